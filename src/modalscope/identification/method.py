"""Define what a method is: the data it takes, its data matrix, factorization, realization and options, and its problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.results import Settings
from modalscope.data.stored import StoredSignals
from modalscope.data.whitening import Whitening
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization
from modalscope.identification.options import Options
from modalscope.identification.orders import OrderRule
from modalscope.numerics.errors import DataError
from modalscope.numerics.handed import or_faster

#: Maximum share of the energy in the last tenth of a response that has decayed.
_MAX_LATE_ENERGY = 1e-3


class Takes(Enum):
    """Kind of data of a row; `prepare` provides them."""

    SAMPLES = "samples"
    LINES = "lines"
    CONTINUOUS = "lines of a continuous structure"
    RESPONSE = "lines, or the samples of a window"
    PAST = "records projected on their past"
    RECORDS = "records with inputs on their own lines"
    DRIVEN = "records with inputs projected on their past"


#: The route from records with inputs to the data of a row.
ROUTES = {
    Takes.SAMPLES: "markov",
    Takes.LINES: "frf",
    Takes.CONTINUOUS: "frf",
    Takes.RESPONSE: "frf",
    Takes.PAST: "",
    Takes.RECORDS: "records",
    Takes.DRIVEN: "subspace",
}


class Refusal(NamedTuple):
    """Why data do not suit a row, and the remedy."""

    reason: str
    change: str


_NO_LINES = Refusal(
    "samples have no rational transform in j w",
    "Use domain='z', which is exact for samples, or give measured frequency responses.",
)
_NO_RECORDS = Refusal(
    "it needs records without inputs",
    "Give Signals with outputs alone, or use method='alternate', which accepts any response.",
)
_NO_INPUTS = Refusal("it needs records with inputs", "Give Signals with inputs, or omit route.")

#: Origin of a response that a row needs, and the refusal of others. Other rows accept all data.
REFUSALS: dict[Takes, tuple[str, Refusal]] = {
    Takes.CONTINUOUS: ("lines", _NO_LINES),
    Takes.RECORDS: ("records", _NO_INPUTS),
    Takes.DRIVEN: ("records", _NO_INPUTS),
}


def _no_even_lines(response: Response) -> str:
    try:
        response.as_samples()
    except DataError as error:
        return error.fault
    return ""


def _sampled_lines(response: Response) -> str:
    return "lines of a sampled system need domain z" if response.held_input else ""


def _not_decayed(response: Response) -> str:
    if response.exact_lines or has_decayed(response):
        return ""
    return "the response has not decayed at its last sample: its lines are biased"


def has_decayed(response: Response) -> bool:
    """Whether a response has decayed at its last samples, so that a transform of the samples is unbiased."""
    energy = np.sum(np.abs(response.values) ** 2, axis=(1, 2))
    return bool(energy[-max(energy.size // 10, 1) :].sum() < _MAX_LATE_ENERGY * energy.sum())


#: Why a comparison omits a row although the data suit it, or an empty text. Other rows are compared.
RESERVATIONS: dict[Takes, Callable[[Response], str]] = {
    Takes.SAMPLES: _no_even_lines,
    Takes.LINES: _not_decayed,
    Takes.CONTINUOUS: _sampled_lines,
}

#: Whether a row uses the data themselves, not a lossy transform. Other rows do.
EXACT: dict[Takes, Callable[[Response], bool]] = {
    Takes.SAMPLES: lambda response: response.exact_samples,
    Takes.LINES: lambda response: response.exact_lines,
}


DOMAINS = {
    "time": "Hankel matrix of Markov parameters",
    "z": "shifted transfer functions",
    "s": "differentiated transfer functions",
}


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Problem:
    """Data and options of one identification by a row of the table; made by `prepare`.

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


@or_faster("fewer_outputs")
def fewer_outputs(response: Response, order: int, options: Any) -> Any:
    """Return combinations of the outputs where these far exceed the states; the plain way takes all outputs themselves."""
    return None


def refuse(options: Options, why: str, *names: str) -> None:
    """Raise `DataError` for a given option that a data matrix does not have."""
    for name in names:
        if getattr(options, name) is not None:
            raise DataError(f"option {name!r} was asked", why, "Omit it, or use another domain.")


