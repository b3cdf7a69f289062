"""Find harmonics of rotating machines in a record: narrow bands whose envelope is steadier than that of random vibration.

Around a frequency the outputs are z(t) exp(j 2 pi f t). Random vibration, however narrow its band, has |z|^2 that is exponential; a
harmonic has a constant |z|, at constant speed and at one that wanders. For n independent values the ratio of arithmetic to geometric
mean,

    g = ln mean |z|^2 - mean ln |z|^2        (.577 for random vibration, 0 for a harmonic; Bartlett's and Moran's statistic)

separates them: 2 n g is nearly chi-square with n - 1 degrees of freedom for random vibration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike
from scipy import fft, special

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.shown import percent
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.signals.preprocess.spectra import Spectrum

#: Minimum damping ratio of a structure: a narrower resonance cannot be distinguished from a harmonic.
MIN_DAMPING = 0.001

_TINY = float(np.finfo(float).tiny)

#: Minimum number of lines of a band, and the part of a run that is excluded at either end.
MIN_BAND_LINES, _ENDS = 12, 0.15

#: The kind of the notes that name harmonics.
HARMONIC = "harmonic"

#: Widths of the tested bands, as parts of their frequency: harmonics at constant speed, and at one that wanders.
_BAND_WIDTHS = (0.01, 0.025)

#: Probability of a harmonic in a record of random vibration.
_FALSE_ALARM = 1e-3

#: Maximum relative deviation of a harmonic from the multiple of a shaft that it is taken for.
_MULTIPLE_TOLERANCE = 0.003

#: Multiples and divisors of harmonics that are tried; the probability limit for them, and their maximum spread over that of the harmonics.
_MAX_MULTIPLE, _MAX_DIVISOR, _FALSE_ALARM_OF_MULTIPLE, _MAX_SPREAD_RATIO = 8, 3, 0.01, 1.5

#: Mains frequencies in Hz, and their relative deviation.
_MAINS, _MAINS_TOLERANCE = (50.0, 60.0), 0.002


class Narrow(NamedTuple):
    """A narrow band of a record, shifted to zero frequency, in the combination of outputs with most of its power."""

    first: int  # its first line
    values: ComplexArray  # z(t)
    independent: float  # number of independent values in random vibration of this spectrum
    centre: float  # mean of the frequency, weighted by power, Hz
    spread: float  # its standard deviation, Hz
    power: float  # mean square in the band, the sum of all outputs

    @property
    def chance(self) -> float:
        """The probability of an envelope as steady as this in random vibration."""
        return _chance(float(_unsteadiness(self.values)), self.independent)


def _band(spectrum: Spectrum, first: int, lines: ComplexArray, combined: ComplexArray, values: ComplexArray) -> Narrow:
    """Return a band from its lines (runs, n, l), their combination (runs, n) with most power, and its z(t)."""
    power = np.sum(np.abs(combined) ** 2, axis=0)
    f = (first + np.arange(power.size)) * spectrum.step
    weight = power / power.sum()
    centre = float(f @ weight)
    spread = float(np.sqrt(max((f - centre) ** 2 @ weight, 0.0)))
    independent = _independent(power, spectrum.step, centre, _seconds(spectrum))
    return Narrow(first, values, independent, centre, spread, float(np.sum(np.abs(lines) ** 2)))


def _seconds(spectrum: Spectrum) -> float:
    """Return the length of all runs without their ends."""
    return float((1 - 2 * _ENDS) * len(spectrum.lines) / spectrum.step)


def narrow_band(spectrum: Spectrum, frequency: float, width: float) -> Narrow | None:
    """Return a band of a record around a frequency (Hz); None where it has too few lines."""
    (first,), (count,) = lines_around(spectrum, np.array([frequency]), width)
    if not count:
        return None
    cut = spectrum.lines[:, first : first + count]
    combined = cut @ _strongest(cut.reshape(-1, cut.shape[2]))
    return _band(spectrum, int(first), cut, combined, _values(combined).ravel())


def lines_around(spectrum: Spectrum, frequencies: RealArray, widths: ArrayLike) -> tuple[IntArray, IntArray]:
    """Return the first lines of bands (Hz) and how many each has; 0 of those that have too few, or reach beyond the last line."""
    half = np.asarray(widths) / 2
    first = np.maximum(np.ceil((frequencies - half) / spectrum.step), 1).astype(int)
    last = ((frequencies + half) / spectrum.step).astype(int)
    count = last - first + 1
    return first, np.where((count < MIN_BAND_LINES) | (last >= spectrum.lines.shape[1]), 0, count)


def steady_bands(spectrum: Spectrum, first: IntArray, count: IntArray, chance: float) -> list[Narrow]:
    """Return the bands whose probability may be below a given one, a thousandth or less; `count` is at least `MIN_BAND_LINES`."""
    cuts = [spectrum.lines[:, a : a + n] for a, n in zip(first.tolist(), count.tolist(), strict=True)]
    combined = [cut @ _strongest(cut.reshape(-1, cut.shape[2])) for cut in cuts]
    limits, bands = _max_unsteadiness(spectrum, first, count, chance), {}
    for n in np.unique(count):  # one transform for bands of as many lines
        alike = np.flatnonzero(count == n)
        values = _values(np.stack([combined[i] for i in alike])).reshape(alike.size, -1)
        for j in np.flatnonzero(_unsteadiness(values) < limits[alike]):
            i = int(alike[j])
            bands[i] = _band(spectrum, int(first[i]), cuts[i], combined[i], values[j])
    return [bands[i] for i in sorted(bands)]


def _values(combined: ComplexArray) -> ComplexArray:
    """Return z(t) in the middle of every run from the lines of a combination of outputs, (..., n)."""
    inside, window = _middle(combined.shape[-1])
    return np.asarray(fft.ifft(combined, axis=-1)[..., inside] / window)


def _max_unsteadiness(spectrum: Spectrum, first: IntArray, count: IntArray, chance: float) -> RealArray:
    """Return the g from which on the probability of bands is no smaller than a given one: a bound without another transform."""
    half = np.maximum(MIN_DAMPING * (first + count), 0.5)
    n = _most_independent(count, spectrum.step, half, _seconds(spectrum))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n < 2, 0.0, special.gammaincinv((n - 1) / 2, chance) * (1 + (n + 1) / (6 * n)) / n)


@lru_cache(maxsize=4)
def _middle(count: int) -> tuple[slice, RealArray]:
    """Return the middle of a run, and the Hann window there, by which the envelope is divided."""
    end = math.floor(_ENDS * count + 0.5)  # (k + 1/2) / count lies above
    window = np.sin(np.pi / count * (np.arange(end, count - end) + 0.5))
    return slice(end, count - end), window * window / count


def _strongest(lines: ComplexArray) -> ComplexArray:
    """Return the combination of channels with most power on lines (n, l), from the smaller of both Gram matrices."""
    if lines.shape[0] < lines.shape[1]:
        vector = _last_vector(lines @ lines.conj().T) @ lines.conj()
        return np.asarray(vector / max(float(np.linalg.norm(vector)), _TINY))
    return _last_vector(sla.blas.zherk(1.0, lines.T, lower=1)).conj()  # of the conjugate matrix: no copy is made


def _last_vector(gram: ComplexArray) -> ComplexArray:
    """Return the eigenvector of the largest eigenvalue alone, in half of the time of all."""
    _, vectors, _, _, info = sla.lapack.zheevr(gram, lower=1, range="I", il=len(gram), iu=len(gram))
    if info != 0:
        raise np.linalg.LinAlgError(f"zheevr ended with {info}")
    return np.asarray(vectors[:, 0])


def _unsteadiness(values: ComplexArray) -> RealArray:
    """Return g = ln mean |z|^2 - mean ln |z|^2 of every row."""
    squares = np.maximum(values.real**2 + values.imag**2, _TINY)
    return np.asarray(np.log(np.mean(squares, axis=-1)) - np.mean(np.log(squares), axis=-1))


def _chance(g: float, n: float) -> float:
    """Return the probability that n independent values of random vibration have so small a g; small ones fall with n."""
    if n < 2:
        return 1.0
    return float(special.gammainc((n - 1) / 2, n * g / (1 + (n + 1) / (6 * n))))


def _most_independent(count: Array, step: float, half: Array, seconds: float) -> RealArray:
    """Return an upper bound of `_independent` for so many lines.

    A transform of `count` powers that sum to P is no smaller than P cos(w (count - 1) / 2) up to w = pi / (count - 1). Its square times
    exp(-2 h w) has an integral in closed form, which a sum at `4 count` places or more exceeds by less than one term.
    """
    a, b = 2 * np.asarray(half), np.asarray(count) - 1
    decay = np.exp(-a * np.pi / b)
    both = ((1 - decay) / a + a * (1 + decay) / (a**2 + b**2)) / (2 * np.pi) - 1 / (4 * count)
    return np.asarray(np.divide(seconds * step, both, out=np.full(np.shape(both), np.inf), where=both > 0))


def _independent(power: RealArray, step: float, centre: float, seconds: float) -> float:
    """Return T (int S)^2 / int S^2 of a spectrum no narrower than the minimum damping allows.

    S is the power smoothed by h / pi / (h^2 + k^2), whose transform is exp(-h |w|); the squares are summed by Parseval's theorem.
    """
    half = max(MIN_DAMPING * centre / step, 0.5)  # minimum half bandwidth of a resonance, lines
    count = int(fft.next_fast_len(4 * len(power), real=True))
    w = 2 * np.pi * np.arange(count // 2 + 1) / count
    squares = np.abs(fft.rfft(power, count)) ** 2 * np.exp(-2 * half * w)
    both = 2 * squares.sum() - squares[0] - (0 if count % 2 else squares[-1])
    return float(seconds * step * squares[0] * count / both)


class Line(NamedTuple):
    """A harmonic of a rotating machine."""

    frequency: float  # mean, Hz
    spread: float  # standard deviation of the frequency, Hz
    level: float  # RMS over that of all outputs together
    chance: float  # probability of such a band in random vibration


def find_lines(signals: Signals, band: tuple[float, float] | None = None) -> tuple[Line, ...]:
    """Return the harmonics of rotating machines in the outputs of a record, in a band (Hz), by ascending frequency.

    Every band of 1 and of 2.5 % of its frequency is examined, from where it holds a dozen lines. Multiples of a shaft with two known
    harmonics need less evidence, when they wander no more.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> hum = np.sin(2 * np.pi * 12.0 * np.arange(30000) / 50)
    >>> [
    ...     round(line.frequency, 2)
    ...     for line in find_lines(Signals(outputs=rng.standard_normal((30000, 2)) + hum[:, None], sampling_rate=50.0))
    ... ]
    [12.0]
    """
    return lines_in(Spectrum.of(signals), band)


def lines_in(spectrum: Spectrum, band: tuple[float, float] | None = None) -> tuple[Line, ...]:
    """Return the harmonics of `find_lines` from the spectrum of a record."""
    low, high = (0.0, np.inf) if band is None else band
    f, widths = (
        np.concatenate(both) for both in zip(*(_ladder(spectrum, width) for width in _BAND_WIDTHS), strict=True)
    )
    inside = (low <= f) & (f <= high)
    first, count = lines_around(spectrum, f[inside], widths[inside])
    first, count = first[count > 0], count[count > 0]
    limit = _FALSE_ALARM / max(first.size, 1)
    bands = steady_bands(spectrum, first, count, limit)
    harmonics = _distinct([(band.chance, band) for band in bands if band.chance < limit])
    harmonics = _distinct([*harmonics, *_of_the_same_shaft(spectrum, [band for _, band in harmonics])])
    lines = (Line(b.centre, b.spread, float(np.sqrt(b.power / spectrum.power)), chance) for chance, b in harmonics)
    return tuple(sorted(line for line in lines if low <= line.frequency <= high))


def _ladder(spectrum: Spectrum, width: float) -> tuple[Array, Array]:
    """Return the centres of bands of one relative width, a quarter of it apart, and their widths, Hz."""
    lowest, highest = MIN_BAND_LINES * spectrum.step / width * 1.2, spectrum.rate / 2 / (1 + width)
    steps = max(int(np.log(highest / lowest) / np.log1p(width / 4)) + 2, 1)
    f = np.multiply.accumulate(np.concatenate([[lowest], np.full(steps, 1 + width / 4)]))
    f = f[f * (1 + width) < spectrum.rate / 2]
    return f, width * f


def _distinct(pairs: list[tuple[float, Narrow]]) -> list[tuple[float, Narrow]]:
    """Return one of all bands with the same harmonic, the least likely first."""
    kept: list[tuple[float, Narrow]] = []
    for chance, band in sorted(pairs, key=lambda pair: pair[0]):
        if all(abs(band.centre / other.centre - 1) > max(_BAND_WIDTHS) / 2 for _, other in kept):
            kept.append((chance, band))
    return kept


def _of_the_same_shaft(spectrum: Spectrum, harmonics: list[Narrow]) -> list[tuple[float, Narrow]]:
    """Return bands at multiples and divisors common to two harmonics, as steady and as narrow as these."""
    bands: list[tuple[float, Narrow]] = []
    if len(harmonics) < 2:
        return bands
    relative = float(np.median([band.spread / band.centre for band in harmonics]))
    lines = np.array([band.centre for band in harmonics])
    shafts = [line / part for line in lines for part in range(1, _MAX_DIVISOR + 1)]
    shafts = [
        f for f in shafts if np.sum(np.abs(lines / f - np.round(lines / f)) < _MULTIPLE_TOLERANCE * lines / f) > 1
    ]
    for f in {round(k * f / spectrum.step) * spectrum.step for f in shafts for k in range(1, _MAX_MULTIPLE + 1)}:
        band = narrow_band(spectrum, f, max(_BAND_WIDTHS) * f)
        if band is None or band.chance > _FALSE_ALARM_OF_MULTIPLE or abs(band.centre / f - 1) > _MULTIPLE_TOLERANCE:
            continue
        if band.spread < _MAX_SPREAD_RATIO * relative * f + spectrum.step:
            bands.append((max(band.chance, 1e-300), band))
    return bands


def shaft_orders(frequencies: Array) -> list[int | None]:
    """Return which multiple of the lowest harmonic each one is; None where it is none, and for a single one."""
    if len(frequencies) < 2:
        return [None] * len(frequencies)
    orders = [round(f / frequencies[0]) for f in frequencies]
    fits = [abs(f / (k * frequencies[0]) - 1) < _MULTIPLE_TOLERANCE for f, k in zip(frequencies, orders, strict=True)]
    return [k if fit and sum(fits) > 1 else None for k, fit in zip(orders, fits, strict=True)]


def harmonic_notes(lines: Sequence[Line]) -> tuple[Note, ...]:
    """Return a note for every harmonic: frequency, spread, level and order among its numbers."""
    orders = shaft_orders(np.array([line.frequency for line in lines]))
    notes = []
    for line, order in zip(lines, orders, strict=True):
        f = line.frequency
        numbers = {"frequency_hz": f, "spread_hz": line.spread, "level": line.level}
        if order is not None:
            numbers["order"] = float(order)
        mains = any(abs(f / hz - round(f / hz)) < _MAINS_TOLERANCE and f > hz / 2 for hz in _MAINS)
        source = "the mains" if mains else "a rotating machine"
        evidence = f"constant envelope, false-alarm probability {line.chance:.1g}"
        text = f"Harmonic of {source} at {f:.5g} Hz +- {percent(line.spread / f, 2)} ({evidence})"
        notes.append(Note(HARMONIC, numbers, text))
    return tuple(notes)
