"""Find the bands of an ambient record that hold resonances, and test whether it holds anything but noise."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.stored import Record
from modalscope.data.whitening import Whitening, normed_covariance, whitening_matrix
from modalscope.numerics.checks import BoolArray, IntArray, RealArray
from modalscope.preprocess.conditioning import decimate, filter_band
from modalscope.preprocess.harmonics import Spectrum

# ----------------------------------------------------------------------------------------------------------- prominent
# Lines of the periodogram are collected in bins of 1 % of their frequency. The level of a bin is their median, which harmonics and mains,
# narrower than any bin, do not change; a peak is where that level, over that of its neighbourhood, exceeds chance.

#: Width of a bin as a part of its frequency, and its least number of lines.
_WIDTH, _LINES = 0.01, 8

#: A neighbourhood reaches so far on either side (in ln f), over so many bins at least and at most.
_REACH, _FEWEST_LINES, _MOST = 0.25, 8, 60

#: Probability of a peak in a record of white noise; and the least ratio of a peak, since backgrounds bend, too.
_FALSE_ALARM, _LEAST = 1e-3, 1.4

#: Adjacent bins that are averaged: a damped resonance is that wide.
_ADJACENT = 3

#: Lines of a Hann window that are worth an independent one.
_CORRELATED = 1.5


@dataclass(frozen=True, eq=False)
class Levels:
    """Spectral levels of a record in b bins: centres (Hz), numbers of lines, and the medians of the periodogram over ln 2, (b, l).

    The latter estimate the mean of random lines, in 1 / Hz, relative to one number for all outputs. `combined` (b, c): the same of
    combinations of the outputs, in which peaks are sought as well.
    """

    frequencies: RealArray
    widths: RealArray
    levels: RealArray
    combined: RealArray | None = None

    def with_channels(self, others: Sequence[Levels]) -> Levels:
        """Return the levels with those of further channels in the same bins."""
        return replace(self, levels=np.hstack([self.levels, *(other.levels for other in others)]))

    def beside(self, *combined: Levels) -> Levels:
        """Return the levels with those of combinations of channels in the same bins."""
        return replace(self, combined=np.hstack([other.levels for other in combined]))

    @property
    def independent(self) -> RealArray:
        """The independent lines whose mean has the variance of the bin's level, (b,): a median has that of (ln 2)^2 times as many."""
        return np.asarray(np.maximum(self.widths / _CORRELATED * np.log(2) ** 2, 1.0))

    @cached_property
    def heights(self) -> RealArray:
        """Level over the median of the neighbourhood, (b, l + c); 1 where there is no neighbourhood."""
        every = self.levels if self.combined is None else np.hstack([self.levels, self.combined])
        logs = np.log(np.maximum(every, np.finfo(float).tiny))
        count, ln_f = len(logs), np.log(self.frequencies)
        below = np.arange(count) - np.searchsorted(ln_f, ln_f - _REACH)
        above = np.searchsorted(ln_f, ln_f + _REACH) - 1 - np.arange(count)
        reach, i = np.clip(np.minimum(below, above), _FEWEST_LINES, _MOST), np.arange(count)
        reach = np.minimum(reach, np.minimum(i, i[::-1]))  # symmetric, so that slopes cancel
        heights = np.ones(logs.shape)
        for far in np.unique(reach[reach >= _FEWEST_LINES]):
            some = np.flatnonzero(reach == far)
            around = np.median(logs[some[:, None] + np.arange(-far, far + 1)], axis=1)
            heights[some] = np.exp(np.minimum(logs[some] - around, 50.0))
        return heights

    def limits(self, trials: int) -> RealArray:
        """Return the limit of chance for the height of each bin, (b,), where so many heights are tested in each.

        The mean of k lines is a gamma variable of shape k over k.
        """
        n = _ADJACENT * self.independent
        return np.maximum(special.gammainccinv(n, _FALSE_ALARM / max(len(n) * trials, 1)) / n, _LEAST)

    @cached_property
    def _wide(self) -> RealArray:
        """Means of the heights of three bins, (b, l + c); of the first and the last 1."""
        wide = np.ones(self.heights.shape)
        if len(wide) >= _ADJACENT:
            wide[1:-1] = np.lib.stride_tricks.sliding_window_view(self.heights, _ADJACENT, axis=0).mean(axis=2)
        return wide

    @cached_property
    def single_peaks(self) -> BoolArray:
        """Which bins belong to a peak of each output or combination, (b, l + c): the mean of three exceeds chance."""
        return np.asarray(self._wide > self.limits(self._wide.shape[1])[:, None])

    @cached_property
    def in_peak(self) -> BoolArray:
        """Which bins belong to a peak, (b,): the mean of three exceeds chance, in one output or in the mean of all."""
        return np.asarray(np.any(self.single_peaks, axis=1) | (self._wide.mean(axis=1) > self.limits(1)))


