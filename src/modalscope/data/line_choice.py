"""Choose lines of long records: for judging and refining models, weighting, and for pictures.

The equations of records hold line by line, so that lines that are left out cost accuracy and bring no bias.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.data.responses import FrequencyResponse
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray

#: Lines on either side over which a weight is averaged, and the lowest power relative to the median that it follows.
_WEIGHT_NEIGHBOURS, _MIN_POWER_OVER_MEDIAN = 20, 0.01

#: Neighbours on either side over which a peak and its surroundings are averaged.
_PEAK_NEIGHBOURS, _LEVEL_NEIGHBOURS = 3, 2000

#: Lines that are averaged at a time, to bound the memory of long records.
_LINES_AT_A_TIME = 1 << 16


def running_mean(values: RealArray, run: IntArray, neighbours: int) -> RealArray:
    """Return the mean over each line and up to `neighbours` lines on either side within its run, (F,).

    `values` (F,). `run` (F,): increasing.

    Examples
    --------
    >>> running_mean(np.array([1.0, 2.0, 6.0, 5.0]), np.array([0, 0, 0, 1]), 1)
    array([1.5, 3. , 4. , 5. ])
    """
    mean = np.empty_like(values)
    for first, last in pairwise(np.searchsorted(run, np.arange(run[-1] + 2 if run.size else 1, dtype=run.dtype))):
        for start in range(first, last, _LINES_AT_A_TIME):
            k = np.arange(start, min(start + _LINES_AT_A_TIME, last))
            low, high = np.maximum(k - neighbours, first), np.minimum(k + neighbours + 1, last)
            total = np.concatenate([[0.0], np.cumsum(values[low[0] : high[-1]], dtype=float)])
            mean[k] = (total[high - low[0]] - total[low - low[0]]) / (high - low)
    return mean


def resonance_weights(power: RealArray, run: IntArray) -> RealArray:
    """Return a weight per line, (F,), of mean square one: the root of the outputs' amplitude over neighbouring lines of the run.

    `power` (F,): of the outputs together. `run` (F,).
    """
    w = running_mean(power, run, _WEIGHT_NEIGHBOURS)
    np.maximum(w, _MIN_POWER_OVER_MEDIAN * max(float(np.median(w)), np.finfo(float).tiny), out=w)
    np.sqrt(w, out=w)
    mean = float(np.mean(w))
    np.sqrt(w, out=w)
    w /= np.sqrt(mean)
    return w


def telling_lines(power: RealArray, run: IntArray, most: int) -> IntArray:
    """Return at most so many lines: half of them evenly spaced, and those that stand highest above their surroundings.

    `power` (F,): of the outputs together. `run` (F,).
    """
    if power.size <= most:
        return np.arange(power.size)
    even = np.arange(0, power.size, -(-power.size // (most // 2)))
    level, height = running_mean(power, run, _LEVEL_NEIGHBOURS), running_mean(power, run, _PEAK_NEIGHBOURS)
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

    Lines at least d half bandwidths away carry a share of about 1 / (2 d^3) of the information on a pole.

    `frequencies` (F,): Hz. `poles` (n,): rad/s. `resolution`: Hz; no mode is taken to be narrower.
    """
    if frequencies.size <= most:
        return np.arange(frequencies.size)
    apart = np.full(frequencies.size, np.inf)
    for pole in np.asarray(poles):
        half = max(abs(pole.real) / (2 * np.pi), resolution)
        np.minimum(apart, np.abs(frequencies - abs(pole) / (2 * np.pi)) / half, out=apart)
    np.negative(apart, out=apart)
    return _largest(apart, most, np.empty_like(apart))


#: Maximum number of lines of a picture, and groups of lines on either side over which each value is averaged.
_MAX_PICTURE_LINES, _PICTURE_NEIGHBOURS = 4000, 3

#: Inputs below this share of the largest power are regularized: they are no forces.
_MIN_INPUT_POWER = 1e-12


def picture_of(
    frequencies: RealArray, outputs: ComplexArray, inputs: ComplexArray, labels: dict[str, Any]
) -> FrequencyResponse:
    """Return H = S_yu S_uu^-1 with spectra averaged over groups of neighbouring lines, of all runs together.

    `frequencies` (F,): Hz, in any order. `outputs` (F, l). `inputs` (F, m). `labels`: labels, units and quantity of the response.
    """
    order = np.argsort(frequencies, kind="stable")
    starts = np.arange(0, order.size, max(-(-order.size // _MAX_PICTURE_LINES), 1))
    f, Y, U = frequencies[order], outputs[order], inputs[order]
    cross = _over_neighbours(np.add.reduceat(Y[:, :, None] * U[:, None, :].conj(), starts))
    power = _over_neighbours(np.add.reduceat(U[:, :, None] * U[:, None, :].conj(), starts))
    m = U.shape[1]
    level = np.einsum("fii->f", power).real
    floor = _MIN_INPUT_POWER * max(float(level.max()), np.finfo(float).tiny)
    H = cross @ np.linalg.inv(power + (_MIN_INPUT_POWER * level + floor)[:, None, None] * np.eye(m))
    middle = np.add.reduceat(f, starts) / np.diff(np.append(starts, f.size))
    lines, first = np.unique(middle, return_index=True)
    return FrequencyResponse(values=H[first], frequencies=lines, **labels)


def _over_neighbours(sums: ComplexArray) -> ComplexArray:
    """Return sums over each group of lines and its neighbours."""
    total = np.concatenate([np.zeros_like(sums[:1]), np.cumsum(sums, axis=0)])
    k = np.arange(len(sums))
    return np.asarray(
        total[np.minimum(k + _PICTURE_NEIGHBOURS + 1, len(sums))] - total[np.maximum(k - _PICTURE_NEIGHBOURS, 0)]
    )
