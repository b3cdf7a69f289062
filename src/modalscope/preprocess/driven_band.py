"""Lines into which hits and sweeps put a force: those on which what they estimate means something."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from scipy import fft

from modalscope.model.checks import Array, RealArray
from modalscope.model.notes import Note
from modalscope.model.signals import Signals
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.impacts import find_hits
from modalscope.preprocess.own_band import CHOSEN

__all__ = ["struck_band", "swept_lines", "useful_lines"]

#: Useful lines have at least this part of the largest power of the force.
_USEFUL = 0.01

#: A band that reaches this part of half the sampling rate is left as it is.
_WHOLE = 0.8

#: Lines on which a pulse is looked at: it is short, so that its spectrum is smooth.
_LINES = 1025

#: Significant digits of a band's end.
_DIGITS = 3


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
    lines = np.linspace(0.0, part.sampling_rate / 2, _LINES)
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
