"""Assign the outcome of the joint selection to the groups of a diagram: modes, parts of modes, and rejected poles with reasons.

Values are those of the diagram, the median of the orders that agree, so that every method keeps its own; a mode of white data that no
orders agree on has refined ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any

import numpy as np

from modalscope.data.deferred import Deferred
from modalscope.data.indicators import mac
from modalscope.data.rebuilt import contributions
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.shown import figures, percent
from modalscope.data.whitening import levels_of_channels
from modalscope.identification.orders import usable_orders
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.selection.judging.copies import Copies, clusters_of, copies_of
from modalscope.selection.judging.evidence import (
    LEAST_PEAK,
    LEAST_PERSISTENCE,
    LEAST_PROMINENCE,
    NO_PERIOD,
    Candidate,
    Evidence,
    Own,
    judge,
    peaks,
)
from modalscope.selection.judging.joint_selection import MAX_EXCESS_RATIO, Outcome, gains_in_residual, select_jointly
from modalscope.selection.judging.recount import recount_of
from modalscope.selection.judging.selection_problem import MAX_DAMPING_OF_RESONANCES, SelectionProblem
from modalscope.selection.judging.tracking import GAP, Poles, collinear, consensus, merge_splits, tracks
from modalscope.selection.likelihood.likelihood import whitened
from modalscope.selection.likelihood.reference_model import Floor, by_line, floor_of
from modalscope.selection.likelihood.settling import needed_beside, out_of_band_poles
from modalscope.selection.likelihood.whitening import search_bound

# ---------------------------------------------------------------------------------------------------------- objections
# Reasons against a mode, in words.

#: Standard deviations above this (half bandwidths, damping ratios) are not stated: they carry no information.
_MAX_STATED_DEVIATION = 10.0


def left_open(apart: float, damped: float) -> str:
    """Say how uncertain a mode is, in half-power half bandwidths and relative to its damping."""
    if not (apart < _MAX_STATED_DEVIATION and damped < _MAX_STATED_DEVIATION):
        return "frequency or damping undetermined by the data"
    return f"uncertain: frequency by {figures(apart, 2)} half bandwidths, damping by {percent(damped, 2)} (one standard deviation)"


def too_little(gain: float, bar: float, *, coloured: bool) -> str:
    """Return why a group is not significant: noise or coloured errors may explain it.

    `gain`, `bar`: what it explains and what noise may, in standard deviations. `coloured`: errors were treated as coloured.
    """
    if gain > bar and coloured:
        return f"barely above the noise: significance {gain:.1f}; white noise reaches {bar:.1f}, these errors more"
    return f"significance {gain:.1f} given the other modes; noise alone reaches {bar:.1f}"


# --------------------------------------------------------------------------------------------------------- one residue
# The residue of a mode that the data need several poles for.


def one_residue(response: Response, pole: complex, parts: ComplexArray, residues: ComplexArray) -> ComplexArray:
    """Fit the residue of one pole to the joint response of several, (l, m).

        min over R, terms of |sum_k (R_k g(s_k) + conjugate) - R g(s) - conjugate - terms|^2

    in every channel. The data themselves are not fitted: weak modes would compensate for shifts of strong ones.

    `response`: one channel of the data. `pole`: s, rad/s, as it is in the data. `parts` (k,): poles s_k. `residues` (k, l, m).
    """
    basis = response.basis(np.append(pole, parts), response.outside_powers)
    columns = np.hstack([basis.terms, basis.by_pole[:, 0]])
    functions = basis.by_pole[:, 1:].reshape(len(basis.data), -1)
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    whole = np.stack([residues.real, residues.imag], axis=1).reshape(functions.shape[1], -1)
    # of what all give together the columns see no more than what they see of each function: these are few, and channels many
    seen = np.linalg.lstsq(columns / size, functions, rcond=None)[0][-2:] / size[-2:, None]
    found = seen @ whole
    return np.asarray((found[0] + 1j * found[1]).reshape(residues.shape[1:]))


# ------------------------------------------------------------------------------------------------------------- verdict

#: Maximum standard deviation of frequency (half bandwidths) and damping (relative) of a mode, and maximum distance of a cluster from
#: its refined pole (half bandwidths).
_MAX_DEVIATION = 0.3

#: Maximum distance of a cluster under coloured errors, where a drifting resonance biases the refinement, in half bandwidths.
_MAX_DISTANCE_COLOURED = 0.5

#: A cluster shows a mode within a half bandwidth, this relative damping difference, and above this MAC.
_MAX_DAMPING_DIFFERENCE, _MIN_MAC = 0.5, 0.8

#: A pole that stands for modes outside the band has an end of it within so many half bandwidths: `out_of_band_poles` have it within one.
_REACH_OF_OUTSIDE = 2.0

#: Minimum share of the orders that show a mode under coloured errors.
_MIN_SHARE_OF_ORDERS = 0.25


@dataclass(frozen=True, eq=False)
class Contest:
    """What poles the data need, by one joint selection, whatever diagrams are judged by it.

    `selection`, `found`: what was posed, and its outcome; None where samples leave a coloured residual: then it has nothing else.
    """

    selection: SelectionProblem
    found: Outcome | None

    @property
    def outcome(self) -> Outcome:
        """`found` where it is there."""
        assert self.found is not None
        return self.found

    @cached_property
    def copies(self) -> Copies | None:
        """The poles that are copies of others, where that is evident.

        Not of correlations, whose errors follow the modes themselves.
        """
        light = self.selection.problem.light
        if light.grid is None or light.ambient:
            return None
        if self.outcome.recount is None and not clusters_of(self.outcome.poles):
            return None  # white errors, and no poles that overlap: nothing is to be told
        return copies_of(self.outcome.recount or recount_of(self.selection, self.outcome.descent))

    @cached_property
    def poles(self) -> ComplexArray:
        """The refined poles as modes have them, rad/s."""
        poles = self.outcome.poles if self.copies is None else self.copies.poles
        return poles + self.selection.problem.light.added_damping

    @cached_property
    def hosts(self) -> IntArray:
        """The mode that each pole is part of, by default itself.

        Those of `copies`. In coloured data where these are not known, and of a single row or column, whose hit or sensor makes one line of
        any kind for all channels: the strongest of overlapping poles of one shape.
        """
        gain, s = self.outcome.gain, self.outcome.poles
        host = np.arange(len(self.poles)) if self.copies is None else self.copies.host.copy()
        if not self.selection.coloured or (self.copies is not None and min(self.selection.problem.channels) > 1):
            return host
        shapes, participation = self.outcome.residues
        one = collinear(s, *((participation.T, shapes.T) if len(shapes) == 1 else (shapes, participation)))
        for j in np.argsort(-gain, kind="stable"):
            stronger = [k for k in np.flatnonzero(one[j]) if gain[k] > gain[j]]
            if stronger and host[j] == j:
                host[j] = host[max(stronger, key=lambda k: gain[k])]
        return np.asarray(host[host])

    @cached_property
    def deviations(self) -> Deferred:
        """The standard deviations of frequency (Hz) and damping ratio of each pole as a mode with its parts."""
        found = self.outcome

        def of_one(j: int) -> tuple[float, float]:
            parts = np.flatnonzero((self.hosts == j) & (np.arange(len(self.hosts)) != j))
            if parts.size:
                return found.as_one(j, parts)
            return float(found.frequency_std[j]), float(found.damping_std[j])

        return Deferred(len(found.poles), lambda index: np.array([of_one(j) for j in index.tolist()]).T)

    @cached_property
    def recounted(self) -> Deferred:
        """The gain of each pole relative to coloured errors; see `Recount.relative_gains`."""
        recount, count = self.outcome.recount, len(self.outcome.poles)
        compute = np.zeros_like if recount is None else recount.relative_gains
        return Deferred(count, lambda index: compute(index)[None].astype(float), rows=1)


@dataclass(frozen=True, eq=False)
class SelectionResult:
    """A diagram, its poles and evidence, and the outcome of the joint selection; `shared`: of several diagrams."""

    diagram: StabilizationDiagram
    poles: Poles
    evidence: Evidence
    contest: Contest
    shared: bool = False

    @property
    def selection(self) -> SelectionProblem:
        """What was posed."""
        return self.contest.selection

    @property
    def found(self) -> Outcome:
        """The outcome of the joint selection."""
        return self.contest.outcome

    @property
    def bar(self) -> float:
        """What noise may explain, in standard deviations."""
        return float(np.sqrt(self.selection.bar / 2))

    @property
    def gain(self) -> RealArray:
        """What each mode explains, in standard deviations."""
        return np.asarray(np.sqrt(np.maximum(self.found.gain, 0) / 2))

    @cached_property
    def refined(self) -> tuple[Poles, RealArray]:
        """The refined poles, put at the last order, and the size of each one's term at its frequency; see `peaks`."""
        orders, s, (shapes, participation) = self.poles.orders, self.contest.poles, self.found.residues
        own = contributions(self.diagram.response, s, shapes.T, participation)
        poles = Poles(orders, np.full(len(s), orders[-1]), s, shapes.T, participation, own)
        return poles, peaks(self.diagram, poles, self.evidence)

    def left_open(self, j: int) -> tuple[float, float]:
        """Return the deviations of a mode with its parts: of frequency in half bandwidths, of damping in damping ratios."""
        f, zeta = (float(v) for v in frequencies_and_damping(self.contest.poles[j]))
        by_frequency, by_damping = self.contest.deviations.at(np.array([j]))[:, 0].tolist()
        return (by_frequency / (f * zeta), by_damping / zeta) if zeta > 0 else (np.inf, np.inf)

    def residue(self, candidate: Candidate, family: Array) -> ComplexArray | None:
        """Return the residue of a mode at the values it is listed with, from its poles; None for white data without copies.

        None of a contest on several diagrams, too: each has shapes of its own.
        """
        if self.shared or (not self.selection.coloured and self.contest.copies is None):
            return None
        listed = complex(poles_from(candidate.frequency, candidate.damping)) - self.diagram.as_measured.added_damping
        shapes, participation = self.found.residues
        each = np.einsum("ok,ki->koi", shapes[:, family], participation[family])
        return one_residue(self.selection.problem.light, listed, self.found.poles[family], each)


