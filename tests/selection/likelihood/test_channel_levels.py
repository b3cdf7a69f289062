"""Levels of channels that are no product of an output's and an input's: read, fitted with, found again, and given up under model error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging import joint_selection
from modalscope.selection.judging.joint_selection import State, converged, pruned
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.likelihood.descent import Descent, descend
from modalscope.selection.likelihood.information import information_of_channels, inverse, normal, residual, scores
from modalscope.selection.likelihood.likelihood import Fitted, Point, unit_vectors, whitened
from modalscope.selection.likelihood.reference_model import floor_of
from modalscope.selection.likelihood.settling import settle, task_of
from modalscope.selection.likelihood.whitening import Levels, levels_of

F = np.linspace(4, 26, 240)
POLES = poles_from(np.array([8.0, 11.0, 19.0]), np.array([0.01, 0.02, 0.012]))
NONE = np.zeros(0, complex)


def sides(l: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    return rng.standard_normal((l, 3)) + 0j, rng.standard_normal((3, m)) + 0.1j * rng.standard_normal((3, m))


def response(shapes: np.ndarray, participation: np.ndarray, noise: RealArray, seed: int = 0) -> FrequencyResponse:
    x, rng = 2j * np.pi * F[:, None, None], np.random.default_rng(seed)
    R = 40 * np.einsum("on,ni->noi", shapes, participation)
    H = sum(r / (x - s) + r.conj() / (x - s.conj()) for r, s in zip(R, POLES, strict=True))
    e = rng.standard_normal((2, *np.shape(H)))
    return FrequencyResponse(values=H + noise * (e[0] + 1j * e[1]), frequencies=F)


@pytest.mark.parametrize(("factor", "own"), [(1.41, None), (1.42, 2.0)])
def test_levels_are_products_and_to_the_next_power_of_two_beyond_them(factor: float, own: float | None) -> None:
    # log deviations of a corner of 2 x 2 are left by a product as + - - +, a quarter of its own
    one = np.log(factor) * np.array([[1, -1], [-1, 1]])
    d = np.outer([1.0, 3.0], [0.2, 5.0]) * np.exp(one)
    found = levels_of(d, d)
    assert np.allclose(np.outer(found.outputs, found.inputs), np.outer([1.0, 3.0], [0.2, 5.0]))
    if own is None:
        assert found.own is None
        assert found.change(Levels(found.outputs, found.inputs)) == 0
    else:
        assert found.own is not None
        assert found.own.tolist() == [[own, 1 / own], [1 / own, own]]
        assert np.all(np.abs(np.log2(d / found.channels)) <= 0.5 + 1e-12)
        assert found.product.own is None
        assert found.change(found.product) == pytest.approx(np.log(2))


def written_out(point: Point) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return J'J of the projected residual, its gradient and the squared misfit, by differences and least squares of whole matrices."""
    problem, (n, p) = point.problem, point.sides.shape
    weights = problem.weights
    assert weights is not None

    def left(unknown: np.ndarray) -> np.ndarray:
        poles, at = point.moved((unknown[::2] + 1j * unknown[1::2]).reshape(n, p))
        own, _ = problem.columns(poles, slopes=False)  # type: ignore[attr-defined]
        g = own[:, ::2] - 1j * own[:, 1::2]
        rows = []
        for o, each in enumerate(weights):
            columns = np.einsum("kj,ji,i->kij", g, at, each).reshape(-1, n)
            psi = np.stack([columns.real, -columns.imag], axis=2).reshape(len(columns), 2 * n)
            y = problem.data[:, o].reshape(-1)  # type: ignore[attr-defined]
            rows.append(y - psi @ np.linalg.lstsq(psi, y, rcond=None)[0])
        return np.concatenate(rows)

    step = 1e-6 * np.abs(point.poles).max()
    J = np.stack([(left(step * e) - left(-step * e)) / (2 * step) for e in np.eye(2 * n * p)], axis=1)
    return J.T @ J, -J.T @ left(np.zeros(2 * n * p)), np.sum(left(np.zeros(2 * n * p)) ** 2)