def levels_of(signals: Signals) -> Levels:
    """Return the spectral levels of the outputs of a record, averaged over runs, without straight lines."""
    return levels_in(Spectrum.of(signals))


def levels_in(spectrum: Spectrum) -> Levels:
    """Return the spectral levels of a record from its spectrum, averaged over runs."""
    power = sum(lines.real**2 + lines.imag**2 for lines in spectrum.lines) / (spectrum.step * len(spectrum.lines))
    edges = bin_edges(2, len(power) - 1, _LINES)  # the first lines hold the remainder of the straight line
    medians = [np.median(power[a:b], axis=0) for a, b in itertools.pairwise(edges)]
    middles = (edges[:-1] + edges[1:] - 1) / 2 * spectrum.step
    values = np.array(medians).reshape(len(middles), power.shape[1]) / np.log(2)
    return Levels(middles, np.diff(edges).astype(float), values)


#: Eigenvalues of the normed covariance that count, as a part of the largest: below are channels that depend on others.
_DEPENDENT = 1e-10


def uncorrelated(spectrum: Spectrum) -> Spectrum:
    """Return the spectrum of the principal components of the outputs, each of size one: a weak mode has a peak in one of them.

    With D the root mean squares of the channels and D^-1 S D^-1 = V E V', these are E^-1/2 V' D^-1 y.
    """
    C, size = normed_covariance(_covariance(spectrum))
    values, vectors = np.linalg.eigh(C)
    kept = values > _DEPENDENT * max(float(values[-1]), np.finfo(float).tiny)
    return spectrum._replace(lines=spectrum.lines @ (vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]))


def _covariance(spectrum: Spectrum) -> RealArray:
    lines = spectrum.lines.reshape(-1, spectrum.lines.shape[-1])
    return np.asarray(lines.real.T @ lines.real + lines.imag.T @ lines.imag)


def whitening_of(record: Signals, references: Sequence[int], band: Band | None) -> Whitening | None:
    """Return what whitens the outputs of a record and those of them that are references; None of one output.

    Principal components without a peak in the band (Hz) are noise, which is not brought to the size of modes: eigenvalues are held above
    the least of a component with a peak.
    """
    if len(record.output_dofs) < 2:
        return None
    spectrum, chosen = Spectrum.of(record), list(references)
    W = _whitening_matrix(spectrum, band)
    whole = chosen == list(range(len(W)))
    return Whitening(W, W if whole else _whitening_matrix(spectrum._replace(lines=spectrum.lines[..., chosen]), band))


def _whitening_matrix(spectrum: Spectrum, band: Band | None) -> RealArray:
    S = _covariance(spectrum)
    values = np.linalg.eigvalsh(normed_covariance(S)[0])
    levels = levels_in(uncorrelated(spectrum))
    low, high = (0.0, np.inf) if band is None else band
    inside = (levels.frequencies >= low) & (levels.frequencies <= high)
    seen = np.any(levels.single_peaks & inside[:, None], axis=0)
    least = values[-int(seen.size) :][seen].min() if seen.any() else values[-1]
    return whitening_matrix(S, float(least / max(values[-1], np.finfo(float).tiny)))


