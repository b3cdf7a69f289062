"""Choose model orders: which to try, by what an order counts (states, blocks, degrees), and which are sufficient."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.fast.normal_equations import largest_degree
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix
from modalscope.identification.realizations.order import recommend_order
from modalscope.numerics.checks import check_count, check_each
from modalscope.numerics.errors import DataError

#: Largest number of states tried by default, by the origin of the response; impulse responses 60.
_MAX_STATES = {"lines": 80, "records": 80, "correlation": 40}

#: Maximum number of states of a companion form in a comparison: eigenvalues cost its cube. The second value holds where every input has
#: functions of its own.
_MAX_COMPANION_STATES, _MAX_DRIVEN_STATES = 200, 80

#: Above this number of orders every second one is computed for companion forms.
_MAX_COMPANION_ORDERS = 30

#: A diagram of more orders is a mistake: none has so many rows.
MAX_ORDERS = 10_000


def checked_orders(orders: Iterable[int]) -> list[int]:
    """Return the distinct orders, increasing; an empty list is an error."""
    increasing = sorted({check_count("order", n) for n in check_each("orders", orders, "whole numbers", MAX_ORDERS)})
    if not increasing:
        raise DataError(
            "orders were asked", "the range of orders is empty", "Give range(2, 61, 2) or 2:60:2, for instance."
        )
    return increasing


Factored = Callable[[int], tuple[DataMatrix, Factors]]


@dataclass(frozen=True)
class Choice:
    """An order chosen from the data, with the reason as notes."""

    order: int
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class Reach:
    """The orders up to the rank of the factors, and notes on those left out."""

    orders: list[int]
    notes: tuple[Note, ...] = ()


class OrderRule(ABC):
    """What an order counts, and the choices that depend on it."""

    #: Whether a model has as many states as the truncation keeps.
    truncates = False

    @abstractmethod
    def ladder(self, measured: Response) -> list[int]:
        """Return the default orders."""

    @abstractmethod
    def choose(self, largest: int, factored: Factored) -> Choice:
        """Return one order by default, from the factors of the largest order considered."""

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        """Return which of the orders can be computed."""
        return Reach(asked)

    def states_each(self, response: Response) -> int:
        """Return the number of states of one order."""
        return 1

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        """Return orders and block sizes for a comparison at about `asked` states."""
        return tuple(asked), {}


class _States(OrderRule):
    """The order is the number of states kept: the rank of the truncation."""

    truncates = True

    def ladder(self, measured: Response) -> list[int]:
        top = _MAX_STATES.get(measured.origin, 60)
        return list(range(2, min(top, measured.max_states or top) + 1, 2))

    def choose(self, largest: int, factored: Factored) -> Choice:
        """Return the number of significant singular values."""
        return self._advised(factored(largest)[1])

    def _advised(self, factors: Factors, blocks_of: int = 1, times: int = 1) -> Choice:
        advice = recommend_order(factors)
        order = -(-times * advice.order // blocks_of) * blocks_of
        text = f"order {order} was chosen ({advice.confidence}): {advice.reason}"
        return Choice(order, (Note("order chosen", {"order": order}, text),))

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        """Drop orders above the rank; an exact rank is added as an order."""
        rank = factors.rank
        beyond = [n for n in asked if n > rank]
        notes: tuple[Note, ...] = ()
        if beyond:
            text = f"orders {beyond[0]} to {beyond[-1]} left out: the data matrix has rank {rank}"
            notes = (Note("orders left out", {"lowest": beyond[0], "highest": beyond[-1], "rank": rank}, text),)
        within = [n for n in asked if n <= rank]
        if not within and not automatic:
            raise DataError(
                f"orders {asked[0]} to {asked[-1]} were asked",
                f"the data matrix has rank {rank}",
                f"Lower the orders to at most {rank}.",
            )
        exact = rank < min(factors.left.shape[1], asked[-1])
        if (exact or not within) and rank not in within:
            within.append(rank)
        return Reach(within, notes)


class _Companions(_States):
    """The order is the rank, and the model has all block rows for states."""

    truncates = False

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        """Limit companion matrices of lines, whose eigenvalues cost the cube of their size."""
        if response.max_states is None:
            return tuple(asked), {}
        outputs = response.values.shape[1]
        most = _MAX_COMPANION_STATES if response.separable else _MAX_DRIVEN_STATES
        degree = max(min(48, most // outputs), -(-asked[-1] // outputs) + 2)
        few = asked if len(asked) <= _MAX_COMPANION_ORDERS else [n for n in asked if (asked[-1] - n) % 4 == 0]
        return tuple(few or asked), {"block_rows": degree}


class _Blocks(_States):
    """The order is a number of states in whole blocks, without truncation."""

    truncates = False

    def choose(self, largest: int, factored: Factored) -> Choice:
        """Return twice the number of significant singular values, in whole blocks: half of the states fit noise."""
        matrix, factors = factored(largest)
        return self._advised(factors, blocks_of=factors.left.shape[0] // (matrix.block_rows + 1), times=2)

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        return Reach(asked)

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        inputs = response.values.shape[2]
        return tuple(sorted({inputs * max(-(-n // inputs), 1) for n in asked})), {}


class _Degrees(OrderRule):
    """The order is the degree of matrix polynomials, of as many states as there are inputs."""

    #: Default degree: enough for the modes of a usual band; superfluous poles are unstable.
    usual = 30

    def ladder(self, measured: Response) -> list[int]:
        """Degrees up to 60, up to 240 poles, and up to what the lines of a band determine."""
        top = max(min(60, 240 // max(measured.values.shape[2], 1), largest_degree(measured)), 4)
        return list(range(2, top + 1, 2 if top > 40 else 1))

    def choose(self, largest: int, factored: Factored) -> Choice:
        return Choice(self.usual)

    def states_each(self, response: Response) -> int:
        return int(response.values.shape[2])

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        return tuple(sorted({max(n // 2, 2) for n in asked})), {}


STATES, COMPANIONS, BLOCKS, DEGREES = _States(), _Companions(), _Blocks(), _Degrees()


#: An order is sufficient when its fit error is within this factor of the smallest one.
SLACK = 1.2

#: The fit error still falls when the last quarter of the orders lowers it by this fraction and it remains above this value: fits to
#: noise lower it by less, or below.
_MIN_FALL, _MIN_FIT_ERROR = 0.1, 0.15

#: Usable orders above the sufficient one: as many again, and at least this many.
_MIN_FURTHER_ORDERS = 20


def sufficient_order(diagram: StabilizationDiagram) -> int:
    """Return the first order whose fit error is within a fifth of the best."""
    errors = diagram.fit_errors
    return diagram.orders[int(np.argmax(errors <= SLACK * errors.min()))]


def usable_orders(diagram: StabilizationDiagram) -> tuple[tuple[int, ...], float]:
    """Return the orders up to twice (at least 20 above) the sufficient one, and the best fit error among them.

    Higher orders fit noise only.
    """
    enough = sufficient_order(diagram)
    orders = tuple(n for n in diagram.orders if n <= max(2 * enough, enough + _MIN_FURTHER_ORDERS))
    return orders, float(diagram.fit_errors[: len(orders)].min())


def still_falls(diagram: StabilizationDiagram) -> bool:
    """Return whether the fit error still falls at the last orders, so that modes may be missing."""
    errors, late = diagram.fit_errors, np.array(diagram.orders) > 0.75 * diagram.orders[-1]
    if late.all():
        return False
    last = errors[late].min()
    return bool(last > _MIN_FIT_ERROR and last < (1 - _MIN_FALL) * errors[~late].min())


#: Kind of the notes that modes may be missing because the orders end too soon.
ORDERS_END = "orders end"

#: Default orders are doubled at most this many times, and are every second one up to this order.
_MAX_DOUBLINGS, _MAX_FINE_ORDER = 2, 100


def grown(found: StabilizationDiagram, again: Callable[[Iterable[int]], StabilizationDiagram]) -> StabilizationDiagram:
    """Double the orders of a diagram while the fit error still falls, and note where they end first.

    `found`: at the default orders. `again`: computes the diagram of other orders.
    """
    if found.response.ambient or not found.response.separable:
        return found
    for _ in range(_MAX_DOUBLINGS):
        if not still_falls(found):
            return found
        top = 2 * found.orders[-1]
        room = found.response.max_states
        if room is not None and top > room:
            break
        step = 2 if top <= _MAX_FINE_ORDER else 4
        found = again(range(step, top + 1, step))
        text = f"orders extended to {top}: the fit error still fell at {top // 2}"
        found = found.changed(notes=(*found.notes, Note("orders grew", {"largest": top}, text)))
    if still_falls(found):
        last = found.orders[-1]
        text = f"The fit error still falls at order {last}: modes may be missing. Give more orders, or narrower bands"
        found = found.changed(notes=(*found.notes, Note(ORDERS_END, {"largest": last}, text)))
    return found
