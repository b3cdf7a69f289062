"""What modes explain of data whose errors are coloured, against least squares and plain sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from modalscope.identification.descent import descend
from modalscope.identification.likelihood import whitened
from modalscope.identification.whitening import free_bound, lag_factor
from modalscope.judging.recount import Recount, recount_of
from modalscope.model.checks import RealArray
from modalscope.model.poles import poles_from
from tests.judging.test_contest import PARTS, POLES, SHAPES, F, arena_of, data


def errors_of(variance: float = 2.0, correlation: tuple[float, ...] = ()) -> Recount:
    """Return white data with modes where they are, and errors as they are said to be: 2 is what the arena divides by."""
    arena = arena_of(data(), coloured=True)
    descent = descend(arena.problem, POLES, PARTS / np.linalg.norm(PARTS, axis=1, keepdims=True) + 0j, most=0)
    left = arena.problem.data
    shape = (len(F), *left.shape[1:])
    return Recount(arena, descent, left, np.full(shape, variance), np.array(correlation))


def test_of_white_errors_a_gain_is_the_rise_of_the_misfit_without_the_mode_and_free_residues() -> None:
    recount = errors_of()
    problem = recount.arena.problem

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
    arena = replace(arena_of(data(), coloured=True), problem=problem)
    recount = recount_of(arena, descend(problem, POLES, PARTS / np.linalg.norm(PARTS, axis=1)[:, None] + 0j))
    told = np.sqrt(recount.variance) / (0.05 * np.abs(H) / level[:, None, None])
    assert np.exp(np.mean(np.log(told))) == pytest.approx(1, abs=0.15)
    assert np.std(np.log(told)) < 0.4
    # a mean of nine lines: 1 - k / 9, less what four modes take of it
    assert recount.correlation[:4] == pytest.approx(1 - np.arange(1, 5) / 9, abs=0.12)
    assert len(recount.correlation) < 15


def test_narrow_poles_and_such_as_errors_reach_as_far_are_not_wide() -> None:
    # half bandwidths of 1.45 and 1.55 lines; errors over 1 + 2 sum r = 9 lines, pi h = 9 at 2.86 lines
    def pole(half: float) -> np.ndarray:
        return poles_from(np.array([15.0]), np.array([half * (F[1] - F[0]) / 15]))

    white, long = errors_of(), errors_of(2.0, (1.0,) * 4)
    assert [bool(white.wide(pole(h))[0]) for h in (1.45, 1.55)] == [False, True]
    assert [bool(long.wide(pole(h))[0]) for h in (2.8, 2.95)] == [False, True]


@pytest.mark.parametrize(
    ("shape", "part", "own"),
    [(0, 0, False), (1, 0, False), (0, 1, False), (1, 1, True)],
)
def test_a_shoulder_has_the_shape_or_the_participation_of_a_stronger_mode_that_it_overlaps(
    shape: int, part: int, own: bool
) -> None:
    shapes = [SHAPES[:, 3], np.linalg.svd(SHAPES[:, [3]])[0][:, 1]]
    parts = [PARTS[3], np.array([-PARTS[3, 1], PARTS[3, 0]])]
    x, beside = 2j * np.pi * F[:, None, None], POLES[3] * 1.012
    R = 0.4 * np.outer(shapes[shape], parts[part])
    response = replace(data(), values=data().values + R / (x - beside) + R / (x - beside.conj()))
    arena = arena_of(response, coloured=True)
    poles, sides = np.append(POLES, beside), np.vstack([PARTS, parts[part]])
    descent = descend(arena.problem, poles, sides / np.linalg.norm(sides, axis=1)[:, None] + 0j, most=1)
    assert recount_of(arena, descent).own(np.array([3, 4])).tolist() == [True, own]