def bin_edges(first: int, end: int, least: int) -> IntArray:
    """Return the first lines of the bins that fit before `end`, and the end of the last: a hundredth of the frequency each, or `least`."""
    edges = [first]
    while (edge := edges[-1] + max(least, round(_WIDTH * edges[-1]))) <= end:
        edges.append(edge)
    return np.array(edges)


# ------------------------------------------------------------------------------------------------------ automatic bands

#: The kinds of the note on the choice: one band, or several.
CHOSEN, SPLIT = "band chosen", "bands chosen"

#: A band extends beyond the peaks by these factors, for weak modes and for the filters.
_BELOW, _ABOVE = 0.6, 1.25

#: A record of fewer samples a period of its band's upper end is used unchanged ...
_SLOW = 8.0

#: ... unless this part of all power lies below the band: drift.
_DRIFT = 0.2

#: A band is no wider than this ratio, if it can be cut at a gap of at least the second ratio: the lags for its slowest mode then suit the
#: fastest.
_WIDE, _GAP = 4.0, 1.15

#: Least samples a period of the band's upper end after decimation: the number of lags is the same at any rate, and they should end where
#: the correlation is noise.
_SAMPLES_PER_PERIOD = 4.0

#: Significant digits of a band's ends.
_DIGITS = 3

Band = tuple[float, float]


class OwnBands(NamedTuple):
    """The automatic band of a record, its parts, and how they were found; frequencies in Hz."""

    whole: Band | None = None  # None where the record is used unchanged
    parts: tuple[Band, ...] = ()  # one if the band is not wide, none without a peak
    drift: float | None = None  # below is drift, to be removed; None where there is little of it
    span: Band | None = None  # the lowest and the highest peak
    below: float = 0.0  # part of all power below the band

    def note(self, parts: tuple[Band, ...]) -> Note:
        """Return the note on the bands used, the whole or its parts."""
        assert self.span is not None
        drift = "" if self.drift is None else f", and drift below ({100 * self.below:.2g} % of all power)"
        bands = ", ".join(f"{low:g} to {high:g} Hz" for low, high in parts)
        what = "the band {} was" if len(parts) == 1 else "bands of {} were"
        text = (
            f"{what.format(bands)} chosen: spectral peaks lie from {self.span[0]:.3g} to {self.span[1]:.3g} Hz{drift}"
        )
        numbers = {"lowest_hz": parts[0][0], "highest_hz": parts[-1][1], "parts": float(len(parts))}
        return Note(CHOSEN if len(parts) == 1 else SPLIT, {**numbers, "share_below": self.below}, text)


def own_bands(levels: Levels, rate: float) -> OwnBands:
    """Return the band of an ambient record sampled at `rate` Hz: 0.6 times its lowest peak to 1.25 times the highest.

    A record that is sampled for that band without drift is used unchanged, and so is one without peaks. A band wider than 4 : 1 is cut
    into parts at the widest gaps.

    Examples
    --------
    >>> from modalscope.preprocess.bands import levels_of
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="ambient", duration=600, sampling_rate=200.0)
    >>> low, high = own_bands(levels_of(record), 200.0).whole
    >>> bool(low < chain5().modes().frequencies.min() and chain5().modes().frequencies.max() < high)
    True
    """
    shown = levels.frequencies[levels.in_peak]
    if not shown.size:
        return OwnBands()
    low, high = rounded(_BELOW * shown[0]), rounded(min(_ABOVE * shown[-1], 0.49 * rate))
    power: RealArray = levels.levels * levels.widths[:, None]
    total = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    share = float(np.mean(power[levels.frequencies < low].sum(axis=0) / total))
    parts = _parts((low, high), shown)
    drift = low if share >= _DRIFT else None
    whole = None if rate < _SLOW * high and drift is None else (low, high)
    if whole is None and len(parts) == 1:
        return OwnBands()
    return OwnBands(whole, parts, drift, (float(shown[0]), float(shown[-1])), share)


