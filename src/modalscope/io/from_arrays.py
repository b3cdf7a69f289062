"""Build data objects from named arrays: renaming, order of axes, and values that options override."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from difflib import get_close_matches
from itertools import chain, islice
from typing import Any

import numpy as np

from modalscope.data import DataError, Geometry, ModalModel, Signals, StateSpace
from modalscope.data.shown import counted
from modalscope.io.arrays import (
    AXES,
    FIELD_FAULTS,
    GEOMETRY,
    INDICATOR,
    NEEDED,
    UNREFINED,
    class_of,
    field_value,
    geometry_of_arrays,
    names_of,
)
from modalscope.io.columns import contents_from_table
from modalscope.io.columns.weights import role_by_words
from modalscope.io.contents import Contents, DataObject, Finding, Options, chosen, damage_as_error, needs
from modalscope.io.loose import is_rate, meaning_of, with_vectors
from modalscope.io.members import Lists, experiments_of, lists_of, names_selecting, stacked_runs
from modalscope.io.options import FIELDS
from modalscope.numerics.checks import Array

#: Names of arrays in a message, and how alike a name is to the one that it may be meant for.
_MAX_NAMES, _SPELLING = 12, 0.8

#: What arrays of other names are in the layout, by their meaning, and letters of formulas.
_MEANINGS = {"frequency": "frequencies", "in": "inputs", "out": "outputs"}
_LETTERS = {"y": "outputs", "data": "outputs", "u": "inputs", "h": "values", "frf": "values", "phi": "shapes"}


def contents_from_arrays(
    where: str, arrays: Mapping[str, Array], options: Options, *, members: bool = False
) -> Contents:
    """Make the data object that named arrays describe.

    `arrays`: name -> array, as they stand in the file. `options`: `rename` (name in the file -> name of the layout), `axes` (name of the
    layout -> the axes as they stand in the file, such as "inputs outputs lines"; an axis that is not named has length 1), `ignore` (names
    to leave), and any of `FIELDS`. `members`: whether names such as `runs{2}` and `test(2).acc` are those of members of lists
    (`modalscope.io.members`).

    Raises `DataError`: unknown arrays, none that make a data object, text where numbers belong, or whatever the data class refuses.
    """
    rename, ignore = dict(options.get("rename") or {}), options.get("ignore") or ()
    ignore = {ignore} if isinstance(ignore, str) else set(ignore)
    names = {name: names_selecting(name) if members else {name} for name in arrays}
    absent = sorted((set(rename) | ignore) - set().union(*names.values()))
    if absent:
        fault = f"{where} holds {_listed(arrays)}"
        raise DataError(f"rename or ignore of {', '.join(absent)}:", fault, "Name arrays that are there.")
    taken = {name: array for name, array in arrays.items() if not names[name] & ignore}
    findings = [Finding(part=name, what=_shape(array)) for name, array in taken.items()]
    ignored = ((name, _shape(arrays[name])) for name in sorted(arrays.keys() - taken.keys()))
    findings += [Finding(part=name, what=what, taken=False, reason="ignore names it") for name, what in ignored]
    lists = lists_of(where, taken) if members else None
    if lists is not None:
        return _without_lists(where, lists, findings, options)
    taken = {rename.get(name, name): array for name, array in taken.items()}
    data_class = class_of(taken)
    unknown = [name for name in taken if not _is_field(data_class, name)]
    if data_class is None or unknown:
        return _by_evidence(where, taken, unknown, data_class, options)
    _refuse_rows(where, options)
    taken = _with_axes(taken, data_class, dict(options.get("axes") or {}))
    return Contents(thing=_build(where, data_class, taken, _fields(options)), found=tuple(findings))


def _refuse_rows(where: str, options: Options) -> None:
    if options.get("rows") is not None:
        raise DataError(f"rows of {where}:", "it is no table", "Cut its arrays before they are saved.")


def _without_lists(where: str, lists: Lists, findings: list[Finding], options: Options) -> Contents:
    """Return one data object of all arrays, or the runs of a record, each read by itself."""
    further = {**options, "ignore": None}
    if not lists.runs:
        contents = contents_from_arrays(where, lists.arrays, further)
        ignored = (finding for finding in findings if not finding.taken)
        return replace(contents, found=(*contents.found, *ignored))
    runs = [contents_from_arrays(where, run, further) for run in lists.runs]
    thing = stacked_runs(where, [run.thing for run in runs])
    notes = (f"{counted(len(runs), 'run')}, one a member of its lists", *(note for run in runs for note in run.notes))
    return Contents(thing=thing, found=tuple(findings), notes=tuple(dict.fromkeys(notes)))


def _of_one_experiment(
    where: str, arrays: dict[str, Array], options: Options
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return the arrays of the experiment that is asked, of several in one file, and what all share; and a note."""
    found, likely = experiments_of(arrays), experiments_of(arrays, of_matrix=2)
    if not found and (options.get("sheet") is None or not likely):
        said = f"{', '.join(likely)[:60]} hold the same channels: taken as sensors of one test; if tests: --test {next(iter(likely), '')}"
        return arrays, (said,) * bool(likely)
    found = found or likely
    label = chosen(where, "experiments", found, list(found), options)
    others = set().union(*(names for other, names in found.items() if other != label))
    kept = {name: array for name, array in arrays.items() if name not in others}
    return kept, (f"using experiment {label!r}; ignored: {', '.join(other for other in found if other != label)[:60]}",)


