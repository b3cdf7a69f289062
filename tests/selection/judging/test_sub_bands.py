"""A band of its own out of a test of many modes: its modes, whatever lies outside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.checks import IntArray
from tests.selection.judging.sub_bands import sub_band
from tests.studies import Study


def judged(seeds: range, decibel: float, *, coloured: bool = False) -> IntArray:
    """Return how many lists hold all modes of the band above ten deviations and nothing else, such modes, missed ones, and false ones."""
    counts = np.zeros(4, int)
    for seed in seeds:
        case = sub_band(seed, decibel, coloured=coloured)
        found, spurious = case.scored(ms.select(ms.stabilize(case.response, band=case.band)))
        counts += [found.all() and not spurious, found.size, np.sum(~found), spurious]
    return counts


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 9, 1015, 1089])
def test_modes_of_a_band_are_found_beside_the_skirts_of_those_outside(seed: int) -> None:
    # with the residual terms alone two of two and one of four were lost in the first two; in the others one, where these poles are noise
    assert judged(range(seed, seed + 1), 40)[[0, 2, 3]].tolist() == [1, 0, 0]


@pytest.mark.slow
def test_coloured_errors_of_few_lines_are_not_white_for_the_poles_that_skirts_need() -> None:
    # a rich model and all out-of-band poles beside it leave nothing that is coloured, and two and three poles of errors were listed
    assert judged(range(1002, 1003), 40, coloured=True)[[0, 2, 3]].tolist() == [1, 0, 0]
    assert judged(range(1022, 1023), 40, coloured=True)[[0, 2, 3]].tolist() == [1, 0, 0]


@pytest.mark.study("bands")
@pytest.mark.parametrize(
    ("decibel", "coloured", "least", "most"), [(40, False, 97, 1), (20, False, 95, 1), (40, True, 80, 8)]
)
def test_study_of_bands_within_wide_ones(
    decibel: float, coloured: bool, least: int, most: int, study: Callable[[str, str], Study]
) -> None:
    """Seeds that nothing was developed on."""
    perfect, strong, missed, spurious = judged(range(50000, 50100), decibel, coloured=coloured)
    kind = "coloured" if coloured else "white"
    found = study(f"part of a band, {kind} errors, {decibel} dB", "100 structures, seeds 50000 to 50099")
    found.row("lists with all modes of significance 10, no others", perfect, least=least)
    found.row("missed modes of significance 10", f"{missed} of {strong}")
    found.row("false modes", spurious, most=most)
    assert not found.missed
