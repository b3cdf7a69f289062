"""A list of modes completed by what stands out of the residual, where that leaves white noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.identification.information import residual
from modalscope.identification.settling import Settled, Task, least_gain, settle
from modalscope.model.checks import ComplexArray
from modalscope.model.mode_fields import PER_MODE, joined
from modalscope.model.modes import ModalModel

__all__ = ["completed"]

#: Modes added at most.
_ROUNDS = 8

#: Poles, shapes and participation.
_Found = tuple[ComplexArray, ComplexArray, ComplexArray]


def completed(task: Task, modes: ModalModel, participation: ComplexArray) -> ModalModel:
    """Return the modes, and behind them what stands out of the residual, one after the other from the strongest on.

    The first one is looked for before anything is refined: a mode that is missed draws the others to its place. Nothing is added when
    the residual stays coloured: then it is no noise, and poles would be fitted to the model's own error.

    Parameters
    ----------
    task : Task
    modes : ModalModel
    participation : array of complex, (n, m)
        Of the modes.
    """
    count = len(modes)
    found: _Found = (modes.poles - task.response.added_damping, modes.shapes, participation)
    settled = settle(task, *found, most=0)
    for _ in range(_ROUNDS):
        more = _with_peak(task, settled)
        if more is None:
            break
        settled = _pruned(task, settle(task, *more), count)
        if len(settled.descent.point.poles) <= len(found[0]):
            break
        found = (settled.descent.point.poles, *settled.residues)
    if len(found[0]) == count:
        return modes
    # a mode of the list that has nothing of its own wanders, and says nothing of the others
    held = _pruned(task, settled, 0)
    if held.colour.coloured or not held.descent.converged:
        return modes
    return joined([modes, _added(task, modes, tuple(part[..., count:] for part in found[:2]), found[2][count:])])


def _with_peak(task: Task, settled: Settled) -> _Found | None:
    """Return what there is with the strongest peak of the residual, or None where no peak exceeds what noise may do."""
    point, fitted = settled.descent.point, settled.descent.fitted
    least = 2 * least_gain(task) * settled.variance
    peaks = point.problem.peaks(residual(point, fitted), point.poles, least)
    if not peaks:
        return None
    peak, (shapes, participation) = peaks[0], settled.residues
    return (
        np.append(point.poles, peak.pole),
        np.column_stack([shapes, peak.shape]),
        np.vstack([participation, peak.participation]),
    )


def _pruned(task: Task, settled: Settled, count: int) -> Settled:
    """Take the weakest of the modes behind the first `count` out again while it explains no more than noise may."""
    while (gain := settled.gain[count:]).size and gain.min() < 2 * least_gain(task):
        out = count + int(np.argmin(gain))
        shapes, participation = settled.residues
        poles = np.delete(settled.descent.point.poles, out)
        settled = settle(task, poles, np.delete(shapes, out, axis=1), np.delete(participation, out, axis=0))
    return settled


def _added(task: Task, modes: ModalModel, found: tuple[Any, ...], participation: ComplexArray) -> ModalModel:
    """Return the added modes alone; what is known of the others only is NaN."""
    poles, shapes = found
    unknown = np.full(len(poles), np.nan)
    text = "stands out of what the other modes leave"
    columns: dict[str, Any] = {name: unknown for name in PER_MODE if getattr(modes, name) is not None}
    return ModalModel(
        poles=poles + task.response.added_damping,
        shapes=shapes,
        participation=task.response.told_of(task.response.of_inputs(participation)),
        quantity=modes.quantity,
        indicators=dict.fromkeys(modes.indicators, unknown),
        reasons=tuple({"text": text} for _ in poles) if modes.reasons else (),
        **columns,
        **task.response.labelled(),
    )
