"""Narrow bands of a record: their envelope, how steady it is, and how often random vibration has one as steady.

Around a frequency the outputs are z(t) exp(j 2 pi f t). Random vibration, however narrow its band, has |z|^2 that is exponential; a
machine's line has a constant |z|, at constant speed and at one that wanders. For n independent values the ratio of arithmetic to
geometric mean,

    g = ln mean |z|^2 - mean ln |z|^2        (.577 for random vibration, 0 for a line; Bartlett's and Moran's statistic)

tells them apart: 2 n g is nearly chi-square with n - 1 degrees of freedom for random vibration.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike
from scipy import fft, special

from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.preprocess.whole_spectrum import Spectrum

__all__ = ["FEWEST", "Envelope", "Narrow", "lines_around", "narrow_band", "steady_bands"]

#: No structure is taken to be less damped than this: a narrower resonance could not be told from a line.
_LEAST_DAMPING = 0.001

_TINY = float(np.finfo(float).tiny)

#: Values of |z|^2 that a band has at least, and the part of a run at either end that is not looked at.
FEWEST, _ENDS = 12, 0.15


class Narrow(NamedTuple):
    """A narrow band of a record, shifted to zero frequency, in the combination of outputs that holds most of its power.

    Attributes
    ----------
    values : array of complex, (n,)
        z(t), as many values as the band has.
    worth : float
        How many of them are independent in random vibration of this spectrum.
    centre, spread : float
        Mean and standard deviation of the frequency, Hz, weighted by power.
    power : float
        Mean square of the outputs in the band, the sum of all.
    """

    values: ComplexArray
    worth: float
    centre: float
    spread: float
    power: float

    @property
    def chance(self) -> float:
        """How often random vibration has an envelope as steady as this."""
        return _chance(float(_unsteadiness(self.values)), self.worth)


class Envelope(NamedTuple):
    """A narrow band before anything is told of it.

    Attributes
    ----------
    first : int
        The first line.
    lines : array of complex, (runs, n, l)
        All of its lines.
    combined : array of complex, (runs, n)
        The combination of outputs with most power.
    values : array of complex
        z(t).
    """

    first: int
    lines: ComplexArray
    combined: ComplexArray
    values: ComplexArray

    def band(self, step: float) -> Narrow:
        """Return what is told of the band; lines are `step` Hz apart."""
        power = np.sum(np.abs(self.combined) ** 2, axis=0)
        f = (self.first + np.arange(power.size)) * step
        weight = power / power.sum()
        centre = float(f @ weight)
        spread = float(np.sqrt(max((f - centre) ** 2 @ weight, 0.0)))
        worth = _independent(power, step, centre, self._seconds(step))
        return Narrow(self.values, worth, centre, spread, float(np.sum(np.abs(self.lines) ** 2)))

    def _seconds(self, step: float) -> float:
        return float((1 - 2 * _ENDS) * self.lines.shape[0] / step)


def narrow_band(spectrum: Spectrum, frequency: float, width: float) -> Narrow | None:
    """Return a band of a record around a frequency; None where it has too few lines.

    Parameters
    ----------
    spectrum : Spectrum
    frequency, width : float
        Hz.
    """
    (first,), (count,) = lines_around(spectrum, np.array([frequency]), width)
    if not count:
        return None
    cut = spectrum.lines[:, first : first + count]
    combined = cut @ _strongest(cut.reshape(-1, cut.shape[2]))
    return Envelope(int(first), cut, combined, _values(combined).ravel()).band(spectrum.step)


def lines_around(spectrum: Spectrum, frequencies: RealArray, widths: ArrayLike) -> tuple[IntArray, IntArray]:
    """Return the first lines of bands and how many each has; 0 of those that have too few, or reach beyond the last line.

    Parameters
    ----------
    spectrum : Spectrum
    frequencies, widths : array, (n,)
        Hz.
    """
    half = np.asarray(widths) / 2
    first = np.maximum(np.ceil((frequencies - half) / spectrum.step), 1).astype(int)
    last = ((frequencies + half) / spectrum.step).astype(int)
    count = last - first + 1
    return first, np.where((count < FEWEST) | (last >= spectrum.lines.shape[1]), 0, count)


def steady_bands(spectrum: Spectrum, first: IntArray, count: IntArray, chance: float) -> list[Envelope]:
    """Return the bands whose chance may be below a given one, a thousandth or less: those of as many lines are looked at together.

    Parameters
    ----------
    spectrum : Spectrum
    first, count : array of int, (n,)
        Lines of the bands, at least `FEWEST`.
    chance : float
    """
    cuts = [spectrum.lines[:, a : a + n] for a, n in zip(first.tolist(), count.tolist(), strict=True)]
    combined = [cut @ _strongest(cut.reshape(-1, cut.shape[2])) for cut in cuts]
    limits, found = _steadiest(spectrum, first, count, chance), {}
    for n in np.unique(count):
        alike = np.flatnonzero(count == n)
        values = _values(np.stack([combined[i] for i in alike])).reshape(alike.size, -1)
        for j in np.flatnonzero(_unsteadiness(values) < limits[alike]):
            i = int(alike[j])
            found[i] = Envelope(int(first[i]), cuts[i], combined[i], values[j])
    return [found[i] for i in sorted(found)]


def _values(combined: ComplexArray) -> ComplexArray:
    """Return z(t) in the middle of every run from the lines of a combination of outputs, (..., n)."""
    inside, window = _middle(combined.shape[-1])
    return np.asarray(fft.ifft(combined, axis=-1)[..., inside] / window)


def _steadiest(spectrum: Spectrum, first: IntArray, count: IntArray, chance: float) -> RealArray:
    """Return g of bands from which on their chance is no smaller than a given one: a bound without another transform."""
    half = np.maximum(_LEAST_DAMPING * (first + count), 0.5)
    seconds = (1 - 2 * _ENDS) * spectrum.lines.shape[0] / spectrum.step
    n = _most_independent(count, spectrum.step, half, seconds)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n < 2, 0.0, special.gammaincinv((n - 1) / 2, chance) * (1 + (n + 1) / (6 * n)) / n)


@lru_cache(maxsize=4)
def _middle(count: int) -> tuple[slice, RealArray]:
    """Return the middle of a run, and the window there: a Hann window fades at both ends, and so does the envelope."""
    end = math.floor(_ENDS * count + 0.5)  # (k + 1/2) / count lies above
    window = np.sin(np.pi / count * (np.arange(end, count - end) + 0.5))
    return slice(end, count - end), window * window / count


def _strongest(lines: ComplexArray) -> ComplexArray:
    """Return the combination of channels that has most power on lines (n, l): from the smaller of both Gram matrices."""
    if lines.shape[0] < lines.shape[1]:
        own = _last_vector(lines @ lines.conj().T) @ lines.conj()
        return np.asarray(own / max(float(np.linalg.norm(own)), _TINY))
    return _last_vector(sla.blas.zherk(1.0, lines.T, lower=1)).conj()  # of the conjugate matrix: no copy is made


def _last_vector(gram: ComplexArray) -> ComplexArray:
    """Return the eigenvector of the largest eigenvalue alone, which takes half of the time of all."""
    _, vectors, _, _, info = sla.lapack.zheevr(gram, lower=1, range="I", il=len(gram), iu=len(gram))
    if info != 0:
        raise np.linalg.LinAlgError(f"zheevr ended with {info}")
    return np.asarray(vectors[:, 0])


def _unsteadiness(values: ComplexArray) -> RealArray:
    """Return g = ln mean |z|^2 - mean ln |z|^2 of every row."""
    squares = np.maximum(values.real**2 + values.imag**2, _TINY)
    return np.asarray(np.log(np.mean(squares, axis=-1)) - np.mean(np.log(squares), axis=-1))


def _chance(g: float, n: float) -> float:
    """Return how often n independent values of random vibration have so small a g: the more values, the less often, where that is small."""
    if n < 2:
        return 1.0
    corrected = 2 * n * g / (1 + (n + 1) / (6 * n))
    return float(special.gammainc((n - 1) / 2, corrected / 2))


def _half_width(centre: float, step: float) -> float:
    """Return half of the least width of a resonance, in lines."""
    return max(_LEAST_DAMPING * centre / step, 0.5)


def _most_independent(count: Array, step: float, half: Array, seconds: float) -> RealArray:
    """Return what `_independent` never exceeds with so many lines.

    A transform of `count` powers that sum to P is no smaller than P cos(w (count - 1) / 2) up to w = pi / (count - 1). Its square times
    exp(-2 h w) has an integral in closed form, and a sum at `4 count` places in all, or more, stays above that by less than one term.
    """
    a, b = 2 * np.asarray(half), np.asarray(count) - 1
    fades = np.exp(-a * np.pi / b)
    both = ((1 - fades) / a + a * (1 + fades) / (a**2 + b**2)) / (2 * np.pi) - 1 / (4 * count)
    return np.asarray(np.divide(seconds * step, both, out=np.full(np.shape(both), np.inf), where=both > 0))


def _independent(power: RealArray, step: float, centre: float, seconds: float) -> float:
    """Return T (int S)^2 / int S^2 of a spectrum that is nowhere narrower than the least damping allows.

    S is the power smoothed by h / pi / (h^2 + k^2), whose transform is exp(-h |w|): the squares are summed there (Parseval).
    """
    half = _half_width(centre, step)
    count = int(fft.next_fast_len(4 * len(power), real=True))
    w = 2 * np.pi * np.arange(count // 2 + 1) / count
    squares = np.abs(fft.rfft(power, count)) ** 2 * np.exp(-2 * half * w)
    both = 2 * squares.sum() - squares[0] - (0 if count % 2 else squares[-1])
    return float(seconds * step * squares[0] * count / both)
