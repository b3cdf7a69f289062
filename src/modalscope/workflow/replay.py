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
    """Repeat an analysis from its document: the same choices on the same data give the same result to the last bit.

    Parameters
    ----------
    document : Analysis or path
        The document, `x.analysis.json`, or a result that was written as .json.
    data : path or data object, optional
        The data, if they are not in the file that the document names.
    force : bool
        Whether to accept data that differ from those that were analysed.
    progress : callable, optional
        Called with (orders done, orders in all).

    Raises
    ------
    DataError
        A file that is missing or has changed, a document that names no file and no data, a document that cannot be read.

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
        raise DataError("a replay needs the data of the analysis", have, change)
    # options of reading apply to files; a data object was read already
    reading = document.reading if data is None or are_paths(data) else {}
    given = [file.path for file in files] if data is None else data
    response, sources, notes = opened(given, reading, decays=document.route == "auto")
    if not force:
        check_same(files, sources, response)
    return analyzed(response, document, progress, notes)


def check_same(expected: tuple[SourceFile, ...], sources: tuple[SourceFile, ...], data: Any) -> None:
    """Raise `DataError` unless data are those that were analysed, by their hashes.

    The document of an analysis of files has the hashes of these files. A data object that was read from files has another hash, that of its
    arrays. It is accepted if its files have the expected hashes and give the same arrays when they are read again.

    Parameters
    ----------
    expected : tuple of SourceFile
        Sources of the analysed data, of the document. Without hashes nothing is compared.
    sources : tuple of SourceFile
        Sources of the data at hand, from `opened`.
    data : data object
        The data at hand.

    Raises
    ------
    DataError
        A hash differs.
    """
    hashes = [file.sha256 for file in expected]
    if not all(hashes) or hashes == [file.sha256 for file in sources]:
        return
    paths = files_of(data)
    object_for_files = all(file.path for file in expected) and not any(file.path for file in sources)
    if object_for_files and len(paths) == len(expected) and all(path.exists() for path in paths):
        arrays, files, _ = opened(paths, [file.reading for file in expected])
        hash_of_arrays = source_of_data(arrays).sha256
        if hashes == [file.sha256 for file in files] and hash_of_arrays and hash_of_arrays == sources[0].sha256:
            return
    raise DataError(
        f"the data of {', '.join(file.path for file in expected if file.path) or 'the analysis'} were expected",
        "these are others: their hash differs from the document's",
        "Give the data that were analysed, or say force=True (a result of other data is another result).",
    )
