"""Grade each mode by one word and the reason that decides it.

The first rule that applies decides. Every limit is one of another rule of the library, or a bound of its own meaning:

- **doubtful**: the pole does not decay; its frequency is uncertain (95 %) by more than its half-power half-bandwidth; its damping is
  uncertain by its whole value, so that its sign is not known.
- **look**: its shape is that of a stronger mode (MAC above .8); its interval did not hold in simulations; its damping is uncertain by more
  than 30 %; its shape is complex (MPC below .8); it is weak at its own frequency; its uncertainty is not known.
- **good**: no rule applies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.checking.certificate import Certificate
from modalscope.data import ModalModel
from modalscope.data.mode_fields import half_widths
from modalscope.judging.evidence import LEAST_PEAK, LEAST_PROMINENCE
from modalscope.modal.indicators import mac, mpc
from modalscope.reporting.html import percent

#: Best first.
GRADES = ("good", "look", "doubtful")

#: MAC above which only their frequencies distinguish two modes.
ALIKE = 0.8

#: MPC below which a shape is complex, or poorly identified.
_MIN_MPC = 0.8

#: Half-width of the 95 % interval of a damping ratio, relative to its value, above which it is no basis for a decision.
_MAX_DAMPING_UNCERTAINTY = 0.3


@dataclass(frozen=True)
class Grade:
    """The grade of a mode.

    `reason`: the one that decides.
    """

    word: str
    reason: str


def grades(modes: ModalModel, certificate: Certificate | None = None) -> tuple[Grade, ...]:
    """Return a grade for each mode by the rules of this module.

    `certificate`: of the intervals, by simulations.
    """
    widths, pairs = half_widths(modes), alike_pairs(modes)
    graded = []
    for i in range(len(modes)):
        f, zeta = float(widths[0][i]), float(widths[1][i])
        if reason := _doubt(modes, i, f, zeta):
            graded.append(Grade("doubtful", reason))
        elif reason := _weakness(modes, i, zeta, pairs, certificate):
            graded.append(Grade("look", reason))
        else:
            relative = percent(f / float(modes.frequencies[i]), 2), percent(zeta / float(modes.damping_ratios[i]), 2)
            graded.append(Grade("good", f"frequency within ±{relative[0]}, damping within ±{relative[1]}"))
    return tuple(graded)


def alike_pairs(modes: ModalModel) -> list[tuple[int, int, float]]:
    """Return pairs of modes (first, second, MAC) whose shapes are alike, by descending MAC; none of a single output."""
    if len(modes) < 2 or len(modes.output_dofs) < 2:
        return []
    values = mac(modes.shapes)
    pairs = [(int(i), int(j), float(values[i, j])) for i, j in zip(*np.triu_indices(len(modes), 1), strict=True)]
    return sorted((pair for pair in pairs if pair[2] > ALIKE), key=lambda pair: -pair[2])


def _doubt(modes: ModalModel, i: int, f: float, zeta: float) -> str:
    value = float(modes.damping_ratios[i])
    if modes.kinds[i] != "mode":
        return f"pole is {modes.kinds[i]}: no decaying oscillation"
    if modes.degrees is not None and modes.degrees[i, 0] == 0:
        return "left open by the data: frequency uncertain by more than 0.3 half-power half-bandwidths"
    if f > value * modes.frequencies[i]:
        return f"frequency uncertain by ±{f:.2g} Hz, more than its half-power half-bandwidth"
    if zeta >= value:
        return f"damping uncertain by ±{percent(zeta / value, 2)}: probably not a mode"
    return ""


def _weakness(
    modes: ModalModel, i: int, zeta: float, pairs: list[tuple[int, int, float]], certificate: Certificate | None
) -> str:
    for a, b, value in pairs:
        if i in (a, b) and i not in _stronger(modes, a, b):
            other = (b if i == a else a) + 1
            return f"shape equals that of mode {other} (MAC {value:.2f}): too few sensors, or a duplicate"
    if certificate is not None and i < len(certificate.holds) and not certificate.holds[i]:
        return "interval did not hold in simulations of this case"
    uncertainty = zeta / float(modes.damping_ratios[i])
    if uncertainty > _MAX_DAMPING_UNCERTAINTY:
        return f"damping uncertain by ±{percent(uncertainty, 2)}"
    collinearity = float(mpc(modes.shapes[:, [i]])[0]) if len(modes.output_dofs) > 1 else 1.0
    if collinearity < _MIN_MPC:
        return f"shape is complex (MPC {collinearity:.2f})"
    reasons: Mapping[str, Any] = modes.reasons[i] if modes.reasons else {}
    share, prominence = (reasons.get(key) for key in ("share_of_peak", "indicator_prominence"))
    if share is not None and prominence is not None and share < LEAST_PEAK and prominence < LEAST_PROMINENCE:
        return f"weak: {percent(share, 2)} of the response at its frequency, no peak of the mode indicator"
    return "" if np.isfinite(uncertainty) else "uncertainty not known"


def _stronger(modes: ModalModel, a: int, b: int) -> tuple[int, ...]:
    """Return the more significant of two modes; none if that is not known."""
    gain = modes.gain
    if gain is None or not np.all(np.isfinite(np.asarray(gain)[[a, b]])):
        return ()
    return (a,) if gain[a] > gain[b] else (b,)
