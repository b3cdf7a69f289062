"""Responses on lines that an exponential window was put over: its noise is correlated from line to line, and tells less."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.selection.likelihood.whitening import colour, gain_factor_under_window

RATE, SAMPLES, LAST = 20.0, 512, 0.01
TIME = np.arange(SAMPLES) / RATE
DECAY = -np.log(LAST) / TIME[-1]


def windowed(samples: RealArray) -> tuple[ComplexArray, RealArray]:
    """Return the lines of samples (T, l, m) under the window, and their frequencies."""
    under = samples * np.exp(-DECAY * TIME)[:, None, None]
    return np.fft.rfft(under, axis=0) / RATE, np.fft.rfftfreq(SAMPLES, 1 / RATE)


def response_of(seed: int, decibel: float = 40.0) -> FrequencyResponse:
    """Return five storeys struck at two floors, with noise before the window."""
    clean = ms.systems.chain5().state_space(dt=1 / RATE).impulse_response(SAMPLES).values
    rng = np.random.default_rng(seed)
    noise = np.sqrt(np.mean(clean**2, axis=0)) * 10 ** (-decibel / 20)
    lines, f = windowed(clean + noise * rng.standard_normal(clean.shape))
    inside = (f > 0.4) & (f < 8)
    return FrequencyResponse(
        values=lines[inside], frequencies=f[inside], sampling_rate=RATE, added_damping=DECAY, quantity="acceleration"
    )


def test_lines_under_a_window_list_the_modes_and_none_of_the_noise() -> None:
    # without the window counted 11 to 32 were listed
    modes = ms.select(ms.stabilize(response_of(0), domain="z", orders=range(4, 25, 4)))
    truth = ms.systems.chain5().modes().frequencies
    assert modes.frequencies == pytest.approx(truth, rel=0.01)


def test_noise_under_the_window_is_no_coloured_noise_and_white_noise_is_none_without() -> None:
    rng = np.random.default_rng(0)
    lines, _ = windowed(rng.standard_normal((SAMPLES, 3, 2)))
    length = DECAY * SAMPLES / RATE
    rows = np.concatenate([lines[5:-5].real, lines[5:-5].imag])
    assert not colour(rows, len(rows) // 2, 0, window=length).coloured
    assert colour(rows, len(rows) // 2, 0).coloured
    white = rng.standard_normal(rows.shape)
    assert not colour(white, len(rows) // 2, 0).coloured
    assert colour(white, len(rows) // 2, 0, window=length).coloured


def test_a_mode_under_a_window_stands_out_by_what_plain_sums_say() -> None:
    t = (np.arange(4000) + 0.5) / 4000
    for window, decay in ((4.6, 4.6), (4.6, 30.0), (0.5, 2.0)):
        w, r = np.exp(-2 * window * t), np.exp(-2 * decay * t)
        plain = w.mean() * r.mean() / (w * r).mean()
        assert gain_factor_under_window(window, np.array([decay]))[0] == pytest.approx(plain, rel=1e-4)
    assert gain_factor_under_window(1e-12, np.array([3.0]))[0] == pytest.approx(1)
