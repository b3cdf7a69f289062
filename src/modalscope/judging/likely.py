"""Modes by likelihood: what the data need, whether many orders show it or few, and nothing that noise may explain.

The poles of the diagram contend for the data (`contest`); what stays decides which modes there are. Their values are those of the
diagram, the median of the orders that agree, so that every method keeps its own; a mode that no orders agree on has refined ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.identification.beside import needed_beside
from modalscope.identification.likelihood import whitened
from modalscope.identification.richer import Floor, floor_of
from modalscope.identification.whitening import search_bound
from modalscope.judging.contest import Arena, Outcome, contest, gains_beside
from modalscope.judging.evidence import Candidate, Evidence, Own, judge, peaks
from modalscope.judging.tracking import Poles, consensus, tracks
from modalscope.modal.contribution import contributions
from modalscope.modal.indicators import mac
from modalscope.modal.sufficient import usable_orders
from modalscope.model.checks import Array, ComplexArray, IntArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.poles import frequencies_and_damping
from modalscope.model.response import window_damping

__all__ = ["has_likelihood", "likely"]

#: A group of poles has so many orders, where there are as many.
_LEAST_ORDERS = 3

#: Candidates lie further apart than this part of a half bandwidth, unless their shapes differ by this MAC; so many at most.
_APART, _ALIKE, _MOST = 0.3, 0.95, 60

#: With more damping than this a mode has to be shown by the diagram.
_DAMPED = 0.3

#: A mode is sure when frequency and damping are known to this part of the half bandwidth and of the damping ratio.
_SURE = 0.3

#: A group shows a mode when it lies within a half bandwidth, its damping within this part and its shape above this MAC.
_DAMPING, _SHAPE = 0.5, 0.8


def has_likelihood(diagram: StabilizationDiagram) -> bool:
    """Return whether errors of the data are such that modes can maximize a likelihood: those of responses, not of correlations."""
    response = diagram.response
    return response.separable and not response.ambient


def likely(diagram: StabilizationDiagram, poles: Poles, evidence: Evidence) -> tuple[Poles, list[Candidate]] | None:
    """Return modes and all other groups of poles that agree over orders, these with what speaks against them.

    None where what a rich model leaves of the data is no white noise.

    Parameters
    ----------
    diagram : StabilizationDiagram
    poles : Poles
        Not merged: of two poles within one bandwidth each is a candidate.
    evidence : Evidence
    """
    response = diagram.response
    best = diagram.order_of_pole == diagram.orders[int(np.argmin(diagram.fit_errors))]
    floor = floor_of(response, diagram.poles[best] - window_damping(response))
    if floor.colour.coloured:
        return None
    agree = (consensus(poles, track) for track in tracks(poles))
    groups = [group for group in agree if group.size >= min(_LEAST_ORDERS, len(poles.orders))]
    starts = _starts(poles, groups)
    steady = diagram.poles[best & (diagram.poles.imag == 0)]
    arena = _arena(diagram, floor, needed_beside(response, poles.pole[starts], steady) - window_damping(response))
    sides = (poles.shape if arena.problem.turned else poles.participation)[starts] / arena.problem.varying
    found = contest(arena, poles.pole[starts] - window_damping(response), sides)
    return poles, _candidates(_Trial(diagram, poles, evidence, arena, found), groups)


def _arena(diagram: StabilizationDiagram, floor: Floor, steady: ComplexArray) -> Arena:
    """Return the data divided by their noise; poles that do not oscillate are free in every channel."""
    response, levels = diagram.response, floor.levels
    problem = whitened(response, steady, response.outside_powers, floor.rows, levels.outputs, levels.inputs)
    bar = search_bound(response.values.shape[1], response.values.shape[2], len(floor.rows))
    return Arena(problem, floor.variance, bar, response.span)


def _starts(poles: Poles, groups: list[Array]) -> IntArray:
    """Return the middle member of every group, groups at most orders first, without those that are the same."""
    starts: list[int] = []
    for group in sorted(groups, key=lambda g: (-g.size, float(poles.frequency[g[0]]))):
        s = poles.pole[group]
        middle = int(group[np.argmin(np.abs(s - np.median(s.real) - 1j * np.median(s.imag)))])
        near = np.abs(poles.pole[starts] - poles.pole[middle])
        half = np.maximum(-poles.pole[starts].real, -poles.pole[middle].real)
        same = (near < _APART * half) & (mac(poles.shape[starts].T, poles.shape[[middle]].T)[:, 0] > _ALIKE)
        if not np.any(same):
            starts.append(middle)
    return np.array(starts[:_MOST], dtype=int)


@dataclass(frozen=True, eq=False, slots=True)
class _Trial:
    """All that a verdict rests on."""

    diagram: StabilizationDiagram
    poles: Poles
    evidence: Evidence
    arena: Arena
    found: Outcome

    @property
    def settled(self) -> ComplexArray:
        """The refined poles as modes have them, rad/s."""
        return self.found.poles + window_damping(self.diagram.response)

    @property
    def bar(self) -> float:
        """What noise may explain, in deviations."""
        return float(np.sqrt(self.arena.bar / 2))


def _candidates(trial: _Trial, groups: list[Array]) -> list[Candidate]:
    shown = _shown_by(trial, groups)
    fit = usable_orders(trial.diagram)[1]
    peak = peaks(trial.diagram, trial.poles, trial.evidence)
    candidates = []
    for j in range(len(trial.settled)):
        own = [group for group, mode in zip(groups, shown, strict=True) if mode == j]
        near = [group for group in own if _close(trial, group, j)]
        known = judge(trial.poles, max(near, key=len), peak, fit, trial.evidence) if near else _by_itself(trial, j, fit)
        candidates.append(_with_gain(trial, known, j))
    left = [group for group, mode in zip(groups, shown, strict=True) if mode < 0]
    return candidates + _left(trial, [judge(trial.poles, group, peak, fit, trial.evidence) for group in left])


def _shown_by(trial: _Trial, groups: list[Array]) -> list[int]:
    """Return the mode that each group shows, the nearest one; -1 where there is none."""
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


def _close(trial: _Trial, group: Array, j: int) -> bool:
    """Return whether the values of a group can stand for those of a mode."""
    s = trial.poles.pole[group]
    middle, mode = complex(np.median(s.real), np.median(s.imag)), trial.settled[j]
    return bool(abs(middle - mode) < _SURE * max(-middle.real, -mode.real))


def _by_itself(trial: _Trial, j: int, fit: float) -> Candidate:
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
    none = np.zeros(0, dtype=int)
    return Candidate(none, known.frequency, known.damping, counted | shown, (), own=Own(shape[0], part[0], *deviations))


def _with_gain(trial: _Trial, known: Candidate, j: int) -> Candidate:
    """Return a mode with its gain, and what speaks against it: values that the data leave open."""
    gain = float(np.sqrt(max(trial.found.gain[j], 0) / 2))
    f, zeta = (float(v) for v in frequencies_and_damping(trial.settled[j]))
    low, high = trial.diagram.response.reported_band(trial.diagram.settings.band)
    against = []
    if not low <= f <= high:
        against.append(f"lies outside the band, at {f:.5g} Hz")
    apart, damped = trial.found.frequency_std[j] / (f * zeta), trial.found.damping_std[j] / zeta
    if not (apart < _SURE and damped < _SURE and (zeta < _DAMPED or known.own is None)):
        against.append(
            f"the data leave its frequency open by {apart:.2g} half bandwidths and its damping by {100 * damped:.2g} %"
        )
    facts = {**known.facts, "gain": gain, "noise_gain": trial.bar}
    return replace(known, facts=facts, gain=gain, against=tuple(against))


def _left(trial: _Trial, groups: list[Candidate]) -> list[Candidate]:
    """Return the groups that no mode answers to, with what they would explain beside the modes."""
    shapes = np.array([group.frequency for group in groups])
    if not shapes.size:
        return []
    poles = np.array([np.median(trial.poles.pole[group.members]) for group in groups])
    gain = np.sqrt(gains_beside(trial.arena, trial.found, poles - window_damping(trial.diagram.response)) / 2)
    return [
        replace(
            group,
            gain=float(g),
            against=(
                f"beside the modes it explains {g:.1f} standard deviations of the noise; noise alone may explain {trial.bar:.1f}",
            ),
        )
        for group, g in zip(groups, gain, strict=True)
    ]
