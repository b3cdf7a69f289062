"""Build data objects from named arrays: renaming, order of axes, and values that options override."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import fields, replace
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Signals,
    StabilizationDiagram,
    StateSpace,
    StoredSignals,
)
from modalscope.data.channels import AUTO, Channels, input_groups
from modalscope.data.geometry import label_of
from modalscope.data.shown import counted, summary_of
from modalscope.io.arrays import (
    AXES,
    GEOMETRY,
    INDICATOR,
    UNREFINED,
    damaged,
    field_value,
    geometry_of_arrays,
    names_of,
    noun_of,
)
from modalscope.io.columns import contents_from_table
from modalscope.io.columns.words import kind_of_unit
from modalscope.io.contents import Contents, DataObject, Finding, Options
from modalscope.io.loose import Lists, lists_of, meaning_of, meant_by, stacked_runs
from modalscope.numerics.checks import Array

# --------------------------------------------------------------------------------------------------------------- hints
# What to say about arrays whose names are not known: the nearest that are.

#: So many names of arrays are told in a message.
_NAMED = 12

#: Names that others use; only for the hint of an error message.
_OTHERS = {
    "fs": "sampling_rate", "rate": "sampling_rate", "f": "frequencies", "freq": "frequencies", "freqs": "frequencies",
    "frequency": "frequencies", "h": "values", "frf": "values", "y": "outputs", "acc": "outputs", "data": "outputs",
    "u": "inputs", "force": "inputs", "phi": "shapes",
}  # fmt: skip


def listed(names: Iterable[str]) -> str:
    """Return the first of the names: a file may have thousands."""
    first = list(islice(names, _NAMED + 1))
    return ", ".join([*first[:_NAMED], *(["..."] if len(first) > _NAMED else [])]) or "(none)"


def unknown_arrays(where: str, names: list[str], noun: type[Any] | None) -> DataError:
    """Return the error about arrays that make no data object, or are none of its fields.

    `names`: of the arrays. `noun`: the data object that the others make.
    """
    known: list[str] = (
        sorted(names_of(noun))
        if noun
        else ["frequencies", "values", "sampling_rate", "outputs", "inputs", "poles", "shapes"]
    )
    hints = {}
    for name in names[:_NAMED]:
        near = _OTHERS.get(name.lower()) or next(iter(get_close_matches(name, known, n=1)), None)
        if near in known:
            hints[name] = near
    rename = f"rename={hints or {names[0] if names else 'y': 'outputs'}}"
    return DataError(
        f"reading {where} needs `frequencies` and `values`, `sampling_rate` with `outputs` (and `inputs`) "
        "or with `values`, or `poles` and `shapes`",
        f"the arrays {listed(names)} are unknown" + (f" beside those of {noun.__name__}" if noun else ""),
        f"Rename them, read(..., {rename}), or leave them out, read(..., ignore={names[:3]}).",
    )


# ---------------------------------------------------------------------------------------------------------- increments
# Axes that analysers write as a start, an increment and a number: `x_values` beside `y_values`, as Testlab exports structures.

_INCREMENT = re.compile(r"(?P<of>(?:.*\.)?)x_values\.increment\Z")


def with_vectors(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Return arrays with the vector x(k) = start + k increment, k < number, in the place of the scalars that give it.

    It is of frequencies where `y_values` are complex or the unit says so, else of times. Equal vectors of several signals are one.
    Arrays without such scalars are returned as they are.

    Examples
    --------
    >>> held = {"Signal.x_values.increment": np.array([[0.5]]), "Signal.y_values.values": np.zeros((3, 2))}
    >>> {name: array.tolist() for name, array in with_vectors(held).items() if name.endswith("time")}
    {'Signal.x_values.time': [0.0, 0.5, 1.0]}
    """
    held = dict(arrays)
    vectors: list[Array] = []
    for name in arrays:
        found = _INCREMENT.match(name)
        vector = None if found is None else _vector(found["of"], arrays)
        if found is None or vector is None:
            continue
        for part in [part for part in held if part.startswith(f"{found['of']}x_values.")]:
            del held[part]
        if not any(np.array_equal(vector, other) for other in vectors):
            held[f"{found['of']}x_values.{_kind(found['of'], arrays)}"] = vector
            vectors.append(vector)
    return held


