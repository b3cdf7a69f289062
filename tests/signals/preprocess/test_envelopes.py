"""Narrow bands: what they are worth, and the bound by which most are passed over."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.signals.preprocess import harmonics as envelopes
from modalscope.signals.preprocess.harmonics import lines_around, narrow_band, steady_bands
from modalscope.signals.preprocess.spectra import Spectrum


@pytest.mark.parametrize("count", [12, 37, 400])
@pytest.mark.parametrize("half", [0.5, 3.0, 40.0])
def test_no_spectrum_is_worth_more_than_the_bound(count: int, half: float) -> None:
    """Flat ones, single lines, all power at both ends, powers over ten decades."""
    rng, step = np.random.default_rng(0), 0.01
    centre = half * step / envelopes.MIN_DAMPING
    ends = np.zeros(count)
    ends[[0, -1]] = 1
    spectra = [np.ones(count), np.eye(count)[3], ends, *(10 ** rng.uniform(-10, 0, (20, count)))]
    worth = [envelopes._independent(power, step, centre, 70.0) for power in spectra]
    most = envelopes._most_independent(count, step, half, 70.0)
    assert max(worth) <= most
    if half < 1:
        assert most < 4.1 * max(
            worth
        )  # two, for a cosine instead of a flat spectrum, and two for the term that is taken off


@pytest.mark.parametrize("hum", [0.0, 0.03, 0.3])
def test_no_band_that_is_unlikely_is_passed_over(hum: float) -> None:
    t = np.arange(20_000) / 50
    y = np.random.default_rng(1).standard_normal((t.size, 3)) + hum * np.sin(2 * np.pi * 12.3 * t)[:, None]
    spectrum = Spectrum.of(Signals(outputs=y, sampling_rate=50.0))
    f = np.linspace(8.0, 20.0, 100)
    first, count = lines_around(spectrum, f, 0.02 * f)
    bands = [narrow_band(spectrum, each, 0.02 * each) for each in f]
    for chance in (1e-3, 1e-5):
        seen = {band.first: band for band in steady_bands(spectrum, first, count, chance)}
        for start, band in zip(first, bands, strict=True):
            assert band is not None
            assert band.chance >= chance or seen[start].chance == pytest.approx(band.chance, rel=1e-9)
        assert len(seen) < 50  # nearly all that are passed over are so by the bound
    assert lines_around(spectrum, np.array([0.05, 25.0, 5.0]), np.array([0.02, 0.1, 0.1]))[1].tolist() == [0, 0, 41]


def test_more_values_with_the_same_envelope_are_less_likely() -> None:
    """Where the chance is small at all, which is where the bound is asked."""
    n = np.geomspace(2, 1000, 60)
    for g in np.linspace(0.01, 1, 60):
        chances = np.array([envelopes._chance(g, each) for each in n])
        rising = np.diff(chances) > 0
        assert np.all(chances[1:][rising] > 1e-3)


def test_the_combination_is_that_of_most_power() -> None:
    rng = np.random.default_rng(2)
    for lines, outputs in ((5, 9), (40, 6)):
        X = rng.standard_normal((lines, outputs)) + 1j * rng.standard_normal((lines, outputs))
        found = envelopes._strongest(X)
        assert np.isclose(np.linalg.norm(found), 1)
        assert np.isclose(np.linalg.norm(X @ found), np.linalg.norm(X, 2))
