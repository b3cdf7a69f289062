"""Replicates of a result: the response that its modes give plus noise like that of the data, identified as the reported modes were."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.identification.lookup import find_method
from modalscope.identification.measured import Measured
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import pose
from modalscope.identification.refine import refine
from modalscope.identification.sweep import Sweep
from modalscope.judging.select import select
from modalscope.judging.stabilize import stabilized
from modalscope.modal.indicators import mac
from modalscope.modal.joint import joint_residues
from modalscope.modal.rebuilt import rebuilt
from modalscope.model.checks import Array, DataError, IntArray, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.modes import ModalModel
from modalscope.model.pairing import assign
from modalscope.model.response import Response
from modalscope.model.signals import Signals
from modalscope.uncertainty.noise import Noise, noise_of
from modalscope.uncertainty.of_modes import SPLIT
from modalscope.uncertainty.residual import residual_variance, unexplained_energy

__all__ = ["Replicates", "matched", "nearest_order", "replicates_of"]

#: A replicate finds a mode within so many half bandwidths or deviations, with a shape this much alike.
_NEAR_BANDWIDTHS, _NEAR_DEVIATIONS, _ALIKE = 2.0, 10.0, 0.5


@dataclass(frozen=True, eq=False, slots=True)
class Replicates:
    """How replicates of a result are made and identified; made by `replicates_of`.

    Parameters
    ----------
    diagram : StabilizationDiagram
    modes : ModalModel
        The truth of every replicate.
    clean : array
        The rebuilt response.
    noise : Noise
    order : int
    whole : bool
        Whether the selection is replayed, too.
    """

    diagram: StabilizationDiagram
    modes: ModalModel
    clean: Array
    noise: Noise
    order: int
    whole: bool

    def one(self, rng: np.random.Generator) -> RealArray:
        """Return frequencies, damping ratios and their deviations of one replicate, (4, n); NaN where a mode is not found.

        Parameters
        ----------
        rng : numpy Generator
        """
        values = self.clean + self.noise.drawn(self.clean.shape, rng)
        response: Response = replace(self.diagram.response, values=values)
        found = np.full((4, len(self.modes)), np.nan)
        try:
            modes = self._identified(response)
        except DataError:  # no model, no mode: not found
            return found
        mine, theirs = matched(self.modes, modes)
        if self.modes.unrefined is not None and len(theirs):
            modes = refine(response, modes.take(np.sort(theirs)))
            mine, theirs = matched(self.modes, modes)
        found[0, mine], found[1, mine] = modes.frequencies[theirs], modes.damping_ratios[theirs]
        for row, name in ((2, "frequencies_std"), (3, "damping_ratios_std")):
            told, std = getattr(self.modes, name), getattr(modes, name)
            if (
                told is not None
            ):  # where a replicate has none of its own, as of correlations without records, what is tried itself
                own = np.full(len(mine), np.nan) if std is None else std[theirs]
                found[row, mine] = np.where(np.isfinite(own), own, told[mine])
        return found

    def _identified(self, response: Response) -> ModalModel:
        diagram, settings = self.diagram, self.diagram.settings
        row = find_method(diagram.method, diagram.domain, diagram.domain, settings.route)
        options = {k: v for k, v in settings.items() if k not in ("band", "exclude", "route", *row.fixed)}
        measured = Measured(
            response, None, "a replicate", row.name, row.domain, band=settings.band, route=settings.route
        )
        problem = pose(measured, row, options)
        if self.whole:
            return select(stabilized(problem, list(diagram.asked_orders or diagram.orders)))
        found = Sweep(factor(problem, self.order), [self.order]).cut(self.order)
        return found.modes.take(found.reported)


def replicates_of(
    diagram: StabilizationDiagram, modes: ModalModel, records: Signals | None = None, *, whole: bool = False
) -> Replicates:
    """Return how to make replicates of modes that were selected from a diagram.

    Parameters
    ----------
    diagram : StabilizationDiagram
    modes : ModalModel
    records : Signals, optional
        That correlations were made from.
    whole : bool
        Whether the selection is replayed, too.

    Raises
    ------
    DataError
        No modes, noise of which nothing is known, or a method that works on past records themselves.
    """
    if not len(modes):
        raise DataError("a certificate was asked", "there are no modes", "Give a result with modes.")
    row = find_method(diagram.method, diagram.domain, diagram.domain, diagram.settings.route)
    if row.of_past:
        raise DataError(
            f"a certificate of {row.label} was asked",
            "it projects the records themselves on their past, and replicates are made of responses",
            "Certify another method on the same record.",
        )
    response, order = diagram.response, nearest_order(diagram, modes.unrefined or modes)
    clean = rebuilt(response, modes)
    noise = _noise_beside(diagram, modes, order, records)
    noise.drawn(clean.shape, np.random.default_rng(0))  # raises where nothing is known of it
    return Replicates(diagram, modes, clean, noise, order, whole)


def _noise_beside(diagram: StabilizationDiagram, modes: ModalModel, order: int, records: Signals | None) -> Noise:
    """Return the noise, given what all decaying poles of the order that made the modes leave, with its spectrum where that is seen."""
    response = diagram.response
    is_complex = bool(np.iscomplexobj(response.values))
    own = np.flatnonzero((diagram.order_of_pole == order) & (diagram.poles.real < 0))
    poles, shapes = (diagram.poles[own], diagram.shapes[:, own]) if own.size else (modes.poles, modes.shapes)
    basis = response.basis(poles - response.added_damping, response.outside_powers)
    free = response.count * (1 + is_complex) - basis.columns.shape[1]
    variance = residual_variance(unexplained_energy(basis), free, is_complex)
    noise = noise_of(response, records)
    if not is_complex:
        return noise.beside(variance)
    shapes, fitted = joint_residues(response, poles, shapes)
    model = ModalModel(
        poles=poles, shapes=shapes, dt=diagram.dt, held_input=response.held_input, **fitted, **response.labelled()
    )
    left = response.values - rebuilt(response, model)
    level = np.sqrt(variance / np.maximum(np.mean(np.abs(left) ** 2, axis=0), 1e-300))
    return noise.beside(variance, left * level)


def nearest_order(diagram: StabilizationDiagram, modes: ModalModel) -> int:
    """Return the order whose poles are nearest to the modes, each at most a half bandwidth to its account, and split the fewest of them.

    Of a mode that is split in two the deviation is, rightly, many times that of the mode.

    Parameters
    ----------
    diagram : StabilizationDiagram
    modes : ModalModel
        Selected from it.
    """
    costs = []
    for order in diagram.orders:
        own = np.flatnonzero(diagram.order_of_pole == order)
        if not own.size:
            costs.append(np.inf)
            continue
        distance = np.abs(diagram.poles[own][:, None] - modes.poles) / np.abs(modes.poles.real)
        cost = np.minimum(distance.min(axis=0), 1.0)
        if diagram.frequencies_std is not None and modes.frequencies_std is not None:
            std = diagram.frequencies_std[own[np.argmin(distance, axis=0)]]
            cost = cost + (std > SPLIT * modes.frequencies_std)
        costs.append(float(np.sum(cost)))
    return int(diagram.orders[int(np.argmin(costs))])


def matched(truth: ModalModel, found: ModalModel) -> tuple[IntArray, IntArray]:
    """Return which modes were found, and as what: near in frequency and alike in shape."""
    if not len(found):
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    half = np.abs(truth.poles.real) / (2 * np.pi)
    std = np.zeros(len(truth)) if truth.frequencies_std is None else np.nan_to_num(truth.frequencies_std)
    near = np.maximum(_NEAR_BANDWIDTHS * half, _NEAR_DEVIATIONS * std)[:, None]
    away = np.abs(truth.frequencies[:, None] - found.frequencies) / near
    likeness = mac(truth.shapes, found.shapes)
    distance = np.abs(truth.poles[:, None] - found.poles) / np.maximum(np.abs(truth.poles.real), 1e-300)[:, None]
    allowed = (away <= 1) & (likeness >= _ALIKE)
    rows, columns = assign(np.where(allowed, np.minimum(distance, 1e3) + 1 - likeness, 1e6))
    good = allowed[rows, columns]
    return np.asarray(rows[good]), np.asarray(columns[good])
