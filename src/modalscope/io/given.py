"""Put what the caller says of data in place of what their file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path

from modalscope.data import DataError, Signals, StabilizationDiagram, StoredSignals
from modalscope.data.channels import AUTO, Channels, input_groups
from modalscope.data.geometry import label_of
from modalscope.data.shown import summary_of
from modalscope.io.contents import DataObject, Options
from modalscope.io.options import FIELDS


def _units_by_label(thing: DataObject, given: Mapping[str, str]) -> tuple[list[str], list[str]] | None:
    """Return the units of all channels with those given by label, or for all outputs or inputs; None where no channel is named.

    Columns of tables have theirs already, by their number or name.
    """
    if not isinstance(thing, Channels):
        return None
    sides = (list(thing.units[0]), list(thing.units[1]))
    changed = False
    for name, unit in given.items():
        for word, side, dofs in zip(("outputs", "inputs"), sides, (thing.output_dofs, thing.input_dofs), strict=True):
            for i, dof in enumerate(dofs):
                if name == word or dof in (name, label_of(name)):
                    side[i], changed = unit, True
    return sides if changed else None


def overridden(thing: DataObject, options: Options, path: Path | None) -> DataObject:
    """Return the data with the fields that the caller gave, which replace those of the file, and their source."""
    given = {name: options[name] for name in FIELDS if options.get(name) is not None}
    if isinstance(given.get("units"), Mapping):
        units = _units_by_label(thing, given.pop("units"))
        given |= {} if units is None else {"units": units}
    if isinstance(thing, Signals | StoredSignals) and "quantity" in given:
        given["quantities"] = given.pop("quantity")
    refused = sorted(set(given) - {field.name for field in fields(thing)})
    if refused:
        fault = f"the file gives {summary_of(thing)}, which has no such field"
        raise DataError(f"the options {', '.join(refused)} were asked", fault, "Leave them out.")
    if isinstance(thing, Channels):
        given |= {} if path is None else {"source_path": path.absolute()}
        if "input_dofs" in given and getattr(thing, "groups", None) == input_groups(thing.input_dofs):
            given.setdefault("groups", AUTO)
    if isinstance(thing, StabilizationDiagram) and path is not None:
        given["response"] = replace(thing.response, source_path=path.absolute())
    return replace(thing, **given) if given else thing
