"""One order after the other from one factorization: cut, judged and handed out as it comes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from modalscope.blocks.triple import Misfit, Triple
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.poles import frequencies_and_damping
from modalscope.data.response import output_scale
from modalscope.identification.options import AllOptions
from modalscope.identification.orders import checked_orders
from modalscope.identification.pipeline import Factored, Pipeline, factor, realized
from modalscope.identification.prepare import prepare
from modalscope.likelihood.deviations import Asked, Deviations, deviations_of, residual_variance, unexplained_energy
from modalscope.likelihood.noise import Noise, Unknown, noise_of
from modalscope.modal.accuracy import indicators_of_all
from modalscope.modal.eigenmodes import Eigenmodes, eigenmodes, split_extraneous
from modalscope.modal.rebuilt import modal_model
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread

__all__ = ["Cut", "Shared", "Sweep", "cut_order", "judged", "start", "sweep"]


# ----------------------------------------------------------------------------------------------------------------- cut
# One order of a sweep: its model, its modes, and how far to trust them.

#: Orders are judged together while their states times lines or samples are no more than this: arrays in between stay in the cache.
_TOGETHER = 100_000

#: Poles are the same to this part of them: deviations are told to three digits.
_SAME = 1e-8


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """One order: its model, its modes and how far to trust them.

    `triple`: (A, B, C), with inputs and outputs in their own places. `modal`: all its poles, as they are in the data. `wrapped`: () ->
    the same, with what an exponential window added taken off. `reported`: the poles that a rank explains and that lie in the band.
    `misfit`: norm(measured - rebuilt) / norm(measured) over the data, each output divided by its root mean square. `std`: standard
    deviations of the reported poles, where they were asked.
    """

    order: int
    triple: Triple
    modal: Eigenmodes
    wrapped: Callable[[], ModalModel]
    reported: IntArray
    indicators: Mapping[str, RealArray]
    misfit: float
    std: Deviations | None = None

    @cached_property
    def modes(self) -> ModalModel:
        """All its poles with what an exponential window added taken off, made when they are first asked for."""
        modes = self.wrapped()
        if self.std is None:
            return modes
        return replace(modes, frequencies_std=self.std.frequency, damping_ratios_std=self.std.damping_ratio)


def cut_order(pipeline: Pipeline, order: int, *, deviations: bool = True) -> Cut:
    """Cut one order out of a pipeline and judge it.

    `deviations`: whether standard deviations are wanted.
    """
    return Shared(pipeline, deviations).of_order(order)


def judged(pipeline: Pipeline, orders: Sequence[int], measured: Shared) -> list[Cut | DataError]:
    """Return the first of some orders, or why there is none: as many of them as are better judged together, at least one.

    `orders`: increasing, at least one.
    """
    found: list[tuple[int, Triple, Eigenmodes] | DataError] = []
    size = 0
    for order in orders:
        try:
            model = pipeline.triple(order)
            found.append((order, model, _checked(pipeline, eigenmodes(pipeline.matrix, model))))
        except DataError as error:
            found.append(error)
            continue
        size += len(model.A) * pipeline.response.count
        if size > _TOGETHER or not (pipeline.matrix.fitted.by_mode and model.span is None):
            break
    good = [part for part in found if not isinstance(part, DataError)]
    modes = measured.with_bases([modal for _, _, modal in good])
    cuts = iter(measured.cuts([(order, model, modal) for (order, model, _), modal in zip(good, modes, strict=True)]))
    return [part if isinstance(part, DataError) else next(cuts) for part in found]


def _checked(pipeline: Pipeline, modal: Eigenmodes) -> Eigenmodes:
    """Return modes that are numbers; what is wrong with others the making of their model says."""
    if not all(np.all(np.isfinite(values)) for values in (modal.poles, modal.shapes, modal.participation)):
        modal_model(pipeline.matrix, modal, {})
    return modal


class _Told(NamedTuple):
    """What is known of the poles of an order, some of which were asked."""

    poles: ComplexArray
    asked: IntArray
    deviations: Deviations

    def of(self, poles: ComplexArray, asked: IntArray) -> bool:
        """Whether these are the same poles, in the same order, and the same ones are asked."""
        if self.poles.shape != poles.shape or not np.array_equal(self.asked, asked):
            return False
        return bool(np.all(np.abs(self.poles - poles) <= _SAME * np.abs(poles)))


class Shared:
    """The data that every order is fitted to and the noise in them: what all orders share, computed once.

    `deviations`: whether standard deviations are wanted.
    """

    def __init__(self, pipeline: Pipeline, deviations: bool) -> None:
        self._pipeline, self._matrix = pipeline, pipeline.matrix.fitted
        self._response = self._matrix.judged
        self._misfit = Misfit(pipeline.response, output_scale(pipeline.response))
        self._complex = bool(np.iscomplexobj(self._response.values))
        self._weighted = getattr(self._matrix, "weights", None) is not None
        self.noise = noise_of(self._response, pipeline.problem.records) if deviations else None
        self._told: dict[int, _Told] = {}

    def cuts(self, parts: Sequence[tuple[int, Triple, Eigenmodes]]) -> list[Cut]:
        """Return orders with their indicators, and the standard deviations of their poles, where they are wanted.

        `parts`: of one order, or of several that are judged together.
        """
        if not parts:
            return []
        indicators = indicators_of_all(self._pipeline.matrix, [part[1:] for part in parts])
        reported = [self._reported(model, modal) for _, model, modal in parts]
        std = self._deviations(parts, reported)
        return [self._cut(*each) for each in zip(parts, reported, indicators, std, strict=True)]

    def _deviations(
        self, parts: Sequence[tuple[int, Triple, Eigenmodes]], reported: Sequence[IntArray]
    ) -> list[Deviations | None]:
        """Return the standard deviations of some poles of every order, those that are known as they are; None where none were wanted."""
        if self.noise is None:
            return [None] * len(parts)
        asked = []
        for part, which in zip(parts, reported, strict=True):
            order, _, modal = part
            known = self._told.get(order)
            if known is None or not known.of(modal.poles, which):
                noise = self.noise_beside(modal)
                assert noise is not None
                asked.append(Asked(*part, which, noise))
        for one, found in zip(asked, deviations_of(self._matrix, self._pipeline.realization, *asked), strict=True):
            self._told[one.order] = _Told(one.modal.poles, one.which, found)
        return [self._told[order].deviations for order, _, _ in parts]

    def take_deviations_of(self, other: Shared) -> None:
        """Take the deviations that are known of the same poles: they follow from the poles and the data alone."""
        self._told.update(other._told)

    def _reported(self, model: Triple, modal: Eigenmodes) -> IntArray:
        """Return the poles that a rank explains and that lie in the band."""
        kept, _ = split_extraneous(modal, model)
        f, _ = frequencies_and_damping(modal.poles)
        low, high = self._pipeline.reported_band
        return np.asarray(kept[(f[kept] >= low) & (f[kept] <= high)])

    def _cut(
        self,
        part: tuple[int, Triple, Eigenmodes],
        reported: IntArray,
        indicators: Mapping[str, RealArray],
        std: Deviations | None,
    ) -> Cut:
        order, model, modal = part
        bare = replace(modal, fit=replace(modal.fit, basis=None))  # every order's columns together would be large
        return Cut(
            order=order,
            triple=model,
            modal=bare,
            wrapped=partial(modal_model, self._pipeline.matrix, bare, indicators),
            reported=reported,
            indicators=indicators,
            misfit=self.misfit(modal),
            std=std,
        )

    def of_order(self, order: int) -> Cut:
        """Return one order.

        Raises `DataError`: an order that cannot be given.
        """
        (found,) = judged(self._pipeline, [order], self)
        if isinstance(found, DataError):
            raise found
        return found

    def with_bases(self, several: Sequence[Eigenmodes]) -> list[Eigenmodes]:
        """Return modes with what their poles can contribute, made once for all, where the misfit is not known by the fit.

        `several`: of one order or of several.
        """
        if self._weighted or self._response is not self._pipeline.response:
            return list(several)
        if not several or any(modes.fit.misfit is not None or modes.fit.basis is not None for modes in several):
            return list(several)
        basis = self._response.basis(np.concatenate([modes.poles for modes in several]), several[0].fit.powers)
        ends = 2 * np.cumsum([0, *(modes.poles.size for modes in several)])
        each = (replace(basis, functions=basis.functions[:, a:b]) for a, b in pairwise(ends))
        own = each if len(several) > 1 else [basis]  # inputs and ends may stand beside the poles
        return [replace(m, fit=replace(m.fit, basis=part)) for m, part in zip(several, own, strict=True)]

    def misfit(self, modes: Eigenmodes) -> float:
        """Return the norm of what modes leave of the level data over that of the data: from the fit where it knows, else rebuilt."""
        return self._misfit.of_fit(modes.poles, modes.fit) if modes.fit.misfit is None else modes.fit.misfit

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


# --------------------------------------------------------------------------------------------------------------- sweep


class Sweep:
    """The orders of one pipeline, one after the other: consumed as they come, left between two and taken up again.

    An order that cannot be given (too few blocks, say) is left out, with a note in `notes`. Orders that are better judged together are
    (see `judged`), and handed out one by one.

    `orders`: increasing. `deviations`: whether standard deviations of the poles are wanted.
    """

    def __init__(self, pipeline: Pipeline, orders: Iterable[int], *, deviations: bool = True) -> None:
        self.orders = tuple(orders)
        self.pipeline = pipeline
        self.notes: list[Note] = []
        self._left = deque(self.orders)
        self._ahead: deque[Cut | DataError] = deque()
        self._measured = Shared(pipeline, deviations)

    @property
    def noise(self) -> Noise | None:
        """What is known of the noise; None where no deviations were asked."""
        return self._measured.noise

    def noise_beside(self, cut: Cut) -> Noise | None:
        """Return the noise, given what a model leaves of the data; None where no deviations were asked."""
        return self._measured.noise_beside(cut.modal)

    def has_poles_of(self, other: Sweep) -> bool:
        """Whether another sweep over the same factors has the same poles at every order."""
        return self.orders == other.orders and self._model.has_poles_of(other._model)

    def has_modes_of(self, other: Sweep) -> bool:
        """Whether another sweep over the same factors has the same modes at every order, and says the same of them."""
        if not self.has_poles_of(other):
            return False
        mine, its = self.pipeline, other.pipeline
        said = mine.notes == its.notes and mine.settings == its.settings
        return said and (mine.matrix.fits_states or self._model.has_ends_of(other._model))

    @cached_property
    def _model(self) -> Triple:
        """The model of the largest order, as it was realized."""
        return self.pipeline.realization.triple(self.orders[-1])

    def take_deviations_of(self, other: Sweep | None) -> None:
        """Take the deviations that a sweep with the same poles has found."""
        if other is not None:
            self._measured.take_deviations_of(other._measured)

    def cut(self, order: int) -> Cut:
        """Return one order; the sweep stays where it is."""
        return self._measured.of_order(order)

    def told(self, cuts: Iterable[Cut]) -> tuple[Note, ...]:
        """Return where the deviations of cuts come from, or why there are none; nothing where none were asked."""
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
            if not self._ahead:
                self._ahead.extend(judged(self.pipeline, tuple(self._left), self._measured))
            order, found = self._left.popleft(), self._ahead.popleft()
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


def start(
    problem: Any, asked: list[int], *, automatic: bool, deviations: bool = True, given: Factored | None = None
) -> Sweep:
    """Factor for the largest order and return the sweep over those within reach.

    `automatic`: whether nobody asked for just these: then some order is always found. `deviations`: whether standard deviations of the
    poles are wanted. `given`: factors for the largest order, where another row has them.
    """
    pipeline = factor(problem, asked[-1]) if given is None else realized(problem, given)
    reach = pipeline.method.orders.reach(pipeline.factors, asked, automatic)
    made = Sweep(pipeline, reach.orders, deviations=deviations)
    made.notes.extend(reach.notes)
    return made
