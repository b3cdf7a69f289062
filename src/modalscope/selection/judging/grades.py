"""Give frequency, damping and shape of each mode a word with its reason; the grade of a mode is the worse of frequency's and shape's.

Damping has its own word beside its interval: a mode whose damping is hardly known may be known well in all else. Every limit is one of
another rule of the library, or a bound of its own meaning:

- **doubtful**: the pole does not decay; the data do not determine it; its frequency is uncertain (95 %) by more than its half-power
  half-bandwidth and by more than poles of one mode differ from order to order; its damping is uncertain by its whole value; the errors of
  its shape are as large as the shape.
- **look**: it may be a stronger mode of the list once more (`same_mode`); its interval did not hold in simulations; its refinement did not
  converge; its damping is uncertain by more than 30 %; its shape has a MAC below .9 with itself by its own deviations, or is complex (MPC
  below .8); it is weak at its own frequency; a machine's line lies within 2 % of it; the modes explain less than a fifth of the response
  around it; it lies above .8 of half the sampling rate of records without forces, where what is higher is folded back; the record shows
  that it went on where its blocks ended; its uncertainty is not known.
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
from modalscope.data.sameness import divided, log_ratios
from modalscope.data.shown import figures, percent
from modalscope.numerics.checks import Array, BoolArray, RealArray
from modalscope.numerics.statistics import levels_of_table
from modalscope.selection.judging.evidence import LEAST_PEAK, LEAST_PROMINENCE
from modalscope.selection.judging.surroundings import DIED, EXPLAINED_NEARBY, LEFT_AT_END, OF_NYQUIST
from modalscope.selection.judging.tracking import SAME_FREQUENCY
from modalscope.signals.preprocess.bands import UNFOLDED

#: Best first.
GRADES = ("good", "look", "doubtful")

#: MAC above which only their frequencies distinguish two modes.
ALIKE = 0.8

#: MPC below which a shape is complex, or poorly identified.
_MIN_MPC = 0.8

#: Half-width of the 95 % interval of a damping ratio, relative to its value, above which it is no basis for a decision.
_MAX_DAMPING_UNCERTAINTY = 0.3

#: MAC of a shape with the true one above which two shapes are taken for correlated (D. J. Ewins, "Modal Testing", 2000, section 7.2), and
#: below which its errors are as large as the shape.
_KNOWN_SHAPE, _UNKNOWN_SHAPE = 0.9, 0.5

#: Distance of a machine's line relative to the frequency of a mode within which the one may be taken for the other.
_NEAR_A_LINE = 0.02

#: Share of the response around a mode below which something else is seen there.
_LEAST_EXPLAINED = 0.2


#: What a grade is made of.
QUANTITIES = ("frequency", "damping", "shape")


@dataclass(frozen=True)
class Grade:
    """The grade of a mode, the worse word of its frequency and its shape.

    `reason`: the one that decides, of a good mode that of its damping. `words`: by quantity (frequency, damping, shape) a word and its
    reason, of the rules that concern it.
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
    """What speaks against quantities of a mode: the worst word it allows, and its reason."""

    of: tuple[str, ...]
    word: str
    reason: str


def grades(modes: ModalModel, holds: BoolArray | None = None) -> tuple[Grade, ...]:
    """Return a grade for each mode by the rules of this module.

    `holds` (n,): whether the interval of each mode held in simulations (see `certify`).
    """
    widths, levelled = half_widths(modes), _levelled(modes)
    known, same = _known_shapes(levelled), log_ratios(levelled, levelled) > 0
    phases = mpc(levelled.shapes) if len(modes.output_dofs) > 1 else np.ones(len(modes))
    graded = []
    for i in range(len(modes)):
        f, zeta = float(widths[0][i]), float(widths[1][i])
        against = [
            *_doubts(modes, i, f, zeta),
            *_weaknesses(modes, i, zeta, holds),
            *_twice(modes, i, np.flatnonzero(same[i])),
            *_of_shape(float(known[i]), float(phases[i])),
        ]
        said = {
            "frequency": f"frequency known within ±{figures(f, 2)} Hz",
            "damping": f"damping known within ±{percent(_relative(zeta, float(modes.damping_ratios[i])), 2)}",
            "shape": "no rule speaks against it"
            if np.isinf(known[i])
            else f"errors leave it a MAC of {known[i]:.3f} with itself",
        }
        words = {name: _worst([one for one in against if name in one.of], said[name]) for name in QUANTITIES}
        worse = _worst([one for one in against if {"frequency", "shape"} & {*one.of}], words["damping"].reason)
        graded.append(Grade(str(worse), worse.reason, words))
    return tuple(graded)


