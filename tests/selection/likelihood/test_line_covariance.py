"""One covariance for poles of every kind of data: influence and leverage against differences of the code, lines, and parts in time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as fisher, t as student

import modalscope as ms
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.selection.likelihood import covariance
from modalscope.selection.likelihood.covariance import (
    Parts,
    degrees_of_lines,
    deviations_of_poles,
    gradients_of_poles,
    joined,
    lower_damping,
    lower_damping_of_channels,
    of_parts,
    pole_blocks,
    variances_of_lines,
    wandering,
)
from modalscope.selection.likelihood.descent import descend
from modalscope.selection.likelihood.driven import DrivenWhitened, whitened_records
from modalscope.selection.likelihood.information import (
    OnRows,
    by_channel,
    influence_on_poles,
    information_of_channels,
    inverse,
    leverage,
    normal,
    on_rows,
    residual,
    scores,
)
from modalscope.selection.likelihood.likelihood import Fitted, Point, Whitened, whitened
from modalscope.selection.likelihood.lines_told import told_by_lines
from modalscope.selection.likelihood.settling import settle, task_of
from modalscope.selection.likelihood.whitening import Levels
from tests.selection.judging.shifted import KINDS, shifted_response, shifted_structure
from tests.selection.judging.test_refine_records import runs_of, started, system
from tests.selection.likelihood.cases import TRUTH

CHAIN = ms.systems.chain5()


def optimum(kind: str, noise: float = 1e-6) -> tuple[Point, Fitted, Any]:
    """Return the optimum of data with little noise, and the data."""
    if kind == "records":
        runs = runs_of(system(3, 2), [300, 250], noise=noise)
        data: Any = record_spectra(runs)
        modes = ms.refine(runs, started(runs))
        problem: Any = whitened_records(data, np.zeros(0), data.refined_powers, np.ones(2 * data.count), np.ones(3))
        participation, _ = data.basis(modes.poles, (0,)).fit_participation(modes.shapes)
    else:
        in_time = kind == "samples"
        data = (
            CHAIN.impulse_response(200, noise=noise, seed=0)
            if in_time
            else CHAIN.frequency_response(np.linspace(0.2, 7, 150), noise=noise, seed=0)
        )
        rows = data.count * (1 if in_time else 2)
        problem = whitened(data, np.zeros(0), data.refined_powers, np.ones(rows), np.ones(4), np.ones(2))
        modes, participation = TRUTH, TRUTH.participation
    sides = participation / problem.varying
    found = descend(problem, modes.poles, sides / np.linalg.norm(sides, axis=1, keepdims=True), tolerance=1e-20)
    return found.point, found.fitted, data


def whole(point: Point, fitted: Fitted) -> OnRows:
    """Return all rows in one piece, of records put together from both parts of some lines at a time."""
    pieces = list(on_rows(point, fitted, together=point.problem.light.grid is None))
    if len(pieces) == 1 and isinstance(pieces[0].rows, slice):
        return pieces[0]
    order = np.argsort(np.concatenate([each.rows for each in pieces]))
    return OnRows(slice(None), *(np.concatenate(each)[order] for each in list(zip(*pieces, strict=True))[1:]))


def data_of(problem: Whitened) -> RealArray:
    """Return the divided data on all rows, without what terms explain, (K, q, p)."""
    if not isinstance(problem, DrivenWhitened):
        return problem.data
    both = np.concatenate([problem.values.real, problem.values.imag]) / problem.rows[:, None] / problem.linear
    return (both - problem.terms @ problem.taken)[:, :, None]


def with_data(problem: Whitened, data: RealArray) -> Whitened:
    """Return the problem with other data, which the terms have no part in."""
    if not isinstance(problem, DrivenWhitened):
        return replace(problem, data=data)
    both = data[:, :, 0] * problem.rows[:, None] * problem.linear
    half = len(both) // 2
    return replace(problem, values=both[:half] + 1j * both[half:], taken=0 * problem.taken)


def influence(point: Point, fitted: Fitted) -> tuple[RealArray, RealArray]:
    """Return the influence on all frequencies, then all damping ratios, and the deviations that white noise of one gives these."""
    C, (n, p) = inverse(normal(point, fitted)[0]), point.sides.shape
    g = np.zeros((2, n, len(C)))
    for k, gradient in enumerate(gradients_of_poles(point.poles)):
        for j in range(n):
            g[k, j, 2 * p * j : 2 * p * j + 2] = gradient[j]
    W = np.split(whole(point, fitted).W.view(np.float64).T, n)
    u = influence_on_poles(W, fitted.linear, g.reshape(2 * n, -1) @ C).transpose(0, 3, 1, 2)
    return u, np.concatenate(deviations_of_poles(point.poles, pole_blocks(C, 2 * p * np.arange(n))))


@pytest.mark.parametrize("kind", ["records", "lines", "samples"])
def test_influence_is_the_change_of_poles_with_the_data(kind: str) -> None:
    point, fitted, _ = optimum(kind)
    (u, _), problem = influence(point, fitted), point.problem
    data = data_of(problem)
    change = np.random.default_rng(3).standard_normal(data.shape)
    change -= np.tensordot(problem.terms, np.tensordot(problem.terms.T, change, 1), 1)
    ends = []
    for sign in (1, -1):
        moved = with_data(problem, data + sign * 1e-5 * np.abs(data).max() * change)
        ends.append(np.concatenate(frequencies_and_damping(descend(moved, point.poles, point.sides).point.poles)))
    numeric = (ends[0] - ends[1]) / (2e-5 * np.abs(data).max())
    told, size = np.einsum("bkqp,kqp->b", u, change), np.sqrt(np.sum(u**2, axis=(1, 2, 3)))
    assert np.all(np.abs(numeric - told) < 1e-3 * size)


@pytest.mark.parametrize("kind", ["records", "lines", "samples"])
def test_with_white_noise_put_in_lines_give_the_covariance_of_the_information(kind: str) -> None:
    """With S = 2 v I in place of the residual, 1/2 sum u^H S u is v times the inverse information."""
    point, fitted, data = optimum(kind)
    u, white = influence(point, fitted)
    C, v = inverse(normal(point, fitted)[0]), 0.3
    rows, (_, W, _, left) = told_by_lines(point, fitted, C, data), whole(point, fitted)
    turned = [rows.times(each) for each in rows.W]
    assert (
        np.sum(np.square(turned)) == pytest.approx(np.sum(np.square(rows.W))) == pytest.approx(np.sum(np.abs(W) ** 2))
    )
    assert np.allclose(np.sqrt(np.sum(u**2, axis=(1, 2, 3))), white, rtol=1e-6)
    assert np.allclose(information_of_channels(point, fitted, v, alike=True), v * normal(point, fitted)[0])
    # drawn: the covariance by lines of 40 residuals, their mean known to some per cent
    rng, p, problem = np.random.default_rng(0), point.sides.shape[1], point.problem
    in_time = data.grid is None
    h = leverage(problem.terms, fitted.linear, W, whole(point, fitted).kept, C, 1 if in_time else 2)
    free = 1 - (h.mean(axis=0) if in_time else np.tile(h, (2, 1, 1)))
    explained, drawn = data_of(problem) - left, []
    for _ in range(40):
        e = rng.standard_normal(left.shape) * free
        found = told_by_lines(replace(point, problem=with_data(problem, explained + e)), fitted, C, data).covariance(C)
        drawn.append(
            np.concatenate(deviations_of_poles(point.poles, pole_blocks(found, 2 * p * np.arange(len(point.poles)))))
        )
    assert np.allclose(np.sqrt(np.mean(np.square(drawn), axis=0)), white, rtol=0.15)


@pytest.mark.parametrize("kind", ["records", "samples"])
def test_leverages_are_the_slopes_of_fitted_numbers_by_their_data_and_sum_to_the_unknowns(kind: str) -> None:
    point, fitted, _ = optimum(kind)
    problem = point.problem
    rows, (q, p) = whole(point, fitted), problem.channels
    h = leverage(problem.terms, fitted.linear, rows.W, rows.kept, inverse(normal(point, fitted)[0]))
    unknowns = problem.terms.shape[1] * q * p + fitted.only.kept.shape[1] * q + 2 * point.sides.size
    assert h.sum() == pytest.approx(unknowns, rel=1e-6)
    k, o = 40, 1
    ends = []
    for sign in (1, -1):
        data = data_of(problem).copy()
        size = 1e-4 * np.abs(data).max()
        unit = np.zeros(len(data))
        unit[k] = sign * size
        data[:, o, 0] += unit - problem.terms @ (problem.terms.T @ unit)
        there = descend(with_data(problem, data), point.poles, point.sides).point
        ends.append(data[k, o, 0] - _left(there)[k, o, 0])
    own = float(problem.terms[k] @ problem.terms[k])
    assert h[k, o, 0] == pytest.approx((ends[0] - ends[1]) / (2 * size) + own, abs=2e-3)


def _left(point: Point) -> RealArray:
    return residual(point, point.fitted())


@pytest.mark.parametrize("kind", ["records", "lines", "samples"])
def test_a_point_under_other_levels_is_that_of_the_data_divided_by_these(kind: str) -> None:
    point, _, data = optimum(kind)
    problem, rng = point.problem, np.random.default_rng(4)
    outputs = rng.uniform(0.5, 2, data.values.shape[1])
    if kind == "records":
        inputs = np.array([1.5])
        levels = Levels(outputs, inputs)
        anew: Whitened = whitened_records(data, np.zeros(0), data.refined_powers, problem.rows, 1.5 * outputs)
    else:
        inputs = rng.uniform(0.5, 2, data.values.shape[2])
        levels = Levels(outputs, inputs, 2.0 ** rng.integers(-1, 2, data.values.shape[1:]))
        anew = whitened(data, np.zeros(0), data.refined_powers, problem.rows, outputs, inputs, own=levels.own)
    found = point.releveled(levels)
    direct = anew.at(found.poles, found.sides)
    assert found.problem.size == pytest.approx(anew.size, rel=1e-10)
    assert np.allclose(data_of(found.problem), data_of(anew), rtol=1e-9, atol=1e-12 * np.sqrt(anew.size))
    assert found.cost(found.fitted()) == pytest.approx(direct.cost(direct.fitted()), rel=1e-6)
    for told, own in zip(
        anew.scaled_back(found, found.fitted()), anew.scaled_back(direct, direct.fitted()), strict=True
    ):
        assert np.allclose(told, own, rtol=1e-6, atol=1e-6 * np.abs(own).max())
    assert not np.isclose(found.problem.size, problem.size)


def degrees(u: ComplexArray, e: ComplexArray) -> float:
    return float(degrees_of_lines(variances_of_lines(u, e))[0])


def test_degrees_of_freedom_count_two_a_line_and_follow_those_that_tell() -> None:
    rng = np.random.default_rng(1)
    e = (rng.standard_normal((4000, 2)) + 1j * rng.standard_normal((4000, 2))) / np.sqrt(2)
    alike = np.ones((4000, 1, 2), complex)
    assert degrees(alike, e) == pytest.approx(8000, rel=0.1)
    half = alike.copy()
    half[1000:] *= 0.01
    assert degrees(half, e) == pytest.approx(2000, rel=0.1)
    blocks = [variances_of_lines(half[k : k + 700], e, k) for k in range(0, 4000, 700)]
    assert np.allclose(np.concatenate(blocks), variances_of_lines(half, e), rtol=1e-12)


@pytest.mark.parametrize("width", [3.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_students_interval_of_few_lines_holds_the_truth(width: float) -> None:
    """A resonance few lines wide: 1/2 sum |u* e|^2 scatters, and Student's quantile of its degrees of freedom makes up for it."""
    rng, x = np.random.default_rng(2), np.arange(-200, 200) / width
    u = (1 / (1 + 1j * x) ** 2)[:, None, None]
    held = []
    for _ in range(1500):
        e = (rng.standard_normal((x.size, 1)) + 1j * rng.standard_normal((x.size, 1))) / np.sqrt(2)
        z = (u[:, 0].conj() * e).sum(axis=1)
        t = student.ppf(0.975, degrees(u, e))
        held.append([abs(z.real.sum()) < q * np.sqrt(np.sum(np.abs(z) ** 2) / 2) for q in (t, 1.96)])
    by_student, by_normal = np.mean(held, axis=0)
    assert 0.935 < by_student < 0.985  # 1500 cases leave 1.1 %
    assert by_normal < by_student


