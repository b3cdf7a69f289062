"""Choose the band of records on lines by the resonances in them: where polynomials of the frequency leave more than noise.

On a few adjacent lines, from a to b, any response and the transients of a run are polynomials of a low degree,

    Y(f) = sum_(d <= D) f^d (G_d U(f) + t_d) + noise,

and the residual of least squares is the noise. This also holds over a tenth of the frequency above all modes, where the response is a mass
line or falls off. A resonance is no such polynomial: there the residual over a wide range exceeds that over narrow ones, whether the lines
resolve it or not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import special

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.shown import figures
from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray
from modalscope.signals.preprocess.bands import band_up_to, rounded
from modalscope.signals.preprocess.spectral_peaks import bin_edges

#: Degrees over a narrow range and over a wide one.
_NARROW_DEGREE, _WIDE_DEGREE = 2, 4

#: Minimum lines of a narrow range (a bin) for every unknown.
_LINES_PER_UNKNOWN = 4

#: A wide range extends by this part of the frequency on either side of its middle, which is as wide, and by a bin at least.
_WIDE_REACH = 0.1

#: The noise is the median of so many bins on either side.
_NOISE_BINS = 20

#: Probability of a peak in a record without resonances, and the minimum ratio of a peak: noise has slopes.
_FALSE_ALARM, _MIN_PEAK_RATIO = 1e-3, 1.2

#: Adjacent bins that are averaged.
_AVERAGED_BINS = (1, 3)

#: Upper end of the band over the highest peak, and half the rate over that end from which on it is chosen.
_HIGH_END, _MIN_EXCESS = 1.25, 2.0

#: Directions of inputs below this part of the largest are rounding.
_RANK = 1e-10


class Residuals(NamedTuple):
    """Residuals of polynomials of the outputs of a run, in b bins: mean squares (b, l), of white noise its power."""

    highest: RealArray  # the last line of each bin, Hz
    free: RealArray  # degrees of freedom of each
    narrow: RealArray  # of every output from the bin alone
    wide: RealArray  # from its surroundings

    @property
    def in_peak(self) -> BoolArray:
        """In which bins the residual over a wide range exceeds the noise, (b,): in one output, or in the mean of all."""
        if not len(self.narrow):  # runs of too few lines
            return np.zeros(0, bool)
        tiny = np.finfo(float).tiny
        around = np.median(_windows(np.log(np.maximum(self.narrow, tiny)), _NOISE_BINS), axis=2)
        heights = np.exp(np.clip(np.log(np.maximum(self.wide, tiny)) - around, -50.0, 50.0))
        in_peak, outputs = np.zeros(len(heights), bool), heights.shape[1]
        for adjacent in _AVERAGED_BINS:
            if len(heights) < adjacent:
                break
            high = sliding_window_view(heights, adjacent, axis=0).mean(axis=2)
            free = sliding_window_view(self.free, adjacent).sum(axis=1)
            chance = _FALSE_ALARM / (len(_AVERAGED_BINS) * len(high))
            single, mean = _limit(free, chance / outputs), _limit(outputs * free, chance)
            middle = slice(adjacent // 2, adjacent // 2 + len(high))
            in_peak[middle] |= np.any(high > single[:, None], axis=1) | (high.mean(axis=1) > mean)
        return in_peak


def resonant_band(spectra: RecordSpectra) -> tuple[tuple[float, float], Note] | None:
    """Return the band (Hz) up to 1.25 times the highest frequency with resonances above the noise, and a note, from all lines of records.

    Lines above all modes would take most of the degree of a model. None where half the sampling rate is less than twice as high, and
    without resonances.

    Examples
    --------
    >>> from modalscope.data import Records
    >>> from modalscope.data.record_transform import record_spectra
    >>> from modalscope.systems import chain5
    >>> run = chain5().simulate(inputs="white", samples=12_000, sampling_rate=100.0, noise=0.01, seed=0)
    >>> band, note = resonant_band(record_spectra(Records(runs=(run,))))
    >>> bool(chain5().modes().frequencies.max() < band[1] < 12)
    True
    """
    if spectra.sampling_rate is None:
        return None
    runs = [polynomial_residuals(spectra, lines) for lines in spectra.spans_of_runs]
    peaks = [run.highest[run.in_peak] for run in runs]
    highest = max((float(lines[-1]) for lines in peaks if lines.size), default=0.0)
    high = rounded(_HIGH_END * highest)
    if not 0 < _MIN_EXCESS * high < spectra.sampling_rate / 2:
        return None
    return band_up_to(high, f"no resonance above {figures(highest)} Hz")


def polynomial_residuals(spectra: RecordSpectra, run: slice) -> Residuals:
    """Return the residuals of the outputs from polynomials of the frequency on the lines of a run, in bins; none with too few lines."""
    drive = spectra.drive[run]
    power = _power(drive)
    used = np.flatnonzero(power > 0)
    size = np.sqrt(power[used] / max(len(drive), 1))
    edges = bin_edges(0, len(drive), _LINES_PER_UNKNOWN * (_NARROW_DEGREE + 1) * (1 + used.size))

    def lines(a: int, b: int, low: int, high: int, degree: int) -> tuple[ComplexArray, ComplexArray]:
        """Return x^d [1, U] and the outputs on lines a to b, x from -1 to 1 between the lines low and high."""
        x = 2 * (np.arange(a, b) - low) / max(high - low - 1, 1) - 1
        channels = np.hstack([np.ones((b - a, 1)), drive[a:b, used] / size])
        powers = np.polynomial.legendre.legvander(x, degree)
        columns = np.asarray((powers[:, :, None] * channels[:, None, :]).reshape(b - a, -1), dtype=complex)
        return columns, spectra.values[run.start + a : run.start + b, :, 0]

    bins, outputs = max(len(edges) - 1, 0), spectra.values.shape[1]
    narrow, wide, free = np.empty((bins, outputs)), np.empty((bins, outputs)), np.empty(bins)
    for middle, around in _ranges(edges):
        low, high = edges[around.start], edges[around.stop]
        pairs = [(edges[k], edges[k + 1]) for k in range(around.start, around.stop)]
        inverse, solution = _solved(lines(a, b, low, high, _WIDE_DEGREE) for a, b in pairs)
        for k in range(middle.start, middle.stop):
            a, b = edges[k], edges[k + 1]
            columns, values = lines(a, b, a, b, _NARROW_DEGREE)
            Q = np.linalg.qr(columns)[0]
            free[k] = b - a - Q.shape[1]
            narrow[k] = _power(values - Q @ (Q.conj().T @ values)) / free[k]
            columns, values = lines(a, b, low, high, _WIDE_DEGREE)
            used_freedom = float(np.sum(inverse * (columns.conj().T @ columns).T).real)
            wide[k] = _power(values - columns @ solution) / max(b - a - used_freedom, 1.0)
    highest = spectra.frequencies[run][edges[1:] - 1] if bins else np.zeros(0)
    return Residuals(highest, free, narrow, wide)


def _ranges(edges: IntArray) -> Iterator[tuple[slice, slice]]:
    """Yield the bins in the middle of every wide range, and all of its bins."""
    start, bins, far = 0, len(edges) - 1, 1 + _WIDE_REACH
    while start < bins:
        stop = max(int(np.searchsorted(edges, far * edges[start], side="right")) - 1, start + 1)
        low = min(int(np.searchsorted(edges, edges[start] / far)), start - 1)
        high = max(int(np.searchsorted(edges, far * edges[stop])), stop + 1)
        yield slice(start, stop), slice(max(low, 0), min(high, bins))
        start = stop


def _solved(parts: Iterable[tuple[ComplexArray, ComplexArray]]) -> tuple[ComplexArray, ComplexArray]:
    """Return the pseudo-inverse of the columns' Gram matrix, and the least-squares solution for the outputs."""
    sums = [(columns.conj().T @ columns, columns.conj().T @ values) for columns, values in parts]
    gram, products = (np.sum(terms, axis=0) for terms in zip(*sums, strict=True))
    inverse = np.linalg.pinv(gram, rcond=_RANK, hermitian=True)
    return inverse, inverse @ products


def _power(x: ComplexArray) -> RealArray:
    """Return the sum of squares of every column."""
    return np.asarray(np.einsum("fo,fo->o", x.real, x.real) + np.einsum("fo,fo->o", x.imag, x.imag))


def _windows(values: RealArray, reach: int) -> RealArray:
    """Return the values of so many bins on either side of each, (b, l, 2 reach + 1), mirrored at the ends."""
    reach = min(reach, max(len(values) - 1, 0))
    return sliding_window_view(np.pad(values, ((reach, reach), (0, 0)), mode="reflect"), 2 * reach + 1, axis=0)


def _limit(free: RealArray, chance: float) -> RealArray:
    """Return the limit of chance for the mean square of noise over its expectation, with so many degrees of freedom."""
    return np.maximum(special.gammainccinv(free, chance) / free, _MIN_PEAK_RATIO)
