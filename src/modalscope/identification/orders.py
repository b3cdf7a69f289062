"""Choose orders beyond those of the ladder: one by default, those of a comparison, and which of a diagram are sufficient."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any, ClassVar

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix
from modalscope.identification.method import Blocks, Companions, OrderRule, States
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.errors import DataError

#: Maximum number of states of a companion form in a comparison: eigenvalues cost its cube. The second value holds where every input has
#: functions of its own.
_MAX_COMPANION_STATES, _MAX_DRIVEN_STATES = 200, 80

#: Above this number of orders every second one is computed for companion forms.
_MAX_COMPANION_ORDERS = 30

Factored = Callable[[int], tuple[DataMatrix, Factors]]


@dataclass(frozen=True)
class Choice:
    """An order chosen from the data, with the reason as notes."""

    order: int
    notes: tuple[Note, ...] = ()


class UsualOrder(OrderRule):
    """A rule whose default order is the same for all data."""

    usual: ClassVar[int]


class Degrees(UsualOrder):
    """The order is the degree of matrix polynomials, of as many states as there are inputs."""

    #: Enough for the modes of a usual band; superfluous poles are unstable.
    usual = 30

    def ladder(self, measured: Response) -> list[int]:
        """Degrees up to 60, up to 240 poles, and up to what the lines of a band determine."""
        from modalscope.identification.fast.normal_equations import largest_degree  # other rows have no use for it

        top = max(min(60, 240 // max(measured.values.shape[2], 1), largest_degree(measured)), 4)
        return list(range(2, top + 1, 2 if top > 40 else 1))


DEGREES = Degrees()


@singledispatch
def choose(rule: OrderRule, largest: int, factored: Factored) -> Choice:
    """Return one order by default, from the factors of the largest order considered; a rule that states none is a `DataError`."""
    raise DataError("a default order:", "this method has none", "Give order=.")


@choose.register
def _(rule: UsualOrder, largest: int, factored: Factored) -> Choice:
    """The usual one."""
    return Choice(rule.usual)


@choose.register
def _(rule: States, largest: int, factored: Factored) -> Choice:
    """The number of significant singular values."""
    return _advised(factored(largest)[1])


@choose.register
def _(rule: Blocks, largest: int, factored: Factored) -> Choice:
    """Twice the number of significant singular values, in whole blocks: half of the states fit noise."""
    matrix, factors = factored(largest)
    return _advised(factors, blocks_of=factors.left.shape[0] // (matrix.block_rows + 1), times=2)


def _advised(factors: Factors, blocks_of: int = 1, times: int = 1) -> Choice:
    from modalscope.identification.realizations.order import recommend_order  # where no order is given

    advice = recommend_order(factors)
    order = -(-times * advice.order // blocks_of) * blocks_of
    text = f"order {order} was chosen ({advice.confidence}): {advice.reason}"
    return Choice(order, (Note("order chosen", {"order": order}, text),))


@singledispatch
def states_each(rule: OrderRule, response: Response) -> int:
    """Return the number of states of one order."""
    return 1


@states_each.register
def _(rule: Degrees, response: Response) -> int:
    return int(response.values.shape[2])


#: Orders and block sizes.
_Compared = tuple[tuple[int, ...], dict[str, Any]]


@singledispatch
def orders_compared(rule: OrderRule, asked: Sequence[int], response: Response) -> _Compared:
    """Return orders and block sizes for a comparison at about `asked` states."""
    return tuple(asked), {}


@orders_compared.register
def _(rule: Companions, asked: Sequence[int], response: Response) -> _Compared:
    """Limit companion matrices of lines, whose eigenvalues cost the cube of their size."""
    if response.max_states is None:
        return tuple(asked), {}
    outputs = response.values.shape[1]
    most = _MAX_COMPANION_STATES if response.separable else _MAX_DRIVEN_STATES
    degree = max(min(48, most // outputs), -(-asked[-1] // outputs) + 2)
    few = asked if len(asked) <= _MAX_COMPANION_ORDERS else [n for n in asked if (asked[-1] - n) % 4 == 0]
    return tuple(few or asked), {"block_rows": degree}


@orders_compared.register
def _(rule: Blocks, asked: Sequence[int], response: Response) -> _Compared:
    inputs = response.values.shape[2]
    return tuple(sorted({inputs * max(-(-n // inputs), 1) for n in asked})), {}


@orders_compared.register
def _(rule: Degrees, asked: Sequence[int], response: Response) -> _Compared:
    return tuple(sorted({max(n // 2, 2) for n in asked})), {}


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
    """Return the orders up to twice (at least 20 above) the sufficient one, as higher ones fit noise, and their best fit error."""
    enough = sufficient_order(diagram)
    orders = tuple(n for n in diagram.orders if n <= max(2 * enough, enough + _MIN_FURTHER_ORDERS))
    return orders, float(diagram.fit_errors[: len(orders)].min())


def last_poles(diagram: StabilizationDiagram) -> ComplexArray:
    """Return the poles of the last usable order, rad/s, with those outside the band: what the data of the band need."""
    return diagram.poles_at(usable_orders(diagram)[0][-1])


def still_falls(diagram: StabilizationDiagram) -> bool:
    """Return whether the fit error still falls at the last orders, so that modes may be missing."""
    errors, late = diagram.fit_errors, np.array(diagram.orders) > 0.75 * diagram.orders[-1]
    return bool(not late.all() and _MIN_FIT_ERROR < errors[late].min() < (1 - _MIN_FALL) * errors[~late].min())


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