def drifting(wander: float, seed: int) -> tuple[RealArray, RealArray]:
    """Return influence over time, uneven, and an error that is white, with a part along the influence that changes in time."""
    rng, t = np.random.default_rng(seed), np.arange(4000)
    J = rng.standard_normal((1, t.size, 2)) * np.exp(-t / 3000)[:, None]
    e = rng.standard_normal((t.size, 2)) + wander * np.sin(2 * np.pi * t / 2500)[:, None] * J[0]
    u = J / np.sum(J**2)
    return u, e - J[0] * np.sum(u[0] * e)


def parts_of(u: RealArray, e: RealArray) -> Parts:
    return of_parts(np.sum(u**2, axis=2), np.sum(u * e, axis=2))


def test_parts_in_time_tell_the_variance_of_white_noise_and_more_where_a_number_changes() -> None:
    ratios = []
    for seed in range(300):
        u, e = drifting(0.0, seed)
        ratios.append(parts_of(u, e).variance[0] / np.sum(u**2))
    assert np.mean(ratios) == pytest.approx(1, abs=0.1)  # 300 of seven degrees of freedom leave 3 %
    assert np.mean(np.array(ratios) > fisher.ppf(0.95, 7, 1e6)) == pytest.approx(0.05, abs=0.03)
    u, e = drifting(0.4, 0)
    found = parts_of(u, e)
    assert found.variance[0] > 5 * np.sum(u**2)
    assert found.share[0] == pytest.approx(np.full(8, 1 / 8), abs=0.002)
    assert np.ptp(found.moved[0]) == pytest.approx(0.8, rel=0.3)  # means over parts of a sine of .4


