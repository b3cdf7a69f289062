"""Rules of the choice of modes, switched off one by one, other paths of its descents, and cases of every kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

import modalscope as ms
from modalscope.analysis.workflow import bands, refining
from modalscope.data.analysis import Analysis
from modalscope.data.indicators import mac
from modalscope.data.results import StabilizationDiagram
from modalscope.numerics.checks import Array, ComplexArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging import (
    copies,
    evidence,
    joint_selection,
    outcome,
    recount,
    refine,
    select,
    selection_problem,
    verdict,
)
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.likelihood import descent, reference_model, settling
from tests.selection.judging import any_ambient
from tests.selection.judging.ambient_records import beside_a_machine, random_structure as ambient_structure
from tests.selection.judging.coloured import coloured_response, unit_errors, white_errors
from tests.selection.judging.hard import Structure, frequency_response, impulse_response, lines_of, random_structure
from tests.selection.judging.narrow import narrow_case
from tests.selection.judging.pairs import structure_with_pair
from tests.selection.judging.plates import Errors, plate, plate_response
from tests.selection.judging.shifted import KINDS, missed_and_false, shifted_response, shifted_structure
from tests.selection.judging.sub_bands import sub_band
from tests.selection.judging.test_hidden import DAMPING, FREQUENCIES, hidden
from tests.selection.judging.test_windowed_lines import response_of as windowed_response


class Rule(NamedTuple):
    """Where a rule stands, and what stands there when it is off."""

    place: Any
    name: str
    off: Any


def _same(state: Any, *_: Any, **__: Any) -> Any:
    return state


def _nothing(*_: Any, **__: Any) -> None:
    return None


def _no_poles(*_: Any, **__: Any) -> ComplexArray:
    return np.zeros(0, complex)


def _no_pairs(poles: Any, *_: Any) -> Array:
    return np.zeros((len(poles), len(poles)), bool)


def _ones(self: Any, poles: Array, *_: Any) -> Array:
    return np.ones(len(poles))


def _plain_levels(power: Array, even: Array, size: Array) -> tuple[Array, Array]:
    noise = np.asarray(even)[:, None] * np.mean(power / np.asarray(even)[:, None], axis=0)
    return np.broadcast_to(noise, power.shape).copy(), np.zeros(power.shape)


def _none_that_shift(self: Any, begun: list[int], _: Any) -> Any:
    """Return the next pole, and a fit of so many that is no choice."""
    begun = [*begun, next(k for k in range(len(self.which)) if k not in begun)]
    fit = self.fitted(self.poles[self.which[begun]][:, None, None], steps=1)
    return begun, copies._Centred(fit.means, fit, np.inf)


#: What is switched off in the choice: a function that does nothing then, or a threshold that never holds.
RULES = {
    # white errors: the joint selection
    "joint: peaks of the residual": Rule(joint_selection, "strongest_peaks", lambda *_: []),
    "joint: each round whitens": Rule(joint_selection, "MAX_EXCESS_RATIO", np.inf),
    "joint: a strong mode was missing": Rule(joint_selection, "_MAX_MISFIT_RATIO", 0.0),
    "joint: levels divided anew": Rule(joint_selection, "_levelled", _same),
    "joint: one pole or two": Rule(joint_selection, "_split_where_needed", _same),
    "joint: weak poles fitted without": Rule(joint_selection, "_without_redundant", _same),
    "joint: noise of the channels of a mode": Rule(joint_selection, "_above_channel_noise", _same),
    "joint: lines around a weak mode": Rule(joint_selection, "_MAX_LOCAL", 0.0),
    "joint: tried at half of the bar": Rule(joint_selection, "_UNREFINED_FRACTION", 1.0),
    "joint: variance of the fit": Rule(joint_selection, "variance_of_fit", lambda selection, _: selection.variance),
    "joint: collinear neighbours stay": Rule(joint_selection, "collinear", _no_pairs),
    "problem: poles near the band": Rule(selection_problem, "_MAX_OUTSIDE", np.inf),
    "problem: damping below .9": Rule(selection_problem, "_MAX_DAMPING", np.inf),
    "problem: wider than a part of a line": Rule(selection_problem, "_MIN_BANDWIDTH", 0.0),
    "problem: correlation of noise": Rule(selection_problem, "gain_factor_in_correlated_noise", lambda c, _: c * 0 + 1),
    "problem: window of noise": Rule(selection_problem, "gain_factor_under_window", lambda _, half: half * 0 + 1),
    # coloured errors
    "coloured: peaks": Rule(joint_selection, "_with_significant_peaks", _nothing),
    "coloured: strongest of those that share a peak": Rule(joint_selection, "significant_peaks", lambda _, r: r > 1),
    "coloured: shoulders of a shifting mode": Rule(
        recount.Recount, "hosts", lambda self, which: np.zeros((len(which), len(self.descent.point.poles)), bool)
    ),
    "coloured: no lines": Rule(recount.Recount, "lasting", lambda self, which: np.ones(len(which), bool)),
    "coloured: narrowest mode": Rule(recount, "_MIN_BANDWIDTH_LINES", 0.0),
    "coloured: narrowest peak": Rule(recount, "_MIN_PEAK_LINES", 0.0),
    "coloured: uncertainty of error variances": Rule(recount, "UNCERTAINTY_OF_VARIANCE", 1.0),
    "coloured: errors that go with the response": Rule(recount, "parts_of_level", _plain_levels),
    "coloured: level of the lines around": Rule(recount, "smoothed", lambda v, _: np.full(len(v), np.mean(v))),
    "coloured: correlation of errors": Rule(recount, "_correlations", lambda *_: (np.zeros(0), np.zeros(0))),
    "coloured: lines by their level": Rule(verdict, "by_line", _same),
    "coloured: levels are products": Rule(reference_model.Floor, "of_products", _same),
    "coloured: quieter lines are tried": Rule(reference_model.Floor, "quiet", _same),
    # one mode or several
    "copies: two modes or one that shifts": Rule(verdict, "copies_of", _nothing),
    "copies: scatter of a single mode": Rule(copies, "_MAX_SCATTER", np.inf),
    "copies: what shifts may lack": Rule(copies, "_MAX_LACKING", 0.0),
    "copies: least shift": Rule(copies, "_LEAST_SHIFT", 1e-9),
    "copies: rank of one pole": Rule(copies._Cluster, "_rank", lambda *_: 1),
    "copies: several modes that shift": Rule(copies._Cluster, "_next", _none_that_shift),
    "hosts: collinear parts": Rule(verdict, "collinear", _no_pairs),
    # verdict
    "verdict: poles outside the band": Rule(verdict, "out_of_band_poles", _no_poles),
    "verdict: poles beside": Rule(verdict, "needed_beside", _no_poles),
    "verdict: whiter beside poles outside": Rule(verdict, "MAX_EXCESS_RATIO", 0.0),
    "verdict: a quarter of the orders": Rule(verdict, "_MIN_SHARE_OF_ORDERS", 0.0),
    "verdict: merged groups": Rule(verdict, "merge_splits", _same),
    "joint: rounding has no colour": Rule(joint_selection, "_ROUNDING_OF_FIT", 1e-160),
    "verdict: data without noise": Rule(verdict, "_MAX_COMPUTED", 0.0),
    "verdict: uncertain modes": Rule(verdict, "_MAX_DEVIATION", np.inf),
    "verdict: distance under coloured errors": Rule(verdict, "_MAX_DISTANCE_COLOURED", 0.3),
    "verdict: damped poles near an end": Rule(verdict, "_may_stand_outside", lambda *_: False),
    "verdict: at a peak": Rule(verdict, "_at_peak", _nothing),
    "verdict: orders end": Rule(verdict, "_late", lambda *_: False),
    "verdict: starts of other shape": Rule(verdict, "_SAME_START_MAC", -1.0),
    # counting
    "counted: orders at least": Rule(evidence, "LEAST_ORDERS", 0),
    "counted: share of the orders": Rule(evidence, "LEAST_SHARE", 0.0),
    "counted: persistence": Rule(evidence, "LEAST_PERSISTENCE", 0.0),
    "counted: signal": Rule(evidence, "LEAST_SIGNAL", 0.0),
    "counted: visible": Rule(evidence, "_visible", lambda *_: True),
    "counted: certain": Rule(evidence, "CERTAIN", 0.0),
    "counted: uncertain": Rule(evidence, "UNCERTAIN", np.inf),
    "counted: clear peak": Rule(evidence, "CLEAR", np.inf),
    "counted: broken tracks joined": Rule(evidence, "join_broken", lambda _, groups: groups),
    "counted: splits merged": Rule(evidence, "merge_splits", _same),
    "counted: orders that fit noise": Rule(evidence, "usable_orders", lambda d: (d.orders, float(d.fit_errors.min()))),
    "counted: deviation of setups": Rule(evidence, "deviations_between", _nothing),
    "record: objections": Rule(select, "with_objections_of_record", lambda _, candidates: list(candidates)),
}

_descend_from = settling.descend_from

#: What is switched off in the refinement of the chosen modes.
RULES_OF_REFINEMENT = {
    "refined: peaks of records": Rule(refine, "completed", lambda task, modes, settled: modes),
    "refined: modes stay at home": Rule(
        settling, "descend_from", lambda point, home=None, **options: _descend_from(point, **options)
    ),
    "refined: poles held beside": Rule(refining, "terms_of", lambda modes: (np.zeros(0, complex), None)),
    "refined: powers of terms": Rule(settling, "_needed_powers", lambda task, _: task.powers),
    "refined: levels of lines": Rule(settling, "_uneven", lambda *_: False),
    "refined: least gain": Rule(refine, "least_gain", lambda _: 0.0),
    "refined: poles besides the shapes": Rule(outcome, "_poles_besides", _no_poles),
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


#: Functions without which no rule of a group runs.
_OF_GROUP = {
    "coloured": (recount, "errors_of"),
    "copies": (verdict, "copies_of"),
    "counted": (select, "counted"),
    "joint": (verdict, "select_jointly"),
    "problem": (verdict, "select_jointly"),
    "verdict": (select, "likely"),
}


@contextmanager
def counted_calls(rules: dict[str, Rule]) -> Iterator[set[str]]:
    """Collect the names of rules that run; one that never ran changes nothing when it is off. Thresholds run with their group."""
    ran: set[str] = set()

    def watched(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any, **options: Any) -> Any:
            ran.add(name)
            return call(*arguments, **options)

        return run

    with ExitStack() as stack:
        for name, (place, attribute) in _OF_GROUP.items():
            stack.enter_context(patch.object(place, attribute, watched(name, getattr(place, attribute))))
        for name, rule in rules.items():
            there = getattr(rule.place, rule.name)
            if callable(there) and not hasattr(there, "register"):  # one that dispatches keeps what it has registered
                stack.enter_context(patch.object(rule.place, rule.name, watched(name, there)))
        yield ran
    always = {name for name, rule in rules.items() if not callable(getattr(rule.place, rule.name)) or name in ran}
    groups = {name.split(":")[0] for name in rules}
    silent = {group for group in groups if group in _OF_GROUP and group not in ran}
    ran |= {name for name in always if name.split(":")[0] not in silent}
    ran -= set(_OF_GROUP)


class Case(NamedTuple):
    """Data, and the true poles (n,) in rad/s; None where they are not known."""

    data: Any
    poles: ComplexArray | None


def _exact(seed: int) -> Case:
    structure = random_structure(seed)
    f = np.linspace(0.7 * np.abs(structure.poles).min(), 1.15 * np.abs(structure.poles).max(), 500) / (2 * np.pi)
    values = lines_of(structure, f)
    return Case(ms.FrequencyResponse(values=values, frequencies=f, quantity=structure.quantity), structure.poles)


def _noise(seed: int) -> Case:
    rng = np.random.default_rng([seed, 20])
    values = rng.standard_normal((300, 4, 2)) + 1j * rng.standard_normal((300, 4, 2))
    return Case(ms.FrequencyResponse(values=values, frequencies=np.arange(1.0, 301.0)), np.zeros(0, complex))


def _known(structure: Structure, data: Any) -> Case:
    return Case(data, structure.poles)


def _shifted(kind: str) -> Callable[[int], Case]:
    def case(seed: int) -> Case:
        structure = shifted_structure(seed, pair=KINDS[kind].pair)
        return _known(structure, shifted_response(structure, KINDS[kind], seed))

    return case


def _free_shapes(rng: np.random.Generator, poles: ComplexArray, sizes: Array, channels: tuple[int, int]) -> Structure:
    """Return a structure of poles whose residues have rank one and a size each."""
    l, m = channels
    shapes, sides = rng.standard_normal((l, len(poles))), rng.standard_normal((m, len(poles)))
    own = (sizes * np.abs(poles.real) / (2j * poles.imag) * np.abs(poles))[:, None, None]
    return Structure(poles, np.einsum("on,in->noi", shapes, sides) * own, "displacement")


def _triple(seed: int) -> Case:
    """Three modes half to two half bandwidths apart among others, white noise of 40 dB."""
    rng = np.random.default_rng([seed, 77])
    f = 40 * np.cumprod(1 + rng.uniform(0.1, 0.4, int(rng.integers(4, 8))))
    zeta = 10 ** rng.uniform(-2.5, -1.5, len(f))
    k = int(rng.integers(len(f)))
    f = np.append(f, f[k] * (1 + zeta[k] * np.cumsum(rng.uniform(0.5, 2, 2))))
    zeta = np.append(zeta, zeta[k] * rng.uniform(0.7, 1.4, 2))
    channels = int(rng.integers(3, 8)), int(rng.integers(2, 4))
    structure = _free_shapes(rng, poles_from(f, zeta), np.ones(len(f)), channels)
    return _known(structure, frequency_response(structure, 40, seed, lines=1500)[0])


def _repeated(coloured: bool) -> Callable[[int], Case]:
    """One mode of some twice, with another shape at the same pole: white noise of 40 dB, or errors of 1 % that are smooth over lines."""

    def case(seed: int) -> Case:
        rng = np.random.default_rng([seed, 82])
        f = 40 * np.cumprod(1 + rng.uniform(0.1, 0.4, int(rng.integers(3, 7))))
        poles = poles_from(f, 10 ** rng.uniform(-2.7, -1.6, len(f)))
        poles = np.append(poles, rng.choice(poles))
        structure = _free_shapes(rng, poles, np.ones(len(poles)), (int(rng.integers(3, 9)), int(rng.integers(2, 5))))
        response = frequency_response(structure, 60 if coloured else 40, seed, lines=1200)[0]
        H = response.values * (1 + 0.01 * coloured * unit_errors(rng, response.values.shape, 9))
        return _known(structure, ms.FrequencyResponse(values=H, frequencies=response.frequencies))

    return case


def _weak(seed: int) -> Case:
    """Two modes 20 to 50 dB weak beside others, errors of .3 to 3 % of the response, line by line."""
    rng = np.random.default_rng([seed, 78])
    f = 30 * np.cumprod(1 + rng.uniform(0.05, 0.5, int(rng.integers(5, 9))))
    sizes = np.ones(len(f))
    sizes[rng.permutation(len(f))[:2]] = 10 ** (-rng.uniform(20, 50, 2) / 20)
    poles = poles_from(f, 10 ** rng.uniform(-2.7, -1.6, len(f)))
    structure = _free_shapes(rng, poles, sizes, (int(rng.integers(3, 9)), int(rng.integers(1, 4))))
    grid = np.linspace(0.7 * f[0], 1.1 * f[-1], 1500)
    H = lines_of(structure, grid)
    H = H + rng.choice([0.003, 0.01, 0.03]) * np.abs(H) * white_errors(rng, np.ones(H.shape), np.sqrt(2))
    return _known(structure, ms.FrequencyResponse(values=H + white_errors(rng, H, 1e-5), frequencies=grid))


def _beside_lines(seed: int) -> Case:
    """Errors of `coloured`, and a sinusoid that a Hann window spreads over three lines of all channels."""
    structure = random_structure(seed)
    response, rng = coloured_response(structure, seed), np.random.default_rng([seed, 79])
    H, at = np.array(response.values), int(rng.integers(50, 450))
    tone = np.exp(2j * np.pi * rng.uniform(size=H.shape[1:])) * np.abs(H).max(axis=0) * rng.uniform(0.1, 0.5)
    H[at - 1 : at + 2] += np.array([-0.5, 1, -0.5])[:, None, None] * tone
    known = {"frequencies": response.frequencies, "quantity": response.quantity}
    return _known(structure, ms.FrequencyResponse(values=H, **known))


def _loud_channels(seed: int) -> Case:
    """White noise whose level differs by up to a thousand from channel to channel."""
    structure, rng = random_structure(seed), np.random.default_rng([seed, 81])
    clean = _exact(seed).data
    level = 10 ** rng.uniform(-4, -1, clean.values.shape[1:])
    values = clean.values + level * white_errors(rng, clean.values, 1.0)
    return _known(
        structure, ms.FrequencyResponse(values=values, frequencies=clean.frequencies, quantity=clean.quantity)
    )


def _alike_pair(seed: int) -> Case:
    """A pair of one shape, a half bandwidth apart, 20 dB."""
    structure = structure_with_pair(seed, 1.0, 1.0, inputs=1 + seed % 2, alike=True)
    return _known(structure, frequency_response(structure, 20, seed)[0])


def _hidden(seed: int) -> Case:
    return Case(hidden(seed), poles_from(FREQUENCIES[1:], DAMPING[1:]))


def _window(seed: int) -> Case:
    return Case(windowed_response(seed), ms.systems.chain5().modes().poles)


def _part(coloured: bool) -> Callable[[int], Case]:
    def case(seed: int) -> Case:
        found = sub_band(seed, 40.0, coloured=coloured)
        f = np.abs(found.structure.poles) / (2 * np.pi)
        inside = (f > found.band[0]) & (f < found.band[1])
        return Case(found.response.band(*found.band), found.structure.poles[inside])

    return case


def _narrow(seed: int) -> Case:
    case = narrow_case(seed)
    return Case(case.response.band(*case.band), case.within.poles)


def _driven(sine: bool) -> Callable[[int], Case]:
    """A record under measured random forces, 30 s, noise of 20 dB; `sine`: unmeasured forces of a machine beside them."""

    def case(seed: int) -> Case:
        chain = ms.systems.chain5()
        record = chain.simulate(inputs="white", duration=60, sampling_rate=20, noise=0.1, seed=seed)
        if sine:
            rng, y = np.random.default_rng([seed, 80]), np.array(record.outputs)
            t = np.arange(len(y))[:, None] / 20
            y += y.std() * rng.uniform(0.1, 0.3, y.shape[1]) * np.sin(2 * np.pi * rng.uniform(0.5, 6) * t)
            record = ms.Signals(outputs=y, inputs=record.inputs, sampling_rate=20)
        return Case(record, chain.modes().poles)

    return case


def _ambient(family: str, disturbance: str = "") -> Callable[[int], Case]:
    def case(seed: int) -> Case:
        found = any_ambient.FAMILIES[family](seed)
        found = any_ambient.disturbed(found, disturbance, seed) if disturbance else found
        seen = found.visible()
        truth = found.truth
        return Case(found.record, poles_from(truth.frequencies[seen], truth.damping_ratios[seen]))

    return case


def _machine(seed: int) -> Case:
    found = beside_a_machine(seed, 1e-3)
    return Case(found.record, poles_from(found.structure.frequencies, found.structure.damping_ratios))


def _nothing_but_noise(seed: int) -> Case:
    y = np.random.default_rng(500 + seed).standard_normal((20_000, 1 + seed % 5))
    return Case(ms.Signals(outputs=y, sampling_rate=100.0), np.zeros(0, complex))


def _short(seed: int) -> Case:
    """A random structure under ambient forces, a fifth of its usual time."""
    from dataclasses import replace

    structure = ambient_structure(seed)
    structure = replace(structure, duration=structure.duration / 5)
    return Case(structure.record(1.2, seed), poles_from(structure.frequencies, structure.damping_ratios))


#: Kinds of data: how a case is made of a seed.
CASES: dict[str, Callable[[int], Case]] = {
    "lines, 40 dB": lambda seed: _known(
        random_structure(seed), frequency_response(random_structure(seed), 40, seed)[0]
    ),
    "lines, 20 dB": lambda seed: _known(
        random_structure(seed), frequency_response(random_structure(seed), 20, seed)[0]
    ),
    "samples, 40 dB": lambda seed: _known(
        random_structure(seed), impulse_response(random_structure(seed), 40, seed)[0]
    ),
    "samples, 20 dB": lambda seed: _known(
        random_structure(seed), impulse_response(random_structure(seed), 20, seed)[0]
    ),
    "close pairs": lambda seed: _known(
        structure_with_pair(seed, 0.3, 0.95), frequency_response(structure_with_pair(seed, 0.3, 0.95), 20, seed)[0]
    ),
    "close pairs of one shape": _alike_pair,
    "close triples": _triple,
    "repeated modes": _repeated(False),
    "repeated modes, coloured": _repeated(True),
    "modes behind stronger ones": _hidden,
    "channels of unlike noise": _loud_channels,
    "noise": _noise,
    "no noise": _exact,
    "parts of a band, white": _part(False),
    "parts of a band, coloured": _part(True),
    "lines under a window": _window,
    "weak modes, errors of a part": _weak,
    "coloured errors": lambda seed: _known(random_structure(seed), coloured_response(random_structure(seed), seed)),
    "coloured errors, a sinusoid": _beside_lines,
    "plates": lambda seed: _known(plate(seed), plate_response(plate(seed), Errors(0.1, 20, 5e-4, 40.0, 800), seed)),
    "narrow bands": _narrow,
    **{f"shifted: {kind}": _shifted(kind) for kind in KINDS},
    "records with forces": _driven(False),
    "records with forces, a machine": _driven(True),
    **{f"ambient: {family}": _ambient(family) for family in any_ambient.FAMILIES},
    **{f"ambient, {kind}": _ambient("5 to 12 modes on 10 to 30 channels", kind) for kind in any_ambient.DISTURBANCES},
    "ambient: beside a machine": _machine,
    "ambient: short": _short,
    "ambient: noise": _nothing_but_noise,
}


class Posed(NamedTuple):
    """The diagram of a case, and the true poles in its band."""

    diagram: StabilizationDiagram
    poles: ComplexArray


@cache
def posed(kind: str, seed: int) -> Posed:
    """Return a case as the choice meets it: responses by the default method, records as the main job cuts them, in their fullest band."""
    data, poles = CASES[kind](seed)
    if kind == "no noise":
        return Posed(ms.stabilize(data, method="lscf"), poles)
    if not isinstance(data, ms.Signals):
        return Posed(ms.stabilize(data), poles)
    looks = bands.looked_at(data, Analysis())
    f = np.abs(poles) / (2 * np.pi)
    inside = [(f >= look.reported[0]) & (f <= look.reported[1]) for look in looks]
    fullest = int(np.argmax([own.sum() for own in inside]))
    return Posed(looks[fullest].fitted, poles[inside[fullest]])


def frequencies_of(diagram: StabilizationDiagram) -> Array:
    """Return the list, Hz."""
    return np.asarray(ms.select(diagram).frequencies)


def chosen(case: Posed, *, refined: bool) -> ms.ModalModel:
    """Return the list of a case, or what its refinement leaves of it."""
    if refined:
        return refining.refined_where_it_helps(case.diagram, select.selected(case.diagram))
    return ms.select(case.diagram)


class Full(NamedTuple):
    """The list under all rules, its faults, and the rules that ran."""

    modes: ms.ModalModel
    faults: int
    ran: frozenset[str]


@cache
def full(kind: str, seed: int, refined: bool) -> Full:
    """Return the list of a case under all rules."""
    case = posed(kind, seed)
    with counted_calls(RULES_OF_REFINEMENT if refined else RULES) as ran:
        modes = chosen(case, refined=refined)
    return Full(modes, faults_of(case.poles, modes), frozenset(ran))


def faults_of(poles: ComplexArray, modes: ms.ModalModel) -> int:
    """Return how many true modes are not listed, and how many listed ones are none."""
    return sum(missed_and_false(Structure(poles, np.zeros((len(poles), 1, 1)), ""), modes))


#: What may become of a list when a rule is off.
CHANGES = ("more faults", "fewer faults", "as many faults", "other damping or shapes")


def change_without(rule: str, kind: str, seed: int) -> str | None:
    """Return which of `CHANGES` the list of a case undergoes without a rule, "" for none; None where the rule did not run."""
    refined = rule in RULES_OF_REFINEMENT
    whole, case = full(kind, seed, refined), posed(kind, seed)
    if rule not in whole.ran:
        return None
    with changed((RULES | RULES_OF_REFINEMENT)[rule]):
        other = chosen(case, refined=refined)
    if not alike(whole.modes.frequencies, other.frequencies):
        more = faults_of(case.poles, other) - whole.faults
        return CHANGES[0] if more > 0 else CHANGES[1] if more < 0 else CHANGES[2]
    return "" if not len(other) or values_alike(whole.modes, other) else CHANGES[3]


def alike(one: Array, other: Array) -> bool:
    """Whether two lists hold the same modes, to .2 %."""
    return len(one) == len(other) and bool(np.allclose(one, other, rtol=2e-3))


def values_alike(one: ms.ModalModel, other: ms.ModalModel) -> bool:
    """Whether two lists of the same modes have the same shapes, and the same damping to a tenth."""
    shapes = np.diag(mac(one.shapes, other.shapes)) > 0.99
    return bool(shapes.all() and np.allclose(one.damping_ratios, other.damping_ratios, rtol=0.1))
