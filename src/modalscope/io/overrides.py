"""Fields of data that the caller gives beside the file: they go before what it says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path

from modalscope.io.contents import Options, Thing
from modalscope.io.from_arrays import FIELD_OPTIONS
from modalscope.model import DataError, Signals, StabilizationDiagram
from modalscope.model.channels import Channels
from modalscope.model.groups import AUTO, input_groups
from modalscope.model.shown import summary_of

__all__ = ["overridden"]


def overridden(thing: Thing, options: Options, path: Path | None) -> Thing:
    """Return the data with the fields that the caller gave, which named arrays have used already, and where they came from.

    Parameters
    ----------
    thing : data object
    options : mapping
    path : path, optional
    """
    given = {name: options[name] for name in FIELD_OPTIONS if options.get(name) is not None}
    if isinstance(given.get("units"), Mapping):  # of single columns: used already
        del given["units"]
    if isinstance(thing, Signals) and "quantity" in given:
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
