"""Read and write modes as JSON, with shapes, indicators and reasons.

The layout is that of the command line (`identify -o modes.json`):

    {"modalscope": version, "data": {...}, "method", "domain", "orders",
     "modes": [{"frequency_hz", "damping_ratio", "kind", "frequency_spread_hz", "damping_ratio_spread", "frequency_std_hz",
                "damping_ratio_std", "frequency_repeatability_hz", "damping_ratio_repeatability", "damping_ratio_lower",
                "degrees": [of the frequency, of the damping ratio], "gain", "significance", "shape_std",
                "interval_95": {"frequency_hz": [low, high], "damping_ratio": [low, high]}, "grade", "grade_reason", "mpc",
                "indicators": {...}, "reasons": {...}, "shape": {"dof", "real", "imag", "std"},
                "pole": {"real", "imag"}, "participation": {"dof", "real", "imag"}}],
     "left_out": [{"frequency_hz", "damping_ratio", "gain", "reason", "remedy"}],
     "harmonics": [{"frequency_hz", "order", "level", "evidence"}], "unrefined": [as "modes"] or null, "converged", "route",
     "geometry", "feedthrough", "lower_residual", "upper_residual",
     "residual_terms": [as `ResidualTerms.to_dict`], "notes": [{"kind", "numbers", "text"}],
     "analysis": the document of `modalscope.io.analysis` or null}

A state-space model is {"modalscope": version, "state_space": {"A", "B", "C", "D", "dt", ...}}.

Intervals, grades and MPC follow from the rest, and are not read back.

`pole` (rad/s) keeps every digit; a file without it is read by frequency and damping ratio. What is not known is null.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, Geometry, ModalModel, StabilizationDiagram, StateSpace
from modalscope.data.analysis import VERSION
from modalscope.data.mode_fields import COLUMNS, DIRECT
from modalscope.data.results import Result
from modalscope.io.analysis import analysis_to
from modalscope.io.arrays import FIELD_FAULTS, joined, plain, to_arrays
from modalscope.io.contents import Contents, Finding, Options, damage_as_error, unreadable
from modalscope.io.diagrams import DIAGRAM, document_contents, write_document
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.limits import room
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.documents import entries, made, mapping, number, numbers
from modalscope.numerics.functions.poles import poles_from

_OF_DATA = ("quantity", "dt", "held_input", "scaling")
_OF_CHANNELS = ("output_dofs", "input_dofs", "units", "processing")


def write(path: Path, modes: Any, options: Options) -> None:
    """Write modes with `method`, `domain`, `orders` and a mapping `data` as they are given; a state-space model; or a diagram."""
    if isinstance(modes, StabilizationDiagram):
        write_document(path, modes)
        return
    if isinstance(modes, StateSpace):
        matrices = {name: array.tolist() for name, array in to_arrays(modes).items()}
        path.write_text(json.dumps({"modalscope": VERSION, "state_space": matrices}, indent=1) + "\n", encoding="utf-8")
        return
    if not isinstance(modes, ModalModel):
        fault = "that layout holds modes, a state-space model or a stabilization diagram"
        remedy = "Use .npz, .h5 or .uff for records and responses."
        raise DataError(f"writing {type(modes).__name__} as .json:", fault, remedy)
    options = {**_of_result(options.get("result")), **options}
    data = {name: getattr(modes, name) for name in (*_OF_DATA, *_OF_CHANNELS)}
    document = {
        "modalscope": VERSION,
        "data": {**dict(options.get("data") or {}), **data},
        "method": options.get("method"),
        "domain": options.get("domain"),
        "orders": None if options.get("orders") is None else [int(order) for order in np.atleast_1d(options["orders"])],
        "modes": _rows(modes),
        **{name: None if (a := getattr(modes, name)) is None else a.tolist() for name in DIRECT},
        "residual_terms": [terms.to_dict() for terms in modes.residual_terms],
        "left_out": [candidate.to_dict() for candidate in modes.left_out],
        "harmonics": [harmonic.to_dict() for harmonic in modes.harmonics],
        "unrefined": None if (u := modes.unrefined) is None else _rows(u),
        "converged": modes.converged,
        "route": options.get("route"),
        "notes": [note.to_dict() for note in dict.fromkeys((*modes.notes, *options.get("notes", ())))],
        "analysis": options.get("analysis"),
        "geometry": None if modes.geometry is None else _geometry_out(modes.geometry),
    }
    path.write_text(json.dumps(plain(document), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _of_result(result: Result | None) -> dict[str, Any]:
    """Return what a result holds besides its modes: how they were identified, its notes, and the document that repeats it."""
    if result is None:
        return {}
    analysis = result.analysis
    entries: dict[str, Any] = {"notes": result.notes, "analysis": analysis_to(analysis), "route": analysis.route}
    files = [Path(file.path).name for file in analysis.files if file.path]
    if files:
        entries["data"] = {"file": ", ".join(files)}
    if result.diagrams:
        diagram = result.diagram
        route = diagram.settings.get("route")
        entries |= {} if route is None else {"route": route}
        entries |= {"method": diagram.method, "domain": diagram.domain, "orders": diagram.orders}
    return entries


def _rows(modes: ModalModel) -> list[dict[str, Any]]:
    """Return the entries of all modes."""
    columns = modes.columns()
    return [_mode(modes, j, {name: values[j] for name, values in columns.items()}) for j in range(len(modes))]


def _mode(modes: ModalModel, j: int, columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entry of one mode; `columns`: its numbers by column."""
    pole, std, part = modes.poles[j], modes.shapes_std, modes.participation
    shape = {"dof": list(modes.output_dofs), **_parts(modes.shapes[:, j]), "std": None if std is None else std[:, j]}
    return {
        "frequency_hz": modes.frequencies[j],
        "damping_ratio": modes.damping_ratios[j],
        "kind": modes.kinds[j],
        **{key: None if (a := getattr(modes, name)) is None else a[j] for key, name in COLUMNS.items()},
        "significance": None if modes.gain is None else modes.gain[j],
        "shape_std": None if std is None else std[:, j],
        "degrees": None if modes.degrees is None else modes.degrees[j],
        "interval_95": {
            of: [columns.get(f"{name}_95_{end}{unit}") for end in ("low", "high")]
            for of, name, unit in (("frequency_hz", "frequency", "_hz"), ("damping_ratio", "damping_ratio", ""))
        },
        "grade": columns["grade"],
        "grade_reason": columns["reason"],
        "mpc": columns.get("mpc"),
        "indicators": {name: columns[name] for name in modes.indicators},
        "reasons": dict(modes.reasons[j]) if modes.reasons else {},
        "shape": shape,
        "pole": {"real": pole.real, "imag": pole.imag},
        "participation": None if part is None else {"dof": list(modes.input_dofs), **_parts(part[j])},
    }


