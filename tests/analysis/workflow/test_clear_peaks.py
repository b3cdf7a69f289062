"""Clear peaks of ambient records: found where three outputs show them, given a mode by more orders, or named."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.ambient_lines import peaks_in, with_note_on_peaks, without_mode
from modalscope.data import Candidate, ModalModel
from modalscope.numerics.functions.poles import poles_from
from modalscope.signals.preprocess.spectral_peaks import Levels, clear_peaks
from tests.selection.judging.any_ambient import cable

BINS = 200
F = 0.5 * 1.01 ** np.arange(BINS)


def levels(height: float, outputs: int, of: int = 4) -> Levels:
    """Return levels of many lines a bin with one peak of three bins in so many of the outputs."""
    values = np.ones((BINS, of))
    values[99:102, :outputs] = np.array([[0.6], [1.0], [0.6]]) * height
    return Levels(F, np.full(BINS, 1000.0), values)


@pytest.mark.parametrize(("height", "clear"), [(9.9, False), (10.1, True)])
def test_a_peak_rises_ten_times(height: float, clear: bool) -> None:
    assert bool(clear_peaks(levels(height, 4))) == clear


@pytest.mark.parametrize(("outputs", "clear"), [(2, False), (3, True)])
def test_a_peak_stands_in_three_outputs(outputs: int, clear: bool) -> None:
    assert clear_peaks(levels(20, outputs)) == ([F[100]] if clear else [])


def test_of_two_outputs_both_show_it() -> None:
    assert clear_peaks(levels(20, 2, of=2)) == [F[100]]
    assert not clear_peaks(levels(20, 1, of=2))


def test_the_skirt_of_a_peak_is_none() -> None:
    made = levels(20, 4)
    made.levels[95] = made.levels[105] = 3.0  # on both flanks, scatter of their levels
    made.levels[96:99] = made.levels[102:105] = 2.0
    assert clear_peaks(made) == [F[100]]


def test_outside_the_bands_and_on_a_machine_nothing_lacks_a_mode() -> None:
    made = levels(20, 4)
    assert peaks_in(made, [(1.0, 2.0)], []) == [F[100]]
    assert not peaks_in(made, [(0.5, 1.0)], [])
    assert not peaks_in(made, [(1.0, 2.0)], [(F[100] * 1.015, 0.0)])


def test_a_peak_without_a_mode_is_named_with_the_reason() -> None:
    left = Candidate(
        frequency=2.0, damping_ratio=0.01, reason="intermittent: found at 30 % of the orders from its first one on"
    )
    modes = ModalModel(
        poles=poles_from(np.array([1.0]), np.array([0.01])), shapes=np.ones((2, 1), complex), left_out=(left,)
    )
    assert without_mode([1.019, 1.021], modes) == [1.021]
    note = with_note_on_peaks(modes, [1.0, 2.01, 3.0]).notes[-1]
    assert note.kind == "peaks without a mode"
    assert "2.01 Hz (intermittent: found at 30 %" in note.text
    assert "3 Hz (no poles agree there)" in note.text


@pytest.mark.slow
def test_fifteen_modes_of_a_cable_ask_for_more_orders() -> None:
    """30 states of its fifteen modes: at orders up to 40 the middle ones are at too few of them."""
    result = ms.analyze(cable(2).record)
    assert len(result.modes) == 15
    assert any(note.kind == "orders grew" for note in result.notes)
