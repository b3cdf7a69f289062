"""Convert data objects to named arrays, the layout of .npz, .mat and HDF5 files.

Each field of a data object is an array of that name; what is None is left out. Texts are text arrays. Units are `output_units` and
`input_units`, a geometry is `geometry_nodes`, `geometry_coordinates`, `geometry_lines` and `geometry_faces` (indices into
the nodes, from 0) and `geometry_motions` (JSON text), indicators are `indicator_<name>`, reasons, notes, `left_out` and `harmonics` are
JSON text, and the arrays of modes before their refinement are `unrefined_<name>`.
`groups` is left out where it is the default, and one empty text where there are none.

| the file holds | it is |
|---|---|
| `frequencies`, `values` | a frequency response |
| `sampling_rate`, `values` | an impulse response |
| `sampling_rate`, `outputs` (`inputs`) | records |
| `poles`, `shapes` | modes |
| `A`, `B`, `C` (`D`, `dt`, `gain`) | a state-space model |
| `geometry_nodes`, `geometry_coordinates` alone | a geometry |
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields, is_dataclass
from typing import Any

import numpy as np

from modalscope.data import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Note,
    Signals,
    StateSpace,
)
from modalscope.data.channels import input_groups, run_groups
from modalscope.data.notes import Candidate, Harmonic
from modalscope.data.residual_terms import ResidualTerms
from modalscope.io.contents import ArrayData, damage_as_error
from modalscope.io.limits import room
from modalscope.numerics.checks import Array, ComplexArray

#: Fields that are text arrays.
TEXTS = (
    *("output_dofs", "input_dofs", "processing", "quantities", "output_units", "input_units", "geometry_nodes"),
    "groups",
)
#: What data classes raise on damaged fields, whose types are checked before.
FIELD_FAULTS = (KeyError, IndexError, OverflowError, ValueError)
INDICATOR = "indicator_"
#: What the names of the arrays of modes before their refinement start with.
UNREFINED = "unrefined_"
#: Fields that stand there as JSON text.
JSON = ("reasons", "notes", "left_out", "harmonics", "residual_terms", "geometry_motions")
GEOMETRY = ("geometry_nodes", "geometry_coordinates", "geometry_lines", "geometry_faces", "geometry_motions")

_TEXT = ("quantity", "kind", "scaling")
_FLOATS = ("sampling_rate", "added_damping", "dt")
_WHOLE = ("averages", "first_sample")
_BOOLEAN = ("held_input", "converged")
#: Characters of a label, at most.
_MAX_LETTERS = 1000
#: Axes of the arrays that people store in another order.
AXES: dict[type[Any], dict[str, tuple[str, ...]]] = {
    FrequencyResponse: dict.fromkeys(("values", "coherence", "variance"), ("lines", "outputs", "inputs")),
    ImpulseResponse: {"values": ("samples", "outputs", "inputs")},
    Signals: {"outputs": ("runs", "samples", "outputs"), "inputs": ("runs", "samples", "inputs")},
    ModalModel: {"shapes": ("outputs", "modes"), "participation": ("modes", "inputs")},
}


#: Data object -> the arrays by which it is known, and the others without which there is none.
NEEDED: dict[type[Any], tuple[tuple[str, ...], tuple[str, ...]]] = {
    FrequencyResponse: (("frequencies",), ("values",)),
    ModalModel: (("poles",), ("shapes",)),
    Signals: (("outputs",), ("sampling_rate",)),
    ImpulseResponse: (("values",), ("sampling_rate",)),
    StateSpace: (("A", "B", "C"), ()),
    Geometry: (("geometry_nodes", "geometry_coordinates"), ()),
}


def class_of(names: Iterable[str]) -> type[Any] | None:
    """Return the data object that arrays of these names make; None when they make none."""
    there = set(names)
    return next((data_class for data_class, (known, _) in NEEDED.items() if there.issuperset(known)), None)


def names_of(data_class: type[Any]) -> set[str]:
    """Return the names of the arrays that a data object may have."""
    if data_class is Geometry:
        return set(GEOMETRY)
    if data_class is StateSpace:
        return {field.name for field in fields(data_class)}
    names = {field.name for field in fields(data_class)} | {"output_units", "input_units", *GEOMETRY}
    names -= {"units", "geometry", "indicators", "source_path", "unrefined"}
    return names | {"quantity"} if data_class is Signals else names


def to_arrays(thing: ArrayData) -> dict[str, Array]:
    """Return data, modes or a geometry as named arrays; `contents_from_arrays` is the inverse."""
    if isinstance(thing, Geometry):
        return _geometry_arrays(thing)
    arrays: dict[str, Array] = {}
    for field in fields(thing):
        name, value = field.name, getattr(thing, field.name)
        if name == "source_path":
            continue
        if name == "units":
            arrays |= {"output_units": _texts(value[0]), "input_units": _texts(value[1])}
        elif name == "geometry":
            arrays |= {} if value is None else _geometry_arrays(value)
        elif name == "indicators":
            arrays |= {INDICATOR + key: np.asarray(array) for key, array in value.items()}
        elif name in JSON:
            arrays |= {name: np.asarray(json.dumps(value, default=from_json_numbers))} if value else {}
        elif name == "unrefined":
            arrays |= {} if value is None else {UNREFINED + key: array for key, array in to_arrays(value).items()}
        elif name == "groups" and not isinstance(thing, StateSpace):
            default = run_groups(thing.runs) if isinstance(thing, Signals) else input_groups(thing.input_dofs)
            arrays |= {} if value == default else {name: _texts(value or [""])}
        elif name in TEXTS:
            arrays[name] = _texts("" if text is None else text for text in value)
        elif value is not None:
            arrays[name] = np.asarray(value)
    return {name: array for name, array in arrays.items() if array.size or name in ("shapes", "poles")}


def _texts(values: Iterable[str]) -> Array:
    return np.asarray(list(values), dtype=np.str_)


def _geometry_arrays(geometry: Geometry) -> dict[str, Array]:
    arrays = {
        "geometry_nodes": _texts(geometry.nodes),
        "geometry_coordinates": geometry.coordinates,
        "geometry_lines": geometry.lines,
        "geometry_faces": geometry.faces,
    }
    if geometry.motions:
        arrays["geometry_motions"] = np.asarray(json.dumps(geometry.motions))
    return {name: array for name, array in arrays.items() if array.size}


def joined(real: Array, imaginary: Array) -> ComplexArray:
    """Return real and imaginary parts as one array; parts of other types or shapes are a `ValueError`, infinite ones are kept."""
    if real.shape != imaginary.shape or real.dtype.kind not in "biuf" or imaginary.dtype.kind not in "biuf":
        raise ValueError(f"its parts are {real.dtype} {real.shape} and {imaginary.dtype} {imaginary.shape}")
    values = np.empty(real.shape, complex)
    values.real, values.imag = real, imaginary
    return values


def from_json_numbers(value: object) -> object:
    """Turn numpy's numbers and arrays, notes and candidates into what the json module knows; anything else is a TypeError."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Note | Candidate | Harmonic | ResidualTerms):
        return value.to_dict()
    raise TypeError(f"{type(value).__name__} is not a JSON value")


