"""Roving tests: modes that shift from point to point are listed once, and close pairs as two."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from tests.selection.judging.roving import counted, roving
from tests.studies import Study
from tests.support import stored_list


@pytest.mark.slow
def test_a_roving_test_lists_its_modes_once_and_pairs_as_two() -> None:
    test = roving(55)
    assert counted(test, ms.select(ms.stabilize(test.response, reciprocal=False))).perfect


def test_the_stored_roving_test_has_its_pair() -> None:
    """384.66 Hz was "a duplicate" of a mixture of both."""
    found = stored_list("roving_pair")
    assert len(found["f"]) == 15
    for f, zeta in ((384.66, 0.00800), (390.81, 0.00857)):
        k = int(np.argmin(np.abs(np.array(found["f"]) - f)))
        assert abs(found["f"][k] - f) < 0.05
        assert found["zeta"][k] == pytest.approx(zeta, rel=0.02)


@pytest.mark.study("selection")
@pytest.mark.parametrize("sensors", [1, 2, 3])
def test_study_of_roving_tests(sensors: int, study: Callable[[str, str], Study]) -> None:
    """Seeds that nothing was developed on."""
    each = []
    for seed in range(70000, 70040):
        test = roving(seed, sensors)
        each.append(counted(test, ms.select(ms.stabilize(test.response, reciprocal=False))))
    found = study(f"roving hammer, {sensors} accelerometers", "40 tests, seeds 70000 to 70039")
    found.row("perfect lists", sum(one.perfect for one in each), least=36)
    found.row("modes found", f"{sum(one.found for one in each)} of {sum(one.modes for one in each)}")
    found.row("false modes", sum(one.false for one in each), most=2)
    found.row("modes listed twice", sum(one.twice for one in each), most=2)
    found.row("pairs as two", sum(one.pair is True for one in each), least=18)
    assert not found.missed
