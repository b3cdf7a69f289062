"""What a contest decided, told of the groups of poles in a diagram: which are modes, which are parts of one, and what the others lack.

Values are those of the diagram, the median of the orders that agree, so that every method keeps its own; a mode of white data that no
orders agree on has refined ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.judging.arena import Arena
from modalscope.judging.contest import Outcome, gains_beside
from modalscope.judging.evidence import LEAST_PERSISTENCE, Candidate, Evidence, Own, judge, peaks
from modalscope.judging.likeness import collinear
from modalscope.judging.objections import left_open, rarely_shown, too_little
from modalscope.judging.one_residue import one_residue
from modalscope.judging.tracking import GAP, Poles
from modalscope.modal.contribution import contributions
from modalscope.modal.indicators import mac
from modalscope.modal.sufficient import usable_orders
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.poles import frequencies_and_damping, overlap, poles_from

__all__ = ["Trial", "verdicts"]

#: With more damping than this a mode has to be shown by the diagram: so wide a pole may stand for modes outside the band.
_DAMPED = 0.1

#: A mode is sure when frequency and damping are known to this part of the half bandwidth and of the damping ratio, and values of
#: the diagram stand for it within this part of a half bandwidth.
_SURE = 0.3

#: Of coloured data, where a resonance that shifts draws a refinement away, within this part.
_SHIFTED = 0.5

#: A group shows a mode when it lies within a half bandwidth, its damping within this part and its shape above this MAC.
_DAMPING, _SHAPE = 0.5, 0.8

#: Of coloured data a mode is shown at this part of the orders.
_SHARE = 0.25


@dataclass(frozen=True, eq=False, slots=True)
class Trial:
    """All that a verdict rests on.

    Parameters
    ----------
    diagram : StabilizationDiagram
    poles : Poles
    evidence : Evidence
    arena : Arena
    found : Outcome
    """

    diagram: StabilizationDiagram
    poles: Poles
    evidence: Evidence
    arena: Arena
    found: Outcome

    @property
    def settled(self) -> ComplexArray:
        """The refined poles as modes have them, rad/s."""
        return self.found.poles + self.diagram.as_measured.added_damping

    @property
    def bar(self) -> float:
        """What noise may explain, in deviations."""
        return float(np.sqrt(self.arena.bar / 2))

    @property
    def gain(self) -> RealArray:
        """What each mode explains, in deviations."""
        return np.asarray(np.sqrt(np.maximum(self.found.gain, 0) / 2))

    def recounted(self, which: IntArray) -> RealArray:
        """Return by how much poles that few orders show stand out of coloured errors, (k,): see `Recount.standing`; 1 at what these may do.

        Orders have to show the others: a shift of a resonance makes shoulders, coherent lines and errors of neighbouring lines are narrow.
        """
        recount = self.found.recount
        return np.zeros(len(which)) if recount is None or not len(which) else recount.standing(which)

    def hosts(self) -> IntArray:
        """Return the mode that each pole is part of, itself where it is none: the strongest of those that act as one.

        Of coloured data those of one shape do, which a resonance that shifts needs; of any data two that overlap and that are each open.
        """
        host, gain, s = np.arange(len(self.settled)), self.found.gain, self.found.poles
        if self.arena.coloured:
            one = collinear(s, *self.found.residues)
        else:
            one = overlap(s, s) & self.open[:, None] & self.open
        for j in np.argsort(-gain):
            stronger = [k for k in np.flatnonzero(one[j]) if gain[k] > gain[j]]
            if stronger:
                host[j] = host[max(stronger, key=lambda k: gain[k])]
        return host

    @property
    def open(self) -> Array:
        """Which poles the data leave open, each taken alone."""
        f, zeta = frequencies_and_damping(self.settled)
        known = (self.found.frequency_std < _SURE * f * zeta) & (self.found.damping_std < _SURE * zeta)
        return np.asarray(~known)

    def left_open(self, j: int, host: IntArray) -> tuple[float, float]:
        """Return the deviations of a mode with its parts: of frequency in half bandwidths, of damping in damping ratios."""
        f, zeta = (float(v) for v in frequencies_and_damping(self.settled[j]))
        parts = np.flatnonzero((host == j) & (np.arange(len(host)) != j))
        both = float(self.found.frequency_std[j]), float(self.found.damping_std[j])
        if parts.size:
            both = self.found.as_one(j, parts)
        return (both[0] / (f * zeta), both[1] / zeta) if zeta > 0 else (np.inf, np.inf)

    def residue(self, candidate: Candidate, family: Array) -> ComplexArray | None:
        """Return the residue of a mode at the values it is listed with, from its poles; None of white data, which the list explains.

        Parameters
        ----------
        candidate : Candidate
        family : array of int
        """
        if not self.arena.coloured:
            return None
        listed = complex(poles_from(candidate.frequency, candidate.damping)) - self.diagram.as_measured.added_damping
        shapes, participation = self.found.residues
        each = np.einsum("ok,ki->koi", shapes[:, family], participation[family])
        return one_residue(self.arena.problem.light, listed, self.found.poles[family], each)


def verdicts(trial: Trial, groups: list[Array]) -> list[Candidate]:
    """Return modes and all that was found beside them, these with what speaks against them.

    Parameters
    ----------
    trial : Trial
    groups : list of array of int
        Poles that agree over orders; those that values are preferably taken from first.
    """
    peak, fit = peaks(trial.diagram, trial.poles, trial.evidence), usable_orders(trial.diagram)[1]
    known = [judge(trial.poles, group, peak, fit, trial.evidence) for group in groups]
    host = trial.hosts()
    shown = [-1 if mode < 0 else int(host[mode]) for mode in _shown_by(trial, groups)]
    mine = {
        int(j): [c for c, mode in zip(known, shown, strict=True) if mode == j]
        for j in np.flatnonzero(host == np.arange(len(host)))
    }
    least = _SHARE * len(trial.poles.orders)
    few = {j: max((c.members.size for c in each), default=0) < least for j, each in mine.items()}
    weak = (trial.gain < trial.bar) & (trial.found.recount is not None)
    doubted = [j for j in mine if few[j] or weak[j]] if trial.arena.coloured else []
    again = dict(zip(doubted, trial.recounted(np.array(doubted, dtype=int)), strict=True))
    modes = {j: _mode(trial, j, each, fit, host, again.get(j), few[j]) for j, each in mine.items()}
    parts = [_part(trial, int(j), modes[host[j]], fit) for j in np.flatnonzero(host != np.arange(len(host)))]
    left = _left(trial, [each for each, mode in zip(known, shown, strict=True) if mode < 0])
    return [*modes.values(), *parts, *left]


def _shown_by(trial: Trial, groups: list[Array]) -> list[int]:
    """Return the pole that each group shows, the nearest one; -1 where there is none."""
    modes, (shapes, _) = trial.settled, trial.found.residues
    f, zeta = frequencies_and_damping(modes)
    shown = []
    for group in groups:
        g, eta = np.median(trial.poles.frequency[group]), np.median(trial.poles.damping[group])
        alike = np.median(mac(shapes, trial.poles.shape[group].T), axis=1) if len(modes) else np.zeros(0)
        apart = np.abs(f - g) / np.maximum(f * zeta, g * eta)
        near = (apart < 1) & (np.abs(zeta - eta) < _DAMPING * np.maximum(zeta, eta)) & (alike > _SHAPE)
        cost = np.where(near, apart + 1 - alike, np.inf)
        shown.append(int(np.argmin(cost)) if np.any(near) else -1)
    return shown


def _mode(
    trial: Trial, j: int, groups: list[Candidate], fit: float, host: IntArray, again: float | None, rare: bool
) -> Candidate:
    """Return a mode with its gain, and what speaks against it: values that the data leave open, or too few orders."""
    several = bool(np.any(np.delete(host, j) == j))
    reach = _SHIFTED if trial.arena.coloured else _SURE
    near = groups if several else [c for c in groups if _close(c, complex(trial.settled[j]), reach)]
    best = max(near, key=lambda c: c.members.size) if near else _by_itself(trial, j, fit)
    f, zeta = (float(v) for v in frequencies_and_damping(trial.settled[j]))
    low, high = trial.diagram.as_measured.reported_band(trial.diagram.settings.band)
    hidden = again is not None and again <= 1
    gain = max(trial.gain[j], again * trial.bar if rare and again is not None and not hidden else 0.0)
    against = []
    if not low <= f <= high:
        against.append(f"lies outside the band, at {f:.5g} Hz")
    if hidden:
        few_orders = rarely_shown(int(best.members.size), len(trial.poles.orders))
        against.append(few_orders if rare else too_little(gain, trial.bar, coloured=True))
    # what tells more of a mode tells more of where it lies
    apart, damped = (deviation * trial.gain[j] / gain for deviation in trial.left_open(j, host))
    if zeta >= _DAMPED and not groups:
        against.append(f"damped by {100 * zeta:.2g} %, which no orders show: it may stand for modes outside the band")
    if not (apart < _SURE and damped < _SURE):
        against.append(left_open(apart, damped))
    undecided: dict[str, Any] = (
        {"late": True} if hidden and rare and len(against) == 1 and zeta < _DAMPED and _late(best, trial) else {}
    )
    if several and not trial.arena.coloured:
        undecided = {"cluster": int(np.sum(host == j))}
    residue = trial.residue(best, np.flatnonzero(host == j))
    known = replace(best, against=tuple(against), facts=best.facts | _alone(trial, j) | undecided, residue=residue)
    return _with_gain(trial, known, gain)


def _late(group: Candidate, trial: Trial) -> bool:
    """Return whether a group is there at most orders since its first one and up to the last: it began too late to be shown at more."""
    if not group.members.size:
        return False
    orders = trial.poles.orders
    return bool(
        group.facts["persistence"] >= LEAST_PERSISTENCE and group.facts["last_order"] >= orders[-min(GAP, len(orders))]
    )


def _alone(trial: Trial, j: int) -> dict[str, str]:
    """Return the input that a mode rests on, when without it no more would be left than noise may explain; nothing else."""
    response, (_, participation) = trial.diagram.response, trial.found.residues
    share = np.abs(participation[j] / trial.arena.problem.sides[1]) ** 2
    rest = 1 - share.max() / share.sum()
    if share.size == 1 or trial.gain[j] ** 2 * rest > trial.bar**2:
        return {}
    return {"rests_on": response.input_dofs[int(np.argmax(share))]}


def _close(group: Candidate, mode: complex, reach: float) -> bool:
    """Return whether the values of a group can stand for those of a mode: within this part of the wider half bandwidth."""
    middle = complex(poles_from(group.frequency, group.damping))
    return abs(middle - mode) < reach * max(-middle.real, -mode.real)


def _by_itself(trial: Trial, j: int, fit: float) -> Candidate:
    """Return a mode that no orders agree on, with refined values."""
    response, orders = trial.diagram.response, trial.poles.orders
    s, (shapes, participation) = trial.settled[[j]], trial.found.residues
    shape, part = shapes.T[[j]], participation[[j]]
    own = contributions(response, s, shape, part)
    alone = Poles(orders, np.array([orders[-1]]), s, shape, part, own)
    known = judge(alone, np.array([0]), peaks(trial.diagram, alone, trial.evidence), fit, trial.evidence)
    deviations = float(trial.found.frequency_std[j]), float(trial.found.damping_std[j])
    counted = {"orders_found": 0, "orders_tried": len(orders)}
    shown = {name: known.facts[name] for name in ("signal_to_noise", "share_of_peak", "indicator_prominence")}
    values = Own(shape[0], part[0], *deviations)
    return Candidate(np.zeros(0, dtype=int), known.frequency, known.damping, counted | shown, (), own=values)


def _part(trial: Trial, j: int, host: Candidate, fit: float) -> Candidate:
    """Return a pole that acts as one with a stronger one, or that cannot be told from it."""
    shifts = "part of the mode at {:.5g} Hz: a resonance that shifts while it is measured needs several poles"
    close = "one of a cluster with the mode at {:.5g} Hz: the data need both and cannot tell them apart"
    against = ((shifts if trial.arena.coloured else close).format(host.frequency),)
    part = _by_itself(trial, j, fit)
    return _with_gain(trial, replace(part, against=against, residue=trial.residue(part, np.array([j]))), trial.gain[j])


def _with_gain(trial: Trial, candidate: Candidate, gain: float) -> Candidate:
    facts = {**candidate.facts, "gain": float(gain), "noise_gain": trial.bar}
    return replace(candidate, facts=facts, gain=float(gain))


def _left(trial: Trial, groups: list[Candidate]) -> list[Candidate]:
    """Return the groups that no mode answers to, each once, with what they would explain beside the modes."""
    each: list[Candidate] = []
    for c in sorted(groups, key=lambda c: -c.members.size):
        if not any(abs(c.frequency - k.frequency) < _SURE * k.frequency * max(k.damping, c.damping) for k in each):
            each.append(c)
    if not each:
        return []
    poles = poles_from([c.frequency for c in each], [c.damping for c in each])
    gain = np.sqrt(gains_beside(trial.arena, trial.found, poles - trial.diagram.as_measured.added_damping) / 2)
    coloured = trial.found.recount is not None
    return [
        _with_gain(trial, replace(c, against=(too_little(g, trial.bar, coloured=coloured),)), g)
        for c, g in zip(each, gain, strict=True)
    ]