def verdicts(trial: SelectionResult, groups: list[Array]) -> list[Candidate]:
    """Return modes and all other candidates, these with the reasons against them.

    `groups`: poles that agree over orders, preferred sources of values first.
    """
    peak, fit = peaks(trial.diagram, trial.poles, trial.evidence), usable_orders(trial.diagram)[1]
    known = [judge(trial.poles, group, peak, fit, trial.evidence) for group in groups]
    host = trial.contest.hosts
    shown = [-1 if mode < 0 else int(host[mode]) for mode in _shown_by(trial, groups)]
    mine = {
        int(j): [c for c, mode in zip(known, shown, strict=True) if mode == j]
        for j in np.flatnonzero(host == np.arange(len(host)))
    }
    least = _MIN_SHARE_OF_ORDERS * len(trial.poles.orders)
    few = {j: max((c.members.size for c in each), default=0) < least for j, each in mine.items()}
    weak = (trial.gain < trial.bar) & (trial.found.recount is not None)
    # a mode that shifts is weak beside its own copies, and repeated modes beside each other: each was significant with the others
    copies = trial.contest.copies
    family = (
        np.zeros(len(host), bool) if copies is None else (np.bincount(host, minlength=len(host)) > 1) | copies.repeated
    )
    doubted = [j for j in mine if (few[j] or weak[j]) and not family[j]] if trial.selection.coloured else []
    again = dict(zip(doubted, trial.contest.recounted.at(np.array(doubted, dtype=int))[0], strict=True))
    modes = {j: _mode(trial, j, each, fit, host, again.get(j), few[j]) for j, each in mine.items()}
    parts = [_part(trial, int(j), modes[host[j]], fit) for j in np.flatnonzero(host != np.arange(len(host)))]
    left = _left(trial, [each for each, mode in zip(known, shown, strict=True) if mode < 0])
    return [*modes.values(), *parts, *left]


