"""The modes of what was identified, by the choices in a document: of parts, bands and setups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np

from modalscope.identification.refine_setups import refine_setups
from modalscope.judging.bands import merge_bands
from modalscope.judging.parts import Part, joined_modes
from modalscope.judging.select import select
from modalscope.modal.between import with_repeatability
from modalscope.modal.several import merge_modes
from modalscope.model.analysis import Analysis
from modalscope.model.checks import DataError
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.modes import ModalModel
from modalscope.model.setups import Setups
from modalscope.preprocess.correlation import estimate_correlation
from modalscope.workflow.parts import Choose, Look, setups_apart
from modalscope.workflow.refining import refined_where_it_helps

__all__ = ["modes_chosen"]


def modes_chosen(data: Any, document: Analysis, looks: Sequence[Look], choose: Choose = select) -> ModalModel:
    """Return the modes of all that was identified, refined where that was chosen and helps.

    Parameters
    ----------
    data : data object
    document : Analysis
    looks : sequence of Look
        Of the bands of the document, or of every setup apart.
    choose : callable
        `select`, or what keeps its parts from one choice to the next.
    """
    if not isinstance(data, Setups):
        return _of_bands(document, looks, choose)
    found = _of_setups(data, replace(document, refine=False), looks, choose)
    kept = data.select(exclude=document.exclude) if document.exclude else data
    return refine_setups(kept, found, apart=document.apart) if document.refine else found


def _of_setups(data: Setups, document: Analysis, looks: Sequence[Look], choose: Choose) -> ModalModel:
    """Return the modes of setups that were identified together, or apart and put together."""
    if not document.apart:
        return _of_bands(document, looks, choose, between=True)
    return merge_modes(
        [_of_bands(document, list(apart), choose) for _, apart in groupby(looks, key=attrgetter("setup"))],
        responses=[estimate_correlation(part) for part in setups_apart(data, document)],
        groups=data.groups,
    )


def _of_bands(document: Analysis, looks: Sequence[Look], choose: Choose, *, between: bool = False) -> ModalModel:
    """Return the modes of every band, `between` setups with what these disagree by; one given by hand belongs to the band it lies in."""
    if len(looks) == 1:
        return _repeated(_of_band(document, looks[0], choose), looks[0], between)
    parts = []
    for look in looks:
        low, high = look.reported
        frequencies, taken, refused = (
            tuple(f for f in given or () if low <= f <= high)
            for given in (document.frequencies, document.taken, document.refused)
        )
        if document.frequencies is not None and not frequencies:
            continue
        here = replace(
            document,
            frequencies=None if document.frequencies is None else frequencies,
            taken=taken,
            refused=refused,
        )
        parts.append(((low, high), _repeated(_of_band(here, look, choose), look, between)))
    if not parts:
        raise DataError(
            "modes at given frequencies were asked", "none of these lies in a band", "Give bands that hold them."
        )
    return merge_bands([modes for _, modes in parts], [band for band, _ in parts])


def _repeated(modes: ModalModel, look: Look, between: bool) -> ModalModel:
    return with_repeatability(modes, look.diagram.response) if between else modes


def _of_band(document: Analysis, look: Look, choose: Choose) -> ModalModel:
    """Return the modes of one band."""

    def improved(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
        return refined_where_it_helps(diagram, modes) if document.refine else modes

    if not look.parts:
        by_hand = {"frequencies": document.frequencies, "take": document.taken, "refuse": document.refused}
        return improved(look.diagram, choose(look.diagram, **by_hand))
    cuts = [part.core[1] for part in look.parts[:-1]]

    def reported(k: int, part: Part) -> ModalModel:
        take, refuse = (
            [f for f in given if np.searchsorted(cuts, f) == k] for given in (document.taken, document.refused)
        )
        found = choose(part.diagram, take=take, refuse=refuse) if take or refuse else part.modes
        return improved(part.diagram, found)

    each = [reported(k, part) for k, part in enumerate(look.parts)]
    return each[0] if len(each) == 1 else joined_modes(look.parts, each, look.diagram.response)
