"""The same analysis again, from its document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from modalscope.io.analysis import read_analysis
from modalscope.model.analysis import Analysis, SourceFile
from modalscope.model.checks import DataError
from modalscope.model.keywords import named
from modalscope.model.kinds import check_kind
from modalscope.model.result import Result
from modalscope.workflow.analyze import Progress, analyzed
from modalscope.workflow.sources import opened, source_of_data

__all__ = ["replay"]


@named()
def replay(
    document: Analysis | str | Path, data: Any = None, *, force: bool = False, progress: Progress | None = None
) -> Result:
    """Do an analysis again: the same choices on the same data give the same result to the last bit.

    Parameters
    ----------
    document : Analysis or path
        The document, `x.analysis.json`, or a result that was written as .json.
    data : path or data object, optional
        Instead of the file that the document names.
    force : bool
        Whether data that have changed since may take the place of those that were analysed.
    progress : callable, optional
        Called with (orders done, orders in all).

    Raises
    ------
    DataError
        A file that is not there or has changed, data that are needed and not given, a document that cannot be read.

    Examples
    --------
    >>> from modalscope import analyze
    >>> from modalscope.systems import chain5
    >>> response = chain5().impulse_response(300, noise=0.01, seed=0)
    >>> first = analyze(response, method="era")
    >>> again = replay(first.analysis, response)
    >>> bool((again.modes.frequencies == first.modes.frequencies).all())
    True
    """
    if isinstance(document, str | Path):
        document = read_analysis(Path(document))
    check_kind("document", document, Analysis)
    known = document.files[0] if document.files else SourceFile()
    if data is None and not known.path:
        raise DataError(
            "an analysis was to be done again",
            "its data came from no file",
            "Give the data: replay(document, data).",
        )
    thing, source, told = opened(known.path if data is None else data, known.reading if _is_path(data) else {})
    if not force:
        _check_same(known, source, thing)
    return analyzed(thing, document, progress, told)


def _is_path(data: Any) -> bool:
    return data is None or isinstance(data, str | Path)


def _check_same(known: SourceFile, source: SourceFile, thing: Any) -> None:
    """Raise when data are not those that were analysed, by their hash; where only a file's is known, by that of the data's own file."""
    if not known.sha256 or known.sha256 == source.sha256:
        return
    came_from = getattr(thing, "source_path", None)
    if known.path and not source.path and came_from is not None and Path(came_from).exists():
        read_again, of_file, _ = opened(Path(came_from), known.reading)
        if of_file.sha256 == known.sha256 and source.sha256 == source_of_data(read_again).sha256:
            return
    raise DataError(
        f"the data of {known.path or 'the analysis'} were expected",
        "these are others: their hash differs from the document's",
        "Give the data that were analysed, or say force=True (a result of other data is another result).",
    )
