"""Poles that contend for the data: what each explains, what is missed and what is too much, and when two are one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modalscope.data import FrequencyResponse
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging import joint_selection
from modalscope.selection.judging.joint_selection import (
    State,
    _completed_in_coloured_errors,
    _doubtful,
    _excess,
    _with_significant_peaks,
    channel_noise_factors,
    gains_in_residual,
    pruned,
    select_jointly,
    significant_peaks,
)
from modalscope.selection.judging.recount import recount_of
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.judging.tracking import ONE_SHAPE, collinear
from modalscope.selection.likelihood.covariance import deviations_of_poles, pole_blocks
from modalscope.selection.likelihood.descent import descend
from modalscope.selection.likelihood.information import inverse, normal
from modalscope.selection.likelihood.likelihood import Whitened, whitened
from modalscope.selection.likelihood.whitening import search_bound
from tests.selection.judging.made import NUDGE, at_angle

F = np.linspace(5, 25, 400)
NOISE = 0.002
POLES = poles_from(np.array([9.0, 12.0, 12.5, 18.0]), np.array([0.01, 0.008, 0.01, 0.012]))
rng = np.random.default_rng(4)
SHAPES, PARTS = rng.standard_normal((3, 4)), rng.standard_normal((4, 2))


def made(modes: list[tuple[np.ndarray, complex]], noise: float, seed: int) -> FrequencyResponse:
    """Return responses of residues and poles, by the plain definition, with white noise of this deviation of a real row."""
    x = 2j * np.pi * F[:, None, None]
    H = np.zeros((F.size, 3, 2), complex)
    for R, s in modes:
        H += R / (x - s) + R / (x - np.conj(s))
    own = np.random.default_rng(seed)
    H = H + noise * (own.standard_normal(H.shape) + 1j * own.standard_normal(H.shape))
    return FrequencyResponse(values=H, frequencies=F)


def data(which: tuple[int, ...] = (0, 1, 2, 3), noise: float = NOISE, seed: int = 0) -> FrequencyResponse:
    """Return responses of some of the modes."""
    return made([(np.outer(SHAPES[:, j], PARTS[j]), POLES[j]) for j in which], noise, seed)


def problem_of(response: FrequencyResponse, noise: float = NOISE, *, swift: bool = False) -> Whitened:
    rows = np.ones(2 * F.size)
    return whitened(response, np.zeros(0), (0,), rows, np.full(3, noise), np.ones(2), swift=swift)


def selection_of(response: FrequencyResponse, **how: object) -> SelectionProblem:
    made = SelectionProblem(problem_of(response), 1.0, search_bound(3, 2, 2 * F.size), (5.0, 25.0))
    return replace(made, **how)  # type: ignore[arg-type]


def ends(selection: SelectionProblem, start: list[int], **how: bool) -> np.ndarray:
    found = select_jointly(selection, POLES[start], PARTS[start].astype(complex), **how)
    assert found is not None
    return np.sort_complex(found.poles)


def close(found: np.ndarray, truth: np.ndarray) -> bool:
    """Within a tenth of a decay rate: gains here are of hundreds of deviations."""
    return found.size == truth.size and bool(np.all(np.abs(found - np.sort_complex(truth)) < -0.1 * truth.real.max()))


def test_the_bound_is_that_of_the_largest_singular_value_over_all_positions() -> None:
    # sqrt 3 + sqrt 2 + sqrt ln(400 / 1e-3), squared, twice
    assert search_bound(3, 2, 800) == pytest.approx(2 * (3**0.5 + 2**0.5 + np.log(4e5) ** 0.5) ** 2)
    assert search_bound(2, 3, 800) == search_bound(3, 2, 800)


def test_what_noise_explains_at_its_best_place_stays_below_the_bound() -> None:
    for seed in range(5):
        selection = selection_of(data((), seed=seed))
        assert ends(selection, []).size == 0


@pytest.mark.parametrize("seed", range(4))
def test_two_of_one_shape_are_parted_though_one_in_their_place_leaves_no_peak(seed: int) -> None:
    """What one pole leaves of two is of second order in their distance: both together tell it from noise, not the peak that it makes."""
    noise, R, apart = 0.06, np.outer(SHAPES[:, 0], PARTS[0]), -0.5j * POLES[0].real
    response = made([(R, POLES[0] - apart), (R, POLES[0] + apart)], noise, seed)
    selection = SelectionProblem(problem_of(response, noise), 1.0, search_bound(3, 2, 2 * F.size), (5.0, 25.0))
    found = select_jointly(selection, POLES[[0]], PARTS[[0]].astype(complex))
    assert found is not None
    assert found.poles.size == 2


@pytest.mark.slow
def test_noise_of_one_channel_that_is_louder_than_its_levels_makes_no_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    arenas = []
    for seed in range(3):
        response, loud = data((), seed=seed), data((), noise=3 * NOISE, seed=seed + 50)
        values = response.values.copy()
        values[:, 1, 0] = loud.values[:, 1, 0]
        arenas.append(selection_of(replace(response, values=values)))
    assert [ends(selection, []).size for selection in arenas] == [0, 0, 0]
    monkeypatch.setattr(
        "modalscope.selection.judging.joint_selection.channel_noise_factors", lambda state: np.ones(len(state.poles))
    )
    assert all(ends(selection, []).size for selection in arenas)


def test_the_noise_beneath_a_mode_is_that_of_the_channels_it_rests_on() -> None:
    response = data(noise=0)
    own = np.random.default_rng(1)
    size = NOISE * np.array([[1.0, 1.0], [1.0, 6.0], [1.0, 1.0]])
    H = response.values + size * (
        own.standard_normal(response.values.shape) + 1j * own.standard_normal(response.values.shape)
    )
    selection = selection_of(replace(response, values=H), variance=float(np.mean((size / NOISE) ** 2)))
    state = State(descend(selection.problem, POLES, PARTS.astype(complex)), selection.variance, selection)
    left = (size / NOISE) ** 2 / selection.variance
    R = np.abs(np.einsum("oj,ji->joi", SHAPES, PARTS)) ** 2
    expected = np.sum(R * left, axis=(1, 2)) / np.sum(R, axis=(1, 2))
    assert channel_noise_factors(state) == pytest.approx(np.maximum(expected, 1), rel=0.1)


@pytest.mark.parametrize(("part", "computed"), [(1 - NUDGE, True), (1 + NUDGE, False)])
def test_what_rounding_leaves_of_computed_data_has_no_colour(
    part: float, computed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = selection_of(data())
    state = State(descend(problem.problem, POLES[:3], PARTS[:3].astype(complex)), problem.variance, problem)
    left = float(np.sqrt(state.descent.cost / problem.problem.size))
    monkeypatch.setattr(joint_selection, "_ROUNDING_OF_FIT", left / part)
    assert (_excess(state) == 0) is computed


@pytest.mark.parametrize(("gain", "local"), [(4 - NUDGE, True), (4 + NUDGE, False)])
def test_of_a_weak_mode_the_noise_of_the_lines_around_it_counts(gain: float, local: bool) -> None:
    # lines within a hertz of the last mode are three times as loud as all others, in the channels of one input
    loud = np.where((np.abs(F - 18) < 2)[:, None, None] & np.array([[False, True]]), 3.0, 1.0)
    own = np.random.default_rng(1)
    e = own.standard_normal((2, *loud.shape[:1], 3, 2))
    response = data(noise=0)
    problem = selection_of(replace(response, values=response.values + NOISE * loud * (e[0] + 1j * e[1])))
    descent = descend(problem.problem, POLES, PARTS.astype(complex))
    state = State(descent, problem.variance, problem)
    state = replace(state, selection=replace(problem, bar=float(state.gain[3]) / gain))
    share = np.abs(PARTS[3]) ** 2 / np.sum(np.abs(PARTS[3]) ** 2)
    expected = share @ [1, 9] if local else 1.0
    found = channel_noise_factors(state)[3]
    assert found == pytest.approx(expected, rel=0.2) if local else found < 0.6 * (share @ [1, 9])


def test_a_mode_that_no_candidate_shows_is_found_in_what_the_others_leave() -> None:
    assert close(ends(selection_of(data()), [0, 1, 2]), POLES)
    assert close(ends(selection_of(data()), []), POLES)


def test_of_coloured_data_resonances_are_looked_for_and_coherent_lines_are_none() -> None:
    # 18 Hz with 1.2 % spans 8.6 lines, 15 Hz with .4 % 2.4; the lobe of a line under Hann's window three
    x, known = 2j * np.pi * F[:, None, None], data((0, 1))
    for pole, size in ((POLES[3], 0.01), (complex(poles_from(15.0, 0.004)), 0.005)):
        response = replace(known, values=known.values + size / (x - pole) + size / (x - np.conj(pole)))
        assert ends(selection_of(response, coloured=True), [0, 1]).size == 3
    values = known.values.copy()
    values[199:202] += 0.02 * np.array([0.5, 1.0, 0.5])[:, None, None]
    assert ends(selection_of(replace(known, values=values), coloured=True), [0, 1]).size == 2


def test_a_candidate_that_explains_no_more_than_noise_goes() -> None:
    assert close(ends(selection_of(data((0, 1, 3))), [0, 1, 2, 3]), POLES[[0, 1, 3]])


def test_two_candidates_of_one_mode_become_one() -> None:
    start = np.append(POLES, POLES[0] * 1.004)
    found = select_jointly(selection_of(data()), start, np.vstack([PARTS, PARTS[:1]]).astype(complex))
    assert found is not None
    assert close(np.sort_complex(found.poles), POLES)


def test_poles_are_looked_for_in_the_band_and_a_tenth_of_its_ends_around() -> None:
    selection = selection_of(data(), band=(5.0, 18 / 1.1 - NUDGE))
    assert close(ends(selection, [0, 1, 2, 3]), POLES[:3])
    selection = selection_of(data(), band=(5.0, 18 / 1.1 + 0.05))
    assert close(ends(selection, [0, 1, 2, 3]), POLES)


@pytest.mark.slow
def test_the_gain_is_the_rise_of_the_misfit_without_the_mode_and_deviations_are_those_of_repeated_noise() -> None:
    found = [select_jointly(selection_of(data(seed=s)), POLES, PARTS.astype(complex)) for s in range(40)]
    poles = np.array([each.poles for each in found if each is not None])
    told = found[0]
    assert told is not None
    spread = np.std(poles.imag, axis=0) / (2 * np.pi)
    # forty sets know a deviation to 11 %; the frequency is that of Im s but for zeta^2
    assert np.all(np.abs(spread / told.frequency_std - 1) < 0.4)
    selection = selection_of(data())
    whole = descend(selection.problem, told.poles, told.descent.point.sides)
    point = selection.problem.at(np.delete(told.poles, 3), np.delete(told.descent.point.sides, 3, axis=0))
    less = point.cost(point.fitted())
    assert told.gain[3] == pytest.approx((less - whole.cost) / told.variance, rel=1e-3)


def test_what_stays_when_the_weakest_go_is_what_refits_say() -> None:
    problem = problem_of(data((0, 1, 3)))
    sides = PARTS / np.linalg.norm(PARTS, axis=1, keepdims=True)
    fitted = problem.at(POLES, sides.astype(complex), slopes=False).fitted()
    kept, gone = list(range(4)), []
    while len(kept) > 1:  # by refits, the weakest first
        cost = [cost_of(problem, sides, [k for k in kept if k != j]) for j in kept]
        rise = min(cost) - cost_of(problem, sides, kept)
        gone.append((kept.pop(int(np.argmin(cost))), rise))
    for least in [gain * (1 + side * 1e-6) for _, gain in gone for side in (-1, 1)]:
        stay = next((k for k, (_, gain) in enumerate(gone) if gain >= least), len(gone))
        left = {j for j, _ in gone[stay:]} | set(kept)
        if stay < len(gone):
            assert set(pruned(fitted, np.full(4, least))) == left


def cost_of(problem: Whitened, sides: np.ndarray, which: list[int]) -> float:
    point = problem.at(POLES[which], sides[which].astype(complex))
    return point.cost(point.fitted())


def test_what_a_pole_would_explain_beside_the_modes_is_its_own_gain_where_it_is_missing() -> None:
    selection = selection_of(data())
    # nothing is taken up beyond the band
    found = select_jointly(
        replace(selection, coloured=True, band=(5.0, 15.0)), POLES[[0, 1, 2]], PARTS[[0, 1, 2]].astype(complex)
    )
    whole = select_jointly(selection, POLES, PARTS.astype(complex))
    assert found is not None
    assert whole is not None
    gain = gains_in_residual(selection, found, POLES[[3]])[0] * found.variance
    # alone at the true place: less the little that the others have taken up of it
    assert gain == pytest.approx(whole.gain[3] * whole.variance, rel=0.05)


# --------------------------------------------------------------------------------------------------------- two that are one


def pair(apart: float, likeness: float, outputs: int = 2, inputs: int = 2) -> bool:
    """Return whether two poles so many sums of half bandwidths apart act as one."""
    s = poles_from(np.array([10.0, 10.0]), np.array([0.01, 0.02]))
    s = np.array([s[0], s[0].imag * 1j + apart * -(s.real.sum()) * 1j + s[1].real])
    shapes = np.array([[1, 0], at_angle(likeness)], dtype=complex).T if outputs == 2 else np.ones((1, 2), complex)
    return bool(collinear(s, shapes, np.ones((2, inputs), complex))[0, 1])


@pytest.mark.parametrize(("side", "one"), [(-1, True), (1, False)])
def test_poles_that_overlap_are_one_when_their_shapes_are(side: int, one: bool) -> None:
    assert pair(1 + side * NUDGE, 1.0) is one
    assert pair(0.5, ONE_SHAPE - side * NUDGE) is one


@pytest.mark.parametrize(("apart", "one"), [(0.25 - NUDGE, True), (0.25 + NUDGE, False)])
def test_with_one_input_close_poles_are_one_whatever_their_shapes(apart: float, one: bool) -> None:
    assert pair(apart, 0.0, inputs=1) is one
    assert pair(apart, 0.0) is False


# ------------------------------------------------------------------------------------------------------------- doubtful data


def test_data_in_doubt_are_given_up_unless_what_is_left_becomes_white() -> None:
    assert select_jointly(selection_of(data()), POLES[:2], PARTS[:2].astype(complex), doubted=True) is not None
    e = np.random.default_rng(1).standard_normal((2, F.size, 3, 2))
    smooth = np.apply_along_axis(lambda v: np.convolve(v, np.ones(9) / 3, mode="same"), 1, e)
    coloured = replace(data(noise=0.0), values=data(noise=0.0).values + 3 * NOISE * (smooth[0] + 1j * smooth[1]))
    assert select_jointly(selection_of(coloured), POLES, PARTS.astype(complex), doubted=True) is None
    # peaks of coloured errors are above what white noise reaches: of data known to be coloured none is added by that
    assert close(ends(selection_of(coloured, coloured=True, recounted=False), range(4)), POLES)


# -------------------------------------------------------------------------------------------------------------- faster steps


def test_steps_by_products_are_those_by_reflections() -> None:
    sides = (PARTS / np.linalg.norm(PARTS, axis=1, keepdims=True)).astype(complex)
    start = POLES * np.exp(0.002j)
    exact, swift = (descend(problem_of(data(), swift=way), start, sides) for way in (False, True))
    assert swift.cost == pytest.approx(exact.cost, rel=1e-9)
    assert np.allclose(swift.point.poles, exact.point.poles, rtol=1e-9)
    span = swift.point.span
    assert np.allclose(span.T @ span, np.eye(span.shape[1]), atol=1e-5)
    assert np.allclose(swift.fitted.gain, exact.fitted.gain, rtol=1e-6)


@pytest.mark.parametrize("apart", [1e-2, 1e-6])
def test_products_tell_what_a_pole_adds_beside_a_term_close_to_it(apart: float) -> None:
    """Beside a pole that is free in every channel at a part of the frequency: a half bandwidth, and a ten-thousandth of it."""
    sides = (PARTS / np.linalg.norm(PARTS, axis=1, keepdims=True)).astype(complex)
    fixed, rows = POLES[:1] * (1 + apart), np.ones(2 * F.size)
    exact, swift = (
        whitened(data(), fixed, (0,), rows, np.full(3, NOISE), np.ones(2), swift=way).at(POLES, sides)
        for way in (False, True)
    )
    assert swift.cost(swift.fitted()) == pytest.approx(exact.cost(exact.fitted()), rel=1e-9)
    span = swift.span
    assert np.max(np.abs(swift.problem.terms.T @ span)) < 1e-9
    assert np.allclose(span.T @ span, np.eye(span.shape[1]), atol=1e-4)


def test_a_descent_that_is_decided_ends() -> None:
    problem = problem_of(data())
    sides = (PARTS / np.linalg.norm(PARTS, axis=1, keepdims=True)).astype(complex)
    start = POLES * np.exp(0.002j)
    whole = descend(problem, start, sides)
    first = problem.at(start, sides)
    assert descend(problem, start, sides, decisive=2 * first.cost(first.fitted())).iterations == 0
    # far below all that can be reached: where steps promise little there is nothing to hope for
    assert descend(problem, start, sides, decisive=0.0).iterations < whole.iterations
    assert descend(problem, start, sides, decisive=1.01 * whole.cost).cost < 1.01 * whole.cost


def test_of_new_poles_that_share_one_peak_the_one_that_stands_out_most_stays_for_another_round() -> None:
    poles = poles_from(np.array([10.0, 10.1, 12.0, 13.0]), np.full(4, 0.01))
    assert significant_peaks(poles, np.array([0.7, 0.5, 0.6, 1.2])).tolist() == [True, False, False, True]
    assert significant_peaks(poles, np.array([0.7, 1.5, 0.6, 1.2])).tolist() == [False, True, False, True]
    # of three on one peak the other two go at once: what a second one does beside the first shows when that is left
    three = poles_from(np.array([10.0, 10.05, 10.1]), np.full(3, 0.01))
    assert significant_peaks(three, np.array([0.6, 0.7, 0.5])).tolist() == [False, True, False]
    assert significant_peaks(poles[:0], np.zeros(0)).tolist() == []


@pytest.mark.parametrize("coloured", [False, True])
def test_what_cannot_be_a_mode_is_far_outside_the_band_damped_or_narrower_than_a_part_of_a_line(coloured: bool) -> None:
    selection = replace(selection_of(data()), coloured=coloured, band=(10.0, 20.0))
    line = F[1] - F[0]
    limits = [(9.0, 0.01, 1), (22.0, 0.01, -1)]
    for f, zeta, inwards in limits:
        near = poles_from(f * (1 + inwards * np.array([1e-6, -1e-6])), np.full(2, zeta))
        assert selection.possible(near).tolist() == [True, False]
    damped = poles_from(np.full(2, 15.0), 0.9 * (1 + np.array([-1e-6, 1e-6])))
    assert selection.possible(damped).tolist() == [True, False]
    # the bandwidth at half the power is 2 zeta f
    narrow = poles_from(np.full(2, 15.0), 0.1 * line / 30 * (1 + np.array([1e-6, -1e-6])))
    assert selection.possible(narrow).tolist() == [True, not coloured]


def test_a_peak_of_an_earlier_round_goes_when_a_later_one_leaves_it_nothing() -> None:
    selection = selection_of(data((0, 1, 3)), coloured=True)
    two = descend(selection.problem, POLES[:2], PARTS[:2].astype(complex))
    state, before = State(two, selection.variance, selection), recount_of(selection, two)
    # in the first round a peak was added at 15 Hz, where there is nothing; in the second the mode at 18 Hz
    poles = np.append(POLES[:2], [poles_from(15.0, 0.01), POLES[3]])
    sides = PARTS[[0, 1, 2, 3]].astype(complex)
    found = _with_significant_peaks(state, before, (poles, sides), np.array([0, 0, 1, 2]), 2)
    assert found is not None
    assert found[2].tolist() == [0, 0, 2]
    assert close(np.sort_complex(found[0].poles), POLES[[0, 1, 3]])
    # nothing of the last round is left: the state before stands
    assert _with_significant_peaks(state, before, (poles[[0, 1, 3, 2]], sides), np.array([0, 0, 1, 2]), 2) is None
    # so it does where all of them leave during the descent, and not at the test: such a round came again, up to eight times
    gone = np.array([*poles[[0, 1, 3]], poles_from(40.0, 0.01)])  # far outside the band
    assert _with_significant_peaks(state, before, (gone, sides[[0, 1, 3, 2]]), np.array([0, 0, 1, 2]), 2) is None
    # with a pole of the state that was nothing, what its leaving makes of the others is kept; with one that was significant it is not
    outside = np.array([*POLES[:2], *gone[[3, 3]]])
    three = descend(selection.problem, np.append(POLES[:2], gone[3]), PARTS[:3].astype(complex), most=0)
    for held, kept in (
        (recount_of(selection, three), True),
        (SimpleNamespace(relative_gains=lambda which: 2 + which), False),
    ):
        fewer = _with_significant_peaks(
            State(three, selection.variance, selection), held, (outside, sides), np.array([0, 0, 0, 1]), 1
        )
        assert (fewer is not None) is kept


def test_where_no_peak_is_a_mode_the_next_strongest_are_tried_and_after_one_that_is_all_are_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    selection = selection_of(data((0, 1)), coloured=True)
    state = State(descend(selection.problem, POLES[:2], PARTS[:2].astype(complex)), selection.variance, selection)
    grid, tried, searched = poles_from(np.arange(6.0, 34), np.full(28, 0.001)), list[list[float]](), list[int]()

    def peaks(most: int, examined: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        searched.append(len(examined))
        found = grid[~np.isin(grid, examined)][:most]
        return found, np.ones((found.size, 2), complex)

    recount = SimpleNamespace(peaks=peaks)

    def one_mode_in_the_second_round(*given: Any) -> Any:
        (poles, _), rounds, last = given[2:]
        tried.append(np.round(np.abs(poles[-np.count_nonzero(rounds == last) :]) / (2 * np.pi)).tolist())
        return (state, recount, np.zeros(3, int)) if last == 2 else None

    monkeypatch.setattr(joint_selection, "recount_of", lambda *_: recount)
    monkeypatch.setattr(joint_selection, "_with_significant_peaks", one_mode_in_the_second_round)
    _completed_in_coloured_errors(state)
    first, second, third = (list(range(k, k + 6)) for k in (6, 12, 18))
    assert tried == [first, second, first, second, third]  # and after three rounds in vain no more
    assert searched == [0, 6, 0, 6, 12]


def test_below_two_bars_a_mode_that_stands_alone_is_in_doubt() -> None:
    # 10 to 16 Hz with 1 %: far apart; of a bar of 10 gains of 15 and 19 are less than two, 21 and 100 are not
    poles, selection = (
        poles_from(np.array([10.0, 12.0, 14.0, 16.0]), np.full(4, 0.01)),
        SimpleNamespace(bar=10.0, coloured=False),
    )
    gain = np.array([19.0, 100.0, 15.0, 21.0])
    assert _doubtful(SimpleNamespace(poles=poles, gain=gain, selection=selection)) == [2, 0]  # type: ignore[arg-type]


def test_deviations_of_a_mode_for_its_parts_are_those_of_the_model_without_them() -> None:
    found = select_jointly(selection_of(data()), POLES, PARTS.astype(complex))
    assert found is not None
    point, at = found.descent.point, int(np.argmin(np.abs(found.poles - POLES[1])))
    other = int(np.argmin(np.abs(found.poles - POLES[2])))
    kept = np.delete(np.arange(len(found.poles)), other)
    alone = point.problem.at(point.poles[kept], point.sides[kept])
    covariance = found.noise * inverse(normal(alone, alone.fitted())[0])
    n = int(np.flatnonzero(kept == at)[0])
    f, zeta = deviations_of_poles(point.poles[[at]], pole_blocks(covariance, 2 * point.sides.shape[1] * np.array([n])))
    assert found.as_one(at, np.array([other])) == pytest.approx((f[0], zeta[0]), rel=1e-9)
