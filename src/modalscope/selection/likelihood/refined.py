"""Build the modal model of a refinement, with standard deviations, rejected modes and notes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.data.channels import Groups
from modalscope.data.indicators import with_indicators_of_shapes
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Candidate, Note
from modalscope.data.response import INSEPARABLE
from modalscope.data.shown import counted, list_some
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.selection.likelihood.covariance import LEAST_GROUPS
from modalscope.selection.likelihood.descent import astray
from modalscope.selection.likelihood.joint_fit import JointFit, joint_fit
from modalscope.selection.likelihood.noise import KIND
from modalscope.selection.likelihood.settling import Settled, Task
from modalscope.selection.likelihood.spread import Spread, spread_of
from modalscope.selection.likelihood.whitening import Colour

#: Poles closer than this many standard deviations of their difference share their information.
_MIN_DISTANCE_DEVIATIONS = 3

#: Kinds of notes of an earlier refinement that this one replaces.
_REPLACED_KINDS = (KIND, INSEPARABLE, "held", "moved far", "coloured residual", "noise and model only", "repeated")


def refined(
    task: Task, before: ModalModel, settled: Settled | None, groups: Groups, lost: list[Candidate], notes: list[Note]
) -> ModalModel:
    """Build the refined modal model: values, standard deviations, rejected modes, and the modes before."""
    response = task.response
    if lost:
        listed = list_some(f"{each.frequency:.5g} Hz" for each in lost)
        notes = [*notes, Note("nothing of its own", {"modes": len(lost)}, f"Not significant, left out: {listed}")]
    if settled is None:
        return replace(before, left_out=(*before.left_out, *lost), unrefined=before, converged=True).noted(notes)
    point = settled.descent.point
    poles = point.poles + response.added_damping
    spread = spread_of(settled, poles, response, groups)
    order = np.argsort(np.abs(poles), kind="stable")
    fit = last_fit(task, settled)
    dt = 1 / response.sampling_rate if response.held_input and response.sampling_rate else before.dt
    model = replace(
        before,
        poles=poles,
        shapes=fit.shapes,
        dt=dt,
        held_input=response.held_input,
        frequencies_std=spread.frequency,
        damping_ratios_std=spread.damping,
        shapes_std=spread.shapes,
        degrees=spread.degrees,
        damping_ratios_lower=spread.lower if np.any(np.isfinite(spread.lower)) else None,
        frequencies_repeatability=spread.frequency_between,
        damping_ratios_repeatability=spread.damping_between,
        gain=np.sqrt(settled.gain / 2),
        left_out=(*before.left_out, *lost),
        converged=settled.descent.converged,
        notes=(*(note for note in before.notes if note.kind not in _REPLACED_KINDS), *response.inseparable_inputs),
        **fit.fields(response),
    )
    scaled = with_indicators_of_shapes(replace(model.normalized(_scale(before)), unrefined=before))
    notes = [*notes, *_moved_far(before.poles, poles)]
    # lines of records tell their errors whatever the spectrum
    averaged = (response.averages or 1) > 1
    doubt = settled.colour.coloured and not point.problem.records
    told = _told(settled.colour if doubt else None, spread, groups, poles, averaged)
    return scaled.take(order).noted([*notes, *told])


def last_fit(task: Task, settled: Settled) -> JointFit:
    """Return the residues of the very model whose poles are reported: the likelihood's own where its descent came to an end.

    Where no descent was made the given sides still hold, and residues are fitted in turn.
    """
    problem, poles = settled.descent.point.problem, settled.descent.point.poles
    shapes, participation = settled.residues
    model = poles, shapes, task.fixed, settled.powers
    whole = task.response.whole
    if whole is not task.response:  # terms of lines near the modes alone mean nothing between them
        return joint_fit(whole.judging(), *model, participation=participation)
    known = participation if settled.descent.converged else None
    return joint_fit(task.response, *model, participation=known, rows=problem.rows, sides=problem.sides)


#: Beginning of the stated scaling -> argument of `normalized`; others get unit length.
_SCALE_OF_TEXT = {"unit modal mass": "mass", "largest component": "max"}


def _scale(before: ModalModel) -> str:
    return next((scale for words, scale in _SCALE_OF_TEXT.items() if before.scaling.startswith(words)), "unit")


def _moved_far(before: ComplexArray, poles: ComplexArray) -> list[Note]:
    """Say which modes moved so far that they stand for others: the data hold more than the modes that were given."""
    far = astray(before, poles)
    if not far.any():
        return []
    (old, _), (new, _) = frequencies_and_damping(before[far]), frequencies_and_damping(poles[far])
    moves = ", ".join(f"{a:.5g} to {b:.5g} Hz" for a, b in zip(old, new, strict=True))
    text = f"Modes are missing from the list: others moved to them, by more than their half bandwidth ({moves}). Use `analyze` to find all"
    return [Note("moved far", {"modes": int(far.sum())}, text)]


def _told(seen: Colour | None, spread: Spread, groups: Groups, poles: ComplexArray, averaged: bool) -> list[Note]:
    """Say what the deviations rest on, and which poles are too close to have deviations of their own."""
    notes = []
    if seen is not None:
        text = f"Residual not white (lag-1 correlation {seen.correlation:.2g}): intervals widened, model error may exceed them"
        notes.append(Note("coloured residual", {"correlation": seen.correlation, "uneven": seen.uneven}, text))
    if spread.frequency_between is None:
        count = 0 if groups is None else len(set(groups))
        one = "runs averaged into one" if averaged else "single run"
        why = one if not count else f"{counted(count, 'group')}, {LEAST_GROUPS} are needed"
        text = f"Intervals cover noise and model error only; repeatability unknown ({why})"
        notes.append(Note("noise and model only", {"groups": count}, text))
    f = frequencies_and_damping(poles)[0]
    distance = np.abs(f[:, None] - f) + np.diag(np.full(f.size, np.inf))
    near = np.argwhere(
        np.triu(distance < _MIN_DISTANCE_DEVIATIONS * np.hypot(spread.frequency[:, None], spread.frequency))
    )
    if near.size:
        pairs = list_some((f"{f[i]:.5g} and {f[j]:.5g} Hz" for i, j in near), 2)
        text = f"Too close to separate: {pairs}; only mean frequency and common subspace are known"
        notes.append(Note("repeated", {"pairs": len(near)}, text))
    return notes
