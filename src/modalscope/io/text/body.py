"""Parse the rows of a text table to arrays, in pieces."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import islice

import numpy as np

from modalscope.data import DataError
from modalscope.data.shown import counted
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
from modalscope.io.text.dialect import is_wide
from modalscope.numerics.checks import Array

#: Lines parsed at a time, and lines that are no rows at most, under a table and in it.
_LINES_OF_PIECE, _MAX_LINES_OF_FOOT = 20_000, 20
#: Characters of a cell in a message.
CHARACTERS_SHOWN = 20
#: Signs, or blanks, with which a comment may begin.
_FIRST_OF_COMMENT = frozenset("#%/! \t")
#: Kind of a column -> whether a cell is of that kind, in the order in which they are tried.
_KINDS = {"stamp": is_stamp, "complex": is_complex, "number": is_number}


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
        most = (kind for kind, is_one in _KINDS.items() if 2 * sum(map(is_one, present)) >= len(present))
        kinds.append(next(most, "text") if present else "empty")
    return kinds


def read_body(
    where: str,
    lines: Iterable[tuple[int, str]],
    kinds: Sequence[str],
    dialect: Dialect,
    width: int,
    space: Room,
    head: Sequence[str] = (),
    *,
    whole: bool = False,
) -> tuple[list[Array], list[str]]:
    """Return the columns of a body, and notes on lines that are no rows of it.

    Remarks, the header again, a last line that is cut short and lines under the table are ignored and counted.

    `lines`: the body, each line with its number. `kinds`: of the columns. `width`: cells in a row. `head`: the lines above it.
    `whole`: whether every line is to be a row, so that nothing is read behind the first that is none.

    Raises `DataError`: a row of another length, or a cell that holds something else than its column.
    """
    pieces: list[list[Array]] = []
    odd: list[tuple[int, str]] = []
    again = {line.strip() for line in head if line.strip()}
    source = ((number, line) for number, line in lines if line[0] not in _FIRST_OF_COMMENT or not uncommented(line)[1])
    last = 0
    while piece := list(islice(source, _LINES_OF_PIECE)):
        space.take("its numbers", 8 * len(piece) * width)
        arrays = _fast(piece, kinds, dialect, width)
        if arrays is None:
            good = _rows_of(where, piece, odd, kinds, dialect, width, again)
            space.take("its cells", sum(len(cell) for row in good[:1] for cell in row[1]) * len(good))
            arrays = columns_of([cells for _, cells in good], kinds, dialect) if good else _none(kinds)
            last = good[-1][0] if good else last
        else:
            last = piece[-1][0]
        pieces.append(arrays)
        if whole and odd:
            break
    _check_last(where, odd, last, width, dialect)
    return [np.concatenate(column) for column in zip(*pieces, strict=True)], _notes(odd, last)


def _rows_of(
    where: str,
    piece: list[tuple[int, str]],
    odd: list[tuple[int, str]],
    kinds: Sequence[str],
    dialect: Dialect,
    width: int,
    again: Collection[str],
) -> list[tuple[int, list[str]]]:
    """Return the rows among lines with their numbers; the lines that are none are added to `odd`.

    `again`: the lines of the header.

    Raises `DataError`: a line that looks like a row and is none, or too many that do not.
    """
    good: list[tuple[int, list[str]]] = []
    for number, line in piece:
        if line.strip() in again:
            odd.append((number, line))
            continue
        cells = split(line, dialect)
        cells = cells[:width] if is_wide(cells, width) else cells
        if len(cells) < width and set(kinds[len(cells) :]) <= {"text", "empty"}:
            cells = [*cells, *[""] * (width - len(cells))]
        if len(cells) == width and _fits(cells, kinds, dialect):
            good.append((number, cells))
            continue
        numbers = sum(is_value(cell) and not is_missing(cell) for cell in cells)
        if 2 * numbers > len(cells) and (len(cells) >= width or (odd and _is_cut(odd[-1][1], width, dialect))):
            raise _no_row(where, odd[-1] if odd and len(cells) < width else (number, line), kinds, dialect, width)
        if odd and _is_cut(odd[-1][1], width, dialect):  # of a whole file only the last line can be cut short
            raise _no_row(where, odd[-1], kinds, dialect, width)
        odd.append((number, line))
        if len(odd) > _MAX_LINES_OF_FOOT:
            raise _no_row(where, odd[0], kinds, dialect, width)
    return good


def _is_cut(line: str, width: int, dialect: Dialect) -> bool:
    """Whether a line is a row that ends early: fewer cells, and most of them numbers."""
    cells = split(line, dialect)
    return len(cells) < width and 2 * sum(is_value(cell) and not is_missing(cell) for cell in cells) > len(cells)


def _check_last(where: str, odd: Sequence[tuple[int, str]], last: int, width: int, dialect: Dialect) -> None:
    """Raise where a row that ends early is followed by others."""
    cut = next(((number, line) for number, line in odd if number < last and _is_cut(line, width, dialect)), None)
    if cut is not None:
        raise _no_row(where, cut, ["number"] * width, dialect, width)


def _notes(odd: Sequence[tuple[int, str]], last: int) -> list[str]:
    """Return what was ignored, inside of the table and under it."""
    notes = []
    among, under = ([x for x in odd if x[0] < last], [x for x in odd if x[0] > last])
    for words, lines in (("among the rows", among), ("under the table", under)):
        if lines:
            shown = lines[0][1].strip()[:CHARACTERS_SHOWN]
            notes.append(f"{counted(len(lines), 'line')} {words} ignored ({shown!r} ...)")
    return notes


def _none(kinds: Sequence[str]) -> list[Array]:
    return [np.zeros(0, "U1" if kind in ("text", "stamp", "name") else float) for kind in kinds]


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


def _no_row(where: str, line: tuple[int, str], kinds: Sequence[str], dialect: Dialect, width: int) -> DataError:
    """Return the error of a line that should be a row: another number of cells, or a cell that is no number."""
    number, cells = line[0], split(line[1], dialect)
    pairs = enumerate(zip(cells, kinds, strict=False))
    odd = [k for k, (cell, kind) in pairs if not _fits([cell], [kind], dialect)]
    if len(cells) != width or not odd:
        fault = f"line {number} has {len(cells)}: {[cell[:CHARACTERS_SHOWN] for cell in cells[:6]]}"
        remedy = (
            f"Correct that line, or take it out; if the table begins below it, leave what is above out: --skip {number}"
        )
        return needs(where, f"{width} cells in every row", fault, remedy)
    fault = f"line {number} holds {cells[odd[0]][:CHARACTERS_SHOWN]!r} there"
    these = "that cell, or leave the column" if len(odd) == 1 else "such cells, or leave these columns"
    remedy = f"Correct {these} out: {' '.join(f'--ignore {k + 1}' for k in odd)}"
    return needs(where, f"a number in every cell of column {odd[0] + 1}", fault, remedy)