def _fields(options: Options) -> dict[str, Any]:
    """Return the fields that were given, without units of single channels: these need the labels."""
    given = {name: options[name] for name in FIELDS if options.get(name) is not None}
    return {name: value for name, value in given.items() if not (name == "units" and isinstance(value, Mapping))}


def _by_evidence(
    where: str, arrays: dict[str, Array], unknown: list[str], data_class: type[Any] | None, options: Options
) -> Contents:
    """Return the data that arrays of other names hold by names and shapes, or raise where these say nothing."""
    given = {name for name in FIELDS if options.get(name) is not None}
    complete = data_class is not None and {*NEEDED[data_class][1]} <= {*arrays, *given}
    notes: tuple[str, ...] = ()
    if not complete:
        plain = {name: array.astype(np.uint8) if array.dtype == bool else array for name, array in arrays.items()}
        arrays, notes = _of_one_experiment(where, with_vectors(plain), options)
    meant = None if complete or options.get("axes") else meaning_of(where, arrays, options, bool(notes))
    if meant is None:
        raise _unknown_arrays(where, unknown or list(arrays), data_class)
    if meant.table is not None:
        contents = contents_from_table(meant.table, {**options, "ignore": None})
        return replace(contents, notes=(*notes, *meant.notes, *contents.notes))
    _refuse_rows(where, options)
    layout = dict(meant.arrays or {})
    thing = _build(where, class_of(layout) or Signals, layout, _fields(options))
    findings = (
        Finding(part=name, what=_shape(array), taken=name not in meant.left, reason="unused" * (name in meant.left))
        for name, array in arrays.items()
    )
    return Contents(thing=thing, found=tuple(findings), notes=meant.notes)


def _listed(names: Iterable[str]) -> str:
    """Return the first of the names: a file may have thousands."""
    first = list(islice(names, _MAX_NAMES + 1))
    return ", ".join([*first[:_MAX_NAMES], *(["..."] if len(first) > _MAX_NAMES else [])]) or "(none)"


def _unknown_arrays(where: str, names: list[str], data_class: type[Any] | None) -> DataError:
    """Return the error of arrays that make no data object, or are none of its fields."""
    usual = ("frequencies", "values", "sampling_rate", "outputs", "inputs", "poles", "shapes")
    known = sorted(names_of(data_class)) if data_class else usual
    hints: dict[str, str] = {}
    for name in names[:_MAX_NAMES]:
        spelt = next(iter(get_close_matches(name, known, n=1, cutoff=_SPELLING)), None)
        meant = _LETTERS.get(name.lower(), _MEANINGS.get(role_by_words(name), spelt))
        near = "sampling_rate" if is_rate(name) else meant
        if near is not None and near in known and near != name:
            hints[name] = near
    return needs(
        where,
        "`frequencies` and `values`, `sampling_rate` with `outputs` (and `inputs`) or `values`, or `poles` and `shapes`",
        f"the arrays {_listed(names)} are unknown" + (f" besides those of {data_class.__name__}" if data_class else ""),
        _renaming(names, hints),
    )


def _renaming(names: Sequence[str], hints: Mapping[str, str]) -> str:
    """Return what to do about unknown arrays: names that are in the file, and only where there are such."""
    if not names:
        return "Save measured values with their sampling rate, or with their frequencies."
    leave = f"leave others out, read(..., ignore={list(names[:3])})."
    if not hints:
        rate = "If they are samples alone, give their rate: --sampling-rate HZ. " if len(names) == 1 else ""
        return f"{rate}Rename what is measured to one of these, read(..., rename=...), and {leave}"
    return f"Rename them, read(..., rename={dict(hints)}), or {leave}"


