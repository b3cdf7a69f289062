"""Noise that rises towards 0 Hz is seen, and taken off line by line; other noise, and resonances, are not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms
from benchmarks.records.shaker import shaker
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.identification.prepare import prepare
from modalscope.numerics.functions.poles import poles_from
from modalscope.signals.preprocess import line_noise as lines
from modalscope.signals.preprocess.line_noise import DRIFT, level_lines, line_noise
from tests.support import match_poles, random_system, relative

RATE = 100.0


def noise_of(power: float, rng: np.random.Generator, samples: int, outputs: int) -> np.ndarray:
    """Noise of the spectrum 1 / |x - 1|^(2 power) on the lines of a run."""
    white = np.fft.rfft(rng.standard_normal((samples, outputs)), axis=0)
    x = np.exp(2j * np.pi * np.arange(len(white)) / samples)
    rise = np.abs(np.where(x == 1, 1, x - 1)) ** -power
    return np.fft.irfft(white * rise[:, None], n=samples, axis=0)


def spectra(drift: float, power: float = 1.0, seed: int = 0, noise: float = 0.01) -> RecordSpectra:
    """One minute of four modes, the lowest between two lines or so, under white noise and some that drifts."""
    rng = np.random.default_rng(seed)
    test = shaker(seed, modes=4, outputs=5, seconds=6.0).signals
    y = test.outputs / test.outputs.std(axis=0)
    y = y + noise * (rng.standard_normal(y.shape) + drift * noise_of(power, rng, *y.shape))
    return record_spectra(Records(runs=(replace(test, outputs=y),)))


@pytest.mark.parametrize("power", [0.5, 1.0])
@pytest.mark.parametrize("drift", [1.0, 5.0])
def test_the_spectrum_of_drift_is_seen(drift: float, power: float) -> None:
    found = spectra(drift, power)
    variance = line_noise(found)
    assert variance is not None
    # the record has 1 % of noise of its own
    true = 2 + drift**2 * np.abs(found.points - 1) ** (-2 * power)
    ratio = variance / true
    apart = np.abs(np.log(ratio / np.median(ratio)))
    # on the lowest lines noise that falls is itself nearly a rational function, and some is taken for one
    assert apart[100:].max() < np.log(1.7)
    assert apart[20:].max() < np.log(3)


@pytest.mark.parametrize("noise", [1e-3, 0.01, 0.3])
def test_white_noise_leaves_the_records_as_they_are(noise: float) -> None:
    for seed in range(4):
        given = spectra(0.0, seed=seed, noise=noise)
        taken, notes = level_lines(given)
        assert taken is given
        assert notes == ()


def test_what_a_group_of_lines_around_a_resonance_leaves_is_its_noise() -> None:
    """The resonance lies between two lines, a seventh of their distance wide, a hundred times as large as the noise."""
    samples, noise, left = 4000, 0.01, []
    z = np.exp(poles_from([2.2], [0.003])[0] / RATE)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal((samples, 1))
        y = lfilter([0, 1], [1, -z], u.astype(complex), axis=0).imag * rng.standard_normal(3)
        y = y / y.std(axis=0) + noise * rng.standard_normal(y.shape)
        found = record_spectra(Records(runs=(ms.Signals(outputs=y, inputs=u, sampling_rate=RATE),)))
        at = int(np.argmin(np.abs(found.frequencies - 2.2)))
        left.append(lines._residual_power(found, slice(at - 12, at + 12)))
    # some 36 squares an output: the mean of 24 outputs is known to 5 %; a denominator that is fitted to them, too, takes more
    assert 0.5 < np.mean(left) / noise**2 < 1.1


def test_a_resonance_between_two_lines_is_no_noise() -> None:
    """Half a bandwidth is a seventh of what lines lie apart: no polynomial of the frequency follows it."""
    rng = np.random.default_rng(0)
    samples = 4000
    for low in (1.3, 1.7):
        u, y = rng.standard_normal((samples, 1)), np.zeros((samples, 3))
        for pole, shape in zip(
            poles_from([low, 2.2, 20.0], [0.003, 0.003, 0.01]), rng.standard_normal((3, 3)), strict=True
        ):
            z = np.exp(pole / RATE)
            y += lfilter([0, (z - 1) / pole], [1, -z], u.astype(complex), axis=0).imag * shape
        y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
        record = ms.Signals(outputs=y, inputs=u, sampling_rate=RATE)
        assert level_lines(record_spectra(Records(runs=(record,))))[1] == ()


@pytest.mark.parametrize("runs", [(600,), (401, 556)])
def test_lines_divided_by_any_numbers_give_the_same_poles(
    runs: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The equations hold line by line: poles, direct terms and the rebuilt records are exact whatever every line is divided by."""
    rng = np.random.default_rng(3)
    monkeypatch.setattr(lines, "line_noise", lambda found: np.exp(3 * rng.standard_normal(found.count)))
    model = random_system(rng, modes=2, outputs=2, inputs=2, direct=True)
    parts = []
    for samples in runs:
        u = rng.standard_normal((samples, 2))
        parts.append(ms.Signals(outputs=model.simulate(u, rng.standard_normal(4)), inputs=u, sampling_rate=1.0))
    for method in ("alternate", "era", "polyreference", "least_squares"):
        problem = prepare(parts, method, "z")
        assert problem.response.line_scale is not None
        found = ms.identify(parts, method=method, order=4, block_rows=8)
        match = match_poles(found.poles, np.log(np.linalg.eigvals(model.A).astype(complex)))
        assert max(match.frequency_error, match.damping_error) < 1e-9
        assert relative(found.state_space.D, model.D) < 1e-8
        assert found.fit_error < 1e-8
    assert relative(problem.response.rebuilt_by(model).values, problem.response.values) < 1e-8