def _shown_by(trial: SelectionResult, groups: list[Array]) -> list[int]:
    """Return the pole that each group shows, the nearest one; -1 where there is none."""
    modes, (shapes, _) = trial.contest.poles, trial.found.residues
    f, zeta = frequencies_and_damping(modes)
    shown = []
    for group in groups:
        g, eta = np.median(trial.poles.frequency[group]), np.median(trial.poles.damping[group])
        alike = np.median(mac(shapes, trial.poles.shape[group].T), axis=1) if len(modes) else np.zeros(0)
        apart = np.abs(f - g) / np.maximum(f * zeta, g * eta)
        near = (apart < 1) & (np.abs(zeta - eta) < _MAX_DAMPING_DIFFERENCE * np.maximum(zeta, eta)) & (alike > _MIN_MAC)
        cost = np.where(near, apart + 1 - alike, np.inf)
        shown.append(int(np.argmin(cost)) if np.any(near) else -1)
    return shown


def _mode(
    trial: SelectionResult, j: int, groups: list[Candidate], fit: float, host: IntArray, again: float | None, rare: bool
) -> Candidate:
    """Return a mode with its gain, and the reasons against it: uncertain values, or too few orders."""
    several = bool(np.any(np.delete(host, j) == j))
    reach = _MAX_DISTANCE_COLOURED if trial.selection.coloured else _MAX_DEVIATION
    near = (
        groups
        if several and trial.contest.copies is None
        else [c for c in groups if _close(c, complex(trial.contest.poles[j]), reach)]
    )
    best = max(near, key=lambda c: c.members.size) if near else _by_itself(trial, j, fit)
    f, zeta = (float(v) for v in frequencies_and_damping(trial.contest.poles[j]))
    low, high = trial.diagram.as_measured.reported_band(trial.diagram.settings.band)
    hidden = again is not None and again <= 1
    gain = max(trial.gain[j], again * trial.bar if rare and again is not None and not hidden else 0.0)
    against = []
    if not low <= f <= high:
        against.append(f"outside the band, at {f:.5g} Hz")
    if f < trial.evidence.one_period:
        against.append(NO_PERIOD)
    if hidden:
        few_orders = f"found at {best.members.size} of {len(trial.poles.orders)} orders only, and errors are not white"
        against.append(few_orders if rare else too_little(gain, trial.bar, coloured=True))
    apart, damped = (deviation * trial.gain[j] / gain for deviation in trial.left_open(j))
    if zeta >= MAX_DAMPING_OF_RESONANCES and not groups and _may_stand_outside(trial, j):
        against.append(f"damping {percent(zeta, 2)}, not found in the diagram: may represent modes outside the band")
    if not (apart < _MAX_DEVIATION and damped < _MAX_DEVIATION):
        shown = _at_peak(trial, j, best, fit) if trial.selection.coloured else None
        best = best if shown is None else replace(shown, facts=shown.facts | {"uncertain": left_open(apart, damped)})
        against += [left_open(apart, damped)] if shown is None else []
    undecided: dict[str, Any] = (
        {"late": True}
        if hidden and rare and len(against) == 1 and zeta < MAX_DAMPING_OF_RESONANCES and _late(best, trial)
        else {}
    )
    if several and trial.contest.copies is not None:
        best = replace(best, frequency=f, damping=zeta)
        undecided |= trial.contest.copies.facts(turned=trial.selection.problem.turned)
    residue = trial.residue(best, np.flatnonzero(host == j))
    known = replace(best, against=tuple(against), facts=best.facts | _alone(trial, j) | undecided, residue=residue)
    return _with_gain(trial, known, gain)


