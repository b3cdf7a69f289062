"""The scripts that repeat what a report shows."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.comparing import Comparison
from modalscope.identification.identify import Identification
from modalscope.model import StabilizationDiagram
from modalscope.model.result import Result
from modalscope.model.settings import Settings

__all__ = ["comparison_script", "identification_script", "result_script", "stabilization_script"]


def stabilization_script(diagram: StabilizationDiagram, source: str | None) -> str:
    """Return the script that repeats a stabilization diagram and the selection from it."""
    lines = [
        f"    method={diagram.method!r},\n",
        f"    domain={diagram.domain!r},\n",
        f"    orders={_orders(diagram.asked_orders or diagram.orders)},\n",
        *_options(diagram.settings),
    ]
    if diagram.tolerances:
        lines.append(f"    tolerances={ {name: float(limit) for name, limit in diagram.tolerances.items()}!r},\n")
    after = 'modes = ms.select(diagram)\nprint(modes.table())\nms.report((modes, diagram), "report.html")\n'
    return _call("diagram", "stabilize", source, lines) + after


def result_script(result: Result) -> str:
    """Return the script that repeats a whole analysis."""
    document = result.analysis
    paths = [file.path for file in document.files if file.path]
    reading = {"reading": document.reading} if document.reading else {}
    lines = _options(reading | document.choices())
    arrays = "import numpy as np\n\n" if any("np." in line for line in lines) else ""
    source = repr(paths if len(paths) > 1 else paths[0]) + "," if paths else "data,  # which came from no file"
    head = f"{arrays}import modalscope as ms\n\nresult = ms.analyze(\n    {source}\n"
    return f"{head}{''.join(lines)})\n" + 'print(result.modes.table())\nms.report(result, "report.html")\n'


def identification_script(found: Identification, source: str | None) -> str:
    """Return the script that repeats an identification at one order."""
    lines = [
        f"    method={found.method!r},\n",
        f"    domain={found.domain!r},\n",
        f"    order={int(found.order)},\n",
        *_options(found.settings),
    ]
    after = 'print(found.modes.table())\nms.report(found, "report.html")\n'
    return _call("found", "identify", source, lines) + after


def comparison_script(c: Comparison, source: str | None) -> str:
    """Return the script that repeats a comparison."""
    lines = _options({name: value for name, value in c.settings.items() if value is not None})
    after = 'print(comparison.table())\nms.report(comparison, "report.html")\n'
    return _call("comparison", "compare", source, lines) + after


def _call(name: str, verb: str, source: str | None, lines: list[str]) -> str:
    arrays = "import numpy as np\n\n" if any("np." in line for line in lines) else ""
    head = f"{arrays}import modalscope as ms\n\ndata = ms.read({source or 'your file'!r})\n"
    return f"{head}{name} = ms.{verb}(\n    data,\n{''.join(lines)})\n"


def _options(settings: Settings | Mapping[str, Any]) -> list[str]:
    """Return options as arguments, each as Python writes it: the script gives the same result to the last bit."""
    return [f"    {name}={_literal(value)},\n" for name, value in settings.items()]


def _literal(value: Any) -> str:
    """Return what Python reads back as the same value; numbers keep all their digits."""
    if isinstance(value, np.ndarray):
        return f"np.array({value.tolist()!r})"
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_literal(item)}" for key, item in value.items()) + "}"
    if isinstance(value, tuple | list):
        parts = ", ".join(_literal(part) for part in value)
        return f"[{parts}]" if isinstance(value, list) else f"({parts}{',' if len(value) == 1 else ''})"
    return repr(value)


def _orders(orders: tuple[int, ...]) -> str:
    steps = {b - a for a, b in pairwise(orders)}
    if len(steps) == 1:
        return f"range({orders[0]}, {orders[-1] + 1}, {int(steps.pop())})"
    return repr(tuple(int(order) for order in orders))
