"""Parse the cells of a text table: numbers, complex numbers, dates and times."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from modalscope.io.columns.vocabulary import MAX_CHARACTERS
from modalscope.numerics.checks import Array, RealArray

_CLOCK = r"(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{1,2})(?:[.,:](?P<part>\d{1,9}))?)?\s?(?P<half>[AaPp][Mm])?"
_ZONE = r"(?:Z|[+-]\d{2}:?\d{2})?"
_FORMS = tuple(
    re.compile(form + r"\Z")
    for form in (
        rf"(?P<y>\d{{4}})[-/.](?P<m>\d{{1,2}})[-/.](?P<d>\d{{1,2}})(?:[T ]+{_CLOCK}{_ZONE})?",
        rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.(?P<y>\d{{4}})(?:[ T,]+{_CLOCK})?",
        rf"(?P<m>\d{{1,2}})[/-](?P<d>\d{{1,2}})[/-](?P<y>\d{{4}})(?:[ T,]+{_CLOCK})?",
        _CLOCK,
    )
)
_SECONDS_OF_DAY = 86400.0
_MAX_CHARACTERS_OF_STAMP = 40
#: Decimals of a second in stamps.
_DECIMALS_OF_SECOND = 9


def _unsigned(name: str) -> str:
    """Return the pattern of a number without its sign; the groups of thousands in it are parted by one sign, of this name."""
    groups = rf"\d{{1,3}}(?P<{name}>[.,'’\u00a0\u202f ])\d{{3}}(?:(?P={name})\d{{3}})*(?:[.,]\d+)?"
    return rf"(?:\d+\.?|\d*[.,]\d+|{groups})(?:[eEdD][+-]?\d{{1,4}})?"


_NUMBER = re.compile(rf"[+-]?\s?{_unsigned('a')}\Z")
_COMPLEX = re.compile(
    rf"\(?\s*(?:[+-]?\s?{_unsigned('a')}\s*[+-]\s*)?[+-]?(?:{_unsigned('b')}\s*\*?\s*[ijIJ]|[ijIJ]\s*\*?\s*{_unsigned('c')})\s*\)?\Z"
)
_IMAGINARY_FIRST = re.compile(r"([+-])[ijIJ]\*?(.+)\Z")
_MISSING_WORDS = {
    "",
    *["nan", "n/a", "na", "-", "--", "null", "none", "#n/a", "inf", "+inf", "-inf", "-nan", "1.#qnan", "-1.#ind", "*"],
}
_MARKERS = ("#", "%", "//", "!")


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a date, a time of day, or both.

    Examples
    --------
    >>> cells = ("2024-05-01T12:00:00.125Z", "01.05.2024 12:00:00,125", "12:00:00 PM", "1.5", "run 1")
    >>> [is_stamp(cell) for cell in cells]
    [True, True, True, False, False]
    """
    may_be = 4 <= len(cell) <= _MAX_CHARACTERS_OF_STAMP and not cell[-1].isspace()
    return may_be and any(form.match(cell) for form in _FORMS)


def _day_and_seconds(cell: str) -> tuple[int, float]:
    """Return the number of a day, 0 where there is none, and the seconds in it: together they would lose digits."""
    match = next((match for form in _FORMS if (match := form.match(cell))), None)
    if match is None:
        raise ValueError(f"{cell!r} is no date or time")
    part = match.groupdict()
    day = 0
    if part.get("y"):
        month, day_of = int(part["m"]), int(part["d"])
        if month > 12 >= day_of:  # day first, as most of the world writes it
            month, day_of = day_of, month
        day = date(int(part["y"]), month, day_of).toordinal()
    hour = int(part["h"] or 0)
    if part["half"]:
        hour = hour % 12 + (12 if part["half"].lower() == "pm" else 0)
    fraction = float(f"0.{part['part']}") if part["part"] else 0.0
    return day, hour * 3600.0 + int(part["min"] or 0) * 60.0 + int(part["s"] or 0) + fraction


def seconds_of(cells: Iterable[str], more: Iterable[str] | None = None) -> RealArray:
    """Return seconds from the first of dates and times; a column of dates and one of times of day are added.

    Times of day alone go on past midnight.

    `more`: the other column.

    Raises
    ------
    ValueError
        A cell that is none.

    Examples
    --------
    >>> seconds_of(["23:59:59.5", "00:00:00.0"]), seconds_of(["2024-05-01 12:00:00", "2024-05-01 12:00:01"])
    (array([0. , 0.5]), array([0., 1.]))
    """
    days, seconds = _columns(cells)
    if more is not None:
        other_days, other_seconds = _columns(more)
        days, seconds = days + other_days, seconds + other_seconds
    elif days.size and not days.any():
        days = np.concatenate([[0], np.cumsum(np.diff(seconds) < -_SECONDS_OF_DAY / 2)])
    return np.round((days - days[:1]) * _SECONDS_OF_DAY + (seconds - seconds[:1]), _DECIMALS_OF_SECOND)


def _columns(cells: Iterable[str]) -> tuple[RealArray, RealArray]:
    pairs = np.array([_day_and_seconds(cell) for cell in cells], float).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


@dataclass(frozen=True, kw_only=True, slots=True)
class Dialect:
    """How numbers and cells are written.

    `delimiter`: between cells; empty for blanks. `decimal`, `thousands`: signs inside numbers; `thousands` is empty where groups of
    digits are not parted. `quoted`: whether cells stand in quotation marks. `paired`: whether the comma is both: two cells at a time are
    one number.
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
        text = line.strip("\r\n " if dialect.delimiter else None)  # a blank last cell stays
        rows = csv.reader([text], delimiter=dialect.delimiter or " ", skipinitialspace=True)
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
    if len(cell) > MAX_CHARACTERS:
        return False
    return bool(_NUMBER.match(cell)) or cell.lower() in _MISSING_WORDS or bool(_COMPLEX.match(cell)) or is_stamp(cell)


def is_number(cell: str) -> bool:
    """Whether a cell holds one real number in any writing."""
    return len(cell) <= MAX_CHARACTERS and bool(_NUMBER.match(cell))


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no number."""
    return cell.lower() in _MISSING_WORDS


def is_complex(cell: str) -> bool:
    """Whether a cell holds a complex number."""
    return len(cell) <= MAX_CHARACTERS and bool(_COMPLEX.match(cell))


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
    >>> german = Dialect(delimiter=";", decimal=",", thousands=".")
    >>> number_of("1.234,5", german), number_of("1.5D+03", Dialect(delimiter=""))
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
        elif kind == "empty":  # a sensor may begin late
            arrays.append(np.array([number_of(cell, dialect) if is_number(cell) else np.nan for cell in cells]))
        else:
            arrays.append(np.array(cells if kind in ("stamp", "name") else [""], dtype=np.str_))
    return arrays
