"""Faults of frequency responses line by line: lines that stand alone, phases that run backwards, phases that are no phases."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.preprocess.findings import Finding

__all__ = ["conjugated", "lone_lines", "no_phase"]

#: A line that stands alone is so many times larger than the lines beside it, or smaller, in every pair.
_ALONE = 8.0

#: Lines beside it that must be smooth: within this factor of each other.
_SMOOTH = 2.0

#: The sum of products of neighbouring lines exceeds what noise makes of it by so many deviations (one of 700 sets of noise alone).
_SURE = 3.0

#: Less than this part of the energy in imaginary parts is none.
_REAL = 1e-12


def conjugated(response: FrequencyResponse) -> list[Finding]:
    """Find responses whose phase rises along the resonances: the conjugate of a causal response, by exp(-j w t).

    sum conj(H_k) H_(k+1) has the angle -dw t, with t the mean time at which the energy of h arrives, sum t |h|^2 / sum |h|^2: later
    than the impulse in every structure. So that one resonance does not decide alone, products p count as p / sqrt |p|; of noise
    alone the imaginary part of their sum has the variance sum |p| / 2.
    """
    if response.lines < 8:
        return []
    H = response.values
    gap = np.diff(response.frequencies)
    even = gap < 1.5 * np.median(gap)  # across a gap the angle means nothing
    products = (np.conj(H[:-1]) * H[1:])[even]
    size = np.abs(products)
    total = float(np.sum(products.imag / np.sqrt(np.maximum(size, np.finfo(float).tiny))))
    if total <= _SURE * float(np.sqrt(np.sum(size) / 2)):
        return []
    return [
        Finding(
            "conjugated",
            response.output_dofs,
            "phases rise along the resonances: energy would arrive before the impulse",
            "Take the complex conjugate of the values, or change the sign of the phases; for the time convention exp(-j w t).",
        )
    ]


def no_phase(response: FrequencyResponse) -> list[Finding]:
    """Find responses without imaginary parts: magnitudes, or levels in decibels where negative values are among them."""
    H = response.values
    if response.lines < 3 or np.sum(H.imag**2) > _REAL * np.sum(np.abs(H) ** 2):
        return []
    decibels = bool(np.any(H.real < 0)) and float(np.ptp(H.real)) > 10
    what = (
        "values look like decibels without a phase" if decibels else "all values are real: magnitudes without a phase"
    )
    change = "Give complex values" + (", 10^(dB / 20) exp(j phase)." if decibels else ", magnitude times exp(j phase).")
    return [Finding("no phase", response.output_dofs, what, change)]


def lone_lines(response: FrequencyResponse) -> list[Finding]:
    """Find lines that stand alone in every pair, the lines beside them smooth: mains, an overload, a line that was edited.

    A resonance or antiresonance that the lines resolve changes by a factor of at most sqrt(5) from its top to the next line where half
    of its half-power bandwidth spans half a line; and lines beside one that they do not resolve fall off on both sides.
    """
    if response.lines < 7:
        return []
    level = np.log(np.maximum(np.abs(response.values).reshape(response.lines, -1), np.finfo(float).tiny))
    found = stands_alone(level)
    if not found.size:
        return []
    where = ", ".join(f"{response.frequencies[k]:.6g}" for k in found[:5]) + (", ..." if found.size > 5 else "")
    return [
        Finding(
            "lone lines",
            response.output_dofs,
            f"{found.size} lines stand far out of their neighbours in every pair, at {where} Hz",
            "Look for mains or an edited line; leave these lines out: response.at_lines(...).",
        )
    ]


def stands_alone(level: RealArray) -> Array:
    """Return the lines whose level differs from both pairs of neighbours in all channels; the neighbours are alike in most.

    Parameters
    ----------
    level : array, (F, c)
    """
    beside = np.stack([level[:-4], level[1:-3], level[3:-1], level[4:]])
    smooth = np.ptp(beside, axis=0) < np.log(_SMOOTH)
    out = np.abs(level[2:-2] - beside.mean(axis=0)) > np.log(_ALONE)
    return np.asarray(np.flatnonzero(out.all(axis=1) & (smooth.mean(axis=1) >= 0.5)) + 2)
