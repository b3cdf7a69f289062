"""Data in SI: channels multiplied by what their units are, those of unknown units left as they are, with a word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from modalscope.model.channels import QUANTITIES, Channels
from modalscope.model.checks import RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.notes import Note
from modalscope.model.records import Records
from modalscope.model.setups import Setups
from modalscope.model.signals import Signals
from modalscope.model.stored import Picked, StoredSignals
from modalscope.model.units import InSi, in_si

__all__ = ["si_form"]

Data = TypeVar("Data")

#: Units of what has none.
_BARE = ("", "-", "1", "none", "n/a")


def si_form(data: Data) -> tuple[Data, tuple[Note, ...]]:
    """Return data in SI, and what was converted and what was not; other things are returned as they are.

    Parameters
    ----------
    data : Signals, Records, Setups, FrequencyResponse or ImpulseResponse
    """
    if isinstance(data, Records):
        runs, notes = _each(data.runs)
        return replace(data, runs=runs, groups=data.groups), notes
    if isinstance(data, Setups):
        parts, notes = _each(data.parts)
        return replace(data, parts=parts), notes
    if not isinstance(data, Signals | StoredSignals | FrequencyResponse | ImpulseResponse):
        return data, ()
    sides = tuple(_side(units) for units in data.units)
    notes = _notes(data)
    if all(
        f == 1 and new == old
        for side, units in zip(sides, data.units, strict=True)
        for (f, new), old in zip(side, units, strict=True)
    ):
        return data, tuple(note for note in notes if note.kind == "units not known")
    outputs, inputs = (np.array([factor for factor, _ in side]) for side in sides)
    units = (tuple(unit for _, unit in sides[0]), tuple(unit for _, unit in sides[1]))
    changed: Any = replace(data, **_scaled(data, outputs, inputs), units=units, **_quantity(data))
    return changed.processed(str(notes[0])), notes


def _each(parts: Sequence[Signals]) -> tuple[tuple[Signals, ...], tuple[Note, ...]]:
    told = [si_form(part) for part in parts]
    return tuple(part for part, _ in told), tuple(dict.fromkeys(note for _, notes in told for note in notes))


def _side(units: Sequence[str]) -> list[tuple[float, str]]:
    """Return factor and unit of every channel of one side; a unit that is written otherwise than in SI is no other unit."""
    found: list[tuple[InSi | None, str]] = [(in_si(unit), unit) for unit in units]
    return [(1.0, unit) if si is None else (si.factor, unit if si.factor == 1 else si.unit) for si, unit in found]


def _scaled(
    data: Signals | StoredSignals | FrequencyResponse | ImpulseResponse, outputs: RealArray, inputs: RealArray
) -> dict[str, Any]:
    """Return the arrays in SI. A response is a ratio of both sides, a correlation their product."""
    if isinstance(data, StoredSignals):
        return {"rows": Picked(data.rows, tuple(range(len(outputs))), tuple(map(float, outputs)))}
    if isinstance(data, Signals):
        return {"outputs": data.outputs * outputs, "inputs": None if data.inputs is None else data.inputs * inputs}
    by = outputs[:, None] * (inputs if data.origin == "correlation" else 1 / inputs)
    arrays: dict[str, Any] = {"values": data.values * by}
    if isinstance(data, FrequencyResponse):
        return arrays | {"variance": None if data.variance is None else data.variance * by**2}
    return arrays | {"feedthrough": None if data.feedthrough is None else data.feedthrough * by}


def _quantity(data: Signals | StoredSignals | FrequencyResponse | ImpulseResponse) -> dict[str, Any]:
    """Return the quantity that the units say where it was not given."""
    kinds = [None if (si := in_si(unit)) is None or si.kind not in QUANTITIES else si.kind for unit in data.units[0]]
    if isinstance(data, Signals | StoredSignals):
        return {"quantities": tuple(q or kind for q, kind in zip(data.quantities, kinds, strict=True))}
    known = set(kinds)
    return {"quantity": data.quantity or (known.pop() if len(known) == 1 else None)}


def _notes(data: Channels) -> tuple[Note, ...]:
    turned: dict[str, list[str]] = {}
    unknown: dict[str, list[str]] = {}
    for units, dofs in zip(data.units, (data.output_dofs, data.input_dofs), strict=True):
        for unit, dof in zip(units, dofs, strict=True):
            si = in_si(unit)
            if si is None and unit.strip() not in _BARE:
                unknown.setdefault(unit, []).append(dof)
            elif si is not None and si.factor != 1:
                turned.setdefault(f"{unit} to {si.unit} (times {si.factor:.7g})", []).append(dof)
    notes = []
    if turned:
        words = "; ".join(f"{_some(dofs)} from {how}" for how, dofs in turned.items())
        notes.append(Note("units", {}, f"converted to SI: {words}"))
    for unit, channels in unknown.items():
        text = f"the unit {unit} of {_some(channels)} is not known: values stay in it, and modal masses are not in kg"
        notes.append(Note("units not known", {}, text))
    return tuple(notes)


def _some(dofs: Sequence[str]) -> str:
    return ", ".join(dofs[:3]) + (f" and {len(dofs) - 3} more" if len(dofs) > 3 else "")
