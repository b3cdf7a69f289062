"""Choose model orders by what an order counts: states, blocks of states, or the degree of a matrix polynomial."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from modalscope.blocks.factor import Factors
from modalscope.blocks.fraction import largest_degree
from modalscope.blocks.matrix import DataMatrix
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.numerics.checks import check_count, check_each
from modalscope.numerics.errors import DataError
from modalscope.realizations.order import recommend_order

#: Largest number of states tried by default, by where the response came from; impulse responses 60.
_LARGEST = {"lines": 80, "records": 80, "correlation": 40}

#: Canonical forms have a block for every block row: beyond about this many states their eigenvalues cost more than they tell.
_COMPANION_STATES = 200

#: ... and where every input has functions of its own beyond this many.
_DRIVEN_STATES = 80

#: ... and of that many orders every second one will do.
_COMPANION_ORDERS = 30


def checked_orders(orders: Iterable[int]) -> list[int]:
    """Return the orders asked, increasing and each once; none at all is an error."""
    found = sorted({check_count("order", n) for n in check_each("orders", orders, "whole numbers")})
    if not found:
        raise DataError(
            "at least one order was asked",
            "the range of orders is empty",
            "Give orders, for instance range(2, 61, 2) or 2:60:2.",
        )
    return found


Factored = Callable[[int], tuple[DataMatrix, Factors]]


@dataclass(frozen=True)
class Choice:
    """One order chosen from the data, and why."""

    order: int
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class Reach:
    """The orders that the factors can give, what was left out, and the exact rank where the data end."""

    orders: list[int]
    notes: tuple[Note, ...] = ()


class OrderRule(ABC):
    """What an order counts, and what follows from that."""

    #: Whether a model has as many states as the truncation keeps.
    truncates = False

    @abstractmethod
    def ladder(self, measured: Response) -> list[int]:
        """Return the orders to try when none are given."""

    @abstractmethod
    def choose(self, largest: int, factored: Factored) -> Choice:
        """Return one order where none is asked, from what `factored` gives for the largest that is looked at."""

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        """Return which of the orders there are."""
        return Reach(asked)

    def states_each(self, response: Response) -> int:
        """Return how many states one more order is."""
        return 1

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        """Return orders, and sizes that are not the row's own, for a comparison at about `asked` states."""
        return tuple(asked), {}


class _States(OrderRule):
    """The order is the number of states kept: the rank of the truncation."""

    truncates = True

    def ladder(self, measured: Response) -> list[int]:
        top = _LARGEST.get(measured.origin, 60)
        return list(range(2, min(top, measured.room or top) + 1, 2))

    def choose(self, largest: int, factored: Factored) -> Choice:
        """Return what stands out of the noise in the singular values."""
        _, factors = factored(largest)
        return self._advised(factors)

    def _advised(self, factors: Factors, blocks_of: int = 1, times: int = 1) -> Choice:
        advice = recommend_order(factors)
        order = -(-times * advice.order // blocks_of) * blocks_of
        text = f"order {order} was chosen ({advice.confidence}): {advice.reason}"
        return Choice(order, (Note("order chosen", {"order": order}, text),))

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        """Leave out what lies beyond the rank; where the rank is exact it is an order itself."""
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
        """Keep companion matrices of lines to a size whose eigenvalues are worth their time."""
        if response.room is None:
            return tuple(asked), {}
        outputs = response.values.shape[1]
        most = _COMPANION_STATES if response.separable else _DRIVEN_STATES
        degree = max(min(48, most // outputs), -(-asked[-1] // outputs) + 2)
        few = asked if len(asked) <= _COMPANION_ORDERS else [n for n in asked if (asked[-1] - n) % 4 == 0]
        return tuple(few or asked), {"block_rows": degree}


class _Blocks(_States):
    """The order is a number of states in whole blocks, without truncation."""

    truncates = False

    def choose(self, largest: int, factored: Factored) -> Choice:
        """Leave room for the noise beside the modes: twice the states that stand out, in whole blocks."""
        matrix, factors = factored(largest)
        return self._advised(factors, blocks_of=factors.left.shape[0] // (matrix.block_rows + 1), times=2)

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        return Reach(asked)

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        inputs = response.values.shape[2]
        return tuple(sorted({inputs * max(-(-n // inputs), 1) for n in asked})), {}


class _Degrees(OrderRule):
    """The order is the degree of matrix polynomials, of as many states as there are inputs."""

    #: Degree when one is to be chosen: enough for the modes of a usual band, whatever is left over turns out unstable.
    usual = 30

    def ladder(self, measured: Response) -> list[int]:
        """Degrees up to 60, to 240 poles, and to what the lines of a band can tell apart."""
        top = max(min(60, 240 // max(measured.values.shape[2], 1), largest_degree(measured)), 4)
        return list(range(2, top + 1, 2 if top > 40 else 1))

    def choose(self, largest: int, factored: Factored) -> Choice:
        return Choice(self.usual)

    def states_each(self, response: Response) -> int:
        return int(response.values.shape[2])

    def compared(self, asked: Sequence[int], response: Response) -> tuple[tuple[int, ...], dict[str, Any]]:
        return tuple(sorted({max(n // 2, 2) for n in asked})), {}


STATES, COMPANIONS, BLOCKS, DEGREES = _States(), _Companions(), _Blocks(), _Degrees()
