"""Reading the layout of `modalscope.io.arrays`: renaming, order of axes, and one noun out of named arrays."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from modalscope.io.arrays import AXES, GEOMETRY, INDICATOR, UNREFINED, names_of, noun_of
from modalscope.io.columns import contents_from_table
from modalscope.io.contents import Contents, Finding, Options, Thing
from modalscope.io.field_values import field_value
from modalscope.io.geometry_arrays import damaged, geometry_of_arrays
from modalscope.io.hints import listed, unknown_arrays
from modalscope.io.increments import with_vectors
from modalscope.io.loose import meaning_of
from modalscope.io.members import Lists, lists_of, meant_by, stacked_runs
from modalscope.model import DataError, FrequencyResponse, Geometry, ImpulseResponse, ModalModel, Signals, StateSpace
from modalscope.model.checks import Array
from modalscope.model.shown import counted

__all__ = ["ARRAY_OPTIONS", "FIELD_OPTIONS", "contents_from_arrays"]

#: Options of the formats that hold named arrays.
ARRAY_OPTIONS = ("rename", "axes", "ignore", "columns", "transpose", "rows")

#: Fields of a noun that may be given, or overridden, while it is read from any format.
FIELD_OPTIONS = (
    "quantity",
    "quantities",
    "sampling_rate",
    "kind",
    "output_dofs",
    "input_dofs",
    "units",
    "geometry",
    "averages",
    "added_damping",
    "groups",
)

#: The arrays without which there is no such data object.
_NEEDED: dict[type[Any], set[str]] = {
    FrequencyResponse: {"frequencies", "values"},
    ImpulseResponse: {"sampling_rate", "values"},
    Signals: {"sampling_rate", "outputs"},
    ModalModel: {"poles", "shapes"},
    StateSpace: {"A", "B", "C"},
    Geometry: set(),
}


def contents_from_arrays(
    where: str, arrays: Mapping[str, Array], options: Options, *, members: bool = False
) -> Contents:
    """Make the noun that named arrays describe.

    Parameters
    ----------
    where : str
        The file, for messages.
    arrays : mapping
        Name -> array, as they stand in the file.
    options : mapping
        `rename` (name in the file -> name of the layout), `axes` (name of the layout -> the axes as they stand in the
        file, such as "inputs outputs lines"; an axis that is not named has length 1), `ignore` (names to leave), and any
        of `FIELD_OPTIONS`.
    members : bool
        Whether names such as `runs{2}` and `test(2).acc` are those of members of lists (`modalscope.io.members`).

    Raises
    ------
    DataError
        Unknown arrays, none that make a noun, text where numbers belong, or whatever the noun refuses.
    """
    rename, ignore = dict(options.get("rename") or {}), _as_names(options.get("ignore"))
    known = {part for name in arrays for part in (meant_by(name) if members else (name,))}
    absent = sorted((set(rename) | set(ignore)) - known)
    if absent:
        raise DataError(
            f"rename or ignore of {', '.join(absent)} was asked",
            f"{where} holds {listed(arrays)}",
            "Name arrays that are there.",
        )
    left = {name for name in arrays if name in ignore or (members and meant_by(name) & set(ignore))}
    lists = lists_of(where, {name: array for name, array in arrays.items() if name not in left}) if members else None
    if lists is not None:
        return _without_lists(where, lists, arrays, left, options)
    held = {rename.get(name, name): array for name, array in arrays.items() if name not in left}
    given = _fields(options)
    noun = noun_of(held)
    known = set() if noun is None else names_of(noun)
    unknown = [name for name in held if name not in known and not _of_modes(noun, name)]
    if noun is None or unknown:
        return _by_evidence(where, held, unknown, noun, options)
    _refuse_rows(where, options)
    held = _with_axes(held, noun, dict(options.get("axes") or {}))
    thing = _build(where, noun, held, given)
    return Contents(thing=thing, findings=_told(arrays, left))


def _refuse_rows(where: str, options: Options) -> None:
    if options.get("rows") is not None:
        raise DataError(f"rows of {where} were asked", "it is no table", "Cut its arrays before they are saved.")


def _told(arrays: Mapping[str, Array], left: Collection[str]) -> tuple[Finding, ...]:
    """Return a finding an array; those that were ignored say so."""
    taken = [Finding(part=name, what=_what(array)) for name, array in arrays.items() if name not in left]
    ignored = [Finding(part=k, what=_what(arrays[k]), taken=False, reason="ignore names it") for k in sorted(left)]
    return (*taken, *ignored)


def _without_lists(
    where: str, lists: Lists, arrays: Mapping[str, Array], left: Collection[str], options: Options
) -> Contents:
    """Make what arrays are among which there were lists: one object of all, or the runs of a record, each read by itself."""
    further = {**options, "ignore": None}
    told = _told(arrays, left)
    if not lists.runs:
        found = contents_from_arrays(where, lists.arrays, further)
        return replace(found, findings=(*found.findings, *(part for part in told if not part.taken)))
    runs = [contents_from_arrays(where, run, further) for run in lists.runs]
    thing = stacked_runs(where, [run.thing for run in runs])
    notes = (f"{counted(len(runs), 'run')}, one a member of its lists", *(note for run in runs for note in run.notes))
    return Contents(thing=thing, findings=told, notes=tuple(dict.fromkeys(notes)))


def _fields(options: Options) -> dict[str, Any]:
    """Return the fields that were given; units of single channels are told apart by their labels, once these are known."""
    given = {name: options[name] for name in FIELD_OPTIONS if options.get(name) is not None}
    return {name: value for name, value in given.items() if not (name == "units" and isinstance(value, Mapping))}


def _by_evidence(
    where: str, held: dict[str, Array], unknown: list[str], noun: type[Any] | None, options: Options
) -> Contents:
    """Make what arrays of other names are by their names and shapes, or raise where these say nothing."""
    whole = noun is not None and _NEEDED[noun] <= {
        *held,
        *(name for name in FIELD_OPTIONS if options.get(name) is not None),
    }
    if not whole:
        held = with_vectors(held)
    meant = None if whole or options.get("axes") else meaning_of(where, held, options)
    if meant is None:
        raise unknown_arrays(where, unknown or list(held), noun)
    if meant.table is not None:
        found = contents_from_table(meant.table, {**options, "ignore": None})
        return replace(found, notes=(*meant.notes, *found.notes))
    _refuse_rows(where, options)
    arrays = dict(meant.arrays or {})
    given = _fields(options)
    thing = _build(where, noun_of(arrays) or Signals, arrays, given)
    findings = [
        Finding(
            part=name, what=_what(array), taken=name not in meant.left, reason="nothing takes it" * (name in meant.left)
        )
        for name, array in held.items()
    ]
    return Contents(thing=thing, findings=tuple(findings), notes=meant.notes)


def _of_modes(noun: type[Any] | None, name: str) -> bool:
    """Whether modes may have an array of this name: indicators, and what the modes were before their refinement."""
    if noun is not ModalModel:
        return False
    return name.removeprefix(UNREFINED) in names_of(noun) or name.removeprefix(UNREFINED).startswith(INDICATOR)


def _as_names(names: Any) -> list[str]:
    return [names] if isinstance(names, str) else list(names or ())


def _what(array: Array) -> str:
    return f"{array.dtype} {'x'.join(map(str, array.shape))}" if array.ndim else f"{array.dtype} {array}"


def _with_axes(held: dict[str, Array], noun: type[Any], axes: dict[str, Any]) -> dict[str, Array]:
    """Return the arrays with their axes in the order of the noun."""
    expected: dict[str, tuple[str, ...]] = AXES.get(noun, {})
    for name, order in axes.items():
        stored = tuple(order.split()) if isinstance(order, str) else tuple(order)
        wanted = expected.get(name, ())
        if (
            name not in held
            or len(set(stored)) != len(stored)
            or not set(stored) <= set(wanted)
            or len(stored) != held[name].ndim
        ):
            shape = f"its shape is {held[name].shape}" if name in held else "there is no such array"
            raise DataError(
                f"axes={{{name!r}: {' '.join(stored)!r}}} was asked",
                f"{shape}, and its axes may be {', '.join(wanted) or 'none'}",
                "Name each axis of the stored array once, in its order.",
            )
        array = np.transpose(held[name], [stored.index(axis) for axis in wanted if axis in stored])
        array = np.expand_dims(array, [i for i, axis in enumerate(wanted) if axis not in stored])
        held = held | {name: array[0] if wanted[0] == "runs" and "runs" not in stored else array}
    return held


def _build(where: str, noun: type[Any], held: dict[str, Array], given: dict[str, Any]) -> Thing:
    before = {name.removeprefix(UNREFINED): array for name, array in held.items() if name.startswith(UNREFINED)}
    values: dict[str, Any] = {
        name: field_value(where, name, array) for name, array in held.items() if not name.startswith(UNREFINED)
    }
    if noun is Geometry:
        return geometry_of_arrays(where, values)
    if noun is StateSpace:
        _check_fields(where, noun, values, given)
        return StateSpace(**values)
    units = (values.pop("output_units", None), values.pop("input_units", None))
    geometry = {name: values.pop(name) for name in GEOMETRY if name in values}
    indicators = {name.removeprefix(INDICATOR): values.pop(name) for name in list(values) if name.startswith(INDICATOR)}
    values |= (
        {"units": units}
        | ({"geometry": geometry_of_arrays(where, geometry)} if geometry else {})
        | ({"indicators": indicators} if indicators else {})
        | ({"unrefined": _build(where, noun, before, {})} if before else {})
        | given
    )
    if noun is Signals and "quantity" in values:
        values["quantities"] = values.pop("quantity")
    _check_fields(where, noun, values, given)
    try:
        thing: Thing = noun(**values)
    except DataError:
        raise
    except (TypeError, KeyError, AttributeError, IndexError, OverflowError, ValueError) as error:
        # JSON text in it may hold anything
        raise damaged(where, f"{type(error).__name__}: {error}") from None
    return thing


def _check_fields(where: str, noun: type[Any], values: dict[str, Any], given: dict[str, Any]) -> None:
    """Raise where a field that the noun needs is missing, or one was asked for that it does not have."""
    present = {f.name for f in fields(noun)}
    needed = sorted(present & {"values", "frequencies", "sampling_rate", "outputs", "poles", "shapes"})
    free = {"sampling_rate"} if noun is FrequencyResponse else set()
    missing = [name for name in needed if name not in values and name not in free]
    if missing:
        raise DataError(
            f"reading {where} as {noun.__name__} needs {', '.join(needed)}",
            f"{', '.join(missing)} are missing",
            "Add the array, or give it as an option.",
        )
    refused = sorted(set(given) - present - {"quantity"})
    if refused:
        raise DataError(
            f"the options {', '.join(refused)} were asked", f"a {noun.__name__} has no such field", "Leave them out."
        )
