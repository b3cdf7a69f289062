"""Determine the sampling rate from a column of times, its evenness, and the rows that are taken."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import DataError
from modalscope.data.shown import figures
from modalscope.io.columns.table import Column, Table, as_word
from modalscope.io.contents import needs
from modalscope.numerics.checks import Array, BoolArray, RealArray

#: Largest distance of times from the even grid, in steps.
_MAX_OFF_GRID = 0.02
#: Relative difference up to which rates are equal: headers are rounded.
_SAME_RATE = 1e-3
#: Steps longer than this times the usual one lack samples; of a clock as coarse as the steps only if they are fewer than this share.
STEPS_OF_GAP, _MAX_SHARE_OF_GAPS = 1.9, 0.01
#: Seconds since 1970 in the years 1990 and 2100: no test lasts as many milliseconds.
_EPOCH = (631152000.0, 4102444800.0)
#: Times counted from long ago lose digits: the grain is that of what follows the whole seconds.
_LARGE_TIMES = 1e7
#: Parts of a second that clocks count; the longest step between samples of a vibration in s (the slowest towers sway in 10 s); and the
#: lowest rate in Hz of recorders that count milliseconds.
_PARTS_OF_SECOND = (1e3, 1e6, 1e9)
_LONGEST_STEP, _SLOWEST_RATE = 2.0, 5.0
#: Relative accuracy of the clocks of samplers, at best.
CLOCK_ACCURACY = 1e-6
#: Ticks of a clock that is coarser than the samples, by which their rate is known.
_MIN_TICKS = 3
#: Powers of two in the rates of samplers: 625 Hz = 2^-4 10^4 Hz, 65536 Hz = 2^16 Hz.
_POWERS_OF_TWO = np.arange(-5.0, 17.0)
#: Times examined at each end for their digits, and decimals at most.
_TIMES_AT_END, _MIN_TIMES_AT_END, _MAX_DECIMALS = 5000, 16, 9
#: Relative difference of steps of one even stretch from the usual one, at most; share of the rows of a stretch that is offered, at least.
_STEP_TOLERANCE, _MIN_SHARE_OF_ROWS = 0.5, 0.25
#: Nearly even times vary so by this share of the steps at least, over so many rows.
_MIN_SHARE_OF_STEPS, _MIN_ROWS_OF_CLOCK = 0.98, 8

#: Records that follow each other in one table at most, and rows of one at least.
_MOST_RECORDS, _MIN_ROWS_OF_RECORD = 1000, 3

_RANGE = re.compile(r"\s*(\d*)\s*-\s*(\d*)\s*\Z")


@dataclass(frozen=True, slots=True)
class Sampling:
    """The rate of a column of times.

    `rate`: samples per second. `doubt`: what the digits of the times leave open of it. `off`: the largest distance of a time from the
    even grid, in steps.
    """

    rate: float
    doubt: float
    off: float


def rises(values: Array) -> bool:
    """Whether every value is larger than the one before, of real ones; differences of unsigned integers would always be.

    Examples
    --------
    >>> rises(np.array([1, 2, 4])), rises(np.array([4, 2, 1], dtype=np.uint8))
    (True, False)
    """
    return not np.iscomplexobj(values) and bool(np.all(values[1:] > values[:-1]))


def nearly_even(values: RealArray) -> bool:
    """Whether values rise by steps that hardly vary, as times of an uneven clock do.

    Examples
    --------
    >>> nearly_even(np.arange(20.0) + 0.1 * np.sin(np.arange(20.0))), nearly_even(np.arange(20.0) ** 2)
    (True, False)
    """
    if np.iscomplexobj(values) or values.size < _MIN_ROWS_OF_CLOCK:
        return False
    steps = np.diff(values.astype(float))
    usual = np.median(steps)
    if usual <= 0 or steps.min() < 0:  # a time may be written twice
        return False
    return bool(np.mean(np.abs(steps - usual) < _STEP_TOLERANCE * usual) >= _MIN_SHARE_OF_STEPS)


def grain_of(times: RealArray) -> float:
    """Return the power of ten that all times are multiples of: what their digits leave open; 0 where there is none.

    Printed times may lose digits as they grow, so that both ends are asked, and every decade: 9.98E-01 has fewer than 2.50E-04.

    Examples
    --------
    >>> grain_of(np.array([0.0, 0.01, 0.019, 0.029])), grain_of(np.array([0.0, 1 / 3, 2 / 3]))
    (0.001, 0.0)
    """
    base = np.floor(times[:1]) if times.size and abs(times[0]) > _LARGE_TIMES else 0.0
    spacing = float(np.spacing(np.abs(times).max(initial=0.0)))
    times = times - base

    def of(part: RealArray) -> float:
        for digits in range(_MAX_DECIMALS + 1):
            scaled = part * 10.0**digits
            rounding = 2 * spacing * 10.0**digits
            if np.all(np.abs(scaled - np.rint(scaled)) <= 1e-6 + 1e-12 * np.abs(scaled) + rounding):
                return float(10.0**-digits)
        return 0.0

    at_end = max(_MIN_TIMES_AT_END, min(_TIMES_AT_END, times.size // 8))
    decades = np.split(times, np.searchsorted(times, 10.0 ** np.arange(-_MAX_DECIMALS, _MAX_DECIMALS)))
    parts = [times[-at_end:], *(part[:at_end] for part in decades if part.size >= _MIN_TIMES_AT_END)]
    return max(map(of, (times[:at_end], *parts)))


def in_epoch(times: Array) -> bool:
    """Whether numbers are seconds since 1970, or parts of these, of the years 1990 to 2100.

    Examples
    --------
    >>> in_epoch(np.array([1.7e9, 1.7e9 + 1])), in_epoch(np.array([0.0, 1.0]))
    (True, False)
    """
    return _parts_since_1970(times) > 0


def _parts_since_1970(times: Array) -> float:
    """Return in which parts of a second numbers count from 1970: 1, 1e3, 1e6 or 1e9; 0 of others."""
    low, high = _EPOCH
    ends = times[[0, -1]].astype(float) if times.size else np.zeros(2)
    return next((p for p in (1.0, *_PARTS_OF_SECOND) if np.all((low * p < ends) & (ends < high * p))), 0.0)


def parts_of_second(times: RealArray, rate: float | None = None) -> float:
    """Return by what times without a unit are finer than seconds: 1, 1e3, 1e6 or 1e9.

    `times` (N,). `rate`: samples per second, where a header or an option says it.

    Times that count from 1970 say it by their size, others by the rate where one is known. Otherwise steps of up to 2 are seconds: nobody
    measures vibrations more slowly. Longer ones are in the coarsest part of a second in which there are 5 samples a second and more.

    Examples
    --------
    >>> parts_of_second(np.array([1.7e12, 1.7e12 + 5])), parts_of_second(np.array([0.0, 1.0]))
    (1000.0, 1.0)
    >>> parts_of_second(np.array([0.0, 10.0])), parts_of_second(np.array([0.0, 10.0]), rate=1e5)
    (1000.0, 1000000.0)
    """
    since = _parts_since_1970(times)
    if since > 1 or times.size < 2:
        return max(since, 1.0)
    with np.errstate(all="ignore"):
        step = float(np.median(np.diff(times)))
    if not 0 < step < np.inf:
        return 1.0
    if rate is not None:
        return next((parts for parts in (1.0, *_PARTS_OF_SECOND) if same_rate(rate, parts / step)), 1.0)
    if step <= _LONGEST_STEP:
        return 1.0
    return next((parts for parts in _PARTS_OF_SECOND if parts / step >= _SLOWEST_RATE), 1.0)


def sampling_of(times: RealArray) -> Sampling:
    """Return the rate 1/T of times t(k) = t(0) + k T, T = (t(N-1) - t(0)) / (N-1); of a coarse clock N counts from its first tick on.

    `times` (N,): seconds.

    Raises `DataError`: times that are fewer than two, do not increase, leave the grid by more than their digits and 2 % of a step
    explain, or skip samples; `found` says by how much.

    Examples
    --------
    >>> sampling_of(np.array([0.0, 0.001, 0.002, 0.003, 0.004])).rate
    1000.0
    """
    steps = np.diff(times)
    if not steps.size:
        raise _uneven("there is one sample")
    if not np.isfinite(times).all():
        raise _uneven(f"{int((~np.isfinite(times)).sum())} of its {times.size} times are missing or infinite")
    grain, step = grain_of(times), float(times[-1] - times[0]) / steps.size
    back, widest = int(np.argmin(steps)), int(np.argmax(steps))
    if step <= 0 or steps[back] < -1.01 * grain:
        raise _uneven(f"they do not increase: {times[back]:g} s is followed by {times[back + 1]:g} s in row {back + 2}")
    distance = np.abs(times - times[0] - step * np.arange(times.size))
    ulp = float(np.spacing(np.float32(np.abs(times).max()))) if _is_single(times) and not grain else 0.0
    ulp = max(ulp, float(np.spacing(np.abs(times).max())))
    off = float(distance.max())
    if off > max(_MAX_OFF_GRID * step, 1.01 * grain, 2 * ulp) or _has_gaps(steps, grain):
        raise _uneven(
            f"time steps vary from {steps[back]:.6g} to {steps[widest]:.6g} s (typically {np.median(steps):.6g} s), the longest at row "
            f"{widest + 2}, and times leave the even grid by up to {figures(off / step)} steps"
        )
    # whoever writes 0.00, 0.01, 0.02 ... means what stands there
    same = steps[widest] - steps[back] <= 1e-6 * step + 4 * float(np.spacing(np.abs(times).max()))
    doubt = 0.0 if same else (grain + 2 * ulp) / (step * steps.size) / step
    rate, ticks = 1 / step, np.flatnonzero(steps > 0)
    if ticks.size > _MIN_TICKS:
        # a clock that stands still between its ticks: samples from one to the last
        # at a tick the time lies between what is printed before and after: the last digit may be worth more at the end
        seconds = float(times[ticks[-1] : ticks[-1] + 2].mean() - times[ticks[0] : ticks[0] + 2].mean())
        if seconds <= 0:
            raise _uneven("they fall as often as they rise")
        rate, doubt = (float(ticks[-1] - ticks[0]) / seconds, 1 / seconds) if 1 / seconds < doubt else (rate, doubt)
    return Sampling(roundest(rate, doubt + CLOCK_ACCURACY * rate), doubt, off / step)


def even_sampling(times: RealArray) -> Sampling | None:
    """Return the sampling of times; None where they are not even."""
    try:
        return sampling_of(times)
    except DataError:
        return None


def _has_gaps(steps: RealArray, grain: float) -> bool:
    """Whether some steps are so long that samples are missing in them."""
    usual = float(np.median(steps))
    long = steps > STEPS_OF_GAP * usual
    return bool(usual > 0 and long.any() and (grain < 0.4 * usual or long.mean() < _MAX_SHARE_OF_GAPS))


def _is_single(times: RealArray) -> bool:
    """Whether numbers had single precision before they had double."""
    with np.errstate(over="ignore"):
        return bool(np.array_equal(times.astype(np.float32).astype(float), times))


def _uneven(fault: str) -> DataError:
    return DataError("times must rise in even steps", fault, "Correct the times, or resample the record evenly.")


def roundest(value: float, doubt: float) -> float:
    """Return the rate that samplers have, else the number of fewest digits, that is as near to a value as the doubt allows.

    These rates are 2^a 10^b, or three times such a number, or such a number of samples in three units of time.

    Examples
    --------
    >>> roundest(1023.99987, 0.01), roundest(33.3333, 1e-9), roundest(3996.0, 8.0), roundest(1655.2, 8.0)
    (1024.0, 33.3333, 4000.0, 1655.0)
    """
    if not np.isfinite(value):
        return value
    for times in (1.0, 3.0, 1 / 3):
        powers = times * 2.0**_POWERS_OF_TWO
        usual = powers * 10.0 ** np.rint(np.log10(value / powers))
        nearest = float(usual[np.argmin(np.abs(usual - value))])
        if abs(nearest - value) <= doubt:
            return float(f"{nearest:.16g}")
    for digits in range(7):
        if (candidate := round(value, digits)) > 0 and abs(candidate - value) <= doubt:
            return float(candidate)
    return value


def same_rate(one: float, other: float, doubt: float = 0.0) -> bool:
    """Whether two rates are one within 0.1 % and the doubt.

    Examples
    --------
    >>> same_rate(1000.0, 1000.5), same_rate(1000.0, 1024.0)
    (True, False)
    """
    return abs(one - other) <= max(_SAME_RATE * max(one, other), doubt)


def with_rows(table: Table, asked: object) -> Table:
    """Return a table of the rows that are asked, `1101-4000`, counted from 1; either end may be left open.

    Raises `DataError`: no range, or rows that are not there.

    Examples
    --------
    >>> whole = Table(where="x.csv", columns=(Column(number=1, values=np.arange(5.0)),))
    >>> with_rows(whole, "2-4").columns[0].values
    array([1., 2., 3.])
    """
    if asked is None:
        return table
    match = _RANGE.match(str(asked)[:40])
    first, last = (int(match[1] or 1), int(match[2] or table.rows)) if match else (0, 0)
    if not 1 <= first < last <= table.rows:
        fault = f"it has the rows 1 to {table.rows}" if match else "that is no range of rows"
        remedy = f"Give the first and the last row: --rows 1-{table.rows}"
        raise DataError(f"rows {str(asked)[:40]!r} of {table.where}:", fault, remedy)
    columns = tuple(replace(column, values=column.values[first - 1 : last]) for column in table.columns)
    note = f"rows {first} to {last} of {table.rows} were taken"
    return replace(table, columns=columns, first_row=first, notes=(*table.notes, note))


def check_numbers(table: Table, columns: Sequence[Column]) -> None:
    """Raise where cells are empty or not finite; name the rows, and the ways out.

    `columns`: those that are taken.

    Raises `DataError`: cells without a finite number.
    """
    text = next((column for column in columns if column.textual), None)
    if text is not None:
        raise needs(
            table.where, "numbers of measured channels", f"{text} holds text", "Leave that column out of --columns."
        )
    holes = [~np.isfinite(column.values) for column in columns]
    column, bad = next(((c, hole) for c, hole in zip(columns, holes, strict=True) if hole.any()), (None, None))
    if column is None or bad is None:
        return
    above = table.first_row - 1
    first, last = longest_stretch(~np.any(holes, axis=0))
    ways = {"leave the column out": f"--ignore {as_word(column.label)}"} if len(columns) > 1 else {}
    ways |= {"take the longest stretch of whole rows": f"--rows {above + first}-{above + last}"} if last > first else {}
    where = f"the first in row {above + int(np.argmax(bad)) + 1}"
    fault = f"{int(bad.sum())} of {bad.size} in {column} are empty or no numbers, {where}"
    remedy = " or ".join(["Fill these rows", *ways]) + (f": {', or '.join(ways.values())}" if ways else ".")
    raise needs(table.where, "a finite number in every row", fault, remedy)


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
    first, last = longest_stretch(np.abs(steps - np.median(steps)) < _STEP_TOLERANCE * np.median(steps))
    last += 1  # of so many steps one row more
    long = last - first >= _MIN_SHARE_OF_ROWS * len(times)
    return (first, last) if long and even_sampling(times[first - 1 : last]) else None


def records_of(times: RealArray) -> list[tuple[int, int]]:
    """Return the first and the last row, from 1, of each record of several whose even times begin anew; none where they do not.

    Examples
    --------
    >>> records_of(np.array([0.0, 0.1, 0.2, 0.0, 0.1, 0.2])), records_of(np.array([0.0, 0.1, 0.2, 0.5]))
    ([(1, 3), (4, 6)], [])
    """
    ends = [*(np.flatnonzero(np.diff(times) < 0) + 1).tolist(), len(times)]
    parts = list(zip([0, *ends[:-1]], ends, strict=True))
    if not 1 < len(parts) <= _MOST_RECORDS or min(end - start for start, end in parts) < _MIN_ROWS_OF_RECORD:
        return []
    found = [even_sampling(times[start:end]) for start, end in parts]
    alike = found[0] is not None and all(each and same_rate(each.rate, found[0].rate) for each in found)
    return [(start + 1, end) for start, end in parts] if alike else []


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
