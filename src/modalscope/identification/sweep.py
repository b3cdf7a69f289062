"""Identify at many orders from one factorization: model, modes, indicators and standard deviations of each order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Misfit, output_scale
from modalscope.identification.matrices.matrix import Triple
from modalscope.identification.method import Problem, checked_orders
from modalscope.identification.modal.eigenmodes import (
    Eigenmodes,
    eigenmodes,
    indicators_of_all,
    modal_model,
    split_extraneous,
)
from modalscope.identification.options import AllOptions
from modalscope.identification.pipeline import Pipeline, factor
from modalscope.identification.prepare import prepare
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.handed import replaceable
from modalscope.numerics.resources import one_thread


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """One order: its model, modes, indicators and standard deviations.

    `triple`: (A, B, C). `modal`: all poles, as they are in the data. `wrapped`: () -> the same without the damping of an exponential
    window. `reported`, `outside`: indices of the poles that the rank explains, those that lie in the band and the others. `misfit`:
    norm(measured - rebuilt) / norm(measured), each output divided by its root mean square. `due`: what computes their standard
    deviations, and of what, where asked; see `modalscope.identification.deviating`.
    """

    order: int
    triple: Triple
    modal: Eigenmodes
    wrapped: Callable[[], ModalModel]
    reported: IntArray
    outside: IntArray
    indicators: Mapping[str, RealArray]
    misfit: float
    due: tuple[Any, Any] | None = None

    @cached_property
    def std(self) -> Any:
        """Standard deviations of the reported poles, NaN at others, computed on first use; None where not asked."""
        return None if self.due is None else self.due[0].deviations(self.due[1])[0]

    @cached_property
    def modes(self) -> ModalModel:
        """All poles without the damping that an exponential window added; computed on first use."""
        modes = self.wrapped()
        if self.std is None:
            return modes
        return replace(modes, frequencies_std=self.std.frequency, damping_ratios_std=self.std.damping_ratio)


class Model(NamedTuple):
    """One order of a pipeline before it is judged: its model and modes."""

    order: int
    triple: Triple
    modal: Eigenmodes


def model_of(pipeline: Pipeline, order: int) -> Model | DataError:
    """Return the model and modes of one order, or its error."""
    try:
        triple = pipeline.triple(order)
        modal = eigenmodes(pipeline.matrix, triple)
        if not all(np.all(np.isfinite(values)) for values in (modal.poles, modal.shapes, modal.participation)):
            modal_model(pipeline.matrix, modal, {})  # raises its error
    except DataError as error:
        return error
    return Model(order, triple, modal)


@replaceable("first_models")
def first_models(pipeline: Pipeline, orders: Sequence[int]) -> list[Model | DataError]:
    """Return the first of increasing orders; as many as are faster together, see `modalscope.identification.fast.together`."""
    return [model_of(pipeline, orders[0])]


@replaceable("deviating")
def deviating(pipeline: Pipeline) -> Any:
    """Return who tells the standard deviations of poles, see `modalscope.identification.deviating`; None where nobody does."""
    return None


class Sweep:
    """An iterator over the orders of one pipeline, increasing, that can be interrupted and continued.

    An order that cannot be computed (too few blocks, say) is left out, with a note in `notes`. `deviating`: who tells the standard
    deviations of the poles; None where nobody was asked.
    """

    def __init__(
        self, pipeline: Pipeline, orders: Iterable[int], *, deviations: bool = True, indicators: bool = True
    ) -> None:
        self.orders = tuple(orders)
        self.pipeline = pipeline
        self.notes: list[Note] = []
        self.deviating = deviating(pipeline) if deviations else None
        self._indicated = indicators
        self._pending = deque(self.orders)
        self._ahead: deque[Cut | DataError] = deque()

    def cut(self, order: int) -> Cut:
        """Return one order, or raise its `DataError`; the sweep stays where it is."""
        (found,) = self.judged([model_of(self.pipeline, order)])
        if isinstance(found, DataError):
            raise found
        return found

    def judged(self, models: Sequence[Model | DataError]) -> list[Cut | DataError]:
        """Return orders that were computed together with their indicators, each in its place."""
        made = [model for model in models if isinstance(model, Model)]
        indicators: list[dict[str, RealArray]] = [{} for _ in made]
        if self._indicated and made:
            indicators = indicators_of_all(self.pipeline.matrix, [(model.triple, model.modal) for model in made])
        cuts = iter([self._cut(model, own) for model, own in zip(made, indicators, strict=True)])
        return [model if isinstance(model, DataError) else next(cuts) for model in models]

    def _cut(self, model: Model, indicators: Mapping[str, RealArray]) -> Cut:
        kept, _ = split_extraneous(model.modal, model.triple)
        f, _ = frequencies_and_damping(model.modal.poles)
        low, high = self.pipeline.response.reported_band(self.pipeline.problem.options.band)
        reported = np.asarray(kept[(f[kept] >= low) & (f[kept] <= high)])
        bare = replace(model.modal, fit=model.modal.fit.bare())  # the columns of all orders would need much memory
        asked = None if self.deviating is None else self.deviating.ask(model.order, model.triple, model.modal, reported)
        return Cut(
            order=model.order,
            triple=model.triple,
            modal=bare,
            wrapped=partial(modal_model, self.pipeline.matrix, bare, indicators),
            reported=reported,
            outside=np.setdiff1d(kept, reported),
            indicators=indicators,
            misfit=self.misfit(model.modal),
            due=None if asked is None else (self.deviating, asked),
        )

    @cached_property
    def _missed(self) -> Misfit:
        response = self.pipeline.matrix.fitted.judged
        return Misfit(response, output_scale(response))

    def misfit(self, modes: Eigenmodes) -> float:
        """Return norm(residual) / norm(data), outputs divided by their root mean square: from the fit where known, else rebuilt."""
        fit = modes.fit.fitted or modes.fit
        if modes.fit.misfit is not None:
            return modes.fit.misfit
        basis = fit.basis or self._missed.response.basis(modes.poles, fit.powers)
        return self._missed.of_modes(basis, fit.shapes, fit.participation, fit.terms)

    def notes_on(self, cuts: Iterable[Cut]) -> tuple[Note, ...]:
        """Return a note on how the standard deviations were estimated, or why there are none."""
        known = self.deviating
        return () if known is None else (known.note_on(cut.due[1] for cut in cuts if cut.due is not None),)

    @cached_property
    def largest(self) -> Triple:
        """The model of the largest order, as it was realized."""
        return self.pipeline.realization.triple(self.orders[-1])

    @property
    def remaining(self) -> tuple[int, ...]:
        """The remaining orders."""
        return tuple(self._pending)

    def __iter__(self) -> Sweep:
        return self

    @one_thread
    def __next__(self) -> Cut:
        while self._pending:
            if not self._ahead:
                self._ahead.extend(self.judged(first_models(self.pipeline, tuple(self._pending))))
            order, found = self._pending.popleft(), self._ahead.popleft()
            if not isinstance(found, DataError):
                return found
            self.notes.append(Note("orders left out", {"order": order}, f"order {order} left out: {found.found}"))
        raise StopIteration


@named(AllOptions.__annotations__)
@one_thread
def sweep(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: int | Iterable[int] | None = None,
    deviations: bool = True,
    **options: Any,
) -> Sweep:
    """Identify at many orders from one factorization, one order at a time.

    The data are factored before this returns; each order is computed when the iteration reaches it. The iteration can be interrupted and
    continued.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse, Signals, Records, a list of records, or Pipeline
        A pipeline was made by `factor`, and takes neither method nor options.
    method, domain : str, optional
        A cell of the table of methods, see `identify`.
    orders : int or iterable of int, optional
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
    options = {"method": method, "domain": domain, **options}
    if isinstance(data, Pipeline):
        return over_pipeline(data, orders, options, deviations=deviations)
    problem = prepare(data, **options)
    asked = resolved_orders(problem, orders)
    return over(factor(problem, asked[-1]), asked, automatic=orders is None, deviations=deviations)


