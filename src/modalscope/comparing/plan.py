"""Which cells of the table a comparison tries on the data, with which orders and block sizes, and how exact their way to the data is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from modalscope.comparing.questions import default_orders, exact_on, method_orders, unsuited
from modalscope.identification.table import DOMAINS, Method, find_method, methods
from modalscope.model.checks import DataError, check_choice
from modalscope.model.response import Response

__all__ = ["Cell", "plan"]


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
        return default_orders(response)
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
    row = find_method(name, None, "time").name  # an unknown name is an error
    return [m for m in methods() if m.name == row and _allowed(m, response, notes, records)]


def _allowed(method: Method, response: Response, notes: list[str], records: bool) -> bool:
    """Whether the data suit a method; why not is noted."""
    reason = unsuited(method, response, records)
    notes += [] if reason is None else [reason]
    return reason is None


def _cell(method: Method, response: Response, asked: tuple[int, ...]) -> Cell:
    orders, sizes = method_orders(method, response, asked)
    return Cell(method, orders, dict(sizes), exact_on(method, response))
