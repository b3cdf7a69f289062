"""Identify every band of an analysis, select its modes and refine them; a band with too many modes is cut in parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np

from modalscope.data.analysis import Analysis
from modalscope.data.mode_fields import joined
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.record_residual import DELAY, UNMEASURED
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.setups import Setups, setups_of
from modalscope.identification.ambient_records import bands_of_record, bands_of_setups, looked_through
from modalscope.identification.orders import usable_orders
from modalscope.identification.refine import in_place, refine
from modalscope.identification.stabilize import Watch, stabilize
from modalscope.judging.bands import Part, cut_of, evened, holds_too_little, joined_diagram, joined_modes, merge_bands
from modalscope.judging.select import select
from modalscope.likelihood.refine_setups import refine_setups
from modalscope.likelihood.refined import astray
from modalscope.likelihood.settling import needed_beside
from modalscope.modal.setups import merge_modes, with_repeatability
from modalscope.modal.shapes import joint_residues
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.errors import DataError
from modalscope.preprocess.correlation import estimate_correlation
from modalscope.workflow.line_shapes import with_line_shapes

# ---------------------------------------------------------------------------------------------------- diagrams of bands

Progress = Callable[[int, int], None]
Choose = Callable[..., ModalModel]
Band = tuple[float, float] | None
Sweep = Callable[[Band], StabilizationDiagram]

#: A band is cut in two so many times after another at most: into eight parts.
_DEEPEST = 3


@dataclass(frozen=True, eq=False, slots=True)
class Look:
    """One identified band of an analysis.

    `diagram`: of the whole band, joined of its parts. `band`: Hz; None for all data. `parts`: with a range of orders each; none where
    orders, frequencies or several bands were given. `notes`: why this band. `setup`: its index, where setups are identified apart.
    """

    diagram: StabilizationDiagram
    band: Band = None
    parts: tuple[Part, ...] = ()
    notes: tuple[Note, ...] = ()
    setup: int = 0

    @property
    def reported(self) -> tuple[float, float]:
        """Hz: the ends of the band."""
        return self.band or self.diagram.response.reported_band(None)


def looked_at(
    data: Any, document: Analysis, progress: Progress | None = None, watch: Watch | None = None, choose: Choose = select
) -> list[Look]:
    """Identify every band of an analysis; cut one with automatic orders where it has more modes than these can hold.

    `progress`, `watch`: as in `stabilize`. `choose`: `select`, or a version of it that caches its parts.
    """
    if document.apart:
        alone = replace(document, exclude=(), apart=False)
        return [
            replace(look, setup=k)
            for k, part in enumerate(setups_apart(data, document))
            for look in looked_at(part, alone, progress, watch, choose)
        ]

    seen = looked_through(data, document.exclude or None)

    def sweep(band: Band) -> StabilizationDiagram:
        return stabilize(
            seen,
            method=document.method,
            domain=document.domain,
            orders=document.orders,
            band=band,
            exclude=document.exclude or None,
            route=document.route,
            progress=progress,
            watch=watch,
            **document.options,
        )

    bands: tuple[tuple[float, float], ...] = document.bands
    told: tuple[Note, ...] = ()
    if not bands and document.orders is None:
        if setups_of(seen):
            bands, told = bands_of_setups(seen.select(exclude=document.exclude) if document.exclude else seen)
        else:
            bands, told = bands_of_record(seen)
    if len(bands) > 1 or document.orders is not None or document.frequencies is not None:
        return [Look(sweep(band), band, notes=told) for band in bands or (None,)]
    band = bands[0] if bands else None
    whole = sweep(band)
    by_line = not isinstance(document.options.get("weights"), str | None)  # they belong to the lines of the whole band
    parts = _parts(sweep, choose, _part(choose, band, whole), 0 if by_line else _DEEPEST)
    return [Look(whole if len(parts) == 1 else joined_diagram(whole, parts), band, tuple(parts), told)]


def setups_apart(data: Any, document: Analysis) -> tuple[Signals, ...]:
    """Return the records of every setup without the excluded channels; raise `DataError` for other data and several bands."""
    several = bool(setups_of(data))
    if not several or len(document.bands) > 1:
        what = f"{len(document.bands)} bands" if several else type(data).__name__
        raise DataError(
            "an identification of every setup apart was asked",
            f"there {'are' if several else 'is'} {what}",
            "Give several ambient records with common outputs, and one band or none.",
        )
    return setups_of(data.select(exclude=document.exclude) if document.exclude else data)


def _part(choose: Choose, band: Band, diagram: StabilizationDiagram, core: Band = None) -> Part:
    low, high = diagram.response.reported_band(band)
    return Part(core or (low, high), band, diagram, choose(diagram))


def _parts(sweep: Sweep, choose: Choose, part: Part, deeper: int) -> list[Part]:
    """Return a part, cut in two as long as its orders do not hold it."""
    cut = cut_of(part) if deeper and holds_too_little(part.diagram, part.modes) else None
    if cut is None:
        return [part]
    halves = (_part(choose, band, sweep(band), core) for core, band in cut.halves(part))
    return [found for half in halves for found in _parts(sweep, choose, half, deeper - 1)]


# ------------------------------------------------------------------------------------------------------------ refining
_DEVIATIONS = ("frequencies_std", "damping_ratios_std", "frequencies_repeatability", "damping_ratios_repeatability")

#: Modes that drift away are fixed and the others refined again: rounds, and the least share of modes that are still refined.
_ROUNDS, _LEAST = 4, 0.5


def refined_where_it_helps(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    """Return the modes selected from a diagram refined, or as they are with a note that says why.

    Poles that the data need beside the modes (real ones, and those not selected) are fixed at their values in the diagram.
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
    """Return the refined modes with others at their unrefined values: a stronger neighbour would draw these to its place.

    Their standard deviations are those at these values, given the refined modes.
    """
    parts = evened([replace(part, left_out=(), shapes_std=None, unrefined=None) for part in (found, others)])
    everything = joined(parts)
    there = in_place(response.whole, everything, beside)
    nearest = [int(np.argmin(np.abs(there.poles - s))) for s in others.poles]
    known = {name: getattr(there, name)[nearest] for name in _DEVIATIONS if getattr(there, name) is not None}
    merged = joined([parts[0], replace(parts[1], **known, converged=True)])
    order = np.argsort(merged.frequencies, kind="stable")
    merged = merged.take(order)
    # the refinement may have left modes out, and frequencies may have passed each other
    started = others.poles if found.unrefined is None else np.append(found.unrefined.poles, others.poles)
    before = modes.take([int(np.argmin(np.abs(modes.poles - s))) for s in started[order]])
    shapes, fitted = joint_residues(response, merged.poles, merged.shapes)
    where = ", ".join(f"{f:.5g} Hz" for f in others.frequencies)
    text = f"values are not refined at {where}: a stronger neighbour that shifts would draw them to its place"
    note = Note("not refined", {"modes": len(others)}, text)
    both = replace(merged, shapes=shapes, left_out=found.left_out, **fitted).normalized("unit")
    return replace(both, unrefined=before).noted(note)