def resolved_orders(problem: Problem, orders: int | Iterable[int] | None) -> list[int]:
    """Return the orders that were asked, increasing; those of the problem's method by default."""
    return problem.method.orders.ladder(problem.measured) if orders is None else checked_orders(orders)


def over_pipeline(
    pipeline: Pipeline, orders: int | Iterable[int] | None, options: Mapping[str, Any], *, deviations: bool
) -> Sweep:
    """Return the sweep over a pipeline; raise `DataError` where options were given, which are fixed by its problem."""
    for name, value in options.items():
        if value is not None:
            raise DataError(f"{name}=:", "the problem is factored already", f"Give {name}= to prepare().")
    return over(pipeline, resolved_orders(pipeline.problem, orders), automatic=orders is None, deviations=deviations)


def over(
    pipeline: Pipeline, asked: list[int], *, automatic: bool, deviations: bool = True, indicators: bool = True
) -> Sweep:
    """Return the sweep over the orders of a pipeline that its rank allows.

    `automatic`: whether the orders are defaults: then at least one is found. `indicators`: whether those of each pole are wanted.
    """
    reach = pipeline.method.orders.reach(pipeline.factors, asked, automatic)
    made = Sweep(pipeline, reach.orders, deviations=deviations, indicators=indicators)
    made.notes.extend(reach.notes)
    return made
