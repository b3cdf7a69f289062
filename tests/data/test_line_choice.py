"""Which lines of long records are enough."""

from __future__ import annotations

import numpy as np

from modalscope.data.line_choice import near_modes, running_mean, telling_lines

RNG = np.random.default_rng(0)


def test_the_running_mean_is_that_of_every_window() -> None:
    values, run = RNG.uniform(size=50), np.repeat([0, 1], [20, 30])
    found = running_mean(values, run, 4)
    for k in range(50):
        own = [i for i in range(max(k - 4, 0), min(k + 5, 50)) if run[i] == run[k]]
        assert np.isclose(found[k], values[own].mean())


def test_peaks_are_kept_whole_and_the_rest_evenly() -> None:
    f = np.arange(100_000)
    power = 1 + sum(1e4 / (1 + ((f - peak) / 20) ** 2) for peak in (20_011, 71_234))
    kept = telling_lines(power, np.zeros(f.size, int), 8000)
    assert kept.size == 8000
    assert np.all(np.diff(kept) > 0)
    assert np.diff(kept).max() <= 100_000 // 4000
    for peak in (20_011, 71_234):
        assert set(range(peak - 100, peak + 101)) <= set(kept.tolist())
    assert telling_lines(power[:50], np.zeros(50, int), 50).size == 50


def test_lines_near_the_modes_are_those_within_the_fewest_half_bandwidths() -> None:
    f = np.linspace(0, 100, 10_001)
    poles = 2 * np.pi * np.array([-0.1 + 20j, -1 + 60j])
    kept = f[near_modes(f, poles, 0.01, 2201)]
    apart = np.minimum(np.abs(kept - abs(poles[0]) / 2 / np.pi) / 0.1, np.abs(kept - abs(poles[1]) / 2 / np.pi))
    # 2200 intervals of .01 Hz are 10 half bandwidths on either side of .1 Hz and of 1 Hz
    assert abs(apart.max() - 10) < 0.1
