"""Compare the routes from records with inputs as independent estimates, and name what makes them disagree.

leakage
    Lines of estimated frequency responses lie less than four to the half bandwidth of the narrowest mode: their damping is too high, and
    they have no vote.
unmeasured forces
    The residual on the records' lines has peaks at the modes (or there is noise on the inputs: one record cannot tell).
delay
    Poles at z = 0: some channels come late.
too short
    The record holds fewer than three decay times of a mode.
poor fit, too few blocks
    The modes of a route leave a residual above thirty per cent, or its orders cannot hold as many modes as the usual route finds, while
    these explain enough: it has no vote, for its missing modes are no evidence against a mode.
poor excitation
    Inputs that depend on each other, or hold few lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.comparing.diagnosis import Cause
from modalscope.comparing.run import Cell, MethodResult, plan
from modalscope.data.record_residual import UNMEASURED
from modalscope.data.response import line_step
from modalscope.identification.prepare import Measured, measure
from modalscope.identification.routes import USUAL
from modalscope.modal.rebuilt import explains_enough, share_explained
from modalscope.numerics.errors import DataError

#: Lines to a half bandwidth below which a window broadens a mode, and decay times below which a record hardly shows one.
_LINES, _DECAYS = 4, 3

#: Notes of a diagram that are causes here.
_NOTED = {UNMEASURED: "unmeasured forces", "delay": "delay", "warning": "poor excitation"}


def witnesses(
    data: Any, band: Any, route: str | None, delays: Mapping[str, int] | None = None
) -> tuple[tuple[Measured, ...], tuple[str, ...]]:
    """Return the response of the data by every route, the usual one first, and why others failed; other data have one response.

    `band`: Hz. `route`: the only one, where asked. `delays`: as in `identify`; those that the usual route finds serve the others, too.
    """
    first = measure(data, band, route=route, delays=delays)
    if first.route is None or route not in (None, "auto"):
        return (first,), ()
    found, failed, seen = [first], [], first.delays or {}
    for other in USUAL:
        if other != first.route:
            try:
                found.append(measure(data, band, route=other, delays=seen))
            except DataError as error:
                failed.append(f"route {other} left out: {error.found}")
    return tuple(found), tuple(failed)


def tasks_of(
    ways: Sequence[Measured], methods: Any, orders: Any
) -> tuple[list[tuple[Measured, Cell]], tuple[str, ...]]:
    """Return the cells to run, each with the data of its route, and notes on what the data do not allow.

    The usual row of a route comes first and has its vote. Of all methods, rows are run in the usual domain of the route where possible.
    """
    tasks: list[tuple[Measured, Cell]] = []
    notes: list[str] = []
    for way in ways:
        cells, more = plan(way.response, methods, orders, records=way.records is not None, route=way.route)
        notes += more
        kept = [c for c in cells if methods != "all" or way.route is None or _at_home(c, cells, way)]
        usual = (way.row, way.domain)
        ordered = kept if way.route is None else sorted(kept, key=lambda c: (c.method.name, c.method.domain) != usual)
        tasks += [(way, cell) for cell in ordered]
    if not tasks:
        raise DataError("a comparison was asked", "no way serves the methods that were named", 'Use methods="all".')
    return tasks, tuple(dict.fromkeys(notes))


def _at_home(cell: Cell, cells: Sequence[Cell], way: Measured) -> bool:
    """Whether a cell stands in the usual domain of its way, or its row has none there."""
    return cell.method.domain == way.domain or all(
        c.method.domain != way.domain for c in cells if c.method.name == cell.method.name
    )


def route_causes(results: Sequence[MethodResult]) -> tuple[tuple[MethodResult, ...], list[Cause]]:
    """Return the results, those that leak or explain too little without a vote, and what makes the ways disagree.

    `results`: of one way or of several.
    """
    if not any(r.route for r in results):
        return tuple(results), []
    half = _narrowest([r for r in results if r.route == "records"]) or _narrowest(results)
    asked = next(r for r in results if r.route)
    causes: dict[str, Cause] = {}
    judged = []
    for r in results:
        leak, blind = _leaks(r, half), _blind(r, asked) if r.exact else None
        if leak:
            causes["leakage"] = Cause("leakage", leak)
        if blind is not None:
            causes.setdefault(f"{blind.name} of {r.route}", blind)
        judged.append(replace(r, exact=r.exact and not leak and blind is None))
        for note in r.diagram.notes if r.diagram is not None and r.route == "records" else ():
            if note.kind in _NOTED:
                causes.setdefault(_NOTED[note.kind], Cause(_NOTED[note.kind], str(note)))
    short = _short(results, half)
    return tuple(judged), [*causes.values(), *([] if short is None else [short])]


def _blind(result: MethodResult, asked: MethodResult) -> Cause | None:
    """Return why a route has no vote beside the usual one: it explains too little, or its orders are too low."""
    if result.route == asked.route or result.fit_error is None or asked.modes is None or not _enough(asked):
        return None
    way = f"route {result.route} by {result.label}"
    if not _enough(result):
        return Cause("poor fit", f"the modes of {way} explain {100 * share_explained(result.fit_error):.0f} %")
    most = 0 if result.diagram is None else max(result.diagram.orders, default=0)
    if most < 2 * len(asked.modes):
        return Cause(
            "too few blocks",
            f"{way} has no order above {most}, and {len(asked.modes)} modes want {2 * len(asked.modes)}",
        )
    return None


def _enough(result: MethodResult) -> bool:
    """Whether the modes of a way explain enough of what was measured."""
    return result.fit_error is not None and explains_enough(result.fit_error)


def _narrowest(results: Sequence[MethodResult]) -> float | None:
    """Return the least half bandwidth of any mode in Hz: the median over the methods of the least of each."""
    each = [
        float(np.min(r.modes.frequencies * r.modes.damping_ratios))
        for r in results
        if r.modes is not None and len(r.modes)
    ]
    return float(np.median(each)) if each else None


def _leaks(result: MethodResult, half: float | None) -> str:
    """Return why the lines of estimated responses are too coarse for the narrowest mode; empty when they are not."""
    if result.route != "frf" or result.diagram is None or half is None:
        return ""
    step = line_step(result.diagram.response)
    windowed = any("window" in step and "no window" not in step for step in result.diagram.response.processing)
    if not step or not windowed or _LINES * step <= half:
        return ""
    return f"segments have lines every {step:.2g} Hz, and the narrowest mode a half bandwidth of {half:.2g} Hz"


def _short(results: Sequence[MethodResult], half: float | None) -> Cause | None:
    durations = [
        max(d) for r in results if r.diagram is not None and (d := getattr(r.diagram.response, "durations", None))
    ]
    if half is None or not durations or 2 * np.pi * half * max(durations) >= _DECAYS:
        return None
    decays = 2 * np.pi * half * max(durations)
    return Cause("too short", f"{max(durations):.3g} s hold {decays:.2g} decay times of the narrowest mode")
