"""Read and write analyses as JSON, alone (`x.analysis.json`) or inside a file of modes.

    {"modalscope": version, "analysis": {"schema", "version", "files": [{"path", "size", "sha256", "reading"}], "bands", "exclude",
     "route", "reciprocal", "method", "domain", "orders", "options", "frequencies", "taken", "refused", "refine", "names", "remarks"}}

Arrays among the options are {"array": [...]}, with every digit; complex ones have "imag", too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data.analysis import VERSION, Analysis, SourceFile
from modalscope.io.arrays import joined
from modalscope.io.contents import unreadable
from modalscope.io.limits import room
from modalscope.numerics.checks import Array, check_kind
from modalscope.numerics.documents import entries as listed, made
from modalscope.numerics.errors import DataError

#: Lists and mappings in each other, more than any document has.
_MAX_DEPTH = 32
_NESTED = (Mapping, list, tuple)


def write_analysis(path: Path, document: Analysis) -> None:
    """Write the document alone."""
    text = json.dumps({"modalscope": VERSION, "analysis": analysis_to(document)}, indent=1)
    path.write_text(text + "\n", encoding="utf-8")


def read_analysis(path: Path) -> Analysis:
    """Return the analysis that a JSON file holds, by itself or with modes.

    Raises `DataError`: no such file, no JSON, or no analysis in it.
    """
    try:
        text = path.read_text(encoding="utf-8")
        room(path.name, len(text)).json("what it lists", text)
        document = json.loads(text)
    except DataError:
        raise
    except OSError as error:
        fault = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror or str(error)
        raise unreadable(repr(str(path)), fault, "Check the name and the folder.") from None
    except (ValueError, RecursionError) as error:
        raise unreadable(str(path), f"it is no JSON ({error})", "Name an .analysis.json.") from None
    entries = document.get("analysis") if isinstance(document, Mapping) else None
    if not isinstance(entries, Mapping):
        fault = 'it has no "analysis": what it holds does not say how it was found'
        remedy = "Name the data, an .analysis.json, or a result that `modalscope identify` wrote."
        raise DataError(f"the analysis in {path.name}:", fault, remedy)
    return analysis_from(entries)


def analysis_to(document: Analysis) -> dict[str, Any]:
    """Return an analysis as JSON holds it."""
    return {f.name: _jsonable(getattr(document, f.name)) for f in fields(document)}


def analysis_from(entries: Mapping[str, Any]) -> Analysis:
    """Return the analysis that `analysis_to` gave; fields of later layouts are refused with the layout, not dropped."""
    check_kind("an analysis", entries, Mapping)
    if is_deep(entries):
        raise DataError("an analysis was read", f"its fields are nested more than {_MAX_DEPTH} deep", "Write it again.")
    unknown = sorted(set(map(str, entries)) - {f.name for f in fields(Analysis)})
    if unknown:
        fault = f"it has {', '.join(unknown)}, which this version does not know"
        raise DataError("an analysis was read", fault, "Use a later version.")
    try:
        # "refine" and "reciprocal" are missing where it was written before there was one
        given = {"refine": False, "reciprocal": False, **{name: _back(value) for name, value in entries.items()}}
        return Analysis(files=tuple(made(SourceFile, file) for file in listed(given.pop("files", ()))), **given)
    except DataError:
        raise
    except (KeyError, OverflowError, ValueError) as error:
        raise DataError("an analysis was read", f"its fields are damaged ({error})", "Write it again.") from error


def is_deep(value: Any) -> bool:
    """Whether lists and mappings lie in each other deeper than those of any document: no function may follow them by calling itself.

    Examples
    --------
    >>> is_deep({"options": {"weights": {"array": [[1.0]]}}}), is_deep(json.loads("[" * 40 + "]" * 40))
    (False, True)
    """
    layer = [value]
    for _ in range(_MAX_DEPTH):
        nested = [each for each in layer if isinstance(each, _NESTED)]
        layer = [item for each in nested for item in (each.values() if isinstance(each, Mapping) else each)]
    return bool(layer)


def _jsonable(value: Any) -> Any:
    if isinstance(value, SourceFile):
        return {f.name: _jsonable(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        parts = {"array": value.real.tolist()}
        return {**parts, "imag": value.imag.tolist()} if np.iscomplexobj(value) else parts
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): _jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple | range):
        return [_jsonable(item) for item in value]
    return value if isinstance(value, str | int | float | bool) or value is None else str(value)


def _back(value: Any) -> Any:
    if isinstance(value, Mapping):
        if "array" in value:
            real = _numbers(value["array"])
            return joined(real, _numbers(value["imag"])) if "imag" in value else real
        return {key: _back(item) for key, item in value.items()}
    if isinstance(value, list):
        return tuple(_back(item) for item in value)
    return value


def _numbers(listed: Any) -> Array:
    """Return lists of numbers as an array; text among them would give every entry the width of the longest."""
    entries = np.array(listed, dtype=object)
    if any(not isinstance(entry, int | float) for entry in entries.ravel()):
        raise ValueError("an array holds more than numbers")
    return np.asarray(listed)
