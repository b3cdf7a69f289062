"""Plan the cells of a comparison on every route, and name the causes that make routes from records with inputs disagree.

leakage
    Fewer than four lines of estimated frequency responses lie in the half bandwidth of the narrowest mode: their damping is too high, and
    they have no vote.
unmeasured forces
    The residual on the records' lines has peaks at the modes (or there is noise on the inputs: one record does not distinguish these).
delay
    Poles at z = 0: some channels are delayed.
too short
    The record has fewer than three decay times of a mode.
poor fit, too few blocks
    The residual of a route's modes is above thirty per cent, or its orders are too low for as many modes as the usual route finds, while
    these explain enough: it has no vote, as its missing modes are no evidence against a mode.
poor excitation
    Inputs that depend on each other, or have few lines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.analysis.comparing.diagnosis import Cause
from modalscope.analysis.comparing.reservations import exact_on, reservation
from modalscope.analysis.comparing.run import Cell, MethodResult
from modalscope.data.rebuilt import explains_enough
from modalscope.data.record_residual import UNMEASURED
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response, line_step
from modalscope.data.shown import figures, percent
from modalscope.identification.method import STATES, Method, checked_orders
from modalscope.identification.method_names import find_method, methods, rows_of
from modalscope.identification.orders import orders_compared
from modalscope.identification.prepare import Measured, measure
from modalscope.identification.routes import USUAL
from modalscope.identification.suits import INSTEAD, is_driven, refusal, route_of
from modalscope.identification.table_beyond import DOMAINS, methods as table
from modalscope.numerics.checks import check_each
from modalscope.numerics.errors import DataError, check_choice

#: Minimum lines in a half bandwidth: with fewer a window broadens a mode. Minimum decay times of a mode in a record.
_MIN_LINES, _MIN_DECAYS = 4, 3

#: Causes by the kinds of a diagram's notes.
_CAUSES_OF_NOTES = {UNMEASURED: "unmeasured forces", "delay": "delay", "warning": "poor excitation"}


def responses_by_route(
    data: Any, band: Any, route: str | None, delays: Mapping[str, int] | None = None, reciprocal: bool | None = None
) -> tuple[tuple[Measured, ...], tuple[str, ...]]:
    """Return the response of the data by every route, the usual one first, and why others failed; other data have one response.

    `band`: Hz. `route`: the only one, where asked. `delays`: as in `identify`; those of the usual route are used for the others, too.
    """
    if reciprocal is None and isinstance(data, Signals | Records):
        # shapes are compared over the same points, and not all routes give responses that can be exchanged
        reciprocal = False
    first = measure(data, band, route=route, delays=delays, reciprocal=reciprocal)
    if first.route is None or route not in (None, "auto"):
        return (first,), ()
    responses, failed = [first], []
    for other in USUAL:
        if other not in (first.route, INSTEAD.get(first.route), *INSTEAD):
            try:
                responses.append(measure(data, band, route=other, delays=first.delays or {}, reciprocal=reciprocal))
            except DataError as error:
                failed.append(f"Route {other} left out: {error.found}")
    return tuple(responses), tuple(failed)


def tasks_of(
    routes: Sequence[Measured], methods: Any, orders: Any, *, all_sets: bool = False
) -> tuple[list[tuple[Measured, Cell]], tuple[str, ...]]:
    """Return the cells to run, each with the data of its route, and notes on methods that the data do not allow.

    The usual row of a route comes first and has its vote. Of all methods, rows are run in the usual domain of the route where possible.
    """
    tasks: list[tuple[Measured, Cell]] = []
    notes: list[str] = []
    for data in routes:
        cells, refused = plan(
            data.response, methods, orders, records=data.records is not None, route=data.route, all_sets=all_sets
        )
        notes += refused
        if data.route is not None:
            if methods == "all":  # the usual domain, or the others for a row that is not there
                in_domain = {c.method.name for c in cells if c.method.domain == data.domain}
                cells = tuple(c for c in cells if c.method.domain == data.domain or c.method.name not in in_domain)
            usual = (data.row, data.domain)
            cells = tuple(sorted(cells, key=lambda c: (c.method.name, c.method.domain) != usual))
        tasks += [(data, cell) for cell in cells]
    if not tasks:
        raise DataError("a comparison:", "no method of these names takes these data", 'Use methods="all".')
    return tasks, tuple(dict.fromkeys(notes))


def plan(
    response: Response,
    wanted: str | Iterable[Any],
    orders: int | Iterable[int] | None,
    *,
    records: bool = False,
    route: str | None = None,
    all_sets: bool = False,
) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Return the cells to try and notes on those that the data do not allow.

    `wanted`: "era" is the row in every domain that the data allow, "era/s" or ("era", "s") one cell. `orders`: by default 2, 4, ... up to
    80 for frequency responses, 60 for impulse responses and 40 for correlations. `records`: whether the records without inputs from which
    the response was estimated are available. `route`: from records with inputs: only rows of this route. `all_sets`: with "all" also the
    rows without a vote, which stay without.

    Raises `DataError`: an unknown name, or no method at all.
    """
    refused: dict[str, list[str]] = {}  # methods by reason

    def allowed(method: Method) -> bool:
        unsuited = refusal(method, response, records)
        why = unsuited.reason if unsuited else reservation(method, response)
        if why:
            refused.setdefault(why, []).append(str(method))
        return not why

    def suits(method: Method) -> bool:
        return not is_driven(method) if route is None else route_of(method) == INSTEAD.get(route, route)

    chosen: list[Method] = []
    if isinstance(wanted, str) and wanted == "all":
        chosen = [m for m in (methods() if all_sets else table()) if suits(m) and (m.votes or all_sets) and allowed(m)]
    else:
        for item in [wanted] if isinstance(wanted, str) else check_each("methods", wanted, "names of rows or cells"):
            named = _named(item, suits, route is not None, allowed)
            chosen += [m for m in named if m not in chosen]
    notes = tuple(f"{', '.join(dict.fromkeys(names))} left out: {why}" for why, names in refused.items())
    if not chosen and route is None:
        have = notes[0] if notes else "no method was named"
        raise DataError("a comparison:", have, 'Name methods, or methods="all".')
    asked = STATES.ladder(response) if orders is None else checked_orders(orders)
    aside = [m for m in chosen if all_sets and not (m.votes and m in table())]
    cells = (
        Cell(m, *orders_compared(m.orders, asked, response), exact_on(m, response) and m not in aside, m in aside)
        for m in sorted(chosen, key=lambda m: m in aside)
    )
    if aside:
        listed = ", ".join(map(str, aside))
        notes += (f"Shown without a vote, as trust was calibrated with the votes of the others: {listed}",)
    return tuple(cells), notes


