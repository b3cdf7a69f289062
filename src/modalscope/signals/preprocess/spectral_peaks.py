"""Test the spectra of an ambient record for peaks: against their surroundings, against white noise, and at a pole.

Lines of the periodogram are collected in bins of 1 % of their frequency. The level of a bin is their median, which harmonics and mains,
narrower than any bin, do not change. A peak is where that level, over that of its neighbourhood, exceeds chance.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
import scipy.linalg as sla
from numpy.typing import ArrayLike
from scipy import special

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.shown import figures
from modalscope.data.stored import StoredSignals
from modalscope.data.whitening import Whitening, normed_covariance, whitening_matrix
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.statistics import MANY_NUMBERS, few_channels
from modalscope.signals.preprocess.spectra import Spectrum

#: Width of a bin as a part of its frequency, and its minimum number of lines.
_BIN_WIDTH, _MIN_BIN_LINES = 0.01, 8

#: Half width of a neighbourhood in ln f, and the bins on either side that it has at least and at most.
_NEIGHBOURHOOD, _MIN_NEIGHBOURS, _MAX_NEIGHBOURS = 0.25, 8, 60

#: Probability of a peak in a record of white noise; and the minimum ratio of a peak, since backgrounds bend, too.
_FALSE_ALARM, MIN_PEAK_RATIO = 1e-3, 1.4

#: Adjacent bins that are averaged: a damped resonance is that wide.
_AVERAGED_BINS = 3

#: Lines of a Hann window that are worth an independent one.
_LINES_PER_INDEPENDENT = 1.5

#: Minimum eigenvalue of the normed covariance, as a part of the largest: below are channels that depend on others.
_MIN_EIGENVALUE = 1e-10

#: The kinds of the notes: a record of noise alone; one that is not white, but without a peak.
NOISE, UNSEEN = "noise alone", "nothing stands out"

#: A record is white while its levels scatter by no more than this many standard deviations above chance; and the bins that the test needs.
_MAX_SCATTER, _MIN_TESTED_BINS = 5.0, 20

#: The name of the indicator.
PEAK = "peak"

#: Minimum lines of a peak on either side of its pole, and the range of its surroundings in half bandwidths.
_MIN_PEAK_LINES, _SURROUNDINGS = 4, (1.5, 5.0)

#: Minimum lines of the surroundings for every output, so that their covariance has an inverse; and maximum lines of either set.
_LINES_PER_OUTPUT, _MAX_LINES = 4, 2000

#: A peak is clear where it rises so many times above the dips beside it in so many outputs; lower levels are rounding.
_CLEAR_HEIGHT, _CLEAR_OUTPUTS, _LEAST_LEVEL = 10.0, 3, 1e-15

#: A peak of this height needs no further evidence; a lower one has to exceed this probability, shared by all that might be tested.
_CERTAIN_HEIGHT, _CHANCE_OF_ANY = 2.0, 0.01


@dataclass(frozen=True, eq=False)
class Levels:
    """Spectral levels of a record in b bins: centres (Hz), numbers of lines, and the medians of the periodogram over ln 2, (b, l).

    The latter estimate the mean of random lines, in 1 / Hz, relative to one number for all outputs. `combined` (b, c): the same of
    combinations of the outputs, which are tested for peaks as well.
    """

    frequencies: RealArray
    widths: RealArray
    levels: RealArray
    combined: RealArray | None = None

    def with_channels(self, others: Sequence[Levels]) -> Levels:
        """Return the levels with those of further channels in the same bins."""
        return replace(self, levels=np.hstack([self.levels, *(other.levels for other in others)]))

    def with_combinations(self, *combined: Levels) -> Levels:
        """Return the levels with those of combinations of channels in the same bins."""
        return replace(self, combined=np.hstack([other.levels for other in combined]))

    @property
    def independent(self) -> RealArray:
        """The independent lines whose mean has the variance of the bin's level, (b,): a median has that of (ln 2)^2 times as many."""
        return np.asarray(np.maximum(self.widths / _LINES_PER_INDEPENDENT * np.log(2) ** 2, 1.0))

    @cached_property
    def heights(self) -> RealArray:
        """Level over the median of the neighbourhood, (b, l + c); 1 where there is no neighbourhood."""
        levels = self.levels if self.combined is None else np.hstack([self.levels, self.combined])
        logs = np.log(np.maximum(levels, np.finfo(float).tiny))
        count, ln_f = len(logs), np.log(self.frequencies)
        below = np.arange(count) - np.searchsorted(ln_f, ln_f - _NEIGHBOURHOOD)
        above = np.searchsorted(ln_f, ln_f + _NEIGHBOURHOOD) - 1 - np.arange(count)
        reach, i = np.clip(np.minimum(below, above), _MIN_NEIGHBOURS, _MAX_NEIGHBOURS), np.arange(count)
        reach = np.minimum(reach, np.minimum(i, i[::-1]))  # symmetric, so that slopes cancel
        heights = np.ones(logs.shape)
        for n in np.unique(reach[reach >= _MIN_NEIGHBOURS]):
            bins = np.flatnonzero(reach == n)
            around = np.median(logs[bins[:, None] + np.arange(-n, n + 1)], axis=1)
            heights[bins] = np.exp(np.minimum(logs[bins] - around, 50.0))
        return heights

    def limits(self, trials: int) -> RealArray:
        """Return the limit of chance for the height of each bin, (b,), where so many heights are tested in each.

        The mean of k lines is a gamma variable of shape k over k.
        """
        n = _AVERAGED_BINS * self.independent
        return np.maximum(special.gammainccinv(n, _FALSE_ALARM / max(len(n) * trials, 1)) / n, MIN_PEAK_RATIO)

    @cached_property
    def _averaged_heights(self) -> RealArray:
        """Means of the heights of three bins, (b, l + c); of the first and the last 1."""
        means = np.ones(self.heights.shape)
        if len(means) >= _AVERAGED_BINS:
            means[1:-1] = np.lib.stride_tricks.sliding_window_view(self.heights, _AVERAGED_BINS, axis=0).mean(axis=2)
        return means

    @cached_property
    def single_peaks(self) -> BoolArray:
        """Which bins belong to a peak of each output or combination, (b, l + c): the mean of three exceeds chance."""
        return np.asarray(self._averaged_heights > self.limits(self._averaged_heights.shape[1])[:, None])

    @cached_property
    def in_peak(self) -> BoolArray:
        """Which bins belong to a peak, (b,): the mean of three exceeds chance, in one output or in the mean of all."""
        return np.asarray(np.any(self.single_peaks, axis=1) | (self._averaged_heights.mean(axis=1) > self.limits(1)))

    def inside(self, band: tuple[float, float] | None) -> BoolArray:
        """Return which bins lie in a band (Hz), (b,); all where it is None."""
        low, high = (0.0, np.inf) if band is None else band
        return np.asarray((self.frequencies >= low) & (self.frequencies <= high))


