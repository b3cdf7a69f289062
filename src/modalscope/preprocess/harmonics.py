"""Lines of turning machines in a record: told from resonances by an envelope that does not fluctuate as random vibration does.

Around a frequency the outputs are z(t) exp(j 2 pi f t). Random vibration, however narrow its band, has |z|^2 that is exponential; a
machine's line has a constant |z|, at constant speed and at one that wanders. For n independent values the ratio of arithmetic to
geometric mean,

    g = ln mean |z|^2 - mean ln |z|^2        (.577 for random vibration, 0 for a line; Bartlett's and Moran's statistic)

tells them apart: 2 n g is nearly chi-square with n - 1 degrees of freedom for random vibration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft, special

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.notes import Note
from modalscope.model.signals import Signals
from modalscope.preprocess.prominent import binary_size

__all__ = ["HARMONIC", "Line", "Narrow", "find_lines", "harmonic_notes", "narrow_band"]

#: The kind of the notes that name harmonics.
HARMONIC = "harmonic"

#: Widths of the bands looked at, as parts of their frequency: lines at constant speed, and at one that wanders.
_WIDTHS = (0.01, 0.025)

#: No structure is taken to be less damped than this: a narrower resonance could not be told from a line.
_LEAST_DAMPING = 0.001

#: One record of random vibration in so many has a line by chance.
_CHANCE = 1e-3

#: A line this near to a multiple of the lowest (part of its frequency) is that multiple.
_NEAR = 0.003

#: Multiples of a shaft that are tried beside lines that are known, and the chance that is left for what wanders no more than they do.
_ORDERS, _PARTS, _CHANCE_OF_ORDER, _AS_NARROW = 8, 3, 0.01, 1.5

#: Frequencies of mains, Hz, which hold to this.
_MAINS, _OF_MAINS = (50.0, 60.0), 0.002

#: Values of |z|^2 that a band has at least.
_FEWEST = 12


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
        squares = np.maximum(np.abs(self.values) ** 2, np.finfo(float).tiny)
        g = float(np.log(squares.mean()) - np.log(squares).mean())
        n = self.worth
        if n < 2:
            return 1.0
        corrected = 2 * n * g / (1 + (n + 1) / (6 * n))
        return float(special.gammainc((n - 1) / 2, corrected / 2))


class Line(NamedTuple):
    """A line of a machine.

    Attributes
    ----------
    frequency, spread : float
        Hz: mean, and how far it wanders (standard deviation).
    level : float
        Its root mean square over that of all outputs together.
    chance : float
        How often random vibration looks like it.
    """

    frequency: float
    spread: float
    level: float
    chance: float


class _Spectrum(NamedTuple):
    """Transforms of all runs (R, lines, l), the distance of lines (Hz), and the power of all outputs, these over one number."""

    lines: ComplexArray
    step: float
    power: float

    @classmethod
    def of(cls, signals: Signals) -> _Spectrum:
        outputs, _ = signals.by_run()
        y = scipy.signal.detrend(outputs / binary_size(outputs), axis=1)
        window = scipy.signal.get_window("hann", y.shape[1])
        scale = np.sqrt(2 / (y.shape[1] * float(window @ window)))
        lines = np.asarray(fft.rfft(y * window[:, None], axis=1)) * scale
        return cls(lines, signals.sampling_rate / y.shape[1], float(np.sum(np.mean(y**2, axis=(0, 1)))))


def narrow_band(spectrum: _Spectrum, frequency: float, width: float) -> Narrow | None:
    """Return a band of a record around a frequency; None where it has too few lines.

    Parameters
    ----------
    spectrum : _Spectrum
    frequency, width : float
        Hz.
    """
    first = max(int(np.ceil((frequency - width / 2) / spectrum.step)), 1)
    last = int((frequency + width / 2) / spectrum.step)
    if last - first + 1 < _FEWEST or last >= spectrum.lines.shape[1]:
        return None
    cut = spectrum.lines[:, first : last + 1]
    flat = cut.reshape(-1, cut.shape[2])
    strongest = _strongest(flat)
    # a Hann window fades at both ends, and so does the envelope: the middle of the run is looked at, the window divided out
    Z = cut @ strongest
    count = Z.shape[1]
    z = np.fft.ifft(Z, axis=1) * count
    t = (np.arange(count) + 0.5) / count
    inside = (t > 0.15) & (t < 0.85)
    values = (z / np.sin(np.pi * t) ** 2)[:, inside].ravel()
    power = np.sum(np.abs(Z) ** 2, axis=0)
    f = (first + np.arange(count)) * spectrum.step
    weight = power / power.sum()
    centre = float(f @ weight)
    spread = float(np.sqrt(max((f - centre) ** 2 @ weight, 0.0)))
    seconds = 0.7 * cut.shape[0] / spectrum.step
    return Narrow(
        values, _independent(power, spectrum.step, centre, seconds), centre, spread, float(np.sum(np.abs(flat) ** 2))
    )


def _strongest(lines: ComplexArray) -> ComplexArray:
    """Return the combination of channels that has most power on lines (n, l): from the smaller of both Gram matrices."""
    if lines.shape[0] < lines.shape[1]:
        own = np.linalg.eigh(lines @ lines.conj().T)[1][:, -1] @ lines.conj()
        return np.asarray(own / max(float(np.linalg.norm(own)), np.finfo(float).tiny))
    return np.asarray(np.linalg.eigh(lines.conj().T @ lines)[1][:, -1])


def _independent(power: RealArray, step: float, centre: float, seconds: float) -> float:
    """Return T (int S)^2 / int S^2 of a spectrum that is nowhere narrower than the least damping allows.

    S is the power smoothed by h / pi / (h^2 + k^2), whose transform is exp(-h |w|): the squares are summed there (Parseval).
    """
    half = max(_LEAST_DAMPING * centre / step, 0.5)
    count = int(fft.next_fast_len(4 * len(power), real=True))
    w = 2 * np.pi * np.arange(count // 2 + 1) / count
    squares = np.abs(fft.rfft(power, count)) ** 2 * np.exp(-2 * half * w)
    both = 2 * squares.sum() - squares[0] - (0 if count % 2 else squares[-1])
    return float(seconds * step * squares[0] * count / both)


def find_lines(signals: Signals, band: tuple[float, float] | None = None) -> tuple[Line, ...]:
    """Return the lines of turning machines in a record, by rising frequency.

    Every band of 1 and of 2.5 % of its frequency is looked at, from where it holds a dozen lines; beside two multiples of a shaft its other
    multiples need less evidence, when they wander no more.

    Parameters
    ----------
    signals : Signals
        Its outputs.
    band : (float, float), optional
        Hz: lines there alone.

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
    spectrum = _Spectrum.of(signals)
    low, high = (0.0, np.inf) if band is None else band
    looked: list[tuple[float, Narrow]] = []
    for width in _WIDTHS:
        f = _FEWEST * spectrum.step / width * 1.2
        while f * (1 + width) < signals.sampling_rate / 2:
            part = narrow_band(spectrum, f, width * f) if low <= f <= high else None
            if part is not None:
                looked.append((part.chance, part))
            f *= 1 + width / 4
    bar = _CHANCE / max(len(looked), 1)
    found = _apart([pair for pair in looked if pair[0] < bar])
    found = _apart([*found, *_of_the_same_shaft(spectrum, [band for _, band in found])])
    lines = [
        Line(b.centre, b.spread, float(np.sqrt(b.power / spectrum.power)), chance)
        for chance, b in found
        if low <= b.centre <= high
    ]
    return tuple(sorted(lines, key=lambda line: line.frequency))