def _vector(of: str, arrays: Mapping[str, Array]) -> Array | None:
    """Return the axis; None where a scalar is none, or the number is not that of the values beside it."""
    values = _values(of, arrays)
    step, start = _scalar(arrays.get(f"{of}x_values.increment")), _scalar(arrays.get(f"{of}x_values.start_value"))
    number = _scalar(arrays.get(f"{of}x_values.number_of_values"))
    if values is None or step is None or step <= 0:
        return None
    count = max(values.shape) if number is None else int(number)
    if count not in values.shape:
        return None
    return (start or 0.0) + step * np.arange(count)


def _values(of: str, arrays: Mapping[str, Array]) -> Array | None:
    """Return the first numbers of the values beside an axis."""
    named = (array for name, array in arrays.items() if name.startswith(f"{of}y_values"))
    return next((array for array in named if array.dtype.kind in "biufc" and array.size > 1), None)


def _scalar(array: Array | None) -> float | None:
    """Return a finite number; None for anything else."""
    if array is None or array.size != 1 or array.dtype.kind not in "biuf" or not np.isfinite(array).all():
        return None
    return float(array.reshape(-1)[0])


def _kind(of: str, arrays: Mapping[str, Array]) -> str:
    values = _values(of, arrays)
    told = [
        str(array) for name, array in arrays.items() if name.startswith(f"{of}x_values.quantity") and not array.ndim
    ]
    lines = (values is not None and np.iscomplexobj(values)) or any(kind_of_unit(text) == "frequency" for text in told)
    return "frequency" if lines else "time"


# --------------------------------------------------------------------------------------------------------- from arrays

#: Options of the formats that hold named arrays.
ARRAY_OPTIONS = ("rename", "axes", "ignore", "columns", "transpose", "rows", "resample")

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

    `arrays`: name -> array, as they stand in the file. `options`: `rename` (name in the file -> name of the layout), `axes` (name of the
    layout -> the axes as they stand in the file, such as "inputs outputs lines"; an axis that is not named has length 1), `ignore` (names
    to leave), and any of `FIELD_OPTIONS`. `members`: whether names such as `runs{2}` and `test(2).acc` are those of members of lists
    (`modalscope.io.loose`).

    Raises `DataError`: unknown arrays, none that make a noun, text where numbers belong, or whatever the noun refuses.
    """
    rename, ignore = dict(options.get("rename") or {}), _as_names(options.get("ignore"))
    known = {part for name in arrays for part in (meant_by(name) if members else (name,))}
    absent = sorted((set(rename) | set(ignore)) - known)
    if absent:
        fault = f"{where} holds {listed(arrays)}"
        raise DataError(f"rename or ignore of {', '.join(absent)} was asked", fault, "Name arrays that are there.")
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
            fault = f"{shape}, and its axes may be {', '.join(wanted) or 'none'}"
            remedy = "Name each axis of the stored array once, in its order."
            raise DataError(f"axes={{{name!r}: {' '.join(stored)!r}}} was asked", fault, remedy)
        array = np.transpose(held[name], [stored.index(axis) for axis in wanted if axis in stored])
        array = np.expand_dims(array, [i for i, axis in enumerate(wanted) if axis not in stored])
        held = held | {name: array[0] if wanted[0] == "runs" and "runs" not in stored else array}
    return held


def _build(where: str, noun: type[Any], held: dict[str, Array], given: dict[str, Any]) -> DataObject:
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
        thing: DataObject = noun(**values)
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
        asked = f"reading {where} as {noun.__name__} needs {', '.join(needed)}"
        raise DataError(asked, f"{', '.join(missing)} are missing", "Add the array, or give it as an option.")
    refused = sorted(set(given) - present - {"quantity"})
    if refused:
        fault = f"a {noun.__name__} has no such field"
        raise DataError(f"the options {', '.join(refused)} were asked", fault, "Leave them out.")


# ----------------------------------------------------------------------------------------------------------- overrides
# Fields of data that the caller gives beside the file: they go before what it says.


def _of_channels(thing: DataObject, given: Mapping[str, str]) -> tuple[list[str], list[str]] | None:
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


def overridden(thing: DataObject, options: Options, path: Path | None) -> DataObject:
    """Return the data with the fields that the caller gave, which named arrays have used already, and where they came from."""
    given = {name: options[name] for name in FIELD_OPTIONS if options.get(name) is not None}
    if isinstance(given.get("units"), Mapping):
        units = _of_channels(thing, given.pop("units"))
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
