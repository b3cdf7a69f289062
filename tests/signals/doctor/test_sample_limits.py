"""Limits of isolated and of missing samples, tried from just below and just above."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from modalscope.signals.doctor.prediction import _filtered, _gaps, prediction_of
from modalscope.systems import chain5


@pytest.mark.parametrize(("factor", "count"), [(0.97, 0), (1.03, 1)])
def test_an_isolated_sample_exceeds_half_again_what_gaussian_records_reach_once_in_a_thousand(factor, count) -> None:
    """Of an autoregression of order one the error of interpolation has the variance 1 / (1 + phi^2)."""
    phi, samples = 0.9, 20_000
    k, limit = samples // 2, 1.5 * np.sqrt(2 * np.log(samples / 1e-3))
    e = np.random.default_rng(0).standard_normal(samples)
    e[k - 60 : k + 60] *= 0.3  # quiet neighbours: no doubt that one number explains them
    y = lfilter([1], [1, -phi], e)
    y[k] = (phi * (y[k - 1] + y[k + 1]) / (1 + phi**2)) + factor * limit / np.sqrt(1 + phi**2)
    assert len(prediction_of(y[None, :, None]).isolated) == count


@pytest.mark.parametrize(("noise", "count"), [(0.02, 1), (0.03, 0)])
def test_missing_samples_are_said_where_chance_is_below_a_thousandth(noise: float, count: int) -> None:
    """A sample is missing in both records; in the noisier one chance would do as well in one of so many records."""
    y = chain5().simulate(inputs="ambient", samples=4001, sampling_rate=20.0, quantity="velocity", seed=1).outputs
    y = y + noise * y.std(axis=0) * np.random.default_rng(0).standard_normal(y.shape)
    y = np.delete(y, 2000, axis=0)
    assert len(_gaps(prediction_of((y / y.std(axis=0))[None]).first)) == count


@pytest.mark.parametrize(("samples", "count"), [(5000, 41), (300, 20), (41, 41), (90, 7)])
def test_weights_over_neighbouring_samples_are_applied_by_transforms_of_blocks(samples: int, count: int) -> None:
    """Against the plain sum, to rounding of transforms of numbers around one."""
    rng = np.random.default_rng(0)
    x, weights = rng.standard_normal((samples, 3)), rng.standard_normal((5, count, 3))
    plain = [np.einsum("nil,il->n", weights, x[t : t + count]) for t in range(samples - count + 1)]
    assert np.allclose(_filtered(x, weights), plain, rtol=0, atol=1e-12)
