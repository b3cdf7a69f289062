"""Read files by packages that trust them, as meshio or openpyxl, in a process of its own with limits of time and memory.

This module also runs as that program: it reads a file, and writes one line of JSON and the arrays as .npy behind each other. There it
imports nothing of modalscope. A package may print, hang, fill the memory or end its process: all that is an error of the file.
"""

from __future__ import annotations

import io
import json
import sys
import warnings
from contextlib import closing
from datetime import date, time
from importlib import import_module
from importlib.util import find_spec
from math import prod
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

Answer = tuple[dict[str, Any], list[Any]]


def read_apart(package: str, path: Path, sheet: str = "", here: bool = False) -> Answer:
    """Return what the program says of a file, and its arrays.

    `package`: one of `_PACKAGES`. `sheet`: the group to read, of several. `here`: whether this process tries first, with a part of the
    memory, since that ends soon whatever the file holds.

    Raises `DataError`: the package is missing, or does not read the file within its limits.
    """
    from modalscope.io.apart import python, run_apart
    from modalscope.io.contents import unreadable
    from modalscope.io.hdf5 import check_hdf5, names_in
    from modalscope.io.limits import room
    from modalscope.io.loose import refuse_modes
    from modalscope.numerics.errors import optional_package

    name, extra, _, *begins = _PACKAGES[package]
    if find_spec(package) is None:  # to load some takes seconds
        optional_package(f"reading {path.suffix}", package, extra, name)
    space = room(path.name, path.stat().st_size)
    arguments = (package, str(path), str(space.left), sheet)
    remedy = "Export it again, or as text (.csv)." if package != "meshio" else "Export it as .msh, .vtk, .bdf or .inp."
    arrays: list[Any] = []
    with path.open("rb") as file:
        head = file.read(8)
    if head.startswith(b"\x89HDF") or path.suffix.lower() == ".med":  # netCDF 4 and MED: links may lead out of them
        check_hdf5(path, space)
        refuse_modes(path.name, names_in(path))
    answer: dict[str, Any] = {"fault": "it is damaged or of another kind: it does not begin as such a file does"}
    if not begins or head.startswith(begins[0]):
        answer, arrays = _read(package, str(path), space.left // _PARTS_HERE, sheet) if here else (answer, arrays)
        if answer.get("fault"):
            program = [__file__, *arguments]
            answer, arrays = _told(*run_apart(package, space, program)) if python() else _read(*arguments)
    if answer.get("fault"):
        raise unreadable(f"{path.name} with {name}", str(answer["fault"]), remedy)
    return answer, arrays


def _told(fault: str, told: bytes) -> Answer:
    """Return the answer of the program, or what became of it."""
    stream = io.BytesIO(told)
    try:
        answer: dict[str, Any] = json.loads(stream.readline())
        arrays = [np.load(stream, allow_pickle=False) for _ in range(answer.get("arrays", 0))]
    except (ValueError, EOFError):
        return {"fault": f"it is damaged: {fault or 'its reader says nothing'}"}, []
    return answer, arrays


#: What is read in this process may take this part of the memory.
_PARTS_HERE = 8


# ------------------------------------------------------------------------------------------------------------- in the program


def _meshio(path: str, left: int, sheet: str) -> Answer:
    mesh = import_module("meshio").read(path)
    points = np.asarray(mesh.points, float)
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    return {"kinds": [str(block.type) for block in mesh.cells]}, [
        points,
        *(np.asarray(b.data, int) for b in mesh.cells),
    ]


def _nptdms(path: str, left: int, sheet: str) -> Answer:
    nptdms = import_module("nptdms")

    with nptdms.TdmsFile.open(path) as file:
        groups = {group.name: [c for c in group.channels() if len(c) > 1] for group in file.groups()}
        name = sheet or next((key for key, channels in groups.items() if channels), "")
        listed = {"groups": list(groups), "tables": [key for key, channels in groups.items() if channels]}
        if name not in groups:
            return listed, []
        longest = max((len(channel) for channel in groups[name]), default=0)
        channels = [channel for channel in groups[name] if len(channel) == longest]
        _weigh(8 * longest * len(channels), left)
        steps = {float(c.properties["wf_increment"]) for c in channels if c.properties.get("wf_increment")}
        units = [c.properties.get("unit_string") or c.properties.get("NI_UnitDescription") or "" for c in channels]
        columns = [{"name": c.name, "unit": str(unit)} for c, unit in zip(channels, units, strict=True)]
        starts = [start for c in channels if (start := _start_of(c.properties)) is not None]
        arrays = [np.asarray(channel[:]) for channel in channels]
    for column, k in zip(columns, range(len(arrays)), strict=True):
        if arrays[k].dtype.kind == "M":
            arrays[k] = (arrays[k] - arrays[k][0]) / np.timedelta64(1, "ns") * 1e-9
            column |= {"unit": "s", "stamps": True}
    shorter = [channel.name for channel in groups[name] if len(channel) != longest]
    late = [start - min(starts) for start in starts] if len(starts) == len(arrays) else []
    start = max(starts) if late else 0.0
    held = {"columns": columns, "steps": sorted(steps), "shorter": shorter, "late": late, "start": start}
    return listed | held, arrays


def _start_of(properties: Any) -> float | None:
    """Return when a waveform starts, s since 1970; None where it does not say so."""
    start = properties.get("wf_start_time")
    if start is None:
        return None
    nanoseconds = np.datetime64(start, "ns").astype(np.int64)
    return float(nanoseconds) * 1e-9 + float(properties.get("wf_start_offset") or 0.0)


def _asammdf(path: str, left: int, sheet: str) -> Answer:
    asammdf = import_module("asammdf")

    with asammdf.MDF(path) as file:
        groups = {f"group {k}": k for k, group in enumerate(file.groups) if group.channel_group.cycles_nr > 1}
        name = sheet or next(iter(groups), "")
        listed = {"groups": list(groups), "tables": list(groups)}
        if name not in groups:
            return listed, []
        group = file.groups[groups[name]]
        _weigh(8 * int(group.channel_group.cycles_nr) * len(group.channels), left)
        master = file.masters_db.get(groups[name])
        signals = [file.get(group=groups[name], index=k) for k in range(len(group.channels)) if k != master]
        times, start = np.asarray(file.get_master(groups[name]), float), file.header.start_time.timestamp()
    plain = [signal for signal in signals if np.ndim(signal.samples) == 1]
    columns = [{"name": "time", "unit": "s"}]
    columns += [{"name": str(signal.name), "unit": str(signal.unit or "")} for signal in plain]
    return {**listed, "columns": columns, "start": start}, [times, *(np.asarray(signal.samples) for signal in plain)]


def _xarray(path: str, left: int, sheet: str) -> Answer:
    xarray = import_module("xarray")

    with xarray.open_dataset(path) as data:
        _weigh(sum(16 * prod(each.shape) for each in data.variables.values()), left)
        variables = [
            {"name": str(name), "dims": list(map(str, each.dims)), "unit": str(each.attrs.get("units", ""))}
            for name, each in data.variables.items()
        ]
        numbers = {str(k): float(v) for k, v in data.attrs.items() if isinstance(v, int | float | np.number)}
        coords = list(map(str, data.coords))
        arrays = [np.asarray(each) for each in data.load().variables.values()]
    return {"variables": variables, "coords": coords, "numbers": numbers}, arrays


#: Warning filters belong to the whole process: one reader at a time changes and restores them.
FILTERS_OF_WARNINGS = Lock()
#: Bytes of a cell of a sheet in memory, beside those of its text.
_BYTES_OF_CELL = 8


def _openpyxl(path: str, left: int, sheet: str) -> Answer:
    openpyxl = import_module("openpyxl")

    arrays: list[Any] = []
    weight = 0
    with FILTERS_OF_WARNINGS, warnings.catch_warnings(), Path(path).open("rb") as file:
        warnings.simplefilter("ignore")  # of styles and names that are not needed
        with closing(openpyxl.load_workbook(file, read_only=True, data_only=True)) as book:
            sheets = list(map(str, book.sheetnames))
            read = [sheet] if sheet in sheets else [name for name in sheets if hasattr(book[name], "iter_rows")]
            for name in read:
                lines: list[str] = []
                for row in book[name].iter_rows(values_only=True):
                    weight += _BYTES_OF_CELL * (1 + len(row)) + sum(len(cell) for cell in row if isinstance(cell, str))
                    _weigh(weight, left)
                    lines.append("\t".join(map(_text_of_cell, row)))
                full = [(number, line) for number, line in enumerate(lines, 1) if line.strip("\t")]
                text = "\n".join(line for _, line in full).encode(errors="replace")
                arrays += [np.array([number for number, _ in full], np.int64), np.frombuffer(text, np.uint8)]
    return {"sheets": sheets, "read": read}, arrays


def _text_of_cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool | int | float):
        return repr(float(value))
    return value.isoformat() if isinstance(value, date | time) else " ".join(str(value).split())


