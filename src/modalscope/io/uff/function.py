"""Read and write dataset 58, functions at nodal degrees of freedom, as text and binary."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.data import DataError
from modalscope.io.uff.layout import DAMAGED, Field, dof_fields, form, label_from, parse, unit_in_ascii
from modalscope.io.uff.scan import BINARY, FORM, HEADER_LINES, Block
from modalscope.numerics.checks import Array, RealArray

FUNCTION_TYPES = (
    "general function", "time response", "auto spectrum", "cross spectrum", "frequency response", "transmissibility", "coherence",
    "auto correlation", "cross correlation", "power spectral density", "energy spectral density", "probability density",
    "spectrum", "cumulative frequency distribution", "peaks valley", "stress/cycles", "strain/cycles", "orbit",
    "mode indicator function", "force pattern", "partial power", "partial coherence", "eigenvalue", "eigenvector",
    "shock response spectrum", "finite impulse response filter", "multiple coherence", "order function",
)  # fmt: skip

DOFS = (
    Field("function type", 5, "i"), Field("function number", 10, "i"), Field("version", 5, "i"), Field("load case", 10, "i"),
    Field("response entity", 11, "a"), Field("response node", 10, "i"), Field("response direction", 4, "i"),
    Field("reference entity", 11, "a"), Field("reference node", 10, "i"), Field("reference direction", 4, "i"),
)  # fmt: skip
AXIS = (
    Field("data type", 10, "i"), Field("length exponent", 5, "i"), Field("force exponent", 5, "i"), Field("temperature exponent", 5, "i"),
    Field("label", 21, "a"), Field("unit", 21, "a"),
)  # fmt: skip
TEXT = (Field("text", 80, "a"),)
#: What to do about values that are not finite.
_REPAIR = "Repair that function, or leave it out of the export."

_ALPHABET = b"0123456789+-.EeDd \t"
_EXACT = re.compile(r"abscissa (\S+) to (\S+)")
#: Columns of numbers in single and in double precision.
_SINGLE, _DOUBLE = 13, 20


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Function:
    """One measured function: its type, its dofs, its abscissa and its values.

    `quantity`, `denominator` and `abscissa_type` are specific data types (12 acceleration, 13 excitation force, 17 time ...);
    `texts` are the five ID lines.
    """

    kind: int
    output: str
    input: str
    x: RealArray
    values: Array
    quantity: int = 0
    denominator: int = 0
    abscissa_type: int = 0
    unit: str = ""
    unit_in: str = ""
    even: bool = True
    place: int = 0
    part: str = ""
    texts: tuple[str, ...] = ()
    note: str = ""

    @property
    def words(self) -> str:
        """What the function is."""
        return FUNCTION_TYPES[self.kind] if 0 <= self.kind < len(FUNCTION_TYPES) else f"function of type {self.kind}"


def read_function(name: str, block: Block) -> Function:
    """Read one dataset 58.

    Raises `DataError`: records that do not read, another number of values than the header counts, NaN, values of an impossible size.
    """
    where = f"{block.name} of {name}"
    if len(block.records) < HEADER_LINES:
        fault = f"it has {len(block.records)}"
        raise DataError(f"{where} needs {HEADER_LINES} records before its data", fault, DAMAGED)
    dofs, shape = parse(DOFS, block.records[5], where), parse(FORM, block.records[6], where)
    abscissa, ordinate, denominator = (parse(AXIS, line, where) for line in block.records[7:10])
    _check_form(where, shape)
    if block.payload is None:
        x, values = _from_text(where, block.records[HEADER_LINES:], shape)
    else:
        x, values = _from_bytes(where, block, shape)
    texts = tuple(line.decode("latin-1").strip() for line in block.records[:5])
    return Function(
        kind=dofs["function type"],
        output=label_from(where, dofs["response entity"], dofs["response node"], dofs["response direction"]),
        input=label_from(where, dofs["reference entity"], dofs["reference node"], dofs["reference direction"]),
        x=_even_abscissa(where, shape, texts) if x is None else x,
        values=values,
        quantity=ordinate["data type"],
        denominator=denominator["data type"],
        abscissa_type=abscissa["data type"],
        unit=_named(ordinate["unit"]),
        unit_in=_named(denominator["unit"]),
        even=x is None,
        place=block.place,
        part=block.name,
        texts=texts,
        note=block.note,
    )


def _named(text: str) -> str:
    return "" if text.upper() == "NONE" else text


def _check_form(where: str, shape: dict[str, Any]) -> None:
    kind, points, spacing = shape["ordinate data type"], shape["number of points"], shape["abscissa spacing"]
    if kind not in (2, 4, 5, 6) or points < 1 or spacing not in (0, 1):
        fault = f"they are {kind}, {points} and {spacing}"
        raise DataError(f"{where} needs data type 2, 4, 5 or 6, at least one point, and spacing 0 or 1", fault, DAMAGED)
    if spacing == 1 and points > 1 and shape["abscissa increment"] <= 0:
        asked = f"{where} needs a positive abscissa increment"
        raise DataError(asked, f"it is {shape['abscissa increment']:g}", "Export it again, or with uneven abscissa.")


def _even_abscissa(where: str, shape: dict[str, Any], texts: Sequence[str]) -> RealArray:
    """Return minimum + k increment; an ID line of ours that agrees with these 13 columns holds all digits of the ends."""
    first, step, points = shape["abscissa minimum"], shape["abscissa increment"], shape["number of points"]
    last = first + step * (points - 1)
    match = _EXACT.match(texts[4])
    if match:
        try:
            ends = float(match[1]), float(match[2])
        except ValueError:
            ends = first, last
        if abs(ends[0] - first) <= 1e-4 * step and abs(ends[1] - last) <= 1e-4 * step * points:
            first, last = ends
    x = np.linspace(first, last, points)
    if not np.isfinite(x).all():
        raise DataError(f"{where} needs a finite abscissa", f"it runs from {first:g} to {last:g}", DAMAGED)
    return x


def _from_bytes(where: str, block: Block, shape: dict[str, Any]) -> tuple[RealArray | None, Array]:
    size = 4 if shape["ordinate data type"] in (2, 5) else 8
    values = _decode(block, shape, size, block.order)
    other = _decode(block, shape, size, "<>".replace(block.order, ""))
    if not _plausible(*values) and _plausible(*other):
        with np.errstate(invalid="ignore", over="ignore"):
            largest = float(np.nanmax(np.abs(values[1].astype(complex))))
        right = "little-endian" if block.order == ">" else "big-endian"
        fault = f"its values then reach {largest:.1e}; they are {right}"
        remedy = "Export it again, or correct the byte order in its header (1 little, 2 big)."
        raise DataError(f"{where} is flagged {'big' if block.order == '>' else 'little'}-endian", fault, remedy)
    _check_finite(where, *values)
    return values


def _decode(block: Block, shape: dict[str, Any], size: int, order: str) -> tuple[RealArray | None, Array]:
    parts = 2 if shape["ordinate data type"] in (5, 6) else 1
    word = f"{order}f{size}"
    fields: list[Any] = [("y", word, (parts,))]
    if block.abscissa_bytes:
        fields.insert(0, ("x", f"{order}f{block.abscissa_bytes}"))
    table = np.frombuffer(block.payload or b"", dtype=fields)
    with np.errstate(invalid="ignore"):  # signalling NaN, which _check_finite reports
        y = table["y"].astype(float)
        x = table["x"].astype(float) if block.abscissa_bytes else None
    return x, _joined(y)


def _joined(y: Array) -> Array:
    return np.ascontiguousarray(y).view(complex)[:, 0] if y.shape[1] == 2 else y[:, 0].copy()


def _plausible(x: RealArray | None, values: Array) -> bool:
    """Numbers read in the wrong byte order have exponents all over; measured ones stay within 1e-25 and 1e25."""
    flat = np.concatenate([values.view(float), [] if x is None else x])
    size = np.abs(flat[flat != 0])
    return bool(np.all((size > 1e-25) & (size < 1e25)))


def _check_finite(where: str, x: RealArray | None, values: Array) -> None:
    bad = ~np.isfinite(values) | (False if x is None else ~np.isfinite(x))
    if bad.any():
        fault = f"{bad.sum()} of {bad.size} points are NaN or infinite, the first at point {np.argmax(bad) + 1}"
        raise DataError(f"{where} needs finite values", fault, _REPAIR)


def _from_text(where: str, lines: Sequence[bytes], shape: dict[str, Any]) -> tuple[RealArray | None, Array]:
    parts = 2 if shape["ordinate data type"] in (5, 6) else 1
    width = _SINGLE if shape["ordinate data type"] in (2, 5) else _DOUBLE
    uneven = shape["abscissa spacing"] == 0
    widths = [_SINGLE] * uneven + [width] * parts
    whole = b"".join(line.rstrip() for line in lines)
    points = shape["number of points"]
    if odd := whole.translate(None, _ALPHABET):
        infinite = any(word in whole.lower() for word in (b"nan", b"inf"))
        fault = "NaN or infinity" if infinite else f"the characters {odd[:10].decode('latin-1')!r}"
        raise DataError(f"{where} needs finite numbers as data", f"they hold {fault}", _REPAIR)
    cells = b" ".join(lines).split() if len(whole) != points * sum(widths) else []
    if len(cells) == points * len(widths):  # of another width than the standard, and all there
        length = max(map(len, cells))
        whole, widths = b"".join(cell.rjust(length) for cell in cells), [length] * len(widths)
    if len(whole) != points * sum(widths):
        columns_of_values = " and ".join(map(str, dict.fromkeys(widths)))
        asked = f"{where} needs the {points} points of its header, in columns of {columns_of_values}"
        remedy = "The file is cut off or damaged there; export it again."
        raise DataError(asked, f"it holds {len(whole) / sum(widths):.4g}", remedy)
    table = np.frombuffer(whole.upper().replace(b"D", b"E"), dtype=[(f"f{i}", f"S{w}") for i, w in enumerate(widths)])
    try:
        columns = [table[field].astype(float) for field in table.dtype.names or ()]
    except ValueError as error:
        raise DataError(f"{where} needs numbers in its columns", f"they do not read ({error})", DAMAGED) from None
    y = np.stack(columns[uneven:], axis=1)
    x = columns[0] if uneven else None
    values = _joined(y)
    _check_finite(where, x, values)
    return x, values


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
    counts = {"number of ASCII lines": HEADER_LINES, "number of bytes": len(payload)}
    # the flag stands right behind the number
    head = f"{58:6d}b" + form(BINARY, {"byte order": 1, "floating-point format": 2, **counts})[7:]
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
    lines.append(form(AXIS, {"data type": function.quantity, "unit": unit_in_ascii(function.unit)}))
    lines.append(form(AXIS, {"data type": function.denominator, "unit": unit_in_ascii(function.unit_in)}))
    lines.append(form(AXIS, {}))
    return "\n".join(lines) + "\n"


def _text_body(y: RealArray, x: RealArray | None) -> str:
    if x is None:
        flat = [f"{value:20.11E}" for value in y.ravel()]
        return "".join("".join(flat[k : k + 4]) + "\n" for k in range(0, len(flat), 4))
    rows = [f"{point:13.5E}" + "".join(f"{value:20.11E}" for value in row) for point, row in zip(x, y, strict=True)]
    points_of_line = 2 if y.shape[1] == 1 else 1
    return "".join("".join(rows[k : k + points_of_line]) + "\n" for k in range(0, len(rows), points_of_line))
