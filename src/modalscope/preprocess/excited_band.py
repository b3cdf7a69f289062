"""Up to where lines of records hold resonances: beyond, what the inputs do is smooth, and all else is noise.

On a few lines side by side, from a to b, any response and the ends of a run are polynomials of a low degree,

    Y(f) = sum_(d <= D) f^d (G_d U(f) + t_d) + noise,

and least squares leave the noise. Over a tenth of the frequency and more they still do so above all modes, where the response is a mass
line or falls off; a resonance is no such polynomial, so that what is left over a wide range, beside what is left over narrow ones, stands
out of the noise wherever there is one, resolved by the lines or not.
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
from modalscope.preprocess.bands import CHOSEN
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.impacts import find_hits

__all__ = ["Left", "left_over", "resonant_band", "struck_band", "swept_lines", "useful_lines"]


# --------------------------------------------------------------------------------------------------------- driven band
# Lines into which hits and sweeps put a force: those on which what they estimate means something.

#: Useful lines have at least this part of the largest power of the force.
_USEFUL = 0.01

#: A band that reaches this part of half the sampling rate is left as it is.
_WHOLE = 0.8

#: Lines on which a pulse is looked at: it is short, so that its spectrum is smooth.
_DRIVEN_LINES = 1025


def struck_band(
    parts: Sequence[Signals], asked: tuple[float, float] | None = None
) -> tuple[tuple[float, float], Note] | None:
    """Return the band into which the hits of a hammer put a hundredth of their largest power or more, and what is said of it.

    Beyond, a response is noise over next to nothing, and what is sampled far beyond what was struck would drown its modes in it. None where
    that band is nearly the whole, or where not every part is hits. A band that was asked is kept; one that holds both sides of that end is
    named.

    Parameters
    ----------
    parts : sequence of Signals
        Those of one hammer, at one place each.
    asked : (float, float), optional
        Hz.
    """
    if not all(len(part.input_dofs) == 1 and find_excitation(part) == "impact" for part in parts):
        return None
    half = parts[0].sampling_rate / 2
    highest = max(_highest(part) for part in parts)
    high = float(f"{highest:.{_DIGITS}g}")
    if highest >= _WHOLE * half or (asked is not None and not asked[0] < high < _WHOLE * asked[1]):
        return None
    little = "the hits put in less than a hundredth of their largest power"
    own = f"modes above want a band of their own, such as --band {high:g} {min(2 * high, half):g} (band=...)"
    if asked is not None:
        hides = "what is noise there may hide the modes below"
        text = f"above {high:g} Hz {little}: {hides}; without a band that end is chosen, and {own}"
        return asked, Note("band past the hits", {"highest_hz": high}, text)
    text = f"the band up to {high:g} Hz was chosen: above, {little}; {own}"
    return (0.0, high), Note(CHOSEN, {"lowest_hz": 0.0, "highest_hz": high, "parts": 1.0}, text)


def _highest(part: Signals) -> float:
    """Return the highest useful line, Hz; half the sampling rate where there is no good hit."""
    lines = np.linspace(0.0, part.sampling_rate / 2, _DRIVEN_LINES)
    return float(lines[useful_lines(part, lines)][-1])


def useful_lines(signals: Signals, frequencies: RealArray) -> Array:
    """Return the lines into which good hits put a hundredth of their largest power or more; all where none is good."""
    power = _power_of_hits(signals, frequencies)
    return np.asarray(power >= _USEFUL * np.max(power))


def _power_of_hits(signals: Signals, frequencies: RealArray) -> RealArray:
    """Return the power of the good hits' first pulses on lines; zeros where none is good."""
    _, inputs = signals.by_run()
    assert inputs is not None
    hits = [hit for hit in find_hits(inputs[:, :, 0]) if not hit.unfit]
    pulses = [inputs[h.run, h.start : h.stop, 0] - np.median(inputs[h.run, :, 0]) for h in hits]
    phase = np.arange(max((p.size for p in pulses), default=0)) / signals.sampling_rate
    turn = np.exp(-2j * np.pi * np.outer(frequencies, phase))
    return sum((np.abs(turn[:, : p.size] @ p) ** 2 for p in pulses), np.zeros(len(frequencies)))


