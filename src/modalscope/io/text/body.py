"""Parse the rows of a text table to arrays, in pieces."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice

import numpy as np

from modalscope.io.contents import needs
from modalscope.io.limits import Room
from modalscope.io.text.cells import (
    Dialect,
    columns_of,
    complex_of,
    is_complex,
    is_missing,
    is_number,
    is_stamp,
    is_value,
    number_of,
    seconds_of,
    split,
    uncommented,
)
from modalscope.numerics.checks import Array

#: Lines parsed at a time, and lines under a table at most.
_LINES_OF_PIECE, _MAX_LINES_OF_FOOT = 20_000, 20
_CHARACTERS_SHOWN = 20
#: Signs, or blanks, with which a comment may begin.
_FIRST_OF_COMMENT = frozenset("#%/! \t")


def kinds_of(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return what each column holds: "number", "complex", "stamp", "text" or "empty", by its first rows.

    Where half of the cells or more are numbers it is a column of these, and the others are for the user to settle.

    Examples
    --------
    >>> kinds_of([["0,1", "1+2i", "12:00:01", "", "run 1"], ["1", "3", "12:00:02", "", ""]])
    ['number', 'complex', 'stamp', 'empty', 'text']
    """
    kinds = []
    for cells in zip(*rows, strict=True):
        present = [cell for cell in cells if not is_missing(cell)]
        if not present:
            kinds.append("empty")
        elif all(map(is_stamp, present)):
            kinds.append("stamp")
        elif not all(map(is_number, present)) and all(is_number(cell) or is_complex(cell) for cell in present):
            kinds.append("complex")
        else:
            kinds.append("number" if 2 * sum(map(is_number, present)) >= len(present) else "text")
    return kinds


def read_body(
    where: str, lines: Iterable[tuple[int, str]], kinds: Sequence[str], dialect: Dialect, width: int, space: Room
) -> tuple[list[Array], list[str]]:
    """Return the columns of a body, and a note on lines under it.

    `lines`: the body, each line with its number. `kinds`: those of the columns. `width`: cells in a row.

    Raises `DataError`: a row of another length, or a cell that holds something else than its column.
    """
    pieces: list[list[Array]] = []
    source = ((number, line) for number, line in lines if line[0] not in _FIRST_OF_COMMENT or not uncommented(line)[1])
    while piece := list(islice(source, _LINES_OF_PIECE)):
        space.take("its numbers", 8 * len(piece) * width)
        arrays = _fast(piece, kinds, dialect, width)
        if arrays is None:
            arrays, bad = _slow(piece, kinds, dialect, width, space)
            if bad is not None:
                foot = list(islice(source, _MAX_LINES_OF_FOOT + 1))
                rest = [*piece[bad:], *foot]
                _check_foot(where, rest, kinds, dialect, width)
                shown = rest[0][1].strip()[:_CHARACTERS_SHOWN]
                return _joined([*pieces, arrays]), [f"{len(rest)} lines under the table were left ({shown!r} ...)"]
        pieces.append(arrays)
    return _joined(pieces), []


def _joined(pieces: list[list[Array]]) -> list[Array]:
    return [np.concatenate(column) for column in zip(*pieces, strict=True)]


def _fast(piece: list[tuple[int, str]], kinds: Sequence[str], dialect: Dialect, width: int) -> list[Array] | None:
    """Return columns of nothing but numbers by numpy's own reader; None where something else stands there."""
    if dialect.quoted or dialect.thousands or dialect.paired or set(kinds) != {"number"}:
        return None
    texts: Iterator[str] = (line for _, line in piece)
    if dialect.decimal == ",":
        texts = (line.replace(",", ".") for line in texts)
    if not piece[0][1].strip():  # numpy warns of texts that hold nothing; filters of warnings are those of all threads
        return None
    try:
        table = np.loadtxt(texts, delimiter=dialect.delimiter or None, comments=None, ndmin=2)
    except (ValueError, OverflowError):
        return None
    return list(table.T) if table.shape == (len(piece), width) else None


def _slow(
    piece: list[tuple[int, str]], kinds: Sequence[str], dialect: Dialect, width: int, space: Room
) -> tuple[list[Array], int | None]:
    """Return columns cell by cell, and the first line that is no row of them."""
    rows: list[list[str]] = []
    bad = None
    for k, (_, line) in enumerate(piece):
        cells = split(line, dialect)
        if len(cells) != width or not _fits(cells, kinds, dialect):
            bad = k
            break
        rows.append(cells)
    if not rows:
        rows = [[""] * width][:0]
        return [np.zeros(0, "U1" if kind in ("text", "stamp") else float) for kind in kinds], bad
    space.take("its cells", sum(len(cell) for row in rows[:1] for cell in row) * len(rows))
    return columns_of(rows, kinds, dialect), bad


def _fits(cells: Sequence[str], kinds: Sequence[str], dialect: Dialect) -> bool:
    """Whether every cell is of the kind of its column, or empty where numbers may be."""
    try:
        for cell, kind in zip(cells, kinds, strict=True):
            if kind == "number":
                number_of(cell, dialect)
            elif kind == "complex":
                complex_of(cell, dialect)
            elif kind == "stamp":
                seconds_of([cell])
    except (ValueError, OverflowError):
        return False
    return True


def _check_foot(where: str, rest: list[tuple[int, str]], kinds: Sequence[str], dialect: Dialect, width: int) -> None:
    """Raise unless what follows a line that is no row is a few lines of text at the end."""
    number, line = rest[0]
    cells = split(line, dialect)
    rows = (split(text, dialect) for _, text in rest)
    values = [row for row in rows if len(row) == width and all(map(is_value, row))]
    if (
        len(rest) <= _MAX_LINES_OF_FOOT
        and not values
        and not (len(cells) == width > 1 and is_value(cells[0]) and cells[0])
    ):
        return
    pairs = enumerate(zip(cells, kinds, strict=False))
    odd = next((k for k, (cell, kind) in pairs if not _fits([cell], [kind], dialect)), None)
    if len(cells) != width or odd is None:
        fault = f"line {number} has {len(cells)}: {[cell[:_CHARACTERS_SHOWN] for cell in cells[:6]]}"
        remedy = "Correct that line; lines above the table may be left out: --skip N"
        raise needs(where, f"{width} cells in every row", fault, remedy)
    fault = f"line {number} holds {cells[odd][:_CHARACTERS_SHOWN]!r} there"
    remedy = f"Correct that cell, or leave the column out: --ignore {odd + 1}"
    raise needs(where, f"a number in every cell of column {odd + 1}", fault, remedy)
