"""Read files of recorders and workbooks: TDMS, MDF 3 and 4, netCDF, Parquet and Excel by optional packages, and sound files.

Each reader returns columns, units and rate; `columns` makes data of them. npTDMS and asammdf are under the LGPL.
"""

from __future__ import annotations

import re
import warnings
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options, chosen, damage_as_error, unreadable
from modalscope.io.foreign import FILTERS_OF_WARNINGS, read_apart
from modalscope.io.frames import Variables, table_of_frame, table_of_variables
from modalscope.io.limits import Room, room
from modalscope.io.loose import refuse_modes
from modalscope.io.text import contents_of_lines
from modalscope.io.text.cells import is_value
from modalscope.numerics.errors import optional_package

#: Part of a step by which starts may differ from whole ones in silence.
_MAX_ODD = 0.02
_EXPORT = "Export it again, or as text (.csv)."
#: A sheet is a table where at least so many of its first rows hold nothing but values.
_ROWS_EXAMINED, _MIN_ROWS_OF_VALUES = 200, 3
#: Workbooks that are read in this process, for one of its own costs a quarter of a second: bytes packed in them, and these for every sheet
#: (all may be one part); characters of a text, since patterns of openpyxl may take the square of them.
_MAX_PACKED_HERE, _MAX_WORK_HERE, _MAX_TEXT_HERE = 1_000_000, 5_000_000, 500
#: XML that may become more than it is: entities, and encodings in which they are not seen.
_MAY_GROW = re.compile(rb"\0|<!(?!--|\[CDATA)|encoding=.(?!utf-8|us-ascii)", re.IGNORECASE)


def read_group(package: str, path: Path, options: Options) -> Contents:
    """Read one group of channels of a recorder's file: their clock or increment, and their units.

    `package`: "nptdms" for TDMS files of LabVIEW, "asammdf" for MDF files of vehicles.

    Raises `DataError`: the package is missing, a damaged file, several groups and no `sheet`, or what tables are refused for.
    """
    answer, arrays = read_apart(package, path, str(options.get("sheet") or ""))
    name = chosen(path.name, "groups", answer["groups"], answer["tables"], options)
    columns = tuple(
        Column(number=k, values=values, **column)
        for k, (column, values) in enumerate(zip(answer.get("columns", ()), arrays, strict=True), 1)
    )
    shorter, steps = answer.get("shorter", ()), answer.get("steps", ())
    notes = [f"channels of other lengths, ignored: {', '.join(shorter[:6])}"] if shorter else []
    if len(steps) == 1 and max(answer.get("late", ()), default=0.0) * 2 > steps[0]:
        columns, said = _from_the_last_start(columns, answer["late"], steps[0])
        notes.append(said)
    table = Table(
        where=path.name,
        columns=columns,
        rate=1 / steps[0] if len(steps) == 1 else None,
        rate_from="wf_increment",
        notes=tuple(notes),
        layout=(("group", name),),
        begins=answer.get("start", 0.0),
    )
    return contents_from_table(table, options)


def _from_the_last_start(
    columns: Sequence[Column], late: Sequence[float], step: float
) -> tuple[tuple[Column, ...], str]:
    """Return channels from the start of the last one on, and what is said; as they stand where they would have nothing in common.

    `late`: by how much each starts behind the first, s. `step`: between samples, s.
    """
    skipped = [round((max(late) - each) / step) for each in late]
    rows = min(len(c.values) - skip for c, skip in zip(columns, skipped, strict=True))
    first, last = (columns[f(range(len(late)), key=late.__getitem__)].label for f in (min, max))
    said = f"start times differ: {last} begins {max(late):.6g} s after {first}"
    if rows < 2:
        return tuple(columns), f"{said}: channels have no samples in common, and are taken as if they began together"
    cut = tuple(replace(c, values=c.values[skip : skip + rows]) for c, skip in zip(columns, skipped, strict=True))
    odd = max(abs((max(late) - each) / step - skip) for each, skip in zip(late, skipped, strict=True))
    rest = f", to {odd:.2g} of a step" if odd > _MAX_ODD else ""
    return cut, f"{said}: each is taken from there on{rest}"


def read_netcdf(path: Path, options: Options) -> Contents:
    """Read a netCDF file: the variables along time or frequency.

    Raises `DataError`: xarray is missing, a damaged file, no common dimension, or what tables are refused for.
    """
    answer, arrays = read_apart("xarray", path)
    named = zip(answer["variables"], arrays, strict=True)
    variables: Variables = {each["name"]: (tuple(each["dims"]), array, each["unit"]) for each, array in named}
    refuse_modes(path.name, variables)
    coords = {name: variables.pop(name) for name in answer["coords"]}
    return contents_from_table(table_of_variables(path.name, variables, coords, answer["numbers"]), options)


def read_parquet(path: Path, options: Options) -> Contents:
    """Read a Parquet file of columns.

    Raises `DataError`: pandas or pyarrow are missing, a damaged file, or what tables are refused for.
    """
    parquet = optional_package("reading .parquet", "pyarrow.parquet", "parquet", "pyarrow")
    pandas = optional_package("reading .parquet", "pandas", "parquet")
    space = room(path.name, path.stat().st_size)
    with damage_as_error(f"{path.name} with pyarrow", _EXPORT):
        head = parquet.read_metadata(path)
        space.take("its columns", 16 * head.num_rows * head.num_columns)
        table = table_of_frame(pandas.read_parquet(path), path.name)
    return contents_from_table(table, options)