def _is_field(data_class: type[Any] | None, name: str) -> bool:
    """Whether a data class has an array of this name; modes also have indicators, and arrays before refinement."""
    if data_class is ModalModel:
        name = name.removeprefix(UNREFINED)
        return name in names_of(data_class) or name.startswith(INDICATOR)
    return data_class is not None and name in names_of(data_class)


def _shape(array: Array) -> str:
    return f"{array.dtype} {'x'.join(map(str, array.shape))}" if array.ndim else f"{array.dtype} {array}"


def _with_axes(arrays: dict[str, Array], data_class: type[Any], axes: dict[str, Any]) -> dict[str, Array]:
    """Return the arrays with their axes in the order of the data class."""
    arrays = dict(arrays)
    for name, order in axes.items():
        stored = tuple(order.split()) if isinstance(order, str) else tuple(order)
        wanted = AXES.get(data_class, {}).get(name, ())
        ndim = arrays[name].ndim if name in arrays else -1
        if len(set(stored)) != len(stored) or not set(stored) <= set(wanted) or len(stored) != ndim:
            shape = f"its shape is {arrays[name].shape}" if name in arrays else "there is no such array"
            fault = f"{shape}, and its axes may be {', '.join(wanted) or 'none'}"
            remedy = "Name each axis of the stored array once, in its order."
            raise DataError(f"axes={{{name!r}: {' '.join(stored)!r}}}:", fault, remedy)
        array = np.transpose(arrays[name], [stored.index(axis) for axis in wanted if axis in stored])
        array = np.expand_dims(array, [i for i, axis in enumerate(wanted) if axis not in stored])
        arrays[name] = array[0] if wanted[0] == "runs" and "runs" not in stored else array
    return arrays


def _build(where: str, data_class: type[Any], arrays: dict[str, Array], given: dict[str, Any]) -> DataObject:
    before = {name.removeprefix(UNREFINED): array for name, array in arrays.items() if name.startswith(UNREFINED)}
    taken = {name: array for name, array in arrays.items() if not name.startswith(UNREFINED)}
    values: dict[str, Any] = {name: field_value(where, name, array) for name, array in taken.items()}
    if data_class is Geometry:
        return geometry_of_arrays(where, values)
    if data_class is StateSpace:
        _check_fields(where, data_class, values, given)
        return StateSpace(**values)
    values["units"] = (values.pop("output_units", None), values.pop("input_units", None))
    geometry = {name: values.pop(name) for name in GEOMETRY if name in values}
    indicators = {name.removeprefix(INDICATOR): values.pop(name) for name in list(values) if name.startswith(INDICATOR)}
    if geometry:
        values["geometry"] = geometry_of_arrays(where, geometry)
    if indicators:
        values["indicators"] = indicators
    if before:
        values["unrefined"] = _build(where, data_class, before, {})
    values |= given
    for side in {"outputs", "inputs"} & set(values) if data_class is Signals else ():
        if np.ndim(values[side]) == 2 and len(values[side]) == 1:  # a row is a channel: nothing else has one sample
            values[side] = np.transpose(values[side])
    if data_class is Signals and "quantity" in values:
        values["quantities"] = values.pop("quantity")
    _check_fields(where, data_class, values, given)
    # texts of JSON may hold anything
    with damage_as_error(where, "Write the file again.", FIELD_FAULTS):
        thing: DataObject = data_class(**values)
    return thing


def _check_fields(where: str, data_class: type[Any], values: dict[str, Any], given: dict[str, Any]) -> None:
    """Raise where a field that the data class needs is missing, or one was asked for that it does not have."""
    present = {f.name for f in fields(data_class)}
    needed = sorted(chain(*NEEDED[data_class]))
    missing = [name for name in needed if name not in values]
    if missing:
        asked = f"reading {where} as {data_class.__name__} needs {', '.join(needed)}"
        raise DataError(asked, f"{', '.join(missing)} are missing", "Add the array, or give it as an option.")
    refused = sorted(set(given) - present - {"quantity"})
    if refused:
        fault = f"a {data_class.__name__} has no such field"
        raise DataError(f"the options {', '.join(refused)}:", fault, "Leave them out.")