def clear_peaks(levels: Levels) -> list[float]:
    """Return the frequencies (Hz) of peaks that rise ten times and more above the lower of the dips beside them, and above chance.

    They do so in three outputs, or in all where there are fewer. Of neighbouring bins the one with the highest mean level counts.
    """
    outputs = levels.levels.shape[1]
    logs = np.log(np.maximum(levels.levels, _LEAST_LEVEL * levels.levels.max(axis=0, initial=np.finfo(float).tiny)))
    count = np.zeros(len(logs))
    for own, tested in zip(logs.T, levels.single_peaks.T[:outputs], strict=True):
        top = scipy.signal.find_peaks(own, prominence=np.log(_CLEAR_HEIGHT))[0]
        near = np.zeros(len(logs), dtype=bool)
        near[np.clip(top[tested[top], None] + [-1, 0, 1], 0, len(logs) - 1)] = True
        count += near
    clear = np.flatnonzero(count >= min(_CLEAR_OUTPUTS, outputs))
    runs = np.split(clear, np.flatnonzero(np.diff(clear) > 1) + 1)
    mean = logs.mean(axis=1)
    return [float(levels.frequencies[run[np.argmax(mean[run])]]) for run in runs if run.size]


def levels_of(signals: Signals) -> Levels:
    """Return the spectral levels of the outputs of a record, averaged over runs, without straight lines."""
    return levels_in(Spectrum.of(signals))