def _relative(deviation: float, value: float) -> float:
    """Return a deviation relative to a value; infinite, or NaN, of no damping."""
    return deviation / value if value else float(np.inf * deviation)


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
    if f > max(value, SAME_FREQUENCY) * modes.frequencies[i]:
        yield _Objection(("frequency",), "doubtful", "frequency uncertain beyond its bandwidth")
    if zeta >= value:
        text = (
            f"damping uncertain by {percent(_relative(zeta, value), 2)}, more than its value"
            if value
            else "no damping told"
        )
        yield _Objection(("damping",), "doubtful", text)


def _weaknesses(modes: ModalModel, i: int, zeta: float, holds: BoolArray | None) -> Iterator[_Objection]:
    """Yield what a person should look at."""
    if holds is not None and i < len(holds) and not holds[i]:
        yield _Objection(("frequency", "damping"), "look", "interval failed in simulations")
    if modes.converged is False:
        yield _Objection(QUANTITIES, "look", "refinement did not converge")
    uncertainty = _relative(zeta, float(modes.damping_ratios[i]))
    if uncertainty > _MAX_DAMPING_UNCERTAINTY:
        yield _Objection(("damping",), "look", f"damping uncertain by ±{percent(uncertainty, 2)}")
    reasons: Mapping[str, Any] = modes.reasons[i] if modes.reasons else {}
    share, prominence = (reasons.get(key) for key in ("share_of_peak", "indicator_prominence"))
    if share is not None and prominence is not None and share < LEAST_PEAK and prominence < LEAST_PROMINENCE:
        yield _Objection(QUANTITIES, "look", f"weak: {percent(share, 2)} of its response, no peak")
    yield from _surroundings(modes, i, reasons)
    if not np.isfinite(uncertainty):
        yield _Objection(("frequency", "damping"), "look", "uncertainty not known")


def _twice(modes: ModalModel, i: int, same: Array) -> Iterator[_Objection]:
    """Yield that a mode may be another of the list once more, the stronger of both; `same`: which are the same by `same_mode`."""
    for j in same:
        if j != i and i not in _stronger(modes, i, int(j)):
            yield _Objection(QUANTITIES, "look", f"may be mode {j + 1} once more: frequency, damping and shape agree")


def _of_shape(known: float, phases: float) -> Iterator[_Objection]:
    """Yield what speaks against a shape: its own errors, `known` as of `_known_shapes`, and its `phases`, the MPC."""
    if not known >= _KNOWN_SHAPE:
        text = (
            f"errors leave it a MAC of {known:.2f} with itself"
            if np.isfinite(known)
            else "deviation of the shape not known"
        )
        yield _Objection(("shape",), "doubtful" if known < _UNKNOWN_SHAPE else "look", text)
    if phases < _MIN_MPC:
        yield _Objection(("shape",), "look", f"shape is complex (MPC {phases:.2f} in deviations of its outputs)")


def _known_shapes(modes: ModalModel) -> RealArray:
    """Return the MAC of each shape with the true one that its deviations leave, 1 / (1 + e^2), e the relative size of all errors, (n,).

    Infinite where no deviations are stated, and of a single output; NaN where one is not known.
    """
    if modes.shapes_std is None or len(modes.output_dofs) < 2:
        return np.full(len(modes), np.inf)
    size = np.sum(np.abs(modes.shapes) ** 2, axis=0)
    return np.asarray(1 / (1 + np.sum(modes.shapes_std**2, axis=0) / np.maximum(size, 1e-300)))


def _levelled(modes: ModalModel) -> ModalModel:
    """Return modes with shapes in levels of the errors of their outputs, or of their own size where no deviations are known.

    No unit changes what is in these.
    """
    stated = np.zeros(modes.shapes.shape) if modes.shapes_std is None else modes.shapes_std
    known = np.all(np.isfinite(stated) & (stated > 0), axis=0)
    sizes = np.asarray(stated[:, known] if known.any() else np.abs(modes.shapes), dtype=float)
    return divided(modes, np.sqrt(levels_of_table(sizes**2)[0]))


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


def _stronger(modes: ModalModel, a: int, b: int) -> tuple[int, ...]:
    """Return the more significant of two modes; none if that is not known."""
    gain = modes.gain
    if gain is None or not np.all(np.isfinite(np.asarray(gain)[[a, b]])):
        return ()
    return (a,) if gain[a] > gain[b] else (b,)
