"""Levels of stretches: gusts and disturbances are found where they are, and steady records stay as they are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from modalscope.data import Signals, StoredSignals
from modalscope.signals.preprocess import steady
from modalscope.signals.preprocess.ambient_records import seen_record
from modalscope.signals.preprocess.spectra import Spectrum
from modalscope.signals.preprocess.steady import steadied

Array = NDArray[np.float64]
RATE = 10.0


def resonance(seed: int, f: float = 1.3, zeta: float = 0.02, samples: int = 20_000) -> Array:
    """Return two channels of one mode in white forces, with noise of a hundredth, (N, 2)."""
    rng = np.random.default_rng(seed)
    pole = np.exp((-zeta + 1j * np.sqrt(1 - zeta**2)) * 2 * np.pi * f / RATE)
    q = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(samples))
    return np.asarray(np.outer(q, [1.0, -0.6]) / q.std() + 0.01 * rng.standard_normal((samples, 2)))


def levels(y: Array) -> tuple[float, float] | None:
    """Return the least and the largest level of a record; None where it is steady."""
    record = Signals(outputs=y, sampling_rate=RATE)
    found = steadied(record, Spectrum.of(record))
    return None if found is None else (found.note.numbers["least"], found.note.numbers["largest"])


def test_a_record_of_zeros_has_no_level() -> None:
    assert levels(np.zeros((4000, 2))) is None


def test_steady_records_stay_as_they_are() -> None:
    """Also where the mode rings as long as a stretch lasts: 800 s at .1 % damping."""
    assert not any(levels(resonance(seed)) for seed in range(10))
    assert not any(levels(resonance(seed, f=0.2, zeta=0.004)) for seed in range(10))


def test_slow_gusts_are_divided_out() -> None:
    t = np.arange(20_000) / 20_000
    gust = np.exp(0.7 * np.sin(2 * np.pi * 3 * t))
    record = Signals(outputs=resonance(0) * gust[:, None], sampling_rate=RATE)
    found = steadied(record, Spectrum.of(record))
    assert found is not None
    left = found.record.outputs[:, 0] / resonance(0)[:, 0]
    # of the factor e^(2 * .7) = 4.1: the level of a stretch of 50 s is known to a fifth
    assert np.quantile(left, 0.9) / np.quantile(left, 0.1) < 1.6


def test_a_disturbance_of_one_channel_is_found_where_it_is() -> None:
    y = resonance(1)
    y[8000:8600, 1] += 3 * np.random.default_rng(0).standard_normal(600)
    record = Signals(outputs=y, sampling_rate=RATE)
    found = steadied(record, Spectrum.of(record))
    assert found is not None
    assert "from 750 to 950 s" in found.note.text
    assert np.std(found.record.outputs[8000:8600, 1]) < 0.2
    assert np.allclose(found.record.outputs[:7000], y[:7000])


def test_a_disturbance_counts_from_four_times_the_power() -> None:
    """White noise has one power in all parts of its spectrum."""
    rng = np.random.default_rng(2)
    y = rng.standard_normal((40_000, 3))
    for factor, named in ((3.4, False), (4.6, True)):
        z = y.copy()
        z[10_000:11_000, 0] *= np.sqrt(factor)
        assert (levels(z) is not None) == named


def test_a_stretch_of_a_thousand_times_the_power_is_another_test() -> None:
    y = resonance(3)
    for factor, same in ((500.0, False), (2000.0, True)):
        z = y.copy()
        z[10_000:10_500] *= np.sqrt(factor / np.mean(y[10_000:10_500] ** 2, axis=0) * np.mean(y**2, axis=0))
        assert (levels(z) is None) == same


def test_a_gap_is_not_raised() -> None:
    y = resonance(4)
    y[5000:6100] = 0.0
    y[5000:6100] += 1e-6
    found = levels(y)
    assert found is None or found[0] > 0.3


def test_stored_records_and_runs_have_the_same_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    y = resonance(5)
    y[8000:8500] *= 8

    class Held:
        identity, shape = "held", y.shape

        def read(self, start: int, stop: int) -> Array:
            return y[start:stop]

    whole = Signals(outputs=y, sampling_rate=RATE)
    own = steadied(whole, Spectrum.of(whole))
    stored = steadied(StoredSignals(rows=Held(), sampling_rate=RATE), Spectrum.of(whole))
    runs = Signals(outputs=y.reshape(4, 5000, 2), sampling_rate=RATE)
    by_run = steadied(runs, Spectrum.of(runs))
    assert own
    assert stored
    assert by_run
    assert np.allclose(stored.record.rows.read(7500, 9000), own.record.outputs[7500:9000])
    assert "of run 2" in by_run.note.text
    assert np.std(by_run.record.outputs[1, 3000:3500]) < np.std(y[8000:8500]) / 4
    monkeypatch.setattr(steady, "_STRETCHES", 20_000)
    assert steadied(whole, Spectrum.of(whole)) is None


def test_the_loudest_stretch_stays_where_it_shows_the_most() -> None:
    """A passage raises a second mode out of the noise; a burst of noise raises nothing."""
    y = 0.02 * resonance(6, samples=80_000) + np.random.default_rng(9).standard_normal((80_000, 2)) * 0.2
    passage, burst = y.copy(), y.copy()
    for f in (0.7, 1.3, 2.4, 3.6):
        passage[20_000:28_000] += 1.5 * resonance(7, f=f, samples=8000)
    burst[20_000:28_000] += 4 * np.random.default_rng(8).standard_normal((8000, 2))
    seen = [seen_record(Signals(outputs=z, sampling_rate=RATE)) for z in (passage, burst)]
    assert [bool(each.level) for each in seen] == [False, True]