Matrix = Callable[[Problem, int], Built]
Factor = Callable[[Any, int, str], Factors]
Realize = Callable[[Any, Factors], Realization]


@dataclass(frozen=True, kw_only=True)
class Method:
    """One cell of the table: everything that the stages ask of a method.

    `name`, `domain`: row and column. `realization`: in words. `section`: of the report. `common`: the most common name. `known_as`: names
    in the literature, with the options that give them. `aliases`: further accepted names. `takes`: the kind of data. `matrix`: (problem,
    largest order) -> data matrix and settings. `factor`: (data matrix, largest order, route) -> factors. `realize`: (data matrix, factors)
    -> models of all orders. `orders`: what an order counts: states, blocks of states, or the degree of a polynomial. `options_type`: of its
    data matrix. `forms`: available forms, the default first; "smaller" is the one with fewer states. `fixed`: options that define the row.
    `from_records`: the route from records with inputs, where it is not that of all rows with these data. `votes`: whether a comparison
    of all methods runs it: trust was calibrated with the votes of the rows of the report. Others are compared where they are named.
    """

    name: str
    domain: str
    realization: str
    section: str
    common: str
    known_as: tuple[str, ...]
    takes: Takes
    matrix: Matrix
    factor: Factor
    realize: Realize
    orders: OrderRule
    options_type: type[Options]
    forms: tuple[str, ...] = ("observable",)
    aliases: tuple[str, ...] = ()
    fixed: Mapping[str, Any] = field(default_factory=dict, hash=False)
    from_records: str = ""
    votes: bool = True

    def __str__(self) -> str:
        return f"{self.name} ({', '.join((self.domain, *self._of_records))})"

    @property
    def route(self) -> str:
        """The route from records with inputs to the data of the row, or an empty text."""
        return self.from_records or ROUTES[self.takes]

    def served_by(self, route: str) -> bool:
        """Whether a route from records with inputs gives the data of the row; frequency responses also give samples."""
        return route == self.route or (route == "frf" and self.takes is Takes.SAMPLES)

    @property
    def driven(self) -> bool:
        """Whether it needs records with inputs."""
        return self.takes in (Takes.RECORDS, Takes.DRIVEN)

    @property
    def of_past(self) -> bool:
        """Whether it projects records on their past."""
        return self.takes in (Takes.PAST, Takes.DRIVEN)

    @property
    def _of_records(self) -> tuple[str, ...]:
        """What distinguishes the row from one of the same name and domain."""
        return ("records",) if self.takes is Takes.RECORDS else ()

    @property
    def label(self) -> str:
        """The common name first, with the name and domain of the table behind it: "SSI-cov (alternate)"."""
        name = () if plain(self.common) == plain(self.name) else (self.name,)
        domain = () if self.domain == "time" else (self.domain,)
        details = ", ".join((*name, *domain, *self._of_records))
        return f"{self.common} ({details})" if details else self.common

    def refusal(self, response: Response, records: bool) -> Refusal | None:
        """Return why these data do not suit the row, or None. `records`: whether there are records without inputs."""
        if self.takes is Takes.PAST:
            return None if records else _NO_RECORDS
        needed = REFUSALS.get(self.takes)
        return needed[1] if needed and response.origin != needed[0] else None

    def reservation(self, response: Response) -> str:
        """Return why a comparison omits the row although the data suit it, or an empty text."""
        reservation = RESERVATIONS.get(self.takes)
        return reservation(response) if reservation else ""

    def rows_span(self, settings: Settings, dt: float | None) -> float | None:
        """Return the time span of the block rows, seconds; None where they are no samples, or all of them are states.

        `dt`: sampling interval of the identified system.
        """
        rows = settings.get("block_rows")
        of_samples = self.takes in (Takes.SAMPLES, Takes.PAST, Takes.DRIVEN) and self.orders.truncates
        return None if rows is None or dt is None or not of_samples else float(rows * dt)

    def exact_on(self, response: Response) -> bool:
        """Return whether the row uses the data themselves, not a lossy transform."""
        exact = EXACT.get(self.takes)
        return exact is None or exact(response)


def plain(name: str) -> str:
    """Return a name in small letters without hyphens, underscores and blanks."""
    return "".join(c for c in name.lower() if c not in "-_ ")