def _apart(pairs: list[tuple[float, Narrow]]) -> list[tuple[float, Narrow]]:
    """Return one of all bands that hold the same line, the least likely first."""
    kept: list[tuple[float, Narrow]] = []
    for chance, band in sorted(pairs, key=lambda pair: pair[0]):
        if all(abs(band.centre / other.centre - 1) > max(_WIDTHS) / 2 for _, other in kept):
            kept.append((chance, band))
    return kept


def _of_the_same_shaft(spectrum: _Spectrum, known: list[Narrow]) -> list[tuple[float, Narrow]]:
    """Return bands at multiples and divisors of lines that two of these agree on, as steady and as narrow as a line of that shaft is."""
    found: list[tuple[float, Narrow]] = []
    if len(known) < 2:
        return found
    relative = float(np.median([band.spread / band.centre for band in known]))
    lines = np.array([band.centre for band in known])
    shafts = [line / part for line in lines for part in range(1, _PARTS + 1)]
    shafts = [f for f in shafts if np.sum(np.abs(lines / f - np.round(lines / f)) < _NEAR * lines / f) > 1]
    for f in {round(k * shaft / spectrum.step) * spectrum.step for shaft in shafts for k in range(1, _ORDERS + 1)}:
        band = narrow_band(spectrum, f, max(_WIDTHS) * f)
        if band is None or band.chance > _CHANCE_OF_ORDER or abs(band.centre / f - 1) > _NEAR:
            continue
        if band.spread < _AS_NARROW * relative * f + spectrum.step:
            found.append((max(band.chance, 1e-300), band))
    return found


def shaft_orders(frequencies: Array) -> list[int | None]:
    """Return which multiple of the lowest line each line is; None where it is none, and for a line alone."""
    if len(frequencies) < 2:
        return [None] * len(frequencies)
    orders = [round(f / frequencies[0]) for f in frequencies]
    fits = [abs(f / (k * frequencies[0]) - 1) < _NEAR for f, k in zip(frequencies, orders, strict=True)]
    return [k if fit and sum(fits) > 1 else None for k, fit in zip(orders, fits, strict=True)]


def harmonic_notes(lines: Sequence[Line]) -> tuple[Note, ...]:
    """Return a note for every line of a turning machine: frequency, spread, level and order among its numbers.

    Parameters
    ----------
    lines : sequence of Line
    """
    orders = shaft_orders(np.array([line.frequency for line in lines]))
    return tuple(_note(line, order) for line, order in zip(lines, orders, strict=True))


def _note(line: Line, order: int | None) -> Note:
    numbers = {"frequency_hz": line.frequency, "spread_hz": line.spread, "level": line.level}
    if order is not None:
        numbers["order"] = float(order)
    mains = any(
        abs(line.frequency / f - round(line.frequency / f)) < _OF_MAINS and line.frequency > f / 2 for f in _MAINS
    )
    named = " (a multiple of the mains)" if mains else ""
    text = (
        f"at {line.frequency:.5g} Hz{named} the envelope is as steady as a machine's and no random vibration's (by chance in "
        f"{line.chance:.1g} of records), the frequency within {100 * line.spread / line.frequency:.2g} %"
    )
    return Note(HARMONIC, numbers, text)