@pytest.mark.parametrize(("above", "taken"), [(0.999, False), (1.001, True)])
def test_parts_count_where_they_scatter_more_than_the_f_test_allows(above: float, taken: bool) -> None:
    limit = fisher.ppf(0.95, 7, 30.0)
    parts = Parts(np.array([2.0 * above * limit]), np.zeros((1, 8)), np.full((1, 8), 1 / 8))
    variance, degrees = joined(np.array([2.0]), np.array([30.0]), parts)
    assert (degrees[0], variance[0]) == ((7, pytest.approx(2 * above * limit)) if taken else (30, 2))


def test_a_wandering_frequency_takes_what_it_adds_off_the_lower_end_of_damping() -> None:
    """A line fitted to a frequency that wanders by sigma is wider by sigma^2 / (f^2 zeta), to second order."""
    f, zeta, sigma = 10.0, 0.01, 0.02
    wide = zeta + (sigma / f) ** 2 / zeta
    pole = 2 * np.pi * f * (-wide + 1j * np.sqrt(1 - wide**2))
    assert lower_damping(np.array([pole]), np.array([sigma**2]))[0] == pytest.approx(zeta, rel=1e-6)
    assert lower_damping(np.array([pole]), np.array([100 * sigma**2]))[0] == pytest.approx(wide / 2)
    assert np.isnan(lower_damping(np.array([pole]), np.zeros(1))[0])