def _may_stand_outside(trial: SelectionResult, j: int) -> bool:
    """Return whether a pole may stand for modes outside the band: in white errors those do whose bandwidth reaches an end of it."""
    f, zeta = frequencies_and_damping(trial.contest.poles[j])
    low, high = trial.selection.band
    return bool(trial.selection.coloured or min(f - low, high - f) < _REACH_OF_OUTSIDE * zeta * f)


def _at_peak(trial: SelectionResult, j: int, best: Candidate, fit: float) -> Candidate | None:
    """Return a mode that the data have a peak at, which it is most of: with the values of the orders, else refined ones; None without."""
    for each in (best, _by_itself(trial, j, fit)):
        if each.facts["share_of_peak"] >= LEAST_PEAK and each.facts["indicator_prominence"] >= LEAST_PROMINENCE:
            return each
    return None


def _late(group: Candidate, trial: SelectionResult) -> bool:
    """Return whether a group persists from its first order to the last: it began too late to be shown at more."""
    if not group.members.size:
        return False
    orders = trial.poles.orders
    return bool(
        group.facts["persistence"] >= LEAST_PERSISTENCE and group.facts["last_order"] >= orders[-min(GAP, len(orders))]
    )


def _alone(trial: SelectionResult, j: int) -> dict[str, str]:
    """Return the only input that makes a mode significant, if one does."""
    response, (_, participation) = trial.diagram.response, trial.found.residues
    share = np.abs(participation[j] / trial.selection.problem.sides[1]) ** 2
    rest = 1 - share.max() / share.sum()
    if share.size == 1 or trial.gain[j] ** 2 * rest > trial.bar**2:
        return {}
    return {"rests_on": response.input_dofs[int(np.argmax(share))]}


