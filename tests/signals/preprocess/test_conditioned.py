"""Ambient records with nothing set: their band is chosen, said, and repeated by the settings to the last bit."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.signals.preprocess import ambient_records, decimate
from modalscope.signals.preprocess.ambient_records import bands_of_record, looked_through
from modalscope.signals.preprocess.harmonics import lines_in
from tests.selection.judging.ambient_records import random_structure
from tests.support import refused

STRUCTURE = random_structure(11)
RECORD = STRUCTURE.record(5, 0)
SHORT = ms.Signals(outputs=RECORD.outputs[:20_000], sampling_rate=RECORD.sampling_rate, quantities=RECORD.quantities)


def test_the_settings_repeat_the_diagram_to_the_last_bit() -> None:
    first = ms.stabilize(SHORT)
    assert first.settings.band is not None
    again = ms.stabilize(SHORT, band=first.settings.band)
    assert np.array_equal(first.frequencies, again.frequencies)
    assert np.array_equal(first.damping_ratios, again.damping_ratios)


def test_a_decimated_copy_gives_the_same_modes_within_a_deviation() -> None:
    fast, slow = (ms.select(ms.stabilize(record)) for record in (RECORD, decimate(RECORD, 2)))
    assert len(fast) == len(slow) == len(STRUCTURE.frequencies)
    assert np.all(np.abs(fast.frequencies - slow.frequencies) < fast.frequencies_std)
    assert np.all(np.abs(fast.damping_ratios - slow.damping_ratios) < fast.damping_ratios_std)


def test_what_was_chosen_is_told_once() -> None:
    result = ms.analyze(SHORT, orders=[10, 20], refine=False)
    assert len([note for note in result.notes if "chosen" in note.kind]) == 1
    assert np.array_equal(ms.replay(result.analysis, SHORT).modes.poles, result.modes.poles)


def test_matrix_fractions_take_half_spectra() -> None:
    modes = ms.select(ms.stabilize(RECORD, method="lscf", band=(0.5, 4.0), orders=range(4, 25, 4)))
    nearest = [np.min(np.abs(STRUCTURE.frequencies / f - 1)) for f in modes.frequencies]
    # every one is true; a weak one may be missed: the errors of lines of correlations are taken for independent
    assert len(modes) >= 2
    assert np.max(nearest) < 0.01


def test_powers_that_lines_cannot_tell_apart_are_refused_in_words():
    cut = ms.preprocess.half_spectra(ms.estimate_correlation(SHORT), lines=4001).band(0.5, 1.2)
    refused("polynomials to degree", ms.stabilize, cut, method="lscf", orders=[20])
    assert ms.stabilize(cut, method="lscf").orders[-1] < 20


def test_data_that_are_no_ambient_records_have_no_bands() -> None:
    assert bands_of_record(ms.estimate_correlation(SHORT)) == ((), ())


def test_a_record_is_looked_through_once_for_all_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same numbers to the last bit as from the record itself, without one of its channels, too."""
    looked = []
    monkeypatch.setattr(ambient_records, "lines_in", lambda seen: looked.append(seen) or lines_in(seen))
    bands = ((0.5, 2.0), (2.0, 4.0))
    result = ms.analyze(SHORT, band=bands, exclude=[0], orders=[10, 16])
    assert len(looked) == 1
    seen = looked_through(SHORT, [0])
    for band, diagram in zip(bands, result.diagrams, strict=True):
        alone = ms.stabilize(SHORT, band=band, exclude=[0], orders=[10, 16])
        assert np.array_equal(alone.poles, ms.stabilize(seen, band=band, exclude=[0], orders=[10, 16]).poles)
        assert np.array_equal(alone.poles, diagram.poles)
        assert [str(note) for note in alone.notes] == [str(note) for note in diagram.notes]
