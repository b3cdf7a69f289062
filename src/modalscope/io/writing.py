"""Data, modes, diagrams and results into files: what a suffix can hold, and never over the file that the data came from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from modalscope.io.analysis import write_analysis
from modalscope.io.atomic import replacing
from modalscope.io.formats import check_options, format_of
from modalscope.io.texts import check_texts
from modalscope.model import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Signals,
    StabilizationDiagram,
    StateSpace,
)
from modalscope.model.analysis import Analysis
from modalscope.model.checks import check_kind, check_path
from modalscope.model.entries import plainly
from modalscope.model.result import Result
from modalscope.model.sources import files_of

__all__ = ["sources_of", "write"]

#: What can be written, and the suffixes that hold a diagram with its response.
_WRITTEN = (
    FrequencyResponse,
    ImpulseResponse,
    Signals,
    ModalModel,
    Geometry,
    StateSpace,
    StabilizationDiagram,
    Analysis,
    Result,
)
_DIAGRAMS = (".npz", ".json")


@plainly
def write(path: str | Path, thing: Any, **options: Any) -> None:
    """Write data, modes or a stabilization diagram to a file; the format by suffix.

    An earlier file is replaced only when the new one is complete, and never the file that the data came from (`source_path`).

    Parameters
    ----------
    path : path
        `.npz`, `.h5` and `.uff` hold every data object, `.mat` all arrays; `.csv` responses, one run of records, or a table of modes;
        `.json` modes, a result with its analysis, or an analysis; `.npz` and `.json` a stabilization diagram with its response, and a
        state-space model, which `.mat` and `.h5` hold, too.
    thing : FrequencyResponse, ImpulseResponse, Signals, ModalModel, Geometry, StateSpace, StabilizationDiagram, Result or Analysis
        Of a result the modes are written, in JSON with the document of its analysis.
    **options
        Universal files: `text=True` (datasets 58 as text), `dataset=55 | 2414` (modes), `nodes=2411 | 15`,
        `lines=82 | 2412`. JSON: `method`, `domain`, `orders`, `data`, written beside the modes.

    Raises
    ------
    DataError
        An unknown suffix or option, something that the format cannot hold, a place that cannot be written, or the file that the
        data came from.
    """
    file = check_path(path)
    check_kind("what is written", thing, _WRITTEN)
    if isinstance(thing, Analysis):
        _write_analysis(file, thing)
        return
    sources = sources_of(thing)
    if isinstance(thing, Result):
        options = {**options, "result": thing} if file.suffix.lower() == ".json" else options
        thing = thing.modes
    row = format_of(file, "writing")
    if isinstance(thing, StabilizationDiagram) and file.suffix.lower() not in _DIAGRAMS:
        raise DataError(
            f"writing a stabilization diagram as {file.suffix} was asked",
            f"diagrams are written as {' or '.join(_DIAGRAMS)}",
            "Choose one of these suffixes, or write the modes that select(diagram) gives.",
        )
    if row.writer is None:
        raise DataError(f"writing {file.name} was asked", f"a {row.name} is only read", "Choose another suffix.")
    check_options(file, options, row.write_options, "writing")
    check_texts(file.suffix, thing)
    with replacing(file, sources) as temporary:
        row.writer(temporary, thing, options)


def sources_of(thing: Any) -> tuple[Path, ...]:
    """Return the files that data, modes, a diagram, a result or its document came from, as far as they are known.

    Parameters
    ----------
    thing : data object, StabilizationDiagram, Result, Analysis, or what has a response
    """
    document = thing if isinstance(thing, Analysis) else getattr(thing, "analysis", None)
    held = (thing, *(getattr(thing, name, None) for name in ("data", "response")))
    named = (file.path for file in document.files) if isinstance(document, Analysis) else ()
    return (*(path for each in held for path in files_of(each)), *(Path(path) for path in named if path))


def _write_analysis(file: Path, document: Analysis) -> None:
    if file.suffix.lower() != ".json":
        raise DataError(
            f"writing an analysis as {file.suffix or file.name} was asked",
            "its document is JSON",
            "End the name in .analysis.json.",
        )
    with replacing(file, sources_of(document)) as temporary:
        write_analysis(temporary, document)
