"""Dataset 58 out: a function at a nodal dof in double precision, binary or text."""

from __future__ import annotations

import numpy as np

from modalscope.io.texts import in_ascii
from modalscope.io.uff.dofs import dof_fields
from modalscope.io.uff.function import AXIS, DOFS, TEXT, Function
from modalscope.io.uff.layout import form
from modalscope.io.uff.scan import BINARY, FORM, HEADER_LINES
from modalscope.model.checks import RealArray

__all__ = ["write_function"]

#: Characters of a unit.
_UNIT = 20


def write_function(function: Function, *, text: bool = False) -> bytes:
    """Return one dataset 58 in double precision: binary, or text of 12 digits."""
    cplx = np.iscomplexobj(function.values)
    points, even = function.values.size, function.even
    parts = 2 if cplx else 1
    y = np.ascontiguousarray(function.values, dtype=complex if cplx else float).view(float).reshape(points, parts)
    first, last = float(function.x[0]), float(function.x[-1])
    step = (last - first) / (points - 1) if points > 1 else 1.0
    records = _header(function, (6 if cplx else 4, points, int(even), first * even, step * even), (first, last))
    if text:
        body = _text_body(y, None if even else function.x)
        return b"    -1\n    58\n" + (records + body).encode("ascii") + b"    -1\n"
    table = y if even else np.column_stack([function.x, y])
    payload = np.ascontiguousarray(table, dtype="<f8").tobytes()
    # the flag stands right behind the number
    head = (
        f"{58:6d}b"
        + form(
            BINARY,
            {
                "byte order": 1,
                "floating-point format": 2,
                "number of ASCII lines": HEADER_LINES,
                "number of bytes": len(payload),
            },
        )[7:]
    )
    return b"    -1\n" + (head + "\n" + records).encode("ascii") + payload + b"    -1\n"


def _header(function: Function, shape: tuple[int, int, int, float, float], ends: tuple[float, float]) -> str:
    texts = [*function.texts, *["NONE"] * 4][:4]
    texts.append(f"abscissa {ends[0]!r} to {ends[1]!r}" if function.even else "NONE")
    entity, node, direction = dof_fields(function.output)
    entity_in, node_in, direction_in = dof_fields(function.input) if function.input else ("NONE", 0, 0)
    lines = [form(TEXT, {"text": line}) for line in texts]
    lines.append(form(DOFS, {
        "function type": function.kind, "function number": function.place,
        "response entity": entity, "response node": node, "response direction": direction,
        "reference entity": entity_in, "reference node": node_in, "reference direction": direction_in,
    }))  # fmt: skip
    names = ("ordinate data type", "number of points", "abscissa spacing", "abscissa minimum", "abscissa increment")
    lines.append(form(FORM, dict(zip(names, shape, strict=True))))
    units = {17: "s", 18: "Hz"}
    lines.append(form(AXIS, {"data type": function.abscissa_type, "unit": units.get(function.abscissa_type)}))
    lines.append(form(AXIS, {"data type": function.quantity, "unit": in_ascii("unit", function.unit, _UNIT)}))
    lines.append(form(AXIS, {"data type": function.denominator, "unit": in_ascii("unit", function.unit_in, _UNIT)}))
    lines.append(form(AXIS, {}))
    return "\n".join(lines) + "\n"


def _text_body(y: RealArray, x: RealArray | None) -> str:
    if x is None:
        flat = [f"{value:20.11E}" for value in y.ravel()]
        return "".join("".join(flat[k : k + 4]) + "\n" for k in range(0, len(flat), 4))
    rows = [f"{point:13.5E}" + "".join(f"{value:20.11E}" for value in row) for point, row in zip(x, y, strict=True)]
    together = 2 if y.shape[1] == 1 else 1
    return "".join("".join(rows[k : k + together]) + "\n" for k in range(0, len(rows), together))