def _named(
    item: Any, suits: Callable[[Method], bool], of_route: bool, allowed: Callable[[Method], bool]
) -> list[Method]:
    """Return the cells of a name that suit the route, where there is one, or are allowed."""
    if isinstance(item, Method):
        return [item] if not of_route or suits(item) else []
    if not isinstance(item, str) and not (isinstance(item, tuple | list) and len(item) == 2):
        have, change = f"one of methods is {type(item).__name__}", 'Name rows such as "era", or cells such as "era/s".'
        raise DataError("methods need names of rows or cells", have, change)
    name, _, domain = item.partition("/") if isinstance(item, str) else (item[0], "", item[1])
    if domain and not of_route:
        return [find_method(name, check_choice("domain", domain, DOMAINS), domain)]
    row = [m for m in rows_of(find_method(name, None, "time").name) if suits(m)]  # an unknown name is an error
    return [m for m in row if (domain in ("", m.domain) if of_route else allowed(m))]


def route_causes(results: Sequence[MethodResult]) -> tuple[tuple[MethodResult, ...], list[Cause]]:
    """Return the results, those that leak or explain too little without a vote, and the causes that make the routes disagree.

    `results`: of one route or of several.
    """
    if not any(r.route for r in results):
        return tuple(results), []
    half = _narrowest([r for r in results if r.route == "records"]) or _narrowest(results)
    usual = next(r for r in results if r.route)
    causes: dict[str, Cause] = {}
    judged = []
    for r in results:
        leak, insufficient = _leaks(r, half), _insufficient(r, usual) if r.exact else None
        if leak:
            causes["leakage"] = Cause("leakage", leak)
        if insufficient is not None:
            causes.setdefault(f"{insufficient.name} of {r.route}", insufficient)
        judged.append(replace(r, exact=r.exact and not leak and insufficient is None))
        for note in r.diagram.notes if r.diagram is not None and r.route == "records" else ():
            if name := _CAUSES_OF_NOTES.get(note.kind):
                causes.setdefault(name, Cause(name, str(note)))
    durations = [max(d) for r in results if r.diagram and (d := getattr(r.diagram.response, "durations", None))]
    decays = 2 * np.pi * half * max(durations) if half is not None and durations else np.inf
    if decays < _MIN_DECAYS:
        evidence = f"{figures(max(durations))} s are {figures(decays, 2)} decay times of the narrowest mode"
        return tuple(judged), [*causes.values(), Cause("too short", evidence)]
    return tuple(judged), list(causes.values())


def _insufficient(result: MethodResult, usual: MethodResult) -> Cause | None:
    """Return why a route has no vote next to the usual one: it explains too little, or its orders are too low."""
    if result.route == usual.route or result.fit_error is None or usual.modes is None or usual.fit_error is None:
        return None
    if not explains_enough(usual.fit_error):
        return None
    route = f"route {result.route} by {result.label}"
    if not explains_enough(result.fit_error):
        return Cause("poor fit", f"the modes of {route} leave {percent(result.fit_error)} unexplained")
    most, needed = max(result.diagram.orders, default=0) if result.diagram else 0, 2 * len(usual.modes)
    if most < needed:
        return Cause("too few blocks", f"{route} has orders up to {most}, {len(usual.modes)} modes need {needed}")
    return None


def _narrowest(results: Sequence[MethodResult]) -> float | None:
    """Return the minimum half bandwidth of the modes in Hz: the median over the methods."""
    models = [r.modes for r in results if r.modes is not None and len(r.modes)]
    return float(np.median([np.min(m.frequencies * m.damping_ratios) for m in models])) if models else None


def _leaks(result: MethodResult, half: float | None) -> str:
    """Return why the lines of estimated responses are too coarse for the narrowest mode; "" when they are not."""
    if result.route != "frf" or result.diagram is None or half is None:
        return ""
    step = line_step(result.diagram.response)
    windowed = any("window" in step and "no window" not in step for step in result.diagram.response.processing)
    if not step or not windowed or _MIN_LINES * step <= half:
        return ""
    return f"lines of the segments are {figures(step, 2)} Hz apart, the minimum half bandwidth of the modes is {figures(half, 2)} Hz"
