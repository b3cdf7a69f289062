"""Hard random structures whose errors are no white noise: lists that hold what stands out of all errors, and nothing else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.checks import IntArray
from tests.judging.coloured import coloured_gains, coloured_response
from tests.judging.hard import random_structure, score
from tests.studies import Study


def judged(seeds: range) -> IntArray:
    """Return how many lists hold all modes above 10 and above 30 deviations and nothing else, and how many modes are none."""
    counts = np.zeros(3, int)
    for seed in seeds:
        structure = random_structure(seed)
        own = coloured_gains(structure)
        found = score(structure, ms.select(ms.stabilize(coloured_response(structure, seed))))
        counts += [found.perfect(own > 10), found.perfect(own > 30), found.spurious]
    return counts


@pytest.mark.slow
def test_lists_of_structures_with_coloured_errors_are_complete_above_thirty_deviations_and_have_nothing_else() -> None:
    # of the second set the pole that stands for a shifting resonance is open by half a bandwidth beside its own part
    assert judged(range(20042, 20043)).tolist()[1:] == [1, 0]
    assert judged(range(20003, 20005)).tolist()[1:] == [2, 0]


@pytest.mark.slow
def test_a_narrow_mode_that_few_orders_show_is_found_where_it_is() -> None:
    # 1.45 lines at half its power, 20 deviations: nine orders put it a decay rate off
    assert judged(range(80006, 80007)).tolist() == [1, 1, 0]


@pytest.mark.slow
def test_skirts_do_not_hide_errors_that_they_do_not_make_white() -> None:
    # beside three out-of-band poles nineteen poles, many without damping, followed all errors to the noise
    assert judged(range(40068, 40069)).tolist() == [1, 1, 0]


@pytest.mark.study("selection")
def test_study_of_structures_with_coloured_errors(study: Callable[[str, str], Study]) -> None:
    """Seeds that nothing was developed on; shares of 200 are known to 2 and 1 %."""
    above10, above30, spurious = judged(range(40000, 40200))
    found = study("hard random structures, coloured errors", "200 structures, seeds 40000 to 40199")
    found.row("lists with all modes of significance 10, no others", above10, least=190)
    found.row("lists with all modes of significance 30, no others", above30, least=197)
    found.row("false modes", spurious, most=4)
    assert not found.missed
