"""Recorders that started apart are named from the jump that impulse responses begin with; sound records are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.shaker import shaker
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.delays import delayed, late


def shifted(samples: int, channels: slice) -> ms.Signals:
    """Four modes at six outputs, some of the outputs so many samples late."""
    test = shaker(3, modes=4, outputs=6, seconds=12.0).signals
    y, u, N = test.outputs, test.inputs, test.outputs.shape[0]
    moved = y[60:].copy()
    moved[:, channels] = y[60 - samples : N - samples, channels]
    return ms.Signals(outputs=moved, inputs=u[60:], sampling_rate=1024.0, quantities="acceleration")


@pytest.mark.parametrize("samples", [10, 25, 60])
def test_outputs_that_all_come_late_are_named_with_the_delay(samples: int) -> None:
    (found,) = late(shifted(samples, slice(None)))
    assert found.kind == "delay"
    assert len(found.channels) == 6
    assert f"by {samples} samples" in found.reason
    assert "to keep the delays: --delays none" in found.change


@pytest.mark.parametrize("samples", [12, 40])
def test_an_output_that_alone_comes_late_is_named(samples: int) -> None:
    (found,) = late(shifted(samples, slice(2, 3)))
    assert found.channels == ("y3",)
    assert f"by {samples} samples" in found.reason


def test_nothing_is_said_of_sound_records_short_ones_and_those_without_forces() -> None:
    sound = shifted(0, slice(None))
    assert late(sound) == []
    assert late(ms.Signals(outputs=sound.outputs, sampling_rate=1024.0)) == []
    assert late(ms.Signals(outputs=sound.outputs[:300], inputs=sound.inputs[:300], sampling_rate=1024.0)) == []


@pytest.mark.parametrize("force", [0.0, -3.0, 0.1])
def test_forces_that_never_change_say_nothing_of_delays(force: float) -> None:
    """Rounding of a mean is no force either."""
    late_all = shifted(20, slice(None))
    resting = np.full((late_all.samples, 1), force)
    assert late(replace(late_all, inputs=resting, input_dofs=None, units=None)) == []
    one_more = np.column_stack([late_all.inputs, resting])
    (found,) = late(replace(late_all, inputs=one_more, input_dofs=None, units=None))
    assert "by 20 samples" in found.reason


def test_the_examination_names_it() -> None:
    assert [found.kind for found in examine(shifted(20, slice(None)))] == ["delay"]


def test_displacements_that_grow_from_rest_are_not_late() -> None:
    """One slow mode sampled finely: its response rises for a hundred samples."""
    rng = np.random.default_rng(0)
    model = ms.StateSpace(A=[[0, 1], [-1, -0.04]], B=[[0], [1]], C=[[1, 0], [0.5, 0]]).to_discrete(0.02)
    u = rng.standard_normal((20000, 1))
    assert late(ms.Signals(outputs=model.simulate(u), inputs=u, sampling_rate=50.0)) == []


@pytest.mark.parametrize(("moved", "option"), [(slice(1, 2), True), (slice(2, 4), True), ([0, 2, 3, 4, 5], False)])
def test_displacements_late_after_forces_have_an_option_and_early_ones_none(
    moved: slice | list[int], option: bool
) -> None:
    """Their responses grow from zero; what others move by tells how late one is, and no output can come before its force."""
    test = shaker(3, modes=4, outputs=6, seconds=40.0).signals
    record = ms.Signals(outputs=test.outputs, inputs=test.inputs, sampling_rate=1024.0, quantities="acceleration")
    y = np.cumsum(np.cumsum(record.outputs - record.outputs.mean(axis=0), axis=0), axis=0)  # slow drift goes below
    y = y - np.apply_along_axis(lambda c: np.convolve(c, np.ones(401) / 401, "same"), 0, y)
    y, u = y[500:-500], record.inputs[500:-500]
    late_ones = y[20:].copy()
    late_ones[:, moved] = y[8:-12, moved]
    found = delayed(ms.Signals(outputs=late_ones, inputs=u[20:], sampling_rate=1024.0))
    assert found
    assert all(("--delays" in finding.change) == option for finding in found)
