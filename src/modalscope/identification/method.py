"""Define what a method is: the data it takes, its data matrix, factorization, realization, orders and options, and its problem."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.stored import StoredSignals
from modalscope.data.whitening import Whitening
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization
from modalscope.identification.options import Options
from modalscope.numerics.checks import check_count, check_each
from modalscope.numerics.errors import DataError
from modalscope.numerics.handed import handed, replaceable


class Takes(Enum):
    """Kind of data of a row; `prepare` provides them."""

    SAMPLES = "samples"
    LINES = "lines"
    CONTINUOUS = "lines of a continuous structure"
    RESPONSE = "lines, or the samples of a window"
    PAST = "records projected on their past"
    RECORDS = "records with inputs on their own lines"
    DRIVEN = "records with inputs projected on their past"


# ----------------------------------------------------------------------------------------------------------------- orders

#: Largest number of states tried by default, by the origin of the response; impulse responses 60.
_MAX_STATES = {"lines": 80, "records": 80, "correlation": 40}

#: A diagram of more orders is a mistake: none has so many rows.
MAX_ORDERS = 10_000


def checked_orders(orders: int | Iterable[int]) -> list[int]:
    """Return the distinct orders, increasing; an empty list is an error. One number is the largest: every second order up to it."""
    if not isinstance(orders, Iterable):
        orders = range(check_count("orders", orders, most=2 * MAX_ORDERS), 0, -2)
    increasing = sorted({check_count("order", n) for n in check_each("orders", orders, "whole numbers", MAX_ORDERS)})
    if not increasing:
        raise DataError("orders:", "the range of orders is empty", "Give range(2, 61, 2) or 2:60:2, say.")
    return increasing


class Reach(NamedTuple):
    """The orders that can be computed, and notes on those left out."""

    orders: list[int]
    notes: tuple[Note, ...] = ()


class OrderRule(ABC):
    """What an order counts, and which orders there are; those of a comparison are in `modalscope.identification.orders`."""

    #: Whether a model has as many states as the truncation keeps.
    truncates = False

    @abstractmethod
    def ladder(self, measured: Response) -> list[int]:
        """Return the default orders."""

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        """Return which of the orders can be computed. `automatic`: whether they are defaults: then at least one is."""
        return Reach(asked)


class States(OrderRule):
    """The order is the number of states kept: the rank of the truncation."""

    truncates = True

    def ladder(self, measured: Response) -> list[int]:
        """Even numbers up to what such data carry."""
        top = _MAX_STATES.get(measured.origin, 60)
        return list(range(2, min(top, measured.max_states or top) + 1, 2))

    def reach(self, factors: Factors, asked: list[int], automatic: bool) -> Reach:
        """Drop orders above the rank; an exact rank is added as an order."""
        rank = factors.rank
        beyond = [n for n in asked if n > rank]
        notes: tuple[Note, ...] = ()
        if beyond:
            text = f"orders {beyond[0]} to {beyond[-1]} left out: {factors.reach}"
            notes = (Note("orders left out", {"lowest": beyond[0], "highest": beyond[-1], "rank": rank}, text),)
        within = [n for n in asked if n <= rank]
        if not within and not automatic:
            raise DataError(f"orders {asked[0]} to {asked[-1]}:", factors.reach, f"Lower the orders to at most {rank}.")
        exact = rank < min(factors.left.shape[1], asked[-1])
        if (exact or not within) and rank not in within:
            within.append(rank)
        return Reach(within, notes)


class Companions(States):
    """The order is the rank, and the model has all block rows for states."""

    truncates = False


class Blocks(OrderRule):
    """The order is a number of states in whole blocks, without truncation."""

    def ladder(self, measured: Response) -> list[int]:
        """Those of a truncation."""
        return STATES.ladder(measured)


STATES, COMPANIONS, BLOCKS = States(), Companions(), Blocks()


# ---------------------------------------------------------------------------------------------------------- problem and row


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Problem:
    """Data and options of one identification by a row of the table; made by `prepare`.

    The reading path uses `method`, `response`, `measured`, `options` and `notes`; the others serve rows on records.

    `response`: as the row takes it, in the band. `measured`: as measured or estimated, in the band, the same for all rows. `records`:
    records without inputs, filtered to the band. `driven`: records with inputs. `options`: as asked; default sizes follow the order.
    `whitening`: of ambient channels; response and records are those of the channels as they were measured.
    """

    method: Method
    response: Response
    measured: Response
    records: Signals | StoredSignals | None
    options: Any
    notes: tuple[Note, ...]
    driven: Records | None = None
    whitening: Whitening | None = None


class Built(NamedTuple):
    """A data matrix, its options with the chosen sizes, and notes."""

    matrix: DataMatrix
    settings: Options
    notes: tuple[Note, ...] = ()


@replaceable("fewer_outputs")
def fewer_outputs(response: Response, order: int, options: Any) -> Any:
    """Return combinations of the outputs where these far exceed the states; the plain way takes all outputs themselves."""
    return None


def refuse(options: Options, why: str, *names: str) -> None:
    """Raise `DataError` for a given option that a data matrix does not have."""
    for name in names:
        if getattr(options, name) is not None:
            raise DataError(f"option {name!r}:", why, "Omit it, or use another domain.")


Matrix = Callable[[Problem, int], Built]
Factor = Callable[[Any, int, str], Factors]
Realize = Callable[[Any, Factors], Realization]


@dataclass(frozen=True, kw_only=True)
class Method:
    """One cell of the table: everything that the stages ask of a method.

    `name`, `domain`: row and column. `realization`: in words. `section`: of the report. `common`: the most common name. `known_as`: names
    in the literature, with the options that give them. `aliases`: further accepted names. `takes`: the kind of data. `matrix`: (problem,
    largest order) -> data matrix and settings. `factor`: (data matrix, largest order, route) -> factors. `realize`: (data matrix, factors)
    -> models of all orders. `orders`: what an order counts: states, states in whole blocks, or the degree of polynomials. `options_type`:
    of its data matrix. `forms`: available forms; "smaller" is the one with fewer states. `fixed`: options that define the row.
    `from_records`: the route from records with inputs, where it is not that of all rows with these data. `votes`: whether a comparison
    of all methods runs it: trust was calibrated with the votes of the rows of the report. Others are compared where they are named.
    """

    name: str
    domain: str
    realization: str
    section: str
    takes: Takes
    matrix: Matrix
    factor: Factor
    realize: Realize
    orders: OrderRule
    options_type: type[Options]
    forms: tuple[str, ...] = ("observable",)
    common: str = ""
    known_as: tuple[str, ...] = ()
    aliases: tuple[str, ...] = ()
    fixed: Mapping[str, Any] = field(default_factory=dict, hash=False)
    from_records: str = ""
    votes: bool = True

    @property
    def label(self) -> str:
        """The common name first, with the name and domain of the table behind it: "SSI-cov (alternate)"."""
        return str(handed("label_of")(self))

    @property
    def of_samples(self) -> bool:
        """Whether it takes samples as they were measured."""
        return self.takes in (Takes.SAMPLES, Takes.DRIVEN)

    def __str__(self) -> str:
        return f"{self.name} ({self.domain}{', records' if self.takes is Takes.RECORDS else ''})"