def drifting(seed: int) -> tuple[ms.Signals, np.ndarray]:
    test = shaker(seed, modes=5, outputs=6, seconds=5.0)
    rng = np.random.default_rng(seed)
    y = test.signals.outputs
    walk = np.cumsum(rng.standard_normal(y.shape), axis=0)
    return replace(test.signals, outputs=y + walk * y.std(axis=0) / walk.std(axis=0)), test.frequencies


@pytest.mark.slow
def test_modes_are_found_beside_a_random_walk_of_their_size(tmp_path: Path) -> None:
    record, f = drifting(0)
    diagram = ms.stabilize(record)
    assert DRIFT in [note.kind for note in diagram.notes]
    modes = ms.select(diagram)
    assert modes.frequencies == pytest.approx(f, rel=2e-3)
    path = tmp_path / "drift.npz"
    ms.write(path, diagram)
    assert np.array_equal(ms.read(path).response.line_scale, diagram.response.line_scale)


def test_noise_of_responses_is_seen_between_resonances_and_a_smooth_response_is_none() -> None:
    """Modes of a response without noise, however it falls, are no noise: neighbours of its second differences are alike."""
    f = np.arange(1.0, 1001.0)
    shapes = np.eye(3, dtype=complex) + 0.5
    modes = ms.ModalModel(poles=poles_from([40.0, 200.0, 600.0], [0.02] * 3), shapes=shapes, participation=shapes.T)
    smooth = modes.frequency_response(f).values.reshape(len(f), -1)
    rng = np.random.default_rng(1)
    white = rng.standard_normal(smooth.shape) + 1j * rng.standard_normal(smooth.shape)
    rising = np.abs(smooth).max() * white / f[:, None] ** 2
    assert lines.rising_noise(f, smooth) is None
    assert lines.rising_noise(f, smooth + 1e-4 * np.abs(smooth).max() * white) is None
    variance = lines.rising_noise(f, smooth + rising)
    assert variance is not None
    assert np.max(np.abs(np.log(variance / variance[-1] * (f / f[-1]) ** 4))) < np.log(1.5)
    assert lines.rising_noise(f[:9], rising[:9]) is None
    with_dead = np.hstack([smooth + rising, np.where(f == 500, 1e150, 0)[:, None], np.zeros((len(f), 1))])
    assert lines.rising_noise(f, with_dead) == pytest.approx(variance, rel=1e-6)
    assert lines.rising_noise(f, with_dead[:, -2:]) is None


@pytest.mark.slow
def test_modes_of_a_response_that_was_integrated_twice_are_those_of_accelerances() -> None:
    """The same test told in displacements, from 0.25 Hz: all information is there. Half the modes had no interval."""
    rng = np.random.default_rng(2)
    f = np.arange(0.25, 256, 0.25)
    shapes = rng.standard_normal((5, 5)).astype(complex)
    poles = poles_from(np.sort(rng.uniform(20, 200, 5)), np.full(5, 0.01))
    truth = ms.ModalModel(poles=poles, shapes=shapes, participation=shapes[:2].T)
    square = -((2 * np.pi * f)[:, None, None] ** 2)
    accelerance = square * truth.frequency_response(f).values
    noise = rng.standard_normal(accelerance.shape) + 1j * rng.standard_normal(accelerance.shape)
    accelerance = accelerance + 1e-3 * np.abs(accelerance).max(axis=0) * noise
    told = {"acceleration": accelerance, "displacement": accelerance / square}
    first, second = (
        ms.analyze(ms.FrequencyResponse(values=values, frequencies=f, quantity=quantity)).modes
        for quantity, values in told.items()
    )
    assert len(first) == len(second) == 5
    assert [mode.grade for mode in second] == ["good"] * 5
    assert np.all(np.abs(first.frequencies - second.frequencies) < 2 * first.frequencies_std)
    assert np.all(second.frequencies_std < 3 * first.frequencies_std)
