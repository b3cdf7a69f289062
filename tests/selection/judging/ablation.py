"""Rules of the choice of modes, switched off one by one, other paths of its descents, and cases of every kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

import modalscope as ms
from modalscope.data.results import StabilizationDiagram
from modalscope.numerics.checks import Array, ComplexArray
from modalscope.selection.judging import copies, joint_selection, recount, selection_problem, verdict
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.likelihood import descent
from tests.selection.judging.coloured import coloured_response
from tests.selection.judging.hard import frequency_response, impulse_response, lines_of, random_structure
from tests.selection.judging.narrow import narrow_case
from tests.selection.judging.pairs import structure_with_pair
from tests.selection.judging.plates import Errors, plate, plate_response
from tests.selection.judging.shifted import KINDS, shifted_response, shifted_structure


class Rule(NamedTuple):
    """Where a rule stands, and what stands there when it is off."""

    place: Any
    name: str
    off: Any


def _same(state: Any, *_: Any) -> Any:
    return state


def _none_of(self: Any, which: Array, *_: Any) -> Array:
    return np.zeros((len(which), len(self.descent.point.poles)), bool)


def _all_of(self: Any, which: Array, *_: Any) -> Array:
    return np.ones(len(which), bool)


def _ones(self: Any, poles: Array) -> Array:
    return np.ones(len(poles))


#: What is switched off: a function that does nothing then, or a threshold that never holds.
RULES = {
    "copies of shifting resonances": Rule(verdict, "copies_of", lambda *_: None),
    "scatter of a single mode": Rule(copies, "_MAX_SCATTER", np.inf),
    "shoulders of a shifting mode": Rule(recount.Recount, "hosts", _none_of),
    "coherent lines": Rule(recount.Recount, "lasting", _all_of),
    "uncertainty of error variances": Rule(recount, "UNCERTAINTY_OF_VARIANCE", 1.0),
    "peaks of coloured errors": Rule(joint_selection, "_with_significant_peaks", lambda *_: None),
    "noise of the channels of a mode": Rule(joint_selection, "_above_channel_noise", _same),
    "one pole or two": Rule(joint_selection, "_split_where_needed", _same),
    "weak poles fitted without": Rule(joint_selection, "_without_redundant", _same),
    "correlation and window of noise": Rule(selection_problem.SelectionProblem, "gain_factors", _ones),
    "poles outside the band": Rule(verdict, "out_of_band_poles", lambda *_: np.zeros(0, complex)),
    "a quarter of the orders": Rule(verdict, "_MIN_SHARE_OF_ORDERS", 0.0),
    "collinear parts": Rule(verdict, "collinear", lambda s, *_: np.zeros((len(s), len(s)), bool)),
    "merged groups": Rule(verdict, "merge_splits", _same),
    "data without noise": Rule(verdict, "_MAX_COMPUTED", 0.0),
    "uncertain modes": Rule(verdict, "_MAX_DEVIATION", np.inf),
}


def _moved(selection: SelectionProblem, poles: ComplexArray, sides: ComplexArray, **options: Any) -> Any:
    """Select from starts a quarter of a half bandwidth off, the last one first."""
    rng = np.random.default_rng(len(poles))
    away = np.exp(2j * np.pi * rng.uniform(size=len(poles)))
    return joint_selection.select_jointly(selection, (poles - 0.25 * poles.real * away)[::-1], sides[::-1], **options)


#: Other ways to the same optimum: damping that falls to a sixth after every step, other starts, half and twice the steps.
PATHS = {
    "another damping": Rule(descent, "_lessening", lambda *_: 1 / 6),
    "other starts": Rule(verdict, "select_jointly", _moved),
    "half the steps": Rule(joint_selection, "_BRIEF_ROUND", {"tolerance": 1e-5, "most": 4}),
    "twice the steps": Rule(joint_selection, "_BRIEF_ROUND", {"tolerance": 1e-5, "most": 16}),
}


@contextmanager
def changed(rule: Rule) -> Iterator[None]:
    """Switch a rule off, or take another path."""
    with patch.object(rule.place, rule.name, rule.off):
        yield


def _exact(seed: int) -> Any:
    structure = random_structure(seed)
    f = np.linspace(0.7 * np.abs(structure.poles).min(), 1.15 * np.abs(structure.poles).max(), 500) / (2 * np.pi)
    return ms.FrequencyResponse(values=lines_of(structure, f), frequencies=f, quantity=structure.quantity)


def _noise(seed: int) -> Any:
    rng = np.random.default_rng([seed, 20])
    values = rng.standard_normal((300, 4, 2)) + 1j * rng.standard_normal((300, 4, 2))
    return ms.FrequencyResponse(values=values, frequencies=np.arange(1.0, 301.0))


def _plate(seed: int) -> Any:
    return plate_response(plate(seed), Errors(0.1, 20, 5e-4, 40.0, 800), seed)


def _shifted(kind: str) -> Callable[[int], Any]:
    return lambda seed: shifted_response(shifted_structure(seed, pair=KINDS[kind].pair), KINDS[kind], seed)


#: Kinds of data: how a response is made of a seed; of all but "no noise" the diagram of the default method is taken.
CASES: dict[str, Callable[[int], Any]] = {
    "lines, 40 dB": lambda seed: frequency_response(random_structure(seed), 40, seed)[0],
    "lines, 20 dB": lambda seed: frequency_response(random_structure(seed), 20, seed)[0],
    "samples, 40 dB": lambda seed: impulse_response(random_structure(seed), 40, seed)[0],
    "samples, 20 dB": lambda seed: impulse_response(random_structure(seed), 20, seed)[0],
    "close pairs": lambda seed: frequency_response(structure_with_pair(seed, 0.3, 0.95), 20, seed)[0],
    "noise": _noise,
    "no noise": _exact,
    "coloured errors": lambda seed: coloured_response(random_structure(seed), seed),
    "plates": _plate,
    "narrow bands": _noise,
    **{f"shifted: {kind}": _shifted(kind) for kind in KINDS},
}


def diagram_of_case(kind: str, seed: int) -> StabilizationDiagram:
    """Return the diagram of a case: no rule that is switched off here has a part in it."""
    if kind == "narrow bands":
        case = narrow_case(seed)
        return ms.stabilize(case.response, band=case.band)
    return ms.stabilize(CASES[kind](seed), **({"method": "lscf"} if kind == "no noise" else {}))


def frequencies_of(diagram: StabilizationDiagram) -> Array:
    """Return the list, Hz."""
    return np.asarray(ms.select(diagram).frequencies)


def alike(one: Array, other: Array) -> bool:
    """Whether two lists hold the same modes, to .2 %."""
    return len(one) == len(other) and bool(np.allclose(one, other, rtol=2e-3))