def test_of_channels_the_lower_end_is_that_of_the_best_fit_with_free_residues() -> None:
    """The optimum of a' / ((a + a')^2 + d^2), by a search."""
    a, d, f = 2 * np.pi * 10 * 0.008, 2 * np.pi * 0.06, 10.0
    wide = np.linspace(a, 2 * a, 100_001)
    fitted = wide[np.argmax(wide / ((a + wide) ** 2 + d**2))]
    poles = np.array([-fitted + 1j * np.sqrt((2 * np.pi * f) ** 2 - fitted**2)])
    found = lower_damping_of_channels(poles, np.array([0.06**2]))
    assert found[0] == pytest.approx(0.008, rel=1e-4)
    assert lower_damping_of_channels(poles, np.array([1.0]))[0] == pytest.approx(fitted / (2 * np.pi * f) / 2)
    assert np.isnan(lower_damping_of_channels(poles, np.zeros(1))[0])


def test_what_wanders_beyond_the_noise_of_each_part_is_told_for_parts_of_any_share() -> None:
    rng, sigma, noise = np.random.default_rng(0), 0.3, 0.02
    share = rng.uniform(0.01, 1, 40)
    share /= share.sum()
    found, still = [], []
    for _ in range(400):
        own = noise * rng.standard_normal(40) / np.sqrt(share)
        for wander, each in ((sigma, found), (0.0, still)):
            m = own + wander * rng.standard_normal(40)
            parts = covariance.parts_of(share[None], (share * (m - share @ m))[None])
            each.append(wandering(np.array([noise**2]), np.array([1e6]), parts)[0])
    assert np.mean(found) == pytest.approx(sigma**2, rel=0.08)
    assert np.mean(np.array(still) > 0) == pytest.approx(0.01, abs=0.01)


