"""Modes by likelihood: what the data need, whether many orders show it or few, and nothing that noise may explain.

The poles of the diagram contend for the data (`contest`); what stays decides which modes there are (`verdict`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.identification.beside import needed_beside
from modalscope.identification.likelihood import whitened
from modalscope.identification.richer import Floor, by_line, floor_of
from modalscope.identification.skirts import skirts
from modalscope.identification.whitening import search_bound
from modalscope.judging.arena import Arena
from modalscope.judging.contest import Outcome, contest
from modalscope.judging.evidence import Candidate, Evidence
from modalscope.judging.tracking import Poles, consensus, merge_splits, tracks
from modalscope.judging.verdict import Trial, verdicts
from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.response import Response

__all__ = ["has_likelihood", "likely"]

#: A group of poles has so many orders, where there are as many.
_LEAST_ORDERS = 3

#: Candidates lie further apart than this part of a half bandwidth, unless their shapes differ by this MAC; so many at most.
_APART, _ALIKE, _MOST = 0.3, 0.95, 60

#: Noise of this part of the data needs no steps that are exact to rounding.
_LOUD = 1e-4


def has_likelihood(diagram: StabilizationDiagram) -> bool:
    """Return whether errors of the data are such that modes can maximize a likelihood: those of responses, not of correlations."""
    response = diagram.as_measured
    return response.separable and not response.ambient


def likely(diagram: StabilizationDiagram, poles: Poles, evidence: Evidence) -> tuple[Poles, list[Candidate]] | None:
    """Return modes and all other groups of poles that agree over orders, these with what speaks against them.

    A rich model that lacks a mode leaves a coloured residual, too: that of the modes, completed, decides then. So do skirts of modes
    outside the band: they take part where they make that of the rich model white. None where samples leave a coloured one.

    Parameters
    ----------
    diagram : StabilizationDiagram
    poles : Poles
        Not merged: of two poles within one bandwidth each is a candidate.
    evidence : Evidence
    """
    response, groups = diagram.as_measured, _groups(poles)
    rich = diagram.poles[diagram.order_of_pole == diagram.orders[int(np.argmin(diagram.fit_errors))]]
    starts, steady, added = _starts(poles, groups), rich[rich.imag == 0], response.added_damping

    def beside(*candidates: ComplexArray) -> ComplexArray:
        return needed_beside(response, poles.pole[starts], np.concatenate([steady, *candidates])) - added

    def outcome(arena: Arena, doubted: bool) -> Outcome | None:
        sides = (poles.shape if arena.problem.turned else poles.participation)[starts] / arena.problem.varying
        return contest(arena, poles.pole[starts] - added, sides, doubted=doubted)

    floor, held = floor_of(response, rich - added), beside()
    seen, more, doubted = floor, held, floor.colour.coloured
    if doubted:
        more = beside(skirts(response))
        seen = floor_of(response, np.concatenate([rich - added, more[more.imag > 0]]))
    skirted = doubted and not seen.colour.coloured
    arena = replace(_arena(response, seen, more) if skirted else _arena(response, floor, held), brief=doubted)
    found = outcome(arena, doubted)
    if found is None and response.grid is not None:
        arena = replace(_arena(response, by_line(floor, response.count), held), brief=True, coloured=True)
        # half spectra err as long as their correlations last, by no rule of a + b |H|^2: there orders have to show a mode
        arena = replace(arena, recounted=not response.of_correlations)
        arena = replace(arena, whole=_whole(arena, floor))
        found = outcome(arena, False)
        # resonances that shift come out as several poles, and merged ones stand for them
        merged = merge_splits(poles)
        groups = [*_groups(merged), *(group + merged.pole.size for group in groups)]
        poles = merged.beside(poles)
    return None if found is None else (poles, verdicts(Trial(diagram, poles, evidence, arena, found), groups))


def _groups(poles: Poles) -> list[Array]:
    """Return the poles that agree over orders, as many as a group needs."""
    agree = (consensus(poles, track) for track in tracks(poles))
    return [group for group in agree if group.size >= min(_LEAST_ORDERS, len(poles.orders))]


def _arena(response: Response, floor: Floor, steady: ComplexArray) -> Arena:
    """Return the data divided by their noise; poles that do not oscillate are free in every channel."""
    levels = floor.levels
    swift = bool(np.mean(floor.left**2) > _LOUD**2 * np.mean(np.abs(response.values) ** 2))
    problem = whitened(
        response, steady, response.outside_powers, floor.rows, levels.outputs, levels.inputs, swift=swift
    )
    bar = search_bound(response.values.shape[1], response.values.shape[2], len(floor.rows))
    return Arena(problem, floor.variance, bar, response.span, correlation=floor.correlation, window=floor.window)


def _whole(arena: Arena, floor: Floor) -> RealArray:
    """Return the data as the contest divides them, terms and all."""
    outputs, inputs = arena.problem.sides
    whole = floor.data / arena.problem.rows[:, None, None] / outputs[:, None] / inputs
    return np.asarray(whole.transpose(0, 2, 1) if arena.problem.turned else whole)


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