def taken_down(signals: Record, highest: float, drift: float | None) -> Record:
    """Return a record at the lowest rate that carries its band, without drift.

    Only the filters that the lower rate or drift requires are applied, so that white noise stays white and enters correlations at lag 0
    alone. One sample in q is kept, q the largest with at least 4 samples a period of `highest`, behind a low-pass at 0.8 of half the new
    rate; a high-pass removes what is below `drift`. Both are in Hz.
    """
    factor = max(int(signals.sampling_rate / (_SAMPLES_PER_PERIOD * highest)), 1)
    slower = decimate(signals, min(factor, max(signals.samples // 2, 1)))
    if drift is None:
        return slower
    return filter_band(slower, drift, 0.499 * slower.sampling_rate, decimate=False)


def _parts(band: Band, shown: RealArray) -> tuple[Band, ...]:
    """Return a band cut at the widest gap between peaks, recursively while a part is wide."""
    low, high = band
    inside = shown[(shown >= low) & (shown <= high)]
    if inside.size < 2 or inside[-1] < _WIDE * inside[0]:
        return (band,)
    ratios = inside[1:] / inside[:-1]
    widest = int(np.argmax(ratios))
    if ratios[widest] < _GAP:
        return (band,)
    cut = rounded(float(np.sqrt(inside[widest] * inside[widest + 1])))
    return (*_parts((low, cut), shown), *_parts((cut, high), shown))


def rounded(frequency: float) -> float:
    """Return the end of a band with three significant digits."""
    return float(f"{frequency:.{_DIGITS}g}")


# ---------------------------------------------------------------------------------------------------------- noise test

#: The kinds of the notes: a record of noise alone; one that is not white, but without a peak.
NOISE, UNSEEN = "noise alone", "nothing stands out"

#: A record is white while its levels scatter by no more than this many standard deviations above chance.
_CHANCE = 5.0

#: Bins that a test needs.
_FEWEST = 20


def noise_notes(levels: Levels, band: tuple[float, float] | None = None) -> tuple[Note, ...]:
    """Return a note where a record as it was measured, in a band (Hz), is nothing but noise, or has no peak.

    Noise alone has the same spectral level at all frequencies, within chance: with x_b the logarithm of the level of bin b and v_b its
    variance by the number of lines, sum_b (x_b - mean x)^2 / v_b is about the number of bins.
    """
    low, high = (0.0, np.inf) if band is None else band
    inside = (levels.frequencies >= low) & (levels.frequencies <= high)
    if inside.sum() < _FEWEST or np.any(levels.in_peak & inside):
        return ()
    ends = levels.frequencies[inside][[0, -1]]
    numbers = {"lowest_hz": float(ends[0]), "highest_hz": float(ends[1])}
    where = f"{ends[0]:.3g} to {ends[1]:.3g} Hz"
    if _scatter(levels, inside) < _CHANCE:
        text = f"nothing but noise in {where}: the spectral level is the same at all frequencies, without a peak"
        return (Note(NOISE, numbers, text),)
    text = f"no spectral peak in {where}: only modes with small standard deviations are reported"
    return (Note(UNSEEN, numbers, text),)


def _scatter(levels: Levels, inside: BoolArray) -> float:
    """Return by how many standard deviations the levels of the worst output scatter above chance."""
    n = levels.independent[inside]
    variance = special.polygamma(1, n)
    logs = np.log(np.maximum(levels.levels[inside], np.finfo(float).tiny))
    x = logs - (special.digamma(n) - np.log(n))[:, None]
    mean = (x / variance[:, None]).sum(axis=0) / (1 / variance).sum()
    total = ((x - mean) ** 2 / variance[:, None]).sum(axis=0)
    # var x^2 of a log gamma variable is its fourth cumulant polygamma(3) plus twice the square of its variance
    spread = np.sqrt(np.sum(2 + special.polygamma(3, n) / variance**2))
    return float(np.max((total - (len(n) - 1)) / spread))
