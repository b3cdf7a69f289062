"""Repeat an analysis from its document, and check that the data are the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from modalscope.data.analysis import Analysis, SourceFile
from modalscope.data.channels import files_of
from modalscope.data.results import Result
from modalscope.io.analysis import read_analysis
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind
from modalscope.numerics.errors import DataError
from modalscope.workflow.analyze import Progress, analyzed
from modalscope.workflow.sources import are_paths, opened, source_of_data


@named()
def replay(
    document: Analysis | str | Path, data: Any = None, *, force: bool = False, progress: Progress | None = None
) -> Result:
    """Repeat an analysis: the same choices on the same data give the same result to the last bit.

    Parameters
    ----------
    document : Analysis or path
        The document, `x.analysis.json`, or a result that was written as .json.
    data : path or data object, optional
        In place of the file that the document names.
    force : bool
        Whether other data may take the place of those that were analysed.
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
    files = document.files or (SourceFile(),)
    if data is None and not all(file.path for file in files):
        have, change = "its document names no file", "Give the data: replay(document, data)."
        raise DataError("a replay of an analysis was asked", have, change)
    given = [file.path for file in files] if data is None else data
    opened_data, sources, notes = opened(given, document.reading if data is None or are_paths(data) else {})
    if not force:
        check_same(files, sources, opened_data)
    return analyzed(opened_data, document, progress, notes)


def check_same(known: tuple[SourceFile, ...], sources: tuple[SourceFile, ...], thing: Any) -> None:
    """Raise `DataError` when the hash of data `thing` (`sources`) is not that of the analysed data (`known`).

    Where only the hash of files is known, data that were read from files are compared by these.
    """
    hashes = [file.sha256 for file in known]
    if not all(hashes) or hashes == [file.sha256 for file in sources]:
        return
    came_from = files_of(thing)
    named = all(file.path for file in known) and not any(file.path for file in sources)
    if named and len(came_from) == len(known) and all(path.exists() for path in came_from):
        read_again, of_files, _ = opened(came_from, [file.reading for file in known])
        again = source_of_data(read_again).sha256
        if hashes == [file.sha256 for file in of_files] and again and again == sources[0].sha256:
            return
    raise DataError(
        f"the data of {', '.join(file.path for file in known if file.path) or 'the analysis'} were expected",
        "these are others: their hash differs from the document's",
        "Give the data that were analysed, or say force=True (a result of other data is another result).",
    )
