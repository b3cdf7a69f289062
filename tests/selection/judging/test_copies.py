"""Resonances that shift between rows or columns are listed once, pairs twice, whichever way round the test is."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.selection.judging.copies import _MAX_COLUMNS, _MAX_ROWS, _Cluster, _Point, clusters_of, copies_of
from modalscope.selection.judging.recount import Recount, recount_of
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.likelihood.descent import descend
from modalscope.selection.likelihood.information import residual, residual_of
from modalscope.selection.likelihood.likelihood import unit_vectors, whitened
from modalscope.systems import chain5
from tests.selection.judging.ablation import CASES, faults_of
from tests.selection.judging.made import NUDGE
from tests.selection.judging.shifted import KINDS, missed_and_false, shifted_response, shifted_structure
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
def test_a_mode_that_shifts_is_not_weighed_beside_its_own_copies() -> None:
    """Of two of ten such tests a mode was "found at too few orders": its copies had taken what it explains."""
    _, missed, false = judged("rows, smooth errors", range(80005, 80008))
    assert missed == 0
    assert false <= 1  # two in sixty tests of this kind list a false mode


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "pair", "rows and columns, pair"])
def test_a_few_shifted_structures_are_listed_as_they_are(kind: str) -> None:
    """Nine lists in ten are perfect; the study counts them, of every kind. Other kinds are those of the tests above."""
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


#: Poles, rad/s: a mode, and what shares its place; and lines around them.
POLE, GRID = complex(-2.0, 400.0), np.linspace(50, 80, 901)


def recounted(
    made: ComplexArray,
    poles: ComplexArray,
    *,
    noise: float = 1e-3,
    coloured: bool = True,
    part: RealArray | None = None,
) -> Recount:
    """Return the recount of poles in responses (F, q, p) with white noise, relative to their largest value.

    `part` (p,): participation of all poles, which then stay as they are.
    """
    rng = np.random.default_rng(1)
    errors = rng.standard_normal((2, *made.shape)) * noise * np.abs(made).max()
    response = ms.FrequencyResponse(values=made + errors[0] + 1j * errors[1], frequencies=GRID, quantity="displacement")
    ones = np.ones(made.shape[1]), np.ones(made.shape[2])
    problem = whitened(response, np.zeros(0, complex), response.outside_powers, np.ones(2 * len(GRID)), *ones)
    selection = SelectionProblem(problem, 1.0, 100.0, response.span, coloured=coloured)
    sides = rng.standard_normal((len(poles), problem.data.shape[2])) if part is None else np.tile(part, (len(poles), 1))
    most = 20 if part is None else 0
    return recount_of(selection, descend(problem, np.asarray(poles), unit_vectors(sides.astype(complex)), most=most))


def shifting(
    shape: RealArray, part: RealArray, by_row: RealArray, by_column: RealArray, s: complex = POLE
) -> ComplexArray:
    """Return u_i v_j / (x - s - a_i - b_j) on the lines, shifts in half bandwidths, with its mirror image."""
    poles = s + 1j * abs(s.real) * (by_row[:, None] + by_column)
    x = 2j * np.pi * GRID[:, None, None]
    return np.outer(shape, part) * (1 / (x - poles) - 1 / (x - poles.conj()))


def random_sides(seed: int, q: int = 6, p: int = 3) -> tuple[RealArray, RealArray]:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(q), rng.standard_normal(p)


def split(_: ComplexArray | complex) -> ComplexArray:
    """Return two poles that a fit gives a shifting mode."""
    return POLE + 1j * abs(POLE.real) * np.array([-0.4, 0.4])


#: Scatters of a test with no other mode.
ALONE = np.ones((1, 2, 2))


def of_pair(recount: Recount) -> tuple[int, float]:
    """Return how many modes the only cluster has, and what one that shifts explains of it."""
    (which,) = clusters_of(recount.descent.point.poles)
    cluster = _Cluster(recount, which)
    found = cluster.modes(recount.bar, ALONE)
    one, shared = cluster.fitted(cluster._best), cluster.fitted(recount.descent.point.poles[which][:, None, None])
    return len(found.poles), (one.misfit - cluster.as_one().misfit) / (one.misfit - shared.misfit)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("way", ["row", "column", "both"])
def test_one_mode_that_shifts_explains_what_two_poles_do(way: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    (u, v), (a, b) = random_sides(seed), (0.3 * rng.standard_normal(n) for n in (6, 3))
    made = shifting(u, v, a * (way != "column"), b * (way != "row"))
    count, share = of_pair(recounted(made, split(made)))
    assert count == 1
    assert share > 0.97


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("apart", [0.7, 1.5])
def test_no_mode_that_shifts_explains_what_a_pair_does(apart: float, seed: int) -> None:
    (u, v), (w, z), none = random_sides(seed), random_sides(seed + 10), (np.zeros(6), np.zeros(3))
    other = POLE + 1j * apart * abs(POLE.real)
    made = shifting(u, v, *none) + shifting(w, z, *none, other)
    count, share = of_pair(recounted(made, np.array([POLE, other])))
    assert count == 2
    assert share < 0.9


def test_repeated_modes_are_two_and_a_mode_split_at_one_frequency_is_one() -> None:
    """A single pole of any residue explains both: shapes decide."""
    (u, v), (w, z), none = random_sides(0), random_sides(10), (np.zeros(6), np.zeros(3))
    made = shifting(u, v, *none) + shifting(w, z, *none)
    recount = recounted(made, np.array([POLE, POLE + 0.01j]), noise=0.05)
    (which,) = clusters_of(recount.descent.point.poles)
    assert len(_Cluster(recount, which).modes(recount.bar, ALONE).poles) == 2
    found = copies_of(recount)
    assert found is not None
    assert found.repeated.all()
    assert found.host.tolist() == [0, 1]
    alone = recounted(shifting(u, v, *none), np.array([POLE, POLE + 0.01j]), noise=0.05, part=v)
    assert len(_Cluster(alone, which).modes(alone.bar, ALONE).poles) == 1
    one = copies_of(alone)
    assert one is not None
    assert not one.repeated.any()


@pytest.mark.slow
def test_repeated_modes_in_coloured_errors_are_both_listed() -> None:
    """With free residues either explains what both do, so that neither is significant beside the other."""
    case = CASES["repeated modes, coloured"](75007)
    assert faults_of(case.poles, ms.select(ms.stabilize(case.data))) == 0


@pytest.mark.parametrize("place", [0.01, 0.5, 0.99])
def test_poles_much_narrower_than_a_line_have_forty_lines_around_them(place: float) -> None:
    (u, v), none = random_sides(0), (np.zeros(6), np.zeros(3))
    s = complex(-1e-4, 2 * np.pi * np.quantile(GRID, place))
    recount = recounted(shifting(u, v, *none), np.array([s, s + 1e-5j]), part=v)
    lines = _Cluster(recount, np.array([0, 1])).lines
    assert lines.stop - lines.start == 40
    at = int(np.searchsorted(GRID, s.imag / (2 * np.pi)))
    assert abs((lines.start + lines.stop) // 2 - np.clip(at, 20, len(GRID) - 20)) <= 1


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("q", "p"), [(4, 4), (6, 3)])
def test_three_modes_that_overlap_are_not_two_that_shift(q: int, p: int, seed: int) -> None:
    """One pole is far from explaining three, so that a part of what it lacks is no measure of two; and other modes stay in their places."""
    rng, none = np.random.default_rng(seed), (np.zeros(q), np.zeros(p))
    poles = POLE + 1j * abs(POLE.real) * np.array([0, 1.4, 1.95, -12, 12])
    made = sum(shifting(rng.standard_normal(q), rng.standard_normal(p), *none, s) for s in poles)
    assert hosts_near(recounted(np.asarray(made), poles)) == 3
    # where all modes shift, two that do explain three poles
    by_row, two = 0.25 * rng.standard_normal(q), poles[[0, 2, 3, 4]]
    made = sum(shifting(rng.standard_normal(q), rng.standard_normal(p), by_row, none[1], s) for s in two)
    assert hosts_near(recounted(np.asarray(made), poles)) == 2


def hosts_near(recount: Recount) -> int:
    """Return how many modes stand within five half bandwidths."""
    found = copies_of(recount)
    assert found is not None
    near = np.abs(recount.descent.point.poles - POLE) < 5 * abs(POLE.real)
    return len(set(found.host[near].tolist()))


def test_shifts_of_several_modes_have_their_price() -> None:
    """Two modes that shift explain three still ones nearly, by shifts that no other mode of the test has."""
    rng, none, half = np.random.default_rng(50), (np.zeros(6), np.zeros(3)), abs(POLE.real)
    poles = POLE + 1j * half * np.array([0, 1.4, 1.95, -12, -8, 12, 20])
    made = sum(shifting(rng.standard_normal(6), rng.standard_normal(3), *none, s) for s in poles)
    recount = recounted(np.asarray(made), poles)
    assert hosts_near(recount) == 3
    # the price of shifts d_ij = a_i + b_j is that of the shortest a and b, where steps have come to their end
    cluster = _Cluster(recount, np.array([0, 1, 2]))
    found = cluster._centred(poles[[0, 2]], np.array([0.0, 0.1]))
    apart = (found.fit.poles - found.poles[:, None, None]).reshape(2, -1).T
    incidence = np.hstack([np.repeat(np.eye(6), 3, axis=0), np.tile(np.eye(3), (6, 1))])
    shortest = np.linalg.lstsq(incidence, apart, rcond=None)[0]
    price = np.sum(np.abs(shortest) ** 2) / (0.1 * half) ** 2
    assert found.cost - found.fit.misfit == pytest.approx(price, rel=0.05)
    assert price > 1


def test_of_a_pair_seen_by_one_sensor_a_mode_that_shifts_by_row_says_which_it_is() -> None:
    (u, _), (w, _), one = random_sides(3, 9), random_sides(4, 9), np.ones(1)
    other = POLE + 1.5j * abs(POLE.real)
    pair = shifting(u, one, np.zeros(9), np.zeros(1)) + shifting(w, one, np.zeros(9), np.zeros(1), other)
    assert of_pair(recounted(pair, np.array([POLE, other])))[0] == 2
    shifted = shifting(u, one, 0.3 * np.random.default_rng(5).standard_normal(9), np.zeros(1))
    assert of_pair(recounted(shifted, split(shifted)))[0] == 1


def test_of_one_or_two_channels_nothing_is_told() -> None:
    (u, v), none = random_sides(0, 2, 1), (np.zeros(2), np.zeros(1))
    recount = recounted(shifting(u, v, *none), split(POLE))
    assert copies_of(recount) is None


def test_shifts_come_out_as_they_were_made() -> None:
    rng = np.random.default_rng(8)
    (u, v), (a, b) = random_sides(8, 12, 8), (0.1 * rng.standard_normal(12), 0.02 * rng.standard_normal(8))
    made = shifting(u, v, a, b)
    (which,) = clusters_of((recount := recounted(made, split(made), noise=1e-5)).descent.point.poles)
    fit = _Cluster(recount, which).as_one()
    weights = np.outer(u**2, v**2) / np.sum(np.outer(u**2, v**2))
    mean = POLE + 1j * abs(POLE.real) * np.sum(weights * (a[:, None] + b))
    assert abs(fit.means[0] - mean) < 0.02 * abs(POLE.real)  # steps end where they gain next to nothing
    by_row, by_column = (
        np.sqrt(np.sum(w * (e - np.sum(w * e)) ** 2)) * abs(POLE.real) / abs(mean)
        for w, e in ((weights.sum(axis=1), a), (weights.sum(axis=0), b))
    )
    assert fit.shifts() == pytest.approx([by_row, by_column], rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_a_pair_that_shifts_has_the_poles_that_it_shifts_about(seed: int) -> None:
    """Poles that all channels share are biased there, and means of free shifts are loose."""
    rng = np.random.default_rng(seed)
    (u, v), (w, z) = random_sides(seed, 12, 2), random_sides(seed + 10, 12, 2)
    other, shifts, none = POLE + 1.6j * abs(POLE.real), 0.4 * rng.standard_normal(12), np.zeros(2)
    made = shifting(u, v, shifts, none) + shifting(w, z, shifts, none, other)
    start = np.array([POLE, other, POLE + 0.6j * abs(POLE.real)])
    recount = recounted(made, start)
    (which,) = clusters_of(recount.descent.point.poles)
    cluster, half = _Cluster(recount, which), abs(POLE.real)
    centred = cluster._centred(np.array([POLE, other]), 0.4 * np.array([half / abs(POLE), 1.0])).poles
    shared = cluster.fitted(np.array([POLE, other])[:, None, None]).poles[:, 0, 0]
    true = np.array([POLE, other]) + 1j * half * shifts.mean()
    errors = [np.abs(each[np.argsort(each.imag)] - true).max() / half for each in (centred, shared)]
    assert errors[0] < 0.15
    assert errors[0] < errors[1]


@pytest.mark.parametrize(
    ("scatters", "noise", "count"),
    [
        ((1 - NUDGE, 1 - NUDGE), (0.0, 0.0), 2),  # of the limit, relative to the frequency and in half bandwidths
        ((1 + NUDGE, 1 - NUDGE), (0.0, 0.0), 1),
        ((1 - NUDGE, 1 + NUDGE), (0.0, 0.0), 1),
        ((1 + NUDGE, 1 + NUDGE), (0.5, 0.5), 2),  # what noise gives of it is none of a shift
        ((0.0, 0.0), (5 - NUDGE, 5 - NUDGE), 2),
        ((0.0, 0.0), (5 + NUDGE, 5 - NUDGE), 2),  # one scale where it would show as much decides
        ((0.0, 0.0), (5 + NUDGE, 5 + NUDGE), 1),  # it would not show as much
    ],
)
def test_a_mode_that_scatters_more_than_five_times_the_others_is_a_pair(
    scatters: tuple[float, float], noise: tuple[float, float], count: int
) -> None:
    (u, v), a = random_sides(2), 0.3 * np.random.default_rng(2).standard_normal(6)
    made = shifting(u, v, a, np.zeros(3))
    recount = recounted(made, split(made))
    (which,) = clusters_of(recount.descent.point.poles)
    cluster = _Cluster(recount, which)
    limit = cluster.as_one().scatter(0) / 5
    told = np.array([ALONE[0], [limit * scatters, limit * noise]])
    assert len(cluster.modes(recount.bar, told).poles) == count


def test_what_noise_makes_of_a_scatter_is_told() -> None:
    """A mode that stays in its place, in loud noise: its rows scatter as they should by chance."""
    u, v = np.ones(40), np.ones(1)
    recount = recounted(shifting(u, v, np.zeros(40), np.zeros(1)), np.array([POLE]), noise=0.05)
    (scatter, noise) = _Cluster(recount, np.array([0])).scattered()
    assert scatter == pytest.approx(noise, rel=0.25)


def test_steps_of_shifts_by_row_and_by_column_lower_the_misfit_as_their_linear_model_says() -> None:
    """Second route: the slope of the misfit by differences."""
    rng = np.random.default_rng(4)
    (u, v), (a, b) = random_sides(4), (0.3 * rng.standard_normal(n) for n in (6, 3))
    recount = recounted(shifting(u, v, a, b), split(POLE))
    (which,) = clusters_of(recount.descent.point.poles)
    cluster = _Cluster(recount, which)
    s = np.full((1, *cluster.channels), POLE)
    at, step = cluster._at(s, slopes=True), 1e-5 * (rng.standard_normal(s.shape) + 1j * rng.standard_normal(s.shape))
    parts = np.stack([step.real, step.imag], axis=-1).reshape(-1, 2)
    rise = (cluster._at(s + step).left - cluster._at(s - step).left) / 2
    assert rise == pytest.approx(-2 * np.sum(at.slope * parts, axis=1), rel=1e-4, abs=1e-6 * np.abs(rise).max())


def test_the_residual_of_some_channels_is_that_of_all_there() -> None:
    (u, v), none = random_sides(0), (np.zeros(6), np.zeros(3))
    descent = recounted(shifting(u, v, *none), np.array([POLE, POLE + 3j])).descent
    some = np.array([[0], [2], [5]]), np.array([1, 2])
    whole = residual(descent.point, descent.fitted)
    found = residual_of(descent.point, descent.fitted, some)
    assert np.allclose(found, whole[:, *some], rtol=0, atol=1e-12 * np.abs(descent.point.problem.rows).max())


def test_rows_and_columns_are_solved_as_the_whole_system_is() -> None:
    rng = np.random.default_rng(6)
    made = object.__new__(_Cluster)
    made.channels = (4, 3)
    J, r = rng.standard_normal((12, 9, 4)), rng.standard_normal((12, 9))
    at = _Point(np.ones(12), np.ones((12, 2)) + 0j, J.transpose(0, 2, 1) @ J, np.einsum("cki,ck->ci", J, r))
    incidence = np.hstack([np.repeat(np.eye(4), 3, axis=0), np.tile(np.eye(3), (4, 1))])
    N = np.einsum("cu,cv,cij->uivj", incidence, incidence, at.information).reshape(28, 28)
    b = np.einsum("cu,ci->ui", incidence, at.slope).reshape(28)
    whole = np.linalg.solve(N + 0.01 * np.diag(np.diag(N)), b).reshape(7, 4)
    steps = (whole[:, ::2] + 1j * whole[:, 1::2]).T
    assert np.allclose(made._step(at, "both", 0.01), steps[:, :4, None] + steps[:, None, 4:], rtol=1e-6)


@pytest.mark.parametrize("more", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_of_more_rows_and_columns_than_are_examined_those_strongest_beside_their_noise_are(
    more: tuple[int, int],
) -> None:
    """The last but one of each is half as strong, or as strong in noise three times as large."""
    q, p = _MAX_ROWS + more[0], _MAX_COLUMNS + more[1]
    u, v = np.ones(q), np.ones(p)
    v[-2] = 0.5
    made = shifting(u, v, np.zeros(q), np.zeros(p))
    errors = np.random.default_rng(3).standard_normal((2, len(GRID), p)) * 3e-3 * np.abs(made).max()
    made[:, -2] += errors[0] + 1j * errors[1]
    recount = recounted(made, np.array([POLE]))
    cluster = _Cluster(recount, np.array([0]))
    variance = np.add.reduceat(recount.errors.on(cluster.lines).variance, cluster.starts, axis=0)
    variance /= cluster.sizes[:, None, None]
    for axis in np.flatnonzero(more) + 1:
        variance = np.delete(variance, -2, axis=axis)
    assert cluster.channels == (_MAX_ROWS, _MAX_COLUMNS)
    weights = np.tile(np.sqrt(2 / variance), (2, 1, 1)).reshape(-1, _MAX_ROWS * _MAX_COLUMNS).T
    assert np.allclose(cluster.weights, weights, rtol=1e-12, atol=0)


@pytest.mark.parametrize("scale", [0.01, 0.3])
def test_lines_far_from_all_poles_tell_added_up_what_they_tell_alone(
    scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What poles leave differs by less than what errors decide; so do the poles of a mode that shifts."""
    (u, v), a = random_sides(2), scale * np.random.default_rng(2).standard_normal(6)
    recount = recounted(shifting(u, v, a, np.zeros(3)), np.array([POLE, POLE + 0.3j * POLE.real]))
    fits, lines = [], []
    for most in (64, 1):
        monkeypatch.setattr("modalscope.selection.judging.copies._MAX_LINES_OF_BLOCK", most)
        cluster = _Cluster(recount, np.array([0, 1]))
        lines.append(cluster.data.shape[1] // 2)
        fits.append((cluster.as_one(), cluster.fitted(cluster._best)))
    assert lines[0] < lines[1] / 3
    (one, shared), (one_alone, shared_alone) = fits
    assert np.allclose(one.poles, one_alone.poles, rtol=0, atol=0.02 * abs(POLE.real))
    gained, gained_alone = shared.misfit - one.misfit, shared_alone.misfit - one_alone.misfit
    assert gained == pytest.approx(gained_alone, rel=0.05, abs=10)


@pytest.mark.parametrize(("apart", "count"), [(2 - NUDGE, 1), (2 + NUDGE, 0)])
def test_poles_hang_together_within_twice_the_narrower_half_bandwidth(apart: float, count: int) -> None:
    assert len(clusters_of(np.array([-1 + 100j, -3 + (100 + apart) * 1j]))) == count


@pytest.mark.parametrize("coloured", [True, False])
def test_poles_that_no_mode_explains_alone_keep_their_places(coloured: bool) -> None:
    """Of coloured errors that is known then; of white ones the older rules on uncertain neighbours are asked."""
    (u, v), (w, z), none = random_sides(0), random_sides(10), (np.zeros(6), np.zeros(3))
    other = POLE + 1.5j * abs(POLE.real)
    made = shifting(u, v, *none) + shifting(w, z, *none, other)
    found = copies_of(recounted(made, np.array([POLE, other]), coloured=coloured))
    assert (found is not None) is coloured
    if found is not None:
        assert found.host.tolist() == [0, 1]
        assert found.whys == ("", "")


def test_a_copy_belongs_to_the_nearest_mode_and_says_what_is_explained() -> None:
    (u, v), a = random_sides(2), 0.3 * np.random.default_rng(2).standard_normal(6)
    made = shifting(u, v, a, np.zeros(3))
    found = copies_of(recounted(made, split(made), coloured=False))
    assert found is not None
    assert len(set(found.host.tolist())) == 1
    mode = found.host[0]
    assert abs(found.poles[mode] - POLE) < 0.5 * abs(POLE.real)
    assert re.fullmatch(r"one mode that shifts by 0\.\d+ % explains (9[5-9].*|100) % of all", found.whys[1 - mode])
    assert found.facts(turned=False)["shift_by_output"] > 10 * found.facts(turned=False)["shift_by_input"]
    assert found.facts(turned=True)["shift_by_input"] == found.facts(turned=False)["shift_by_output"]


def test_of_correlations_no_mode_is_a_copy() -> None:
    """Their errors follow the modes: a Loewner row on half spectra told shifts of a structure that has none."""
    record = chain5().simulate(inputs="ambient", samples=6000, sampling_rate=20.0, noise=0.05, seed=4)
    modes = ms.select(ms.stabilize(record, method="loewner", domain="z"))
    assert "shifts" not in [note.kind for note in modes.notes]


def test_two_places_of_a_block_stand_for_its_lines() -> None:
    """Sums over lines that lie far from all poles, under weights that differ from line to line, to a part of 1e-4."""
    made = shifting(*random_sides(0), 0.3 * np.linspace(-1, 1, 6), np.zeros(3))
    recount = recounted(made, split(made))
    (which,) = clusters_of(recount.descent.point.poles)
    cluster = _Cluster(recount, which)
    assert cluster.sizes.max() >= 4
    poles = cluster.poles * (1 + 1e-3j)
    rows = 1 + 0.3 * np.random.default_rng(1).random(len(cluster.problem.rows) // 2)
    cluster.problem = replace(cluster.problem, rows=np.tile(rows, 2))
    cluster.nodes, cluster.shares = cluster._nodes(cluster.problem.light.grid[cluster.lines])
    whole = cluster.problem.light.functions(poles, slopes=True, lines=cluster.lines)
    plain = cluster._added(whole / cluster._inside(cluster.problem.rows)[:, None])
    found = np.hstack(cluster._functions(poles))
    assert np.abs(found - plain).max(axis=0) == pytest.approx(0, abs=1e-4 * np.abs(plain).max())
