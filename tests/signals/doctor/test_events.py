"""Events: found where they outweigh a record, not where vibration swells and fades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.signals.doctor.records import events
from modalscope.systems import chain5
from tests.selection.judging.ambient_records import random_structure


def _record(seed: int) -> ms.Signals:
    return chain5().simulate(inputs="ambient", duration=400, sampling_rate=20.0, seed=seed)


@pytest.mark.parametrize("strength", [10, 30, 100])
def test_an_earthquake_in_an_ambient_record_is_found_where_it_is(strength: float) -> None:
    record = _record(1)
    t = np.arange(record.samples) / record.sampling_rate
    y = np.asarray(record.outputs)
    shaken = replace(record, outputs=y * (1 + strength * np.exp(-(((t - 250) / 5) ** 2)))[:, None])
    (found,) = [finding for finding in ms.preprocess.examine(shaken) if finding.kind == "event"]
    first, last = (float(word) for word in found.reason.split("between ")[1].split(" s:")[0].split(" and "))
    assert 230 <= first <= 245
    assert 255 <= last <= 270
    assert found.channels == record.output_dofs


def test_the_length_that_is_left_is_that_of_even_power() -> None:
    # one stretch of forty has all power: the record is worth a fortieth
    y = np.full((4000, 2), 1e-9) * np.resize([1.0, -1.0], 4000)[:, None]
    y[800:900] = np.resize([1.0, -1.0], 100)[:, None]
    (found,) = events(ms.Signals(outputs=y, sampling_rate=10.0))
    assert "worth 10 s of steady vibration" in found.reason


@pytest.mark.slow
def test_sound_records_have_no_event() -> None:
    for seed in range(20):
        assert not events(random_structure(700 + seed).record(1, seed))
        t = np.arange(8000) / 20
        gusts = 1 + 0.8 * np.sin(2 * np.pi * t / 100 + seed)  # twice as strong and a tenth, in turn
        record = _record(seed)
        assert not events(replace(record, outputs=np.asarray(record.outputs) * gusts[:, None]))


def test_drift_of_a_period_or_two_is_no_resonance_that_the_record_is_too_short_for() -> None:
    record = _record(3)
    y = np.asarray(record.outputs)
    swing = np.sin(2 * np.pi * 1.3 * np.arange(len(y)) / len(y))
    drifting = replace(record, outputs=y + 2 * y.std() * swing[:, None])
    assert not [finding for finding in ms.preprocess.examine(drifting) if finding.kind == "short record"]
