"""The band that a record is given: around what stands out, slower where there is room, drift taken off, wide ones in parts."""

from __future__ import annotations

import numpy as np

from modalscope.data import Signals
from modalscope.preprocess.bands import CHOSEN, at_lower_rate, automatic_bands
from modalscope.preprocess.spectral_peaks import levels_of
from modalscope.systems import chain5
from tests.judging.ambient_records import random_structure


def test_a_record_sampled_too_fast_is_given_the_band_of_its_modes() -> None:
    structure = random_structure(3)
    record = structure.record(5, 0)
    own = automatic_bands(levels_of(record), record.sampling_rate)
    assert own.whole is not None
    assert own.drift is None
    assert own.whole[0] < structure.frequencies[0]
    assert structure.frequencies[-1] < own.whole[1]
    assert own.note((own.whole,)).kind == CHOSEN
    slower = at_lower_rate(record, own.whole[1], own.drift)
    assert 4 * own.whole[1] <= slower.sampling_rate < 8 * own.whole[1]


def test_parts_of_a_wide_band_join_and_no_mode_lies_on_a_joint() -> None:
    record = chain5().simulate(inputs="ambient", duration=1200, sampling_rate=200.0)
    own = automatic_bands(levels_of(record), 200.0)
    assert len(own.parts) == 2
    assert own.parts[0][1] == own.parts[1][0]
    f = chain5().modes().frequencies
    assert np.min(np.abs(f / own.parts[0][1] - 1)) > 0.1
    assert own.whole == (own.parts[0][0], own.parts[1][1])


def test_drift_is_found_said_and_taken_off() -> None:
    structure = random_structure(3)
    calm = structure.record(5, 0)
    walk = np.cumsum(np.random.default_rng(0).standard_normal(calm.outputs.shape), axis=0)
    y = calm.outputs + 20 * walk / np.std(walk, axis=0) * np.std(calm.outputs, axis=0)
    record = Signals(outputs=y, sampling_rate=calm.sampling_rate)
    own = automatic_bands(levels_of(record), record.sampling_rate)
    assert own.whole is not None
    assert own.drift == own.whole[0]
    assert "drift" in str(own.note((own.whole,)))
    before, after = (levels_of(each) for each in (record, at_lower_rate(record, own.whole[1], own.drift)))
    low = before.frequencies < own.drift / 4
    assert np.mean(after.levels[: low.sum()]) < 0.01 * np.mean(before.levels[low])


def test_noise_has_no_band() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((5000, 2)), sampling_rate=100.0)
    assert automatic_bands(levels_of(record), 100.0).whole is None
    assert automatic_bands(levels_of(record), 100.0).parts == ()


def test_a_record_of_a_few_samples_has_no_bands_and_no_error() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((6, 2)), sampling_rate=10.0)
    assert automatic_bands(levels_of(record), record.sampling_rate).parts == ()
