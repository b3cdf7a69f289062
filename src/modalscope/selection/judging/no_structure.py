"""Explain ambient lists: harmonics of machines, noise alone, and why no mode is reported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Candidate as LeftOut, Harmonic, Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.results import StabilizationDiagram
from modalscope.selection.judging.evidence import CERTAIN, UNCERTAIN, Candidate
from modalscope.selection.judging.grades import grades
from modalscope.signals.preprocess.bands import driven_share
from modalscope.signals.preprocess.harmonics import HARMONIC
from modalscope.signals.preprocess.spectral_peaks import NOISE, UNSEEN

#: The kind of the note that says that errors of a response may pass for modes.
CORRELATED = "correlated errors"

#: A pole belongs to a rotating-machine line within this many standard deviations of the line plus this fraction of its frequency.
_LINE_SPREADS, _LINE_FREQUENCY_SHARE = 3.0, 0.002

#: Half width of a normal distribution at half its height, sqrt(2 ln 2) standard deviations: the half bandwidth of a line that wanders.
_HALF_WIDTH_OF_NORMAL = 1.18


#: Forces have no power where it is below this part of their largest: no transducer resolves 80 dB below what it is driven to.
_NO_POWER = 1e-8


def harmonics_of_diagram(diagram: StabilizationDiagram) -> tuple[Harmonic, ...]:
    """Return the lines of machines that were found in the record of a diagram."""
    found = []
    for note in diagram.notes:
        if note.kind == HARMONIC:
            order = note.numbers.get("order")
            found.append(
                Harmonic(
                    frequency=note.numbers["frequency_hz"],
                    order=None if order is None else int(order),
                    level=note.numbers["level"],
                    evidence=note.text,
                )
            )
    return tuple(found)


def with_objections_of_record(diagram: StabilizationDiagram, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates with what the record as a whole says against them."""
    lines = [note for note in diagram.notes if note.kind == HARMONIC]
    alone = next((note for note in diagram.notes if note.kind == NOISE), None)
    unseen = next((note for note in diagram.notes if note.kind == UNSEEN), None)
    judged, of_tone = [], _objections_of_tone(diagram, candidates)
    for c in candidates:
        against = [f"harmonic of a rotating machine: {line.text}" for line in lines if _is_line(c, line)]
        against += of_tone(c)
        if c.facts.get("peak_height", np.inf) < 1:
            against.append("no peak in the spectra of any combination of channels")
        if alone is not None:
            against.append(alone.text)
        elif unseen is not None and not c.facts.get("left_open", np.inf) < CERTAIN:
            against.append(unseen.text)
        judged.append(replace(c, against=(*c.against, *against)) if against else c)
    return judged


def _objections_of_tone(
    diagram: StabilizationDiagram, candidates: Sequence[Candidate]
) -> Callable[[Candidate], list[str]]:
    """Return what speaks against poles at multiples of the strongest tone of a decay, and against more than one where it moves."""
    response = diagram.response
    if not response.decaying:
        return lambda c: []
    from modalscope.signals.preprocess.decays import tone_of  # few tests are decays

    rate, tone = response.sampling_rate, tone_of(response.values)
    if tone is None or rate is None:
        return lambda c: []
    f = tone.frequency * rate
    copies = [c for c in candidates if tone.first and tone.holds(c.frequency / rate)]
    copies.sort(key=lambda c: (bool(c.against), -c.facts.get("gain", 0.0)))

    def of(c: Candidate) -> list[str]:
        found = [f"{k} times {f:.5g} Hz, made by it" for k in tone.multiples if tone.holds(c.frequency / rate, k)]
        one = any(c is copy for copy in copies[1:])
        return [*found, f"{f:.5g} Hz goes with the size of its motion: one mode"] if one else found

    return of


def without_unforced(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    """Return modes without those that are doubtful where the forces of a record have no power.

    What a run begins with shows modes there, too: those that it determines stay.
    """
    response = diagram.response
    if not isinstance(response, RecordSpectra) or not len(modes):
        return modes
    doubtful = np.array(["doubtful" in grade.words.values() for grade in grades(modes)])
    gone = doubtful & (driven_share(response, modes.frequencies) < _NO_POWER)
    if not gone.any():
        return modes
    left = tuple(
        LeftOut(
            frequency=float(modes.frequencies[j]),
            damping_ratio=float(modes.damping_ratios[j]),
            gain=np.nan if modes.gain is None else float(modes.gain[j]),
            reason="forces have no power at its frequency",
            remedy="Excite the structure there.",
        )
        for j in np.flatnonzero(gone)
    )
    return replace(modes.take(~gone), left_out=(*modes.left_out, *left))


def _is_line(c: Candidate, line: Note) -> bool:
    """Whether poles lie on a line, and are no more damped than its wandering explains or not known at all: a peak there is the line's."""
    f = line.numbers["frequency_hz"]
    spread = line.numbers["spread_hz"]
    near = abs(c.frequency - f) < _LINE_SPREADS * spread + _LINE_FREQUENCY_SHARE * f
    open_there = c.facts.get("left_open", 0.0) >= UNCERTAIN
    return near and (
        open_there or c.damping * c.frequency < max(_HALF_WIDTH_OF_NORMAL * spread, _LINE_FREQUENCY_SHARE * f)
    )


def with_note_on_errors(modes: ModalModel, diagram: StabilizationDiagram) -> ModalModel:
    """Return modes of samples that were counted, not weighed against noise, with a note that errors may be among them.

    Errors of Markov parameters that follow from a record are themselves the response of a system of many states, the observer's: every
    order fits them as well as the modes, and nothing in the response tells one from the other.
    """
    response = diagram.response
    weighed = any(
        "gain" in why for why in (*modes.reasons, *({"gain": c.gain} for c in modes.left_out if np.isfinite(c.gain)))
    )
    if weighed or response.ambient or response.grid is not None or diagram.exact_rank is not None or not len(modes):
        return modes
    text = (
        "Errors of these samples are correlated: no mode was tested for significance, and weak modes may be errors. "
        "Identify the record itself if you have it"
    )
    return modes.noted((Note(CORRELATED, {}, text),))


def with_note_on_empty(modes: ModalModel, diagram: StabilizationDiagram) -> ModalModel:
    """Return a result with its harmonics, and with a note of why it is empty where it is."""
    modes = replace(modes, harmonics=harmonics_of_diagram(diagram))
    if len(modes):
        return modes
    alone = [note for note in diagram.notes if note.kind == NOISE]
    left = modes.left_out
    why = (
        "; ".join(f"{c.frequency:.4g} Hz ({c.reason})" for c in left[:3])
        or f"no poles agree between orders {diagram.orders[0]} and {diagram.orders[-1]}"
    )
    text = alone[0].text if alone else f"No mode: {why}"
    return modes.noted((Note("no modes", {"left_out": float(len(left))}, text),))
