"""Find the band that was excited: by hits and sweeps from their force, of records on lines from the resonances in them.

On a few adjacent lines, from a to b, any response and the transients of a run are polynomials of a low degree,

    Y(f) = sum_(d <= D) f^d (G_d U(f) + t_d) + noise,

and the residual of least squares is the noise. This also holds over a tenth of the frequency above all modes, where the response is a mass
line or falls off. A resonance is no such polynomial: there the residual over a wide range exceeds that over narrow ones, whether the lines
resolve it or not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from scipy import fft, special

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Signals
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, IntArray, RealArray
from modalscope.preprocess.bands import CHOSEN, bin_edges, rounded
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.impacts import find_hits

# ---------------------------------------------------------------------------------------------- band of hits and sweeps

#: Useful lines have at least this part of the largest power of the force.
_USEFUL = 0.01

#: A band that reaches this part of half the sampling rate is not cut.
_WHOLE = 0.8

#: Lines of the spectrum of a pulse, which is smooth.
_DRIVEN_LINES = 1025


def struck_band(
    parts: Sequence[Signals], asked: tuple[float, float] | None = None
) -> tuple[tuple[float, float], Note] | None:
    """Return the band (Hz) into which the hits of a hammer put a hundredth of their largest power or more, and a note.

    Beyond, a response is noise over hardly any force, and would hide the modes in it. None where that band is nearly the whole, or where
    not every part (each of one place of the hammer) is hits. A band that was asked is kept, and noted where it contains that end.
    """
    if not all(len(part.input_dofs) == 1 and find_excitation(part) == "impact" for part in parts):
        return None
    half = parts[0].sampling_rate / 2
    lines = np.linspace(0.0, half, _DRIVEN_LINES)
    highest = max(float(lines[useful_lines(part, lines)][-1]) for part in parts)
    high = rounded(highest)
    if highest >= _WHOLE * half or (asked is not None and not asked[0] < high < _WHOLE * asked[1]):
        return None
    little = "the hits put in less than a hundredth of their largest power"
    other = f"modes above need another band, such as --band {high:g} {min(2 * high, half):g} (band=...)"
    if asked is not None:
        hides = "noise there may hide the modes below"
        text = f"above {high:g} Hz {little}: {hides}; without a band that end is chosen, and {other}"
        return asked, Note("band past the hits", {"highest_hz": high}, text)
    text = f"the band up to {high:g} Hz was chosen: above, {little}; {other}"
    return (0.0, high), Note(CHOSEN, {"lowest_hz": 0.0, "highest_hz": high, "parts": 1.0}, text)


def useful_lines(signals: Signals, frequencies: RealArray) -> Array:
    """Return the lines into which good hits put a hundredth of their largest power or more; all where none is good."""
    _, inputs = signals.by_run()
    assert inputs is not None
    hits = [hit for hit in find_hits(inputs[:, :, 0]) if not hit.unfit]
    pulses = [inputs[h.run, h.start : h.stop, 0] - np.median(inputs[h.run, :, 0]) for h in hits]
    phase = np.arange(max((p.size for p in pulses), default=0)) / signals.sampling_rate
    turn = np.exp(-2j * np.pi * np.outer(frequencies, phase))
    power = sum((np.abs(turn[:, : p.size] @ p) ** 2 for p in pulses), np.zeros(len(frequencies)))
    return np.asarray(power >= _USEFUL * np.max(power))


def swept_lines(signals: Signals, frequencies: RealArray) -> Array:
    """Return the lines into which sweeps put a hundredth of their largest power or more, smoothed over a hundredth of the band."""
    _, inputs = signals.by_run()
    assert inputs is not None
    power = np.sum(np.abs(fft.rfft(inputs - inputs.mean(axis=1, keepdims=True), axis=1)) ** 2, axis=(0, 2))
    width = max(len(power) // 100, 1)
    smooth = scipy.signal.oaconvolve(power, np.ones(width) / width, mode="same")
    at_lines = np.interp(frequencies, fft.rfftfreq(signals.samples, 1 / signals.sampling_rate), smooth)
    return np.asarray(at_lines >= _USEFUL * smooth.max())


# -------------------------------------------------------------------------------------------------- band of resonances

#: Degrees over a narrow range and over a wide one.
_NARROW, _WIDE = 2, 4

#: Least lines of a narrow range (a bin) for every unknown.
_LINES = 4

#: A wide range extends so far on either side of its middle, which is as wide, as a part of the frequency, and over a bin at least.
_REACH = 0.1

#: The noise is the median of so many bins on either side.
_AROUND = 20

#: Probability of a peak in a record without resonances, and the least ratio of a peak: noise has slopes.
_CHANCE, _LEAST = 1e-3, 1.2

#: Adjacent bins that are averaged.
_ADJACENT = (1, 3)

#: The band extends beyond the highest peak by this factor, and is chosen where half the rate lies beyond its end by this one.
_ABOVE, _FAR = 1.25, 2.0

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
        around = np.median(_windows(np.log(np.maximum(self.narrow, tiny)), _AROUND), axis=2)
        heights = np.exp(np.clip(np.log(np.maximum(self.wide, tiny)) - around, -50.0, 50.0))
        found, outputs = np.zeros(len(heights), bool), heights.shape[1]
        for adjacent in _ADJACENT:
            if len(heights) < adjacent:
                break
            high = sliding_window_view(heights, adjacent, axis=0).mean(axis=2)
            free = sliding_window_view(self.free, adjacent).sum(axis=1)
            chance = _CHANCE / (len(_ADJACENT) * len(high))
            single, mean = _limit(free, chance / outputs), _limit(outputs * free, chance)
            middle = slice(adjacent // 2, adjacent // 2 + len(high))
            found[middle] |= np.any(high > single[:, None], axis=1) | (high.mean(axis=1) > mean)
        return found


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
    shown = [run.highest[run.in_peak] for run in runs]
    highest = max((float(each[-1]) for each in shown if each.size), default=0.0)
    high = rounded(_ABOVE * highest)
    if not 0 < _FAR * high < spectra.sampling_rate / 2:
        return None
    text = (
        f"the band up to {high:g} Hz was chosen: resonances exceed the noise up to {highest:.3g} Hz, and lines far above them, "
        f"up to {spectra.sampling_rate / 2:g} Hz, would take most of the degree"
    )
    return (0.0, high), Note(CHOSEN, {"lowest_hz": 0.0, "highest_hz": high, "parts": 1.0}, text)


def polynomial_residuals(spectra: RecordSpectra, run: slice) -> Residuals:
    """Return the residuals of the outputs from polynomials of the frequency on the lines of a run, in bins; none with too few lines."""
    drive = spectra.drive[run]
    power = _power(drive)
    used = np.flatnonzero(power > 0)
    size = np.sqrt(power[used] / max(len(drive), 1))
    edges = bin_edges(0, len(drive), _LINES * (_NARROW + 1) * (1 + used.size))

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
        every = [(edges[k], edges[k + 1]) for k in range(around.start, around.stop)]
        inverse, solution = _solved(lines(a, b, low, high, _WIDE) for a, b in every)
        for k in range(middle.start, middle.stop):
            a, b = edges[k], edges[k + 1]
            columns, values = lines(a, b, a, b, _NARROW)
            Q = np.linalg.qr(columns)[0]
            free[k] = b - a - Q.shape[1]
            narrow[k] = _power(values - Q @ (Q.conj().T @ values)) / free[k]
            columns, values = lines(a, b, low, high, _WIDE)
            taken = float(np.sum(inverse * (columns.conj().T @ columns).T).real)
            wide[k] = _power(values - columns @ solution) / max(b - a - taken, 1.0)
    highest = spectra.frequencies[run][edges[1:] - 1] if bins else np.zeros(0)
    return Residuals(highest, free, narrow, wide)


def _ranges(edges: IntArray) -> Iterator[tuple[slice, slice]]:
    """Yield the bins in the middle of every wide range, and all of its bins."""
    start, bins, far = 0, len(edges) - 1, 1 + _REACH
    while start < bins:
        stop = max(int(np.searchsorted(edges, far * edges[start], side="right")) - 1, start + 1)
        low = min(int(np.searchsorted(edges, edges[start] / far)), start - 1)
        high = max(int(np.searchsorted(edges, far * edges[stop])), stop + 1)
        yield slice(start, stop), slice(max(low, 0), min(high, bins))
        start = stop


def _solved(parts: Iterable[tuple[ComplexArray, ComplexArray]]) -> tuple[ComplexArray, ComplexArray]:
    """Return the pseudo-inverse of the columns' Gram matrix, and the least-squares solution for the outputs."""
    sums = [(columns.conj().T @ columns, columns.conj().T @ values) for columns, values in parts]
    gram, products = (np.sum(each, axis=0) for each in zip(*sums, strict=True))
    inverse = np.asarray(np.linalg.pinv(gram, rcond=_RANK, hermitian=True), dtype=complex)
    return inverse, np.asarray(inverse @ products)


def _power(x: ComplexArray) -> RealArray:
    """Return the sum of squares of every column."""
    return np.asarray(np.einsum("fo,fo->o", x.real, x.real) + np.einsum("fo,fo->o", x.imag, x.imag))


def _windows(values: RealArray, reach: int) -> RealArray:
    """Return the values of so many bins on either side of each, (b, l, 2 reach + 1), mirrored at the ends."""
    reach = min(reach, max(len(values) - 1, 0))
    return sliding_window_view(np.pad(values, ((reach, reach), (0, 0)), mode="reflect"), 2 * reach + 1, axis=0)


def _limit(free: RealArray, chance: float) -> RealArray:
    """Return the limit of chance for the mean square of noise over its expectation, with so many degrees of freedom."""
    return np.maximum(special.gammainccinv(free, chance) / free, _LEAST)