def _close(group: Candidate, mode: complex, reach: float) -> bool:
    """Return whether a group lies within this part of the wider half bandwidth of a mode."""
    middle = complex(poles_from(group.frequency, group.damping))
    return abs(middle - mode) < reach * max(-middle.real, -mode.real)


def _by_itself(trial: SelectionResult, j: int, fit: float) -> Candidate:
    """Return a mode that no orders agree on, with refined values."""
    poles, peak = trial.refined
    known = judge(poles, np.array([j]), peak, fit, trial.evidence)
    deviations = float(trial.found.frequency_std[j]), float(trial.found.damping_std[j])
    counted = {"orders_found": 0, "orders_tried": len(poles.orders)}
    shown = {name: known.facts[name] for name in ("signal_to_noise", "share_of_peak", "indicator_prominence")}
    values = Own(poles.shape[j], poles.participation[j], *deviations)
    return Candidate(np.zeros(0, dtype=int), known.frequency, known.damping, counted | shown, (), own=values)


def _part(trial: SelectionResult, j: int, host: Candidate, fit: float) -> Candidate:
    """Return a pole that is part of a stronger mode, or cannot be separated from it."""
    copies = trial.contest.copies
    against = f"duplicate of {host.frequency:.5g} Hz (frequency drifted during the measurement)"
    if copies is not None and copies.whys[j]:
        against = f"duplicate of {host.frequency:.5g} Hz: {copies.whys[j]}"
    part = _by_itself(trial, j, fit)
    return _with_gain(
        trial, replace(part, against=(against,), residue=trial.residue(part, np.array([j]))), trial.gain[j]
    )


def _with_gain(trial: SelectionResult, candidate: Candidate, gain: float) -> Candidate:
    facts = {**candidate.facts, "gain": float(gain), "noise_gain": trial.bar}
    return replace(candidate, facts=facts, gain=float(gain))


def _left(trial: SelectionResult, groups: list[Candidate]) -> list[Candidate]:
    """Return the groups that correspond to no mode, each once, with what they explain of the residual."""
    each: list[Candidate] = []
    for c in sorted(groups, key=lambda c: -c.members.size):
        if not any(
            abs(c.frequency - k.frequency) < _MAX_DEVIATION * k.frequency * max(k.damping, c.damping) for k in each
        ):
            each.append(c)
    if not each:
        return []
    poles = poles_from([c.frequency for c in each], [c.damping for c in each])
    gain = np.sqrt(gains_in_residual(trial.selection, trial.found, poles - trial.diagram.as_measured.added_damping) / 2)
    coloured = trial.found.recount is not None
    return [
        _with_gain(trial, replace(c, against=(too_little(g, trial.bar, coloured=coloured),)), g)
        for c, g in zip(each, gain, strict=True)
    ]


# -------------------------------------------------------------------------------------------------------------- likely
# Selection by likelihood: poles of the diagram are candidates of `select_jointly`; its outcome is assigned to groups of the diagram.

#: Minimum number of orders of a cluster of poles, where there are as many.
_MIN_GROUP_ORDERS = 3

#: Minimum distance of starting poles in half bandwidths, unless their MAC is below this; maximum number of them.
_START_HALF_BANDWIDTHS, _SAME_START_MAC, _MAX_STARTS = 0.3, 0.95, 60

#: Distances that differ by less, relative, are equal, those of two poles to their median say: rounding differs from processor to
#: processor and must not choose.
_TIE = 1e-6

