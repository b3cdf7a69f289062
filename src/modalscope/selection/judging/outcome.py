"""Build the modal model of the selected groups, paired with a reference where one is given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.indicators import mac
from modalscope.data.mode_fields import DIRECT
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Candidate as LeftOut, Note
from modalscope.data.rebuilt import rebuilt
from modalscope.data.response import Response
from modalscope.data.results import DEVIATIONS, StabilizationDiagram
from modalscope.data.sameness import likeliest, log_ratios
from modalscope.data.shown import figures, list_some
from modalscope.data.whitening import levels_of_channels
from modalscope.identification.orders import ORDERS_END, last_poles
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.statistics import few_channels, scatter
from modalscope.selection.judging.evidence import LEAST_ORDERS, LEAST_SHARE, Candidate, sentence
from modalscope.selection.judging.tracking import Poles
from modalscope.selection.likelihood.joint_fit import joint_fit, joint_residues
from modalscope.selection.likelihood.noise import KIND, typical_deviation, withheld
from modalscope.selection.likelihood.settling import needed_beside, out_of_band_poles

#: Numbers of responses that are rebuilt at a time.
_NUMBERS_AT_A_TIME = 1 << 20


def modes_of(
    diagram: StabilizationDiagram, poles: Poles, chosen: list[Candidate], left: Sequence[Candidate] = ()
) -> ModalModel:
    """Wrap the chosen modes: median poles, and residues fitted together from the shapes that are nearest to all others of a mode."""
    response = diagram.response
    values = poles_from([c.frequency for c in chosen], [c.damping for c in chosen])
    shapes, fitted = _residues(diagram, values, chosen, poles)
    spreads = [_spread(poles, c) for c in chosen]
    model = ModalModel(
        poles=values,
        shapes=shapes,
        quantity=response.quantity,
        dt=diagram.dt,
        held_input=response.held_input,
        frequencies_spread=np.array([spread["frequency_spread_hz"] for spread in spreads]),
        damping_ratios_spread=np.array([spread["damping_ratio_spread"] for spread in spreads]),
        gain=None if any(np.isnan(c.gain) for c in chosen) else np.array([c.gain for c in chosen]),
        left_out=left_out(diagram, left, chosen=bool(chosen)),
        **_deviations(diagram, chosen, poles),
        indicators=_indicators(diagram, chosen, poles),
        **response.labelled(),
        **fitted,
    )
    facts = [{**c.facts, **spread} for c, spread in zip(chosen, spreads, strict=True)]
    reasons = _reasons(model, response, facts)
    told = [note for note in diagram.notes if note.kind == KIND]
    notes = (
        *told,
        *response.inseparable_inputs,
        *withheld(model),
        *_undecided(diagram, left),
        *_shifting(chosen),
        *_none(diagram, chosen, left),
    )
    return replace(model, reasons=reasons, notes=notes).normalized("unit")


def _residues(
    diagram: StabilizationDiagram, values: ComplexArray, chosen: list[Candidate], poles: Poles
) -> tuple[ComplexArray, dict[str, Any]]:
    """Return shapes, and all else that is fitted: residues that are known are the nearest of rank one, and the others follow."""
    response = diagram.response
    outputs, inputs = response.values.shape[1], len(response.input_dofs)
    shapes, participation = np.zeros((outputs, len(chosen)), complex), np.zeros((len(chosen), inputs), complex)
    known = np.array([c.residue is not None for c in chosen], dtype=bool)
    for j, c in enumerate(chosen):
        if c.residue is None:
            shapes[:, j] = _middle(poles, c)
        else:
            U, d, Vh = np.linalg.svd(c.residue, full_matrices=False)
            shapes[:, j], participation[j] = U[:, 0], d[0] * Vh[0]
    if response.ambient or not len(chosen):  # errors of correlations are no terms of a fit
        return joint_residues(response, values, shapes)
    if known.any():
        held = values[known], shapes[:, known], participation[known]
        shapes[:, ~known], fitted = joint_residues(response, values[~known], shapes[:, ~known], held)
        participation[~known] = fitted["participation"]
    added = response.added_damping
    model = values - added, shapes, _poles_besides(diagram, values) - added, response.refined_powers
    fit = joint_fit(response, *model, participation=participation if known.any() else None)
    return fit.shapes, fit.fields(response)


def _poles_besides(diagram: StabilizationDiagram, values: ComplexArray) -> ComplexArray:
    """Return the poles that the data need besides modes (n,), rad/s: of the last order, and some for modes outside the band of lines."""
    found = last_poles(diagram)
    return needed_beside(diagram.response, values, np.concatenate([found, out_of_band_poles(diagram.response)]))


def _undecided(diagram: StabilizationDiagram, candidates: Sequence[Candidate]) -> tuple[Note, ...]:
    """Return a note on what the data need and only the last orders show: where they end it can be no mode yet."""
    late = sorted(c.frequency for c in candidates if c.facts.get("late"))
    if not late:
        return ()
    where, last = list_some(f"{f:.5g} Hz" for f in late), diagram.orders[-1]
    text = f"Modes at {where} appear at the last orders only (up to {last}): give more orders, or narrower bands"
    return (Note(ORDERS_END, {"largest": last, "late": len(late)}, text),)


def _shifting(chosen: Sequence[Candidate]) -> tuple[Note, ...]:
    """Return a note on resonances that differ from channel to channel."""
    known = next((c.facts for c in chosen if "shift_by_output" in c.facts), None)
    if known is None:
        return ()
    by_output, by_input = (100 * known[f"shift_by_{side}"] for side in ("output", "input"))
    text = (
        f"Sensors disagree on frequency by {figures(by_output, 2)} %, places of force by {figures(by_input, 2)} %: "
        "mass loading, or the structure changed during the test"
    )
    return (Note("shifts", {"by_output": by_output, "by_input": by_input}, text),)


def _none(diagram: StabilizationDiagram, chosen: Sequence[Candidate], left: Sequence[Candidate]) -> tuple[Note, ...]:
    """Return a note that says why a list is empty."""
    if chosen:
        return ()
    orders = f"orders {diagram.orders[0]} to {diagram.orders[-1]}"
    if left:
        strongest = max(left, key=lambda c: c.members.size)
        text = f"No mode among {len(left)} candidates; the one at most orders, {strongest.frequency:.5g} Hz: {'; '.join(strongest.against)}"
    elif len(diagram.poles):
        text = f"No mode: no decaying oscillation is found at three of the {orders}. Try more orders"
    else:
        text = f"No mode: the {orders} have no pole in the band"
    return (Note("no mode", {"candidates": len(left)}, text),)


def left_out(diagram: StabilizationDiagram, candidates: Sequence[Candidate], *, chosen: bool) -> tuple[LeftOut, ...]:
    """Return what looked like a mode and is not reported, with the reason: groups at enough orders, and what the data show without any.

    Where no mode was chosen all groups are told: why there is none is what is asked then.
    """
    least = max(min(LEAST_ORDERS, len(diagram.orders)), LEAST_SHARE * len(diagram.orders)) if chosen else 0
    return tuple(
        LeftOut(
            frequency=c.frequency,
            damping_ratio=c.damping,
            gain=c.gain,
            reason="; ".join(c.against) or "refused by the user",
            remedy=f"take=[{c.frequency:.6g}] reports it anyway" if c.against else "Do not refuse it.",
        )
        for c in candidates
        if c.own is not None or c.members.size >= least
    )


def _middle(poles: Poles, c: Candidate) -> ComplexArray:
    """Return the shape that is nearest to those of all members."""
    if c.own is not None:
        return c.own.shape
    return np.asarray(poles.shape[c.members[np.argmax(mac(poles.shape[c.members].T).sum(axis=1))]])


def _spread(poles: Poles, c: Candidate) -> dict[str, float]:
    """Return the scatter over orders; one order has none, and no orders have none that is known."""
    both = poles.frequency[c.members], poles.damping[c.members]
    of_f, of_damping = map(scatter, both) if c.own is None else (np.nan, np.nan)
    return {"frequency_spread_hz": of_f, "damping_ratio_spread": of_damping}


def _deviations(diagram: StabilizationDiagram, chosen: list[Candidate], poles: Poles) -> dict[str, Any]:
    """Return for every mode the deviation of the members that did not split: of those that did it is many times as large."""
    members = [poles.index[c.members] for c in chosen]
    ends = np.cumsum([len(index) for index in members])[:-1]
    found = {}
    of_members = diagram.deviations_at(np.concatenate([*members, np.zeros(0, dtype=int)]))
    for name, of_own, values in zip(DEVIATIONS, ("frequency_std", "damping_std"), of_members, strict=True):
        if values is not None:
            each = zip(chosen, np.split(values, ends), strict=False)  # of no modes one empty part is left
            found[name] = np.array([typical_deviation(v) if c.own is None else getattr(c.own, of_own) for c, v in each])
    return found


def _indicators(diagram: StabilizationDiagram, chosen: list[Candidate], poles: Poles) -> dict[str, RealArray]:
    """Return for every mode the median of its members' indicators; NaN without members."""
    return {
        name: np.array([float(np.median(column[poles.index[c.members]])) if c.members.size else np.nan for c in chosen])
        for name, column in diagram.indicators.items()
    }


