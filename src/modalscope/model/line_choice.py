"""Which lines of long records are enough: for judging, some of all and those of the peaks; for refining, those near the modes.

The equations of records hold line by line, so that lines that are left out cost accuracy and bring no bias.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from modalscope.model.checks import Array, IntArray, RealArray

__all__ = ["near_modes", "running_mean", "telling_lines"]

#: Neighbours on either side over which a peak and its surroundings are averaged.
_PEAK, _AROUND = 3, 2000


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
    for first, last in pairwise(np.searchsorted(run, np.arange(run[-1] + 2) if run.size else [0])):
        total = np.concatenate([[0.0], np.cumsum(values[first:last])])
        k = np.arange(last - first)
        low, high = np.maximum(k - beside, 0), np.minimum(k + beside + 1, last - first)
        found[first:last] = (total[high] - total[low]) / (high - low)
    return found


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
    level = running_mean(power, run, _AROUND)
    height = running_mean(power, run, _PEAK) / np.where(level > 0, level, 1)
    height[even] = np.inf
    return np.sort(np.argpartition(-height, most - 1)[:most])


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
    return np.sort(np.argpartition(apart, most - 1)[:most])
