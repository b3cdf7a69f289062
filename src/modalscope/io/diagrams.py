"""Read and write stabilization diagrams, as named arrays and as JSON, with their response.

Arrays stand under the names of the diagram's fields, those of its response behind `response_`, of the lines that it was made of behind
`measured_`, of its settings behind `setting_`;
indicators are `indicator_<name>`.
All that is no array is one JSON text, `diagram`. A JSON file holds the same:

    {"modalscope": version, "diagram": {"method", "domain", "orders", ...}, "arrays": {name: [...] or {"real", "imag"}}}

Numbers that are not finite are the texts "NaN", "Infinity" and "-Infinity" there. Nothing is rounded.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse, Signals, StabilizationDiagram
from modalscope.data.analysis import VERSION
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.results import Settings
from modalscope.io.arrays import FIELD_FAULTS, INDICATOR, joined, names_of, plain, to_arrays
from modalscope.io.contents import Contents, Finding, damage_as_error, unreadable
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.limits import Room, room
from modalscope.numerics.checks import Array
from modalscope.numerics.documents import entries, made, mapping, numbers
from modalscope.numerics.handed import handed

#: The text that holds what is no array; where it is, the file holds a diagram.
DIAGRAM = "diagram"

_RESPONSE, _MEASURED, _SETTING = "response_", "measured_", "setting_"
_KINDS: dict[str, type] = {"c": complex, "f": float, "i": int, "b": bool}


def diagram_arrays(diagram: StabilizationDiagram) -> dict[str, Array]:
    """Return a diagram with its response as named arrays; `diagram_contents` is the inverse."""
    arrays, rest = _parted(diagram)
    return {DIAGRAM: np.asarray(json.dumps(rest)), **arrays}


def diagram_contents(where: str, arrays: Mapping[str, Array]) -> Contents:
    """Make the diagram that named arrays describe.

    Raises `DataError`: arrays that are missing, damaged or of no diagram.
    """
    with _checked(where):
        text = str(np.asarray(arrays[DIAGRAM])[()])
        room(where, 0).json(DIAGRAM, text)
        return _contents(where, json.loads(text), {name: a for name, a in arrays.items() if name != DIAGRAM})


def write_document(path: Path, diagram: StabilizationDiagram) -> None:
    """Write a diagram as JSON."""
    arrays, rest = _parted(diagram)
    document = {"modalscope": VERSION, DIAGRAM: rest, "arrays": {name: _listed(a) for name, a in arrays.items()}}
    path.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")


def document_contents(where: str, document: Mapping[str, Any], space: Room) -> Contents:
    """Make the diagram that a JSON document holds; errors as in `diagram_contents`.

    `space`: what its arrays may take.
    """
    with _checked(where):
        arrays = {name: _array(name, values, space) for name, values in mapping(document["arrays"]).items()}
        return _contents(where, document[DIAGRAM], arrays)


def _checked(where: str) -> AbstractContextManager[None]:
    faults = (*FIELD_FAULTS, RecursionError)
    return damage_as_error(f"a stabilization diagram from {where}", "Write the file again.", faults)


def _parted(diagram: StabilizationDiagram) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the arrays of a diagram and of its response, and whatever is no array as plain values."""
    arrays: dict[str, Array] = {}
    rest: dict[str, Any] = {}
    for field in fields(diagram):
        name, value = field.name, getattr(diagram, field.name)
        if name in ("response", "measured") and value is not None:
            arrays |= {f"{name}_{key}": array for key, array in to_arrays(value).items()}
        elif name == "indicators":
            arrays |= {INDICATOR + key: np.asarray(array) for key, array in value.items()}
        elif name == "settings":
            given = dict(value.items())
            arrays |= {_SETTING + key: option for key, option in given.items() if isinstance(option, np.ndarray)}
            rest[name] = {key: plain(option) for key, option in given.items() if not isinstance(option, np.ndarray)}
        elif isinstance(value, np.ndarray):
            arrays[name] = value
        else:
            rest[name] = plain(value)
    return arrays, rest


