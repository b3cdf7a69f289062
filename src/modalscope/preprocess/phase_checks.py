"""Levels and angles given where complex values belong: decibels, degrees, magnitude beside phase."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.preprocess.findings import Finding

__all__ = ["odd_phases"]

#: Fewer lines say too little.
_LEAST = 16

#: An angle that wraps jumps by nearly a turn, from above this part of its limit to below minus that.
_WRAPS = 0.8

#: Angles in degrees taken for radians: the real axis comes out at 0 and +-233 degrees. So many lines lie within 8 degrees of the one, and
#: so few within 8 of 180, where no structure has them so.
_TURNED, _NEAR, _MANY, _FEW = np.radians(np.degrees(180.0) % 360), np.radians(8), 0.25, 0.05

#: From line to line ln |H| and the phase (rad) change by as much: noise moves both alike, and between resonances the phase rests.
#: Degrees that were taken for radians change 57 times as much. So many times more is neither noise nor a structure, where phases move
#: by so many radians at all.
_MORE, _JUMP = 8.0, 0.1

#: Levels in dB lie between these, and seldom far from their median; no response has so small a range around its resonances.
_DECIBELS, _RANGE = 200.0, 6.0


def odd_phases(response: FrequencyResponse) -> list[Finding]:
    """Find magnitude and phase in the places of real and imaginary part, degrees taken for radians, and levels in dB with a phase."""
    H = response.values
    if response.lines < _LEAST or not np.any(H.imag):
        return []
    found = _parts(H) or _degrees(H) or _levels(H)
    return [] if not found else [Finding("no complex values", response.output_dofs, *found)]


def _parts(H: Array) -> tuple[str, str] | None:
    """Whether imaginary parts are angles: they never leave +-180 or +-pi, and jump from the one to the other."""
    for limit, unit in ((180.0, "degrees"), (np.pi, "radians")):
        x = H.imag / limit
        if np.abs(x).max() > 1 + 1e-6:
            continue
        high, low = x > _WRAPS, x < -_WRAPS
        jumps = int(np.sum((high[:-1] & low[1:]) | (low[:-1] & high[1:])))
        if jumps < 2 or np.abs(x).max() < 0.95:
            continue
        level = bool(np.any(H.real < 0))
        angle = "phase" if unit == "radians" else "radians(phase)"
        return (
            f"imaginary parts lie within +-{limit:.6g} and jump {jumps} times from end to end: they are phases in {unit}"
            + (", and real parts levels in dB" if level else ", and real parts magnitudes"),
            f"Give {'10^(dB / 20)' if level else 'magnitude'} exp(j {angle}).",
        )
    return None


def _degrees(H: Array) -> tuple[str, str] | None:
    """Whether phases cluster where degrees that were taken for radians put the real axis."""
    phase = np.angle(H[np.abs(H) > 0])
    if not phase.size:
        return None
    turned = np.abs(np.abs(phase) - (2 * np.pi - _TURNED)) < _NEAR
    change = "Give magnitude exp(j radians(phase))."
    if np.mean(turned) > _MANY and np.mean(np.abs(np.abs(phase) - np.pi) < _NEAR) < _FEW:
        where = (
            f"near +-{np.degrees(2 * np.pi - _TURNED):.0f} degrees, where 180 lies when degrees are taken for radians"
        )
        return f"{100 * np.mean(turned):.0f} % of the phases are {where}", change
    return (
        ("phases jump from line to line where magnitudes are smooth: degrees were taken for radians", change)
        if _rough(H)
        else None
    )


def _rough(H: Array) -> bool:
    """Whether phases change from line to line many times as much as the logarithms of magnitudes do, in the median of all."""
    size = np.maximum(np.abs(H), np.finfo(float).tiny)
    steps = np.conj(H[:-1]) * H[1:]
    steps = steps / np.maximum(np.abs(steps), np.finfo(float).tiny)
    # a delay turns all of a pair alike
    left = np.median(np.abs(np.angle(steps * np.conj(steps.sum(axis=0)))))
    return bool(left > max(_JUMP, _MORE * float(np.median(np.abs(np.diff(np.log(size), axis=0))))))


def _levels(H: Array) -> tuple[str, str] | None:
    """Whether magnitudes are levels: of the size of dB, of little range, and small where the phase falls, at the resonances."""
    size = np.abs(H)
    middle = float(np.median(size))
    if not (2 < middle < _DECIBELS and size.max() < min(_DECIBELS, _RANGE * middle)):
        return None
    fall = -np.angle(H[1:] * np.conj(H[:-1]))
    local = (size[1:] + size[:-1]) / 2
    weighted, plain = _mean(fall, local**2), _mean(fall, np.ones_like(local))
    if plain <= 0 or weighted >= plain:
        return None
    return (
        f"magnitudes lie between {size.min():.3g} and {size.max():.3g} and are small where the phase falls: they are levels in dB",
        "Give 10^(dB / 20) exp(j phase).",
    )


def _mean(x: RealArray, weight: RealArray) -> float:
    return float(np.sum(x * weight) / max(float(np.sum(weight)), 1e-300))
