"""Identify at many orders from one factorization: model, modes, indicators and standard deviations of each order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.data.misfit import Misfit
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import output_scale
from modalscope.identification.deviating import Asked, Deviating, Deviations
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.matrix import Triple
from modalscope.identification.method import Problem, checked_orders
from modalscope.identification.modal.eigenmodes import Eigenmodes, eigenmodes, indicators_of_all, split_extraneous
from modalscope.identification.modal.rebuilt import modal_model
from modalscope.identification.options import AllOptions
from modalscope.identification.pipeline import Factored, Pipeline, factor, realized
from modalscope.identification.prepare import prepare
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.handed import handed
from modalscope.numerics.resources import one_thread

#: Maximum sum of states times lines or samples of orders that are computed together: their arrays fit into the cache.
_MAX_NUMBERS_TOGETHER = 100_000


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """One order: its model, modes, indicators and standard deviations.

    `triple`: (A, B, C). `modal`: all poles, as they are in the data. `wrapped`: () -> the same without the damping of an exponential
    window. `reported`: indices of the poles that the rank explains and that lie in the band. `misfit`: norm(measured - rebuilt) /
    norm(measured), each output divided by its root mean square. `due`: what computes their standard deviations,
    and of what, where asked.
    """

    order: int
    triple: Triple
    modal: Eigenmodes
    wrapped: Callable[[], ModalModel]
    reported: IntArray
    indicators: Mapping[str, RealArray]
    misfit: float
    due: tuple[Deviating, Asked] | None = None

    @cached_property
    def std(self) -> Deviations | None:
        """Standard deviations of the reported poles, NaN at others, computed on first use; None where not asked."""
        if self.due is None:
            return None
        known, asked = self.due
        return known.deviations(asked)[0]

    @cached_property
    def modes(self) -> ModalModel:
        """All poles without the damping that an exponential window added; computed on first use."""
        modes = self.wrapped()
        if self.std is None:
            return modes
        return replace(modes, frequencies_std=self.std.frequency, damping_ratios_std=self.std.damping_ratio)


def judged(pipeline: Pipeline, orders: Sequence[int], measured: Shared) -> list[Cut | DataError]:
    """Return the first of increasing orders, or their errors: as many as are faster computed together, at least one."""
    results: list[tuple[int, Triple, Eigenmodes] | DataError] = []
    size = 0
    for order in orders:
        try:
            model = pipeline.triple(order)
            modes = eigenmodes(pipeline.matrix, model)
            if not all(np.all(np.isfinite(values)) for values in (modes.poles, modes.shapes, modes.participation)):
                modal_model(pipeline.matrix, modes, {})  # raises its error
            results.append((order, model, modes))
        except DataError as error:
            results.append(error)
            continue
        size += len(model.A) * pipeline.response.count
        if size > _MAX_NUMBERS_TOGETHER or not (full(pipeline.matrix.fitted).by_mode and model.span is None):
            break
    computed = [result for result in results if not isinstance(result, DataError)]
    bases = measured.with_bases([modal for _, _, modal in computed])
    cuts = iter(
        measured.cuts([(order, model, modal) for (order, model, _), modal in zip(computed, bases, strict=True)])
    )
    return [result if isinstance(result, DataError) else next(cuts) for result in results]


class Shared:
    """The data that every order is fitted to, and who tells the deviations of their poles: the same for all orders."""

    def __init__(self, pipeline: Pipeline, deviating: Deviating | None, indicators: bool = True) -> None:
        self._indicated, self.deviating = indicators, deviating
        self._pipeline, self._matrix = pipeline, pipeline.matrix.fitted
        self._response = self._matrix.judged
        whitening = pipeline.problem.whitening
        self._compared = pipeline.response if whitening is None else self._response
        self._misfit = Misfit(self._compared, output_scale(self._compared))
        self._weighted = getattr(self._matrix, "weights", None) is not None

    def cuts(self, parts: Sequence[tuple[int, Triple, Eigenmodes]]) -> list[Cut]:
        """Return orders, computed together, with their indicators."""
        if not parts:
            return []
        of_parts = [part[1:] for part in parts]
        indicators = indicators_of_all(self._pipeline.matrix, of_parts) if self._indicated else [{} for _ in parts]
        reported = [self._reported(model, modal) for _, model, modal in parts]
        if self.deviating is not None:
            for part, which in zip(parts, reported, strict=True):
                self.deviating.ask(*part, which)
        return [self._cut(*each) for each in zip(parts, reported, indicators, strict=True)]

    def _reported(self, model: Triple, modal: Eigenmodes) -> IntArray:
        """Return the indices of the poles in the band that are not extraneous."""
        kept, _ = split_extraneous(modal, model)
        f, _ = frequencies_and_damping(modal.poles)
        low, high = self._pipeline.reported_band
        return np.asarray(kept[(f[kept] >= low) & (f[kept] <= high)])

    def _cut(
        self, part: tuple[int, Triple, Eigenmodes], reported: IntArray, indicators: Mapping[str, RealArray]
    ) -> Cut:
        order, model, modal = part
        bare = _with_basis(modal, None)  # the columns of all orders would need much memory
        return Cut(
            order=order,
            triple=model,
            modal=bare,
            wrapped=partial(modal_model, self._pipeline.matrix, bare, indicators),
            reported=reported,
            indicators=indicators,
            misfit=self.misfit(modal),
            due=None if self.deviating is None else (self.deviating, self.deviating.asked[order]),
        )

    def of_order(self, order: int) -> Cut:
        """Return one order, or raise its `DataError`."""
        (result,) = judged(self._pipeline, [order], self)
        if isinstance(result, DataError):
            raise result
        return result

    def with_bases(self, several: Sequence[Eigenmodes]) -> list[Eigenmodes]:
        """Return the modes of several orders with the basis of their poles, computed at once, where the fit has no misfit."""
        if self._weighted or self._response is not self._compared:
            return list(several)
        fits = [modes.fit.fitted or modes.fit for modes in several]
        if not several or any(fit.misfit is not None or fit.basis is not None for fit in fits):
            return list(several)
        basis = self._response.basis(np.concatenate([modes.poles for modes in several]), fits[0].powers)
        ends = 2 * np.cumsum([0, *(modes.poles.size for modes in several)])
        several_bases = (replace(basis, functions=basis.functions[:, a:b]) for a, b in pairwise(ends))
        parts = several_bases if len(several) > 1 else [basis]  # one may have columns of inputs and ends, too
        return [_with_basis(modes, part) for modes, part in zip(several, parts, strict=True)]

    def misfit(self, modes: Eigenmodes) -> float:
        """Return norm(residual) / norm(data), outputs divided by their root mean square: from the fit where known, else rebuilt."""
        if modes.fit.misfit is not None:
            return modes.fit.misfit
        fit = modes.fit.fitted or modes.fit
        basis = fit.basis or self._compared.basis(modes.poles, fit.powers)
        return self._misfit.of_modes(basis, fit.shapes, fit.participation, fit.terms)


def _with_basis(modes: Eigenmodes, basis: ModalBasis | None) -> Eigenmodes:
    """Return modes whose fit has this basis, or the fit of the whitened channels where there is one."""
    if modes.fit.fitted is None:
        return replace(modes, fit=replace(modes.fit, basis=basis))
    return replace(modes, fit=replace(modes.fit, basis=None, fitted=replace(modes.fit.fitted, basis=basis)))


class Sweep:
    """An iterator over the orders of one pipeline, increasing, that can be interrupted and continued.

    An order that cannot be computed (too few blocks, say) is left out, with a note in `notes`.
    """

    def __init__(
        self, pipeline: Pipeline, orders: Iterable[int], *, deviations: bool = True, indicators: bool = True
    ) -> None:
        self.orders = tuple(orders)
        self.pipeline = pipeline
        self.notes: list[Note] = []
        self._pending = deque(self.orders)
        self._ahead: deque[Cut | DataError] = deque()
        self._measured = Shared(pipeline, handed("deviating")(pipeline) if deviations else None, indicators)

    @property
    def deviating(self) -> Deviating | None:
        """Who tells the standard deviations of the poles; None where nobody was asked."""
        return self._measured.deviating

    def cut(self, order: int) -> Cut:
        """Return one order; the sweep stays where it is."""
        return self._measured.of_order(order)

    def notes_on(self, cuts: Iterable[Cut]) -> tuple[Note, ...]:
        """Return a note on how the standard deviations were estimated, or why there are none."""
        known = self.deviating
        return () if known is None else (known.note_on(cut.due[1] for cut in cuts if cut.due is not None),)

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
                self._ahead.extend(judged(self.pipeline, tuple(self._pending), self._measured))
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
    orders: Iterable[int] | None = None,
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
    options = {"method": method, "domain": domain, **options}
    if isinstance(data, Pipeline):
        return over_pipeline(data, orders, options, deviations=deviations)
    problem = prepare(data, **options)
    return start(problem, resolved_orders(problem, orders), automatic=orders is None, deviations=deviations)


def resolved_orders(problem: Problem, orders: Iterable[int] | None) -> list[int]:
    """Return the orders that were asked, increasing; those of the problem's method by default."""
    return problem.method.orders.ladder(problem.measured) if orders is None else checked_orders(orders)