def levels_in(spectrum: Spectrum, mixed: RealArray | None = None) -> Levels:
    """Return the spectral levels of a record from its spectrum, averaged over runs; of combinations of its channels, columns of `mixed`."""
    runs, lines, channels = spectrum.lines.shape if mixed is None else (*spectrum.lines.shape[:2], mixed.shape[1])
    edges = bin_edges(2, lines - 1, _MIN_BIN_LINES)  # the first lines hold the remainder of the straight line
    middles = (edges[:-1] + edges[1:] - 1) / 2 * spectrum.step
    values = np.empty((len(middles), channels))
    for few in few_channels(lines, channels, MANY_NUMBERS):
        parts = (x[:, few] if mixed is None else x @ mixed[:, few] for x in spectrum.lines)
        power = sum(x.real**2 + x.imag**2 for x in parts) / (spectrum.step * runs)
        for median, (a, b) in zip(values, itertools.pairwise(edges), strict=True):
            median[few] = np.median(power[a:b], axis=0)
    return Levels(middles, np.diff(edges).astype(float), values / np.log(2))


def bin_edges(first: int, end: int, least: int) -> IntArray:
    """Return the first lines of the bins that fit before `end`, and the end of the last: a hundredth of the frequency each, or `least`."""
    edges = [first]
    while (edge := edges[-1] + max(least, round(_BIN_WIDTH * edges[-1]))) <= end:
        edges.append(edge)
    return np.array(edges)


def component_levels(spectrum: Spectrum) -> Levels:
    """Return the spectral levels of the principal components of the channels, averaged over runs."""
    return levels_in(spectrum, _components(_covariance(spectrum)))


def _components(covariance: RealArray) -> RealArray:
    """Return the principal components of channels, each of size one, as columns: a weak mode has a peak in one of them.

    With D the root mean squares of the channels and D^-1 S D^-1 = V E V', these are D^-1 V E^-1/2.
    """
    C, size = normed_covariance(covariance)
    values, vectors = np.linalg.eigh(C)
    kept = values > _MIN_EIGENVALUE * max(float(values[-1]), np.finfo(float).tiny)
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]) / size[:, None])


def _covariance(spectrum: Spectrum) -> RealArray:
    """Return the covariance of the channels of a spectrum, summed over stretches of its lines: parts of complex numbers are copied."""
    lines = spectrum.lines.reshape(-1, spectrum.lines.shape[-1])
    parts = (lines[few] for few in few_channels(lines.shape[1], len(lines), MANY_NUMBERS))
    return np.asarray(sum(x.real.T @ x.real + x.imag.T @ x.imag for x in parts))


def whitening_of(record: Signals, references: Sequence[int], band: tuple[float, float] | None) -> Whitening | None:
    """Return the whitening of the outputs of a record and of the references among them; None for one output.

    Principal components without a peak in the band (Hz) are noise, which is not scaled up to modes: their eigenvalues are raised to the
    smallest one of a component with a peak.
    """
    if len(record.output_dofs) < 2:
        return None
    spectrum, every = Spectrum.of(record), list(range(len(record.output_dofs)))
    covariance = _covariance(spectrum)

    def whitened(chosen: list[int]) -> RealArray:
        S = covariance[np.ix_(chosen, chosen)]
        values = np.linalg.eigvalsh(normed_covariance(S)[0])
        levels = levels_in(spectrum, np.eye(len(every))[:, chosen] @ _components(S))
        has_peak = np.any(levels.single_peaks & levels.inside(band)[:, None], axis=0)
        least = values[-int(has_peak.size) :][has_peak].min() if has_peak.any() else values[-1]
        return whitening_matrix(S, float(least / max(values[-1], np.finfo(float).tiny)))

    W = whitened(every)
    return Whitening(W, W if list(references) == every else whitened(list(references)))


def noise_notes(levels: Levels, band: tuple[float, float] | None = None) -> tuple[Note, ...]:
    """Return a note where an unfiltered record has only noise in a band (Hz), or no peak.

    White noise has the same spectral level at all frequencies, within chance: with x_b the logarithm of the level of bin b and v_b its
    variance by the number of lines, sum_b (x_b - mean x)^2 / v_b is about the number of bins.
    """
    inside = levels.inside(band)
    if inside.sum() < _MIN_TESTED_BINS or np.any(levels.in_peak & inside):
        return ()
    low, high = levels.frequencies[inside][[0, -1]].tolist()
    kind, text = UNSEEN, f"No spectral peak in {figures(low)} to {figures(high)} Hz: only precise modes are reported"
    if _scatter(levels, inside) < _MAX_SCATTER:
        kind, text = NOISE, f"Only noise in {figures(low)} to {figures(high)} Hz: the spectrum is flat, without a peak"
    return (Note(kind, {"lowest_hz": low, "highest_hz": high}, text),)


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