#: MAC above which a single pole shows a mode of its frequency: nearer to it than to a right angle.
_SHOWN_MAC = 0.5

#: Residuals below this part of the data are no noise of a measurement: a converter of 20 bits rounds to as much.
_MAX_COMPUTED = 1e-6

#: Above this ratio of noise to data, fast least squares (without orthogonalization) are accurate enough.
_MIN_NOISE_RATIO = 1e-4


def has_likelihood(diagram: StabilizationDiagram) -> bool:
    """Return whether the data are responses, whose errors have a likelihood, and no correlations."""
    response = diagram.as_measured
    return response.separable and not response.ambient


def contest(diagram: StabilizationDiagram, poles: Poles, others: Sequence[Poles] = ()) -> Contest:
    """Select the poles that the data need from the groups of a diagram, refined jointly.

    A coloured residual of the reference model may be a missing mode: the completed joint fit decides. Out-of-band poles take part where
    that residual is much whiter beside them, as each round of completion has to make it; never in coloured errors, which they follow. If
    the fit does not become white under the noise of the reference model, it is tried under that of the quieter lines, see `Floor.quiet`.

    `poles`: not merged: of two poles within one bandwidth each is a candidate. `others`: of further diagrams of the same data, whose groups
    are candidates, too, where they are none of these.
    """
    response = diagram.as_measured
    rich = diagram.poles[diagram.order_of_pole == diagram.orders[int(np.argmin(diagram.fit_errors))]]
    start = _starts_of(poles, others)
    steady, added = rich[rich.imag == 0], response.added_damping

    def beside(*candidates: ComplexArray) -> ComplexArray:
        return needed_beside(response, start.pole, np.concatenate([steady, *candidates])) - added

    def outcome(selection: SelectionProblem, doubted: bool) -> Outcome | None:
        sides = (start.shape if selection.problem.turned else start.participation) / selection.problem.varying
        return select_jointly(selection, start.pole - added, sides, doubted=doubted)

    held, floor = beside(), floor_of(response, rich - added)
    if not floor.colour.coloured or _computed(floor):
        floor = floor.judged()
        selection = _problem_of(response, floor, held)
        return Contest(selection, outcome(selection, False))
    more = beside(out_of_band_poles(response))
    outside = more[more.imag > 0]
    seen = floor_of(response, np.concatenate([rich - added, outside])) if outside.size else floor
    whiter = seen.colour.excess <= max(1.0, MAX_EXCESS_RATIO * floor.colour.excess)
    noise, fixed = (seen, more) if whiter else (floor, held)
    selection = replace(_problem_of(response, noise, fixed), brief=True)
    found = outcome(selection, True)
    if found is None and response.grid is not None and response.variance is None and floor.window == 0:
        selection = replace(_problem_of(response, noise.quiet(response.count), fixed), brief=True)
        found = outcome(selection, True)
    if found is None and response.grid is not None:
        floor = floor.of_products()
        selection = replace(_problem_of(response, by_line(floor, response.count), held), brief=True, coloured=True)
        # errors of half spectra do not follow a + b |H|^2: there orders have to show a mode
        selection = replace(selection, recounted=not response.of_correlations, whole=_whole(selection, floor))
        found = outcome(selection, False)
    return Contest(selection, found)


def likely(
    diagram: StabilizationDiagram, poles: Poles, evidence: Evidence, known: Contest | None = None
) -> tuple[Poles, list[Candidate]] | None:
    """Return modes and all other groups of poles that agree over orders, these with what speaks against them.

    None where samples leave a coloured residual.

    `known`: a contest on the same data: then a mode is one only where poles of this diagram show it, if its orders have room for all.
    """
    held = contest(diagram, poles) if known is None else known
    if held.found is None:
        return None
    groups = _groups(poles)
    if held.selection.coloured:
        # resonances that shift come out as several poles, and merged ones stand for them
        merged = merge_splits(poles, levels=levels_of_channels(diagram.response.values))
        groups = [*_groups(merged), *(group + merged.pole.size for group in groups)]
        poles = merged.beside(poles)
    candidates = verdicts(SelectionResult(diagram, poles, evidence, held, known is not None), groups)
    room = np.unique(diagram.order_of_pole, return_counts=True)[1].max(initial=0)
    if known is None or room < len(held.found.poles):
        return poles, candidates
    return poles, [_shown_here(c, poles) for c in candidates]


