"""What parts that differ add to the variance of a number: closed forms, noise alone, and intervals of made tests."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import stdtrit

from modalscope.numerics.checks import RealArray
from modalscope.numerics.statistics import with_scatter

#: Modes of a test, and tests.
MODES, TESTS = 6, 200


def seen(rng: np.random.Generator, share: RealArray, shifts: RealArray, noise: float) -> tuple[RealArray, RealArray]:
    """Return the errors of numbers whose channels (b, l, m) have `shifts` and white noise, and what each channel adds."""
    own = shifts + noise * rng.standard_normal(share.shape) / np.sqrt(share)
    error = np.sum(share * own, axis=(1, 2))
    return error, share * (own - error[:, None, None])


def shares(rng: np.random.Generator, l: int, m: int) -> RealArray:
    """Return products of unlike shares of outputs and inputs, (MODES, l, m)."""
    a, b = rng.gamma(1, size=(MODES, l)), rng.gamma(1, size=(MODES, m))
    made = a[:, :, None] * b[:, None]
    return np.asarray(made / made.sum(axis=(1, 2), keepdims=True))


def test_of_one_number_and_parts_of_equal_shares_it_is_the_variance_of_their_mean() -> None:
    m = np.array([0.3, -1.2, 0.5, 2.0, -0.4])
    share, s = np.full((1, 5, 1), 0.2), ((m - m.mean()) / 5)[None, :, None]
    found, degrees = with_scatter(np.full(1, 1e-9), np.full(1, 50.0), np.ones(1), share, s)
    own, usual = np.sum((m - m.mean()) ** 2) / 16, 1 / (1 - 2 / 36) ** 3  # leaving out one: 5 / 4 of m.var(ddof=1) / 5
    assert found[0] == pytest.approx(own * (4 + 4 * usual) / 8, rel=1e-6)
    assert degrees[0] == pytest.approx(4 + 4, rel=1e-6)  # its own and those of the mean


def test_one_channel_and_parts_that_agree_add_nothing() -> None:
    given = np.array([2.0]), np.array([7.0]), np.ones(1)
    for shape in ((1, 1, 1), (1, 4, 3)):
        found, degrees = with_scatter(*given, np.full(shape, 1 / np.prod(shape)), np.zeros(shape))
        assert (found[0], degrees[0]) == (2, pytest.approx(7))


@pytest.mark.parametrize(
    ("outputs", "inputs"), [(True, False), (False, True), (True, True)], ids=["outputs", "inputs", "both"]
)
def test_intervals_hold_what_outputs_and_inputs_scatter_around(outputs: bool, inputs: bool) -> None:
    """Shares as unlike as those of random shapes; of 1 200 dependent intervals 95 % is known to about a point and a half."""
    rng, held, wide, narrow = np.random.default_rng(0), [], [], []
    for _ in range(TESTS):
        l, m = int(rng.integers(3, 8)), int(rng.integers(2, 5))
        share, scale = shares(rng, l, m), np.exp(rng.uniform(0, 2, MODES))
        shifts = outputs * rng.standard_normal((MODES, l, 1)) + inputs * rng.standard_normal((MODES, 1, m))
        error, s = seen(rng, share, scale[:, None, None] * shifts, 0.1)
        variance, degrees = with_scatter(np.full(MODES, 0.01), np.full(MODES, 200.0), scale, share, s)
        half = np.sqrt(variance) * stdtrit(degrees, 0.975)
        held.append(np.abs(error) < half)
        narrow.append(np.abs(error) < 1.96 * 0.1)
        wide.append(half / scale)
    assert 0.92 < np.mean(held) < 0.99
    assert np.mean(narrow) < 0.5
    assert np.median(wide) < 4  # of a deviation of one, whose mean over parts this is


def test_of_noise_alone_variances_grow_little_and_hold() -> None:
    rng, held, grown = np.random.default_rng(1), [], []
    for _ in range(TESTS):
        share = shares(rng, int(rng.integers(3, 8)), int(rng.integers(1, 5)))
        error, s = seen(rng, share, np.zeros(share.shape), 0.1)
        variance, degrees = with_scatter(np.full(MODES, 0.01), np.full(MODES, 200.0), np.ones(MODES), share, s)
        held.append(np.abs(error) < np.sqrt(variance) * stdtrit(degrees, 0.975))
        grown.append(np.sqrt(variance) / 0.1)
    assert np.mean(held) > 0.94
    assert np.median(grown) < 1.2


def test_one_number_that_scatters_by_far_the_most_widens_no_other() -> None:
    rng = np.random.default_rng(3)
    share = np.full((MODES, 6, 1), 1 / 6)
    shifts = rng.standard_normal((MODES, 6, 1))
    given = np.full(MODES, 0.01), np.full(MODES, 200.0), np.ones(MODES)
    few, _ = with_scatter(*given, share, seen(rng, share, shifts, 0.1)[1])
    shifts[2] *= 1000
    more, _ = with_scatter(*given, share, seen(rng, share, shifts, 0.1)[1])
    assert more[2] > 1e4 * few[2]
    assert np.all(np.delete(more / few, 2) < 4)


def test_no_unit_of_a_number_changes_what_parts_add() -> None:
    rng = np.random.default_rng(2)
    share = shares(rng, 5, 3)
    _, s = seen(rng, share, rng.standard_normal((MODES, 5, 1)), 0.1)
    unit, one = np.exp(rng.uniform(-9, 9, MODES)), (np.full(MODES, 0.01), np.full(MODES, 200.0))
    found, degrees = with_scatter(*one, np.ones(MODES), share, s)
    other, free = with_scatter(one[0] * unit**2, one[1], unit, share, s * unit[:, None, None])
    assert other == pytest.approx(found * unit**2, rel=1e-9)
    assert free == pytest.approx(degrees, rel=1e-9)
