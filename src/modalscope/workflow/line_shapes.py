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
    participation = modes.known_participation("shapes of the record's lines").copy()
    fields: dict[str, Any] = {}
    for diagram in diagrams:
        low, high = diagram.response.reported_band(diagram.settings.band)
        here = np.flatnonzero((modes.frequencies >= low) & (modes.frequencies <= high))
        participation[here], terms = _participation(diagram, modes.poles[here], shapes[:, here])
        fields = terms if len(diagrams) == 1 else {}
    changed = np.any(shapes != modes.shapes, axis=0)
    told = {"mpc": mpc, "mpd": mpd}
    indicators = {
        name: np.where(changed, told[name](shapes), values) if name in told else values
        for name, values in modes.indicators.items()
    }
    return replace(modes, shapes=shapes, participation=participation, indicators=indicators, **fields)


def _participation(
    diagram: StabilizationDiagram, poles: ComplexArray, shapes: ComplexArray
) -> tuple[ComplexArray, dict[str, Any]]:
    """Return participation (n, m) of modes with these shapes by least squares on the response, and the terms beside them by name."""
    whitening, response = diagram.whitening, diagram.whitened().response
    inside = shapes if whitening is None else whitening.of_shapes(shapes)
    basis = response.basis(poles - response.added_damping, response.outside_powers).compressed()
    participation, terms = basis.fit_participation(inside)
    found = response.of_inputs(participation)
    if whitening is not None:
        found, terms = whitening.references_back(found), whitening.values_back(terms)
    return found, dict(diagram.response.named_terms(terms, response.outside_powers))
