"""Which lines of long records are enough: for judging, some of all and those of the peaks; for refining, those near the modes.

The equations of records hold line by line, so that lines that are left out cost accuracy and bring no bias.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from modalscope.model.checks import Array, IntArray, RealArray

__all__ = ["near_modes", "resonance_weights", "running_mean", "telling_lines"]

#: Lines on either side that a weight is averaged over, and the least power over the median that it follows.
_BESIDE, _QUIET = 20, 0.01

#: Neighbours on either side over which a peak and its surroundings are averaged.
_PEAK, _AROUND = 3, 2000

#: Lines that are averaged together: of long records an array of all lines is large.
_AT_A_TIME = 1 << 16


def running_mean(values: RealArray, run: IntArray, beside: int) -> RealArray:
    """Return the mean over each line and up to `beside` lines on either side within its run, (F,).

    Parameters
    ----------
    values : array, (F,)
    run : array of int, (F,)
        Increasing.
    beside : int

    Examples
    --------
    >>> running_mean(np.array([1.0, 2.0, 6.0, 5.0]), np.array([0, 0, 0, 1]), 1)
    array([1.5, 3. , 4. , 5. ])
    """
    found = np.empty_like(values)
    for first, last in pairwise(np.searchsorted(run, np.arange(run[-1] + 2 if run.size else 1, dtype=run.dtype))):
        for start in range(first, last, _AT_A_TIME):
            own = np.arange(start, min(start + _AT_A_TIME, last))
            low, high = np.maximum(own - beside, first), np.minimum(own + beside + 1, last)
            total = np.concatenate([[0.0], np.cumsum(values[low[0] : high[-1]], dtype=float)])
            found[own] = (total[high - low[0]] - total[low - low[0]]) / (high - low)
    return found


def resonance_weights(power: RealArray, run: IntArray) -> RealArray:
    """Return a weight a line, (F,), of mean square one: the root of the outputs' amplitude over neighbouring lines of the run.

    Parameters
    ----------
    power : array, (F,)
        Of the outputs together.
    run : array of int, (F,)
    """
    w = running_mean(power, run, _BESIDE)
    np.maximum(w, _QUIET * max(float(np.median(w)), np.finfo(float).tiny), out=w)
    np.sqrt(w, out=w)
    mean = float(np.mean(w))
    np.sqrt(w, out=w)
    w /= np.sqrt(mean)
    return w


def telling_lines(power: RealArray, run: IntArray, most: int) -> IntArray:
    """Return at most so many lines: half of them evenly spaced, and those that stand highest above their surroundings.

    Parameters
    ----------
    power : array, (F,)
        Of the outputs together.
    run : array of int, (F,)
    most : int
    """
    if power.size <= most:
        return np.arange(power.size)
    even = np.arange(0, power.size, -(-power.size // (most // 2)))
    level, height = running_mean(power, run, _AROUND), running_mean(power, run, _PEAK)
    np.divide(height, level, out=height, where=level > 0)
    height[even] = np.inf
    return _largest(height, most, level)


def _largest(values: RealArray, most: int, place: RealArray) -> IntArray:
    """Return where the `most` largest values are, increasing; of those alike at the limit the first. The place is overwritten."""
    place[:] = values
    place.partition(values.size - most)
    least = place[values.size - most]
    above = np.flatnonzero(values > least)
    return np.sort(np.concatenate([above, np.flatnonzero(values == least)[: most - above.size]]))


def near_modes(frequencies: RealArray, poles: Array, resolution: float, most: int) -> IntArray:
    """Return at most so many lines, those nearest to a mode in half bandwidths.

    What lies d half bandwidths away and farther holds a part of 1 / (2 d^3) or so of what is known of a pole.

    Parameters
    ----------
    frequencies : array, (F,)
        Hz.
    poles : array of complex, (n,)
        rad/s.
    resolution : float
        Hz; no mode is taken to be narrower.
    most : int
    """
    if frequencies.size <= most:
        return np.arange(frequencies.size)
    apart = np.full(frequencies.size, np.inf)
    for pole in np.asarray(poles):
        half = max(abs(pole.real) / (2 * np.pi), resolution)
        np.minimum(apart, np.abs(frequencies - abs(pole) / (2 * np.pi)) / half, out=apart)
    np.negative(apart, out=apart)
    return _largest(apart, most, np.empty_like(apart))
