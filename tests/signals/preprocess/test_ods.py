"""Operating deflection shapes are what was measured at a line: of a single mode they are its shape."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5
from tests.support import refused

CHAIN = chain5()
LINES = np.linspace(0.1, 8, 800)


def test_near_a_lightly_damped_resonance_it_is_the_shape_of_the_mode() -> None:
    modes = CHAIN.modes()
    found = ms.ods(CHAIN.frequency_response(LINES), modes.frequencies)
    likeness = np.diag(ms.mac(found.shapes, modes.shapes))
    assert likeness[:2] == pytest.approx(1, abs=5e-3)  # neighbours take part by their own tails
    assert np.abs(found.frequencies - modes.frequencies).max() <= 0.5 * (LINES[1] - LINES[0]) + 1e-9
    assert (found.damping_ratios == 0).all()


def test_of_one_input_it_is_the_column_of_the_nearest_line() -> None:
    response = CHAIN.frequency_response(LINES)
    label = response.input_dofs[0]
    found = ms.ods(response, 3.0, input=label)
    k = int(np.argmin(np.abs(LINES - 3.0)))
    assert (found.shapes[:, 0] == response.values[k, :, 0]).all()
    assert (ms.ods(response, 3.0, input=0).shapes == found.shapes).all()


def test_of_ambient_records_it_is_the_first_singular_vector() -> None:
    record = CHAIN.simulate(inputs="ambient", samples=20_000, sampling_rate=20.0, seed=0)
    found = ms.ods(record, CHAIN.modes().frequencies[0])
    assert ms.mac(found.shapes, CHAIN.modes().shapes[:, :1])[0, 0] > 0.98


def test_at_a_time_of_a_sweep_it_is_the_motion_of_that_instant() -> None:
    """A sine whose rate and amplitude change slowly: its own amplitude, at its own rate, at four times."""
    t = np.arange(8000) / 200.0
    c, phase = np.array([1 + 0.5j, -2j, 0.3]), 2 * np.pi * (4 * t + 0.1 * t**2)
    y = np.real(c * np.exp(1j * phase)[:, None]) * (1 + 0.2 * np.sin(t / 5))[:, None] + [1.0, 0, -3]
    at = np.array([8.0, 16.0, 24.0, 32.0])
    found = ms.ods(ms.Signals(outputs=y, sampling_rate=200.0), time=at)
    assert found.frequencies == pytest.approx(4 + 0.2 * at, rel=1e-2)
    expected = c[:, None] * np.exp(1j * phase[(200 * at).astype(int)]) * (1 + 0.2 * np.sin(at / 5))
    assert np.abs(found.shapes - expected).max() < 0.05 * np.abs(c).max()


def test_times_without_what_they_need_are_refused() -> None:
    record = ms.Signals(outputs=np.random.default_rng(0).standard_normal((100, 2)), sampling_rate=10.0)
    refused("record lasts", ms.ods, record, time=11.0)
    refused("record lasts", ms.ods, record, time=[])
    refused("at a time", ms.ods, record, 1.0, time=1.0)
    refused("at a time", ms.ods, record, time=1.0, tacho="1")
    refused("several runs", ms.ods, ms.Signals(outputs=np.zeros((3, 100, 2)), sampling_rate=10.0), time=1.0)


def test_what_is_not_there_is_said() -> None:
    response = CHAIN.frequency_response(LINES)
    refused("data go from", ms.ods, response, 80.0)
    refused("there are", ms.ods, response, 1.0, input="nobody")
    refused("no inputs", ms.ods, CHAIN.simulate(inputs="ambient", samples=600, sampling_rate=20.0), 1.0, input=0)


def turning(*, loud: float = 1.0) -> tuple[ms.Signals, np.ndarray, np.ndarray]:
    """A rotor that speeds up from 5 to 9 turns a second: orders 1 and 2.5 in three channels, pulses in a fourth, with noise."""
    rate, samples, rng = 400.0, 4000, np.random.default_rng(0)
    t = np.arange(samples) / rate
    angle = 2 * np.pi * (5 * t + 0.2 * t**2)
    shapes = np.array([[1 + 2j, 0.5, -1j], [loud, 2j * loud, 0.3 * loud]])
    y = sum(np.real(c * np.exp(1j * k * angle)[:, None]) for k, c in zip((1, 2.5), shapes, strict=True)) + 4.0
    pulses = (np.cos(angle) > 0.9) * 5.0
    outputs = np.column_stack([y + 0.05 * rng.standard_normal(y.shape), pulses])
    turns = np.arange(0, int(angle[-1] / (2 * np.pi)) + 1)
    times = (-5 + np.sqrt(25 + 0.8 * turns)) / 0.4
    return ms.Signals(outputs=outputs, sampling_rate=rate, output_dofs=("a", "b", "c", "tacho")), shapes, times


def test_at_orders_of_a_rotation_that_speeds_up_it_is_the_motion_in_phase_with_it() -> None:
    record, shapes, times = turning()
    exact = ms.ods(record.select(exclude=["tacho"]), order=[1, 2.5], tacho=times)
    assert (
        np.abs(exact.shapes.T - shapes).max() < 0.02
    )  # noise .05 over 4000 samples: 2e-3; angle linear between pulses: 1e-2
    assert exact.frequencies == pytest.approx(np.array([1, 2.5]) * (len(times) - 1) / (times[-1] - times[0]))
    read = ms.ods(record, order=[1, 2.5], tacho="tacho")
    assert read.output_dofs == ("a", "b", "c")
    # the first pulse that begins is that of the first whole turn, where cos is .9: the angle counts from there
    late = np.exp(1j * (2 * np.pi - np.arccos(0.9)) * np.array([1, 2.5]))[:, None]
    assert np.abs(read.shapes.T - shapes * late).max() < 0.1  # pulses are seen to a sample, .07 of a turn's radian
    assert np.diag(ms.mac(read.shapes, shapes.T)) == pytest.approx(1, abs=1e-3)


def test_orders_without_what_they_need_are_refused() -> None:
    record, _, times = turning()
    refused("at a time, or at an order", ms.ods, record)
    refused("at a time, or at an order", ms.ods, record, 1.0, order=1, tacho="tacho")
    refused("at a time, or at an order", ms.ods, record, order=1)
    refused("there are a, b, c, tacho", ms.ods, record, order=1, tacho="d")
    refused("2 pulses", ms.ods, record, order=1, tacho=times[:2])
    assert len(ms.ods(record, order=1, tacho=times[:3])) == 1
    refused(
        "several runs",
        ms.ods,
        CHAIN.simulate(inputs="white", samples=100, runs=2, sampling_rate=20.0),
        order=1,
        tacho=times,
    )


def test_the_samples_of_a_tacho_do_as_its_label_does() -> None:
    t = np.arange(2000) / 500
    motion = np.column_stack([np.cos(2 * np.pi * 10 * t), np.sin(2 * np.pi * 10 * t)])
    pulses = (np.mod(10 * t + 0.03, 1) < 0.2) + 0.01 * np.random.default_rng(0).standard_normal(2000)
    alone = ms.Signals(outputs=motion, sampling_rate=500.0)
    beside = ms.Signals(outputs=np.column_stack([motion, pulses]), sampling_rate=500.0)
    by_samples, by_label = ms.ods(alone, order=1, tacho=pulses), ms.ods(beside, order=1, tacho="y3")
    assert (by_samples.shapes == by_label.shapes).all()
    assert by_samples.frequencies == pytest.approx(10, rel=1e-3)
