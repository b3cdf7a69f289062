"""The peak test: modes have peaks in some combination of the channels, noise has none."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.signals.preprocess.spectral_peaks import peak_heights
from tests.selection.judging.dominated import dominated, noise


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_every_mode_has_a_peak_whatever_dominates_it(seed: int) -> None:
    hidden = dominated(seed)
    assert np.all(peak_heights(hidden.record, hidden.frequencies, np.full(len(hidden.frequencies), 0.01)) > 1)


def test_noise_has_a_peak_at_few_places() -> None:
    frequencies = np.linspace(3.0, 9.0, 40)
    records = [noise(seed).record for seed in range(20)]
    found = [peak_heights(each, frequencies, np.full(40, 0.05)) for each in records if each.outputs.shape[1] > 1]
    # the bar is that of one direction, and the best of several is taken: one place in a hundred is allowed
    assert np.mean(np.array(found) > 1) < 0.01


def test_a_low_peak_counts_by_its_lines_and_a_high_one_by_its_height() -> None:
    """A band of noise 1.3 times as loud is known by 2000 lines, and not by 80."""
    rng = np.random.default_rng(0)
    for samples, expected in ((8_000, False), (200_000, True)):
        lines = np.fft.rfft(rng.standard_normal((samples, 2)), axis=0)
        f = np.fft.rfftfreq(samples, 1 / 20.0)
        lines[np.abs(f - 4.0) < 0.1] *= np.sqrt(1.3)
        record = Signals(outputs=np.fft.irfft(lines, n=samples, axis=0), sampling_rate=20.0)
        assert (peak_heights(record, 4.0, 0.025)[0] > 1) == expected


def test_a_single_channel_and_few_lines_are_not_tested() -> None:
    y = np.random.default_rng(0).standard_normal((2000, 6))
    assert np.isinf(peak_heights(Signals(outputs=y[:, :1], sampling_rate=20.0), 4.0, 0.01))
    assert np.isinf(peak_heights(Signals(outputs=y[:60], sampling_rate=20.0), 0.4, 0.01))
    assert np.isfinite(peak_heights(Signals(outputs=y, sampling_rate=20.0), 4.0, 0.01))


@pytest.mark.parametrize(("lines", "clear"), [(0.9, False), (1.1, True)])
def test_a_peak_narrower_than_a_line_may_be_a_sinusoid(lines: float, clear: bool) -> None:
    rng, t = np.random.default_rng(0), np.arange(20_000) / 20.0
    y = 0.1 * rng.standard_normal((t.size, 2)) + np.sin(2 * np.pi * 4.0 * t)[:, None]
    height = peak_heights(Signals(outputs=y, sampling_rate=20.0), 4.0, lines / (4.0 * t.size / 20.0))[0]
    assert (height > 1) == clear
