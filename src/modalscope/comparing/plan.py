"""Which cells of the table a comparison tries on the data, with which orders and block sizes, and how exact their way to the data is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from modalscope.identification.lookup import find_method
from modalscope.identification.method import DOMAINS, Method
from modalscope.identification.orders import STATES, checked_orders
from modalscope.identification.table import methods
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
    response: Response,
    wanted: str | Iterable[Any],
    orders: Iterable[int] | None,
    *,
    records: bool = False,
    route: str | None = None,
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
    route : str, optional
        From records with inputs: only rows that this way was made for.

    Raises
    ------
    DataError
        An unknown name, or no method at all.
    """
    out: dict[str, list[str]] = {}
    found: list[Method] = []
    if isinstance(wanted, str) and wanted != "all":
        wanted = [wanted]
    table = [m for m in methods() if (not m.driven if route is None else m.route == route)]
    if isinstance(wanted, str):
        found = [m for m in table if _allowed(m, response, out, records)]
    else:
        for item in wanted:
            allowed = _named(item, response, out, records, None if route is None else table)
            found += [m for m in allowed if m not in found]
    notes = tuple(f"{', '.join(dict.fromkeys(names))} left out: {why}" for why, names in out.items())
    if not found and route is None:
        raise DataError(
            "a comparison was asked", notes[0] if notes else "no method was named", 'Name methods, or methods="all".'
        )
    asked = STATES.ladder(response) if orders is None else checked_orders(orders)
    return tuple(_cell(m, response, asked) for m in found), notes


def _named(
    item: Any, response: Response, out: dict[str, list[str]], records: bool, served: list[Method] | None
) -> list[Method]:
    """Return the cells that a name means, of those that a way from records serves where there is one."""
    if isinstance(item, Method):
        return [item] if served is None or item in served else []
    if not isinstance(item, str) and not (isinstance(item, tuple | list) and len(item) == 2):
        raise DataError(
            "methods to compare were asked",
            f"one of methods is {type(item).__name__}",
            'Name rows such as "era", or cells such as "era/s".',
        )
    name, _, domain = item.partition("/") if isinstance(item, str) else (item[0], "", item[1])
    if served is not None:
        row = find_method(name, None, "time").name
        return [m for m in served if m.name == row and domain in ("", m.domain)]
    if domain:
        return [find_method(name, check_choice("domain", domain, DOMAINS), domain)]
    row = find_method(name, None, "time").name  # an unknown name is an error
    return [m for m in methods() if m.name == row and not m.driven and _allowed(m, response, out, records)]


def _allowed(method: Method, response: Response, out: dict[str, list[str]], records: bool) -> bool:
    """Whether the data suit a cell; what does not is noted."""
    refusal = method.refusal(response, records)
    why = refusal.reason if refusal else method.reservation(response)
    if why:
        out.setdefault(why, []).append(str(method))
    return not why


def _cell(method: Method, response: Response, asked: Sequence[int]) -> Cell:
    orders, options = method.orders.compared(asked, response)
    return Cell(method, orders, options, method.exact_on(response))