def read_excel(path: Path, options: Options) -> Contents:
    """Read a sheet of a workbook (options `sheet`, and those of text tables).

    Raises `DataError`: openpyxl is missing, no workbook, several sheets that are tables and no `sheet`, or what tables are refused for.
    """
    space = room(path.name, path.stat().st_size)
    names, read = sheets(path, space, options)
    tables = [name for name in names if _is_table(read.get(name, ()))]
    name = chosen(path.name, "sheets", names, tables, options)
    lines = ((number, text) for number, text in read[name] if number > int(options.get("skip") or 0))
    others = [other for other in names if other != name]
    notes = (f"using sheet {name!r}; ignored: {', '.join(others[:6])}",) if others else ()
    return contents_of_lines(path.name, lines, ("\t", None), space, options, notes)


def rows_of_workbook(path: Path) -> list[tuple[int, str]]:
    """Return the rows of the first sheet of cells with their numbers, cells separated by tabs; none where all sheets are charts."""
    _, read = sheets(path, room(path.name, path.stat().st_size), {})
    return next(iter(read.values()), [])


def sheets(path: Path, space: Room, options: Options) -> tuple[list[str], dict[str, list[tuple[int, str]]]]:
    """Return the names of all sheets, and of the one asked for, or of all, numbers and texts of the rows that are not empty."""
    soon = False
    with damage_as_error(f"{path.name} as an Excel workbook", "Save it again as .xlsx, or as text (.csv)."):
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:  # a cell becomes an object as its text does
                space.take("what is packed in it", sum(member.file_size for member in archive.infolist()))
                soon = _ends_soon(archive)
    answer, arrays = read_apart("openpyxl", path, str(options.get("sheet") or ""), here=soon)
    texts = (text.tobytes().decode().split("\n") for text in arrays[1::2])
    rows = (list(zip(numbers.tolist(), lines, strict=False)) for numbers, lines in zip(arrays[::2], texts, strict=True))
    return answer["sheets"], dict(zip(answer["read"], rows, strict=True))


def _ends_soon(archive: zipfile.ZipFile) -> bool:
    """Whether a workbook is read within seconds and little memory, whatever stands in it: short texts of XML without entities."""
    members = archive.infolist()
    packed = sum(member.file_size for member in members)
    if packed > _MAX_PACKED_HERE:
        return False
    texts = [archive.read(member) for member in members]
    many = packed * sum(text.count(b"sheetId") for text in texts) > _MAX_WORK_HERE
    return not many and not any(
        _MAY_GROW.search(text)
        or text.lstrip(b"\xef\xbb\xbf")[:1] != b"<"
        or max(map(len, re.split(rb"[<>\"]", text))) > _MAX_TEXT_HERE
        for text in texts
    )


def _is_table(lines: Sequence[tuple[int, str]]) -> bool:
    rows = (text.split("\t") for _, text in lines[:_ROWS_EXAMINED])
    return sum(any(cell for cell in row) and all(map(is_value, row)) for row in rows) >= _MIN_ROWS_OF_VALUES


def read_wav(path: Path, options: Options) -> Contents:
    """Read a sound file; samples of 8, 16, 24 or 32 bits are divided by the full scale, those of floating point read as they are.

    Raises `DataError`: a file that is compressed, cut off or empty.
    """
    from scipy.io import wavfile

    space = room(path.name, path.stat().st_size)
    space.take("its samples", 4 * space.size)  # a sample of two bytes becomes a number of eight
    remedy = "Export it as uncompressed WAV (PCM or floating point), or as text."
    with damage_as_error(f"{path.name} as a sound file", remedy), FILTERS_OF_WARNINGS, warnings.catch_warnings():
        warnings.simplefilter("error", wavfile.WavFileWarning)
        warnings.filterwarnings("ignore", "Chunk .*not understood", wavfile.WavFileWarning)
        try:
            rate, values = wavfile.read(path)
        except (NameError, Warning) as error:  # where a part is missing scipy stops at a name that was never set
            raise ValueError(str(error)) from None
    if not rate or not values.size:
        raise unreadable(path.name, "it has no samples or no rate", "Record or export it again.")
    with np.errstate(invalid="ignore"):  # signalling NaN, which is refused later
        samples = values.reshape(len(values), -1).astype(float)
    scale = "samples are floating point, read as they are"
    if values.dtype.kind == "u":
        samples, scale = (samples - 128) / 128, "samples of 8 bits, less 128, divided by 128: full scale is 1"
    elif values.dtype.kind == "i":
        full = 2.0 ** (8 * values.dtype.itemsize - 1)
        samples, scale = samples / full, f"samples of {values.dtype} divided by {full:g}: full scale is 1"
    columns = (Column(number=k, name=f"ch{k}", values=np.ascontiguousarray(c)) for k, c in enumerate(samples.T, 1))
    table = Table(
        where=path.name,
        columns=tuple(columns),
        rate=float(rate),
        rate_from="its header",
        roles=dict.fromkeys(range(1, samples.shape[1] + 1), "out"),
        notes=(f"{scale}; multiply by the sensor's range to have its unit",),
        layout=(("samples", f"{values.dtype} {len(values)}, {samples.shape[1]} channels"),),
    )
    return contents_from_table(table, options)
