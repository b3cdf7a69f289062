"""Rows of a table: which of them are taken, and that every cell of these holds a number."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modalscope.io.columns.axis import sampling_of
from modalscope.io.columns.table import Column, Table, as_word
from modalscope.model import DataError
from modalscope.model.checks import BoolArray, RealArray

__all__ = ["check_numbers", "longest_even", "longest_stretch", "with_rows"]

#: Steps that differ from the usual one by less than this part of it may belong to one stretch, and the part of a table that is worth it.
_STEP, _WORTH = 0.5, 0.25

_RANGE = re.compile(r"\s*(\d*)\s*-\s*(\d*)\s*\Z")


def with_rows(table: Table, asked: object) -> Table:
    """Return a table of the rows that are asked, `1101-4000`, counted from 1; either end may be left open.

    Parameters
    ----------
    table : Table
    asked : str, optional

    Raises
    ------
    DataError
        No range, or rows that are not there.

    Examples
    --------
    >>> whole = Table(where="x.csv", columns=(Column(number=1, values=np.arange(5.0)),))
    >>> with_rows(whole, "2-4").columns[0].values
    array([1., 2., 3.])
    """
    if asked is None:
        return table
    found = _RANGE.match(str(asked)[:40])
    first, last = (int(found[1] or 1), int(found[2] or table.rows)) if found else (0, 0)
    if not 1 <= first < last <= table.rows:
        raise DataError(
            f"rows {str(asked)[:40]!r} of {table.where} were asked",
            f"it has the rows 1 to {table.rows}" if found else "that is no range of rows",
            f"Write the first and the last: --rows 1-{table.rows}",
        )
    columns = tuple(replace(column, values=column.values[first - 1 : last]) for column in table.columns)
    return replace(
        table,
        columns=columns,
        first_row=first,
        notes=(*table.notes, f"rows {first} to {last} of {table.rows} were taken"),
    )


def check_numbers(table: Table, columns: Sequence[Column]) -> None:
    """Raise where cells are empty or not finite; name the rows, and the ways out.

    Parameters
    ----------
    table : Table
    columns : sequence of Column
        Those that are taken.

    Raises
    ------
    DataError
        Cells without a finite number.
    """
    holes = [~np.isfinite(column.values) for column in columns]
    column, bad = next(((c, hole) for c, hole in zip(columns, holes, strict=True) if hole.any()), (None, None))
    if column is None or bad is None:
        return
    above = table.first_row - 1
    first, last = longest_stretch(~np.any(holes, axis=0))
    ways = {"leave the column out": f"--ignore {as_word(column.label)}"} if len(columns) > 1 else {}
    ways |= {"take the longest stretch of whole rows": f"--rows {above + first}-{above + last}"} if last > first else {}
    raise DataError(
        f"reading {table.where} needs a finite number in every row",
        f"{int(bad.sum())} of {bad.size} in {column} are empty or no numbers, the first in row {above + int(np.argmax(bad)) + 1}",
        " or ".join(["Fill these rows", *ways]) + (f": {', or '.join(ways.values())}" if ways else "."),
    )


def longest_even(times: RealArray) -> tuple[int, int] | None:
    """Return the first and the last of the longest run of rows with even times, counted from 1, where it holds a quarter of all.

    Examples
    --------
    >>> longest_even(np.array([0.0, 0.1, 0.2, 0.9, 1.0, 1.1, 1.2]))
    (4, 7)
    """
    if len(times) < 3:  # two rows are always even, and no stretch
        return None
    steps = np.diff(times)
    first, last = longest_stretch(np.abs(steps - np.median(steps)) < _STEP * np.median(steps))
    last += 1  # of so many steps one row more
    try:
        sampling_of(times[first - 1 : last])
    except DataError:
        return None
    return (first, last) if last - first >= _WORTH * len(times) else None


def longest_stretch(whole: BoolArray) -> tuple[int, int]:
    """Return the first and the last of the longest run of rows that are whole, counted from 1; (1, 0) where none is.

    Examples
    --------
    >>> longest_stretch(np.array([True, False, True, True, False]))
    (3, 4)
    """
    edges = np.flatnonzero(np.diff(np.r_[0, np.asarray(whole, int), 0]))
    starts, ends = edges[::2], edges[1::2]
    if not starts.size:
        return 1, 0
    at = int(np.argmax(ends - starts))
    return int(starts[at]) + 1, int(ends[at])
