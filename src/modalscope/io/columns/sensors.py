"""Make channels of rows that sensors write in turn, or one below the other, each row with the name of its sensor in a column of text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modalscope.data.shown import percent
from modalscope.io.columns.axis import grain_of, roundest
from modalscope.io.columns.clock import clock_of, longest_without_gap, resampled
from modalscope.io.columns.records import seconds_of
from modalscope.io.columns.table import Column, Table
from modalscope.io.columns.vocabulary import RUNS, SENSORS, words_of
from modalscope.io.columns.weights import goes_one_way, role_by_words
from modalscope.numerics.checks import Array, IntArray, RealArray

#: Sensors at most, rows of each at least, and by how much numbers of rows may differ, relative.
_MOST_SENSORS, _MIN_ROWS, _MAX_DIFFERENCE = 200, 16, 0.1
#: Distance of times from a straight line, in grains of their digits, that are even but for these; share of the rows taken, at least.
_GRAINS, _MIN_SHARE = 1.5, 0.5


def by_sensor(table: Table) -> Table:
    """Return a table of a column a sensor and quantity where a column of text names the sensor of each row; any other as it stands."""
    names = [c for c in table.columns if _names_sensors(c) and len(c.values) == table.rows > 0]
    rows = [] if len(names) != 1 else _rows_of(names[0].values)
    numbers = [c for c in table.columns if not c.textual and c not in names]
    if not 2 <= len(rows) <= _MOST_SENSORS or any(np.iscomplexobj(c.values) for c in numbers):
        return table
    counts = [len(each) for _, each in rows]
    if min(counts) < _MIN_ROWS or max(counts) - min(counts) > max(2, _MAX_DIFFERENCE * max(counts)):
        return table
    axis = _clock(numbers, rows)
    measured = [c for c in numbers if c is not axis]
    if not measured:
        return table
    parts = [np.stack([c.values[each] for c in measured], axis=1).astype(float) for _, each in rows]
    if any(not np.isfinite(part).all() for part in parts):
        return table
    count, notes = min(counts), [f"column {names[0].number} names the sensor of each row: {len(rows)} sensors"]
    first = Column(number=1, name="time", unit="s", values=np.zeros(0))
    if axis is not None:
        made = _on_one_clock([seconds_of(axis)[each] for _, each in rows], parts)
        if made is None:
            return table
        times, parts, said = made
        first, count, notes = replace(first, values=times), len(times), [*notes, said]
    columns = [first] if axis is not None else []
    for (name, _), part in zip(rows, parts, strict=True):
        for k, column in enumerate(measured):
            label = name if len(measured) == 1 else f"{name} {column.name or k + 1}"
            columns.append(Column(number=len(columns) + 1, name=label, unit=column.unit, values=part[:count, k]))
    roles = {1: "time"} if axis is not None else {}  # columns that the user cannot name by number
    return replace(table, columns=tuple(columns), notes=(*table.notes, *notes), roles=roles)


def _names_sensors(column: Column) -> bool:
    """Whether a column names sensors: text that names no runs, or few whole numbers under a word for a sensor."""
    if RUNS.search(column.name):
        return False
    if column.textual:
        return not RUNS.search(str(column.values[0]))
    whole = bool(SENSORS & set(words_of(column.name))) and not np.iscomplexobj(column.values)
    return whole and bool(np.isfinite(column.values).all()) and 1 < np.unique(column.values).size <= _MOST_SENSORS


def _rows_of(names: Array) -> list[tuple[str, IntArray]]:
    """Return the sensors in the order of their first rows, each with its rows."""
    found, codes = np.unique(names, return_inverse=True)
    if found.size > _MOST_SENSORS:
        return []
    places = [np.flatnonzero(codes == k) for k in range(found.size)]
    called = [f"{each:g}" if found.dtype.kind in "biuf" else str(each).strip(" :;,.") for each in found]
    return [(called[k], places[k]) for k in sorted(range(found.size), key=lambda k: int(places[k][0]))]


def _clock(numbers: Sequence[Column], rows: Sequence[tuple[str, IntArray]]) -> Column | None:
    """Return the column of times: one that rises in every sensor's rows, by its name or, without one, the first such."""

    def rises(times: Array) -> bool:
        return goes_one_way(times) and bool(times[-1] > times[0])

    rising = [c for c in numbers if all(rises(c.values[each]) for _, each in rows)]
    return next((c for c in rising if role_by_words(c.name, c.unit) == "time"), next(iter(rising), None))


def _on_one_clock(
    times: Sequence[RealArray], parts: Sequence[RealArray]
) -> tuple[RealArray, list[RealArray], str] | None:
    """Return even times, the values of every sensor at these, and what was done; None where clocks have nothing long in common."""
    from scipy.interpolate import CubicSpline

    if all(len(t) == len(times[0]) and np.array_equal(t, times[0]) for t in times):
        return times[0], list(parts), "they share their times"
    if any(np.any(np.diff(t) <= 0) for t in times):
        return None
    cut = [slice(first - 1, last) for first, last in (longest_without_gap(clock_of(t), t.size) for t in times)]
    even = [_without_grain(t[c]) for t, c in zip(times, cut, strict=True)]
    begin, end = max(t[0] for t in even), min(t[-1] for t in even)
    shortest = min(float(np.ptp(t)) for t in times)
    if end - begin < _MIN_SHARE * shortest:
        return None
    step = float(np.median([np.mean(np.diff(t)) for t in even]))
    rate = roundest(1 / step, 1e-3 / step)
    grid = begin + np.arange(int((end - begin) * rate) + 1) / rate
    held = [part[c] for c, part in zip(cut, parts, strict=True)]
    lost = max(resampled(t, part, rate)[1] for t, part in zip(even, held, strict=True))
    share = "not known" if np.isnan(lost) else f"{percent(lost, 2)} of the motion"
    gaps = any(c.stop - c.start < len(t) for t, c in zip(times, cut, strict=True))
    whole = f", the longest stretch without a gap ({end - begin:.4g} of {shortest:.4g} s)" if gaps else ""
    said = f"their clocks are put on one, {rate:.6g} Hz, by cubic splines{whole}; what is lost is {share}"
    return grid - begin, [np.asarray(CubicSpline(t, part)(grid)) for t, part in zip(even, held, strict=True)], said


def _without_grain(times: RealArray) -> RealArray:
    """Return times without the rounding of their digits, where they lie on a straight line but for it."""
    k = np.arange(times.size)
    line = np.polynomial.Polynomial.fit(k, times, 1)(k)
    off = float(np.sqrt(np.mean((times - line) ** 2)))
    return np.asarray(line) if off <= _GRAINS * grain_of(times) else times
