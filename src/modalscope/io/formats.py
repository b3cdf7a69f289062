"""The table of formats: suffix -> how it is read and written. A new format is one module and one row here."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from modalscope.io import csv, csv_writer, hdf5, json, mat, npz, uff
from modalscope.io.analysis import write_analysis
from modalscope.io.atomic import replacing
from modalscope.io.contents import Contents, Format, Options, Survey, Thing, describe
from modalscope.io.from_arrays import ARRAY_OPTIONS, FIELD_OPTIONS
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
from modalscope.model.channels import Channels
from modalscope.model.checks import check_kind, check_path
from modalscope.model.entries import plainly
from modalscope.model.groups import AUTO, input_groups
from modalscope.model.result import Result

__all__ = ["FORMATS", "read", "sources_of", "survey", "write"]

_UNIVERSAL = Format(
    name="universal file",
    reader=uff.read,
    writer=uff.write,
    read_options=uff.READ_OPTIONS,
    write_options=uff.WRITE_OPTIONS,
)
_HDF5 = Format(name="HDF5", reader=hdf5.read, writer=hdf5.write, read_options=ARRAY_OPTIONS)

#: Suffix -> format.
FORMATS: dict[str, Format] = {
    ".npz": Format(name="NumPy archive", reader=npz.read, writer=npz.write, read_options=ARRAY_OPTIONS),
    ".uff": _UNIVERSAL,
    ".unv": _UNIVERSAL,
    ".json": Format(name="JSON", reader=json.read, writer=json.write, write_options=json.WRITE_OPTIONS),
    ".csv": Format(name="CSV table", reader=csv.read, writer=csv_writer.write),
    ".mat": Format(name="MATLAB file", reader=mat.read, writer=mat.write, read_options=ARRAY_OPTIONS),
    ".h5": _HDF5,
    ".hdf5": _HDF5,
}


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
def read(path: str | Path, **options: Any) -> Thing:
    """Read a measurement, modes or a stabilization diagram from a file; the format by suffix.

    Parameters
    ----------
    path : path
        `.npz`, `.uff`, `.unv`, `.mat`, `.h5`, `.hdf5`, `.csv` or `.json`.
    **options
        For every format: `quantity` ("displacement", "velocity", "acceleration"), `sampling_rate`, `kind`, `output_dofs`,
        `input_dofs`, `units`, `geometry`, `averages`, `added_damping`, `groups` override what the file says.

        For files of named arrays (.npz, .mat, .h5): `rename={"y": "outputs", "fs": "sampling_rate"}`, name in the file ->
        name of the layout; `axes={"values": "inputs outputs lines"}`, the axes of a stored array when they stand in
        another order or one of length 1 is left out; `ignore=["notes"]`, arrays to leave.

        For universal files: `want="frequency response" | "impulse response" | "records" | "modes" | "geometry"` when a file
        holds several, and `repeated="first" | "last"` when a pair of dofs was measured more than once.

    Returns
    -------
    FrequencyResponse, ImpulseResponse, Signals, ModalModel, Geometry, StateSpace or StabilizationDiagram

    Raises
    ------
    DataError
        No such file, a folder, an unknown suffix or option, a damaged file, NaN, or anything that the data object refuses.

    Examples
    --------
    >>> import tempfile
    >>> from modalscope.io import read, write
    >>> path = Path(tempfile.mkdtemp()) / "decay.npz"
    >>> write(path, Signals(outputs=[[1.0], [0.5], [0.2]], sampling_rate=50.0))
    >>> read(path, quantity="acceleration").quantities
    ('acceleration',)
    """
    return _contents(check_path(path), options).thing


@plainly
def survey(path: str | Path, **options: Any) -> Survey:
    """Tell what a file holds: every part, taken or left and why, and what is missing.

    Parameters
    ----------
    path : path
    **options
        Those of `read`, which returns exactly what is told here.

    Raises
    ------
    DataError
        As `read`.
    """
    file = check_path(path)
    contents = _contents(file, options)
    return Survey(
        path=file,
        format=FORMATS[file.suffix.lower()].name,
        result=describe(contents.thing),
        thing=contents.thing,
        found=contents.findings,
        missing=contents.missing,
        notes=contents.notes,
    )


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
    row = _format(file, "writing")
    if isinstance(thing, StabilizationDiagram) and file.suffix.lower() not in _DIAGRAMS:
        raise DataError(
            f"writing a stabilization diagram as {file.suffix} was asked",
            f"diagrams are written as {' or '.join(_DIAGRAMS)}",
            "Choose one of these suffixes, or write the modes that select(diagram) gives.",
        )
    if row.writer is None:
        raise DataError(f"writing {file.name} was asked", f"a {row.name} is only read", "Choose another suffix.")
    _check_options(file, options, row.write_options, "writing")
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
    found = (getattr(each, "source_path", None) for each in held)
    return (*(path for path in found if isinstance(path, Path)), *(Path(path) for path in named if path))


def _write_analysis(file: Path, document: Analysis) -> None:
    if file.suffix.lower() != ".json":
        raise DataError(
            f"writing an analysis as {file.suffix or file.name} was asked",
            "its document is JSON",
            "End the name in .analysis.json.",
        )
    with replacing(file, sources_of(document)) as temporary:
        write_analysis(temporary, document)


def _contents(path: Path, options: Options) -> Contents:
    if path.is_dir():
        raise DataError(f"reading {str(path)!r} was asked", "that is a folder", "Name a file in it.")
    row = _format(path, "reading")
    if not path.exists():
        raise DataError(f"reading {str(path)!r} was asked", "there is no such file", "Check the name and the folder.")
    if row.reader is None:
        raise DataError(
            f"reading {path.name} was asked", f"a {row.name} is only written", "Give the file that it was made from."
        )
    _check_options(path, options, (*row.read_options, *FIELD_OPTIONS), "reading")
    try:
        if path.stat().st_size == 0:
            raise DataError(f"reading {path.name} was asked", "the file is empty", "Copy or write it again.")
        contents = row.reader(path, options)
    except OSError as error:
        found = f"the system refuses: {(error.strerror or str(error)).lower()}"
        raise DataError(f"reading {str(path)!r} was asked", found, "Check that you may read the file.") from None
    return replace(contents, thing=_overridden(contents.thing, options, path))


def _format(path: Path, doing: str) -> Format:
    row = FORMATS.get(path.suffix.lower())
    if row is None:
        suffix = f"the suffix {path.suffix!r} is unknown" if path.suffix else "it has no suffix"
        raise DataError(f"{doing} {str(path)!r} was asked", suffix, f"Use one of {', '.join(FORMATS)}.")
    return row


def _check_options(path: Path, options: Options, known: tuple[str, ...], doing: str) -> None:
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise DataError(
            f"{doing} {path.name} with {', '.join(unknown)} was asked",
            f"its options are {', '.join(known) or 'none'}",
            "Use one of these.",
        )


def _overridden(thing: Thing, options: Options, path: Path) -> Thing:
    """Return the data with the fields that the caller gave, which named arrays have used already, and where they came from."""
    given = {name: options[name] for name in FIELD_OPTIONS if options.get(name) is not None}
    if isinstance(thing, Signals) and "quantity" in given:
        given["quantities"] = given.pop("quantity")
    refused = sorted(set(given) - {field.name for field in fields(thing)})
    if refused:
        raise DataError(
            f"the options {', '.join(refused)} were asked",
            f"the file gives {describe(thing)}, which has no such field",
            "Leave them out.",
        )
    if isinstance(thing, Channels):
        given["source_path"] = path.absolute()
        if "input_dofs" in given and getattr(thing, "groups", None) == input_groups(thing.input_dofs):
            given.setdefault("groups", AUTO)
    if isinstance(thing, StabilizationDiagram):
        given["response"] = replace(thing.response, source_path=path.absolute())
    return replace(thing, **given) if given else thing