def _unfit(diagram: StabilizationDiagram) -> str:
    """Return why the modes of a diagram cannot be refined; empty where they can."""
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


# ------------------------------------------------------------------------------------------------------------ selection


def modes_chosen(data: Any, document: Analysis, looks: Sequence[Look], choose: Choose = select) -> ModalModel:
    """Return the modes of all identified bands, refined where that was asked and helps; `choose`: as in `looked_at`."""
    if not setups_of(data):
        found = _of_bands(document, looks, choose)
        return with_line_shapes(data, document.exclude, found, [look.diagram for look in looks])
    found = _of_setups(data, replace(document, refine=False), looks, choose)
    kept = data.select(exclude=document.exclude) if document.exclude else data
    return refine_setups(kept, found, apart=document.apart) if document.refine else found


def _of_setups(data: Setups, document: Analysis, looks: Sequence[Look], choose: Choose) -> ModalModel:
    """Return the modes of setups that were identified together, or one by one and merged."""
    if not document.apart:
        return _of_bands(document, looks, choose, between=True)
    return merge_modes(
        [_of_bands(document, list(apart), choose) for _, apart in groupby(looks, key=attrgetter("setup"))],
        responses=[estimate_correlation(part) for part in setups_apart(data, document)],
        groups=data.groups,
    )


def _of_bands(document: Analysis, looks: Sequence[Look], choose: Choose, *, between: bool = False) -> ModalModel:
    """Return the modes of every band, with their repeatability `between` setups; frequencies given by hand belong to their band."""
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
            document, frequencies=None if document.frequencies is None else frequencies, taken=taken, refused=refused
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
