"""Refine selected modes: poles to the maximum of the likelihood, shapes of ambient modes on the lines of the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.mode_fields import joined
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.stored import StoredSignals
from modalscope.identification.orders import usable_orders
from modalscope.identification.refine import in_place, refine
from modalscope.identification.routes import one_record
from modalscope.judging.bands import evened
from modalscope.likelihood.line_shapes import line_shapes
from modalscope.likelihood.refined import astray
from modalscope.likelihood.settling import needed_beside
from modalscope.modal.indicators import mac, mpc, mpd
from modalscope.modal.shapes import joint_residues
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.errors import DataError
from modalscope.preprocess.harmonics import HARMONIC

_STD_FIELDS = (
    *("frequencies_std", "damping_ratios_std", "frequencies_repeatability", "damping_ratios_repeatability"),
    *("degrees", "damping_ratios_lower"),
)

#: Modes that drift away are fixed and the others refined again: maximum number of rounds, and minimum share of refined modes.
_MAX_ROUNDS, _MIN_REFINED = 4, 0.5

#: Half width of a machine's line: in its spreads, plus this part of its frequency.
_HALF_WIDTH_SPREADS, _HALF_WIDTH = 3.0, 0.002

#: Minimum change of a shape, 1 - MAC, that is noted.
_MIN_CHANGE = 0.01


def refined_where_it_helps(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    """Return the modes selected from a diagram refined, or as they are with a note of the reason.

    Poles that the data need in addition (real ones, and those not selected) are fixed at their values in the diagram.
    """
    if not len(modes):
        return modes
    why = _unfit(diagram)
    if why:
        return modes.noted(_kept(why))
    extra = poles_beside(diagram, modes)
    stay = np.ones(len(modes), bool)
    for _ in range(_MAX_ROUNDS):
        fixed = np.concatenate([extra, modes.poles[~stay]])
        try:
            refined = refine(diagram.response.whole, modes.take(stay), fixed=fixed)
        except DataError as error:
            return modes.noted(_kept(f"{error.asked}, but {error.found}"))
        if not refined.converged:
            reasons = [str(note) for note in refined.notes if note.kind == "not converged"]
            return replace(_placed(diagram.response, modes, extra), converged=False).noted(_kept(*reasons))
        before = modes.poles[stay] if refined.unrefined is None else refined.unrefined.poles
        out = np.isin(modes.poles, before[astray(before, refined.poles)])
        if not np.any(out):
            return refined if stay.all() else _with_others(diagram.response, modes, refined, modes.take(~stay), extra)
        stay &= ~out
        if stay.mean() < _MIN_REFINED:
            break
    where = ", ".join(f"{abs(s) / (2 * np.pi):.5g} Hz" for s in modes.poles[~stay])
    kept = _kept(f"the optimum is far from {where}: the data contain more than these modes")
    return _placed(diagram.response, modes, extra).noted(kept)


def poles_beside(diagram: StabilizationDiagram, modes: ModalModel) -> ComplexArray:
    """Return the poles of the last order that the data need beside the modes, rad/s: refinement holds them fixed."""
    last = usable_orders(diagram)[0][-1]
    return needed_beside(diagram.response, modes.poles, diagram.poles[diagram.order_of_pole == last])


def _placed(response: Response, modes: ModalModel, extra: ComplexArray) -> ModalModel:
    """Return modes of records that are not refined with the deviations that the likelihood gives at their values; others as they are."""
    if response.separable:
        return modes
    found = in_place(response.whole, modes, extra)
    return replace(modes, **{name: getattr(found, name) for name in _STD_FIELDS})


def _with_others(
    response: Response, modes: ModalModel, refined: ModalModel, others: ModalModel, extra: ComplexArray
) -> ModalModel:
    """Return the refined modes with others at their unrefined values, which are too close to a stronger, drifting mode.

    Their standard deviations are those at these values, given the refined modes.
    """
    parts = evened([replace(part, left_out=(), shapes_std=None, unrefined=None) for part in (refined, others)])
    at_values = in_place(response.whole, joined(parts), extra)
    own = slice(len(refined), None)
    std = {name: getattr(at_values, name)[own] for name in _STD_FIELDS if getattr(at_values, name) is not None}
    # the likelihood leads away from these values: there is no interval around them
    std["degrees"] = np.zeros((len(others), 2))
    merged = joined([parts[0], replace(parts[1], **std, converged=True)])
    order = np.argsort(merged.frequencies, kind="stable")
    merged = merged.take(order)
    # the refinement may leave modes out, and frequencies may pass each other
    started = others.poles if refined.unrefined is None else np.append(refined.unrefined.poles, others.poles)
    before = modes.take([int(np.argmin(np.abs(modes.poles - s))) for s in started[order]])
    shapes, fitted = joint_residues(response, merged.poles, merged.shapes)
    where = ", ".join(f"{f:.5g} Hz" for f in others.frequencies)
    text = f"Not refined: {where} (too close to a stronger, drifting mode); no intervals"
    note = Note("not refined", {"modes": len(others)}, text)
    both = replace(merged, shapes=shapes, left_out=refined.left_out, **fitted).normalized("unit")
    widths = [part for part in (refined.shapes_std, at_values.shapes_std) if part is not None]
    shapes_std = np.hstack([widths[0], widths[1][:, own]])[:, order] if len(widths) == 2 else None
    return replace(both, unrefined=before, shapes_std=shapes_std).noted(note)


def _unfit(diagram: StabilizationDiagram) -> str:
    """Return why the modes of a diagram cannot be refined; "" where they can."""
    response, band = diagram.response, diagram.settings.band
    if response.ambient:
        return (
            "errors of correlations are correlated from lag to lag; refine(record, modes) uses the lines of the record"
        )
    if any(note.kind == "transformed" for note in diagram.notes):
        return "the data were transformed; choose a domain that uses them as measured"
    if band is not None and response.in_band(band) is response:
        return "samples are not filtered, and contain modes outside the band"
    return ""


def _kept(why: str) -> Note:
    return Note("not refined", {}, f"Not refined: {why}")


def with_line_shapes(
    data: Any, exclude: Any, modes: ModalModel, diagrams: Sequence[StabilizationDiagram]
) -> ModalModel:
    """Return modes of a record without inputs with the shapes of `likelihood.line_shapes`; modes of other data as they are.

    A stored record is used where it fits into memory. `diagrams`: of all bands.
    """
    record = _record(data, exclude)
    if record is None or not len(modes) or len(record.output_dofs) < 2:
        return modes
    numbers = [note.numbers for diagram in diagrams for note in diagram.notes if note.kind == HARMONIC]
    avoided = [
        (n["frequency_hz"], _HALF_WIDTH_SPREADS * n["spread_hz"] + _HALF_WIDTH * n["frequency_hz"]) for n in numbers
    ]
    shapes, deviations = line_shapes(record, modes, avoided)
    refitted = replace(_refitted(modes, shapes, diagrams), shapes_std=deviations).normalized("unit")
    alike = np.diag(mac(refitted.shapes, modes.shapes))
    names = ", ".join(f"{f:.5g} Hz" for f in modes.frequencies[alike < 1 - _MIN_CHANGE])
    if not names:
        return refitted
    text = f"Shapes estimated on the lines of the record, where those of the correlations are others: {names}"
    return refitted.noted(Note("shapes of lines", {"modes": float(np.sum(alike < 1 - _MIN_CHANGE))}, text))


def _record(data: Any, exclude: Any) -> Signals | None:
    """Return the record of the channels that are used, where it is one without inputs and in memory."""
    if not isinstance(data, Signals | StoredSignals | Records) or data.input_dofs:
        return None
    kept = data.select(exclude=exclude) if exclude else data
    if isinstance(kept, Records):
        return one_record(kept, "correlations")
    settled = kept.settled() if isinstance(kept, StoredSignals) else kept
    return settled if isinstance(settled, Signals) else None


def _refitted(modes: ModalModel, shapes: ComplexArray, diagrams: Sequence[StabilizationDiagram]) -> ModalModel:
    """Return modes with other shapes, and participation fitted to the response of their band, whitened as it was identified."""
    participation = modes.known_participation("shapes of the record's lines").copy()
    fields: dict[str, Any] = {}
    for diagram in diagrams:
        low, high = diagram.response.reported_band(diagram.settings.band)
        inside = np.flatnonzero((modes.frequencies >= low) & (modes.frequencies <= high))
        participation[inside], terms = _participation(diagram, modes.poles[inside], shapes[:, inside])
        fields = terms if len(diagrams) == 1 else {}
    changed = np.any(shapes != modes.shapes, axis=0)
    indicators = dict(modes.indicators)
    for name, of_shapes in (("mpc", mpc), ("mpd", mpd)):
        if name in indicators:
            indicators[name] = np.where(changed, of_shapes(shapes), indicators[name])
    return replace(modes, shapes=shapes, participation=participation, indicators=indicators, **fields)


def _participation(
    diagram: StabilizationDiagram, poles: ComplexArray, shapes: ComplexArray
) -> tuple[ComplexArray, dict[str, Any]]:
    """Return participation (n, m) of modes with these shapes by least squares on the response, and the residual terms by name."""
    whitening, response = diagram.whitening, diagram.whitened().response
    inside = shapes if whitening is None else whitening.of_shapes(shapes)
    basis = response.basis(poles - response.added_damping, response.outside_powers).compressed()
    participation, terms = basis.fit_participation(inside)
    participation = response.of_inputs(participation)
    if whitening is not None:
        participation, terms = whitening.references_back(participation), whitening.values_back(terms)
    return participation, dict(diagram.response.named_terms(terms, response.outside_powers))