def _weigh(count: int, left: int) -> None:
    if count > left:
        raise MemoryError(f"it would take {count} bytes of memory, and may take {left}")


#: Packages: what they are called, the extra that brings each, what reads with it, and what its files begin with where that is known.
_PACKAGES: dict[str, tuple[Any, ...]] = {
    "meshio": ("meshio", "mesh", _meshio),
    "nptdms": ("npTDMS", "tdms", _nptdms, b"TDSm"),
    "asammdf": ("asammdf", "mdf", _asammdf, b"MDF "),
    "xarray": ("xarray", "netcdf", _xarray, (b"CDF", b"\x89HDF")),
    "openpyxl": ("openpyxl", "excel", _openpyxl),
}


def _read(package: str, path: str, left: str | int, sheet: str) -> Answer:
    """Return what a package reads; whatever it raises is an error of the file."""
    try:
        answer, arrays = _PACKAGES[package][2](path, int(left), sheet)
        # what is no number is text; nothing else is needed, and objects would be pickled
        return answer, [a if a.dtype.kind in "biufcUSMm" else a.astype(str) for a in arrays]
    except (Exception, SystemExit) as error:  # noqa: BLE001 - packages raise anything
        return {"fault": f"it is damaged or of another kind ({type(error).__name__}: {str(error)[:100]})"}, []


def _main(package: str, path: str, left: str, sheet: str) -> None:
    out, sys.stdout = sys.stdout.buffer, io.StringIO()
    answer, arrays = _read(package, path, left, sheet)
    out.write(json.dumps({**answer, "arrays": len(arrays)}).encode() + b"\n")
    for array in arrays:
        np.save(out, array, allow_pickle=False)


if __name__ == "__main__":
    _main(*sys.argv[1:])
