"""Refine selected modes to the maximum of the likelihood."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.indicators import with_indicators_of_shapes
from modalscope.data.mode_fields import joined
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.shown import list_some
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.errors import DataError
from modalscope.selection.judging.bands import evened, terms_of
from modalscope.selection.judging.refine import as_given, in_place, refinement
from modalscope.selection.likelihood.descent import Astray
from modalscope.selection.likelihood.noise import undenied
from modalscope.selection.likelihood.refined import last_fit

_STD_FIELDS = (
    *("frequencies_std", "damping_ratios_std", "frequencies_repeatability", "damping_ratios_repeatability"),
    *("degrees", "damping_ratios_lower"),
)


def refined_where_it_helps(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    """Refine the modes selected from a diagram, or return them unchanged with a note of the reason.

    Poles that the data need in addition (real ones, and those not selected) are fixed at their values in the diagram. Levelled channels
    stay levelled.
    """
    if not len(modes):
        return modes
    level = diagram.whitening
    if level is None or diagram.response.ambient:
        return _refined(diagram, modes)
    found = level.modes_back(_refined(diagram.whitened(), level.inverse.modes_back(modes)))
    before = found.unrefined
    scaled = replace(found, unrefined=None if before is None else before.normalized("unit")).normalized("unit")
    return with_indicators_of_shapes(scaled)


def _refined(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    why = _unfit(diagram)
    if why:
        return modes.noted(_kept(why))
    extra = terms_of(modes)[0]
    stay = np.ones(len(modes), bool)
    while stay.any():
        fixed = np.concatenate([extra, modes.poles[~stay]])
        try:
            whole = diagram.response.whole
            found = refinement(whole, modes.take(stay), fixed=fixed, confined=True, complete=not whole.separable)
            refined = found.modes() if found.converged else None
        except Astray as away:
            stay &= ~np.isin(modes.poles, away.homes)
            continue
        except DataError as error:
            return modes.noted(_kept(error.fault))
        if refined is None:
            reasons = [str(note) for note in found.notes if note.kind == "not converged"]
            return replace(_placed(diagram, modes, extra), converged=False).noted(_kept(*reasons))
        return refined if stay.all() else _with_others(diagram.response, modes, refined, modes.take(~stay), extra)
    return _with_others(diagram.response, modes, modes.take(stay), modes, extra)


def _placed(diagram: StabilizationDiagram, modes: ModalModel, extra: ComplexArray) -> ModalModel:
    """Return modes of records that are not refined with the deviations that the likelihood gives at their values; others as they are."""
    if diagram.response.separable:
        return modes
    found = in_place(diagram.response.whole, modes, extra)
    placed = replace(modes, **{name: getattr(found, name) for name in _STD_FIELDS})
    return replace(placed, notes=undenied(placed, placed.notes))


def _with_others(
    response: Response, modes: ModalModel, refined: ModalModel, others: ModalModel, extra: ComplexArray
) -> ModalModel:
    """Return the refined modes with others at their unrefined values, which the likelihood leads to other modes.

    These have no deviations: there is no interval around values that the likelihood leads away from. Residues of all are the last fit.
    """
    nothing: dict[str, Any] = {**dict.fromkeys(_STD_FIELDS), "degrees": np.zeros((len(others), 2)), "converged": True}
    known = refined.shapes_std
    shapes_std = None if known is None else np.hstack([known, np.full(others.shapes.shape, np.nan)])
    bare = [replace(part, left_out=(), shapes_std=None, unrefined=None) for part in (refined, others)]
    merged = joined(evened([bare[0], replace(bare[1], **nothing)]))
    fit = last_fit(*as_given(response.whole, merged, extra))
    order = np.argsort(merged.frequencies, kind="stable")
    # the refinement may leave modes out, and frequencies may pass each other
    started = others.poles if refined.unrefined is None else np.append(refined.unrefined.poles, others.poles)
    before = modes.take([int(np.argmin(np.abs(modes.poles - s))) for s in started[order]])
    where = list_some(f"{f:.5g} Hz" for f in others.frequencies)
    text = f"Not refined: {where} (their optimum lies at other modes); no intervals"
    note = Note("not refined", {"modes": len(others)}, text)
    fitted = replace(merged, left_out=refined.left_out, shapes=fit.shapes, **fit.fields(response.whole))
    found = replace(fitted.normalized("unit"), shapes_std=shapes_std).take(order)
    return with_indicators_of_shapes(replace(found, unrefined=before if len(refined) else None)).noted(note)


def _unfit(diagram: StabilizationDiagram) -> str:
    """Return why the modes of a diagram cannot be refined; "" where they can."""
    response, band = diagram.response, diagram.settings.band
    if response.ambient:
        return "errors of correlations are correlated between lags. Use refine(record, modes), which works on the lines of the record"
    if any(note.kind == "transformed" for note in diagram.notes):
        return "the data were transformed; choose a domain that uses them as measured"
    if band is not None and response.in_band(band) is response:
        return "samples are not filtered, and contain modes outside the band"
    return ""


def _kept(why: str) -> Note:
    return Note("not refined", {}, f"Not refined: {why}")
