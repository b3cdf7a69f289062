"""Grade each mode by one word and the reason that decides it.

The first rule that speaks decides; every limit is one that another rule of the library rests on, or a bound of its own meaning:

- **doubtful**: the pole does not decay; its frequency is open (95 %) by more than a half bandwidth, so that it may be any other mode there;
  its damping is open by its whole value, so that even its sign is not known.
- **look**: its shape is that of a stronger mode (MAC above .8); its interval did not hold in simulations; its damping is open by more than
  30 %; its shape is far from one phase (MPC below .8); it is weak at its own frequency; nothing is known of how sure it is.
- **good**: nothing of this.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.checking.certificate import Certificate
from modalscope.data import ModalModel
from modalscope.judging.evidence import LEAST_PEAK, LEAST_PROMINENCE
from modalscope.modal.indicators import mac, mpc
from modalscope.numerics.checks import RealArray
from modalscope.reporting.html import percent

#: Best first.
GRADES = ("good", "look", "doubtful")

#: Two shapes above this MAC are told apart by their frequencies alone.
ALIKE = 0.8

#: A shape whose components lie less than this along one phase (MPC) is complex, or badly known.
_ONE_PHASE = 0.8

#: A damping ratio that is open by more than this part of its value is no basis for a decision.
_OPEN = 0.3


@dataclass(frozen=True)
class Grade:
    """How far a mode can be relied on.

    `reason`: the one that decides.
    """

    word: str
    reason: str


def grades(modes: ModalModel, certificate: Certificate | None = None) -> tuple[Grade, ...]:
    """Return a grade for each mode by the rules of this module.

    `certificate`: whose simulations tell whether intervals hold.
    """
    widths = half_widths(modes)
    likes = alike_pairs(modes)
    found = []
    for i in range(len(modes)):
        f, zeta = float(widths[0][i]), float(widths[1][i])
        reason = _doubt(modes, i, f, zeta)
        word = "doubtful"
        if not reason:
            word, reason = "look", _look(modes, i, zeta, likes, certificate)
        found.append(Grade(word, reason) if reason else Grade("good", _sure(modes, i, f, zeta)))
    return tuple(found)


def half_widths(modes: ModalModel) -> tuple[RealArray, RealArray]:
    """Return the half widths of the 95 % intervals of frequencies (Hz) and damping ratios; NaN where they are not known."""
    if modes.frequencies_std is None and modes.frequencies_repeatability is None:
        unknown = np.full(len(modes), np.nan)
        return unknown, unknown
    known = modes.interval(0.95)
    frequency_half, damping_half = (np.ptp(known[name], axis=1) / 2 for name in ("frequency", "damping_ratio"))
    return np.asarray(frequency_half), np.asarray(damping_half)


def alike_pairs(modes: ModalModel) -> list[tuple[int, int, float]]:
    """Return pairs of modes (first, second, MAC) whose shapes are alike, most alike first.

    Of a single output all shapes are: there is nothing to tell.
    """
    if len(modes) < 2 or len(modes.output_dofs) < 2:
        return []
    values = mac(modes.shapes)
    pairs = [(i, j, float(values[i, j])) for i, j in zip(*np.triu_indices(len(modes), 1), strict=True)]
    return sorted(((int(i), int(j), v) for i, j, v in pairs if v > ALIKE), key=lambda pair: -pair[2])


def _doubt(modes: ModalModel, i: int, f: float, zeta: float) -> str:
    value = float(modes.damping_ratios[i])
    if modes.kinds[i] != "mode":
        return f"its pole is {modes.kinds[i]}, no decaying oscillation"
    if f > value * modes.frequencies[i]:
        return f"its frequency is open by ±{f:.2g} Hz, more than its half bandwidth"
    if zeta >= value:
        return f"its damping is open by ±{percent(zeta / value, 2)} of its value: it may be nothing"
    return ""


def _look(
    modes: ModalModel, i: int, zeta: float, likes: list[tuple[int, int, float]], certificate: Certificate | None
) -> str:
    for a, b, value in likes:
        if i in (a, b) and i not in _stronger(modes, a, b):
            return f"its shape is that of mode {(b if i == a else a) + 1} (MAC {value:.2f}): too few sensors, or one mode twice"
    if certificate is not None and i < len(certificate.holds) and not certificate.holds[i]:
        return "its interval did not hold when this case was simulated"
    part = zeta / float(modes.damping_ratios[i])
    if part > _OPEN:
        return f"its damping is open by ±{percent(part, 2)} of its value"
    purity = float(mpc(modes.shapes[:, [i]])[0]) if len(modes.output_dofs) > 1 else 1.0
    if purity < _ONE_PHASE:
        return f"its shape is far from one phase (MPC {purity:.2f})"
    reasons: Mapping[str, Any] = modes.reasons[i] if modes.reasons else {}
    share, prominence = (reasons.get(key) for key in ("share_of_peak", "indicator_prominence"))
    if share is not None and prominence is not None and share < LEAST_PEAK and prominence < LEAST_PROMINENCE:
        return f"weak: it makes up {percent(share, 2)} of the response at its frequency and no peak of its own"
    return "" if np.isfinite(part) else "how far its damping may be from the truth is not known"


def _stronger(modes: ModalModel, a: int, b: int) -> tuple[int, ...]:
    """Return which of two modes explains more of the data; none where that is not known."""
    gain = modes.gain
    if gain is None or not np.all(np.isfinite(np.asarray(gain)[[a, b]])):
        return ()
    return (a,) if gain[a] > gain[b] else (b,)


def _sure(modes: ModalModel, i: int, f: float, zeta: float) -> str:
    parts = (percent(f / float(modes.frequencies[i]), 2), percent(zeta / float(modes.damping_ratios[i]), 2))
    return f"frequency within ±{parts[0]}, damping within ±{parts[1]} of its value"
