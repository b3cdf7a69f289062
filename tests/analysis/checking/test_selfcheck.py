"""Published tables recomputed by the installation itself."""

from __future__ import annotations

from dataclasses import replace

from modalscope.analysis.checking.selfcheck import Value, recomputed


def test_every_published_value_is_reproduced():
    found = recomputed()
    assert len(found) == 45
    assert all(value.same for value in found)


def test_a_value_that_rounds_to_another_number_differs():
    value = Value("t", "s", "f Hz", 1, 1.23, 1.2349, 2)
    assert value.same
    assert not replace(value, computed=1.2353).same
