"""Resonances that shift between rows or columns are listed once, pairs twice, whichever way round the test is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.judging.copies import _MARGIN, _Cluster, _clusters, _leading, _log_chance, copies_of
from modalscope.judging.recount import Recount, recount_of
from modalscope.judging.selection_problem import SelectionProblem
from modalscope.likelihood.descent import descend
from modalscope.likelihood.likelihood import unit_vectors, whitened
from modalscope.numerics.checks import ComplexArray, IntArray
from modalscope.systems import chain5
from tests.judging.made import NUDGE
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


@pytest.mark.slow
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
    """Nine lists in ten are perfect; the study counts them."""
    perfect, missed, false = judged(kind, range(400, 404))
    assert perfect >= 3
    assert missed <= 1
    assert false <= 4


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


def resonances(shifts: ComplexArray, half: float = 1.0) -> Any:
    """Return a cluster of one pole at 100 rad/s whose channels (q, p) have poles shifted by so much, all as strong."""
    s, x = -half + 100j, 1j * np.linspace(0, 200, 1001)[:, None, None]
    made = object.__new__(_Cluster)
    made.own, made.poles, made.which = 1 / (x - s - shifts), np.array([s]), np.array([0])
    return made


def test_deviations_of_rows_and_columns_leave_across_both_what_their_product_does() -> None:
    rng = np.random.default_rng(4)
    by_row, by_column = 0.05j * rng.standard_normal((40, 1)), 0.02j * rng.standard_normal((1, 30))
    cluster = resonances(by_row + by_column)
    # of forty rows and thirty columns, each shape has one in as many channels
    assert cluster.shifts() == pytest.approx([0.05 / 100, 0.02 / 100], rel=0.2)
    U, V = _leading(cluster.own, 1)
    E = np.sum(np.abs(U.conj().T @ cluster.own @ V.conj()) ** 2, axis=0)
    second, _ = cluster._products(1, np.zeros(2), energy=1.0, across=0.0)
    # of 1, 2 B and 2 B^2 the first is what q itself has
    assert E[1:, 1:].sum() / E[0, 0] == pytest.approx(9 / 8 * second / _MARGIN, rel=0.1)
    # rows alone leave nothing
    alone = resonances(by_row + np.zeros((1, 30)))
    assert alone._products(1, np.zeros(2), energy=1.0, across=0.0)[0] < 1e-20


@pytest.mark.slow
def test_what_is_across_both_shifts_with_its_column() -> None:
    """Gains that differ from channel to channel, on resonances that shift from column to column."""
    rng = np.random.default_rng(5)
    shifts, gains = 0.02j * rng.standard_normal((1, 30)), 1 + 0.1 * rng.standard_normal((40, 30))
    cluster = resonances(np.zeros((40, 1)) + shifts)
    usual = cluster.deviations(1)
    made = cluster.own * gains
    U, V = (each[:, 1:] for each in _leading(made, 1))
    across = np.einsum("qi,fqp,pj->fij", U.conj(), made, V.conj()).reshape(len(made), -1)
    q = 1 / (1j * np.linspace(0, 200, 1001) - cluster.poles[0])
    q /= np.linalg.norm(q)
    in_q = q.conj() @ across
    beside = np.sum(np.abs(across - np.outer(q, in_q)) ** 2)
    first, _ = cluster._products(1, usual, energy=0.0, across=float(np.sum(np.abs(in_q) ** 2)))
    assert beside == pytest.approx(first / _MARGIN, rel=0.2)


@pytest.mark.parametrize(("apart", "count"), [(2 - NUDGE, 1), (2 + NUDGE, 0)])
def test_poles_hang_together_within_twice_the_narrower_half_bandwidth(apart: float, count: int) -> None:
    assert len(_clusters(np.array([-1 + 100j, -3 + (100 + apart) * 1j]))) == count


@pytest.mark.parametrize(("coloured", "chance"), [(False, 1e-3), (True, 0.05)])
@pytest.mark.parametrize(("times", "evident"), [(1 - NUDGE, True), (1 + NUDGE, False)])
def test_copies_are_evident_where_real_modes_would_hardly_hide_as_well(
    coloured: bool, chance: float, times: float, evident: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    selection, descent, left, errors = settled_pair()
    recount = Recount(replace(selection, coloured=coloured), descent, left, errors)
    monkeypatch.setattr(_Cluster, "parted", lambda *_: (np.array([0]), np.array([1]), np.log(times * chance)))
    found = copies_of(recount)
    assert (found is not None) is evident
    if found is not None:
        assert found.host.tolist() == [0, 0]


def settled_pair() -> Any:
    """Return the parts of a recount of two poles that hang together."""
    response = shifted_response(shifted_structure(1), KINDS["white"], 1)
    structure = shifted_structure(1)
    s = structure.poles[0] * np.array([1, 1 + 1e-3])
    l, m = response.values.shape[1:]
    rows = np.ones(2 * len(response.values))
    prepared = ms.prepare(response, method="era").response
    problem = whitened(prepared, np.zeros(0, complex), prepared.outside_powers, rows, np.ones(l), np.ones(m))
    selection = SelectionProblem(problem, 1.0, 100.0, prepared.span)
    sides = unit_vectors(np.random.default_rng(2).standard_normal((2, problem.data.shape[2])).astype(complex))
    found = recount_of(selection, descend(problem, s, sides, most=0))
    return selection, found.descent, found.left, found.errors


def test_of_correlations_no_mode_is_a_copy() -> None:
    """Their errors follow the modes: a Loewner row on half spectra told shifts of a structure that has none."""
    record = chain5().simulate(inputs="ambient", samples=6000, sampling_rate=20.0, noise=0.05, seed=4)
    modes = ms.select(ms.stabilize(record, method="loewner", domain="z"))
    assert "shifts" not in [note.kind for note in modes.notes]
