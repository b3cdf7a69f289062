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
from scipy import fft, special

from modalscope.model.checks import ComplexArray, RealArray
from modalscope.preprocess.whole_spectrum import Spectrum

__all__ = ["FEWEST", "Envelope", "Narrow", "envelope", "narrow_band"]

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
        return _chance(_unsteadiness(self.values), self.worth)


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

    def least_chance(self, step: float) -> float:
        """Return what the band's chance is not below where that is a thousandth or less: a bound without another transform."""
        count = self.combined.shape[1]
        half = _half_width((self.first + count) * step, step)
        return _chance(_unsteadiness(self.values), _most_independent(count, step, half, self._seconds(step)))

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
    seen = envelope(spectrum, frequency, width)
    return None if seen is None else seen.band(spectrum.step)


def envelope(spectrum: Spectrum, frequency: float, width: float) -> Envelope | None:
    """Return what `narrow_band` looks at, before anything is told of it.

    Parameters
    ----------
    spectrum : Spectrum
    frequency, width : float
        Hz.
    """
    first = max(math.ceil((frequency - width / 2) / spectrum.step), 1)
    last = int((frequency + width / 2) / spectrum.step)
    if last - first + 1 < FEWEST or last >= spectrum.lines.shape[1]:
        return None
    cut = spectrum.lines[:, first : last + 1]
    Z = cut @ _strongest(cut.reshape(-1, cut.shape[2]))
    inside, window = _middle(Z.shape[1])
    return Envelope(first, cut, Z, (fft.ifft(Z, axis=1)[:, inside] / window).ravel())


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
    return _last_vector(lines.conj().T @ lines)


def _last_vector(gram: ComplexArray) -> ComplexArray:
    """Return the eigenvector of the largest eigenvalue alone, which takes half of the time of all."""
    _, vectors, _, _, info = sla.lapack.zheevr(gram, range="I", il=len(gram), iu=len(gram))
    if info != 0:
        raise np.linalg.LinAlgError(f"zheevr ended with {info}")
    return np.asarray(vectors[:, 0])


def _unsteadiness(values: ComplexArray) -> float:
    """Return g = ln mean |z|^2 - mean ln |z|^2."""
    squares = np.maximum(values.real**2 + values.imag**2, _TINY)
    return math.log(np.add.reduce(squares) / squares.size) - float(np.add.reduce(np.log(squares))) / squares.size


def _chance(g: float, n: float) -> float:
    """Return how often n independent values of random vibration have so small a g: the more values, the less often, where that is small."""
    if n < 2:
        return 1.0
    corrected = 2 * n * g / (1 + (n + 1) / (6 * n))
    return float(special.gammainc((n - 1) / 2, corrected / 2))


def _half_width(centre: float, step: float) -> float:
    """Return half of the least width of a resonance, in lines."""
    return max(_LEAST_DAMPING * centre / step, 0.5)


def _most_independent(count: int, step: float, half: float, seconds: float) -> float:
    """Return what `_independent` never exceeds with so many lines.

    A transform of `count` powers that sum to P is no smaller than P cos(w (count - 1) / 2) up to w = pi / (count - 1). Its square times
    exp(-2 h w) has an integral in closed form, and a sum at `4 count` places in all, or more, stays above that by less than one term.
    """
    a, b = 2 * half, count - 1
    fades = math.exp(-a * math.pi / b)
    both = ((1 - fades) / a + a * (1 + fades) / (a**2 + b**2)) / (2 * np.pi) - 1 / (4 * count)
    return seconds * step / both if both > 0 else math.inf


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