def swept_lines(signals: Signals, frequencies: RealArray) -> Array:
    """Return the lines into which sweeps put a hundredth of their largest power or more, smoothed over a hundredth of the band."""
    _, inputs = signals.by_run()
    assert inputs is not None
    power = np.sum(np.abs(fft.rfft(inputs - inputs.mean(axis=1, keepdims=True), axis=1)) ** 2, axis=(0, 2))
    width = max(len(power) // 100, 1)
    smooth = scipy.signal.oaconvolve(power, np.ones(width) / width, mode="same")
    own = np.interp(frequencies, fft.rfftfreq(signals.samples, 1 / signals.sampling_rate), smooth)
    return np.asarray(own >= _USEFUL * smooth.max())


# ------------------------------------------------------------------------------------------------------- resonant band

#: Degrees over a narrow range and over a wide one.
_NARROW, _WIDE = 2, 4

#: A narrow range (a bin) is this part of its frequency, and has so many lines for every unknown at least.
_WIDTH, _LINES = 0.01, 4

#: A wide range reaches so far on either side of its middle, which is as wide, as a part of the frequency, and over a bin at least.
_REACH = 0.1

#: The noise is the median of so many bins on either side.
_AROUND = 20

#: In one record without resonances in so many something stands out; nothing does that is below this ratio: noise has slopes.
_CHANCE, _LEAST = 1e-3, 1.2

#: Bins that are looked at one by one and together.
_TOGETHER = (1, 3)

#: The band reaches beyond what stands out by this factor, and is chosen where half the rate lies beyond its end by this one.
_ABOVE, _FAR = 1.25, 2.0

#: Directions of inputs below this part of the largest are none.
_ALIKE = 1e-10

#: Significant digits of a band's end.
_DIGITS = 3


class Left(NamedTuple):
    """What polynomials leave of the outputs of a run, in bins.

    Attributes
    ----------
    highest : array, (b,)
        The last line of each bin, Hz.
    free : array, (b,)
        Lines of each without unknowns of its own.
    narrow, wide : array, (b, l)
        Mean squares that are left of every output by the bin alone and by its surroundings; of white noise its power.
    """

    highest: RealArray
    free: RealArray
    narrow: RealArray
    wide: RealArray

    @property
    def stands_out(self) -> BoolArray:
        """In which bins more is left over a wide range than noise leaves, (b,): in one output, or in the mean of all."""
        tiny = np.finfo(float).tiny
        around = np.median(_windows(np.log(np.maximum(self.narrow, tiny)), _AROUND), axis=2)
        heights = np.exp(np.clip(np.log(np.maximum(self.wide, tiny)) - around, -50.0, 50.0))
        found, outputs = np.zeros(len(heights), bool), heights.shape[1]
        for together in _TOGETHER:
            if len(heights) < together:
                break
            high = sliding_window_view(heights, together, axis=0).mean(axis=2)
            free = sliding_window_view(self.free, together).sum(axis=1)
            chance = _CHANCE / (len(_TOGETHER) * len(high))
            own, all_ = _bar(free, chance / outputs), _bar(outputs * free, chance)
            middle = slice(together // 2, together // 2 + len(high))
            found[middle] |= np.any(high > own[:, None], axis=1) | (high.mean(axis=1) > all_)
        return found


def resonant_band(spectra: RecordSpectra) -> tuple[tuple[float, float], Note] | None:
    """Return the band up to 1.25 times the highest frequency at which resonances stand out, and what is said of it.

    Lines above all modes would take most of the degree of a model. None where half the sampling rate is less than twice as high, and where
    nothing stands out.

    Parameters
    ----------
    spectra : RecordSpectra
        All lines of the records.

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
    runs = [left_over(spectra, own) for own in spectra.spans_of_runs]
    shown = [run.highest[run.stands_out] for run in runs]
    highest = max((float(each[-1]) for each in shown if each.size), default=0.0)
    high = float(f"{_ABOVE * highest:.{_DIGITS}g}")
    if not 0 < _FAR * high < spectra.sampling_rate / 2:
        return None
    text = (
        f"the band up to {high:g} Hz was chosen: resonances stand out of the noise up to {highest:.3g} Hz, and lines far above them, "
        f"up to {spectra.sampling_rate / 2:g} Hz, would take most of the degree"
    )
    return (0.0, high), Note(CHOSEN, {"lowest_hz": 0.0, "highest_hz": high, "parts": 1.0}, text)


def left_over(spectra: RecordSpectra, own: slice) -> Left:
    """Return what polynomials of the frequency leave of the outputs of a run, in bins; no bin where there are too few lines.

    Parameters
    ----------
    own : slice
        The lines of the run.
    """
    drive = spectra.drive[own]
    power = np.einsum("fi,fi->i", drive.real, drive.real) + np.einsum("fi,fi->i", drive.imag, drive.imag)
    used = np.flatnonzero(power > 0)
    size = np.sqrt(power[used] / max(len(drive), 1))
    edges = _edges(len(drive), _LINES * (_NARROW + 1) * (1 + used.size))

    def lines(a: int, b: int, low: int, high: int, degree: int) -> tuple[ComplexArray, ComplexArray]:
        """Return x^d [1, U] and the outputs on lines a to b, x from -1 to 1 between the lines low and high."""
        x = 2 * (np.arange(a, b) - low) / max(high - low - 1, 1) - 1
        channels = np.hstack([np.ones((b - a, 1)), drive[a:b, used] / size])
        powers = np.polynomial.legendre.legvander(x, degree)
        columns = (powers[:, :, None] * channels[:, None, :]).reshape(b - a, -1)
        return columns, spectra.values[own.start + a : own.start + b, :, 0]

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
    highest = spectra.frequencies[own][edges[1:] - 1] if bins else np.zeros(0)
    return Left(highest, free, narrow, wide)


def _edges(count: int, least: int) -> IntArray:
    """Return the first lines of bins and the end of the last."""
    edges = [0]
    while (end := edges[-1] + max(least, round(_WIDTH * edges[-1]))) <= count:
        edges.append(end)
    return np.array(edges)


def _ranges(edges: IntArray) -> Iterator[tuple[slice, slice]]:
    """Yield the bins of the middle of every wide range, and all of its bins."""
    start, bins, far = 0, len(edges) - 1, 1 + _REACH
    while start < bins:
        stop = max(int(np.searchsorted(edges, far * edges[start], side="right")) - 1, start + 1)
        low = min(int(np.searchsorted(edges, edges[start] / far)), start - 1)
        high = max(int(np.searchsorted(edges, far * edges[stop])), stop + 1)
        yield slice(start, stop), slice(max(low, 0), min(high, bins))
        start = stop


def _solved(parts: Iterable[tuple[ComplexArray, ComplexArray]]) -> tuple[ComplexArray, ComplexArray]:
    """Return the inverse of the columns' Gram matrix, without directions that are none, and the least squares of the outputs by them."""
    sums = [(columns.conj().T @ columns, columns.conj().T @ values) for columns, values in parts]
    gram, beside = (np.sum(each, axis=0) for each in zip(*sums, strict=True))
    inverse = np.asarray(np.linalg.pinv(gram, rcond=_ALIKE, hermitian=True), dtype=complex)
    return inverse, np.asarray(inverse @ beside)


def _power(left: ComplexArray) -> RealArray:
    """Return the sum of squares of every output, (l,)."""
    return np.asarray(np.einsum("fo,fo->o", left.real, left.real) + np.einsum("fo,fo->o", left.imag, left.imag))


def _windows(values: RealArray, reach: int) -> RealArray:
    """Return the values of so many bins on either side of each, (b, l, 2 reach + 1), beyond the ends those inside as in a mirror."""
    reach = min(reach, max(len(values) - 1, 0))
    return sliding_window_view(np.pad(values, ((reach, reach), (0, 0)), mode="reflect"), 2 * reach + 1, axis=0)


def _bar(free: RealArray, chance: float) -> RealArray:
    """Return what chance allows for the mean square of so many lines of noise over its expectation."""
    return np.maximum(special.gammainccinv(free, chance) / free, _LEAST)
