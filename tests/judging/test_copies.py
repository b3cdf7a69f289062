"""Resonances that shift between rows or columns are listed once, pairs twice, whichever way round the test is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.judging.copies import _log_chance
from modalscope.numerics.checks import IntArray
from tests.judging.shifted import KINDS, missed_and_false, shifted_response, shifted_structure
from tests.studies import Study


def turned(response: ms.FrequencyResponse) -> ms.FrequencyResponse:
    """Return the same test with inputs and outputs exchanged."""
    values = response.values.transpose(0, 2, 1)
    return ms.FrequencyResponse(values=values, frequencies=response.frequencies, quantity=response.quantity)


def judged(kind: str, seeds: range) -> IntArray:
    """Return how many lists are perfect, how many modes are missed, and how many are false."""
    counts = np.zeros(3, int)
    for seed in seeds:
        structure = shifted_structure(seed, pair=KINDS[kind].pair)
        modes = ms.select(ms.stabilize(shifted_response(structure, KINDS[kind], seed)))
        missed, false = missed_and_false(structure, modes)
        counts += [missed == false == 0, missed, false]
    return counts


@pytest.mark.parametrize("kind", ["rows", "columns, pair"])
def test_a_test_and_its_transpose_list_each_mode_once(kind: str) -> None:
    structure = shifted_structure(0, pair=KINDS[kind].pair)
    response = shifted_response(structure, KINDS[kind], 0)
    lists = [ms.select(ms.stabilize(each, reciprocal=False)) for each in (response, turned(response))]
    assert [missed_and_false(structure, modes) for modes in lists] == [(0, 0), (0, 0)]
    told = [note.numbers for modes in lists for note in modes.notes if note.kind == "shifts"]
    large, small = ("by_output", "by_input") if KINDS[kind].rows else ("by_input", "by_output")
    assert told[0][large] == pytest.approx(told[1][small], rel=0.3)
    assert told[0][large] > 20 * told[0][small]
    assert told[1][small] > 20 * told[1][large]


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(KINDS))
def test_a_few_shifted_structures_are_listed_as_they_are(kind: str) -> None:
    assert judged(kind, range(4)).tolist() == [4, 0, 0]


@pytest.mark.study("selection")
@pytest.mark.parametrize("kind", list(KINDS))
def test_study_of_shifted_structures(kind: str, study: Callable[[str, str], Study]) -> None:
    """Seeds that nothing was developed on."""
    perfect, _, false = judged(kind, range(60000, 60200))
    found = study(f"shifted resonances: {kind}", "200 structures, seeds 60000 to 60199")
    found.row("perfect lists", perfect, least=190)
    found.row("false modes", false, most=12)
    assert not found.missed


def test_the_chance_to_hide_is_that_of_random_vectors() -> None:
    """By drawing: the part across another of a real shape of four and a participation of three."""
    rng, count = np.random.default_rng(0), 40_000

    def across(n: int) -> Any:
        vectors = rng.standard_normal((count, n))
        return 1 - vectors[:, 0] ** 2 / np.sum(vectors**2, axis=1)

    share = across(4) * across(3)
    for limit in (0.03, 0.3):
        assert np.exp(_log_chance(limit, 4, 3)) == pytest.approx(np.mean(share < limit), rel=0.06)
