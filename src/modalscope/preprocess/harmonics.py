"""Lines of turning machines in a record: told from resonances by an envelope that does not fluctuate as random vibration does.

`modalscope.preprocess.envelopes` says how often random vibration has an envelope as steady as that of a band.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modalscope.model.checks import Array
from modalscope.model.notes import Note
from modalscope.model.signals import Signals
from modalscope.preprocess.envelopes import FEWEST, Narrow, lines_around, narrow_band, steady_bands
from modalscope.preprocess.whole_spectrum import Spectrum

__all__ = ["HARMONIC", "Line", "find_lines", "harmonic_notes", "lines_in"]

#: The kind of the notes that name harmonics.
HARMONIC = "harmonic"

#: Widths of the bands looked at, as parts of their frequency: lines at constant speed, and at one that wanders.
_WIDTHS = (0.01, 0.025)

#: One record of random vibration in so many has a line by chance.
_CHANCE = 1e-3

#: A line this near to a multiple of the lowest (part of its frequency) is that multiple.
_NEAR = 0.003

#: Multiples of a shaft that are tried beside lines that are known, and the chance that is left for what wanders no more than they do.
_ORDERS, _PARTS, _CHANCE_OF_ORDER, _AS_NARROW = 8, 3, 0.01, 1.5

#: Frequencies of mains, Hz, which hold to this.
_MAINS, _OF_MAINS = (50.0, 60.0), 0.002


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
    return lines_in(Spectrum.of(signals), band)


def lines_in(spectrum: Spectrum, band: tuple[float, float] | None = None) -> tuple[Line, ...]:
    """Return what `find_lines` does of a record whose transform is known.

    Parameters
    ----------
    spectrum : Spectrum
    band : (float, float), optional
        Hz.
    """
    low, high = (0.0, np.inf) if band is None else band
    f, widths = (np.concatenate(both) for both in zip(*(_ladder(spectrum, width) for width in _WIDTHS), strict=True))
    inside = (low <= f) & (f <= high)
    first, count = lines_around(spectrum, f[inside], widths[inside])
    first, count = first[count > 0], count[count > 0]
    bar = _CHANCE / max(first.size, 1)
    bands = [part.band(spectrum.step) for part in steady_bands(spectrum, first, count, bar)]
    found = _apart([(band.chance, band) for band in bands if band.chance < bar])
    found = _apart([*found, *_of_the_same_shaft(spectrum, [band for _, band in found])])
    lines = [
        Line(b.centre, b.spread, float(np.sqrt(b.power / spectrum.power)), chance)
        for chance, b in found
        if low <= b.centre <= high
    ]
    return tuple(sorted(lines, key=lambda line: line.frequency))


def _ladder(spectrum: Spectrum, width: float) -> tuple[Array, Array]:
    """Return the middles of bands of one relative width, a quarter of it apart, and their widths, Hz."""
    lowest, highest = FEWEST * spectrum.step / width * 1.2, spectrum.rate / 2 / (1 + width)
    steps = max(int(np.log(highest / lowest) / np.log1p(width / 4)) + 2, 1)
    f = np.multiply.accumulate(np.concatenate([[lowest], np.full(steps, 1 + width / 4)]))
    f = f[f * (1 + width) < spectrum.rate / 2]
    return f, width * f


def _apart(pairs: list[tuple[float, Narrow]]) -> list[tuple[float, Narrow]]:
    """Return one of all bands that hold the same line, the least likely first."""
    kept: list[tuple[float, Narrow]] = []
    for chance, band in sorted(pairs, key=lambda pair: pair[0]):
        if all(abs(band.centre / other.centre - 1) > max(_WIDTHS) / 2 for _, other in kept):
            kept.append((chance, band))
    return kept


def _of_the_same_shaft(spectrum: Spectrum, known: list[Narrow]) -> list[tuple[float, Narrow]]:
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
