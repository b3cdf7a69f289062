"""Published tables recomputed by the installation itself."""

from __future__ import annotations

from dataclasses import replace

import modalscope as ms
from modalscope.analysis.checking.selfcheck import Value


def test_every_published_value_is_reproduced():
    found = ms.selfcheck()
    assert len(found.values) == 45
    assert found.passed
    assert found.table().endswith("45 of 45 published values reproduced")


def test_a_value_that_rounds_to_another_number_differs():
    value = Value("t", "s", "f Hz", 1, 1.23, 1.2349, 2)
    assert value.same
    assert not replace(value, computed=1.2353).same
