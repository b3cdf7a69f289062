"""Determine the encoding, lines, delimiter and decimal sign of a text table from its content.

Text is UTF-8 or UTF-16, else Windows-1252.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import compress, count
from pathlib import Path

from modalscope.io.contents import unreadable
from modalscope.io.limits import Room
from modalscope.io.text.cells import Dialect, is_complex, is_missing, is_number, is_value, split

#: The number of a line in its file, from 1, and its text.
Line = tuple[int, str]
#: Bytes by which the encoding is determined.
_BYTES_EXAMINED = 1 << 16
#: Characters of a line and blank lines of a table, at most.
_MAX_CHARACTERS_OF_LINE, _MAX_BLANK_LINES = 1 << 25, 10_000_000
#: Characters after which the time that reading took is looked at.
_CHARACTERS_AT_A_TIME = 1 << 14
_BYTE_ORDER_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
#: Delimiters in order of preference; an empty one stands for blanks.
DELIMITERS = ("\t", ";", ",", "|", "")

_WORDS_OF_DELIMITERS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", "": "blanks"}
#: Lines of digits and signs alone that are tried with every delimiter: further ones are written as these are.
_PLAIN_LINES = 100
_PLAIN = re.compile(r"[-+\d\s.,;:|/eEdDTZ]*\Z")
_ONE_SIGN = re.compile(r"[+-]?(\d*)([.,])(\d*)([eEdD][+-]?\d+)?\Z")
_GROUPS = re.compile(r"[+-]?\d{1,3}(?:([.,'’\u00a0\u202f ])\d{3})(?:\1\d{3})*(?:([.,])\d+)?\Z")
_ONE_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*\Z")


def encoding_of(path: Path) -> str:
    """Return how the bytes of a text file are to be read, by its first 64 kB.

    Raises `DataError`: it is no text.
    """
    with path.open("rb") as file:
        head = file.read(_BYTES_EXAMINED)
    for mark, encoding in _BYTE_ORDER_MARKS:
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        remedy = "Give it the suffix of what it is, or export it as text."
        raise unreadable(f"{path.name} as a text table", "it holds bytes that no text has", remedy)
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines_of(path: Path, encoding: str, skip: int, space: Room) -> Iterator[Line]:
    """Give number, from 1, and text of the lines that are not blank.

    `skip`: lines to leave at the top. `space`: what a line may take.
    """
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        number = blank = read = 0
        while line := file.readline(_MAX_CHARACTERS_OF_LINE):
            number += 1
            if line.isspace():
                blank += 1
                if blank > _MAX_BLANK_LINES:
                    space.parts("blank lines", blank, _MAX_BLANK_LINES)
                continue
            read += len(line)
            if read > _CHARACTERS_AT_A_TIME:
                space.in_time()
                read = 0
            if len(line) == _MAX_CHARACTERS_OF_LINE:
                space.take(f"line {number}", 100 * len(line))
            if number > skip:
                yield number, line


def words_of_delimiter(delimiter: str) -> str:
    """Return what parts cells, in words."""
    return _WORDS_OF_DELIMITERS.get(delimiter, repr(delimiter))


def value_rows(rows: Sequence[Sequence[str]]) -> tuple[int, list[bool]]:
    """Return the commonest number of cells among rows of values, and which rows are such of that number.

    Columns of which most cells that are filled are text may hold anything.

    Examples
    --------
    >>> value_rows([["t", "a"], ["0", "1"], ["1", "2"]])
    (2, [False, True, True])
    >>> value_rows([["t", "note"], ["0", "start"], ["1", ""], ["2", ""]])
    (2, [False, True, True, True])
    """
    return _weighed(rows)[:2]


def _weighed(rows: Sequence[Sequence[str]]) -> tuple[int, list[bool], set[int], list[list[int]]]:
    """Return what `value_rows` does, the columns of which most cells that are filled are text, and what each cell is.

    One of a value, zero where it says that there is none, minus one of text.
    """
    kinds = [[0 if is_missing(cell) else 1 if is_value(cell) else -1 for cell in row] for row in rows]
    filled = [sum(cell != "" for cell in row) for row in rows]
    widths = Counter(len(row) for row, of in zip(kinds, filled, strict=True) if 1 in row and 2 * row.count(1) >= of)
    if not widths:
        return 0, [False] * len(rows), set(), kinds
    width = max(widths, key=lambda n: (widths[n], n))
    whole = zip(*[row for row in kinds if len(row) == width and 1 in row], strict=True)
    texts = {k for k, column in enumerate(whole) if column.count(1) < column.count(-1)}
    of_values = [
        1 in kind and is_wide(row, width) and all(k in texts or each >= 0 for k, each in enumerate(kind[:width]))
        for row, kind in zip(rows, kinds, strict=True)
    ]
    return width, of_values, texts, kinds


def is_wide(row: Sequence[str], width: int) -> bool:
    """Whether a row has so many cells, or further ones of words alone, as remarks in a column without a name are."""
    return len(row) == width or (len(row) > width > 1 and not any(map(is_value, row[width:])))


def _score(rows: Sequence[Sequence[str]]) -> int:
    """Return how many cells are values in the rows of values, less those that are none: words in columns of words do not count."""
    _, of_values, texts, kinds = _weighed(rows)
    good = [row for row, of_value in zip(zip(rows, kinds, strict=True), of_values, strict=True) if of_value]
    cells = [(k, *each) for row in good for k, each in enumerate(zip(*row, strict=True)) if each[1]]
    return sum(1 if kind > 0 else -2 * (k not in texts or cell[:1] in "0123456789+-.,") for k, cell, kind in cells)


def dialect_of(where: str, lines: Sequence[str], delimiter: str | None = None, decimal: str | None = None) -> Dialect:
    """Return how the lines of a table are written.

    The delimiter is the one under which most cells are values; the decimal sign the
    one that all numbers allow.

    `lines`: the first of the file, without signs of comments. `delimiter`, `decimal`: what the user says.

    Raises `DataError`: commas that may be decimal signs as well as delimiters or thousands: the message names the option that says it.

    Examples
    --------
    >>> found = dialect_of("a.csv", ["t;a", "0,001;1,5", "0,002;-2"])
    >>> found.delimiter, found.decimal
    (';', ',')
    """
    quoted = any('"' in line for line in lines)
    stated = next((line[4:5] for line in lines[:1] if line.lower().startswith("sep=")), None)  # as Excel reads it
    delimiter = stated if delimiter is None and stated else delimiter
    best, most = Dialect(delimiter="", quoted=quoted), 0
    plain = count()
    tried = [line for line in lines if not _PLAIN.match(line) or next(plain) < _PLAIN_LINES]
    for sign in DELIMITERS if delimiter is None else (delimiter,):
        dialect = Dialect(delimiter=sign, quoted=quoted)
        score = _score([split(line, dialect) for line in tried])
        if score > (most if sign else 2 * most):  # blanks stand within stamps and beside other signs, too
            best, most = dialect, score
    if best.delimiter == "," and delimiter is None and decimal != ".":
        best = _commas(where, lines, best, decimal)
    rows = [split(line, best) for line in lines]
    good = value_rows(rows)[1]
    sign, thousands = decimal_sign(where, [cell for row in compress(rows, good) for cell in row], decimal)
    return Dialect(delimiter=best.delimiter, decimal=sign, thousands=thousands, quoted=quoted, paired=best.paired)


def _commas(where: str, lines: Sequence[str], best: Dialect, decimal: str | None) -> Dialect:
    """Return the dialect of lines that commas part, or that are one column of decimal commas, or both."""
    rows = [split(line, best) for line in lines]
    width, of_values = value_rows(rows)
    cells = [row for row, good in zip(rows, of_values, strict=True) if good]
    head = next((row for row, good in zip(reversed(rows), reversed(of_values), strict=True) if not good), None)
    whole = all(re.fullmatch(r"[+-]?\d+|\d+[eE][+-]?\d+", cell) for row in cells for cell in row)
    if best.quoted or not whole or width % 2:
        return best
    padded = any(re.match(r"0\d", cell) for row in cells for cell in row[1::2])
    named = len(head) if head is not None else 0
    if named == width and not padded:
        return best
    if named == width // 2 or (padded and decimal == ","):
        return Dialect(delimiter=",", quoted=best.quoted, paired=True) if width > 2 else Dialect(delimiter="")
    one = width == 2 and all(_ONE_COMMA.match(line) for line, good in zip(lines, of_values, strict=True) if good)
    if one and (padded or decimal == ","):
        return Dialect(delimiter="")
    if one or padded:
        fault = f"in {lines[of_values.index(True)].strip()[:60]!r} a comma may part columns or be the decimal sign"
        raise unreadable(where, fault, 'Say which: --decimal "," or --delimiter ","')
    return best


def decimal_sign(where: str, cells: Sequence[str], decimal: str | None = None) -> tuple[str, str]:
    """Return the decimal sign and what parts thousands, which all numbers allow.

    `0,5` has a decimal comma, `1.234,5` too; `1,234` may be either, and where all are such nobody can tell.

    `decimal`: what the user says.

    Raises `DataError`: nothing but numbers such as `1,234`.

    Examples
    --------
    >>> tuple(decimal_sign("a.csv", cells) for cells in (["0,5", "1,234"], ["1,234.5", "2"], ["1'234.5"]))
    ((',', ''), ('.', ','), ('.', "'"))
    """
    allowed, thousands, grouping = {".", ","}, "", ""
    for cell in cells:
        if not is_number(cell):
            if is_complex(cell):
                allowed -= {"."} if "," in cell and "." not in cell else {","} if "." in cell else set()
            continue
        single, groups = _ONE_SIGN.match(cell), _GROUPS.match(cell)
        if single and not (groups and single[1] not in ("", "0")):
            allowed &= {single[2]}
        elif single:
            grouping = single[2] if grouping in ("", single[2]) else "both"
        elif groups:
            thousands = groups[1]
            allowed -= {groups[1]} if not groups[2] else {".", ","} - {groups[2]}
    if decimal is not None:
        other = {".": ",", ",": "."}.get(decimal, "")
        return decimal, thousands or (other if grouping == other else "")
    if len(allowed) == 1:
        sign = allowed.pop()
        other = {".": ",", ",": "."}[sign]
        return sign, thousands or (other if grouping in (other, "both") else "")
    if grouping == ",":
        example = next(cell for cell in cells if "," in cell)
        fault = f"the comma in numbers such as {example[:20]!r} may be the decimal sign or part thousands"
        raise unreadable(where, fault, 'Say which: --decimal "," or --decimal "."')
    return ".", thousands