def plain(value: Any) -> Any:
    """Return what JSON can hold: null for numbers that are not finite, lists for arrays, text for what it does not know."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | range):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if isinstance(value, str | int | bool) or value is None else str(value)


def field_value(where: str, name: str, array: Array) -> Any:
    """Return the array as its field takes it: text, texts, a number, JSON or the array itself."""
    textual = array.dtype.kind in "US"
    if textual is not (name in (*_TEXT, *TEXTS, *JSON)) and array.size:
        wanted = "numbers" if textual else "text"
        remedy = f"Store {wanted} under that name, or rename the array."
        raise DataError(f"{name} in {where} needs {wanted}", f"its type is {array.dtype}", remedy)
    if array.dtype.kind == "b" and name not in _BOOLEAN and array.size:
        raise DataError(f"{name} in {where} needs numbers", "it holds True and False", "Store numbers under that name.")
    if textual and array.dtype.kind == "S":
        array = np.char.decode(array, "utf-8", "replace")
    if name in TEXTS and name != "processing" and array.dtype.kind == "U" and array.dtype.itemsize > 4 * _MAX_LETTERS:
        fault = f"the longest has {array.dtype.itemsize // 4} characters"
        raise DataError(f"{name} in {where} needs labels", fault, f"Shorten it to at most {_MAX_LETTERS}.")
    if name in TEXTS:
        texts = tuple(str(text) for text in np.atleast_1d(array).ravel())
        if name == "groups" and texts == ("",):
            return None
        return tuple(text or None for text in texts) if name == "quantities" else texts
    if name in (*_TEXT, *JSON, *_FLOATS, *_WHOLE, *_BOOLEAN):
        if array.size != 1:
            fault = f"its shape is {array.shape}"
            raise DataError(f"{name} in {where} needs one entry", fault, "Store a single value under that name.")
        return _scalar(where, name, array.reshape(-1)[0].item())
    return array


def _scalar(where: str, name: str, value: Any) -> Any:
    if name in JSON:
        room(where, len(value)).json(name, value)
        try:
            return json.loads(value)
        except (ValueError, RecursionError) as error:
            remedy = "Write the file again, or ignore that array."
            raise DataError(f"{name} in {where} needs JSON text", f"it does not read ({error})", remedy) from None
    if name in _WHOLE and isinstance(value, float) and value.is_integer():
        return int(value)
    return (value or None) if name == "quantity" else bool(value) if name in _BOOLEAN else value


def geometry_of_arrays(where: str, values: dict[str, Any]) -> Geometry:
    """Return the geometry of arrays by their names in the layout.

    `values`: `geometry_nodes`, `geometry_coordinates`, and where present `geometry_lines`, `geometry_faces`, `geometry_motions`.

    Raises `DataError`: an array is missing, or counts nodes that are not there.
    """
    nodes = values.get("geometry_nodes")
    if nodes is None or values.get("geometry_coordinates") is None:
        fault = f"there are {', '.join(values)}"
        raise DataError("a geometry needs geometry_nodes and geometry_coordinates", fault, "Add the missing array.")
    named: dict[str, Any] = {}
    for key in ("lines", "faces"):
        index = np.asarray(values.get(f"geometry_{key}", np.zeros((0, 2), int)))
        whole = index.ndim == 2 and index.dtype.kind in "iuf" and bool(np.all(index == np.rint(index)))
        if index.size and not (whole and index.min() >= 0 and index.max() < len(nodes)):
            asked = f"geometry_{key} needs indices 0 to {len(nodes) - 1} into the nodes"
            raise DataError(asked, f"they reach from {index.min()} to {index.max()}", "Count nodes from 0.")
        named[key] = [[nodes[int(i)] for i in row] for row in index] or None
    with damage_as_error(f"the geometry in {where}", "Write the file again.", FIELD_FAULTS):
        motions = values.get("geometry_motions") or {}
        return Geometry(nodes=nodes, coordinates=values["geometry_coordinates"], motions=motions, **named)
