"""Read and write NumPy files, .npz and .npy, never a pickle."""

from __future__ import annotations

import struct
import zipfile
from ast import literal_eval
from math import prod
from operator import index
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import StabilizationDiagram
from modalscope.io.arrays import to_arrays
from modalscope.io.atomic import MARK
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.contents import ArrayData, Contents, Options, check_characters, damage_as_error, needs, unreadable
from modalscope.io.diagrams import DIAGRAM, diagram_arrays, diagram_contents
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.limits import Room, room
from modalscope.io.loose import points_of
from modalscope.numerics.checks import Array

_MAGIC = b"\x93NUMPY"
#: Version of an array -> the bytes that hold the size of its head, and how the head is coded.
_VERSIONS = {b"\1\0": (2, "latin-1"), b"\2\0": (4, "latin-1"), b"\3\0": (4, "utf-8")}
#: Bytes of the head of an array at most, as NumPy has it.
_BYTES_OF_HEAD = 10_000
#: Bytes that are read at once.
_BYTES_TOGETHER = 1 << 20
#: Bytes at the end of an archive that hold the place of its list of members, and of the longest list (some ten thousand members).
_BYTES_OF_END, _BYTES_OF_DIRECTORY = 1 << 16, 1_000_000


def read_npy(path: Path, options: Options) -> Contents:
    """Read an array (options of tables; `sampling_rate` where no column is of times).

    Raises `DataError`: no array, a pickle, another size than its head says, more than two axes, more channels than samples.
    """
    space = room(path.name, path.stat().st_size)
    with damage_as_error(f"{path.name} as a NumPy array", "Write it again with numpy.save."), path.open("rb") as file:
        array = _array(file, path.name, "its array", space.size, space)
    points = points_of(array) if not array.dtype.names else None
    if points is not None:
        fields = [(name, values[:, None]) for name, values in points]
    elif array.dtype.names:
        fields = [(str(name), np.asarray(array[name]).reshape(len(array), -1)) for name in array.dtype.names]
    else:
        fields = [("", _columns(path.name, array, bool(options.get("transpose"))))]
    columns = [
        (f"{name} {k + 1}" if name and values.shape[1] > 1 else name, values[:, k])
        for name, values in fields
        for k in range(values.shape[1])
    ]
    found = tuple(Column(number=k, name=name, values=values) for k, (name, values) in enumerate(columns, 1))
    what = f"{array.dtype} {'x'.join(map(str, array.shape))}{', points that move together' if points else ''}"
    return contents_from_table(Table(where=path.name, columns=found, layout=(("array", what),)), options)


def _columns(where: str, array: Array, transpose: bool) -> Array:
    """Return an array as (rows, columns).

    `array` (N,) or (N, c). `transpose`: whether it is (c, N).

    Raises `DataError`: more axes, none, or no numbers.
    """
    if array.dtype.kind not in "biufc" or array.ndim not in (1, 2) or not array.size:
        need, fault = "numbers, samples in rows and channels in columns", f"it is {array.dtype} of shape {array.shape}"
        named = (
            "numpy.savez(..., outputs=..., inputs=..., sampling_rate=...), outputs of shape (runs, samples, channels)"
        )
        raise needs(where, need, fault, f"Save each run by itself, or all with names and axes: {named}.")
    if array.ndim == 1:
        return array[:, None]
    return array.T if transpose else array


def _array(file: Any, where: str, name: str, size: int, space: Room) -> Array:
    """Return the array that a file or a member of an archive is, its head first compared with its size, and with the room.

    `size`: bytes of the file or of the member, as the archive states them.
    """
    if file.read(len(_MAGIC)) != _MAGIC:
        raise ValueError(f"{name} does not begin as an array")
    width, coding = _VERSIONS[file.read(2)]
    size_of_head = int.from_bytes(file.read(width), "little")
    try:
        head = literal_eval(file.read(min(size_of_head, _BYTES_OF_HEAD)).decode(coding))
        dtype, shape = np.lib.format.descr_to_dtype(head["descr"]), tuple(map(index, head["shape"]))
    except TypeError:
        raise ValueError(f"{name} has a head that says no type and no shape") from None
    except SyntaxError:  # NumPy mends such a head, and warns
        fault = "the head of an array has the long numbers of Python 2, or is damaged"
        raise unreadable(where, fault, "Load it with numpy.load and store it again with numpy.savez.") from None
    if dtype.hasobject:
        fault = "it holds pickled objects, which can run any program when they are loaded"
        raise unreadable(where, fault, "Store plain arrays: numbers, and text as numpy.array([...], dtype=str).")
    begin = len(_MAGIC) + 2 + width + size_of_head
    if min(shape, default=0) < 0 or begin + prod(shape) * dtype.itemsize != size:
        raise ValueError(f"{name} has the shape {shape} and {size} bytes")
    space.array(name, dtype, prod(shape))
    array = np.empty(prod(shape), dtype)
    data = array.view(np.uint8) if array.nbytes else array
    for start in range(0, array.nbytes, _BYTES_TOGETHER):
        part = data[start : start + _BYTES_TOGETHER]
        if file.readinto(part) != part.size:
            raise ValueError(f"{name} is cut off")
    file.read(1)  # behind the last byte an archive compares its checksum
    check_characters(name, array)
    return array.reshape(shape, order="F" if head["fortran_order"] else "C")


def read(path: Path, options: Options) -> Contents:
    """Read an archive (options of `contents_from_arrays`)."""
    if not zipfile.is_zipfile(path):
        remedy = "Write it with numpy.savez, or give it the suffix of what it is."
        raise unreadable(f"{path.name} as a NumPy archive", "it is not one", remedy)
    with damage_as_error(f"{path.name} as a NumPy archive", "Copy or write the file again."):
        arrays = _arrays(path, room(path.name, path.stat().st_size))
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
            name = member.filename.removesuffix(".npy")
            with archive.open(member) as stream:
                arrays[name] = _array(stream, path.name, name, member.file_size, space)
    return arrays


def _check_directory(path: Path, space: Room) -> None:
    """Bound the list of members before it is read; it stands at the end, with its size behind it."""
    with path.open("rb") as file:
        file.seek(max(0, space.size - _BYTES_OF_END))
        tail = file.read()
    # archives over 4 GB have a longer one, too, and the largest number in the other
    for mark, place, form, none in ((b"PK\5\6", 12, "<I", 0xFFFFFFFF), (b"PK\6\6", 40, "<Q", 0)):
        at = tail.rfind(mark)
        if 0 <= at <= len(tail) - place - 8:
            size = struct.unpack_from(form, tail, at + place)[0]
            space.parts("bytes in its list of members", 0 if size == none else size, _BYTES_OF_DIRECTORY)


def write(path: Path, thing: ArrayData | StabilizationDiagram, options: Options) -> None:
    """Write a data object as named arrays; binary, so that it is read back exactly."""
    arrays: dict[str, Any] = diagram_arrays(thing) if isinstance(thing, StabilizationDiagram) else to_arrays(thing)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = MARK.encode()
