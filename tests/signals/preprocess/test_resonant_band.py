"""Up to where records on lines hold resonances: polynomials leave noise alone, and a resonance wherever there is one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms
from modalscope.data import Signals
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.identification.prepare import measure
from modalscope.numerics.functions.poles import poles_from
from modalscope.signals.preprocess.bands import CHOSEN
from modalscope.signals.preprocess.resonant_band import polynomial_residuals, resonant_band

LINES, RATE = 2000, 100.0


def spectra(response, noise: float, seed: int = 0, outputs: int = 3) -> RecordSpectra:
    """Lines of one run: a response (F, l, 1) to white lines of one input, ends, and white noise."""
    rng = np.random.default_rng(seed)

    def white(*shape):
        return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)

    f = np.arange(1, LINES + 1) * RATE / 2 / (LINES + 1)
    drive, ends = white(LINES, 1), white(1, outputs)
    values = response(f, outputs) * drive + ends + noise * white(LINES, outputs)
    return RecordSpectra(
        values=values[:, :, None],
        frequencies=f,
        drive=drive,
        run=np.zeros(LINES, dtype=int),
        durations=(LINES / RATE * 2,),
        sampling_rate=RATE,
    )


def smooth(f, outputs):
    """A mass line that falls off: nothing resonates in it."""
    return np.arange(1, outputs + 1) * (1 + 0.5j * (f[:, None] / 50) ** 2)


def resonance(at: float, size: float = 1.0, zeta: float = 0.01):
    """A mass line and the acceleration of a mode."""
    return lambda f, outputs: (
        smooth(f, outputs) - size * f[:, None] ** 2 / (at**2 - f[:, None] ** 2 + 2j * zeta * at * f[:, None])
    )


def test_a_smooth_response_and_the_ends_leave_nothing():
    found = polynomial_residuals(spectra(smooth, 0.0), slice(0, LINES))
    assert max(found.narrow.max(), found.wide.max()) < 1e-24


@pytest.mark.slow
@pytest.mark.parametrize("side", ["narrow", "wide"])
def test_of_noise_its_power_is_left(side):
    """The mean of n lines of power s^2, k of them taken by unknowns, is s^2 (n - k) / n: divided by what is free it is s^2."""
    parts = [polynomial_residuals(spectra(smooth, 0.1, seed), slice(0, LINES)) for seed in range(10)]
    power = np.mean([np.average(getattr(p, side), axis=0, weights=p.free) for p in parts], axis=0)
    assert power == pytest.approx(0.01, rel=4 / np.sqrt(10 * parts[0].free.sum()))


@pytest.mark.slow
def test_noise_over_a_smooth_response_hardly_ever_stands_out():
    assert sum(resonant_band(spectra(smooth, 0.1, seed)) is not None for seed in range(30)) <= 1


@pytest.mark.parametrize("at", [2.0, 5.0, 12.0])
@pytest.mark.parametrize("zeta", [1e-4, 0.01, 0.05])
def test_a_resonance_stands_out_whether_lines_resolve_it_or_not(at, zeta):
    band, note = resonant_band(spectra(resonance(at, 0.05, zeta), 0.03))
    assert band[0] == 0
    assert 1.2 * at < band[1] < 1.6 * at + 2  # three bins of .6 Hz, and the margin
    assert note.kind == CHOSEN
    assert f"{band[1]:g} Hz" in note.text


def test_the_highest_of_two_counts_however_weak_it_is():
    def both(f, outputs):
        return resonance(2.0, 1.0)(f, outputs) + resonance(8.0, 0.005)(f, outputs)

    band, _ = resonant_band(spectra(both, 0.03))
    assert band[1] > 1.2 * 8


def test_nothing_is_chosen_where_resonances_reach_up_or_none_is_seen():
    assert resonant_band(spectra(resonance(22.0), 0.1)) is None
    assert resonant_band(spectra(smooth, 0.1)) is None
    assert resonant_band(spectra(resonance(2.0), 0.1).continuous()) is None


def sampled(rate: float, noise: float = 0.005) -> tuple[Signals, np.ndarray]:
    """One minute of four modes below 10 Hz, one of them at .01 of the others' size, sampled at any rate under held forces."""
    rng = np.random.default_rng(1)
    f, zeta = np.array([2.1, 4.4, 6.8, 9.2]), np.array([0.004, 0.006, 0.01, 0.008])
    shapes, u = rng.standard_normal((5, 4)), rng.standard_normal((int(60 * rate), 1))
    shapes[:, 1] *= 0.01
    y = np.zeros((len(u), 5))
    for s, shape in zip(poles_from(f, zeta), shapes.T, strict=True):
        z = np.exp(s / rate)
        x = lfilter([0, (z - 1) / s], [1, -z], u[:, 0].astype(complex))
        y += ((s * x).imag / s.imag)[:, None] * shape
    y += noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return Signals(outputs=y, inputs=u, sampling_rate=rate), f


def test_a_record_sampled_far_beyond_its_modes_takes_its_band_and_tells_why():
    record, f = sampled(300.0)
    found = measure(record)
    assert found.band is not None
    assert f.max() < found.band[1] < 2 * f.max()
    assert found.notes[0].kind == CHOSEN
    asked = measure(record, band=found.band)
    assert np.array_equal(asked.response.values, found.response.values)
    assert [note.kind for note in asked.notes] == ["records on lines"]


def test_a_band_that_is_asked_is_obeyed_and_other_ways_have_none():
    record, _ = sampled(300.0)
    assert measure(record, band=(0.0, 100.0)).response.span[1] > 99
    assert measure(record, route="subspace").band is None
    assert measure(sampled(25.0)[0]).band is None


@pytest.mark.slow
def test_a_weak_mode_is_found_at_thirty_times_the_rate():
    """Of all lines it was lost: those above the modes took the degree."""
    record, f = sampled(300.0, 0.05)
    modes = ms.select(ms.stabilize(record))
    assert modes.frequencies == pytest.approx(f, rel=2e-3)


def test_a_record_of_a_few_samples_has_no_band_and_no_traceback() -> None:
    rng = np.random.default_rng(0)
    record = ms.Signals(outputs=rng.standard_normal((10, 1)), inputs=rng.standard_normal((10, 1)), sampling_rate=100.0)
    assert resonant_band(record_spectra(ms.Records(runs=(record,)))) is None