def _shown_here(candidate: Candidate, poles: Poles) -> Candidate:
    """Return a candidate of a contest on several diagrams, as no mode of one that has room for all modes and does not show it.

    A pole of one order, within a half bandwidth and of a similar shape, shows it: of few orders no groups are made.
    """
    half = candidate.damping * candidate.frequency
    near = np.abs(poles.pole - 2 * np.pi * (-half + 1j * np.sqrt(candidate.frequency**2 - half**2))) < 2 * np.pi * half
    if candidate.own is not None:
        near &= mac(poles.shape.T, candidate.own.shape[:, None])[:, 0] > _SHOWN_MAC
    if candidate.members.size or near.any():
        return candidate
    return replace(
        candidate, against=(*candidate.against, "needed by the data, but shown at no orders of this diagram")
    )


def _groups(poles: Poles) -> list[Array]:
    """Return the poles that agree over orders, as many as a group needs."""
    agree = (consensus(poles, track) for track in tracks(poles))
    return [group for group in agree if group.size >= min(_MIN_GROUP_ORDERS, len(poles.orders))]


def _problem_of(response: Response, floor: Floor, steady: ComplexArray) -> SelectionProblem:
    """Pose the selection: divide the data by their noise; poles that do not oscillate are free in every channel."""
    levels = floor.levels
    swift = floor.share > _MIN_NOISE_RATIO**2 * (len(floor.rows) // response.count)  # parts of a value
    given = floor.rows, levels.outputs, levels.inputs
    problem = whitened(response, steady, response.outside_powers, *given, own=levels.own, swift=swift)
    bar = search_bound(response.values.shape[1], response.values.shape[2], len(floor.rows))
    return SelectionProblem(
        problem, floor.variance, bar, response.span, correlation=floor.correlation, window=floor.window
    )


def _computed(floor: Floor) -> bool:
    """Return whether the residual is less than any measurement leaves: data were computed, and poles are as good as rounding lets them."""
    return floor.share < _MAX_COMPUTED**2


def _whole(selection: SelectionProblem, floor: Floor) -> RealArray:
    """Return the divided data including the terms."""
    whole = floor.data / selection.problem.rows[:, None, None] / floor.levels.channels
    return np.asarray(whole.transpose(0, 2, 1) if selection.problem.turned else whole)


def _starts_of(poles: Poles, others: Sequence[Poles]) -> Poles:
    """Return the middle members of the groups of a diagram, and those of further ones that are none of these."""
    parts = [poles.take(_starts(poles, _groups(poles)))]
    for other in others:
        more = other.take(_starts(other, _groups(other)))
        apart = [not any(_same_start(part, more, k).any() for part in parts) for k in range(more.pole.size)]
        parts.append(more.take(np.flatnonzero(apart)))
    whole = reduce(Poles.beside, parts)
    return whole.take(np.arange(min(whole.pole.size, _MAX_STARTS)))


def _same_start(poles: Poles, other: Poles, k: int) -> Array:
    """Return which poles are near pole `k` of others and alike in shape."""
    near = np.abs(poles.pole - other.pole[k])
    half = np.maximum(-poles.pole.real, -other.pole[k].real)
    alike = mac(poles.shape.T, other.shape[[k]].T)[:, 0] > _SAME_START_MAC
    return np.asarray((near < _START_HALF_BANDWIDTHS * half) & alike)


def _starts(poles: Poles, groups: list[Array]) -> IntArray:
    """Return the middle member of every group, groups at most orders first, without those that are the same."""
    starts: list[int] = []
    for group in sorted(groups, key=lambda g: (-g.size, float(poles.frequency[g[0]]))):
        s = poles.pole[group]
        apart = np.abs(s - np.median(s.real) - 1j * np.median(s.imag))
        middle = int(group[np.flatnonzero(apart <= apart.min() * (1 + _TIE))[0]])
        if not np.any(_same_start(poles.take(np.array(starts, dtype=int)), poles, middle)):
            starts.append(middle)
    return np.array(starts[:_MAX_STARTS], dtype=int)
