"""Fields of data that the caller gives beside the file: they go before what it says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path

from modalscope.io.contents import Options, Thing
from modalscope.io.from_arrays import FIELD_OPTIONS
from modalscope.model import DataError, Signals, StabilizationDiagram, StoredSignals
from modalscope.model.channels import Channels
from modalscope.model.groups import AUTO, input_groups
from modalscope.model.labels import label_of
from modalscope.model.shown import summary_of

__all__ = ["overridden"]


def _of_channels(thing: Thing, given: Mapping[str, str]) -> tuple[list[str], list[str]] | None:
    """Return the units of all channels with those given by label, or for all outputs or inputs; None where nothing names a channel.

    Columns of tables have theirs already, by their number or name.
    """
    if not isinstance(thing, Channels):
        return None
    sides = [list(units) for units in thing.units]
    found = False
    for name, unit in given.items():
        for word, side, dofs in zip(("outputs", "inputs"), sides, (thing.output_dofs, thing.input_dofs), strict=True):
            places = (
                range(len(dofs)) if name == word else [i for i, dof in enumerate(dofs) if dof in (name, label_of(name))]
            )
            for i in places:
                side[i], found = unit, True
    return (sides[0], sides[1]) if found else None


def overridden(thing: Thing, options: Options, path: Path | None) -> Thing:
    """Return the data with the fields that the caller gave, which named arrays have used already, and where they came from.

    Parameters
    ----------
    thing : data object
    options : mapping
    path : path, optional
    """
    given = {name: options[name] for name in FIELD_OPTIONS if options.get(name) is not None}
    if isinstance(given.get("units"), Mapping):
        units = _of_channels(thing, given.pop("units"))
        given |= {} if units is None else {"units": units}
    if isinstance(thing, Signals | StoredSignals) and "quantity" in given:
        given["quantities"] = given.pop("quantity")
    refused = sorted(set(given) - {field.name for field in fields(thing)})
    if refused:
        raise DataError(
            f"the options {', '.join(refused)} were asked",
            f"the file gives {summary_of(thing)}, which has no such field",
            "Leave them out.",
        )
    if isinstance(thing, Channels):
        given |= {} if path is None else {"source_path": path.absolute()}
        if "input_dofs" in given and getattr(thing, "groups", None) == input_groups(thing.input_dofs):
            given.setdefault("groups", AUTO)
    if isinstance(thing, StabilizationDiagram) and path is not None:
        given["response"] = replace(thing.response, source_path=path.absolute())
    return replace(thing, **given) if given else thing
