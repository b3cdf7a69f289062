"""Complex values out of real columns: real and imaginary parts, magnitudes and phases, in decibels, degrees or radians."""

from __future__ import annotations

import re

import numpy as np

from modalscope.io.columns.words import LONGEST, plain_unit
from modalscope.model import DataError
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["from_decibels", "is_decibel", "joined_polar", "part_of", "phase_unit"]

_PARTS = {
    "real": "real|re|realteil|réel|reell",
    "imag": "imaginary|imag|img|im|imaginärteil|imagin",
    "mag": "magnitude|mag|abs|absolute|amplitude|amp|modulus|betrag|gain|module",
    "phase": "phase|phas|phi|arg|argument|angle|phasenwinkel",
    "coh": "coherence|coh|kohärenz|gamma2|cohérence",
}
_PATTERNS = {
    part: re.compile(rf"(?<![A-Za-zÀ-ÿ0-9])(?:{words})(?![A-Za-zÀ-ÿ])(?:\s+part)?", re.IGNORECASE)
    for part, words in _PARTS.items()
}
_BARS = re.compile(r"\|([^|]+)\|\Z")
_DECIBEL = re.compile(r"(?<![A-Za-z])d[bB](?![A-Za-z])")
_LOOSE = " _-.,:;|()"

#: A phase within these bounds (rad) and beyond the lower one is in radians; a degree or three is no phase of a resonance.
_RADIANS = (2.0, 2 * np.pi + 0.01)


def part_of(name: str) -> tuple[str, str] | None:
    """Return what a column belongs to and which part of it it is; None where its name says nothing of it.

    Examples
    --------
    >>> part_of("H11 Real"), part_of("Im(H11)"), part_of("|3Z/1Z|"), part_of("Phase"), part_of("AccA")
    (('H11', 'real'), ('H11', 'imag'), ('3Z/1Z', 'mag'), ('', 'phase'), None)
    """
    text = name.strip()[:LONGEST]
    bars = _BARS.match(text)
    if bars:
        return bars[1].strip(), "mag"
    for part, pattern in _PATTERNS.items():
        found = pattern.search(text)
        if found:
            rest = _DECIBEL.sub("", text[: found.start()] + " " + text[found.end() :])
            return " ".join(_unwrapped(rest).split()), part
    return None


def _unwrapped(text: str) -> str:
    """Return what is left of a name without the brackets and signs that joined the part to it."""
    text = text.strip(_LOOSE.replace("(", "").replace(")", ""))
    while text.startswith("(") and text.endswith(")"):
        text = text[1:-1]
    text = text.replace("()", "")
    return text.strip(_LOOSE if text.count("(") != text.count(")") else " _-.,:;|")


def is_decibel(name: str, unit: str) -> bool:
    """Whether a magnitude is a level, by its unit or its name.

    Examples
    --------
    >>> is_decibel("Mag", "dB"), is_decibel("Mag dB re 1 m/s2/N", ""), is_decibel("Mag", "g/N")
    (True, True, False)
    """
    return bool(_DECIBEL.search(unit) or _DECIBEL.search(name))


def from_decibels(levels: RealArray) -> RealArray:
    """Return 10^(L/20) of levels L in decibels of an amplitude."""
    with np.errstate(over="ignore"):
        return np.asarray(10.0 ** (levels / 20))


def phase_unit(unit: str, phases: RealArray) -> str:
    """Return "deg" or "rad": what a phase is in, by its unit or else by its range; "" where neither says.

    Beyond 2 pi it cannot be within one turn in radians. Between 2 and 2 pi it is radians, for a response that turns through a
    resonance covers more than that many degrees.

    Examples
    --------
    >>> (
    ...     phase_unit("°", np.array([1.0])),
    ...     phase_unit("", np.array([-170.0])),
    ...     phase_unit("", np.array([-3.1])),
    ...     phase_unit("", np.array([0.5])),
    ... )
    ('deg', 'deg', 'rad', '')
    """
    plain = plain_unit(unit).lower()
    if plain.startswith(("deg", "grad")):
        return "deg"
    if plain.startswith("rad"):
        return "rad"
    largest = float(np.abs(phases).max(initial=0.0))
    return "deg" if largest > _RADIANS[1] else "rad" if largest > _RADIANS[0] else ""


def joined_polar(where: str, magnitude: Array, phase: Array, unit: str, example: str) -> ComplexArray:
    """Return m exp(j phi).

    Parameters
    ----------
    where : str
        The file, for messages.
    magnitude, phase : array, (N,)
    unit : str
        "deg", "rad", or "" where it is not known.
    example : str
        How `--units` names the phase.

    Raises
    ------
    DataError
        A phase whose unit is not known.
    """
    if not unit:
        raise DataError(
            f"reading {where} needs the unit of its phases",
            f"they lie within {np.abs(phase).max(initial=0.0):.3g} of zero, which may be degrees or radians",
            f'Say which: --units "{example}=deg" or --units "{example}=rad".',
        )
    turned = np.exp(1j * (np.deg2rad(phase) if unit == "deg" else phase))
    return np.asarray(magnitude * turned, complex)
