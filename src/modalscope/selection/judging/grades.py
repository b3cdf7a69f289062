"""Grade each mode by one word and the reason that decides it.

The first rule that applies decides. Every limit is one of another rule of the library, or a bound of its own meaning:

- **doubtful**: the pole does not decay; its frequency is uncertain (95 %) by more than its half-power half-bandwidth; its damping is
  uncertain by its whole value, so that its sign is not known.
- **look**: its shape is that of a stronger mode (MAC above .8); its interval did not hold in simulations; its refinement did not converge;
  its damping is uncertain by more than 30 %; its shape is complex (MPC below .8); it is weak at its own frequency; a machine's line lies
  within 2 % of it; the modes explain less than a fifth of the response around it; it lies above .8 of half the sampling rate of records
  without forces, where what is higher is folded back; the record shows that it went on where its blocks ended; its refinement moved it by
  more than the intervals before and after allow; its uncertainty is not known.
- **good**: no rule applies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import numpy as np

from modalscope.data.indicators import mac, mpc
from modalscope.data.mode_fields import half_widths
from modalscope.data.modes import ModalModel
from modalscope.data.shown import percent
from modalscope.numerics.checks import BoolArray, RealArray
from modalscope.selection.judging.evidence import LEAST_PEAK, LEAST_PROMINENCE
from modalscope.selection.judging.surroundings import DIED, EXPLAINED_NEARBY, LEFT_AT_END, OF_NYQUIST
from modalscope.signals.preprocess.bands import UNFOLDED

#: Best first.
GRADES = ("good", "look", "doubtful")

#: MAC above which only their frequencies distinguish two modes.
ALIKE = 0.8

#: MPC below which a shape is complex, or poorly identified.
_MIN_MPC = 0.8

#: Half-width of the 95 % interval of a damping ratio, relative to its value, above which it is no basis for a decision.
_MAX_DAMPING_UNCERTAINTY = 0.3

#: MAC of a shape with the true one below which its errors are as large as the shape.
_UNKNOWN_SHAPE = 0.5

#: Distance of a machine's line relative to the frequency of a mode within which the one may be taken for the other.
_NEAR_A_LINE = 0.02

#: Share of the response around a mode below which something else is seen there.
_LEAST_EXPLAINED = 0.2


#: What a grade is made of.
QUANTITIES = ("frequency", "damping", "shape")


@dataclass(frozen=True)
class Grade:
    """The grade of a mode.

    `reason`: the one that decides. `words`: by quantity (frequency, damping, shape) a word and its reason, of the rules that concern it.
    """

    word: str
    reason: str
    words: Mapping[str, Word] = field(default_factory=dict)


class Word(str):
    """How far one quantity of a mode is to be trusted: "good", "look" or "doubtful", with the reason."""

    __slots__ = ("reason",)
    reason: str

    def __new__(cls, word: str, reason: str) -> Self:
        """Return the word with its reason."""
        made = super().__new__(cls, word)
        made.reason = reason
        return made

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return str(self), self.reason


class _Objection(NamedTuple):
    """What speaks against quantities of a mode: the worst word it allows, its reason, and whether the grade of the mode knows it."""

    of: tuple[str, ...]
    word: str
    reason: str
    graded: bool = True


def grades(modes: ModalModel, holds: BoolArray | None = None) -> tuple[Grade, ...]:
    """Return a grade for each mode by the rules of this module.

    `holds` (n,): whether the interval of each mode held in simulations (see `certify`).
    """
    widths, pairs = half_widths(modes), alike_pairs(modes)
    moved = _moves(modes, widths)
    graded = []
    for i in range(len(modes)):
        f, zeta = float(widths[0][i]), float(widths[1][i])
        against = [
            *_doubts(modes, i, f, zeta),
            *_weaknesses(modes, i, zeta, pairs, holds, moved[i]),
            *_own_deviation_of_shape(modes, i),
        ]
        good = f"damping known within ±{percent(zeta / float(modes.damping_ratios[i]), 2)}"
        word = _worst([one for one in against if one.graded], good)
        said = {
            "frequency": f"frequency known within ±{f:.2g} Hz",
            "damping": good,
            "shape": "no rule speaks against it",
        }
        words = {name: _worst([one for one in against if name in one.of], said[name]) for name in QUANTITIES}
        graded.append(Grade(str(word), word.reason, words))
    return tuple(graded)


def _worst(against: Sequence[_Objection], otherwise: str) -> Word:
    """Return the first doubt, else the first weakness, else that all is good."""
    for word in reversed(GRADES[1:]):
        for one in against:
            if one.word == word:
                return Word(word, one.reason)
    return Word(GRADES[0], otherwise)


def alike_pairs(modes: ModalModel) -> list[tuple[int, int, float]]:
    """Return pairs of modes (first, second, MAC) whose shapes are alike, by descending MAC; none of a single output."""
    if len(modes) < 2 or len(modes.output_dofs) < 2:
        return []
    values = mac(modes.shapes)
    pairs = [(int(i), int(j), float(values[i, j])) for i, j in zip(*np.triu_indices(len(modes), 1), strict=True)]
    return sorted((pair for pair in pairs if pair[2] > ALIKE), key=lambda pair: -pair[2])


def _doubts(modes: ModalModel, i: int, f: float, zeta: float) -> Iterator[_Objection]:
    """Yield what makes a mode doubtful."""
    value = float(modes.damping_ratios[i])
    if modes.kinds[i] != "mode":
        yield _Objection(QUANTITIES, "doubtful", f"pole is {modes.kinds[i]}: no decaying oscillation")
    if modes.degrees is not None and modes.degrees[i, 0] == 0:
        yield _Objection(QUANTITIES, "doubtful", "not determined by the data: no interval")
    if f > value * modes.frequencies[i]:
        yield _Objection(("frequency",), "doubtful", "frequency uncertain beyond its bandwidth")
    if zeta >= value:
        text = f"damping uncertain by {percent(zeta / value, 2)}: maybe no mode"
        yield _Objection(("damping",), "doubtful", text)


def _weaknesses(
    modes: ModalModel,
    i: int,
    zeta: float,
    pairs: list[tuple[int, int, float]],
    holds: BoolArray | None,
    moved: _Objection | None,
) -> Iterator[_Objection]:
    """Yield what a person should look at."""
    for a, b, value in pairs:
        if i in (a, b) and i not in _stronger(modes, a, b):
            text = f"shape like that of mode {(b if i == a else a) + 1} (MAC {value:.2f})"
            yield _Objection(("shape",), "look", text)
    if holds is not None and i < len(holds) and not holds[i]:
        yield _Objection(("frequency", "damping"), "look", "interval failed in simulations")
    if modes.converged is False:
        yield _Objection(QUANTITIES, "look", "refinement did not converge")
    uncertainty = zeta / float(modes.damping_ratios[i])
    if uncertainty > _MAX_DAMPING_UNCERTAINTY:
        yield _Objection(("damping",), "look", f"damping uncertain by ±{percent(uncertainty, 2)}")
    collinearity = float(mpc(modes.shapes[:, [i]])[0]) if len(modes.output_dofs) > 1 else 1.0
    if collinearity < _MIN_MPC:
        yield _Objection(("shape",), "look", f"shape is complex (MPC {collinearity:.2f})")
    reasons: Mapping[str, Any] = modes.reasons[i] if modes.reasons else {}
    share, prominence = (reasons.get(key) for key in ("share_of_peak", "indicator_prominence"))
    if share is not None and prominence is not None and share < LEAST_PEAK and prominence < LEAST_PROMINENCE:
        yield _Objection(QUANTITIES, "look", f"weak: {percent(share, 2)} of its response, no peak")
    yield from _surroundings(modes, i, reasons)
    if moved is not None:
        yield moved
    if not np.isfinite(uncertainty):
        yield _Objection(("frequency", "damping"), "look", "uncertainty not known")


def _own_deviation_of_shape(modes: ModalModel, i: int) -> Iterator[_Objection]:
    """Yield what the standard deviations of a shape say of it; the grade of the mode does not know it yet.

    With an error of relative size e across it a shape has the MAC 1 / (1 + e^2) with the true one: below that of shapes that are alike
    it is to be looked at, below a half the error is as large as the shape.
    """
    if modes.shapes_std is None or len(modes.output_dofs) < 2:
        return
    size = float(np.sum(np.abs(modes.shapes[:, i]) ** 2))
    alike = 1 / (1 + float(np.sum(modes.shapes_std[:, i] ** 2)) / max(size, 1e-300))
    if not alike >= ALIKE:  # not a number where the deviation is not known
        text = (
            f"errors leave it a MAC of {alike:.2f} with itself"
            if np.isfinite(alike)
            else "deviation of the shape not known"
        )
        yield _Objection(("shape",), "doubtful" if alike < _UNKNOWN_SHAPE else "look", text, graded=False)


def _surroundings(modes: ModalModel, i: int, reasons: Mapping[str, Any]) -> Iterator[_Objection]:
    """Yield what is near a mode that may be taken for it."""
    f = float(modes.frequencies[i])
    lines = [line.frequency for line in modes.harmonics if abs(line.frequency - f) < _NEAR_A_LINE * f]
    if lines:
        nearest = min(lines, key=lambda line: abs(line - f))
        text = f"{percent(abs(nearest / f - 1), 2)} from a machine's line, {nearest:.5g} Hz"
        yield _Objection(QUANTITIES, "look", text)
    explained, share = reasons.get(EXPLAINED_NEARBY, 1.0), reasons.get(OF_NYQUIST, 0.0)
    if explained < _LEAST_EXPLAINED:
        yield _Objection(QUANTITIES, "look", f"{percent(explained, 2)} of the response around it explained")
    if (left := reasons.get(LEFT_AT_END, 0.0)) > DIED:
        yield _Objection(("damping",), "look", f"{percent(left, 2)} of it left at the end of its blocks: leakage")
    if share > UNFOLDED:
        text = f"at {percent(share, 2)} of half the sampling rate: may be an alias"
        yield _Objection(("frequency",), "look", text)


def _moves(modes: ModalModel, widths: tuple[RealArray, RealArray]) -> list[_Objection | None]:
    """Say of each mode that refinement moved it by more than the intervals before and after allow: one of the two values is biased.

    If both were right, the variance of their difference would be no more than the sum of theirs (J. A. Hausman, Econometrica 46, 1978).

    `widths`: of `half_widths`.
    """
    before = modes.unrefined
    if before is None:
        return [None] * len(modes)
    f, zeta = (np.hypot(w, np.nan_to_num(v)) for w, v in zip(widths, half_widths(before), strict=True))
    far = np.abs(modes.frequencies - before.frequencies) > f
    damped = np.abs(modes.damping_ratios - before.damping_ratios) > zeta
    found: list[_Objection | None] = []
    for i in range(len(modes)):
        of, said = ("frequency", f"it from {before.frequencies[i]:.6g} Hz")
        if not far[i]:
            of, said = ("damping", f"its damping from {percent(float(before.damping_ratios[i]), 3)}")
        told = _Objection((of,), "look", f"refinement moved {said}, by more than its interval")
        found.append(told if far[i] or damped[i] else None)
    return found


def _stronger(modes: ModalModel, a: int, b: int) -> tuple[int, ...]:
    """Return the more significant of two modes; none if that is not known."""
    gain = modes.gain
    if gain is None or not np.all(np.isfinite(np.asarray(gain)[[a, b]])):
        return ()
    return (a,) if gain[a] > gain[b] else (b,)
