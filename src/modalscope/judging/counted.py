"""Modes by counting orders: where the errors of the data have no likelihood that modes could maximize."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.judging.evidence import LEAST_ORDERS, LEAST_SHARE, Candidate, Evidence, judge, peaks
from modalscope.judging.tracking import Poles, consensus, join_broken, merge_splits, tracks
from modalscope.modal.indicators import mac
from modalscope.modal.sufficient import usable_orders
from modalscope.model.checks import Array, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.uncertainty.of_modes import typical_deviation

__all__ = ["counted"]

#: Two modes within a half bandwidth are one above this MAC.
SAME_SHAPE = 0.9

#: What is not among the modes is told of where its frequency is known to this part of a half bandwidth and its damping to this part.
_TOLD = 0.3

#: And at this part of all orders: poles of noise stay at fewer.
_MOST_ORDERS = 0.5


def counted(diagram: StabilizationDiagram, poles: Poles, evidence: Evidence) -> tuple[Poles, list[Candidate]]:
    """Return the groups of poles that agree over orders, splits merged, with what speaks for each and what against.

    Parameters
    ----------
    diagram : StabilizationDiagram
    poles : Poles
    evidence : Evidence
    """
    (orders, fit), known = usable_orders(diagram), _known(diagram)
    every = merge_splits(poles, known)
    poles = replace(every, orders=orders).take(np.flatnonzero(every.order <= orders[-1]))
    groups = [group for group in (consensus(poles, t) for t in tracks(poles)) if group.size >= min(3, len(orders))]
    peak = peaks(diagram, poles, evidence)
    candidates = [
        judge(poles, group, peak, fit, evidence, _left_open(diagram, poles, group))
        for group in join_broken(poles, groups)
    ]
    found = _none_twice(poles, candidates)
    if known is None:  # what noise makes is not told from what agrees
        return every, found
    return every, found + _late(diagram, every, found, (orders[-1], fit), evidence)


def _late(
    diagram: StabilizationDiagram,
    every: Poles,
    found: list[Candidate],
    explaining: tuple[int, float],
    evidence: Evidence,
) -> list[Candidate]:
    """Return what agrees over all orders, is known well and is not among the modes: too weak for the orders that explain the data.

    `explaining` are the last of these orders and its fit error.
    """
    (last, fit), peak = explaining, peaks(diagram, every, evidence)
    least = max(LEAST_ORDERS, _MOST_ORDERS * len(every.orders))
    late: list[Candidate] = []
    told = [c for c in found if not c.against or c.members.size >= LEAST_SHARE * len(every.orders)]
    for group in sorted((consensus(every, t) for t in tracks(every)), key=lambda g: -g.size):
        if group.size < least or not _left_open(diagram, every, group) < _TOLD:
            continue
        f, zeta = float(np.median(every.frequency[group])), float(np.median(every.damping[group]))
        if any(abs(f - c.frequency) < f * zeta + c.frequency * c.damping for c in [*told, *late]):
            continue
        text = f"weak: {group.size} of {len(every.orders)} orders show it, and those up to {last}, which explain the data, hardly any"
        late.append(replace(judge(every, group, peak, fit, evidence), against=(text,)))
    return late


def _known(diagram: StabilizationDiagram) -> RealArray | None:
    """Return the deviation of every pole in rad/s where the errors are those of records on their own lines.

    Of correlations, and of responses with a coloured residual, two poles that are known well may be one mode that changes.
    """
    f, zeta = diagram.frequencies_std, diagram.damping_ratios_std
    if f is None or zeta is None or diagram.response.ambient or diagram.response.separable:
        return None
    return np.asarray(2 * np.pi * np.hypot(f, zeta * diagram.frequencies))


def _left_open(diagram: StabilizationDiagram, poles: Poles, group: Array) -> float:
    """Return the larger deviation of a group: of frequency in half bandwidths, or of damping in damping ratios; NaN without any."""
    if diagram.frequencies_std is None or diagram.damping_ratios_std is None:
        return float("nan")
    members = poles.index[group]
    f, zeta = np.median(poles.frequency[group]), np.median(poles.damping[group])
    apart = typical_deviation(diagram.frequencies_std[members]) / (f * zeta)
    return float(max(apart, typical_deviation(diagram.damping_ratios_std[members]) / zeta))


def _none_twice(poles: Poles, candidates: list[Candidate]) -> list[Candidate]:
    """Speak, of two modes within a half bandwidth and of one shape, against the one found at fewer orders."""
    kept: list[Candidate] = []
    others = [c for c in candidates if c.against]
    for c in sorted((c for c in candidates if not c.against), key=lambda c: (-c.members.size, c.frequency)):
        host = next((k for k in kept if _the_same(poles, c, k)), None)
        if host is None:
            kept.append(c)
        else:
            others.append(replace(c, against=(f"part of the mode at {host.frequency:.5g} Hz, found at more orders",)))
    return kept + others


def _the_same(poles: Poles, c: Candidate, k: Candidate) -> bool:
    near = abs(c.frequency - k.frequency) < max(c.frequency * c.damping, k.frequency * k.damping)
    alike = np.median(mac(poles.shape[c.members].T, poles.shape[k.members].T)) > SAME_SHAPE
    return bool(near and alike and c.members.size > 1)
