"""Define the fixed-column records of universal files, for reading and writing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from modalscope.data import DataError, parse_dof

#: What to do about a set that does not read.
DAMAGED = "The file is damaged there; export it again."
#: Blanks of a record; no other white space is one.
_BLANK = " \t"
_WHOLE = re.compile(r"[+-]?[0-9]+\Z")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([EeDd][+-]?[0-9]+)?\Z")


class Field(NamedTuple):
    """Columns of a record: `kind` is "i" (whole number), "e" (real), "a" (text) or "-" (not used)."""

    name: str
    width: int
    kind: str


Record = Sequence[Field]


def whole(where: str, name: str, text: str) -> int:
    """Return a whole number; blank columns are 0, as Fortran reads them."""
    stripped = text.strip(_BLANK)
    if stripped and not _WHOLE.match(stripped):
        raise _unreadable(where, name, "a whole number", text)
    return int(stripped) if stripped else 0


def number(where: str, name: str, text: str) -> float:
    """Return a real number, D exponents too; blank columns are 0. NaN and infinity are not numbers here."""
    stripped = text.strip(_BLANK)
    if stripped and not _NUMBER.match(stripped):
        raise _unreadable(where, name, "a finite number", text)
    value = float(stripped.upper().replace("D", "E")) if stripped else 0.0
    if value in (float("inf"), float("-inf")):
        raise _unreadable(where, name, "a finite number", text)
    return value


def parse(record: Record, line: bytes, where: str) -> dict[str, Any]:
    """Return the fields of a line by name."""
    text = line.decode("latin-1")
    values: dict[str, Any] = {}
    start = 0
    for name, width, kind in record:
        columns = text[start : start + width]
        start += width
        if kind == "i":
            values[name] = whole(where, name, columns)
        elif kind == "e":
            values[name] = number(where, name, columns)
        elif kind == "a":
            values[name] = _in_words(columns)
    return values


def _in_words(columns: str) -> str:
    """Return text as it was meant: in UTF-8 where the bytes are that, else in Latin-1."""
    try:
        return columns.encode("latin-1").decode("utf-8").strip()
    except UnicodeDecodeError:
        return columns.strip()


def form(record: Record, values: Mapping[str, Any]) -> str:
    """Return a line with the fields in their columns; what is not given is 0, or NONE for text."""
    line = ""
    for name, width, kind in record:
        if kind == "a":
            # texts of an inner field begin after one blank column
            text = " " * (width not in (20, 80)) + (str(values.get(name) or "") or "NONE")
            line += text[:width].ljust(width)
            continue
        value = float(values.get(name, 0.0))
        if kind == "e":
            text = thirteen(value) if width == 13 else f"{value:.16E}"
        else:
            text = str(int(values.get(name, 0)))
        text = text.rjust(width)
        if len(text) > width:
            asked = f"writing {name} = {values.get(name)} to a universal file:"
            raise DataError(asked, f"it has {width} columns there", "Choose a smaller number, or another format.")
        line += text
    return line


def one_set(dataset: int, lines: Iterable[str]) -> bytes:
    """Return one set of text records between its delimiters."""
    return ("\n".join(["    -1", f"{dataset:6d}", *lines]) + "\n    -1\n").encode("ascii")


def thirteen(value: float) -> str:
    """Return the nearest number that 13 columns hold, the first of them blank or a sign.

    Examples
    --------
    >>> thirteen(1.0002000200020003), thirteen(-2.5e-7)
    (' 1.0002000200', '-2.500000E-07')
    """
    texts = [f"{value: .{digits}f}" for digits in range(11)] + [f"{value: .{digits}E}" for digits in (5, 6)]
    return min((text for text in reversed(texts) if len(text) <= 13), key=lambda text: abs(float(text) - value))


def _unreadable(where: str, name: str, wanted: str, text: str) -> DataError:
    remedy = "The file is damaged there or not a universal file; export it again."
    return DataError(f"{where} needs {wanted} for {name}", f"the columns hold {text.strip()!r}", remedy)


#: Codes of directions.
DIRECTIONS = {0: "S"} | {
    sign * (k + 1): f"{'+' if sign > 0 else '-'}{axis}"
    for k, axis in enumerate(("X", "Y", "Z", "RX", "RY", "RZ"))
    for sign in (1, -1)
}
CODES = {name: code for code, name in DIRECTIONS.items()}
#: Specific data types: what an ordinate is.
QUANTITY_OF = {8: "displacement", 11: "velocity", 12: "acceleration"}
QUANTITY_CODES: dict[str | None, int] = {None: 0, **{name: code for code, name in QUANTITY_OF.items()}}
#: Reaction force and excitation force.
FORCES = (9, 13)
#: Characters of an entity's name, and columns of a unit.
_MAX_LETTERS, _COLUMNS_OF_UNIT = 10, 20

#: Signs of units, and what stands for them where there is ASCII alone.
_SIGNS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "³": "3", "·": "*", "×": "x", "°": "deg", "Ω": "Ohm", "–": "-"})


def label_from(where: str, entity: str, node: int, direction: int) -> str:
    """Return the label of a node and a direction; an entity name stands for a node that has no number."""
    if direction not in DIRECTIONS:
        raise DataError(f"{where} needs a direction from -6 to 6", f"it has {direction}", DAMAGED)
    named = entity if entity.upper() != "NONE" else ""
    if node == 0 and named:
        return named if direction == 0 else f"{named}:{DIRECTIONS[direction]}"
    return f"{node}:{DIRECTIONS[direction]}"


def dof_fields(label: str) -> tuple[str, int, int]:
    """Return entity name, node and direction code of a label; `label_from` is the inverse."""
    dof = parse_dof(label)
    node, direction = (label, 0) if dof is None else (dof.node, CODES.get(dof.direction, 0))
    if dof is not None and node.isdecimal() and int(node) < 10**10 and str(int(node)) == node:
        return "NONE", int(node), direction
    writable = node.isascii() and node.isprintable() and 0 < len(node) <= _MAX_LETTERS
    if not writable or label_from("", node, 0, direction) != label:
        fault = f"that has a node number or a name of up to {_MAX_LETTERS} ASCII characters"
        remedy = "Give labels of node and direction, such as 3:+Z, as output_dofs and input_dofs."
        raise DataError(f"writing the channel {label!r} to a universal file:", fault, remedy)
    return node, 0, direction


def sort_key(label: str) -> tuple[int, int, str, int, int]:
    """Return a key that sorts labels by node number, then direction; names come last, in their own order."""
    dof = parse_dof(label)
    if dof is None:
        return (1, 0, label, 0, 0)
    code = CODES.get(dof.direction, 0)
    if dof.node.isdecimal():
        return (0, int(dof.node), "", abs(code), code < 0)
    return (1, 0, dof.node, abs(code), code < 0)


def unit_in_ascii(text: str) -> str:
    """Return a unit as a field of a universal file holds it, signs by their letters; what does not fit is refused.

    Examples
    --------
    >>> unit_in_ascii("µm/s²")
    'um/s2'
    """
    plain = text.translate(_SIGNS)
    short = plain == plain.strip() and len(plain) <= _COLUMNS_OF_UNIT and plain.upper() != "NONE"
    if not (short and plain.isascii() and plain.isprintable()):
        fault = f"it has {_COLUMNS_OF_UNIT} columns for ASCII characters there, with no blank at either end, and NONE means none"
        remedy = "Shorten or rename it, or choose another format."
        raise DataError(f"writing the unit {text!r} to a universal file:", fault, remedy)
    return plain
