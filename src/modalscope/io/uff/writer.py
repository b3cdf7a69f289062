"""Write universal files: header, units, geometry, functions (58) or modes (55, 2414)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, FrequencyResponse, Geometry, ImpulseResponse, ModalModel, Signals, StateSpace
from modalscope.data.analysis import VERSION
from modalscope.io.contents import ArrayData, Options
from modalscope.io.uff.function import Function, write_function
from modalscope.io.uff.layout import QUANTITY_CODES, one_set
from modalscope.io.uff.nodes import write_lines, write_nodes
from modalscope.io.uff.shapes import write_shapes
from modalscope.numerics.errors import check_choice

_TIME, _FRF, _COHERENCE, _CORRELATION, _MULTIPLE = 1, 4, 6, 8, 26
_FORCE, _TIME_AXIS, _FREQUENCY_AXIS = 13, 17, 18
_SI = {"m", "m/s", "m/s2", "m/s^2", "N"}
#: Relative distance of an even abscissa from a straight line, at most.
_ROUNDING = 8 * np.finfo(float).eps


def write(path: Path, thing: ArrayData, options: Options) -> None:
    """Write a data object.

    `options`: `text` (False: binary double precision), `dataset` (55 or 2414 for modes), `nodes` (2411 or 15), `lines` (82 or 2412).

    Raises `DataError`: labels that have neither a node number nor a short name, or something that has no place in the format.
    """
    choices = {"dataset": (55, 2414), "nodes": (2411, 15), "lines": (82, 2412)}
    given = {name: str(options.get(name, known[0])) for name, known in choices.items()}
    dataset, nodes, lines = (int(check_choice(name, given[name], map(str, choices[name]))) for name in choices)
    data = _header()
    if isinstance(thing, StateSpace):
        fault = "there is no such dataset"
        raise DataError(f"writing StateSpace as {path.suffix}:", fault, "Use .npz, .mat, .h5 or .json.")
    geometry = thing if isinstance(thing, Geometry) else thing.geometry
    if not isinstance(thing, Geometry):
        data += _units(thing)
    if geometry is not None:
        data += write_nodes(geometry, nodes) + write_lines(geometry, lines)
    if isinstance(thing, ModalModel):
        data += write_shapes(thing, dataset)
    elif not isinstance(thing, Geometry):
        text = bool(options.get("text", False))
        if isinstance(thing, Signals):
            functions = _records(thing)
        else:
            functions = _frequency(thing) if isinstance(thing, FrequencyResponse) else _impulse(thing)
        data += b"".join(write_function(function, text=text) for function in functions)
    path.write_bytes(data)


def _header() -> bytes:
    """Dataset 151. No date: the same data give the same file."""
    program, undated = f"modalscope {VERSION}", f"{'NONE':<10}{'NONE':<10}"
    texts = ("NONE", "NONE", program, f"{undated}{0:10d}{0:10d}{0:10d}", undated, program, undated)
    return one_set(151, (text.ljust(80) for text in texts))


def _units(thing: Any) -> bytes:
    """Dataset 164 when every channel is known to be in SI; what is not known is not written."""
    if not {unit for side in thing.units for unit in side} <= _SI:
        return b""
    factors = "".join(f"{1.0:25.16E}" for _ in range(3)).replace("E", "D")
    offset = f"{273.15:25.16E}".replace("E", "D")
    return f"    -1\n{164:6d}\n{1:10d}{'SI: Meter (newton)':<20}{2:10d}\n{factors}\n{offset}\n    -1\n".encode("ascii")


def _pairs(thing: FrequencyResponse | ImpulseResponse) -> list[tuple[int, int, dict[str, Any]]]:
    code = QUANTITY_CODES[thing.quantity]
    return [
        (i, j, {
            "output": out, "input": into, "quantity": code, "denominator": _FORCE, "unit": thing.units[0][i], "unit_in": thing.units[1][j],
        })
        for j, into in enumerate(thing.input_dofs) for i, out in enumerate(thing.output_dofs)
    ]  # fmt: skip


def _frequency(frf: FrequencyResponse) -> list[Function]:
    x = frf.frequencies
    even = np.max(np.abs(x - np.linspace(x[0], x[-1], x.size))) <= _ROUNDING * max(abs(x[0]), abs(x[-1]))
    common: dict[str, Any] = {"x": x, "even": bool(even), "abscissa_type": _FREQUENCY_AXIS}
    functions = [Function(kind=_FRF, values=frf.values[:, i, j], **fields, **common) for i, j, fields in _pairs(frf)]
    gamma = frf.coherence
    if gamma is not None and gamma.ndim == 3:
        labels = [(i, j, {side: fields[side] for side in ("output", "input")}) for i, j, fields in _pairs(frf)]
        functions += [Function(kind=_COHERENCE, values=gamma[:, i, j], **of, **common) for i, j, of in labels]
    elif gamma is not None:
        multiple = zip(frf.output_dofs, gamma.T, strict=True)
        functions += [Function(kind=_MULTIPLE, output=dof, input="", values=g, **common) for dof, g in multiple]
    return _placed(functions)


def _impulse(irf: ImpulseResponse) -> list[Function]:
    """Return correlations as cross correlations, others as time responses over a force.

    The direct term of a pulse response and the correlation at lag 0 stand at time zero.
    """
    times, values = irf.times, irf.values
    if irf.feedthrough is not None:
        if irf.kind not in ("pulse", "correlation") or irf.first_sample:
            fault = f"it has a direct term and begins {irf.first_sample} samples late, which has no place there"
            raise DataError(f"writing a {irf.kind} response to a universal file:", fault, "Write .npz or .h5.")
        values, times = np.concatenate([irf.feedthrough[None], values]), np.arange(irf.samples + 1) / irf.sampling_rate
    kind = _CORRELATION if irf.kind == "correlation" else _TIME
    texts = (f"impulse response: {irf.kind}",)
    common: dict[str, Any] = {"x": times, "abscissa_type": _TIME_AXIS, "texts": texts}
    return _placed([Function(kind=kind, values=values[:, i, j], **fields, **common) for i, j, fields in _pairs(irf)])


def _records(record: Signals) -> list[Function]:
    outputs, inputs = record.by_run()
    times = np.arange(record.samples) / record.sampling_rate
    common: dict[str, Any] = {"kind": _TIME, "input": "", "x": times, "abscissa_type": _TIME_AXIS}
    functions = []
    for run in range(record.runs):
        for dof, values, quantity, unit in zip(
            record.output_dofs, outputs[run].T, record.quantities, record.units[0], strict=True
        ):
            code = QUANTITY_CODES[quantity]
            functions.append(Function(output=dof, values=values, quantity=code, unit=unit, **common))
        forces = () if inputs is None else zip(record.input_dofs, inputs[run].T, record.units[1], strict=True)
        functions += [Function(output=dof, values=u, quantity=_FORCE, unit=unit, **common) for dof, u, unit in forces]
    return _placed(functions)


def _placed(functions: list[Function]) -> list[Function]:
    return [replace(function, place=place) for place, function in enumerate(functions, 1)]
