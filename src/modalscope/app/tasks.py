"""Answer questions about a finished analysis: one channel, a file to export, a comparison."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.app.files import FORMATS
from modalscope.data import DataError
from modalscope.io import write

if TYPE_CHECKING:  # what is asked for rarely is loaded then
    from modalscope.app.steps import Stages
    from modalscope.comparing import Comparison

Progress = Callable[[int, int], None]


def channel(stages: Stages, progress: Progress, output: int, column: int) -> bytes:
    """Return one channel, measured and rebuilt, as a blob."""
    return stages.channel(output, column)


def export(stages: Stages, progress: Progress, suffix: str, target: str) -> Path:
    """Write the result in one format, as the command line does.

    `suffix`: one of `FORMATS`. `target`: the file to write.
    """
    result, path = stages.finished(), Path(target)
    if suffix not in FORMATS:
        raise DataError(f"{suffix} was asked", f"there are {', '.join(FORMATS)}", "Choose one of these.")
    if suffix == ".html":
        from modalscope.reporting import report

        return report(result, path)
    write(path, result.analysis if suffix == ".analysis.json" else result)
    return path


def compared(stages: Stages, progress: Progress, methods: list[str] | None = None) -> dict[str, Any]:
    """Return every method on the same data: the verdict, the modes that they agree on, and pictures of where they differ."""
    from modalscope.comparing import compare

    document = stages.finished().analysis
    found = compare(
        stages.data,
        methods or "all",
        orders=document.orders,
        band=_whole(document.bands),
        exclude=document.exclude or None,
        route=document.route,
        progress=progress,
    )
    return compared_view(found)


def _whole(bands: tuple[tuple[float, float], ...]) -> tuple[float, float] | None:
    """Return from where to where bands reach: methods are compared on one."""
    return (min(low for low, _ in bands), max(high for _, high in bands)) if bands else None


def compared_view(found: Comparison) -> dict[str, Any]:
    """Return a comparison as the page shows it."""
    from modalscope import plot
    from modalscope.comparing import CAUSES
    from modalscope.reporting.figures import draw

    ran = sum(r.modes is not None for r in found.results)
    rows = [
        {
            "frequency": group.frequency,
            "damping": group.damping,
            "between": group.frequency_between,
            "found": f"{len(group.members)} of {ran}",
            "trust": trust.grade,
            "why": trust.why,
        }
        for group, trust in zip(found.groups, found.trust, strict=True)
    ]
    methods = [
        {
            "label": r.label,
            "modes": None if r.modes is None else len(r.modes),
            "fit": r.fit_error,
            "failure": r.failure or "",
        }
        for r in found.results
    ]
    pictures = {}
    if len(found.kinship.names) > 1:
        pictures["map"] = draw((8.0, 5.0), lambda f: plot.method_map(found, f.add_subplot())).decode()
    if found.groups:
        pictures["deviations"] = draw(
            (8.0, 5.4), lambda f: plot.deviations(found, tuple(f.subplots(2, 1, sharex=True)))
        ).decode()
    causes = {cause.name: CAUSES[cause.name] for d in found.disagreements for cause in d.causes}
    return {"verdict": found.verdict, "rows": rows, "methods": methods, "pictures": pictures, "causes": causes}


#: What may be asked, by its word.
TASKS: dict[str, Callable[..., Any]] = {"channel": channel, "export": export, "compare": compared}
