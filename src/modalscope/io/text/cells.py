"""Cells of a text table: how lines are parted, and what a cell holds."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.io.text.stamps import is_stamp
from modalscope.model.checks import Array

__all__ = ["Dialect", "complex_of", "is_value", "number_of", "split", "uncommented"]

#: Characters of a cell that are looked at.
_LONGEST = 400


def _unsigned(name: str) -> str:
    """Return the pattern of a number without its sign; the groups of thousands in it are parted by one sign, of this name."""
    groups = rf"\d{{1,3}}(?P<{name}>[.,'’\u00a0\u202f ])\d{{3}}(?:(?P={name})\d{{3}})*(?:[.,]\d+)?"
    return rf"(?:\d+\.?|\d*[.,]\d+|{groups})(?:[eEdD][+-]?\d{{1,4}})?"


_NUMBER = re.compile(rf"[+-]?\s?{_unsigned('a')}\Z")
_COMPLEX = re.compile(
    rf"\(?\s*(?:[+-]?\s?{_unsigned('a')}\s*[+-]\s*)?[+-]?(?:{_unsigned('b')}\s*\*?\s*[ijIJ]|[ijIJ]\s*\*?\s*{_unsigned('c')})\s*\)?\Z"
)
_IMAGINARY_FIRST = re.compile(r"([+-])[ijIJ]\*?(.+)\Z")
_MISSING = {
    "",
    "nan",
    "n/a",
    "na",
    "-",
    "--",
    "null",
    "none",
    "#n/a",
    "inf",
    "+inf",
    "-inf",
    "-nan",
    "1.#qnan",
    "-1.#ind",
    "*",
}
_MARKERS = ("#", "%", "//", "!")


@dataclass(frozen=True, kw_only=True, slots=True)
class Dialect:
    """How numbers and cells are written.

    Parameters
    ----------
    delimiter : str
        Between cells; empty for blanks.
    decimal, thousands : str
        Signs inside numbers; `thousands` is empty where groups of digits are not parted.
    quoted : bool
        Whether cells stand in quotation marks.
    paired : bool
        Whether the comma is both: two cells at a time are one number.
    """

    delimiter: str
    decimal: str = "."
    thousands: str = ""
    quoted: bool = False
    paired: bool = False


def uncommented(line: str) -> tuple[str, bool]:
    """Return a line without the sign of a comment before it, and whether there was one.

    Examples
    --------
    >>> uncommented("# Time, Force"), uncommented("// a"), uncommented("0.1, 2")
    (('Time, Force', True), ('a', True), ('0.1, 2', False))
    """
    text = line.strip("\r\n")
    bare = text.lstrip()
    for marker in _MARKERS:
        if bare.startswith(marker):
            return bare.lstrip(marker).strip(), True
    return text, False


def split(line: str, dialect: Dialect) -> list[str]:
    """Return the cells of a line without the blanks around them.

    Examples
    --------
    >>> split("0,1 ; 2;", Dialect(delimiter=";")), split(" 1  2", Dialect(delimiter=""))
    (['0,1', '2', ''], ['1', '2'])
    """
    if not dialect.quoted:
        cells = line.split(dialect.delimiter) if dialect.delimiter else line.split()
    else:
        rows = csv.reader([line.strip()], delimiter=dialect.delimiter or " ", skipinitialspace=True)
        try:
            cells = next(rows, [])
        except csv.Error:  # a mark that nothing closes for many characters
            cells = [line]
    if dialect.paired and len(cells) % 2 == 0:
        cells = [f"{whole},{part}" for whole, part in zip(cells[::2], cells[1::2], strict=True)]
    return [cell.strip() for cell in cells]


def is_value(cell: str) -> bool:
    """Whether a cell holds a number in any writing, a complex one, a date or time, or says that there is none.

    Examples
    --------
    >>> [is_value(cell) for cell in ("1.5e-3", "1.234,5", "1+2i", "12:00:01.5", "", "Force", "5;2")]
    [True, True, True, True, True, False, False]
    """
    if len(cell) > _LONGEST:
        return False
    return bool(_NUMBER.match(cell)) or cell.lower() in _MISSING or bool(_COMPLEX.match(cell)) or is_stamp(cell)


def is_number(cell: str) -> bool:
    """Whether a cell holds one real number in any writing."""
    return len(cell) <= _LONGEST and bool(_NUMBER.match(cell))


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no number."""
    return cell.lower() in _MISSING


def is_complex(cell: str) -> bool:
    """Whether a cell holds a complex number."""
    return len(cell) <= _LONGEST and bool(_COMPLEX.match(cell))


def _pointed(cell: str, dialect: Dialect) -> str:
    """Return a number with a decimal point and nothing between its digits."""
    text = cell.replace(dialect.thousands, "") if dialect.thousands else cell
    if dialect.decimal != ".":
        text = text.replace(dialect.decimal, ".")
    return text.replace("D", "e").replace("d", "e").replace(" ", "")


def number_of(cell: str, dialect: Dialect) -> float:
    """Return the number in a cell, NaN where it says that there is none; anything else is a `ValueError`.

    Examples
    --------
    >>> (
    ...     number_of("1.234,5", Dialect(delimiter=";", decimal=",", thousands=".")),
    ...     number_of("1.5D+03", Dialect(delimiter="")),
    ... )
    (1234.5, 1500.0)
    """
    try:
        return float(cell)
    except ValueError:
        pass
    if is_missing(cell):
        return float("nan")
    return float(_pointed(cell, dialect))


def complex_of(cell: str, dialect: Dialect) -> complex:
    """Return the complex number in a cell, with i or j, in front or behind; anything else is a `ValueError`.

    Examples
    --------
    >>> complex_of("(1.5 - 2i)", Dialect(delimiter=",")), complex_of("1,5+j*2", Dialect(delimiter=";", decimal=","))
    ((1.5-2j), (1.5+2j))
    """
    if is_missing(cell):
        return complex("nan")
    text = _pointed(cell, dialect).strip("()").replace("*", "").replace("i", "j").replace("I", "j").replace("J", "j")
    if not text.endswith("j"):
        text = _IMAGINARY_FIRST.sub(r"\1\2j", text)
    return complex(text)


def columns_of(rows: Sequence[Sequence[str]], kinds: Sequence[str], dialect: Dialect) -> list[Array]:
    """Return the columns of some rows as arrays of their kinds; texts and stamps as they stand."""
    arrays: list[Array] = []
    for kind, cells in zip(kinds, zip(*rows, strict=True), strict=True):
        if kind == "number":
            arrays.append(np.array([number_of(cell, dialect) for cell in cells]))
        elif kind == "complex":
            arrays.append(np.array([complex_of(cell, dialect) for cell in cells]))
        else:
            arrays.append(np.array(cells if kind == "stamp" else [""], dtype=np.str_))
    return arrays
