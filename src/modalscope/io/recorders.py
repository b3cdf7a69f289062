"""Read files of recorders through optional packages: TDMS, MDF 3 and 4, netCDF, Parquet.

An adapter hands on columns, units and rate; what becomes of them is the same for all (`columns`). npTDMS and asammdf are under the LGPL.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError
from modalscope.io.columns import COLUMN_OPTIONS, Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options, chosen
from modalscope.io.frames import table_of_frame
from modalscope.io.limits import Room, room
from modalscope.numerics.extras import optional_package

RECORDER_OPTIONS = (*COLUMN_OPTIONS, "sheet")

#: What these packages raise on files that are damaged or of another kind.
_DAMAGED = (
    ValueError, KeyError, TypeError, IndexError, AttributeError, OSError, EOFError, RuntimeError, MemoryError, ArithmeticError,
    AssertionError, struct.error, NotImplementedError,
)  # fmt: skip
_SIGNATURES = {
    ".nc": (b"CDF", b"\x89HDF"),
    ".parquet": (b"PAR1",),
    ".tdms": (b"TDSm",),
    ".mf4": (b"MDF ",),
    ".mdf": (b"MDF ",),
}


def _guarded(
    path: Path, package: str, extra: str, name: str, load: Callable[[Any, Room], Table], options: Options
) -> Contents:
    """Return what a package reads, within the room, and its errors as a `DataError`."""
    module = optional_package(f"reading {path.suffix}", package, extra, name)
    space = room(path.name, path.stat().st_size)
    with path.open("rb") as file:
        head = file.read(8)
    try:
        if not head.startswith(_SIGNATURES.get(path.suffix.lower(), (b"",))):
            raise ValueError("it does not begin as such a file does")
        table = load(module, space)
    except _DAMAGED as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"reading {path.name} with {name} was asked",
            f"it is damaged or of another kind ({type(error).__name__}: {str(error)[:100]})",
            "Export it again, or as text (.csv).",
        ) from None
    return contents_from_table(table, options)


def read_tdms(path: Path, options: Options) -> Contents:
    """Read a TDMS file of LabVIEW: the channels of one group, their increment and units.

    Raises `DataError`: npTDMS is missing, a damaged file, several groups and no `sheet`, or what tables are refused for.
    """

    def load(package: Any, space: Room) -> Table:
        with package.TdmsFile.open(str(path)) as file:
            groups = {group.name: [c for c in group.channels() if len(c) > 1] for group in file.groups()}
            name = chosen(path.name, "groups", groups, [key for key, channels in groups.items() if channels], options)
            longest = max((len(channel) for channel in groups[name]), default=0)
            taken = [channel for channel in groups[name] if len(channel) == longest]
            left = [channel.name for channel in groups[name] if len(channel) != longest]
            space.take("its channels", 8 * longest * len(taken))
            steps = {float(c.properties["wf_increment"]) for c in taken if c.properties.get("wf_increment")}
            columns = tuple(_of_tdms(k, channel) for k, channel in enumerate(taken, 1))
        notes = (f"channels of other lengths were left: {', '.join(left[:6])}",) if left else ()
        rate = 1 / steps.pop() if len(steps) == 1 else None
        return Table(
            where=path.name,
            columns=columns,
            rate=rate,
            rate_from="wf_increment",
            notes=notes,
            layout=(("group", name),),
        )

    return _guarded(path, "nptdms", "tdms", "npTDMS", load, options)


def _of_tdms(number: int, channel: Any) -> Column:
    said = channel.properties
    unit = str(said.get("unit_string") or said.get("NI_UnitDescription") or "")
    values = np.asarray(channel[:])
    if values.dtype.kind == "M":
        seconds = (values - values[0]) / np.timedelta64(1, "ns") * 1e-9
        return Column(number=number, name=channel.name, unit="s", values=seconds, stamps=True)
    return Column(number=number, name=channel.name, unit=unit, values=values)


def read_mdf(path: Path, options: Options) -> Contents:
    """Read an MDF file of a vehicle's recorder: the channels of one group, which share its clock.

    Raises `DataError`: asammdf is missing, a damaged file, several groups and no `sheet`, or what tables are refused for.
    """

    def load(package: Any, space: Room) -> Table:
        with package.MDF(str(path)) as file:
            groups = {f"group {k}": k for k, group in enumerate(file.groups) if group.channel_group.cycles_nr > 1}
            name = chosen(path.name, "groups", groups, list(groups), options)
            group = file.groups[groups[name]]
            space.take("its channels", 8 * int(group.channel_group.cycles_nr) * len(group.channels))
            master = file.masters_db.get(groups[name])
            signals = [file.get(group=groups[name], index=k) for k in range(len(group.channels)) if k != master]
            times = np.asarray(file.get_master(groups[name]), float)
        plain = [signal for signal in signals if np.ndim(signal.samples) == 1]
        columns = [Column(number=1, name="time", unit="s", values=times)]
        columns += [
            Column(number=k, name=str(signal.name), unit=str(signal.unit or ""), values=np.asarray(signal.samples))
            for k, signal in enumerate(plain, 2)
        ]
        return Table(where=path.name, columns=tuple(columns), layout=(("group", name),))

    return _guarded(path, "asammdf", "mdf", "asammdf", load, options)


def read_netcdf(path: Path, options: Options) -> Contents:
    """Read a netCDF file: the variables along time or frequency.

    Raises `DataError`: xarray is missing, a damaged file, no common dimension, or what tables are refused for.
    """

    def load(package: Any, space: Room) -> Table:
        with package.open_dataset(path) as data:
            space.take("its variables", sum(16 * int(np.prod(data[name].shape)) for name in data.variables))
            return table_of_frame(data.load(), path.name)

    return _guarded(path, "xarray", "netcdf", "xarray", load, options)


def read_parquet(path: Path, options: Options) -> Contents:
    """Read a Parquet file of columns.

    Raises `DataError`: pandas or pyarrow are missing, a damaged file, or what tables are refused for.
    """

    def load(package: Any, space: Room) -> Table:
        told = package.read_metadata(path)
        space.take("its columns", 16 * told.num_rows * told.num_columns)
        return table_of_frame(optional_package("reading .parquet", "pandas", "parquet").read_parquet(path), path.name)

    return _guarded(path, "pyarrow.parquet", "parquet", "pyarrow", load, options)
