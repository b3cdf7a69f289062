"""Where resonances stand out of a record: in none of noise, and from the lowest mode to the highest of a structure at any rate."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from modalscope.data import Signals
from modalscope.signals.preprocess.spectral_peaks import Levels, levels_of
from tests.selection.judging.ambient_records import random_structure


def record(seed: int, samples: int = 20_000, outputs: int = 3) -> Signals:
    return Signals(outputs=np.random.default_rng(seed).standard_normal((samples, outputs)), sampling_rate=100.0)


def prominent_span(levels: Levels) -> tuple[float, float] | None:
    """Return the lowest and the highest frequency (Hz) at which something stands out; None where nothing does."""
    shown = levels.frequencies[levels.in_peak]
    return (float(shown[0]), float(shown[-1])) if shown.size else None


def test_levels_are_those_of_white_noise() -> None:
    levels = levels_of(record(0))
    # unit variance over 0 to 50 Hz, the largest of 60 000 values lies between 4 and 8; bins of 1 % of 40 Hz hold 80 lines
    assert np.allclose(levels.levels[-30:].mean(), 1 / 50 / 4**2, rtol=0.05)


def test_a_line_of_a_machine_moves_no_level() -> None:
    noise = record(1)
    hum = 5 * np.sin(2 * np.pi * 20 * np.arange(noise.samples) / 100)
    with_line = Signals(outputs=noise.outputs + hum[:, None], sampling_rate=100.0)
    assert prominent_span(levels_of(with_line)) is None


@pytest.mark.slow
def test_chance_shows_something_in_one_record_of_a_thousand() -> None:
    seen = sum(prominent_span(levels_of(record(seed, 5000, 1 + seed % 5))) is not None for seed in range(60))
    assert seen <= 2  # .06 are expected; neighbouring bins are not quite independent


@pytest.mark.parametrize("trials", [1, 50])
def test_the_more_heights_are_looked_at_the_higher_chance_may_reach(trials: int) -> None:
    # the mean of three bins of 2 n lines, n = 10 (ln 2)^2 / 1.5 worth each: a gamma variable of shape 3 n over 3 n, and all
    # heights of 20 bins together exceed their bars in one record of a thousand
    shape = 3 * 10 * np.log(2) ** 2 / 1.5
    bars = Levels(np.arange(1.0, 21), np.full(20, 10.0), np.ones((20, 1))).limits(trials)
    assert scipy.stats.gamma.sf(bars * shape, shape) * 20 * trials == pytest.approx(np.full(20, 1e-3))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("times", [1, 5])
def test_the_span_holds_all_modes_at_any_rate(seed: int, times: float) -> None:
    structure = random_structure(seed)
    span = prominent_span(levels_of(structure.record(times, seed)))
    assert span is not None
    # a peak stands out on its flanks, too: some tenths of its frequency
    assert 0.8 * structure.frequencies[0] < span[0] < 1.01 * structure.frequencies[0]
    assert 0.99 * structure.frequencies[-1] < span[1] < 1.2 * structure.frequencies[-1]


def test_levels_are_medians_of_the_periodogram_and_heights_those_of_their_neighbourhood() -> None:
    """Against scipy's periodogram and plain medians, bin by bin; two runs are averaged."""
    rng = np.random.default_rng(5)
    y = np.cumsum(rng.standard_normal((2, 6001, 3)), axis=1) * [1.0, 1e-9, 1e6] + [5.0, 0.0, -2e6]
    levels = levels_of(Signals(outputs=y, sampling_rate=20.0))
    f, power = scipy.signal.periodogram(y, 20.0, "hann", detrend="linear", axis=1)
    first = 2
    for k in (0, 1, 40, len(levels.frequencies) - 1):
        start = first + int(levels.widths[:k].sum())
        stop = start + int(levels.widths[k])
        expected = np.median(power.mean(axis=0)[start:stop], axis=0) / np.log(2)
        size = 2.0 ** (2 * (np.frexp(np.abs(y).max())[1] - 1))
        np.testing.assert_allclose(levels.levels[k], expected / size, rtol=1e-9)
        assert levels.frequencies[k] == pytest.approx((f[start] + f[stop - 1]) / 2)
    logs, ln_f = np.log(levels.levels), np.log(levels.frequencies)
    for i in (0, 8, 30, 60, len(logs) - 12, len(logs) - 1):
        near = min(
            np.sum((ln_f >= ln_f[i] - 0.25) & (ln_f < ln_f[i])), np.sum((ln_f > ln_f[i]) & (ln_f < ln_f[i] + 0.25))
        )
        far = min(max(near, 8), 60, i, len(logs) - 1 - i)
        around = np.median(logs[i - far : i + far + 1], axis=0) if far >= 8 else logs[i]
        np.testing.assert_allclose(levels.heights[i], np.exp(logs[i] - around), rtol=1e-12)
