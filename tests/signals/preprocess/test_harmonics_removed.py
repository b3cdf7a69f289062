"""Lines of machines go from a record and the structure stays."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.signals.preprocess import remove_harmonics
from modalscope.signals.preprocess.harmonics import find_lines
from modalscope.signals.preprocess.harmonics_removed import _Track
from tests.selection.judging.ambient_records import beside_a_machine
from tests.support import refused, relative


@pytest.mark.slow
@pytest.mark.parametrize("wander", [0, 0.003])
def test_lines_go_and_random_vibration_keeps_its_power(wander: float) -> None:
    machine = beside_a_machine(101, wander)
    truth = machine.structure.record(1.2, 102).outputs
    cleaned = remove_harmonics(machine.record)
    assert relative(machine.record.outputs, truth) > 1
    # what differs is the noise in step with the lines, which is put back with other signs
    assert relative(cleaned.outputs, truth) < 0.04
    assert "harmonics at" in cleaned.processing[-1]
    f = np.fft.rfftfreq(len(truth), 1 / machine.record.sampling_rate)
    before, after = (np.sum(np.abs(np.fft.rfft(y, axis=0)) ** 2, axis=1) for y in (truth, cleaned.outputs))
    for line in machine.lines:
        near = np.abs(f / line - 1) < 0.006
        # some tens of lines are as wide as the machine wanders; their powers scatter by a few per cent
        assert after[near].sum() == pytest.approx(before[near].sum(), rel=0.15)


def test_noise_in_step_with_a_wandering_line_is_put_back() -> None:
    """Of one channel half of the noise in the band of the wandering goes with the phase; that of the envelope stands for it."""
    rng, t = np.random.default_rng(0), np.arange(60_000) / 50
    slow = np.convolve(rng.standard_normal(t.size), np.hanning(1500), mode="same")
    phase = 2 * np.pi * np.cumsum(12 * (1 + 0.003 * slow / slow.std())) / 50
    noise = rng.standard_normal((t.size, 1))
    cleaned = remove_harmonics(Signals(outputs=noise + 3 * np.cos(phase)[:, None], sampling_rate=50.0))
    near = np.abs(np.fft.rfftfreq(t.size, 1 / 50) - 12) < 0.05
    before, after = (np.sum(np.abs(np.fft.rfft(y[:, 0])[near]) ** 2) for y in (noise, cleaned.outputs))
    # 120 lines, half of whose power is taken twice: a deviation of .09; .5 without
    assert after == pytest.approx(before, rel=0.2)


def test_no_more_is_taken_off_than_an_envelope_of_zero_says_and_no_line_is_added() -> None:
    """The logarithm of a weak line's envelope has no bounds; between them what is taken off is linear in the noise."""
    noise = np.array([-9.0, -0.5, 0.0, 0.5, 9.0])
    share = _Track(np.zeros(2), np.zeros(5), noise).share(np.arange(5) / 5)
    put_back = (np.sqrt(2) - 1) / 2
    assert share == pytest.approx([np.sqrt(2), 1 + put_back, 1, 1 - put_back, 0], abs=1e-15)


def test_at_constant_speed_nothing_of_a_line_stays() -> None:
    t = np.arange(50_001) / 50
    noise = np.random.default_rng(4).standard_normal((t.size, 3))
    for f in (7.3, 7.3004):  # the run holds no whole number of turns
        line = np.cos(2 * np.pi * f * t[:, None] + [0.0, 1.0, 2.5]) * [3.0, 1.0, 0.2]
        cleaned = remove_harmonics(Signals(outputs=noise + line, sampling_rate=50.0))
        # of 150 000 values some tens go with the line
        assert relative(cleaned.outputs, noise) < 0.03


@pytest.mark.slow
def test_a_band_of_the_machine_that_holds_a_stronger_mode_is_not_widened_into_it() -> None:
    machine = beside_a_machine(91010, 0.003)
    truth = machine.structure.record(1.2, 91011).outputs
    f = np.fft.rfftfreq(len(truth), 1 / machine.record.sampling_rate)
    near = np.abs(f / machine.structure.frequencies[0] - 1) < 0.01
    before, after = (
        np.sum(np.abs(np.fft.rfft(y, axis=0)[near]) ** 2) for y in (truth, remove_harmonics(machine.record).outputs)
    )
    assert after == pytest.approx(before, rel=0.1)


def test_only_the_lines_that_are_named_go() -> None:
    t = np.arange(40_000) / 50
    y = np.random.default_rng(0).standard_normal((t.size, 2))
    both = y + 2 * np.sin(2 * np.pi * 12 * t)[:, None] + 2 * np.sin(2 * np.pi * 17 * t)[:, None]
    cleaned = remove_harmonics(Signals(outputs=both, sampling_rate=50.0), [17.0])
    assert [round(line.frequency, 2) for line in find_lines(cleaned)] == [12.0]


def test_a_record_without_lines_is_returned_as_it_is() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((5000, 2)), sampling_rate=50.0)
    assert remove_harmonics(record) is record


def test_a_line_that_no_run_holds_is_refused() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((5000, 2)), sampling_rate=50.0)
    refused("a harmonic at 30 Hz", remove_harmonics, record, [30.0])


def test_a_run_of_zeros_has_no_line_to_take_off() -> None:
    t = np.arange(4000) / 100.0
    runs = np.stack([np.sin(2 * np.pi * 12 * t) + 0.1 * np.random.default_rng(0).standard_normal(4000), np.zeros(4000)])
    clean = remove_harmonics(Signals(outputs=runs[:, :, None], sampling_rate=100.0), frequencies=[12.0])
    assert np.array_equal(clean.outputs[1], np.zeros((4000, 1)))
    assert clean.outputs[0].std() < 0.2