def _reasons(model: ModalModel, response: Response, facts: list[dict[str, Any]]) -> tuple[dict[str, Any], ...]:
    """Complete the reasons: what the rebuilt response loses without the mode, and a sentence."""
    if not len(model):
        return ()
    model = replace(model, residual_terms=())  # poles besides the modes may explain what a mode would
    level, size, without = np.outer(*levels_of_channels(response.values)), 0.0, np.zeros(len(model) + 1)
    outputs, numbers = range(len(response.output_dofs)), response.count * len(response.input_dofs)
    # the first states of records are fitted to all outputs together
    pieces = few_channels(numbers, len(outputs), _NUMBERS_AT_A_TIME) if response.separable else (slice(None),)
    for few in pieces:
        own = outputs[few]
        parts = (response, model) if own == outputs else (response.select(outputs=own), model.select(outputs=own))
        size += float(np.linalg.norm(parts[0].values / level[few]) ** 2)
        without += _missed_without(*parts, level[few])
    losses = (np.sqrt(without[:-1]) - np.sqrt(without[-1])) / np.sqrt(size)
    return tuple(
        {**known, "fit_loss": float(loss), "text": known.get("text") or sentence(known, float(loss))}
        for known, loss in zip(facts, losses, strict=True)
    )


def _missed_without(response: Response, model: ModalModel, level: RealArray) -> RealArray:
    """Return the squared misfit of modes without each of them, and of all of them, (n + 1,), channels divided by a level (l, m)."""
    left = (response.values - rebuilt(response, model)) / level
    missed = np.full(len(model) + 1, np.linalg.norm(left) ** 2)
    no_terms: dict[str, Any] = dict.fromkeys(DIRECT)
    for j in range(len(model)):
        more = rebuilt(response, replace(model.take([j]), **no_terms)) / level
        missed[j] += np.linalg.norm(more) ** 2 + 2 * np.vdot(left, more).real
    return np.maximum(missed, 0)


