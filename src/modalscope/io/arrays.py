"""Nouns as named arrays, the layout that .npz, .mat and HDF5 files share.

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

from modalscope.io.contents import Plain
from modalscope.model import FrequencyResponse, Geometry, ImpulseResponse, ModalModel, Note, Signals, StateSpace
from modalscope.model.candidates import Candidate, Harmonic
from modalscope.model.checks import Array, ComplexArray
from modalscope.model.groups import Groups, input_groups, run_groups

__all__ = [
    "AXES",
    "GEOMETRY",
    "INDICATOR",
    "JSON",
    "TEXTS",
    "UNREFINED",
    "from_json_numbers",
    "joined",
    "names_of",
    "noun_of",
    "plain",
    "to_arrays",
]

TEXTS = (
    "output_dofs",
    "input_dofs",
    "processing",
    "quantities",
    "output_units",
    "input_units",
    "geometry_nodes",
    "groups",
)
INDICATOR = "indicator_"

#: What the names of the arrays of modes before their refinement start with.
UNREFINED = "unrefined_"

#: Fields that stand there as JSON text.
JSON = ("reasons", "notes", "left_out", "harmonics", "geometry_motions")
GEOMETRY = ("geometry_nodes", "geometry_coordinates", "geometry_lines", "geometry_faces", "geometry_motions")

#: Axes of the arrays that people store in another order.
AXES: dict[type[Any], dict[str, tuple[str, ...]]] = {
    FrequencyResponse: {
        "values": ("lines", "outputs", "inputs"),
        "coherence": ("lines", "outputs", "inputs"),
        "variance": ("lines", "outputs", "inputs"),
    },
    ImpulseResponse: {"values": ("samples", "outputs", "inputs")},
    Signals: {"outputs": ("runs", "samples", "outputs"), "inputs": ("runs", "samples", "inputs")},
    ModalModel: {"shapes": ("outputs", "modes"), "participation": ("modes", "inputs")},
}


def noun_of(names: Iterable[str]) -> type[Any] | None:
    """Return the data object that arrays of these names make; None when they make none."""
    held = set(names)
    for key, noun in (
        ("frequencies", FrequencyResponse),
        ("poles", ModalModel),
        ("outputs", Signals),
        ("values", ImpulseResponse),
    ):
        if key in held:
            return noun
    if {"A", "B", "C"} <= held:
        return StateSpace
    return Geometry if {"geometry_nodes", "geometry_coordinates"} <= held else None


def names_of(noun: type[Any]) -> set[str]:
    """Return the names of the arrays that a data object may have."""
    if noun is Geometry:
        return set(GEOMETRY)
    if noun is StateSpace:
        return {field.name for field in fields(noun)}
    own = {field.name for field in fields(noun)} - {"units", "geometry", "indicators", "source_path", "unrefined"}
    return own | {"output_units", "input_units", *GEOMETRY} | ({"quantity"} if noun is Signals else set())


def to_arrays(thing: Plain) -> dict[str, Array]:
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
        elif name == "groups":
            arrays |= {} if value == _default_groups(thing) else {name: _texts(value or [""])}
        elif name in TEXTS:
            arrays[name] = _texts("" if text is None else text for text in value)
        elif value is not None:
            arrays[name] = np.asarray(value)
    return {name: array for name, array in arrays.items() if array.size or name in ("shapes", "poles")}


def _default_groups(thing: Any) -> Groups:
    """Return the groups that data have without a word about them: a file holds no more than was said."""
    return run_groups(thing.runs) if isinstance(thing, Signals) else input_groups(thing.input_dofs)


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
    if isinstance(value, Note | Candidate | Harmonic):
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
