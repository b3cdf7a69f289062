"""The chosen modes as a modal model: median poles, shapes and participation fitted together to the data, and the reasons."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.judging.evidence import Candidate, sentence
from modalscope.judging.tracking import Poles
from modalscope.modal.indicators import mac
from modalscope.modal.joint import joint_residues
from modalscope.modal.rebuilt import rebuilt
from modalscope.model.checks import Array, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.modes import ModalModel
from modalscope.model.poles import poles_from
from modalscope.model.response import Response
from modalscope.model.robust import scatter
from modalscope.uncertainty.noise import KIND
from modalscope.uncertainty.of_modes import typical_deviation, withheld

__all__ = ["modes_of"]


def modes_of(diagram: StabilizationDiagram, poles: Poles, chosen: list[Candidate]) -> ModalModel:
    """Wrap the chosen modes: median poles, and residues fitted together from the shapes that are nearest to all others of a mode."""
    response = diagram.response
    picked = [c.members[np.argmax(mac(poles.shape[c.members].T).sum(axis=1))] for c in chosen]
    values = poles_from([c.frequency for c in chosen], [c.damping for c in chosen])
    shapes = poles.shape[picked].T if chosen else np.zeros((response.values.shape[1], 0), complex)
    shapes, fitted = joint_residues(response, values, shapes)
    members = [c.members for c in chosen]
    spreads = [
        {"frequency_spread_hz": scatter(poles.frequency[m]), "damping_ratio_spread": scatter(poles.damping[m])}
        for m in members
    ]
    model = ModalModel(
        poles=values,
        shapes=shapes,
        quantity=response.quantity,
        dt=diagram.dt,
        held_input=response.held_input,
        frequencies_spread=np.array([spread["frequency_spread_hz"] for spread in spreads]),
        damping_ratios_spread=np.array([spread["damping_ratio_spread"] for spread in spreads]),
        **_deviations(diagram, members, poles),
        indicators=_indicators(diagram, members, poles),
        **response.labelled(),
        **fitted,
    )
    facts = [{**c.facts, **spread} for c, spread in zip(chosen, spreads, strict=True)]
    reasons = _reasons(model, response, facts)
    told = [note for note in diagram.notes if note.kind == KIND]
    return replace(model, reasons=reasons, notes=(*told, *withheld(model))).normalized("unit")


def _deviations(diagram: StabilizationDiagram, members: list[Array], poles: Poles) -> dict[str, Any]:
    """Return for every mode the deviation of the members that did not split: of those that did it is many times as large."""
    found = {}
    for name in ("frequencies_std", "damping_ratios_std"):
        values = getattr(diagram, name)
        if values is not None:
            found[name] = np.array([typical_deviation(values[poles.index[group]]) for group in members])
    return found


def _indicators(diagram: StabilizationDiagram, members: list[Array], poles: Poles) -> dict[str, RealArray]:
    """Return for every mode the median of its members' indicators."""
    return {
        name: np.array([float(np.median(column[poles.index[group]])) for group in members])
        for name, column in diagram.indicators.items()
    }


def _reasons(model: ModalModel, response: Response, facts: list[dict[str, Any]]) -> tuple[dict[str, Any], ...]:
    """Complete the reasons: what the rebuilt response loses without the mode, and a sentence."""
    if not len(model):
        return ()
    size = np.linalg.norm(response.values)
    left = response.values - rebuilt(response, model)
    error = np.linalg.norm(left) / size
    reasons = []
    for j, known in enumerate(facts):
        alone = replace(model.take([j]), feedthrough=None, lower_residual=None, upper_residual=None)
        loss = np.linalg.norm(left + rebuilt(response, alone)) / size - error
        text = known.get("text") or sentence(known, float(loss))
        reasons.append({**known, "fit_loss": float(loss), "text": text})
    return tuple(reasons)