def _contents(where: str, rest: Mapping[str, Any], arrays: Mapping[str, Array]) -> Contents:
    def behind(prefix: str) -> dict[str, Array]:
        return {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}

    given, lines = behind(_RESPONSE), behind(_MEASURED)
    response = _records_of(where, given) if "drive" in given else contents_from_arrays(where, given, {}).thing
    if not isinstance(response, FrequencyResponse | ImpulseResponse | RecordSpectra):
        raise unreadable(f"a stabilization diagram from {where}", "its response is missing", "Write the file again.")
    measured = contents_from_arrays(where, lines, {}).thing if lines else None
    values: dict[str, Any] = {name: _tuples(value) for name, value in mapping(rest).items()}
    prefixes = (_RESPONSE, _MEASURED, INDICATOR, _SETTING)
    values |= {name: a for name, a in arrays.items() if not name.startswith(prefixes)}
    options = {**mapping(values["settings"]), **behind(_SETTING)}
    values["settings"] = _settings(values["method"], values["domain"], options)
    values |= {"response": response, "measured": measured, "indicators": behind(INDICATOR)}
    entries(values.get("orders"))
    diagram = made(StabilizationDiagram, values)
    what = f"{len(diagram.poles)} poles at {len(diagram.orders)} orders ({diagram.method}, {diagram.domain})"
    return Contents(thing=diagram, found=(Finding(part=DIAGRAM, what=what),))


def _records_of(where: str, arrays: dict[str, Array]) -> RecordSpectra:
    """Return records on their own lines; their labels are read as those of a record are."""
    rate = float(arrays["sampling_rate"]) if "sampling_rate" in arrays else None
    rest = {name: a for name, a in arrays.items() if name in names_of(Signals) - {"groups"}}
    frame = {
        **rest,
        "outputs": np.zeros((2, arrays["values"].shape[1])),
        "inputs": np.zeros((2, arrays["drive"].shape[1])),
        "sampling_rate": np.asarray(rate or 1.0),
    }
    signals = contents_from_arrays(where, frame, {}).thing
    assert isinstance(signals, Signals)
    return RecordSpectra(
        values=arrays["values"],
        frequencies=arrays["frequencies"],
        drive=arrays["drive"],
        run=arrays["run"],
        durations=tuple(arrays["durations"].tolist()),
        sampling_rate=rate,
        quantity=str(arrays["quantity"]) if "quantity" in arrays else None,
        level=arrays.get("level"),
        line_scale=arrays.get("line_scale"),
        **signals.labelled(),
    )


def _settings(method: str, domain: str, options: dict[str, Any]) -> Settings:
    """Return options as the type that their method has; of what the table has not, those that every method has."""
    found: Settings = made(handed("options_type_of")(method, domain, options.get("route")) or Settings, options)
    return found


def _tuples(value: Any) -> Any:
    """Return lists as tuples, which is what a diagram holds."""
    if isinstance(value, list):
        return tuple(_tuples(item) for item in value)
    return {key: _tuples(item) for key, item in value.items()} if isinstance(value, dict) else value


def _listed(array: Array) -> Any:
    if not array.size:  # lists lose the length of what is empty
        return {"shape": list(array.shape), "kind": array.dtype.kind}
    if array.dtype.kind == "c":
        return {"real": _listed(array.real), "imag": _listed(array.imag)}
    if array.dtype.kind == "f" and not np.all(np.isfinite(array)):
        texts = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}
        flat = [texts.get(str(v), v) for v in array.ravel().tolist()]
        return np.array(flat, dtype=object).reshape(array.shape).tolist()
    return array.tolist()


def _array(name: str, values: Any, space: Room) -> Array:
    if isinstance(values, dict) and "shape" in values:
        return np.zeros(values["shape"] if 0 in values["shape"] else 0, _KINDS[values["kind"]])
    if isinstance(values, dict):
        return joined(_array(name, values["real"], space), _array(name, values["imag"], space))
    array = np.array(values, dtype=object)
    texts = [text for text in array.ravel() if isinstance(text, str)]
    if {"NaN", "Infinity", "-Infinity"} & set(texts):
        return array.astype(float)
    if texts:
        return space.texts(name, [str(text) for text in array.ravel()]).reshape(array.shape)
    return np.array(values) if np.array(values).dtype != object else numbers(values)
