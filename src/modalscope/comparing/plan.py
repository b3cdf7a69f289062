"""Which cells of the table a comparison tries on the data, with which orders and block sizes, and how exact their way to the data is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modalscope.identification.table import DOMAINS, Method, find_method, methods
from modalscope.model.checks import DataError, check_choice
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse

__all__ = ["Cell", "has_decayed", "plan"]

Response = FrequencyResponse | ImpulseResponse

#: Canonical forms have a block for every block row: beyond about this many states their eigenvalues cost more than they tell.
_COMPANION_STATES = 200

#: ... and of that many orders every second one will do.
_COMPANION_ORDERS = 30

#: A response has decayed when its last tenth holds less than this share of the energy.
_DECAYED = 1e-3


@dataclass(frozen=True)
class Cell:
    """One method as the comparison runs it.

    Parameters
    ----------
    method : Method
    orders : tuple of int
    options : mapping
        Block sizes that are not the method's own default.
    exact : bool
        Whether the method works on the data themselves. What was carried from lines to samples or back is compared, but has no vote.
    """

    method: Method
    orders: tuple[int, ...]
    options: dict[str, Any] = field(default_factory=dict)
    exact: bool = True


def plan(
    response: Response, wanted: str | Iterable[Any], orders: Iterable[int] | None, *, records: bool = False
) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Return the cells to try and notes on those that the data do not allow.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
    wanted : "all" or iterable of str, (str, str) or Method
        "era" is the row in every domain that the data allow, "era/s" or ("era", "s") one cell.
    orders : iterable of int, optional
        By default 2, 4, ... up to 80 for frequency responses, 60 for impulse responses and 40 for correlations.
    records : bool
        Whether the records without inputs that the response was estimated from are there.

    Raises
    ------
    DataError
        An unknown name, or no method at all.
    """
    notes: list[str] = []
    found: list[Method] = []
    if isinstance(wanted, str) and wanted != "all":
        wanted = [wanted]
    if isinstance(wanted, str):
        found = [m for m in methods() if _allowed(m, response, notes, records)]
    else:
        for item in wanted:
            found += [m for m in _named(item, response, notes, records) if m not in found]
    if not found:
        raise DataError(
            "a comparison was asked", notes[0] if notes else "no method was named", 'Name methods, or methods="all".'
        )
    asked = _orders(response, orders)
    return tuple(_cell(m, response, asked) for m in found), tuple(dict.fromkeys(notes))


def _orders(response: Response, orders: Iterable[int] | None) -> tuple[int, ...]:
    if orders is None:
        largest = 60
        if isinstance(response, FrequencyResponse):
            largest = 80
        elif response.kind == "correlation":
            largest = 40
        return tuple(range(2, largest + 1, 2))
    asked = tuple(sorted({int(n) for n in orders}))
    if not asked or asked[0] < 1:
        raise DataError(
            "orders of at least 1 were asked",
            f"they are {list(asked)[:5]}",
            "Give for instance range(2, 61, 2) or 2:60:2.",
        )
    return asked


def _named(item: Any, response: Response, notes: list[str], records: bool) -> list[Method]:
    if isinstance(item, Method):
        return [item]
    name, _, domain = item.partition("/") if isinstance(item, str) else (item[0], "", item[1])
    if domain:
        return [find_method(name, check_choice("domain", domain, DOMAINS), domain)]
    find_method(name, None, "time")  # an unknown name is an error
    return [m for m in methods() if m.name == name and _allowed(m, response, notes, records)]


def _allowed(method: Method, response: Response, notes: list[str], records: bool) -> bool:
    """Whether the data suit a cell's domain; what does not is noted once a domain."""
    if method.on_records:
        if not records:
            notes.append(f"{method} left out: it projects records without inputs, and there are none")
        return records
    if isinstance(response, FrequencyResponse):
        if method.domain == "time":
            return _even_lines(response, notes)
        if method.domain == "s" and response.sampling_rate is not None:
            notes.append("domain s left out: the lines are those of a sampled system, which domain z takes as they are")
            return False
        return True
    if method.domain == "s":
        notes.append("domain s left out: the transform of samples is no rational function of j w")
        return False
    if method.factors == "fraction" and not has_decayed(response):
        notes.append(
            f"{method} left out: the response has not decayed at its last sample, so that its lines are biased"
        )
        return False
    return True


def _even_lines(response: FrequencyResponse, notes: list[str]) -> bool:
    try:
        response.at_lines(slice(0, None)).to_impulse_response()
    except DataError as error:
        notes.append(f"domain time left out: {error.asked}, but {error.found}")
        return False
    return True


def has_decayed(response: ImpulseResponse) -> bool:
    """Whether little enough is left at the end for a transform of the samples to serve in place of lines."""
    energy = np.sum(response.values**2, axis=(1, 2))
    return bool(energy[-max(energy.size // 10, 1) :].sum() < _DECAYED * energy.sum())


def _cell(method: Method, response: Response, asked: tuple[int, ...]) -> Cell:
    lines = isinstance(response, FrequencyResponse)
    outputs, inputs = response.values.shape[1:]
    if method.factors == "fraction":  # its order is a degree, of as many states for every input
        degrees = sorted({max(n // 2, 2) for n in asked})
        return Cell(method, tuple(degrees), exact=lines)
    if method.factors == "complete":  # whole blocks only
        whole = sorted({inputs * max(-(-n // inputs), 1) for n in asked})
        return Cell(method, tuple(whole), exact=not lines)
    exact = not lines or method.domain != "time" or _whole_spectrum(response)
    if not method.canonical or method.domain == "time":
        return Cell(method, asked, exact=exact)
    degree = max(min(48, _COMPANION_STATES // outputs), -(-asked[-1] // outputs) + 2)
    few = asked if len(asked) <= _COMPANION_ORDERS else tuple(n for n in asked if (asked[-1] - n) % 4 == 0)
    return Cell(method, few or asked, {"block_rows": degree} if lines else {}, exact)


def _whole_spectrum(response: Response) -> bool:
    """Whether the lines of a sampled system's response cover everything from zero to half the sampling rate."""
    if not isinstance(response, FrequencyResponse) or response.sampling_rate is None:
        return False
    f = response.frequencies
    return bool(f[0] == 0 and np.isclose(f[-1], response.sampling_rate / 2))
