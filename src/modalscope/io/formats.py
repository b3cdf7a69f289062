"""Define the table of formats, and read, survey and write files by their suffix."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory
from typing import Any, get_args

from modalscope.data import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Signals,
    StabilizationDiagram,
    StateSpace,
    StoredSignals,
)
from modalscope.data.analysis import Analysis
from modalscope.data.channels import AUTO, Channels, files_of, input_groups
from modalscope.data.geometry import label_of
from modalscope.data.results import Result
from modalscope.data.shown import summary_of
from modalscope.io.atomic import check_texts, replacing
from modalscope.io.contents import Contents, DataObject, Format, Options, Survey, damage_as_error, unreadable
from modalscope.io.limits import room
from modalscope.io.options import (
    ARRAYS,
    COLUMNS,
    EVERY,
    FIELDS,
    JSON_WRITTEN,
    MESHES,
    RECORDERS,
    SOUND,
    STORED,
    TEXT,
    UNIVERSAL,
    UNIVERSAL_WRITTEN,
    WORKBOOKS,
)
from modalscope.numerics import plugins
from modalscope.numerics.arguments import plainly
from modalscope.numerics.checks import check_kind, check_path
from modalscope.numerics.plugins import WRITINGS, added, names_added


def _of(module: str, name: str) -> Callable[..., Any]:
    """Return a function of a module of this package, which is loaded when a file of its kind is met."""
    return lambda *given: getattr(import_module(f"modalscope.io.{module}"), name)(*given)


def _few_need(name: str) -> Callable[..., Any]:
    """Return a reader that the program registers as plug-ins do: few need it."""
    return lambda *given: added(plugins.READINGS, name)(*given)


_UNIVERSAL = Format(
    "universal file", _of("uff.reader", "read"), _of("uff.writer", "write"), UNIVERSAL, UNIVERSAL_WRITTEN
)
_TEXT = Format("text table", _of("text", "read"), None, TEXT)
_MDF = Format("MDF file", partial(_of("recorders", "read_group"), "asammdf"), None, RECORDERS)
_ACCELEROGRAM = Format("accelerogram", _few_need("accelerogram"), None, COLUMNS)
_HDF5 = Format("HDF5", _of("hdf5", "read"), _of("hdf5", "write"), STORED)

#: Suffix -> format.
FORMATS: dict[str, Format] = {
    ".npz": Format("NumPy archive", _of("npz", "read"), _of("npz", "write"), ARRAYS),
    **dict.fromkeys((".uff", ".unv"), _UNIVERSAL),
    ".json": Format("JSON", _of("json", "read"), _of("json", "write"), write_options=JSON_WRITTEN),
    ".csv": Format("CSV table", _of("csv", "read"), _of("csv", "write"), TEXT),
    **dict.fromkeys((".txt", ".asc", ".tsv", ".dat", ".lvm", ".at2", ".vt2", ".dt2"), _TEXT),
    **dict.fromkeys((".v1", ".v2", ".v3", ".v1c", ".v2c", ".cosmos"), _ACCELEROGRAM),
    **dict.fromkeys((".mseed", ".miniseed", ".msd"), Format("miniSEED file", _few_need("miniseed"), None, COLUMNS)),
    ".sac": Format("SAC file", _few_need("sac"), None, COLUMNS),
    ".smc": replace(_ACCELEROGRAM, reader=_few_need("smc")),
    ".npy": Format("NumPy array", _of("npz", "read_npy"), None, COLUMNS),
    ".parquet": Format("Parquet table", _of("recorders", "read_parquet"), None, RECORDERS),
    ".nc": Format("netCDF file", _of("recorders", "read_netcdf"), None, RECORDERS),
    ".tdms": Format("TDMS file", partial(_of("recorders", "read_group"), "nptdms"), None, RECORDERS),
    **dict.fromkeys((".mf4", ".mdf"), _MDF),
    **dict.fromkeys(MESHES, Format("mesh", _few_need("mesh"))),
    ".wav": Format("sound file", _of("recorders", "read_wav"), None, SOUND),
    ".xlsx": Format("Excel workbook", _of("recorders", "read_excel"), None, WORKBOOKS),
    ".mat": Format("MATLAB file", _of("mat", "read"), _of("mat", "write"), ARRAYS),
    **dict.fromkeys((".h5", ".hdf5"), _HDF5),
    ".zarr": Format("Zarr folder", _of("zarr", "read"), None, STORED, folder=True),
    **dict.fromkeys((".gz", ".zip"), Format("packed file", lambda path, options: _packed(path, options), None, EVERY)),
}


@plainly
def read(path: str | Path, **options: Any) -> DataObject:
    """Read a measurement, modes or a stabilization diagram from a file; the format by suffix.

    Parameters
    ----------
    path : path
        A universal file, `.npz`, `.npy`, `.mat`, `.h5`, `.json`, a folder `.zarr`, a text table (`.csv`, `.txt`, `.asc`,
        `.tsv`, `.dat`, `.lvm`), an accelerogram `.at2`, `.mseed`, `.sac`, `.wav`, and with extras `.xlsx`, `.tdms`, `.mf4`,
        `.nc`, `.parquet` or a mesh (`.msh`, `.vtk`, `.bdf`, `.inp` ...).
    **options
        For every format: `quantity` ("displacement", "velocity", "acceleration"), `sampling_rate`, `kind`, `output_dofs`,
        `input_dofs`, `units`, `geometry` (also a path, or paths of points and lines), `averages`, `added_damping`, `groups` override what
        the file says. Channels that name no node of a given geometry are matched to its nodes by their number (P3: node 3), which a note
        says; `exact_nodes=True` refuses that. `conjugate=True` takes the complex conjugates of responses (time convention exp(-j w t)).

        For tables: `columns="time=1,in=2,out=3-9"` (the roles are time, frequency, in, out, real, imag, mag, phase, coh, ignore; columns
        are numbers from 1, ranges or names), `ignore=[4, "Temp"]`, `units={"Force": "N"}`, `rows="1101-4000"` to take a part,
        `resample=100.0` or "auto" where times are uneven (done by itself where the loss is known and below 3 %),
        `transpose=True` where rows are channels; for text `skip=3` lines at the top, `delimiter=";"`, `decimal=","`; for workbooks and
        recorders' files `sheet="Run 2"`.

        For files of named arrays (.npz, .mat, .h5): `rename={"y": "outputs", "fs": "sampling_rate"}`, name in the file ->
        name of the layout; `axes={"values": "inputs outputs lines"}`, the axes of a stored array when they stand in
        another order or one of length 1 is left out; `ignore=["notes"]`, arrays to leave. For .h5 and .zarr: `stored=True`, the samples
        stay in the file and are read stretch by stretch, also without being asked where they are large for the memory.

        For universal files: `want="frequency response" | "impulse response" | "records" | "modes" | "geometry"` when a file
        holds several, and `repeated="first" | "last"` when a pair of dofs was measured more than once.

    Returns
    -------
    FrequencyResponse, ImpulseResponse, Signals, StoredSignals, ModalModel, Geometry, StateSpace or StabilizationDiagram

    Raises
    ------
    DataError
        No such file, a folder, an unknown suffix or option, a damaged file, NaN, or anything that the data object refuses.

    Examples
    --------
    >>> import tempfile
    >>> from modalscope.io import read, write
    >>> from modalscope.data import Signals
    >>> path = Path(tempfile.mkdtemp()) / "decay.npz"
    >>> write(path, Signals(outputs=[[1.0], [0.5], [0.2]], sampling_rate=50.0))
    >>> read(path, quantity="acceleration").quantities
    ('acceleration',)
    """
    return _contents(check_path(path), options).thing


@plainly
def survey(path: str | Path, **options: Any) -> Survey:
    """Describe what a file holds: every part, read or left and why, and what is missing.

    Parameters
    ----------
    path : path
    **options
        Those of `read`, which returns exactly what is described, and raises the same.
    """
    file = check_path(path)
    contents = _contents(file, options)
    held = {field.name: getattr(contents, field.name) for field in fields(contents)}
    return Survey(path=file, format=format_of(file, "reading").name, **held)


def _contents(path: Path, options: Options) -> Contents:
    try:
        return _whole_contents(path, options)
    except OSError as error:
        fault = f"the system refuses: {(error.strerror or str(error)).lower()}"
        raise unreadable(repr(str(path)), fault, "Check that you may read the file.") from None


def _whole_contents(path: Path, options: Options) -> Contents:
    if path.is_dir() and not (path.suffix.lower() in FORMATS and FORMATS[path.suffix.lower()].folder):
        raise unreadable(repr(str(path)), "that is a folder", _remedy_of_folder(path))
    row = format_of(path, "reading")
    if not path.exists():
        raise unreadable(repr(str(path)), "there is no such file", "Check the name and the folder.")
    check_options(path.name, options, (*row.read_options, *FIELDS, "exact_nodes", "content", "conjugate"), "reading")
    for name in {"rename", "axes"} & set(options):
        _check_names(name, options[name])
    if path.stat().st_size == 0:
        raise unreadable(path.name, "the file is empty", "Copy or write it again.")
    notes: tuple[str, ...] = ()
    if options.get("geometry") is not None:
        options, notes = _of("geometry", "with_geometry")(options, _geometry_in)
    contents = row.reader(path, options)
    whole = replace(contents, thing=overridden(contents.thing, options, path), notes=(*contents.notes, *notes))
    if options.get("geometry") is None:
        return whole
    return _of("geometry", "with_places")(whole, bool(options.get("exact_nodes")))  # type: ignore[no-any-return]


def _remedy_of_folder(path: Path) -> str:
    """Return what to name instead of a folder: its files by their suffixes, or where it has none those of the folders in it."""
    levels = (sorted(path.glob(depth)) for depth in ("[!.]*", "[!.]*/[!.]*"))
    known = ([each for each in level if each.suffix.lower() in FORMATS and is_data(each)] for level in levels)
    files = next(filter(None, known), [])
    patterns = Counter(f"{quote(each.parent.as_posix())}/*{each.suffix}" for each in files)
    if not files:
        return "Name a file; none in it has a suffix that is read."
    named = " or ".join(pattern for pattern, _ in patterns.most_common(_MAX_PATTERNS))
    return f"Name a file in it, such as {quote(files[0].as_posix())}, or several: {named}"


def _packed(path: Path, options: Options) -> Contents:
    """Read the one file that is packed in another, under its own name."""
    with TemporaryDirectory() as folder:
        inside = _of("signatures", "unpacked")(path, Path(folder), room(path.name, path.stat().st_size))
        return _whole_contents(inside, options)


def _units_by_label(thing: DataObject, given: Mapping[str, str]) -> tuple[list[str], list[str]] | None:
    """Return the units of all channels with those given by label, or for all outputs or inputs; None where no channel is named.

    Columns of tables have theirs already, by their number or name.
    """
    if not isinstance(thing, Channels):
        return None
    sides = (list(thing.units[0]), list(thing.units[1]))
    changed = False
    for name, unit in given.items():
        for word, side, dofs in zip(("outputs", "inputs"), sides, (thing.output_dofs, thing.input_dofs), strict=True):
            for i, dof in enumerate(dofs):
                if name == word or dof in (name, label_of(name)):
                    side[i], changed = unit, True
    return sides if changed else None


def overridden(thing: DataObject, options: Options, path: Path | None) -> DataObject:
    """Return the data with the fields that the caller gave, which replace those of the file, and their source."""
    given = {name: options[name] for name in FIELDS if options.get(name) is not None}
    if isinstance(given.get("units"), Mapping):
        units = _units_by_label(thing, given.pop("units"))
        given |= {} if units is None else {"units": units}
    if isinstance(thing, Signals | StoredSignals) and "quantity" in given:
        given["quantities"] = given.pop("quantity")
    if options.get("conjugate") and isinstance(thing, FrequencyResponse):
        thing = replace(thing, values=thing.values.conj()).processed("complex conjugates were taken")
    refused = sorted(set(given) - {field.name for field in fields(thing)})
    refused += ["conjugate"] if options.get("conjugate") and not isinstance(thing, FrequencyResponse) else []
    if refused:
        fault = f"the file gives {summary_of(thing)}, which has no such field"
        raise DataError(f"the options {', '.join(refused)}:", fault, "Leave them out.")
    if isinstance(thing, Channels):
        given |= {} if path is None else {"source_path": path.absolute()}
        if "input_dofs" in given and getattr(thing, "groups", None) == input_groups(thing.input_dofs):
            given.setdefault("groups", AUTO)
    if isinstance(thing, StabilizationDiagram) and path is not None:
        given["response"] = replace(thing.response, source_path=path.absolute())
    return replace(thing, **given) if given else thing


def is_data(path: Path) -> bool:
    """Whether there is a file, or a folder of a format that is one: no device, which may never end, and no folder of anything."""
    row = FORMATS.get(path.suffix.lower())
    try:
        return path.is_file() or (row is not None and row.folder and path.is_dir())
    except (OSError, ValueError):
        return False


def _geometry_in(path: Path) -> DataObject:
    """Return the geometry that a file holds, or data with their own."""
    universal = FORMATS.get(path.suffix.lower()) is _UNIVERSAL
    return _contents(path, {"want": "geometry"} if universal else {}).thing


def format_of(path: Path, doing: str) -> Format:
    """Return the format of a suffix; `doing` it was asked.

    Raises `DataError`: no suffix, or an unknown one.
    """
    suffix = path.suffix.lower()
    row = FORMATS.get(suffix) or _added(suffix)
    if doing == "reading" and path.is_file() and not (row and row.folder):
        told: str = _of("signatures", "told_by_bytes")(path)
        row = FORMATS[told] if _of("signatures", "replaces")(told, suffix, row is not None) else row
    if row is None:
        fault = f"the suffix {path.suffix!r} is unknown" if path.suffix else "it has no suffix"
        known = [name for name, each in FORMATS.items() if doing == "reading" or each.writer]
        known += [f".{name}" for name in names_added(plugins.FORMATS)] if doing == "reading" else [".xlsx"]
        raise DataError(f"{doing} {str(path)!r}:", fault, f"Use one of {', '.join(known)}.")
    return row


def _added(suffix: str) -> Format | None:
    """Return the format that an installed package adds for a suffix: a function of a path that returns data."""
    if suffix.removeprefix(".") not in names_added(plugins.FORMATS):
        return None
    reader = added(plugins.FORMATS, suffix.removeprefix("."))
    package = reader.__module__.partition(".")[0]

    def contents(path: Path, options: Options) -> Contents:
        with damage_as_error(f"{path.name} by {package}", "Write the file again, or update the package.", (Exception,)):
            thing = reader(path)
        check_kind(f"what {package} returns", thing, get_args(DataObject))
        return Contents(thing=thing)

    return Format(f"{suffix} file, read by {package}", contents)


def check_options(name: str, options: Options, known: tuple[str, ...], doing: str) -> None:
    """Raise a `DataError` for an option that a format does not know."""
    unknown = sorted(set(options) - set(known))
    if unknown:
        asked = f"{doing} {name} with {', '.join(unknown)}:"
        raise DataError(asked, f"its options are {', '.join(known) or 'none'}", "Use one of these.")


def _check_names(option: str, given: Any) -> None:
    """Raise unless an option maps names to text, or is None."""
    if given is None or (
        isinstance(given, Mapping) and all(isinstance(text, str) for pair in given.items() for text in pair)
    ):
        return
    remedy = 'Give rename={"y": "outputs"} or axes={"values": "inputs outputs lines"}.'
    raise DataError(f"{option} needs a mapping of names to text", f"it is {given!r}", remedy)


#: Patterns of files that a message names instead of their folder, at most.
_MAX_PATTERNS = 3
#: What can be written, and the suffixes that hold a diagram with its response.
_WRITTEN = (
    *(FrequencyResponse, ImpulseResponse, Signals, ModalModel, Geometry, StateSpace),
    *(StabilizationDiagram, Analysis, Result),
)
_SUFFIXES_OF_DIAGRAMS = (".npz", ".json")


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
        `lines=82 | 2412`. JSON: `method`, `domain`, `orders`, `data`, written with the modes.

    Raises
    ------
    DataError
        An unknown suffix or option, something that the format cannot hold, a place that cannot be written, or the file that the
        data came from.
    """
    file = check_path(path)
    check_kind("what is written", thing, _WRITTEN)
    sources = sources_of(thing)
    if isinstance(thing, Analysis):
        if file.suffix.lower() != ".json":
            asked = f"writing an analysis as {file.suffix or file.name}:"
            raise DataError(asked, "its document is JSON", "End the name in .analysis.json.")
        with replacing(file, sources) as temporary:
            _of("analysis", "write_analysis")(temporary, thing)
        return
    if file.suffix.lower() == ".xlsx":
        check_options(file.name, options, (), "writing")
        with replacing(file, sources) as temporary:
            added(WRITINGS, "xlsx")(temporary, thing)
        return
    if isinstance(thing, Result):
        options = {**options, "result": thing} if file.suffix.lower() == ".json" else options
        thing = thing.modes
    if isinstance(thing, StateSpace):  # of a realized model the matrices alone
        thing = StateSpace(**{field.name: getattr(thing, field.name) for field in fields(StateSpace)})
    row = format_of(file, "writing")
    if isinstance(thing, StabilizationDiagram) and file.suffix.lower() not in _SUFFIXES_OF_DIAGRAMS:
        fault = f"diagrams are written as {' or '.join(_SUFFIXES_OF_DIAGRAMS)}"
        remedy = "Choose one of these suffixes, or write the modes that select(diagram) gives."
        raise DataError(f"writing a stabilization diagram as {file.suffix}:", fault, remedy)
    if row.writer is None:
        raise DataError(f"{file.name} cannot be written", f"a {row.name} can only be read", "Choose another suffix.")
    check_options(file.name, options, row.write_options, "writing")
    check_texts(file.suffix, thing)
    with replacing(file, sources) as temporary:
        row.writer(temporary, thing, options)


def sources_of(thing: Any) -> tuple[Path, ...]:
    """Return the files that data, modes, a diagram, a result or its document came from, as far as they are known."""
    document = thing if isinstance(thing, Analysis) else getattr(thing, "analysis", None)
    parts = (thing, *(getattr(thing, name, None) for name in ("data", "response")))
    paths = (file.path for file in document.files) if isinstance(document, Analysis) else ()
    return (*(path for part in parts for path in files_of(part)), *(Path(path) for path in paths if path))