# ----------------------------------------------------------------------------------------------------------- reference
# Modes paired with those of another program or test: which are the same, and by how much they differ, in deviations too.


def paired_with(
    reference: ModalModel, candidates: list[Candidate], poles: Poles, tolerance: float
) -> list[tuple[Candidate, int]]:
    """Return candidates and the reference mode that each is, by `same_modes`; rejected ones for those that no other candidate is.

    Shapes count where both have as many outputs. Frequencies lie within the tolerance or the larger half bandwidth.

    `tolerance`: relative distance of frequencies, two standard deviations.
    """
    if not candidates or not len(reference):
        return []
    shapes = [c.own.shape if c.own is not None else poles.shape[c.members[0]] for c in candidates]
    alike = len(reference.shapes) == len(shapes[0])
    asked = reference if alike else reference.select(outputs=[0])
    given = ModalModel(
        poles=poles_from([c.frequency for c in candidates], [c.damping for c in candidates]),
        shapes=(np.array(shapes).T if alike else np.ones((1, len(candidates)))).astype(complex),
        output_dofs=asked.output_dofs,
    )
    f, g = asked.frequencies[:, None], given.frequencies
    room = np.maximum(tolerance * f, np.maximum(f * asked.damping_ratios[:, None], g * given.damping_ratios))
    ratio = np.where(np.abs(f - g) <= room, log_ratios(asked, given, tolerance / 2), -np.inf)
    found: list[tuple[Candidate, int]] = []
    for rejected in (False, True):
        rows = np.setdiff1d(np.arange(len(reference)), [i for _, i in found])
        columns = np.flatnonzero([bool(c.against) == rejected for c in candidates])
        pairs = zip(*likeliest(ratio[np.ix_(rows, columns)]), strict=True)
        found += [(candidates[columns[j]], int(rows[i])) for i, j in pairs]
    return found


def compared_with(modes: ModalModel, reference: ModalModel, which: Array) -> ModalModel:
    """Return modes whose reasons hold the differences to the reference; what of the reference has no partner is a note.

    `which` (n,): the reference mode of each.
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
    where = list_some(f"{reference.frequencies[k]:.5g} Hz" for k in missing)
    note = Note("reference", {"missing": float(missing.size)}, f"Reference modes not found: {where}")
    return replace(modes, reasons=reasons).noted(note)


def _together(modes: ModalModel, reference: ModalModel, which: Array, name: str) -> RealArray:
    """Standard deviation of a difference: of both where both are known, of one where one is, else NaN."""
    parts = [getattr(modes, f"{name}_std"), getattr(reference, f"{name}_std")]
    own = np.full(len(modes), np.nan) if parts[0] is None else parts[0]
    other = np.full(len(modes), np.nan) if parts[1] is None else parts[1][which]
    both = np.nan_to_num(own) ** 2 + np.nan_to_num(other) ** 2
    return np.asarray(np.where(np.isnan(own) & np.isnan(other), np.nan, np.sqrt(both)))
