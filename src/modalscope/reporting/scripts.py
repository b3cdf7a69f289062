"""The scripts that repeat what a report shows."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from modalscope.comparing import Comparison
from modalscope.identification.identify import Identification
from modalscope.model import FrequencyResponse, StabilizationDiagram
from modalscope.model.response import Response

__all__ = ["comparison_script", "identification_script", "stabilization_script"]


def stabilization_script(diagram: StabilizationDiagram, source: str | None) -> str:
    """Return the script that repeats a stabilization diagram and the selection from it."""
    lines = [
        f"    method={diagram.method!r},\n",
        f"    domain={diagram.domain!r},\n",
        f"    orders={_orders(diagram.orders)},\n",
        *_band(diagram.response),
        *_options(diagram.settings),
    ]
    if diagram.tolerances:
        lines.append(f"    tolerances={ {name: float(limit) for name, limit in diagram.tolerances.items()}!r},\n")
    after = 'modes = ms.select(diagram)\nprint(modes.table())\nms.report((modes, diagram), "report.html")\n'
    return _call("diagram", "stabilize", source, lines) + after


def identification_script(found: Identification, source: str | None) -> str:
    """Return the script that repeats an identification at one order."""
    lines = [
        f"    method={found.method!r},\n",
        f"    domain={found.domain!r},\n",
        f"    order={int(found.order)},\n",
        *_band(found.response),
        *_options(found.settings),
    ]
    after = 'print(found.modes.table())\nms.report(found, "report.html")\n'
    return _call("found", "identify", source, lines) + after


def comparison_script(c: Comparison, source: str | None) -> str:
    """Return the script that repeats a comparison."""
    given = {k: v for k, v in c.settings.items() if v is not None and k != "methods"}
    lines = [f"    methods={c.settings.get('methods', 'all')!r},\n", *_options(given, (str, int, float, tuple, list))]
    after = 'print(comparison.table())\nms.report(comparison, "report.html")\n'
    return _call("comparison", "compare", source, lines) + after


def _call(name: str, verb: str, source: str | None, lines: list[str]) -> str:
    head = f"import modalscope as ms\n\ndata = ms.read({source or 'your file'!r})\n"
    return f"{head}{name} = ms.{verb}(\n    data,\n{''.join(lines)})\n"


def _band(response: Response) -> list[str]:
    """Return the band of lines as an argument; samples were filtered before, and do not tell theirs."""
    if not isinstance(response, FrequencyResponse):
        return []
    f = response.frequencies
    return [f"    band=({float(f[0])!r}, {float(f[-1])!r}),\n"]


def _options(settings: Mapping[str, Any], plain: tuple[type, ...] = (str, int, float, bool)) -> list[str]:
    """Return options as arguments, and a comment on those that cannot be written down as they stand."""
    kept = {key: found for key, found in settings.items() if found is not None}
    lost = [k for k, v in kept.items() if not isinstance(v, plain) or (k == "weights" and v == "given")]
    lines = [f"    {key}={found!r},\n" for key, found in kept.items() if key not in lost]
    return [*lines, f"    # and as they were given: {', '.join(lost)}\n"] if lost else lines


def _orders(orders: tuple[int, ...]) -> str:
    steps = {b - a for a, b in pairwise(orders)}
    if len(steps) == 1:
        return f"range({orders[0]}, {orders[-1] + 1}, {int(steps.pop())})"
    return repr(tuple(int(order) for order in orders))
