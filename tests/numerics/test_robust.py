"""Robust scatter and the noise threshold against what they are defined by."""

import numpy as np
import pytest

from modalscope.numerics.statistics import NORMAL, noise_threshold, scatter


def test_of_gaussian_values_the_scatter_is_the_standard_deviation():
    """The estimate has a standard deviation of 1.17 / sqrt(n) here (its efficiency is 37 %): three of them."""
    x = np.random.default_rng(0).standard_normal(100_000)
    assert scatter(5 + 2 * x) == pytest.approx(2, abs=3 * 2 * 1.17 / np.sqrt(x.size))


def test_a_few_outliers_do_not_move_it():
    x = np.arange(21.0)
    spoilt = x.copy()
    spoilt[-3:] = 1e12
    assert scatter(spoilt) == scatter(x) == pytest.approx(NORMAL * 5)


def test_of_few_values_it_is_the_standard_deviation():
    assert scatter([3.0]) == scatter([]) == 0
    assert scatter([1.0, 3.0]) == pytest.approx(np.sqrt(2))
    assert scatter([1.0, 1.0, 4.0]) == pytest.approx(np.sqrt(3))  # the median deviation would be 0


@pytest.mark.parametrize("ratio", [1.0, 0.5, 0.1])
def test_the_threshold_lies_above_noise_and_below_what_stands_out(ratio):
    """White noise of n columns ends at sigma sqrt(n) (1 + sqrt(beta)); the published threshold lies up to 20 % above it."""
    n = 600
    noise = np.random.default_rng(0).standard_normal((int(ratio * n), n))
    d = np.linalg.svd(noise, compute_uv=False)
    edge = np.sqrt(n) * (1 + np.sqrt(ratio))
    assert d[0] < noise_threshold(d, ratio) < 1.25 * edge


def test_of_a_square_matrix_it_is_the_published_constant():
    """2.858 times the median; the polynomial is good to .02 (Gavish and Donoho, section IV)."""
    assert noise_threshold([1.0]) == pytest.approx(2.858, abs=0.02)