def peak_heights(record: Signals, frequencies: ArrayLike, damping_ratios: ArrayLike) -> RealArray:
    """Return the height of the peak at every pole relative to its limit, (n,); infinity where it cannot be tested.

    S_i is the mean of Y Y* over the lines within h = f zeta (four lines at least), S_o over those from 1.5 h to 5 h on both sides. The
    largest lambda of S_i w = lambda S_o w is the height in the combination w of the outputs that shows it best, and
    r = 2 n (lambda - 1 - log lambda), n = n_i n_o / (n_i + n_o) / 1.5, its likelihood ratio, about chi-squared with 2 l degrees of
    freedom where there is no peak. The result is the larger of lambda / 2 and r over the quantile 1 - .01 / trials, as many
    trials as windows fit in the record's lines. Other modes in the surroundings lower it in their own combinations alone. Therefore a
    single output is not tested, nor are surroundings with fewer than four lines an output. A pole with a half bandwidth of less than a line
    has 1 at most: a sinusoid looks like that.

    `frequencies` (n,): Hz. `damping_ratios` (n,).
    """
    f, zeta = np.atleast_1d(np.asarray(frequencies, float)), np.atleast_1d(np.asarray(damping_ratios, float))
    if len(record.output_dofs) < 2:
        return np.full(f.size, np.inf)
    spectrum = Spectrum.of(record)
    X = spectrum.lines
    X /= np.sqrt(np.maximum(np.mean(np.abs(X) ** 2, axis=(0, 1)), np.finfo(float).tiny))
    widths = np.abs(f * zeta) / spectrum.step
    places = zip(f / spectrum.step, np.maximum(widths, _MIN_PEAK_LINES), strict=True)
    heights = np.array([_height(X, place, half) for place, half in places])
    return np.where((widths < 1) & np.isfinite(heights), np.minimum(heights, 1.0), heights)


def _height(X: ComplexArray, place: float, half: float) -> float:
    """Return the height of a peak at a place and with a half width in lines; lines (R, F, l)."""
    near, far = (width * half for width in _SURROUNDINGS)
    count, outputs = X.shape[1:]

    def between(low: float, high: float) -> IntArray:  # the first two lines hold the remainder of the straight line
        return np.arange(max(int(np.ceil(low)), 2), min(int(np.floor(high)), count - 1) + 1)

    peak = between(place - half, place + half)
    around = np.concatenate([between(place - far, place - near), between(place + near, place + far)])
    peak, around = (lines[:: -(-lines.size // _MAX_LINES)] if lines.size else lines for lines in (peak, around))
    n_i, n_o = (len(X) * lines.size for lines in (peak, around))
    if n_o < _LINES_PER_OUTPUT * outputs or not n_i:
        return float("inf")
    Y_i, Y_o = (X[:, lines].reshape(-1, outputs) for lines in (peak, around))
    S_i, S_o = (Y.T @ Y.conj() / len(Y) for Y in (Y_i, Y_o))
    try:
        height = float(sla.eigh(S_i, S_o, eigvals_only=True, subset_by_index=[outputs - 1, outputs - 1])[0])
    except np.linalg.LinAlgError:
        return float("inf")
    n = n_i * n_o / (n_i + n_o) / _LINES_PER_INDEPENDENT
    ratio = 2 * n * (height - 1 - np.log(height)) if height > 1 else 0.0
    trials = max(count / (2 * half), 1.0)
    return float(max(height / _CERTAIN_HEIGHT, ratio / special.chdtri(2 * outputs, _CHANCE_OF_ANY / trials)))


def peaks_of_spectra(records: Signals | StoredSignals, poles: Array) -> dict[str, RealArray]:
    """Return the peak height of a record's spectra at each pole (rad/s), as an indicator."""
    f, zeta = frequencies_and_damping(poles)
    return {PEAK: peak_heights(records.excerpt(), f, zeta)}
