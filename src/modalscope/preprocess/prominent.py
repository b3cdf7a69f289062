"""Where an ambient record has resonances: which part of it holds something that forces and noise alone do not show.

Lines of the periodogram are gathered in bins of 1 % of their frequency. A bin's level is its median, which lines of machines and mains,
narrower than any bin, do not move; a peak is where that level, over that of its neighbourhood, exceeds what chance allows.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft, special

from modalscope.model.checks import Array, BoolArray, RealArray
from modalscope.model.signals import Signals

__all__ = ["Levels", "binary_size", "levels_of", "prominent_span"]

#: Width of a bin as a part of its frequency, and the lines that it has at least.
_WIDTH, _LINES = 0.01, 8

#: A neighbourhood reaches so far on either side (in ln f), over so many bins at least and at most.
_REACH, _FEWEST, _MOST = 0.25, 8, 60

#: In white noise one record in so many shows a peak; and no peak is below this ratio, for backgrounds bend, too.
_CHANCE, _LEAST = 1e-3, 1.4

#: Bins that are looked at together: a damped resonance is that wide.
_SIDE_BY_SIDE = 3

#: A Hann window joins neighbouring lines: so many of them are worth one.
_JOINED = 1.5


class Levels(NamedTuple):
    """Spectral levels of a record in bins.

    Attributes
    ----------
    frequencies : array, (b,)
        Middles of the bins, Hz.
    widths : array of int, (b,)
        Lines in each.
    levels : array, (b, l)
        Median of the periodogram's lines over ln 2, the mean of what is random; 1 / Hz, all outputs over one number.
    """

    frequencies: RealArray
    widths: RealArray
    levels: RealArray

    @property
    def worth(self) -> RealArray:
        """Of how many independent lines a bin's level is as good as the mean, (b,): a median is worth (ln 2)^2 times as many."""
        return np.asarray(np.maximum(self.widths / _JOINED * np.log(2) ** 2, 1.0))

    @property
    def heights(self) -> RealArray:
        """Level over the median of the neighbourhood, (b, l); 1 where there is no neighbourhood."""
        logs = np.log(np.maximum(self.levels, np.finfo(float).tiny))
        count, ln_f = len(logs), np.log(self.frequencies)
        below = np.arange(count) - np.searchsorted(ln_f, ln_f - _REACH)
        above = np.searchsorted(ln_f, ln_f + _REACH) - 1 - np.arange(count)
        heights = np.ones(logs.shape)
        for i in range(count):  # as far on one side as on the other: slopes cancel
            far = min(max(min(below[i], above[i]), _FEWEST), _MOST, i, count - 1 - i)
            if far >= _FEWEST:
                around = np.median(logs[i - far : i + far + 1], axis=0)
                heights[i] = np.exp(np.minimum(logs[i] - around, 50.0))
        return heights

    def bars(self, trials: int) -> RealArray:
        """Return what chance allows for the height of each bin, (b,), where so many heights are looked at in each.

        The mean of k lines is a gamma variable of shape k over k.
        """
        worth = _SIDE_BY_SIDE * self.worth
        return np.maximum(special.gammainccinv(worth, _CHANCE / (len(worth) * trials)) / worth, _LEAST)

    @property
    def stands_out(self) -> BoolArray:
        """Which bins belong to a peak, (b,): three side by side are higher than chance allows, in one output or in the mean of all."""
        heights = self.heights
        if len(heights) < _SIDE_BY_SIDE:
            return np.zeros(len(heights), dtype=bool)
        wide = np.lib.stride_tricks.sliding_window_view(heights, _SIDE_BY_SIDE, axis=0).mean(axis=2)
        own, all_ = self.bars(heights.shape[1])[1:-1], self.bars(1)[1:-1]
        high = np.any(wide > own[:, None], axis=1) | (wide.mean(axis=1) > all_)
        return np.asarray(np.r_[False, high, False])


def levels_of(signals: Signals) -> Levels:
    """Return the spectral levels of the outputs of a record, averaged over runs.

    Parameters
    ----------
    signals : Signals
        The straight line is taken off every channel and run.
    """
    outputs, _ = signals.by_run()
    outputs = outputs / binary_size(outputs)
    window = scipy.signal.get_window("hann", signals.samples)
    power: RealArray = np.zeros((signals.samples // 2 + 1, outputs.shape[2]))
    for run in outputs:
        y = scipy.signal.detrend(run, axis=0) * window[:, None]
        power += np.abs(fft.rfft(y, axis=0)) ** 2
    power *= 2 / (signals.sampling_rate * float(window @ window) * len(outputs))
    edges = _edges(len(power))
    medians = [np.median(power[a:b], axis=0) for a, b in itertools.pairwise(edges)]
    middles = (edges[:-1] + edges[1:] - 1) / 2 * signals.sampling_rate / signals.samples
    values = np.array(medians).reshape(len(middles), -1) / np.log(2)
    return Levels(middles, np.diff(edges).astype(float), values)


def binary_size(x: Array) -> float:
    """Return a power of two near the largest value, so that squares of x over it are numbers whatever its unit; 1 of zeros.

    Parameters
    ----------
    x : array
    """
    return float(np.ldexp(1.0, int(np.frexp(np.max(np.abs(x), initial=0.0))[1]) - 1)) if np.any(x) else 1.0


def _edges(lines: int) -> RealArray:
    """Return the first lines of bins, and the end of the last: eight lines each, and a hundredth of the frequency from 800 on."""
    edges = [2]  # the first lines hold what the straight line left
    while edges[-1] + (width := max(_LINES, round(_WIDTH * edges[-1]))) < lines:
        edges.append(edges[-1] + width)
    return np.array(edges)


def prominent_span(levels: Levels) -> tuple[float, float] | None:
    """Return the lowest and the highest frequency (Hz) at which something stands out; None where nothing does.

    Parameters
    ----------
    levels : Levels
    """
    shown = np.flatnonzero(levels.stands_out)
    return None if not shown.size else (float(levels.frequencies[shown[0]]), float(levels.frequencies[shown[-1]]))
