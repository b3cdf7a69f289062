"""Deviations of rows from a variance that is known, or that is an estimate itself."""

import numpy as np
import pytest

from modalscope.selection.likelihood.whitening import colour, colour_of_lines, from_variance, residual_spectrum

LINES, AVERAGES = 2000, 4


def estimated(true, seed=0):
    """Variances of the mean of complex noise, estimated from so many averages: chi squared of 2 (n - 1)."""
    rng = np.random.default_rng(seed)
    free = 2 * (AVERAGES - 1)
    return true[:, None, None] * rng.chisquare(free, (len(true), 2, 1)) / free


def test_a_known_variance_is_taken_line_by_line():
    true = np.exp(np.sin(np.arange(LINES) / 3.0))
    by_row, levels = from_variance(np.tile(true[:, None, None], (1, 2, 1)), 2 * LINES)
    assert by_row == pytest.approx(np.tile(np.sqrt(true), 2))
    assert levels.outputs * levels.inputs[0] == pytest.approx(np.full(2, 1 / np.sqrt(2)))


def test_an_estimate_scatters_less_than_its_lines_do():
    """ln of a chi squared over its freedom n scatters by trigamma(n / 2); 21 lines and two channels leave a 42nd, three a sixth."""
    plain, _ = from_variance(estimated(np.ones(LINES)), LINES)
    even, _ = from_variance(estimated(np.ones(LINES)), LINES, scattered=True)
    assert np.std(np.log(even)) < 0.4 * np.std(np.log(plain))
    assert np.min(even) > 0.7 > np.min(plain)  # no line is quiet by chance


def test_a_loud_resonance_stays_as_loud():
    true = np.ones(LINES)
    true[1000:1003] = 100.0
    by_row, _ = from_variance(np.tile(true[:, None, None], (1, 2, 1)), LINES, scattered=True)
    assert by_row[1001] == pytest.approx(10.0)
    assert by_row[900] == pytest.approx(1.0)


def test_the_spectrum_of_a_residual_is_found_from_one_draw_of_its_lines():
    """White noise, and a mode that unmeasured forces shake: the mean over 3000 lines of what is divided by it is one, with one scatter."""
    f, rng = np.linspace(0.01, 0.5, 3000), np.random.default_rng(4)
    x = np.exp(2j * np.pi * f)
    poles = np.exp(np.array([-0.004 + 0.9j, -0.01 + 2.1j]))
    S = 0.3 + 2e-4 / np.abs(x - poles[0]) ** 2
    found = residual_spectrum(S * rng.exponential(size=f.size), x, poles)
    near = np.abs(np.angle(x) - 0.9) < 0.008
    # fifty lines near the pole know their level to 14 %, and 3000 that of the noise to 2 %
    assert np.mean(found[near] / S[near]) == pytest.approx(1, abs=0.3)
    assert np.median(found / S) == pytest.approx(1, abs=0.1)
    assert np.all(found > 0)
    assert residual_spectrum(100 * S, x, poles) == pytest.approx(100 * residual_spectrum(S, x, poles))


def test_lines_that_come_some_after_others_have_the_colour_of_all() -> None:
    e = np.random.default_rng(0).standard_normal((2, 900, 3))
    e[:, 1:] += 0.4 * e[:, :-1]
    whole = colour(e.reshape(1800, 3, 1), 900, 5)
    pieces = colour_of_lines(np.split(e, [1, 300, 301], axis=1), np.mean(e**2, axis=(0, 1)), 900, 5)
    assert (pieces.correlation, pieces.uneven, pieces.excess) == pytest.approx(
        (whole.correlation, whole.uneven, whole.excess)
    )
    power = np.mean(e**2, axis=(0, 1))
    assert whole.correlation == pytest.approx(np.sum(e[:, 1:] * e[:, :-1] / power) / (2 * 899 * 3), rel=1e-12)


def test_a_level_that_the_fit_itself_takes_from_some_lines_is_no_colour() -> None:
    """Many channels show how little a fit leaves of white noise where its functions are large."""
    rng, k = np.random.default_rng(6), np.arange(400)
    e = rng.standard_normal((800, 6000))
    peak = 1 / (0.7 + 1j * (k - 150))
    Q = np.linalg.qr(np.array([np.append(peak.real, peak.imag), np.append(-peak.imag, peak.real)]).T)[0]
    left = (e - Q @ (Q.T @ e))[:, :, None]
    assert colour(left, 400, 2).has_levels
    assert colour(left, 400, 2, kept=1 - np.sum(Q**2, axis=1)).uneven < 2
    assert colour(e[:, :, None], 400, 0).uneven < 2
