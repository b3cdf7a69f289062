"""Read and write NumPy files, .npz and .npy, never a pickle."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from modalscope.data import DataError, StabilizationDiagram
from modalscope.io.arrays import to_arrays
from modalscope.io.atomic import MARK
from modalscope.io.columns import COLUMN_OPTIONS, Column, Table, contents_from_table
from modalscope.io.contents import ArrayData, Contents, Options, needs, unreadable
from modalscope.io.diagrams import DIAGRAM, diagram_arrays, diagram_contents
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.limits import Room, room
from modalscope.numerics.checks import Array

# ----------------------------------------------------------------------------------------------------------------- npy
# A single NumPy array (.npy): samples in rows, channels in columns; what its shape cannot say, options do.

NPY_OPTIONS = COLUMN_OPTIONS

_MAGIC = b"\x93NUMPY"


def read_npy(path: Path, options: Options) -> Contents:
    """Read an array (options of tables; `sampling_rate` where no column is of times).

    Raises `DataError`: no array, a pickle, another size than its head says, more than two axes, more channels than samples.
    """
    array = _array(path, room(path.name, path.stat().st_size))
    if array.dtype.names:
        named = [(str(name), np.asarray(array[name]).reshape(len(array), -1)) for name in array.dtype.names]
    else:
        named = [("", columns_of_array(path.name, array, bool(options.get("transpose"))))]
    columns = [
        (f"{name} {k + 1}".strip() if name and values.shape[1] > 1 else name, values[:, k])
        for name, values in named
        for k in range(values.shape[1])
    ]
    table = Table(
        where=path.name,
        columns=tuple(Column(number=k, name=name, values=values) for k, (name, values) in enumerate(columns, 1)),
        layout=(("array", f"{array.dtype} {'x'.join(map(str, array.shape))}"),),
    )
    return contents_from_table(table, options)


def columns_of_array(where: str, array: Array, transpose: bool) -> Array:
    """Return an array as (rows, columns).

    `array` (N,). `transpose`: whether it is (c, N).

    Raises `DataError`: more axes, none, or no numbers.
    """
    if array.dtype.kind not in "biufc" or array.ndim not in (1, 2) or not array.size:
        raise needs(
            where,
            "numbers, samples in rows and channels in columns",
            f"it is {array.dtype} of shape {array.shape}",
            "Save each run by itself, or all with names and axes: numpy.savez(..., outputs=..., inputs=..., sampling_rate=...), "
            "outputs of shape (runs, samples, channels).",
        )
    if array.ndim == 1:
        return array[:, None]
    return array.T if transpose else array


def _array(path: Path, space: Room) -> Array:
    """Return the array of a file, its head first compared with the size of the file."""
    try:
        with path.open("rb") as file:
            if file.read(6) != _MAGIC:
                raise ValueError("it does not begin as an array")
            version = tuple(file.read(2))
            head: Any = (
                np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            )
            shape, _, dtype = head(file)
            if dtype.hasobject:
                fault = "it holds pickled objects, which can run any program when they are loaded"
                raise unreadable(path.name, fault, "Store plain numbers.")
            if min(shape, default=0) < 0 or file.tell() + prod(shape) * dtype.itemsize != space.size:
                raise ValueError(f"its head says {shape}, and it has {space.size} bytes")
            space.array("its array", dtype, prod(shape))
            file.seek(0)
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
    except (ValueError, EOFError, SyntaxError, OverflowError, TypeError, KeyError, MemoryError, TokenError) as error:
        if isinstance(error, DataError):
            raise
        fault = f"it is damaged or none ({error})"
        raise unreadable(f"{path.name} as a NumPy array", fault, "Write it again with numpy.save.") from None


# ----------------------------------------------------------------------------------------------------------------- npz

#: Where the end of an archive is looked for, and the longest list of members (some ten thousand).
_LAST, _DIRECTORY = 1 << 16, 1_000_000

#: What numpy and zipfile raise on damaged archives.
_DAMAGE = (
    ValueError,
    OSError,
    EOFError,
    KeyError,
    SyntaxError,
    NotImplementedError,
    RuntimeError,
    OverflowError,
    MemoryError,
)
_DAMAGED = (*_DAMAGE, zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError)


def read(path: Path, options: Options) -> Contents:
    """Read an archive (options of `contents_from_arrays`)."""
    if not zipfile.is_zipfile(path):
        remedy = "Write it with numpy.savez, or give it the suffix of what it is."
        raise unreadable(f"{path.name} as a NumPy archive", "it is not one", remedy)
    space = room(path.name, path.stat().st_size)
    try:
        arrays = _arrays(path, space)
    except _DAMAGED as error:
        if isinstance(error, DataError):
            raise
        raise _refuse(path, error) from None
    if DIAGRAM in arrays:
        return diagram_contents(path.name, arrays)
    return contents_from_arrays(path.name, arrays, options)


def _arrays(path: Path, space: Room) -> dict[str, Array]:
    """Return the arrays of an archive, the sizes that each states compared first with one another and with the room."""
    _check_directory(path, space)
    arrays: dict[str, Array] = {}
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        for member in members:
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"{member.filename} is packed by method {member.compress_type}")
        for member in members:
            _check_member(archive, member, space)
            with archive.open(member) as stream:
                arrays[member.filename.removesuffix(".npy")] = np.lib.format.read_array(stream, allow_pickle=False)
                if stream.read(1):
                    raise ValueError(f"{member.filename} is longer than its array")
    return arrays


def _check_directory(path: Path, space: Room) -> None:
    """Bound the list of members before it is read; it stands at the end, with its size behind it."""
    with path.open("rb") as file:
        file.seek(max(0, space.size - _LAST))
        tail = file.read()
    at = tail.rfind(b"PK\5\6")
    if 0 <= at <= len(tail) - 20:
        space.parts("bytes in its list of members", struct.unpack_from("<I", tail, at + 12)[0] % 0xFFFFFFFF, _DIRECTORY)
    at = tail.rfind(b"PK\6\6")  # archives over 4 GB have a longer one, too
    if 0 <= at <= len(tail) - 48:
        space.parts("bytes in its list of members", struct.unpack_from("<Q", tail, at + 40)[0], _DIRECTORY)


def _check_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, space: Room) -> None:
    """Compare what the head of an array says with what the archive says, and with the room."""
    name = member.filename.removesuffix(".npy")
    with archive.open(member) as stream:
        if stream.read(6) != b"\x93NUMPY":
            fault = f"its member {member.filename} is not an array"
            raise unreadable(f"{space.where} as a NumPy archive", fault, "Keep only .npy members in it.")
        version = tuple(stream.read(2))
        read_head = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_head(stream)
        count, head = prod(shape), stream.tell()
    if dtype.hasobject:
        raise ValueError("it holds a pickle")
    if min(shape, default=0) < 0 or head + count * dtype.itemsize != member.file_size:
        raise ValueError(f"{name} has the shape {shape} and {member.file_size} bytes")
    space.array(name, dtype, count)


def _refuse(path: Path, error: Exception) -> DataError:
    if "pickle" in str(error):
        fault = "it holds pickled objects, which can run any program when they are loaded"
        return unreadable(path.name, fault, "Store plain arrays: numbers, and text as numpy.array([...], dtype=str).")
    fault = f"the archive is damaged ({type(error).__name__}: {error})"
    return unreadable(path.name, fault, "Copy or write the file again.")


def write(path: Path, thing: ArrayData | StabilizationDiagram, options: Options) -> None:
    """Write a noun as named arrays; binary, so that it is read back exactly."""
    arrays: dict[str, Any] = diagram_arrays(thing) if isinstance(thing, StabilizationDiagram) else to_arrays(thing)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = MARK.encode()
