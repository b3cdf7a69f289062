"""Define what a method is: the data it takes, its data matrix, factorization, realization and options, and its problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from modalscope.blocks.factor import Factors
from modalscope.blocks.matrix import DataMatrix
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.results import Settings
from modalscope.data.stored import StoredSignals
from modalscope.data.whitening import Whitening
from modalscope.identification.options import Options
from modalscope.identification.orders import OrderRule
from modalscope.numerics.errors import DataError
from modalscope.realizations.realization import Realization

# --------------------------------------------------------------------------------------------------------------- takes
#: A response has decayed when its last tenth holds less than this share of the energy.
_DECAYED = 1e-3


class Takes(Enum):
    """Data that the data matrix of a row is made of; `prepare` provides them."""

    SAMPLES = "samples"
    LINES = "lines"
    CONTINUOUS = "lines of a continuous structure"
    RESPONSE = "lines, or the samples of a window"
    PAST = "records projected on their past"
    RECORDS = "records with inputs on their own lines"
    DRIVEN = "records with inputs projected on their past"


#: The route from records with inputs to the data that a row takes.
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
    """Why a row cannot take data, and the remedy."""

    reason: str
    change: str


def _no_samples(response: Response, records: bool) -> Refusal | None:
    if response.origin == "lines":
        return None
    return Refusal(
        "the data are samples: their transform is no rational function of j w",
        "Use domain='z', which is exact for samples, or give measured frequency responses.",
    )


def _no_records(response: Response, records: bool) -> Refusal | None:
    if records:
        return None
    return Refusal(
        "it projects records without inputs, and there are none",
        "Give Signals with outputs alone, or use method='alternate', which takes any response.",
    )


def _no_spectra(response: Response, records: bool) -> Refusal | None:
    if response.origin == "records":
        return None
    return Refusal("it takes records with inputs, and these are none", "Give Signals with inputs, or leave route out.")


#: Why a row cannot take the data, given whether records without inputs are there. Other rows take all data.
REFUSALS: dict[Takes, Callable[[Response, bool], Refusal | None]] = {
    Takes.CONTINUOUS: _no_samples,
    Takes.PAST: _no_records,
    Takes.RECORDS: _no_spectra,
    Takes.DRIVEN: _no_spectra,
}


def _no_even_lines(response: Response) -> str:
    try:
        response.as_samples()
    except DataError as error:
        return f"{error.asked}, but {error.found}"
    return ""


def _sampled_lines(response: Response) -> str:
    return "the lines are those of a sampled system, which domain z takes as they are" if response.held_input else ""


def _not_decayed(response: Response) -> str:
    if response.exact_lines or has_decayed(response):
        return ""
    return "the response has not decayed at its last sample, so that its lines are biased"


def has_decayed(response: Response) -> bool:
    """Whether a response has decayed at its last samples, so that a transform of the samples is unbiased."""
    energy = np.sum(np.abs(response.values) ** 2, axis=(1, 2))
    return bool(energy[-max(energy.size // 10, 1) :].sum() < _DECAYED * energy.sum())


#: Why a comparison leaves a row out although it can take the data; empty where it does not. Other rows are compared.
RESERVATIONS: dict[Takes, Callable[[Response], str]] = {
    Takes.SAMPLES: _no_even_lines,
    Takes.LINES: _not_decayed,
    Takes.CONTINUOUS: _sampled_lines,
}

#: Whether a row works on the data themselves, not on a transform that loses something. Other rows do.
EXACT: dict[Takes, Callable[[Response], bool]] = {
    Takes.SAMPLES: lambda response: response.exact_samples,
    Takes.LINES: lambda response: response.exact_lines,
}


# -------------------------------------------------------------------------------------------------------------- method

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


Matrix = Callable[[Problem, int], Built]
Factor = Callable[[Any, int, str], Factors]
Realize = Callable[[Any, Factors], Realization]


@dataclass(frozen=True, kw_only=True)
class Method:
    """One cell of the table: everything that the stages ask of a method.

    `name`, `domain`: the row and the column. `realization`: how the model is read off, in words. `section`: where the report has it.
    `common`: the name that most people know it by. `known_as`: names in the literature of this cell, with the options that make them.
    `aliases`: other words for `name` that mean this cell. `takes`: what it is given. `matrix`: (problem, largest order) -> data matrix
    and settings. `factor`: (data matrix, largest order, route) -> factors. `realize`: (data matrix, factors) -> models of all orders.
    `orders`: what an order is: states, blocks of states, or the degree of a polynomial. `options_type`: the options of its data matrix.
    `forms`: observable and controllable forms that exist; the first is the default, "smaller" takes the one with fewer states. `fixed`:
    options that make the row. `from_records`: the way from records with inputs to what it takes, where that is not the one of all rows
    that take the same.
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
    fixed: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    from_records: str = ""

    def __str__(self) -> str:
        return f"{self.name} ({', '.join((self.domain, *self._of_records))})"

    @property
    def route(self) -> str:
        """The route from records with inputs to the data that the row takes; empty where there is none."""
        return self.from_records or ROUTES[self.takes]

    def served_by(self, route: str) -> bool:
        """Whether a route from records with inputs gives the data that the row takes; frequency responses give samples, too."""
        return route == self.route or (route == "frf" and self.takes is Takes.SAMPLES)

    @property
    def driven(self) -> bool:
        """Whether it takes nothing but records with inputs."""
        return self.takes in (Takes.RECORDS, Takes.DRIVEN)

    @property
    def of_past(self) -> bool:
        """Whether it projects the records themselves on their past."""
        return self.takes in (Takes.PAST, Takes.DRIVEN)

    @property
    def _of_records(self) -> tuple[str, ...]:
        """What distinguishes the row from one of the same name and domain."""
        return ("records",) if self.takes is Takes.RECORDS else ()

    @property
    def label(self) -> str:
        """The common name first, with the name and domain of the table behind it: "SSI-cov (alternate)"."""
        same = plain(self.common) == plain(self.name)
        inside = [] if same else [self.name]
        if self.domain != "time":
            inside.append(self.domain)
        inside += self._of_records
        return f"{self.common} ({', '.join(inside)})" if inside else self.common

    def refusal(self, response: Response, records: bool) -> Refusal | None:
        """Return why the row cannot take these data and what to do, None when it can.

        `records`: whether records without inputs are there.
        """
        refused = REFUSALS.get(self.takes)
        return None if refused is None else refused(response, records)

    def reservation(self, response: Response) -> str:
        """Return why a comparison leaves the row out although it can take the data, empty when it does not."""
        reserved = RESERVATIONS.get(self.takes)
        return "" if reserved is None else reserved(response)

    def rows_span(self, settings: Settings, dt: float | None) -> float | None:
        """Return the time that the block rows span, seconds; None where they are no samples, or all of them are states.

        `dt`: sampling interval of the identified system.
        """
        rows = settings.get("block_rows")
        if (
            rows is None
            or dt is None
            or self.takes not in (Takes.SAMPLES, Takes.PAST, Takes.DRIVEN)
            or not self.orders.truncates
        ):
            return None
        return float(rows * dt)

    def exact_on(self, response: Response) -> bool:
        """Return whether the row works on the data themselves, not on a transform that loses something."""
        exact = EXACT.get(self.takes)
        return exact is None or exact(response)


def plain(name: str) -> str:
    """Return a name without what people write differently: case, hyphens, underscores and blanks."""
    return "".join(c for c in name.lower() if c not in "-_ ")