@pytest.mark.parametrize(("l", "m"), [(3, 2), (2, 3)])
def test_a_fit_with_weights_is_that_of_matrices_written_out(l: int, m: int) -> None:
    own = np.exp2(np.random.default_rng(1).integers(-2, 3, (l, m)).astype(float))
    shapes, participation = sides(l, m)
    b = unit_vectors(shapes.T if l < m else participation)

    def point_of(noise: float, off: float) -> Point:
        data = response(shapes, participation, noise * own)
        problem = whitened(data, NONE, (0,), np.ones(2 * F.size), np.full(l, 0.3), np.ones(m), own=own)
        return problem.at(POLES * (1 + 1j * off), unit_vectors(b + 10 * off))

    # what the information leaves out is a part of the residual: here there is none
    exact = point_of(0, 0)
    J = written_out(exact)[0]
    assert np.allclose(normal(exact, exact.fitted())[0], J, rtol=1e-4, atol=1e-5 * np.abs(J).max())
    point = point_of(0.3, 2e-4)
    fitted, (_, slope, cost) = point.fitted(), written_out(point)
    information, gradient = normal(point, fitted)
    assert np.allclose(gradient, slope, rtol=1e-3, atol=1e-5 * np.abs(slope).max())
    assert point.cost(fitted) == pytest.approx(cost)
    assert scores(point, fitted).sum(axis=(0, 1)) == pytest.approx(gradient)
    assert np.allclose(information_of_channels(point, fitted, 1.0, alike=True), information)
    assert residual(point, fitted).ravel() @ residual(point, fitted).ravel() == pytest.approx(cost)


def without(point: Point, j: int) -> float:
    """Return the squared misfit without a mode, the others fitted again."""
    kept = np.delete(np.arange(3), j)
    fewer = point.problem.at(point.poles[kept], point.sides[kept])
    return fewer.cost(fewer.fitted())


def test_gains_with_weights_are_rises_of_the_misfit_and_the_weakest_goes_first() -> None:
    own = np.array([[1.0, 8.0], [0.25, 1.0], [2.0, 0.5]])
    shapes, participation = sides(3, 2)
    data = response(shapes, participation, 0.3 * own)
    problem = whitened(data, NONE, (0,), np.ones(2 * F.size), np.full(3, 0.3), np.ones(2), own=own)
    point = problem.at(POLES, unit_vectors(participation))
    fitted = point.fitted()
    rises = np.array([without(point, j) - point.cost(fitted) for j in range(3)])
    assert fitted.gain == pytest.approx(rises)
    weakest = int(np.argmin(rises))
    assert pruned(fitted, np.full(3, rises[weakest] * 0.999)).tolist() == [0, 1, 2]
    assert weakest not in pruned(fitted, np.full(3, rises[weakest] * 1.001))


def test_a_mode_of_quiet_channels_alone_is_found_beside_channels_a_thousand_times_as_loud() -> None:
    # errors of one per cent of every channel: a product of levels gives the quiet channels thirty times theirs
    shapes = np.array([[30.0, 0.0, 1e-3], [0.0, 30.0, 1e-3]]) + 0j
    participation = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) + 0j
    clean = response(shapes, participation, np.zeros((2, 2))).values
    size = np.sqrt(np.mean(np.abs(clean) ** 2, axis=0))
    assert size[0, 0] > 1000 * size[0, 1]
    found = ms.analyze(response(shapes, participation, 0.01 * size / np.sqrt(2)), orders=range(6, 19, 4)).modes
    assert np.allclose(found.frequencies, np.abs(POLES) / (2 * np.pi), rtol=1e-3)


def state_of(given: float, channel: tuple[int, int] = (1, 0)) -> State:
    """Return a state whose problem says `given` times the noise of a channel."""
    own = np.ones((2, 2))
    own[channel] = given
    shapes, participation = sides(2, 2)
    data = response(shapes, participation, np.full((2, 2), 0.1))
    problem = whitened(data, NONE, (0,), np.ones(2 * F.size), np.full(2, 0.1), np.ones(2), own=own)
    return converged(SelectionProblem(problem, 1.0, 60.0, data.span), 1.0, POLES, unit_vectors(participation))


