"""One order after the other from one factorization: cut, judged and handed out as it comes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.blocks.misfit import Misfit
from modalscope.blocks.threads import one_thread
from modalscope.blocks.triple import Triple
from modalscope.identification.options import AllOptions
from modalscope.identification.orders import checked_orders
from modalscope.identification.pipeline import Pipeline, factor
from modalscope.identification.prepare import prepare
from modalscope.modal.accuracy import indicators_of
from modalscope.modal.eigenmodes import Eigenmodes, eigenmodes, split_extraneous
from modalscope.modal.rebuilt import modal_model
from modalscope.model.checks import DataError, IntArray, RealArray
from modalscope.model.keywords import named
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note
from modalscope.model.output_levels import output_scale
from modalscope.model.poles import frequencies_and_damping
from modalscope.uncertainty.deviations import Deviations, deviations_of
from modalscope.uncertainty.noise import Noise, Unknown, noise_of
from modalscope.uncertainty.residual import residual_variance, unexplained_energy

__all__ = ["Cut", "Sweep", "cut_order", "sweep"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Cut:
    """One order: its model, its modes and how far to trust them.

    Parameters
    ----------
    order : int
    triple : Triple
        (A, B, C), with inputs and outputs in their own places.
    modal : Eigenmodes
        All its poles, as they are in the data.
    modes : ModalModel
        The same, with what an exponential window added taken off.
    reported : array of int
        The poles that a rank explains and that lie in the band.
    indicators : mapping of name to array (k,)
    misfit : float
        norm(measured - rebuilt) / norm(measured) over the data, each output divided by its root mean square.
    std : Deviations, optional
        Standard deviations of the reported poles, where they were asked.
    """

    order: int
    triple: Triple
    modal: Eigenmodes
    modes: ModalModel
    reported: IntArray
    indicators: Mapping[str, RealArray]
    misfit: float
    std: Deviations | None = None


def cut_order(pipeline: Pipeline, order: int, *, deviations: bool = True) -> Cut:
    """Cut one order out of a pipeline and judge it.

    Parameters
    ----------
    pipeline : Pipeline
    order : int
    deviations : bool
        Whether standard deviations are wanted.
    """
    return _cut(pipeline, order, _Measured(pipeline, deviations))


def _cut(pipeline: Pipeline, order: int, measured: _Measured) -> Cut:
    model = pipeline.triple(order)
    modal = measured.with_basis(eigenmodes(pipeline.matrix, model))
    kept, _ = split_extraneous(modal, model)
    f, _ = frequencies_and_damping(modal.poles)
    low, high = pipeline.reported_band
    reported = kept[(f[kept] >= low) & (f[kept] <= high)]
    indicators = indicators_of(pipeline.matrix, model, modal)
    modes = modal_model(pipeline.matrix, modal, indicators)
    std = measured.deviations(order, model, modal, reported)
    if std is not None:
        modes = replace(modes, frequencies_std=std.frequency, damping_ratios_std=std.damping_ratio)
    return Cut(
        order=order,
        triple=model,
        modal=replace(modal, fit=replace(modal.fit, basis=None)),  # every order's columns together would be large
        modes=modes,
        reported=reported,
        indicators=indicators,
        misfit=measured.misfit(modal),
        std=std,
    )


class _Measured:
    """The data that every order is fitted to and the noise in them: what all orders share, computed once."""

    def __init__(self, pipeline: Pipeline, deviations: bool) -> None:
        self._pipeline, self._matrix = pipeline, pipeline.matrix.fitted
        self._response = self._matrix.judged
        self._misfit = Misfit(pipeline.response, output_scale(pipeline.response))
        self._complex = bool(np.iscomplexobj(self._response.values))
        self._weighted = getattr(self._matrix, "weights", None) is not None
        self.noise = noise_of(self._response, pipeline.problem.records) if deviations else None

    def with_basis(self, modes: Eigenmodes) -> Eigenmodes:
        """Return modes with what their poles can contribute, made once, where the misfit is not known by the fit."""
        if modes.fit.misfit is not None or modes.fit.basis is not None or self._weighted:
            return modes
        if self._response is not self._pipeline.response:
            return modes
        return replace(modes, fit=replace(modes.fit, basis=self._response.basis(modes.poles, modes.fit.powers)))

    def misfit(self, modes: Eigenmodes) -> float:
        """Return the norm of what modes leave of the level data over that of the data: from the fit where it knows, else rebuilt."""
        return self._misfit.of_fit(modes.poles, modes.fit) if modes.fit.misfit is None else modes.fit.misfit

    def deviations(self, order: int, model: Triple, modal: Eigenmodes, index: IntArray) -> Deviations | None:
        """Return the standard deviations of some poles; None where they were not asked."""
        noise, pipeline = self.noise_beside(modal), self._pipeline
        if noise is None:
            return None
        return deviations_of(self._matrix, pipeline.realization, order, model, modal, index, noise)

    def noise_beside(self, modal: Eigenmodes) -> Noise | None:
        """Return the noise, given what no residues at the poles of a model explain, whatever its own shapes leave."""
        if self.noise is None or not self.noise.of_residual:
            return self.noise
        fit, rows = modal.fit, self._response.count * (1 + self._complex)  # of compressed ones there are fewer
        if fit.unexplained is not None and np.all(np.isfinite(fit.unexplained)):
            unknown = len(fit.terms) + 2 * modal.poles.size
            return self.noise.beside(residual_variance(fit.unexplained, rows - unknown, self._complex))
        own = None if self._weighted else fit.basis
        basis = own or self._response.basis(modal.poles, fit.powers)
        unknown = basis.terms.shape[1] + basis.functions.shape[1]
        return self.noise.beside(residual_variance(unexplained_energy(basis), rows - unknown, self._complex))


class Sweep:
    """The orders of one pipeline, one after the other: consumed as they come, left between two and taken up again.

    An order that cannot be given (too few blocks, say) is left out, with a note in `notes`.

    Parameters
    ----------
    pipeline : Pipeline
    orders : iterable of int
        Increasing.
    deviations : bool
        Whether standard deviations of the poles are wanted.
    """

    def __init__(self, pipeline: Pipeline, orders: Iterable[int], *, deviations: bool = True) -> None:
        self.orders = tuple(orders)
        self.pipeline = pipeline = pipeline.in_turn() if _every(self.orders) else pipeline
        self.notes: list[Note] = []
        self._left = list(self.orders)
        self._measured = _Measured(pipeline, deviations)

    @property
    def noise(self) -> Noise | None:
        """What is known of the noise; None where no deviations were asked."""
        return self._measured.noise

    def noise_beside(self, cut: Cut) -> Noise | None:
        """Return the noise, given what a model leaves of the data; None where no deviations were asked."""
        return self._measured.noise_beside(cut.modal)

    def cut(self, order: int) -> Cut:
        """Return one order; the sweep stays where it is.

        Parameters
        ----------
        order : int
        """
        return _cut(self.pipeline, order, self._measured)

    def told(self, cuts: Iterable[Cut]) -> tuple[Note, ...]:
        """Return where the deviations of cuts come from, or why there are none; nothing where none were asked.

        Parameters
        ----------
        cuts : iterable of Cut
        """
        if self.noise is None:
            return ()
        known = any(np.any(np.isfinite(cut.std.frequency)) for cut in cuts if cut.std is not None)
        nothing = Unknown(
            "it is not known how the data move the poles of this method, or nothing is left to see noise in"
        )
        return (self.noise.note if known or isinstance(self.noise, Unknown) else nothing.note,)

    @property
    def remaining(self) -> tuple[int, ...]:
        """The orders that are still to come."""
        return tuple(self._left)

    def __iter__(self) -> Sweep:
        return self

    @one_thread
    def __next__(self) -> Cut:
        while self._left:
            order = self._left.pop(0)
            try:
                return self.cut(order)
            except DataError as error:
                self.notes.append(Note("orders left out", {"order": order}, f"order {order} left out: {error.found}"))
        raise StopIteration


def _every(orders: Sequence[int]) -> bool:
    """Whether orders follow each other by one: with steps of two an eigenproblem from the start costs no more."""
    return len(orders) > 1 and all(after == before + 1 for before, after in pairwise(orders))


@named(AllOptions.__annotations__)
@one_thread
def sweep(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: Iterable[int] | None = None,
    deviations: bool = True,
    **options: Any,
) -> Sweep:
    """Identify at many orders from one factorization, one order at a time.

    The data are factored before this returns; each order is computed when it is asked for. Leave the loop whenever you like, and go on
    with the same object later.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse, Signals, Records or a list of records
    method, domain : str, optional
        A cell of the table of methods, see `identify`.
    orders : iterable of int, optional
        As in `stabilize`.
    deviations : bool
        Whether standard deviations of the poles are wanted.
    **options
        Band, channels, block sizes and the rest, as in `identify`.

    Returns
    -------
    Sweep
        An iterator of cuts, each with `order`, `modes`, `indicators` and `misfit`.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> found = sweep(chain5().state_space(dt=0.05).impulse_response(200), orders=range(2, 11, 2))
    >>> for cut in found:
    ...     if cut.misfit < 1e-6:
    ...         break
    >>> cut.order, len(cut.modes)
    (10, 5)
    """
    problem = prepare(data, method, domain, **options)
    asked = problem.method.orders.ladder(problem.measured) if orders is None else checked_orders(orders)
    return start(problem, asked, automatic=orders is None, deviations=deviations)


def start(problem: Any, asked: list[int], *, automatic: bool, deviations: bool = True) -> Sweep:
    """Factor for the largest order and return the sweep over those within reach.

    Parameters
    ----------
    problem : Problem
    asked : list of int
    automatic : bool
        Whether nobody asked for just these: then some order is always found.
    deviations : bool
        Whether standard deviations of the poles are wanted.
    """
    pipeline = factor(problem, asked[-1])
    reach = pipeline.method.orders.reach(pipeline.factors, asked, automatic)
    made = Sweep(pipeline, reach.orders, deviations=deviations)
    made.notes.extend(reach.notes)
    return made
