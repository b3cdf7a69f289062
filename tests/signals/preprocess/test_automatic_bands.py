"""The band that a record is given: around what stands out, slower where there is room, drift taken off, wide ones in parts."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import Signals
from modalscope.signals.preprocess.bands import CHOSEN, at_lower_rate, automatic_bands
from modalscope.signals.preprocess.spectral_peaks import levels_of
from modalscope.systems import chain5
from tests.selection.judging.ambient_records import random_structure


@pytest.fixture(scope="module")
def calm() -> Signals:
    return random_structure(3).record(5, 0)


def test_a_record_sampled_too_fast_is_given_the_band_of_its_modes(calm: Signals) -> None:
    structure, record = random_structure(3), calm
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


def test_drift_is_found_said_and_taken_off(calm: Signals) -> None:
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


def tones(highest: float, rate: float = 100.0) -> Signals:
    """Return a record of two outputs with modes at 8 Hz and at `highest`."""
    rng, t = np.random.default_rng(4), np.arange(400) / rate
    kernels = [np.exp(-0.02 * 2 * np.pi * f * t) * np.sin(2 * np.pi * f * t) for f in (8.0, highest)]
    noise = rng.standard_normal((2, 20_000))
    moved = [np.convolve(each, kernel)[:20_000] for each, kernel in zip(noise, kernels, strict=True)]
    y = np.array([[1.0, 0.5], [-0.6, 1.0]]) @ [each / each.std() for each in moved]
    return Signals(outputs=y.T, sampling_rate=rate)


@pytest.mark.parametrize(("highest", "end"), [(38.0, None), (44.0, 40.0)])
def test_peaks_above_four_fifths_of_half_the_rate_are_no_reason_to_search_there(
    highest: float, end: float | None
) -> None:
    own = automatic_bands(levels_of(tones(highest)), 100.0)
    if end is None:  # as far as its peaks reach, but not beyond
        assert own.folded is None
        assert own.whole is None or own.whole[1] <= 40.0
        return
    assert own.whole is not None
    assert own.whole[1] == own.parts[-1][1] <= end
    told = own.note(own.parts).text
    assert "peaks above 0.8 of half the sampling rate may be aliases: to search there, --band 40 50" in told


def test_a_record_with_peaks_above_that_end_alone_has_no_band() -> None:
    rng, t = np.random.default_rng(4), np.arange(400) / 100.0
    kernel = np.exp(-0.01 * 2 * np.pi * 46.0 * t) * np.sin(2 * np.pi * 46.0 * t)
    moved = np.convolve(rng.standard_normal(20_000), kernel)[:20_000]
    record = Signals(outputs=(moved + 3 * rng.standard_normal(20_000))[:, None], sampling_rate=100.0)
    levels = levels_of(record)
    assert np.any(levels.in_peak)
    assert levels.frequencies[levels.in_peak].min() > 40.0
    assert automatic_bands(levels, 100.0).whole is None


def test_an_analysis_ends_where_aliases_begin_unless_it_is_asked() -> None:
    found = ms.analyze(tones(44.0), orders=[4, 8, 12])
    assert found.modes.frequencies == pytest.approx([8.0], rel=0.01)
    assert any("--band 40 50" in note.text for note in found.notes)
    assert ms.analyze(tones(44.0), band=(2, 50), orders=[4, 8, 12]).modes.frequencies == pytest.approx(
        [8.0, 44.0], rel=0.01
    )
