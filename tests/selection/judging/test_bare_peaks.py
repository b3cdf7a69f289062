"""Peaks without a mode are named, each with a reason; noise and single lines are no peaks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse, ModalModel
from modalscope.data.notes import Candidate
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.bare_peaks import BARE, bare_peaks, with_note_on_peaks
from tests.support import add_noise

F = np.linspace(1.0, 40.0, 800)
BAND = (1.0, 40.0)


def response(*modes: tuple[float, float], floor: float = 1.0) -> FrequencyResponse:
    """Return resonances (hz, damping ratio) of height one over a floor, one output and one input."""
    x = 2j * np.pi * F
    H = sum(-s.real / (x - s) for s in poles_from(*np.array(modes).T)) if modes else 0
    return FrequencyResponse(values=(floor + H)[:, None, None], frequencies=F)


def listed(*frequencies: float) -> ModalModel:
    return ModalModel(
        poles=poles_from(frequencies, np.full(len(frequencies), 0.01)),
        shapes=np.ones((1, len(frequencies))),
        participation=np.ones((len(frequencies), 1)),
    )


def test_a_resonance_that_no_mode_explains_is_named_the_highest_first() -> None:
    data = response((8, 0.01), (20, 0.01), (30, 0.005), floor=1e-3)
    assert bare_peaks(data, listed(20.0), BAND) == pytest.approx([30, 8], abs=0.06) or bare_peaks(
        data, listed(20.0), BAND
    ) == pytest.approx([8, 30], abs=0.06)
    assert not bare_peaks(data, listed(8.0, 20.0, 30.0), BAND).size
    assert bare_peaks(data, listed(20.0), (1.0, 25.0)) == pytest.approx([8], abs=0.06)


@pytest.mark.parametrize(("decibel", "named"), [(9.9, 0), (10.1, 1)])
def test_a_peak_counts_from_ten_decibel_on(decibel: float, named: int) -> None:
    bump = 1 + (10 ** (decibel / 20) - 1) * np.exp(-(((F - F[400]) / 0.5) ** 2))
    data = FrequencyResponse(values=(bump * np.exp(0.01j * F))[:, None, None], frequencies=F)
    assert len(bare_peaks(data, listed(), BAND)) == named


def test_a_single_line_and_noise_are_no_peaks() -> None:
    values = response((20, 0.01)).values.copy()
    values[200] += 10
    assert not bare_peaks(FrequencyResponse(values=values, frequencies=F), listed(20.0), BAND).size
    rng = np.random.default_rng(0)
    for _ in range(20):
        noise = rng.standard_normal((800, 3, 1)) + 1j * rng.standard_normal((800, 3, 1))
        assert not bare_peaks(FrequencyResponse(values=noise, frequencies=F), listed(), BAND).size


def test_a_note_says_what_speaks_against_the_candidate_there_and_is_replaced() -> None:
    data = response((8, 0.01), (20, 0.01), floor=1e-3)
    against = Candidate(frequency=8.02, damping_ratio=0.01, gain=1.0, reason="no more than noise", remedy="")
    told = with_note_on_peaks(replace(listed(20.0), left_out=(against,)), data, BAND)
    (note,) = told.notes
    assert (note.kind, note.numbers) == (BARE, {"peaks": 1})
    assert note.text.endswith("Hz (no more than noise)")
    assert "no poles agree there" in with_note_on_peaks(listed(20.0), data, BAND).notes[0].text
    assert with_note_on_peaks(told, data, BAND).notes == told.notes
    assert not with_note_on_peaks(replace(listed(8.0, 20.0), notes=told.notes), data, BAND).notes


def test_lists_that_have_every_peak_say_nothing_and_a_refused_mode_is_named() -> None:
    data = add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 340)), 40, 3)
    diagram = ms.stabilize(data, orders=range(8, 25, 4))
    whole = ms.select(diagram)
    assert BARE not in {note.kind for note in whole.notes}
    less = ms.select(diagram, refuse=[whole.frequencies[3]])
    assert "5.3" in next(note.text for note in less.notes if note.kind == BARE)
    assert BARE not in {note.kind for note in ms.select(diagram, frequencies=whole.frequencies[1:]).notes}