def shifting(seed: int, shift: float) -> tuple[ms.FrequencyResponse, RealArray]:
    """Return responses of one mode at 24 outputs and two inputs, its frequency another at each output, and its shape."""
    rng = np.random.default_rng(seed)
    w, shape = 2j * np.pi * np.linspace(8, 12, 400)[:, None], rng.standard_normal(24)
    s = poles_from(10 * (1 + shift * rng.standard_normal(24)), np.full(24, 0.008))
    H = shape * (1 / (w - s) + 1 / (w - s.conj()) * -1) * 1j
    values = H[:, :, None] * np.array([1.0, 0.6])
    values = values + 1e-3 * np.abs(values).max() * (
        rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    )
    return ms.FrequencyResponse(values=values, frequencies=w[:, 0].imag / (2 * np.pi), quantity="displacement"), shape


def test_outputs_whose_resonance_shifts_lower_the_damping_and_widen_the_shape() -> None:
    held, ratios, damping = [], [], []
    for seed in range(12):
        response, shape = shifting(seed, 0.002)
        start = ms.ModalModel(
            poles=poles_from([10.0], [0.008]), shapes=shape[:, None].astype(complex), participation=[[1.0, 0.6]]
        )
        found = ms.refine(response, start)
        ends = found.interval()["damping_ratio"][0]
        held.append(ends[0] < 0.008 < ends[1])
        misfit = 1 - float(ms.mac(found.shapes, shape[:, None])[0, 0])
        ratios.append(misfit / (np.sum(found.shapes_std**2) / np.sum(np.abs(found.shapes) ** 2)))
        damping.append(found.damping_ratios[0])
    assert sum(held) >= 11
    assert 0.5 < np.median(ratios) < 2
    # shares of squares of normal numbers are worth 24 / 3 of equal ones
    assert np.mean(damping) == pytest.approx(np.sqrt(0.008**2 + 0.002**2 * (1 - 3 / 24)), rel=0.01)
    response, shape = shifting(0, 0.0)
    assert ms.refine(response, start).damping_ratios_lower is None


@pytest.mark.parametrize("kind", ["rows", "columns"])
def test_intervals_hold_what_the_frequencies_of_rows_or_columns_scatter_around(kind: str) -> None:
    """Eight tests from the truth; without their scatter half of the intervals and less hold."""
    held = []
    for seed in range(8):
        structure = shifted_structure(seed)
        U, sizes, Vh = np.linalg.svd(structure.residues)
        start = ms.ModalModel(poles=structure.poles, shapes=(U[:, :, 0] * sizes[:, :1]).T, participation=Vh[:, 0])
        found = ms.refine(shifted_response(structure, KINDS[kind], seed), start)
        off = np.abs(found.frequencies[:, None] - np.abs(structure.poles) / (2 * np.pi))
        ends, near = found.interval()["frequency"], np.argmin(off, axis=1)
        f = (np.abs(structure.poles) / (2 * np.pi))[near]
        held += [bool(low < x < high) for (low, high), x in zip(ends, f, strict=True) if np.isfinite(low)]
    assert np.mean(held) > 0.85


def test_errors_by_channel_add_up_to_the_scores() -> None:
    """Second route: products with the scores of channels."""
    response = shifting(3, 0.002)[0]
    for turned in (response, response.transposed()):
        l, m = turned.values.shape[1:]
        task = task_of(turned, np.zeros(0, complex), None, None)
        found = settle(task, poles_from([10.0], [0.008]), np.ones((l, 1), complex), np.ones((1, m), complex)).descent
        C = inverse(normal(found.point, found.fitted)[0])
        steps = np.array([[1.0, 0.5], [0.2, -1.0]]) @ C[:2]
        power, pull = by_channel(found.point, found.fitted, steps)
        assert np.allclose(
            pull, np.einsum("bk,lmk->blm", steps, scores(found.point, found.fitted)), atol=1e-12 * np.abs(pull).max()
        )
        assert np.allclose(
            power.sum(axis=(1, 2)), np.einsum("bk,kj,bj->b", steps, normal(found.point, found.fitted)[0], steps)
        )


def test_an_input_that_never_moves_leaves_the_intervals_of_the_others() -> None:
    runs = runs_of(system(3, 1), [800], noise=1e-3)
    (run,) = runs.runs
    dead = np.column_stack([run.inputs, np.zeros(run.samples)])
    with_dead = ms.Signals(outputs=run.outputs, inputs=dead, sampling_rate=run.sampling_rate)
    one, both = (ms.refine(data, started(data)) for data in (runs, Records(runs=(with_dead,))))
    for name in ("frequencies_std", "damping_ratios_std", "degrees"):
        np.testing.assert_allclose(getattr(both, name), getattr(one, name), rtol=0.05)
