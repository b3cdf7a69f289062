"""Whether an ambient record holds anything but noise: the whole of it is tested before any pole is looked at."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.stored import Record
from modalscope.numerics.checks import BoolArray, RealArray
from modalscope.preprocess.conditioning import decimate, filter_band
from modalscope.preprocess.harmonics import Spectrum

__all__ = [
    "CHOSEN",
    "NOISE",
    "UNSEEN",
    "Levels",
    "OwnBands",
    "levels_in",
    "levels_of",
    "noise_notes",
    "own_bands",
    "taken_down",
]


# ----------------------------------------------------------------------------------------------------------- prominent
# Where an ambient record has resonances: which part of it holds something that forces and noise alone do not show.
#
# Lines of the periodogram are gathered in bins of 1 % of their frequency. A bin's level is its median, which lines of machines and mains,
# narrower than any bin, do not move; a peak is where that level, over that of its neighbourhood, exceeds what chance allows.

#: Width of a bin as a part of its frequency, and the lines that it has at least.
_WIDTH, _LINES = 0.01, 8

#: A neighbourhood reaches so far on either side (in ln f), over so many bins at least and at most.
_REACH, _FEWEST_LINES, _MOST = 0.25, 8, 60

#: In white noise one record in so many shows a peak; and no peak is below this ratio, for backgrounds bend, too.
_FALSE_ALARM, _LEAST = 1e-3, 1.4

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
        reach, i = np.clip(np.minimum(below, above), _FEWEST_LINES, _MOST), np.arange(count)
        reach = np.minimum(reach, np.minimum(i, i[::-1]))  # as far on one side as on the other: slopes cancel
        heights = np.ones(logs.shape)
        for far in np.unique(reach[reach >= _FEWEST_LINES]):
            some = np.flatnonzero(reach == far)
            around = _medians(logs[some[:, None] + np.arange(-far, far + 1)])
            heights[some] = np.exp(np.minimum(logs[some] - around, 50.0))
        return heights

    def bars(self, trials: int) -> RealArray:
        """Return what chance allows for the height of each bin, (b,), where so many heights are looked at in each.

        The mean of k lines is a gamma variable of shape k over k.
        """
        worth = _SIDE_BY_SIDE * self.worth
        return np.maximum(special.gammainccinv(worth, _FALSE_ALARM / (len(worth) * trials)) / worth, _LEAST)

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
    """Return the spectral levels of a record whose transform is known, averaged over runs."""
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


# ------------------------------------------------------------------------------------------------------------ own band
# The bands of an ambient record that nobody gave: from where something stands out, with room on both sides.

#: The kinds of the note that says what was chosen: one band, or several.
CHOSEN, SPLIT = "band chosen", "bands chosen"

#: A band reaches beyond what stands out by these factors; a weak mode may lie there, and filters need room.
_BELOW, _ABOVE = 0.6, 1.25

#: A record of fewer samples a period of its band's upper end is taken as it is ...
_SLOW = 8.0

#: ... unless what lies below the band has this part of all power: drift.
_DRIFT = 0.2

#: One band is no wider than this ratio, where a gap of at least the second ratio is there to cut it at: lags that suit its slowest mode
#: suit the fastest.
_WIDE, _GAP = 4.0, 1.15

#: A record that is slowed down keeps so many samples a period of the highest frequency of its band: as many lags are used whatever the
#: rate, and they should end where the correlation is noise.
_SAMPLES_PER_PERIOD = 4.0

#: Significant digits of a band's ends.
_DIGITS = 3

Band = tuple[float, float]


class OwnBands(NamedTuple):
    """The band of a record, the parts it falls into, and from what they follow.

    Attributes
    ----------
    whole : (float, float) or None
        Hz; None where the record is taken as it is.
    parts : tuple of (float, float)
        One by one; one part where it is not wide. None of them where nothing stands out.
    drift : float or None
        Hz: what lies below is drift, and is taken off; None where there is little of it.
    span : (float, float) or None
        Hz: the lowest and the highest frequency at which something stands out.
    below : float
        Part of all power below the band.
    """

    whole: Band | None = None
    parts: tuple[Band, ...] = ()
    drift: float | None = None
    span: Band | None = None
    below: float = 0.0

    def note(self, parts: tuple[Band, ...]) -> Note:
        """Return in one line which bands were taken, and why.

        Parameters
        ----------
        parts : tuple of (float, float)
            The whole band, or its parts.
        """
        assert self.span is not None
        drift = "" if self.drift is None else f", and drift below ({100 * self.below:.2g} % of all power)"
        bands = ", ".join(f"{low:g} to {high:g} Hz" for low, high in parts)
        what = "the band {} was" if len(parts) == 1 else "bands of {} were"
        text = (
            f"{what.format(bands)} chosen: resonances stand out from {self.span[0]:.3g} to {self.span[1]:.3g} Hz{drift}"
        )
        numbers = {"lowest_hz": parts[0][0], "highest_hz": parts[-1][1], "parts": float(len(parts))}
        return Note(CHOSEN if len(parts) == 1 else SPLIT, {**numbers, "share_below": self.below}, text)


def own_bands(levels: Levels, rate: float) -> OwnBands:
    """Return the band of an ambient record: 0.6 times the lowest to 1.25 times the highest frequency at which something stands out.

    A record that is sampled for that band, and that does not drift, is taken as it is, and so is one in which nothing stands out. A band
    wider than 4 : 1 falls into parts, at the widest gaps.

    Parameters
    ----------
    rate : float
        Samples a second.

    Examples
    --------
    >>> from modalscope.preprocess.bands import levels_of
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="ambient", duration=600, sampling_rate=200.0)
    >>> low, high = own_bands(levels_of(record), 200.0).whole
    >>> bool(low < chain5().modes().frequencies.min() and chain5().modes().frequencies.max() < high)
    True
    """
    shown = levels.frequencies[levels.stands_out]
    if not shown.size:
        return OwnBands()
    low, high = _rounded(_BELOW * shown[0]), _rounded(min(_ABOVE * shown[-1], 0.49 * rate))
    share = _share_below(levels, low)
    parts = _parts((low, high), shown)
    drift = low if share >= _DRIFT else None
    whole = None if rate < _SLOW * high and drift is None else (low, high)
    if whole is None and len(parts) == 1:
        return OwnBands()
    return OwnBands(whole, parts, drift, (float(shown[0]), float(shown[-1])), share)


def taken_down(signals: Record, highest: float, drift: float | None) -> Record:
    """Return a record at the lowest rate that carries its band, without drift.

    Noise stays as white as it was, so that it leaves correlations from lag 1 on alone: nothing is filtered that the lower rate or
    drift does not ask for. One sample in q is kept, q the largest with at least 4 samples a period of `highest`, behind a low-pass at
    0.8 of half the new rate; below `drift` a high-pass takes off what is there.

    Parameters
    ----------
    highest : float
        Hz.
    drift : float, optional
        Hz.
    """
    factor = max(int(signals.sampling_rate / (_SAMPLES_PER_PERIOD * highest)), 1)
    slower = decimate(signals, min(factor, max(signals.samples // 2, 1)))
    if drift is None:
        return slower
    return filter_band(slower, drift, 0.499 * slower.sampling_rate, decimate=False)


def _parts(band: Band, shown: RealArray) -> tuple[Band, ...]:
    """Return a band cut at the widest gap of what stands out, again and again while a part is wide."""
    low, high = band
    inside = shown[(shown >= low) & (shown <= high)]
    if inside.size < 2 or inside[-1] < _WIDE * inside[0]:
        return (band,)
    ratios = inside[1:] / inside[:-1]
    widest = int(np.argmax(ratios))
    if ratios[widest] < _GAP:
        return (band,)
    cut = _rounded(float(np.sqrt(inside[widest] * inside[widest + 1])))
    return (*_parts((low, cut), shown), *_parts((cut, high), shown))


def _rounded(frequency: float) -> float:
    return float(f"{frequency:.{_DIGITS}g}")


def _share_below(levels: Levels, low: float) -> float:
    """Return how much of the outputs' power lies below a frequency; the mean of all, each brought to one."""
    power: RealArray = levels.levels * levels.widths[:, None]
    total = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    return float(np.mean(power[levels.frequencies < low].sum(axis=0) / total))


