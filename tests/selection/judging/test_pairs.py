"""Modes much closer than their bandwidths: both are listed where the data can part them, and one stands for a cluster where they cannot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.checks import IntArray
from tests.selection.judging.hard import frequency_response, impulse_response
from tests.selection.judging.pairs import apart_in_deviations, both_found, listed_in_pair, structure_with_pair

KINDS: dict[str, Callable[..., Any]] = {"lines": frequency_response, "samples": impulse_response}

#: Half bandwidths between the two, and whether they have one shape.
APART = {"unlike": (0.3, 1.0, False), "near": (0.1, 0.3, False), "alike": (1.0, 1.0, True)}

#: Two are asked for where their distance exceeds so many deviations of it.
PARTED = 6.0


def judged(kind: str, apart: str, decibel: float, seeds: range) -> IntArray:
    """Return how many pairs data can part, how many of these are listed as two (refined), and pairs of which nothing is listed."""
    low, high, alike = APART[apart]
    counts = np.zeros(3, int)
    for seed in seeds:
        structure = structure_with_pair(seed, low, high, inputs=1 + seed % 2, alike=alike)
        response, sigma = KINDS[kind](structure, decibel, seed)
        modes = ms.select(ms.stabilize(response))
        parted = apart_in_deviations(structure, response, sigma) > PARTED
        both = parted and both_found(structure, ms.refine(response, modes))
        counts += [parted, both, not listed_in_pair(structure, modes)]
    return counts


@pytest.mark.slow
@pytest.mark.parametrize("apart", list(APART))
def test_pairs_that_data_can_part_are_listed_as_two(apart):
    able, both, none = judged("samples", apart, 20, range(106, 109))
    assert both == able
    assert none == 0


@pytest.mark.slow
def test_a_pair_of_one_shape_is_found_though_its_residual_shows_no_peak():
    # one pole in the place of two leaves errors of second order in their distance
    able, both, _ = judged("lines", "alike", 20, range(103, 104))
    assert able == both == 1


@pytest.mark.study("selection")
@pytest.mark.parametrize("decibel", [40, 20])
@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("apart", list(APART))
def test_study_of_pairs(apart, kind, decibel, study):
    """Seeds that nothing was developed on."""
    able, both, none = judged(kind, apart, decibel, range(600, 624))
    low, high, alike = APART[apart]
    distance = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    name = f"pair {distance} half bandwidths apart, {'one shape' if alike else 'two shapes'}, {kind}, {decibel} dB"
    found = study(name, "24 structures, seeds 600 to 623")
    found.row(f"listed as two, of those more than {PARTED:g} standard deviations apart", f"{both} of {able}")
    found.row("the same, share", 100 * both / able if able else 100, least=90, unit=" %")
    found.row("pairs of which nothing is listed", none, most=0)
    assert not found.missed
