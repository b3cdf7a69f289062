"""Take shapes of ambient modes from the lines of the record where other modes overlay them, with participation fitted anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.results import StabilizationDiagram
from modalscope.data.stored import StoredSignals
from modalscope.identification.routes import one_record
from modalscope.likelihood.line_shapes import line_shapes
from modalscope.modal.indicators import mac, mpc, mpd
from modalscope.numerics.checks import ComplexArray
from modalscope.preprocess.harmonics import HARMONIC

__all__ = ["with_line_shapes"]

#: Lines of a machine reach so many of their spreads, and this part of their frequency.
_SPREADS, _MORE = 3.0, 0.002

#: A shape that changes by less, 1 - MAC, is not spoken of.
_CHANGED = 0.01


def with_line_shapes(
    data: Any, exclude: Any, modes: ModalModel, diagrams: Sequence[StabilizationDiagram]
) -> ModalModel:
    """Return modes of a record without inputs with the shapes of `likelihood.line_shapes`; modes of other data as they are.

    A stored record takes part where it fits into memory. `diagrams`: of all bands.
    """
    record = _record(data, exclude)
    if record is None or len(modes) < 2 or len(record.output_dofs) < 2:
        return modes
    numbers = [note.numbers for diagram in diagrams for note in diagram.notes if note.kind == HARMONIC]
    avoided = [(n["frequency_hz"], _SPREADS * n["spread_hz"] + _MORE * n["frequency_hz"]) for n in numbers]
    shapes = line_shapes(record, modes, avoided)
    changed = np.flatnonzero(np.any(shapes != modes.shapes, axis=0))
    if not changed.size:
        return modes
    found = _refitted(modes, shapes, diagrams).normalized("unit")
    alike = np.diag(mac(found.shapes, modes.shapes))
    names = ", ".join(f"{modes.frequencies[j]:.5g} Hz" for j in changed if alike[j] < 1 - _CHANGED)
    if not names:
        return found
    text = f"other modes overlay those at {names}: their shapes were estimated on the lines of the record, as real ones"
    return found.noted(Note("shapes of lines", {"modes": float(changed.size)}, text))


def _record(data: Any, exclude: Any) -> Signals | None:
    """Return the record of the channels that are used, where it is one without inputs and in memory."""
    if not isinstance(data, Signals | StoredSignals | Records) or data.input_dofs:
        return None
    kept = data.select(exclude=exclude) if exclude else data
    if isinstance(kept, Records):
        return one_record(kept, "correlations")
    settled = kept.settled() if isinstance(kept, StoredSignals) else kept
    return settled if isinstance(settled, Signals) else None


def _refitted(modes: ModalModel, shapes: ComplexArray, diagrams: Sequence[StabilizationDiagram]) -> ModalModel:
    """Return modes with other shapes, and participation fitted to the response of their band, whitened as it was identified."""
    assert modes.participation is not None
    participation = modes.participation.copy()
    fields: dict[str, Any] = {}
    for diagram in diagrams:
        low, high = diagram.response.reported_band(diagram.settings.band)
        here = np.flatnonzero((modes.frequencies >= low) & (modes.frequencies <= high))
        if not here.size:
            continue
        some = replace(modes.take(here), shapes=shapes[:, here])
        fitted = _participation(diagram, some)
        participation[here] = fitted.participation
        if len(diagrams) == 1:
            fields = {"feedthrough": fitted.feedthrough}
    indicators = {**modes.indicators}
    changed = np.any(shapes != modes.shapes, axis=0)
    for name, value in (("mpc", mpc(shapes)), ("mpd", mpd(shapes))):
        if name in indicators:
            indicators[name] = np.where(changed, value, indicators[name])
    return replace(modes, shapes=shapes, participation=participation, indicators=indicators, **fields)


def _participation(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    inside, whitening = diagram.whitened(), diagram.whitening
    response = inside.response
    powers = response.outside_powers
    shapes = modes.shapes if whitening is None else whitening.of_shapes(modes.shapes)
    basis = response.basis(modes.poles - response.added_damping, powers).compressed()
    participation, terms = basis.fit_participation(shapes)
    named = response.named_terms(terms, powers)
    found = replace(modes, shapes=shapes, participation=response.of_inputs(participation), **named)
    return found if whitening is None else whitening.modes_back(found)