# ---------------------------------------------------------------------------------------------------------- noise test

#: The kinds of the notes: nothing but noise; and a record that is not white, but in which nothing stands out.
NOISE, UNSEEN = "noise alone", "nothing stands out"

#: A record is white while its levels scatter by no more than this many standard deviations above what chance makes.
_CHANCE = 5.0

#: Bins that a test needs.
_FEWEST = 20


def noise_notes(levels: Levels, band: tuple[float, float] | None = None) -> tuple[Note, ...]:
    """Return a note where a record, in a band, is nothing but noise, or where nothing stands out of what is there.

    Noise alone has spectral levels that are the same at all frequencies, within chance: with x_b the logarithm of the level of bin b
    and v_b the variance that the number of its lines gives, sum_b (x_b - mean x)^2 / v_b is about the number of bins. And no bins
    stand out of their neighbourhood as a resonance does.

    Parameters
    ----------
    levels : Levels
        Of the record as it was measured.
    band : (float, float), optional
        Hz.
    """
    low, high = (0.0, np.inf) if band is None else band
    inside = (levels.frequencies >= low) & (levels.frequencies <= high)
    if inside.sum() < _FEWEST:
        return ()
    if np.any(levels.stands_out & inside):
        return ()
    ends = levels.frequencies[inside][[0, -1]]
    numbers = {"lowest_hz": float(ends[0]), "highest_hz": float(ends[1])}
    where = f"{ends[0]:.3g} to {ends[1]:.3g} Hz"
    if _scatter(levels, inside) < _CHANCE:
        text = f"nothing but noise in {where}: the level is the same at all frequencies, and nothing stands out"
        return (Note(NOISE, numbers, text),)
    text = f"nothing stands out in {where}: only what the record leaves little open can be a mode"
    return (Note(UNSEEN, numbers, text),)


def _scatter(levels: Levels, inside: BoolArray) -> float:
    """Return by how many standard deviations the levels scatter more than chance makes them, of the output that does most."""
    worth = levels.worth[inside]
    variance = special.polygamma(1, worth)
    x = (
        np.log(np.maximum(levels.levels[inside], np.finfo(float).tiny))
        - (special.digamma(worth) - np.log(worth))[:, None]
    )
    mean = (x / variance[:, None]).sum(axis=0) / (1 / variance).sum()
    total = ((x - mean) ** 2 / variance[:, None]).sum(axis=0)
    # the square of a log gamma variable has the fourth cumulant polygamma(3) beside twice the square of its variance
    spread = np.sqrt(np.sum(2 + special.polygamma(3, worth) / variance**2))
    return float(np.max((total - (len(worth) - 1)) / spread))