def _parts(values: ComplexArray) -> dict[str, list[float]]:
    return {"real": values.real.tolist(), "imag": values.imag.tolist()}


def _geometry_out(geometry: Geometry) -> dict[str, Any]:
    sides = {"lines": geometry.lines, "faces": geometry.faces}
    named = {side: [[geometry.nodes[i] for i in row] for row in rows] for side, rows in sides.items()}
    places = {"nodes": list(geometry.nodes), "coordinates": geometry.coordinates.tolist()}
    return {**places, **named, "motions": geometry.motions}


def read(path: Path, options: Options) -> Contents:
    """Read modes or a stabilization diagram back."""
    space = room(path.name, path.stat().st_size)
    with damage_as_error(f"{path.name} as JSON", "Write it with modalscope.", (ValueError, RecursionError)):
        text = path.read_text(encoding="utf-8")
        space.json("what it lists", text)
        document = json.loads(text)
    if not isinstance(document, dict):
        document = {}
    if DIAGRAM in document:
        return document_contents(path.name, document, space)
    if "modalscope" in document and isinstance(document.get("state_space"), dict):
        with damage_as_error(path.name, "Write the file again.", FIELD_FAULTS):
            matrices = {
                name: np.asarray(a, dtype=str) if name.endswith(("_dofs", "_units")) else numbers(a)
                for name, a in document["state_space"].items()
            }
        return contents_from_arrays(path.name, matrices, options)
    if not isinstance(document.get("modes"), list) or "modalscope" not in document:
        fault = 'it has no "modalscope" and "modes" entries'
        raise unreadable(f"{path.name} as modes", fault, "Give a modes.json that modalscope wrote.")
    with damage_as_error(f"{path.name} as modes", "Write the file again.", FIELD_FAULTS):
        modes = _modes(document)
    how = [f"{key} {document[key]}" for key in ("method", "domain", "orders") if document.get(key) is not None]
    finding = Finding(part="modes", what=f"{len(modes)} modes" + (f" ({', '.join(how)})" if how else ""))
    return Contents(thing=modes, found=(finding,))


