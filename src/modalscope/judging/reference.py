"""Modes paired with those of another program or test: which are the same, and by how much they differ, in deviations too."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.judging.evidence import Candidate
from modalscope.judging.tracking import Poles
from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note
from modalscope.model.pairing import assign

__all__ = ["paired_with", "told_beside"]

#: Costs more than any pair: no partner.
_ALONE = 1e3

#: Something against a candidate counts like shapes that are this much unlike.
_AGAINST = 0.5


def paired_with(
    reference: ModalModel, candidates: list[Candidate], poles: Poles, tolerance: float
) -> list[tuple[Candidate, int]]:
    """Return candidates and the reference mode that each is, pairs of least cost in all.

    Frequencies lie within the tolerance or the larger half bandwidth; among these the nearest with the most alike shape is taken, shapes
    where both have the same outputs.

    Parameters
    ----------
    reference : ModalModel
    candidates : list of Candidate
    poles : Poles
    tolerance : float
        Relative distance of frequencies.
    """
    if not candidates or not len(reference):
        return []
    f, zeta = reference.frequencies, reference.damping_ratios
    g, eta = (np.array([getattr(c, name) for c in candidates]) for name in ("frequency", "damping"))
    room = np.maximum(tolerance * f[:, None], np.maximum((f * zeta)[:, None], g * eta))
    apart = np.abs(f[:, None] - g) / room
    unlike = 1 - _likeness(reference, candidates, poles)
    cost = apart + unlike + _AGAINST * np.array([bool(c.against) for c in candidates])
    cost = np.where(apart <= 1, cost, _ALONE)
    return [(candidates[j], int(i)) for i, j in zip(*assign(cost), strict=True) if cost[i, j] < _ALONE]


def _likeness(reference: ModalModel, candidates: list[Candidate], poles: Poles) -> RealArray:
    """MAC of each reference mode and candidate, (n, candidates); one where the outputs are others."""
    if len(reference.shapes) != poles.shape.shape[1]:
        return np.ones((len(reference), len(candidates)))
    shapes = [c.own.shape if c.own is not None else poles.shape[c.members[0]] for c in candidates]
    return mac(reference.shapes, np.array(shapes, dtype=complex).T)


def told_beside(modes: ModalModel, reference: ModalModel, which: Array) -> ModalModel:
    """Return modes whose reasons hold the differences to the reference; what of the reference has no partner is a note.

    Parameters
    ----------
    modes : ModalModel
    reference : ModalModel
    which : array of int, (n,)
        The reference mode of each.
    """
    alike = np.ones(len(modes))
    if len(reference.shapes) == len(modes.shapes):
        alike = np.array([mac(modes.shapes[:, j], reference.shapes[:, k])[0, 0] for j, k in enumerate(which)])
    f, zeta = modes.frequencies - reference.frequencies[which], modes.damping_ratios - reference.damping_ratios[which]
    beside: list[dict[str, Any]] = [
        {
            "reference_frequency_hz": float(reference.frequencies[k]),
            "reference_damping_ratio": float(reference.damping_ratios[k]),
            "reference_mac": float(alike[j]),
            "frequency_difference_hz": float(f[j]),
            "damping_ratio_difference": float(zeta[j]),
        }
        for j, k in enumerate(which)
    ]
    for word, name, differences in (("frequency", "frequencies", f), ("damping_ratio", "damping_ratios", zeta)):
        deviations = _together(modes, reference, which, name)
        for row, difference, deviation in zip(beside, differences, deviations, strict=True):
            if deviation > 0:
                row[f"{word}_difference_in_deviations"] = float(abs(difference) / deviation)
    reasons = tuple({**why, **row} for why, row in zip(modes.reasons, beside, strict=True))
    missing = np.setdiff1d(np.arange(len(reference)), which)
    if not missing.size:
        return replace(modes, reasons=reasons)
    where = ", ".join(f"{reference.frequencies[k]:.5g} Hz" for k in missing)
    note = Note("reference", {"missing": float(missing.size)}, f"modes of the reference without a partner: {where}")
    return replace(modes, reasons=reasons).noted(note)


def _together(modes: ModalModel, reference: ModalModel, which: Array, name: str) -> RealArray:
    """Standard deviation of a difference: of both where both are known, of one where one is, else NaN."""
    parts = [getattr(modes, f"{name}_std"), getattr(reference, f"{name}_std")]
    own = np.full(len(modes), np.nan) if parts[0] is None else parts[0]
    other = np.full(len(modes), np.nan) if parts[1] is None else parts[1][which]
    both = np.nan_to_num(own) ** 2 + np.nan_to_num(other) ** 2
    return np.asarray(np.where(np.isnan(own) & np.isnan(other), np.nan, np.sqrt(both)))
