"""Sums of lagged products: the plain definition, whatever the chunks and the blocks within them."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import Signals, estimate_correlation
from modalscope.signals.preprocess import stored_correlation as lag_sums
from modalscope.signals.preprocess.stored_correlation import LagSum

#: Rounding of sums of some thousand products, of the largest sum.
ROUNDING = 1e-13


def plainly(y: np.ndarray, references: list[int], lags: int) -> np.ndarray:
    return np.stack([y[k:].T @ y[: len(y) - k, references] for k in range(lags + 1)])


@pytest.mark.parametrize(("samples", "lags"), [(50, 7), (5000, 30), (6000, 2500), (3000, 1)])
def test_blocks_give_the_plain_sums(samples: int, lags: int) -> None:
    y = np.random.default_rng(0).standard_normal((samples, 3)) + 5
    total = LagSum(3, [0, 2], lags)
    total.mean = y.mean(axis=0)
    total.add(y)
    expected = plainly(y - y.mean(axis=0), [0, 2], lags)
    assert np.abs(total.finish() - expected).max() < ROUNDING * np.abs(expected).max()


def test_chunks_that_reach_into_the_next_add_up_in_any_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """And with cross spectra of one reference at a time, a few blocks together."""
    monkeypatch.setattr(lag_sums, "_MAX_CROSS_SPECTRA", 1)
    monkeypatch.setattr(lag_sums, "_MAX_TRANSFORMS", 5000)
    y, lags = np.random.default_rng(1).standard_normal((7000, 2)), 40
    total = LagSum(2, [1, 0], lags)
    for start in (5000, 0, 2300):
        stop = {5000: 7000, 0: 2300, 2300: 5000}[start]
        total.add(y[start : stop + lags], times=stop - start)
    expected = plainly(y, [1, 0], lags)
    assert np.abs(total.finish() - expected).max() < ROUNDING * np.abs(expected).max()


def test_a_correlation_is_all_products_over_their_number_averaged_over_runs() -> None:
    y = np.random.default_rng(2).standard_normal((3, 400, 2)) + np.array([1.0, -2.0])
    found = estimate_correlation(Signals(outputs=y, sampling_rate=1.0), lags=20)
    centred = y - y.mean(axis=1, keepdims=True)
    expected = sum(plainly(run, [0, 1], 20) for run in centred) / (3 * (400 - np.arange(21)))[:, None, None]
    assert np.abs(found.values - expected[1:]).max() < ROUNDING
