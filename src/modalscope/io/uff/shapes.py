"""Read and write mode shapes in universal files, datasets 55 and 2414."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.data import DataError, ModalModel, parse_dof
from modalscope.io.limits import Room
from modalscope.io.uff.layout import (
    CODES,
    DAMAGED,
    DIRECTIONS,
    QUANTITY_CODES,
    QUANTITY_OF,
    Field,
    Record,
    form,
    number,
    one_set,
    parse,
    sort_key,
    whole,
)
from modalscope.io.uff.scan import Block
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from

_TEXT: Record = (Field("text", 80, "a"),)
_DEFINITION = (
    Field("model type", 10, "i"), Field("analysis type", 10, "i"), Field("data characteristic", 10, "i"), Field("quantity", 10, "i"),
    Field("data type", 10, "i"), Field("values per node", 10, "i"),
)  # fmt: skip
_NORMAL, _COMPLEX, _COMPLEX_SECOND = 2, 3, 7
_LABELS = {1: (0,), 2: (1, 2, 3), 3: (1, 2, 3, 4, 5, 6)}
_REAL_TYPES, _COMPLEX_TYPES = (2, 4), (5, 6)
#: Columns of a value, and values in a line; the first node number that needs more than ten columns.
_COLUMNS, _VALUES_OF_LINE, _TOO_LARGE = 13, 6, 10**10

#: Ends and beginnings of the fields of deviations.
_WORDS, _NAMES = ("std", "repeatability"), ("frequencies", "damping_ratios")

#: Analysis type and second line of a set with standard deviations of the shape of a mode, by its number.
_UNKNOWN, _OF_STD = 0, re.compile(r"standard deviation of mode (\d{1,9})$")

#: Texts that state deviations: pairs of frequency and damping ratio, and the damping ratio that intervals count from.
_STATED = re.compile(r"(std|repeatability|degrees|lower) (\S{1,12})(?: Hz)?(?:, (\S{1,12}?))?(?:;|$)")


@dataclass(frozen=True, kw_only=True, slots=True)
class Shape:
    """One mode: its pole in rad/s, its values by (node, direction code), the quantity of these, and deviations by the words of its text.

    `std_of`: number of the mode, from 1, whose standard deviations the values are; 0 for a shape.
    """

    pole: complex
    values: dict[tuple[int, int], complex]
    quantity: str | None
    dataset: int
    stated: dict[str, list[float]]
    std_of: int = 0


def read_shape(name: str, block: Block) -> Shape | str:
    """Read one set; a set of another analysis is answered by a reason to leave it.

    Raises `DataError`: records that do not read, or another number of values at a node than the header counts.
    """
    where = f"{block.name} of {name}"
    newer = block.dataset == 2414
    start, body = (8, 13) if newer else (5, 8)
    if len(block.records) < body:
        return f"it has {len(block.records)} records where a mode has {body} before its data"
    try:
        if newer and whole(where, "the dataset location", block.records[2][:10].decode("latin-1")) != 1:
            return "its data do not lie at nodes"
        head = parse(_DEFINITION, block.records[start], where)
    except DataError as error:
        return f"its header is not that of a mode ({error.found})"
    texts = [line.decode("latin-1").strip() for line in block.records[start - 5 : start]]
    of = _OF_STD.match(texts[1]) if texts[0] == "modalscope" else None
    if of is None and head["analysis type"] not in (_NORMAL, _COMPLEX, _COMPLEX_SECOND):
        return f"analysis type {head['analysis type']} is not a mode"
    if head["data characteristic"] not in _LABELS or head["data type"] not in (*_REAL_TYPES, *_COMPLEX_TYPES):
        return f"data characteristic {head['data characteristic']} of type {head['data type']} is not a shape"
    values, quantity = _values(where, block.records[body:], head), QUANTITY_OF.get(head["quantity"])
    lines, ours = block.records[start + 3 if newer else start + 2 :], texts[0] == "modalscope"
    return Shape(
        pole=0 if of else _pole(where, head["analysis type"], lines, newer),
        values=values,
        quantity=quantity,
        dataset=block.dataset,
        stated=_stated(where, texts[2], texts[4]) if ours and not of else {},
        std_of=int(of[1]) if of else 0,
    )


def _stated(where: str, *texts: str) -> dict[str, list[float]]:
    """Return the numbers behind each word of the texts of a set."""
    found = (match.groups() for text in texts for match in _STATED.finditer(text))
    return {word: [number(where, word, each) for each in values if each is not None] for word, *values in found}


def _reals(where: str, line: bytes) -> list[float]:
    text = line.decode("latin-1").rstrip()
    return [number(where, "the data", text[k : k + _COLUMNS]) for k in range(0, len(text), _COLUMNS)]


def _pole(where: str, analysis: int, lines: Sequence[bytes], newer: bool) -> complex:
    records = [_reals(where, line) for line in lines[: 1 + newer]]
    values = records[0 if analysis == _NORMAL else -1]
    places = (0, 1) if analysis != _NORMAL else (1, 4) if newer else (0, 2)
    if len(values) <= places[1]:
        asked = f"{where} needs the frequency or the eigenvalue of its mode"
        raise DataError(asked, "the record is cut off", DAMAGED)
    first, second = (values[place] for place in places)
    if analysis != _NORMAL:
        return complex(first, second)
    if first < 0 or abs(second) > 1:
        fault, remedy = f"they are {first:g} Hz and {second:g}", "Correct the mode, or leave it out."
        raise DataError(f"{where} needs a frequency from 0 on and a damping ratio within 1", fault, remedy)
    return complex(poles_from(first, second))


def _values(where: str, lines: Sequence[bytes], head: dict[str, int]) -> dict[tuple[int, int], complex]:
    directions = _LABELS[head["data characteristic"]]
    cplx = head["data type"] in _COMPLEX_TYPES
    count = head["values per node"] * (2 if cplx else 1)
    if head["values per node"] != len(directions):
        fault = f"its header counts {head['values per node']}"
        raise DataError(f"{where} needs {len(directions)} values per node", fault, DAMAGED)
    values: dict[tuple[int, int], complex] = {}
    rows = iter(lines)
    for line in rows:
        node = whole(where, "a node", line.decode("latin-1"))
        data: list[float] = []
        while len(data) < count and (more := next(rows, None)) is not None:
            data += _reals(where, more)
        if len(data) != count or (node, directions[0]) in values:
            raise DataError(f"{where} needs {count} numbers once for node {node}", f"it has {len(data)}", DAMAGED)
        parts = list(map(complex, data[::2], data[1::2])) if cplx else list(map(complex, data))
        values |= {(node, code): value for code, value in zip(directions, parts, strict=True)}
    return values


def modes_of(shapes: Sequence[Shape], space: Room) -> tuple[ModalModel, list[str]]:
    """Return the modes of several sets; a direction that no mode moves anywhere in the file is taken as not measured."""
    notes = []
    deviations = {shape.std_of: shape.values for shape in shapes if shape.std_of}
    shapes = [shape for shape in shapes if not shape.std_of]
    dofs = list(dict.fromkeys(dof for shape in shapes for dof in shape.values))
    count = sum(len(shape.values) for shape in shapes)
    space.square(f"{len(shapes)} modes at {len(dofs)} dofs", len(shapes) * len(dofs), count)
    moved = [dof for dof in dofs if any(shape.values.get(dof, 0) != 0 for shape in shapes)] or dofs
    if len(moved) < len(dofs):
        notes.append(f"{len(dofs) - len(moved)} directions are zero in every mode and were left out as not measured")
    labels = {f"{node}:{DIRECTIONS[code]}": (node, code) for node, code in moved}
    labels = {label: labels[label] for label in sorted(labels, key=sort_key)}
    quantities = {shape.quantity for shape in shapes}
    table = [[shape.values.get(dof, 0) for shape in shapes] for dof in labels.values()]
    each = [deviations.get(j, {}) for j in range(1, len(shapes) + 1)]
    std = [[abs(values.get(dof, np.nan)) for values in each] for dof in labels.values()]
    modes = ModalModel(
        poles=np.array([shape.pole for shape in shapes], dtype=complex),
        shapes=np.array(table, dtype=complex).reshape(len(labels), len(shapes)),
        shapes_std=np.array(std, dtype=float).reshape(len(labels), len(shapes)) if any(each) else None,
        **_fields_stated([shape.stated for shape in shapes]),
        output_dofs=tuple(labels),
        quantity=quantities.pop() if len(quantities) == 1 else None,
        scaling="as in the file",
    )
    return modes, notes


def _fields_stated(stated: Sequence[dict[str, list[float]]]) -> dict[str, Any]:
    """Return the fields of modes that texts state, NaN for modes whose text does not."""

    def of(word: str, k: int) -> RealArray | None:
        columns = [each[word][k] if len(each.get(word, ())) > k else np.nan for each in stated]
        return np.array(columns) if any(word in each for each in stated) else None

    pairs = {f"{name}_{word}": of(word, k) for word in _WORDS for k, name in enumerate(_NAMES)}
    degrees = [of("degrees", k) for k in range(2)]
    both = [column for column in degrees if column is not None]
    both_degrees = np.stack(both, axis=1) if len(both) == 2 else None
    return {**pairs, "damping_ratios_lower": of("lower", 0), "degrees": both_degrees}


def write_shapes(modes: ModalModel, dataset: int) -> bytes:
    """Return one set a mode: real shapes of damped modes as normal modes, others as complex eigenvalues; deviations behind them."""
    real = not modes.shapes.imag.any() and all(kind in ("mode", "unstable") for kind in modes.kinds)
    codes, rows, nodes = _places(modes)
    data = deviations = b""
    for j in range(len(modes)):
        table = np.zeros((len(nodes), len(codes)), dtype=complex)
        for channel, (node, column, sign) in enumerate(rows):
            table[nodes.index(node), column] += sign * modes.shapes[channel, j]
        data += _one(modes, j, dataset, real, codes, nodes, table)
        if modes.shapes_std is not None and np.all(np.isfinite(modes.shapes_std[:, j])):
            for channel, (node, column, _) in enumerate(rows):
                table[nodes.index(node), column] = modes.shapes_std[channel, j]
            deviations += _one(modes, j, dataset, real, codes, nodes, table, of_std=True)
    return data + deviations


def _places(modes: ModalModel) -> tuple[tuple[int, ...], list[tuple[int, int, float]], list[int]]:
    """Return the direction codes of a set, and for every channel its node, its column and its sign."""
    asked = "writing mode shapes to a universal file:"
    nodes, codes_of_dofs, odd = [], [], []
    for label in modes.output_dofs:
        dof = parse_dof(label)
        if dof is None or not dof.node.isdecimal() or not 1 <= int(dof.node) < _TOO_LARGE:
            odd.append(repr(label))
        else:
            nodes.append(int(dof.node))
            codes_of_dofs.append(CODES[dof.direction])
    if odd:
        fault = f"the channels {', '.join(odd[:5])} are not node numbers with a direction"
        raise DataError(asked, fault, "Give the data output_dofs such as 3:+Z, or write .json or .npz.")
    used = set(map(abs, codes_of_dofs))
    if 0 in used and used != {0}:
        raise DataError(asked, "some channels are scalars and some have directions", "Give all a direction.")
    codes = _LABELS[1] if used == {0} else _LABELS[2] if max(used) <= 3 else _LABELS[3]
    places = [(n, codes.index(abs(c)), -1.0 if c < 0 else 1.0) for n, c in zip(nodes, codes_of_dofs, strict=True)]
    if len({place[:2] for place in places}) < len(places):
        raise DataError(asked, "a node is measured twice along one axis", "Leave out one of the two channels.")
    return codes, places, sorted(set(nodes))


def _one(
    modes: ModalModel,
    j: int,
    dataset: int,
    real: bool,
    codes: tuple[int, ...],
    nodes: Sequence[int],
    table: ComplexArray,
    *,
    of_std: bool = False,
) -> bytes:
    f, zeta, pole = modes.frequencies[j], modes.damping_ratios[j], modes.poles[j]
    real = real or of_std
    head: dict[str, Any] = {
        "model type": 1, "analysis type": _UNKNOWN if of_std else _NORMAL if real else _COMPLEX,
        "data characteristic": {1: 1, 3: 2, 6: 3}[len(codes)],
        "quantity": QUANTITY_CODES[modes.quantity], "data type": 2 if real else 5, "values per node": len(codes),
    }  # fmt: skip
    title = f"standard deviation of mode {j + 1}" if of_std else f"mode {j + 1}: {f:.6g} Hz, damping ratio {zeta:.6g}"
    texts = ["modalscope", title, _freedom(modes, j), f"shapes {modes.scaling}", _deviations(modes, j)]
    if of_std:
        f, zeta = 0.0, 0.0
    lines = [form(_TEXT, {"text": text}) for text in texts] + [form(_DEFINITION, head)]
    if dataset == 2414:
        integers = ["".join(f"{v:10d}" for v in (0, 0, 0, 0, 0, j + 1, 0, 0)), f"{0:10d}{0:10d}"]
        first = _row([0, f, 0, 0, zeta, 0] if real else [0] * 6)
        second = _row([0] * 6 if real else [pole.real, pole.imag, 0, 0, 0, 0])
        lines = [f"{j + 1:10d}", form(_TEXT, {"text": texts[1]}), f"{1:10d}", *lines, *integers, first, second]
    else:
        lines.append("".join(f"{v:10d}" for v in ((1, 1, j + 1) if of_std else (2, 4 if real else 6, 1, j + 1))))
        lines.append(_row([0]) if of_std else _row([f, 0, zeta, 0] if real else [pole.real, pole.imag, 0, 0, 0, 0]))
    for node, row in zip(nodes, table, strict=True):
        flat = row.real if real else row.view(float)
        lines += [f"{node:10d}", *(_row(flat[k : k + _VALUES_OF_LINE]) for k in range(0, flat.size, _VALUES_OF_LINE))]
    return one_set(dataset, lines)


def _deviations(modes: ModalModel, j: int) -> str:
    """Return the deviations of frequency and damping ratio as a line of text; NONE where none is known."""
    texts = []
    for name in _WORDS:
        f, zeta = (getattr(modes, f"{of}_{name}") for of in _NAMES)
        if f is not None and zeta is not None and np.isfinite(f[j]):
            texts.append(f"{name} {f[j]:.5g} Hz" + (f", {zeta[j]:.5g}" if np.isfinite(zeta[j]) else ""))
    return "; ".join(texts) or "NONE"


def _freedom(modes: ModalModel, j: int) -> str:
    """Return the degrees of freedom of the deviations and the lower damping ratio as a line of text; NONE where none is known."""
    texts = []
    if modes.degrees is not None and np.all(np.isfinite(modes.degrees[j])):
        texts.append(f"degrees {modes.degrees[j, 0]:.5g}, {modes.degrees[j, 1]:.5g}")
    if modes.damping_ratios_lower is not None and np.isfinite(modes.damping_ratios_lower[j]):
        texts.append(f"lower {modes.damping_ratios_lower[j]:.5g}")
    return "; ".join(texts) or "NONE"


def _row(values: Any) -> str:
    return "".join(f"{float(v):13.5E}" for v in values)
