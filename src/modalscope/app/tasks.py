"""Answer questions about a finished analysis: one channel, a file to export, a comparison."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.app.files import FORMATS
from modalscope.data import DataError
from modalscope.io import write

if TYPE_CHECKING:
    from modalscope.app.steps import Stages
    from modalscope.comparing import Comparison

Progress = Callable[[int, int], None]


def channel(stages: Stages, progress: Progress, output: int, column: int) -> bytes:
    """Return one channel, measured and rebuilt, as a blob."""
    return stages.channel(output, column)


def export(stages: Stages, progress: Progress, suffix: str, target: str) -> Path:
    """Write the result in one of `FORMATS`, as the command line does, to the file `target`."""
    result, path = stages.finished(), Path(target)
    if suffix not in FORMATS:
        raise DataError(f"{suffix} was asked", f"the formats are {', '.join(FORMATS)}", "Choose one of these.")
    if suffix == ".html":
        from modalscope.reporting import report

        return report(result, path)
    write(path, result.analysis if suffix == ".analysis.json" else result)
    return path


def compared(stages: Stages, progress: Progress, methods: list[str] | None = None) -> dict[str, Any]:
    """Return the comparison of all methods: verdict, consensus modes, and pictures of the differences."""
    from modalscope.comparing import compare

    document = stages.finished().analysis
    choices: dict[str, Any] = {"orders": document.orders, "exclude": document.exclude or None, "route": document.route}
    if document.bands:  # methods are compared on one band
        choices["band"] = min(low for low, _ in document.bands), max(high for _, high in document.bands)
    return compared_view(compare(stages.data, methods or "all", progress=progress, **choices))


def compared_view(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as the page shows it."""
    from modalscope import plot
    from modalscope.comparing import CAUSES
    from modalscope.reporting.figures import draw

    ran = sum(r.modes is not None for r in comparison.results)
    rows = [
        {
            "frequency": group.frequency,
            "damping": group.damping,
            "between": group.frequency_between,
            "found": f"{len(group.members)} of {ran}",
            "trust": trust.grade,
            "why": trust.why,
        }
        for group, trust in zip(comparison.groups, comparison.trust, strict=True)
    ]
    methods = [
        {
            "label": r.label,
            "modes": None if r.modes is None else len(r.modes),
            "fit": r.fit_error,
            "failure": r.failure or "",
        }
        for r in comparison.results
    ]
    pictures = {}
    if len(comparison.kinship.names) > 1:
        pictures["map"] = draw((8.0, 5.0), lambda f: plot.method_map(comparison, f.add_subplot())).decode()
    if comparison.groups:
        pictures["deviations"] = draw(
            (8.0, 5.4), lambda f: plot.deviations(comparison, tuple(f.subplots(2, 1, sharex=True)))
        ).decode()
    causes = {cause.name: CAUSES[cause.name] for d in comparison.disagreements for cause in d.causes}
    return {"verdict": comparison.verdict, "rows": rows, "methods": methods, "pictures": pictures, "causes": causes}


#: The questions of the page by name.
TASKS: dict[str, Callable[..., Any]] = {"channel": channel, "export": export, "compare": compared}
