"""Repeat an analysis from its document, and check that the data are the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from modalscope.analysis.workflow.analyze import Progress, analyzed
from modalscope.analysis.workflow.sources import are_paths, file_at, opened, source_of_data, source_of_file
from modalscope.data.analysis import SCHEMA, VERSION, Analysis, SourceFile
from modalscope.data.channels import files_of
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.results import Result
from modalscope.data.sameness import log_ratios
from modalscope.io import read
from modalscope.io.analysis import read_analysis
from modalscope.io.beside import confined, named_in
from modalscope.io.formats import is_data
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind
from modalscope.numerics.errors import DataError, printable


@named()
def replay(
    document: Analysis | str | Path,
    data: Any = None,
    *,
    force: bool = False,
    allow_outside: bool = False,
    progress: Progress | None = None,
) -> Result:
    """Repeat an analysis from its document: the same choices on the same data give the same result to the last bit.

    The data file that a document names is opened where its hash is that of the document. A geometry that lies neither beside the document
    nor beside the data, or below their folders, is not read, and a note says so: the document may be a stranger's.

    A document of an earlier layout is repeated by today's rules; a note says so, and which modes of a result it was written with differ.

    Parameters
    ----------
    document : Analysis or path
        The document, `x.analysis.json`, or a result that was written as .json.
    data : path or data object, optional
        The data, if they are not in the file that the document names; the name of a measured test stands for its file.
    force : bool
        Whether to accept data that differ from those that were analysed.
    allow_outside : bool
        Whether to read a geometry wherever the document says that it lies.
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
    >>> response = chain5().impulse_response(150, noise=0.01, seed=0)
    >>> first = analyze(response, method="era")
    >>> again = replay(first.analysis, response)
    >>> bool((again.modes.frequencies == first.modes.frequencies).all())
    True
    """
    place = Path(document) if isinstance(document, str | Path) else None
    if isinstance(document, str | Path):
        document = read_analysis(Path(document))
    check_kind("document", document, Analysis)
    files = document.files or (SourceFile(),)
    given = _named(files, force) if data is None else data
    of_arrays = not any(file.path for file in files)  # and so is their hash
    if of_arrays and are_paths(given) and not force:
        given = [read(file_at(path)) for path in given] if isinstance(given, list | tuple) else read(file_at(given))
    from_files = are_paths(given)
    outside: list[str] = []
    if not allow_outside:
        each = given if isinstance(given, list | tuple) else [given]
        paths = [Path(one) for one in each] if from_files else [path for one in each for path in files_of(one)]
        folders = [path.parent for path in ([place] if place else []) + paths]
        files, outside = confined(files, folders)
    # options of reading apply to files; a data object was read already
    reading = replace(document, files=files).reading if from_files else {}
    response, sources, notes = opened(given, reading, decays=document.route == "auto", exclude=document.exclude)
    if outside and (from_files or not force):
        notes = (*notes, _outside("read" if from_files else "compared", outside))
    if not force:
        check_same(files, sources, given)
    if document.schema == SCHEMA:
        return analyzed(response, document, progress, notes)
    today = analyzed(response, replace(document, schema=SCHEMA, version=VERSION), progress, notes)
    return replace(today, notes=(*today.notes, _by_later_rules(document, _stored(place), today.modes)))


def _named(files: tuple[SourceFile, ...], force: bool) -> list[str]:
    """Return the paths of the data that a document names; a file with another hash than the document's is not even read.

    Raises `DataError`: a path or a hash is missing, or the hash of a file is another.
    """
    if not all(file.path and file.sha256 for file in files):
        lacks = "has no hash of the file" if all(file.path for file in files) else "names no file"
        raise DataError(
            "a replay needs the data of the analysis", f"its document {lacks}", "Give the data: replay(document, data)."
        )
    paths = [file.path for file in files]
    # what is missing or no file of data is refused by the reader, in its words
    if not force and all(is_data(Path(path)) for path in paths):
        check_same(files, tuple(source_of_file(Path(path), {}) for path in paths), None)
    return paths


def _outside(what: str, outside: list[str]) -> Note:
    """Return the note on a geometry that was not read; with data that have it, not compared with theirs."""
    names = ", ".join(printable(Path(name).name[:60]) for name in outside[:2])
    fault = f"Geometry not {what}: {names} lies outside of the folders of the document and of the data"
    return Note("outside", {"files": len(outside)}, f"{fault}; to read it: --allow-outside")


def _stored(place: Path | None) -> ModalModel | None:
    """Return the modes that a document was written with; None where it holds none."""
    found = None if place is None or place.name.endswith(".analysis.json") else read(place)
    modes = found.modes if isinstance(found, Result) else found
    return modes if isinstance(modes, ModalModel) else None


def _by_later_rules(document: Analysis, before: ModalModel | None, now: ModalModel) -> Note:
    """Return the note on a document of an earlier layout: which modes it listed that are not there now, and which are new."""
    text = f"Document of modalscope {document.version}: repeated with later rules for selecting modes"
    if before is None:
        return Note("later rules", {}, text)
    same = log_ratios(before, now) > 0
    gone, new = (
        [f"{f:.5g} Hz" for f in modes.frequencies[~same.any(axis=axis)]] for axis, modes in ((1, before), (0, now))
    )
    told = [f"{what} {', '.join(each)}" for what, each in (("no longer listed:", gone), ("new:", new)) if each]
    numbers = {"gone": len(gone), "new": len(new)}
    return Note("later rules", numbers, f"{text}; {'; '.join(told) or 'the same modes'}")


def check_same(expected: tuple[SourceFile, ...], sources: tuple[SourceFile, ...], data: Any) -> None:
    """Raise `DataError` unless data are those that were analysed, by their hashes.

    The document of an analysis of files has the hashes of these files. A data object that was read from files has another hash, that of its
    arrays. It is accepted if its files have the expected hashes and give the same arrays when they are read again, a geometry apart that
    `expected` does not name.

    Parameters
    ----------
    expected : tuple of SourceFile
        Sources of the analysed data, of the document. Without hashes nothing is compared.
    sources : tuple of SourceFile
        Sources of the data at hand, from `opened`.
    data : data object or paths
        The data at hand, as they were given.

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
        again, files, _ = opened(paths, [file.reading for file in expected])
        whole, _, _ = opened(data, {})
        if not any(named_in(file.reading) for file in expected):
            again, whole = replace(again, geometry=None), replace(whole, geometry=None)
        hash_of_arrays = source_of_data(again).sha256
        if hashes == [file.sha256 for file in files] and hash_of_arrays == source_of_data(whole).sha256 != "":
            return
    raise DataError(
        f"the data of {', '.join(file.path for file in expected if file.path) or 'the analysis'} were expected",
        "these are others: their hash differs from the document's",
        "Give the data that were analysed, or force=True to analyse these.",
    )
