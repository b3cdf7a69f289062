"""Resample records whose times are not even: jitter, drift and gaps of a clock, told apart, and what interpolation loses.

Times are t_k = t_0 + k T + drift + jitter; a step longer than twice the usual one is a gap, in which samples are missing. Between gaps
values are interpolated by cubic splines on an even grid. Their error falls with the fourth power of the step (de Boor, A Practical Guide
to Splines, 1978, ch. 5): what splines through every other sample miss at those between, divided by sixteen, is what is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.data import DataError
from modalscope.data.shown import counted, figures, percent
from modalscope.io.columns.axis import STEPS_OF_GAP, even_sampling, longest_stretch, rises, roundest
from modalscope.io.columns.table import Column
from modalscope.numerics.checks import RealArray, check_positive

#: Resampling without being asked: largest loss of the motion (-30 dB), and least share of the rows.
_MAX_LOSS, _MIN_SHARE_OF_ROWS = 0.03, 0.8
#: Gaps that are filled: largest loss of the motion, share of the samples that are missing, and gaps of as many samples that are tried.
_MAX_LOSS_IN_GAPS, _MAX_SHARE_MISSING, _GAPS_TRIED = 5e-3, 5e-3, 20
#: Samples on either side of a gap that tell whether they go on over it, part of the error of the other reading at most, and the jitter of a
#: clock, in steps, that is even but for gaps.
_AT_GAP, _CLEARLY_LESS, _STEADY = 12, 0.8, 0.02
#: What samples miss on an even grid, relative to what they miss at their times, where the clock alone is uneven: noise scatters by less.
_SMOOTHER = 0.9
#: Share of the motion that splines through every other sample may miss for the loss of those through all to be known.
_MAX_KNOWN_LOSS = 0.5
#: By how much steps of the even grid may be longer than those of the samples, relative.
_COARSER = 1e-3
#: Rows of a record, at least.
_MIN_ROWS = 8
#: Steps of a record at least, and its duration at most, s: damaged numbers beyond have no squares.
_SHORTEST_STEP, _LONGEST = 1e-15, 1e15


@dataclass(frozen=True, slots=True)
class Clock:
    """How times differ from an even grid.

    `step`: the usual one, s. `jitter`: root mean square distance from a steady drift, in steps. `drift`: how far the rate changes from
    the first half to the second, relative. `gaps`: rows before which samples are missing, and how many.
    """

    step: float
    jitter: float
    drift: float
    gaps: tuple[tuple[int, int], ...]

    def __str__(self) -> str:
        words = [f"jitter of {figures(self.jitter, 2)} steps", f"drift of {1e6 * self.drift:.0f} ppm"]
        missing = sum(count for _, count in self.gaps)
        words += [f"{counted(len(self.gaps), 'gap')} with {missing} samples missing"] if self.gaps else []
        return ", ".join(words)


def clock_of(times: RealArray) -> Clock:
    """Return how increasing times differ from an even grid.

    Examples
    --------
    >>> clock_of(np.r_[np.arange(10.0), np.arange(15.0, 25.0)]).gaps
    ((10, 5),)
    """
    steps = np.diff(times)
    usual = float(np.median(steps))
    places = np.flatnonzero(steps > STEPS_OF_GAP * usual) + 1
    missing = [round(float(steps[place - 1]) / usual) - 1 for place in places]
    k = np.arange(times.size, dtype=float)
    for place, count in zip(places, missing, strict=True):
        k[place:] += count
    k /= max(k[-1], 1.0)
    line, _ = np.polynomial.Polynomial.fit(k, times, 2, full=True)  # no warning of gaps beside which all is a point
    off = times - line(k)
    first, second = line.deriv()(np.array([0.25, 0.75]))
    drift = float(second / first - 1)
    gaps = tuple(zip(places.tolist(), missing, strict=True))
    return Clock(usual, float(np.sqrt(np.mean(off**2))) / usual, drift, gaps)


def longest_without_gap(clock: Clock, rows: int) -> tuple[int, int]:
    """Return the first and the last row, from 1, of the longest stretch in which no samples are missing."""
    whole = np.ones(rows - 1, bool)
    whole[[place - 1 for place, _ in clock.gaps]] = False
    first, last = longest_stretch(whole)
    return first, last + 1


def _lost_in_gaps(values: RealArray, missing: Sequence[int]) -> float:
    """Return the part of the motion that splines over gaps lose: as many samples in a row, left out elsewhere, tell it.

    `values` (N, l). `missing`: samples in each gap.
    """
    from scipy.interpolate import CubicSpline

    rows, longest = len(values), max(missing)
    if sum(missing) > _MAX_SHARE_MISSING * rows or longest * _GAPS_TRIED > rows:
        return np.inf
    values = np.ldexp(values, -np.frexp(np.abs(values).max())[1])
    k, lost = np.arange(rows), 0.0
    for count in set(missing):
        begins = np.arange(count, rows - 2 * count, max(2 * _GAPS_TRIED, rows // _GAPS_TRIED))
        left = np.ones(rows, bool)
        left[(begins[:, None] + np.arange(count)).ravel()] = False
        error = CubicSpline(k[left], values[left])(k[~left]) - values[~left]
        lost += missing.count(count) * count * float(np.mean(error**2))
    return float(np.sqrt(lost / rows) / max(np.sqrt(np.mean((values - values.mean(axis=0)) ** 2)), 1e-300))


def _go_on(times: RealArray, values: RealArray, clock: Clock) -> bool:
    """Whether samples go on evenly over all gaps of their clock: there splines through every other miss clearly less on an even grid."""
    errors = np.zeros(2)
    for place, _ in clock.gaps:
        near = slice(max(0, place - _AT_GAP), place + _AT_GAP)
        grids = (np.arange(times[near].size, dtype=float), times[near])
        errors += [max(_missed(grid, values[near]), _missed(grid[1:], values[near][1:])) ** 2 for grid in grids]
    return bool(np.sqrt(errors[0]) < _CLEARLY_LESS * np.sqrt(errors[1]))


def resampled(times: RealArray, values: RealArray, rate: float) -> tuple[RealArray, float]:
    """Return values (N, l) on an even grid over the times, and the part of the motion that is lost; NaN where it is not known."""
    from scipy.interpolate import CubicSpline

    grid = times[0] + np.arange(int(np.floor((times[-1] - times[0]) * rate * (1 + 1e-9))) + 1) / rate
    size = np.frexp(np.abs(values).max())[1]  # slopes and squares of damaged numbers have no place in a float
    even = np.ldexp(CubicSpline(times, np.ldexp(values, -size))(grid), size)
    for limit, nearer in ((values.max(axis=0), np.minimum), (values.min(axis=0), np.maximum)):
        # three in a row: clipped, which is told as long as nothing overshoots
        flat = np.any((values[2:] == limit) & (values[1:-1] == limit) & (values[:-2] == limit), axis=0)
        even = np.where(flat, nearer(even, limit), even)
    missed = _missed(times, values)
    coarser = (times.size - 1) / (rate * (times[-1] - times[0]))
    return np.asarray(even), missed / 16 if missed <= _MAX_KNOWN_LOSS and coarser <= 1 + _COARSER else np.nan


def _missed(times: RealArray, values: RealArray) -> float:
    """Return the part of the motion that splines through every other sample miss at those between."""
    from scipy.interpolate import CubicSpline

    values = np.ldexp(values, -np.frexp(np.abs(values).max())[1])  # as above
    motion = np.sqrt(np.mean((values - values.mean(axis=0)) ** 2))
    if motion == 0:
        return 0.0
    between = CubicSpline(times[::2], values[::2])(times[1:-1:2])
    return float(np.sqrt(np.mean((between - values[1 : 2 * len(between) : 2]) ** 2)) / motion)


def evened(
    where: str, axis: Column, times: RealArray, channels: list[Column], asked: Any
) -> tuple[Column, list[Column], list[str]]:
    """Return the axis and the channels on even times, and notes; unchanged where times are even and nothing is asked.

    `times`: of the axis, s. `asked`: samples per second, "auto", or None, which resamples where the loss is known and small.

    Raises `DataError`: times that do not increase where resampling was asked, a rate above that of the samples.
    """
    rate_asked = None if asked in (None, "auto") else check_positive("resample", asked)
    if rate_asked is None and even_sampling(times):
        return axis, channels, []
    usable = times.size >= _MIN_ROWS and bool(np.isfinite(times).all()) and rises(times)
    usable = usable and np.diff(times).min() >= _SHORTEST_STEP and times[-1] - times[0] <= _LONGEST
    if not usable or any(np.iscomplexobj(c.values) for c in channels):
        return axis, channels, []
    clock = clock_of(times)
    if rate_asked is not None and rate_asked * clock.step > 1 + 1e-3:
        fault = f"its samples follow each other {1 / clock.step:.6g} times a second"
        remedy = "Give a lower rate: nothing stands between the samples."
        raise DataError(f"resampling {where} to {rate_asked:g} Hz:", fault, remedy)
    every = np.stack([c.values for c in channels], axis=1).astype(float)
    filled = bool(clock.gaps) and _lost_in_gaps(every, [count for _, count in clock.gaps]) <= _MAX_LOSS_IN_GAPS
    first, last = (1, times.size) if filled else longest_without_gap(clock, times.size)
    if asked is None and last - first + 1 < _MIN_SHARE_OF_ROWS * times.size:
        return axis, channels, []
    stretch, samples = times[first - 1 : last], every[first - 1 : last]
    # the usual step may be rounded; the mean one is that of the samples and of those that are missing between them
    mean = float(np.ptp(stretch)) / (stretch.size - 1 + filled * sum(count for _, count in clock.gaps))
    usual = clock.step if abs(mean - clock.step) <= _COARSER * mean else mean
    rate = rate_asked or roundest(1 / usual, 1e-4 / usual)
    steady = filled and clock.jitter <= _STEADY
    if asked is None and steady and _go_on(times, every, clock):
        steps = f"{counted(len(clock.gaps), 'step')} of the clock {'is' if len(clock.gaps) == 1 else 'are'} longer"
        said = f"{steps}, but the samples go on evenly there: taken at {rate:.6g} Hz"
        return replace(axis, values=np.arange(times.size) / rate, unit="s", stamps=False), channels, [said]
    values, lost = resampled(stretch, samples, rate)
    # the clock alone is uneven where samples on an even grid are clearly smoother
    evenly = np.arange(stretch.size, dtype=float)
    even_samples = not steady and _missed(evenly, samples) < _SMOOTHER * _missed(stretch, samples)
    if asked is None and (even_samples or not lost <= _MAX_LOSS):
        return axis, channels, []
    unknown = "not known: there is motion near half the sampling rate"
    share = unknown if np.isnan(lost) else f"{percent(lost, 2)} of the motion"
    notes = [f"times are uneven ({clock}): resampled to {rate:.6g} Hz by cubic splines; what is lost is {share}"]
    if clock.gaps and not filled:
        notes.append(f"rows {first}-{last} of {times.size} were taken, the longest stretch without a gap")
    even = replace(axis, values=np.arange(len(values)) / rate, unit="s", stamps=False)
    return even, [replace(c, values=values[:, k]) for k, c in enumerate(channels)], notes
