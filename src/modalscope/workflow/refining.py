"""Refinement as a part of the whole job: where it makes values better, and why not where it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.identification.beside import needed_beside
from modalscope.identification.in_place import in_place
from modalscope.identification.refine import refine
from modalscope.identification.refined import astray
from modalscope.judging.bands import evened
from modalscope.modal.joint import joint_residues
from modalscope.modal.sufficient import usable_orders
from modalscope.model.checks import ComplexArray, DataError
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.mode_fields import joined
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note
from modalscope.model.record_residual import DELAY, UNMEASURED
from modalscope.model.response import Response

__all__ = ["refined_where_it_helps"]

#: Of one mode.
_DEVIATIONS = (
    "frequencies_std",
    "damping_ratios_std",
    "frequencies_repeatability",
    "damping_ratios_repeatability",
)

#: Modes that go astray are held and the others refined again, so many times at most, while this part of all is left.
_ROUNDS, _LEAST = 4, 0.5


def refined_where_it_helps(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    """Return the selected modes refined, or as they are with a note that says why.

    Poles of the diagram that the data need beside the modes take part, held: real poles, and what was not selected.

    Parameters
    ----------
    diagram : StabilizationDiagram
    modes : ModalModel
        Selected from it.
    """
    if not len(modes):
        return modes
    why = _unfit(diagram)
    if why:
        return modes.noted(_kept(why))
    last = usable_orders(diagram)[0][-1]
    beside = needed_beside(diagram.response, modes.poles, diagram.poles[diagram.order_of_pole == last])
    stay = np.ones(len(modes), bool)
    for _ in range(_ROUNDS):
        try:
            found = refine(diagram.response.whole, modes.take(stay), fixed=np.concatenate([beside, modes.poles[~stay]]))
        except DataError as error:
            return modes.noted(_kept(f"{error.asked}, but {error.found}"))
        if not found.converged:
            reasons = [str(note) for note in found.notes if note.kind == "not converged"]
            return replace(modes, converged=False).noted(_kept(*reasons))
        before = modes.poles[stay] if found.unrefined is None else found.unrefined.poles
        away = astray(before, found.poles)
        if not np.any(away):
            return found if stay.all() else _with_others(diagram.response, modes, found, modes.take(~stay), beside)
        stay &= ~np.isin(modes.poles, before[away])
        if stay.mean() < _LEAST:
            break
    where = ", ".join(f"{abs(s) / (2 * np.pi):.5g} Hz" for s in modes.poles[~stay])
    return modes.noted(_kept(f"the optimum lies far from {where}: the data hold more than these modes"))


def _with_others(
    response: Response, modes: ModalModel, found: ModalModel, others: ModalModel, beside: ComplexArray
) -> ModalModel:
    """Return the refined modes, and beside them others with the values that they had: a stronger neighbour would draw them to its place.

    Their deviations are those of the data at these values, the refined ones around them.
    """
    parts = evened([replace(part, left_out=(), shapes_std=None, unrefined=None) for part in (found, others)])
    everything = joined(parts)
    there = in_place(response.whole, everything, beside)
    own = [int(np.argmin(np.abs(there.poles - s))) for s in others.poles]
    known = {name: getattr(there, name)[own] for name in _DEVIATIONS if getattr(there, name) is not None}
    merged = joined([parts[0], replace(parts[1], **known, converged=True)])
    order = np.argsort(merged.frequencies, kind="stable")
    merged = merged.take(order)
    shapes, fitted = joint_residues(response, merged.poles, merged.shapes)
    where = ", ".join(f"{f:.5g} Hz" for f in others.frequencies)
    text = f"values are not refined at {where}: a stronger neighbour that shifts would draw them to its place"
    note = Note("not refined", {"modes": len(others)}, text)
    both = replace(merged, shapes=shapes, left_out=found.left_out, **fitted).normalized("unit")
    return replace(both, unrefined=modes).noted(note)


def _unfit(diagram: StabilizationDiagram) -> str:
    """Say why the data of a diagram have no likelihood that modes alone can maximize; nothing where they have."""
    response, band = diagram.response, diagram.settings.band
    if response.ambient:
        return "errors of correlations are correlated from lag to lag; refine(record, modes) takes the lines of the record itself"
    if any(note.kind == "transformed" for note in diagram.notes):
        return "the data were transformed before they were identified; choose a domain that takes them as they are"
    if any(note.kind == UNMEASURED for note in diagram.notes):
        return "what was not measured stands out of the residual, and least squares on the records' lines would be biased by it"
    if any(note.kind == DELAY for note in diagram.notes):
        return "channels come late, which the modes alone do not explain; align the channels"
    if diagram.settings.route == "subspace":
        return "past inputs and outputs were taken as instruments, and least squares on the records' lines has none"
    if band is not None and response.in_band(band) is response:
        return "samples are not filtered, so that modes outside the band are in them, too"
    return ""


def _kept(why: str) -> Note:
    return Note("not refined", {}, f"values are not refined: {why}")
