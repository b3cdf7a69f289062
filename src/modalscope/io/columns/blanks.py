"""Choose rows and channels where some channels are blank: so that the fewest numbers are lost, which is said in per cent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modalscope.data.shown import list_some, percent
from modalscope.io.columns.lines import part_of
from modalscope.io.columns.table import Column, Table, as_word
from modalscope.numerics.checks import Array, IntArray

#: First and last rows that are tried, at most.
_MAX_ENDS = 64
#: Part of the rows between its first and its last number in which a channel of another, slower clock is blank, at least.
_MIN_BLANK = 0.5
#: Columns that a remedy names, at most.
_MAX_NAMED = 6


def with_least_lost(
    table: Table, axis: Column | None, columns: Sequence[Column], option: str, *, named: bool
) -> tuple[Table, dict[int, str]]:
    """Return a table cut to rows in which channels are not blank, with notes, and why channels are left, by their numbers.

    Channels that begin late or end early are taken over the rows that all have, or left: whichever keeps more numbers, rows times
    channels. Single blanks between numbers are for the user to settle.

    `columns`: the channels. `option`: what `--columns` says of them. `named`: whether it does: then all are taken.
    """
    numeric = [column for column in columns if not column.textual]
    filled = np.array([~np.isnan(column.values) for column in numeric])
    if filled.all():
        return table, {}
    present = np.ones(table.rows, bool) if axis is None or axis.textual else ~np.isnan(axis.values)
    begins, ends = np.array([_span_of(row) for row in (*filled, present)]).T
    inside = np.array([row[a:b].mean() if b > a else 0.0 for row, a, b in zip(filled, begins, ends, strict=False)])
    eligible = np.full(len(numeric), named) | (inside > 1 - _MIN_BLANK)
    start, stop = _longest(begins, ends, eligible, named)
    taken = eligible & (begins[:-1] <= start) & (stop <= ends[:-1])
    if stop <= start or not taken.any() or (taken.all() and (start, stop) == (0, table.rows)):
        return table, {}
    left = {c.number: _share(row[start:stop]) for c, row, take in zip(numeric, filled, taken, strict=True) if not take}
    notes = [*_of_rows(table, numeric, filled, taken, start, stop), *_of_channels(table, numeric, left, option)]
    cut = tuple(c if c.textual else replace(c, values=c.values[start:stop]) for c in table.columns)
    lines = table.lines and (table.lines[0] + start * table.lines[1], table.lines[1])
    whole = replace(table, columns=cut, lines=lines, notes=(*table.notes, *notes), first_row=table.first_row + start)
    return whole, left


def _span_of(filled: Array) -> tuple[int, int]:
    """Return the first row with a number, and the one behind the last."""
    rows = np.flatnonzero(filled)
    return (int(rows[0]), int(rows[-1]) + 1) if rows.size else (0, 0)


def _longest(begins: IntArray, ends: IntArray, eligible: Array, named: bool) -> tuple[int, int]:
    """Return the rows with most numbers in channels that have all of them; `named`: in all channels. The last one is the axis."""
    if named:
        return int(begins.max()), int(ends.min())
    firsts = _few(np.unique(np.maximum(begins[:-1][eligible], begins[-1])))
    lasts = _few(np.unique(np.minimum(ends[:-1][eligible], ends[-1])))
    if not firsts.size:
        return 0, 0
    whole = (begins[:-1][eligible, None, None] <= firsts[:, None]) & (ends[:-1][eligible, None, None] >= lasts)
    numbers = whole.sum(axis=0) * np.maximum(lasts - firsts[:, None], 0)
    first, last = np.unravel_index(int(np.argmax(numbers)), numbers.shape)
    return int(firsts[first]), int(lasts[last])


def _few(rows: IntArray) -> IntArray:
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _MAX_ENDS)).astype(int))] if rows.size else rows


def _share(filled: Array) -> str:
    return f"{int(filled.sum())} of {filled.size} rows have numbers in it"


def _of_rows(table: Table, columns: Sequence[Column], filled: Array, taken: Array, start: int, stop: int) -> list[str]:
    """Return what is said of rows that are not taken: which, how much that is, and what would take them."""
    rows = filled.shape[1]
    lost = rows - (stop - start)
    if not lost:
        return []
    short = [c for c, row, take in zip(columns, filled, taken, strict=True) if take and not row.all()]
    above = table.first_row - 1
    which = f"rows {above + start + 1} to {above + stop} of {above + rows} are taken, {percent(lost / rows)} are lost"
    parts = {c.number: part_of(c.name) for c in columns}
    bases = {part[0] for c in short if (part := parts[c.number])}
    whole = [c for c in columns if c in short or ((part := parts[c.number]) and part[0] in bases)]  # both parts
    if not short or len(whole) >= taken.sum():
        return [f"{which}: the others are blank"]
    words = " ".join(f"--ignore {as_word(column.label)}" for column in whole)
    way = f" (all rows without: {words})" if len(whole) <= _MAX_NAMED else ""
    return [f"{which}: {_listed(short)} blank in the others{way}"]


def _of_channels(table: Table, columns: Sequence[Column], left: dict[int, str], option: str) -> list[str]:
    """Return what is said of channels that are not taken: how many rows they have, and how to take them all the same."""
    notes = []
    for column in columns:
        if column.number in left:
            have = int(np.count_nonzero(~np.isnan(column.values)))
            lost = percent((table.rows - have) / table.rows)
            way = f' (to take it: --columns "{option}")' if have else ""
            said = f"{column} ignored: with it {lost} of the rows would be lost, {have} of {table.rows} have it"
            notes.append(said + way)
    return notes


def _listed(columns: Sequence[Column]) -> str:
    return f"{list_some(columns)} {'is' if len(columns) == 1 else 'are'}"