@pytest.mark.parametrize(("given", "again"), [(1.8, False), (2.3, True), (64.0, True)])
def test_levels_that_the_reference_model_left_too_high_are_lowered_from_twice_on(given: float, again: bool) -> None:
    # by one variance of the fit, which is lower too where a channel has less than its level
    state = replace(state_of(given), variance=1.0)
    after = joint_selection._levelled(state)
    assert (after is not state) is again
    if again:
        now = after.selection.problem.levels.channels * np.sqrt(after.variance)
        assert np.all(np.abs(np.log2(now / 0.1)) < 0.6)
        assert np.allclose(after.poles, state.poles, rtol=1e-4)


def settled(data: FrequencyResponse, participation: np.ndarray, shapes: np.ndarray):  # type: ignore[no-untyped-def]
    return settle(task_of(data, NONE, None, None), POLES, shapes, participation)


def told(fit: Descent, variance: float) -> RealArray:
    """Return the variances of poles' real parts, each channel with the noise that it is left."""
    C = inverse(normal(fit.point, fit.fitted)[0])
    return np.diag(C @ information_of_channels(fit.point, fit.fitted, variance, alike=False) @ C)[::4]


def test_refinement_weights_channels_by_their_own_noise_and_has_the_bound_of_it() -> None:
    own = np.array([[0.05, 0.5], [0.5, 0.05]])
    shapes, participation = sides(2, 2)
    data = response(shapes, participation, own)
    found = settled(data, participation, shapes)
    assert found.levels.own is not None
    truth, even = (
        whitened(data, NONE, (0,), np.ones(2 * F.size), np.ones(2), np.ones(2), own=each) for each in (own, None)
    )
    bound = descend(truth, POLES, unit_vectors(participation))
    best = np.diag(inverse(normal(bound.point, bound.fitted)[0]))[::4]
    # levels to the next power of two cost a sixth of the information at most
    assert np.all(told(found.descent, found.variance) < 1.2 * best)
    assert np.all(told(found.descent, found.variance) > 0.8 * best)
    fit = descend(even, POLES, unit_vectors(participation))
    assert np.all(told(fit, fit.cost / even.freedom) > 2 * best)


@pytest.mark.parametrize("shared", [False, True])
def test_model_error_has_no_levels_of_single_channels(shared: bool) -> None:
    # a resonance that is off by .4 %, and errors that neighbouring lines share
    own = np.array([[0.05, 0.5], [0.5, 0.05]])
    shapes, participation = sides(2, 2)
    data, x = response(shapes, participation, own), 2j * np.pi * F[:, None, None]
    error = np.array(5 / (x - POLES[1] * (1 + 0.004j)) - 5 / (x - POLES[1]))
    if shared:
        e = np.random.default_rng(1).standard_normal((2, F.size + 8, 2, 2))
        sums = np.cumsum(np.pad(e[0] + 1j * e[1], ((1, 0), (0, 0), (0, 0))), axis=0)
        error = own * (sums[9:] - sums[:-9])
    found = settled(replace(data, values=data.values + error), participation, shapes)
    assert found.colour.coloured
    assert found.levels.own is None


def test_a_side_alone_is_asked_only_of_data_without_weights() -> None:
    own = np.array([[1.0, 4.0], [4.0, 1.0]])
    shapes, participation = sides(2, 2)
    problem = whitened(
        response(shapes, participation, own), NONE, (0,), np.ones(2 * F.size), np.ones(2), np.ones(2), own=own
    )
    fitted: Fitted = problem.at(POLES, unit_vectors(participation)).fitted()
    assert len(fitted.sides) == 2
    with pytest.raises(ValueError, match="too many values"):
        _ = fitted.only


def test_a_floor_of_products_has_the_mean_square_of_what_is_left() -> None:
    own = np.array([[0.05, 0.5], [0.5, 0.05]])
    floor = floor_of(response(*sides(2, 2), own), POLES)
    assert floor.levels.own is not None
    even = floor.of_products()
    assert even.levels.own is None
    divided = [np.mean((each.left / each.rows[:, None, None] / each.levels.channels) ** 2) for each in (floor, even)]
    assert even.variance / floor.variance == pytest.approx(divided[1] / divided[0])
    assert even.of_products() is even