def over_pipeline(
    pipeline: Pipeline, orders: Iterable[int] | None, options: Mapping[str, Any], *, deviations: bool
) -> Sweep:
    """Return the sweep over a pipeline; raise `DataError` where options were given, which are fixed by its problem."""
    for name, value in options.items():
        if value is not None:
            raise DataError(f"{name}= was asked", "the problem is factored already", f"Give {name}= to prepare().")
    return over(pipeline, resolved_orders(pipeline.problem, orders), automatic=orders is None, deviations=deviations)


def start(
    problem: Problem,
    asked: list[int],
    *,
    automatic: bool,
    deviations: bool = True,
    indicators: bool = True,
    given: Factored | None = None,
) -> Sweep:
    """Factor for the largest order and return the sweep over the orders that the rank allows.

    `automatic`: whether the orders are defaults: then at least one is found. `indicators`: whether those of each pole are wanted. `given`:
    factors for the largest order, of another row.
    """
    pipeline = factor(problem, asked[-1]) if given is None else realized(problem, given)
    return over(pipeline, asked, automatic=automatic, deviations=deviations, indicators=indicators)


def over(
    pipeline: Pipeline, asked: list[int], *, automatic: bool, deviations: bool = True, indicators: bool = True
) -> Sweep:
    """Return the sweep over the orders of a pipeline that its rank allows; see `start`."""
    reach = pipeline.method.orders.reach(pipeline.factors, asked, automatic)
    made = Sweep(pipeline, reach.orders, deviations=deviations, indicators=indicators)
    made.notes.extend(reach.notes)
    return made
