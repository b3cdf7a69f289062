"""Where an ambient record has resonances: which part of it holds something that forces and noise alone do not show.

Lines of the periodogram are gathered in bins of 1 % of their frequency. A bin's level is its median, which lines of machines and mains,
narrower than any bin, do not move; a peak is where that level, over that of its neighbourhood, exceeds what chance allows.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from modalscope.model.checks import BoolArray, RealArray
from modalscope.model.signals import Signals
from modalscope.preprocess.whole_spectrum import Spectrum

__all__ = ["Levels", "levels_in", "levels_of"]

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


@dataclass(frozen=True, eq=False)
class Levels:
    """Spectral levels of a record in bins.

    Parameters
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

    @cached_property
    def heights(self) -> RealArray:
        """Level over the median of the neighbourhood, (b, l); 1 where there is no neighbourhood."""
        logs = np.log(np.maximum(self.levels, np.finfo(float).tiny))
        count, ln_f = len(logs), np.log(self.frequencies)
        below = np.arange(count) - np.searchsorted(ln_f, ln_f - _REACH)
        above = np.searchsorted(ln_f, ln_f + _REACH) - 1 - np.arange(count)
        reach, i = np.clip(np.minimum(below, above), _FEWEST, _MOST), np.arange(count)
        reach = np.minimum(reach, np.minimum(i, i[::-1]))  # as far on one side as on the other: slopes cancel
        heights = np.ones(logs.shape)
        for far in np.unique(reach[reach >= _FEWEST]):
            some = np.flatnonzero(reach == far)
            around = _medians(logs[some[:, None] + np.arange(-far, far + 1)])
            heights[some] = np.exp(np.minimum(logs[some] - around, 50.0))
        return heights

    def bars(self, trials: int) -> RealArray:
        """Return what chance allows for the height of each bin, (b,), where so many heights are looked at in each.

        The mean of k lines is a gamma variable of shape k over k.
        """
        worth = _SIDE_BY_SIDE * self.worth
        return np.maximum(special.gammainccinv(worth, _CHANCE / (len(worth) * trials)) / worth, _LEAST)

    @cached_property
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
    return levels_in(Spectrum.of(signals))


def levels_in(spectrum: Spectrum) -> Levels:
    """Return the spectral levels of a record whose transform is known, averaged over runs.

    Parameters
    ----------
    spectrum : Spectrum
    """
    power = sum(lines.real**2 + lines.imag**2 for lines in spectrum.lines) / (spectrum.step * len(spectrum.lines))
    edges = _edges(len(power))
    medians = [_medians(power[None, a:b])[0] for a, b in itertools.pairwise(edges)]
    middles = (edges[:-1] + edges[1:] - 1) / 2 * spectrum.step
    values = np.array(medians).reshape(len(middles), power.shape[1]) / np.log(2)
    return Levels(middles, np.diff(edges).astype(float), values)


def _medians(values: RealArray) -> RealArray:
    """Return the medians of (groups, n, l) over n, (groups, l)."""
    n = values.shape[1]
    middle = (n - 1) // 2, n // 2
    return np.asarray(np.partition(values, middle, axis=1)[:, middle, :].mean(axis=1))


def _edges(lines: int) -> RealArray:
    """Return the first lines of bins, and the end of the last: eight lines each, and a hundredth of the frequency from 800 on."""
    edges = [2]  # the first lines hold what the straight line left
    while edges[-1] + (width := max(_LINES, round(_WIDTH * edges[-1]))) < lines:
        edges.append(edges[-1] + width)
    return np.array(edges)