def _modes(document: dict[str, Any]) -> ModalModel:
    """Return the modes, and what belongs to all of them."""
    rows, data = [mapping(row) for row in document["modes"]], mapping(document.get("data") or {})
    fields: dict[str, Any] = {name: data[name] for name in _OF_DATA if data.get(name) is not None}
    before = document.get("unrefined")
    direct = {name: numbers(document[name]) for name in DIRECT if document.get(name) is not None}
    return _model(
        rows,
        data,
        residual_terms=document.get("residual_terms") or (),
        geometry=made(Geometry, document["geometry"]) if document.get("geometry") else None,
        notes=document.get("notes") or (),
        left_out=document.get("left_out") or (),
        harmonics=document.get("harmonics") or (),
        unrefined=None if before is None else _model([mapping(row) for row in entries(before)], data, **fields),
        converged=document.get("converged"),
        **fields,
        **direct,
    )


def _model(rows: list[Mapping[str, Any]], data: Mapping[str, Any], **fields: Any) -> ModalModel:
    """Return modes from their rows, with fields that belong to all of them."""
    parts = [mapping(row["shape"]) for row in rows]
    outputs = entries(data.get("output_dofs") or (parts[0]["dof"] if rows else []))
    participation: list[Any] = [row.get("participation") for row in rows]
    shapes = np.array([_complex(shape) for shape in parts], dtype=complex).reshape(len(rows), len(outputs)).T
    complete = bool(rows) and all(entry is not None for entry in participation)
    std: list[Any] = [shape.get("std") for shape in parts]
    degrees: list[Any] = [row.get("degrees") for row in rows]
    names = mapping(rows[0].get("indicators") or {} if rows else {})
    units = None if data.get("units") is None else entries(data["units"])
    columns: dict[str, Any] = {name: _column(rows, key) for key, name in COLUMNS.items()}
    columns["units"] = None if units is None else (units[0], units[1] if complete else ())
    return ModalModel(
        poles=np.array([_pole(row) for row in rows], dtype=complex),
        shapes=shapes,
        shapes_std=np.array([numbers(entry) for entry in std]).T if rows and all(std) else None,
        degrees=np.array([numbers(entry) for entry in degrees]) if rows and all(degrees) else None,
        participation=np.array([_complex(entry) for entry in participation]) if complete else None,
        output_dofs=tuple(outputs),
        input_dofs=tuple(entries(data.get("input_dofs") or ())) if complete else (),
        processing=tuple(entries(data.get("processing") or ())),
        indicators={name: numbers([mapping(row["indicators"])[name] for row in rows]) for name in names},
        reasons=tuple(row.get("reasons") or {} for row in rows) if any(row.get("reasons") for row in rows) else (),
        **columns,
        **fields,
    )


def _complex(parts: Any) -> ComplexArray:
    return joined(numbers(mapping(parts)["real"]), numbers(parts["imag"]))


def _pole(row: Mapping[str, Any]) -> complex:
    if row.get("pole"):
        return complex(*(number(mapping(row["pole"])[part]) for part in ("real", "imag")))
    return complex(poles_from(number(row["frequency_hz"]), number(row["damping_ratio"])))


def _column(rows: list[Mapping[str, Any]], key: str) -> RealArray | None:
    values = [row.get(key) for row in rows]
    return None if all(value is None for value in values) else numbers(values)
