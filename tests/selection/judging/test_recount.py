"""What modes explain of data whose errors are coloured, against least squares and plain sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.recount import ColouredErrors, Recount, errors_of as told_errors, inverse, recount_of
from modalscope.selection.likelihood.descent import descend
from modalscope.selection.likelihood.likelihood import whitened
from modalscope.selection.likelihood.whitening import free_bound, lag_factor
from tests.selection.judging.test_joint_selection import NOISE, PARTS, POLES, SHAPES, F, data, selection_of


def errors_of(variance: float = 2.0, correlation: tuple[float, ...] = ()) -> Recount:
    """Return white data with modes where they are, and errors as they are said to be: 2 is what the arena divides by."""
    selection = selection_of(data(), coloured=True)
    descent = descend(selection.problem, POLES, PARTS / np.linalg.norm(PARTS, axis=1, keepdims=True) + 0j, most=0)
    left = selection.problem.data
    shape = (len(F), *left.shape[1:])
    errors = ColouredErrors(np.full(shape, variance), np.zeros(shape), np.array(correlation), np.zeros(0))
    return Recount(selection, descent, left, errors)


def test_of_white_errors_a_gain_is_the_rise_of_the_misfit_without_the_mode_and_free_residues() -> None:
    recount = errors_of()
    problem = recount.selection.problem

    def misfit(poles: RealArray) -> float:
        columns = np.hstack([problem.columns(poles, slopes=False)[0], problem.terms])
        flat = problem.data.reshape(len(problem.data), -1)
        return float(np.sum((flat - columns @ np.linalg.lstsq(columns, flat, rcond=None)[0]) ** 2))

    rises = [misfit(np.delete(POLES, j)) - misfit(POLES) for j in range(4)]
    assert recount.gains(np.arange(4)) == pytest.approx(rises, rel=1e-6)
    assert errors_of(4.0).gains(np.array([3])) == pytest.approx(np.array(rises[3]) / 2, rel=1e-6)


def test_correlated_errors_leave_a_wide_mode_the_share_that_a_plain_sum_says() -> None:
    # of a resonance alone; two units of least squares, with neighbours and terms beside it, differ by a tenth
    r = 0.8 ** np.arange(1, 30)
    half = np.array([-POLES[3].real / (2 * np.pi) / (F[1] - F[0])])
    lost = errors_of().gains(np.array([3])) / errors_of(2.0, tuple(r)).gains(np.array([3]))
    assert lost == pytest.approx(lag_factor(r, half), rel=0.1)
    # the same from the matrix: g' T g / g' g of 1 / (j w - s), on lines far beyond it
    k = np.arange(-2000, 2001)
    g = 1 / (1j * k + half)
    T = sum(2 * value * np.sum((g[lag:] * g[: len(g) - lag].conj()).real) for lag, value in enumerate(r, start=1))
    assert lag_factor(r, half) == pytest.approx(1 + T / np.sum(np.abs(g) ** 2), rel=1e-3)


@pytest.mark.parametrize(("correlation", "found"), [((), 1), (tuple(0.8 ** np.arange(1, 30)), 0)])
def test_a_peak_of_correlated_errors_stands_out_less(correlation: tuple[float, ...], found: int) -> None:
    # a resonance at 22 Hz that explains half the bar of white errors, twice what a peak needs; its half bandwidth is 4.4 lines,
    # and 1 + 2 sum .8^i / (1 + (i / 8.8)^2) = 7.2 times the variance leaves it less than a third of what a peak needs
    errors, s = errors_of(2.0, correlation), poles_from(22.0, 0.01)
    g = (1 / (2j * np.pi * F - s))[:, None, None] * np.outer(SHAPES[:, 3], PARTS[3])
    left = np.concatenate([g.real, g.imag])
    left *= np.sqrt(errors.bar / 2 / np.sum(left**2))
    assert len(replace(errors, left=left).peaks(6, np.array([]))[0]) == found
    # another peak was examined: this one must explain the whole bar; and none is examined twice
    for factor, examined, again in ((1, 12.0, 0), (2, 12.0, found), (2, 22.0, 0)):
        given = replace(errors, left=left * np.sqrt(factor * 1.2)), poles_from(np.array([examined]), 0.001)
        assert len(given[0].peaks(6, given[1])[0]) == again


def test_the_bound_of_free_residues_lies_above_the_quantile_of_chi_squared() -> None:
    for channels in (1, 6, 42):
        exact = chi2.isf(1e-3 / 400, 2 * channels)
        assert exact < free_bound(channels, 800) < 1.5 * exact


def test_errors_that_are_a_part_of_the_response_are_told_with_their_correlation() -> None:
    rng = np.random.default_rng(0)
    H = data(noise=0.0).values
    longer = rng.standard_normal((F.size + 8, 3, 2)) + 1j * rng.standard_normal((F.size + 8, 3, 2))
    sums = np.cumsum(np.concatenate([np.zeros((1, 3, 2)), longer]), axis=0)
    e = 0.05 * np.abs(H) * (sums[9:] - sums[:-9]) / np.sqrt(18)
    level = 0.05 * np.sqrt(np.mean(np.abs(H) ** 2, axis=(1, 2)))
    problem = whitened(
        replace(data(), values=H + e), np.zeros(0), (0,), np.tile(level, 2), np.ones(3), np.ones(2), swift=False
    )
    selection = replace(selection_of(data(), coloured=True), problem=problem)
    errors = recount_of(selection, descend(problem, POLES, PARTS / np.linalg.norm(PARTS, axis=1)[:, None] + 0j)).errors
    told = np.sqrt(errors.variance) / (0.05 * np.abs(H) / level[:, None, None])
    assert np.exp(np.mean(np.log(told))) == pytest.approx(1, abs=0.15)
    assert np.std(np.log(told)) < 0.4
    # a mean of nine lines: 1 - k / 9, less what four modes take of it
    assert errors.share.mean() > 0.8
    assert errors.own[:4] == pytest.approx(1 - np.arange(1, 5) / 9, abs=0.12)
    assert len(errors.own) < 15


def test_white_noise_and_smooth_errors_of_the_response_each_have_their_own_correlation() -> None:
    rng = np.random.default_rng(1)
    count = 1500
    H = (1.1 + np.sin(np.arange(count) / 40))[:, None, None] * np.array([[1.0, 2.0], [3.0, 0.5]]) + 0j
    longer = rng.standard_normal((count + 8, 2, 2)) + 1j * rng.standard_normal((count + 8, 2, 2))
    sums = np.cumsum(np.concatenate([np.zeros((1, 2, 2)), longer]), axis=0)
    smooth = 0.1 * np.abs(H) * (sums[9:] - sums[:-9]) / np.sqrt(18)
    sigma = 0.1 * np.abs(H).mean(axis=0) / np.sqrt(2)
    noise = sigma * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    left, whole = (np.concatenate([each.real, each.imag]) for each in (smooth + noise, H + smooth + noise))
    errors = told_errors(left, whole, np.ones(count), 0)
    assert np.abs(errors.even).max(initial=0) < 0.1
    assert errors.own[:7] == pytest.approx(1 - np.arange(1, 8) / 9, abs=0.12)
    truth = np.abs(H) ** 2 / (np.abs(H) ** 2 + np.mean(np.abs(H), axis=0) ** 2)
    assert np.abs(errors.share - truth).mean() < 0.06
    # what all lines have in common at a place is that of its shares, and the same matrix is applied to columns
    near = errors.common(np.array([63, 188]))  # a peak of the response, and where it is least
    assert near[:, 0] == pytest.approx([0.72 * 8 / 9, 0.01], abs=0.12)
    s2 = errors.share[:, 1, 0]
    for apart, correlation in ((0, 1.0), (3, errors.own[2])):
        pair = np.zeros((1, 1, 2, count), complex)
        pair[0, 0, [0, 1], [700, 700 + apart]] = 1
        even = np.append(errors.even, np.zeros(3))[2] if apart else 1.0
        own = np.sqrt(s2[700] * s2[700 + apart]) * correlation
        rest = np.sqrt((1 - s2[700]) * (1 - s2[700 + apart])) * even
        divided = pair * np.sqrt(errors.variance[:, 1, 0])
        assert errors.covariances(slice(2, 3), divided)[0, 0, 0, 1] == pytest.approx(own + rest)


def test_a_narrow_resonance_lasts_beyond_the_lobe_of_a_window_and_a_coherent_line_does_not() -> None:
    rng = np.random.default_rng(2)
    step, at = F[1] - F[0], 60
    noise = 0.02 * np.abs(data().values).mean()
    white = noise * (rng.standard_normal((F.size, 3, 2)) + 1j * rng.standard_normal((F.size, 3, 2)))
    shape, part = rng.standard_normal(3), rng.standard_normal(2)
    beside = poles_from(np.array([F[at]]), np.array([0.75 * step / F[at]]))  # 1.5 lines at half its power
    R = np.outer(shape, part) * -beside.real
    lobe = np.zeros(F.size)
    lobe[at - 1 : at + 2] = 0.5, 1.0, 0.5  # Hann's window
    resonance = R / (2j * np.pi * F[:, None, None] - beside)
    for extra, lasting in ((resonance, True), (lobe[:, None, None] * np.outer(shape, part), False)):
        size = 40 * noise / np.abs(extra).max()
        response = replace(data(), values=data().values + white + size * extra)
        selection = selection_of(response, coloured=True)
        sides = np.vstack([PARTS, part])
        descent = descend(
            selection.problem, np.append(POLES, beside), sides / np.linalg.norm(sides, axis=1)[:, None] + 0j, most=0
        )
        recount = recount_of(selection, descent)
        assert recount.gains(np.array([4]))[0] > recount.bar
        assert recount.lasting(np.array([3, 4])).tolist() == [True, lasting]


def test_what_is_much_narrower_than_a_line_is_no_mode() -> None:
    recount = errors_of()
    step = F[1] - F[0]
    narrow = replace(
        recount.descent.point,
        poles=poles_from(np.abs(POLES) / (2 * np.pi), 0.12 * step / (np.abs(POLES) / (2 * np.pi))),
    )
    less = replace(recount, descent=replace(recount.descent, point=narrow))
    assert not np.any(less.lasting(np.arange(4)))


@pytest.mark.parametrize(("shape", "part", "own"), [(0, 0, False), (1, 0, False), (0, 1, False), (1, 1, True)])
def test_a_shoulder_has_the_shape_or_the_participation_of_a_stronger_mode_that_it_overlaps(
    shape: int, part: int, own: bool
) -> None:
    shapes = [SHAPES[:, 3], np.linalg.svd(SHAPES[:, [3]])[0][:, 1]]
    parts = [PARTS[3], np.array([-PARTS[3, 1], PARTS[3, 0]])]
    x, beside = 2j * np.pi * F[:, None, None], POLES[3] * 1.012
    R = 0.4 * np.outer(shapes[shape], parts[part])
    response = replace(data(), values=data().values + R / (x - beside) + R / (x - beside.conj()))
    selection = selection_of(response, coloured=True)
    poles, sides = np.append(POLES, beside), np.vstack([PARTS, parts[part]])
    descent = descend(selection.problem, poles, sides / np.linalg.norm(sides, axis=1)[:, None] + 0j, most=1)
    assert recount_of(selection, descent).hosts(np.array([3, 4])).tolist() == [
        [False] * 5,
        [False] * 3 + [not own, False],
    ]


def test_a_resonance_that_shifts_from_input_to_input_leaves_nothing_beyond_and_a_second_of_its_participation_does() -> (
    None
):
    rng = np.random.default_rng(5)
    x, alone = 2j * np.pi * F[:, None], POLES[3]
    noise = NOISE * (rng.standard_normal((F.size, 3, 2)) + 1j * rng.standard_normal((F.size, 3, 2)))

    def of(pole: complex, shape: RealArray) -> np.ndarray:
        return shape / (x - pole) + shape / (x - np.conj(pole))

    # shifts of a tenth of the half bandwidth one way and the other; a twentieth of the mode at .6 half bandwidths
    shifted = [of(alone + 0.1j * e * -alone.real, SHAPES[:, 3] * PARTS[3, i]) for i, e in enumerate((1, -1))]
    beside = alone - 0.6j * alone.real
    second = [of(alone, SHAPES[:, 3] * b) + of(beside, rng.standard_normal(3) * 0.3 * b) for b in PARTS[3]]
    for channels, beyond in ((shifted, False), (second, True)):
        response = replace(data(), values=data((0, 1, 2), noise=0.0).values + np.stack(channels, axis=2) + noise)
        selection = selection_of(response, coloured=True)
        poles, sides = np.append(POLES, beside), np.vstack([PARTS, PARTS[3]])
        descent = descend(selection.problem, poles, sides / np.linalg.norm(sides, axis=1)[:, None] + 0j, most=0)
        recount = recount_of(selection, descent)
        assert recount.gains(np.array([4]))[0] > recount.bar
        assert bool(recount.beyond_shifts(4, np.array([3])) > np.sqrt(recount.bar)) is beyond
        assert bool(recount.relative_gains(np.array([4]))[0] > 1) is beyond


def test_information_that_has_vanished_is_none_and_other_is_inverted() -> None:
    B = np.array([[[2.0, 1.0], [1.0, 3.0]], [[1e-310, 0.0], [0.0, 1e-312]]])
    np.testing.assert_allclose(inverse(B), [np.linalg.inv(B[0]), np.zeros((2, 2))], rtol=1e-12)
    np.testing.assert_allclose(inverse(1e-150 * B[:1]), [1e150 * np.linalg.inv(B[0])], rtol=1e-12)
