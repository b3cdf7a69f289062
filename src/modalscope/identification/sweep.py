"""One order after the other from one factorization: cut, judged and handed out as it comes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.blocks.threads import one_thread
from modalscope.blocks.triple import Triple
from modalscope.identification.cut import Cut, Shared, judged
from modalscope.identification.options import AllOptions
from modalscope.identification.orders import checked_orders
from modalscope.identification.pipeline import Factored, Pipeline, factor, realized
from modalscope.identification.prepare import prepare
from modalscope.model.checks import DataError
from modalscope.model.keywords import named
from modalscope.model.notes import Note
from modalscope.uncertainty.noise import Noise, Unknown

__all__ = ["Sweep", "start", "sweep"]


class Sweep:
    """The orders of one pipeline, one after the other: consumed as they come, left between two and taken up again.

    An order that cannot be given (too few blocks, say) is left out, with a note in `notes`. Orders that are better judged together are
    (see `judged`), and handed out one by one.

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
        """Whether another sweep over the same factors has the same poles at every order.

        Parameters
        ----------
        other : Sweep
        """
        return self.orders == other.orders and self._model.has_poles_of(other._model)

    def has_modes_of(self, other: Sweep) -> bool:
        """Whether another sweep over the same factors has the same modes at every order, and says the same of them.

        Parameters
        ----------
        other : Sweep
        """
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
        """Take the deviations that a sweep with the same poles has found.

        Parameters
        ----------
        other : Sweep, optional
        """
        if other is not None:
            self._measured.take_deviations_of(other._measured)

    def cut(self, order: int) -> Cut:
        """Return one order; the sweep stays where it is.

        Parameters
        ----------
        order : int
        """
        return self._measured.of_order(order)

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
            if not self._ahead:
                self._ahead.extend(judged(self.pipeline, tuple(self._left), self._measured))
            order, found = self._left.popleft(), self._ahead.popleft()
            if not isinstance(found, DataError):
                return found
            self.notes.append(Note("orders left out", {"order": order}, f"order {order} left out: {found.found}"))
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


def start(
    problem: Any, asked: list[int], *, automatic: bool, deviations: bool = True, given: Factored | None = None
) -> Sweep:
    """Factor for the largest order and return the sweep over those within reach.

    Parameters
    ----------
    problem : Problem
    asked : list of int
    automatic : bool
        Whether nobody asked for just these: then some order is always found.
    deviations : bool
        Whether standard deviations of the poles are wanted.
    given : Factored, optional
        Factors for the largest order, where another row has them.
    """
    pipeline = factor(problem, asked[-1]) if given is None else realized(problem, given)
    reach = pipeline.method.orders.reach(pipeline.factors, asked, automatic)
    made = Sweep(pipeline, reach.orders, deviations=deviations)
    made.notes.extend(reach.notes)
    return made
