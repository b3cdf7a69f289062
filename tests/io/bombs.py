"""Small files that ask for much: memory, time, other files. Made when they are needed; the largest has some ten megabytes.

Those of HDF5 stand here; `tests.io.packed_bombs` adds the others, whose bytes are put together when it is imported: seconds.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

h5py = pytest.importorskip("h5py")

BOMBS: dict[str, Callable[[Path], None]] = {}

MB = 10**6


def bomb(name: str) -> Callable[[Callable[[Path], None]], Callable[[Path], None]]:
    def add(make: Callable[[Path], None]) -> Callable[[Path], None]:
        BOMBS[name] = make
        return make

    return add


def deflated(head: bytes, size: int, *, raw: bool) -> tuple[bytes, int]:
    """Return `size` bytes, first `head` and then zeros, compressed (the same megabyte again and again), and their checksum."""
    check = zlib.crc32 if raw else zlib.adler32
    whole, rest = divmod(max(0, size - len(head)), MB)
    packed, number = [b"" if raw else b"\x78\x9c", _packed(head)], check(head)
    million = _packed(bytes(MB))
    for _ in range(whole):
        packed.append(million)
        number = check(bytes(MB), number) if size < 200 * MB else 0  # larger ones are refused before it is compared
    number = check(bytes(rest), number)
    end = _packed(bytes(rest)) + b"\3\0" + (b"" if raw else struct.pack(">I", number))
    return b"".join([*packed, end]), number


def _packed(data: bytes) -> bytes:
    stream = zlib.compressobj(9, zlib.DEFLATED, -15)
    return stream.compress(data) + stream.flush(zlib.Z_FULL_FLUSH)


def element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8 if kind != 15 else 0)


# ----------------------------------------------------------------------------------------------------------------- HDF5


def hdf5(name: str, *suffixes: str) -> Callable[[Callable[[h5py.File], None]], None]:
    def add(make: Callable[[h5py.File], None]) -> None:
        def write(path: Path) -> None:
            with h5py.File(path, "w", userblock_size=512 if path.suffix == ".mat" else None) as file:
                make(file)
            if path.suffix == ".mat":
                with path.open("r+b") as raw:
                    raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")

        for suffix in suffixes:
            BOMBS[name + suffix] = write

    return add


@hdf5("a terabyte that is not there", ".h5", ".mat")
def _(file: h5py.File) -> None:
    file.create_dataset("outputs", (10**12,), "i1")


@hdf5("a gigabyte in pieces that are not there", ".h5")
def _(file: h5py.File) -> None:
    file.create_dataset("outputs", (125 * MB, 1), "f8", chunks=(MB, 1), compression="gzip")


@hdf5("a hundred megabytes of zeros", ".h5")
def _(file: h5py.File) -> None:
    item = file.create_dataset("outputs", (200 * MB,), "i1", chunks=(MB,), compression="gzip")
    packed = zlib.compress(b"\0" * MB, 9)
    for k in range(200):
        item.id.write_direct_chunk((k * MB,), packed)


@hdf5("as much as may be", ".h5")
def _(file: h5py.File) -> None:
    file["frequencies"] = np.arange(1.0, MB + 1)
    for part in ("values_real", "values_imag"):
        file.create_dataset(part, data=np.ones((MB, 7, 1)), chunks=(MB // 10, 7, 1), compression="gzip")


@hdf5("as much as may be (7.3)", ".mat")
def _(file: h5py.File) -> None:
    file.create_dataset("sampling_rate", data=[[100.0]])
    file.create_dataset("outputs", (1, 12 * MB), "f8", chunks=(1, MB), compression="gzip", fillvalue=1.0)


@hdf5("pieces without number", ".h5")
def _(file: h5py.File) -> None:
    file.create_dataset("outputs", (10 * MB,), "f4", chunks=(1,))


@hdf5("a piece larger than its array", ".h5")
def _(file: h5py.File) -> None:
    file.create_dataset("outputs", (1,), "i1", chunks=(4 * 10**9,), maxshape=(None,))


@hdf5("a packed piece that is short", ".h5")
def _(file: h5py.File) -> None:
    item = file.create_dataset("outputs", (100 * MB,), "i1", chunks=(100 * MB,), compression="gzip")
    item.id.write_direct_chunk((0,), deflated(b"", 2000 * MB, raw=False)[0])


@hdf5("texts of a gigabyte each", ".h5")
def _(file: h5py.File) -> None:
    file.create_dataset("output_dofs", (2,), "S1000000000")


@hdf5("texts without number", ".h5")
def _(file: h5py.File) -> None:
    file.create_dataset("output_dofs", (MB,), h5py.string_dtype())


@hdf5("a long text among short ones", ".h5")
def _(file: h5py.File) -> None:
    file["output_dofs"] = ["x" * MB, *["x"] * 10_000]


@hdf5("a link to another file", ".h5", ".mat")
def _(file: h5py.File) -> None:
    file["outputs"] = h5py.ExternalLink("/etc/passwd", "/x")


@hdf5("numbers in another file", ".h5", ".mat")
def _(file: h5py.File) -> None:
    file.create_dataset("outputs", (10,), "i1", external=[("/etc/passwd", 0, 10)])


@hdf5("a view of another file", ".h5")
def _(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", (10,))
    file.create_virtual_dataset("outputs", layout)


@hdf5("a soft link through another file", ".h5")
def _(file: h5py.File) -> None:
    file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")
    file["outputs"] = h5py.SoftLink("/elsewhere/x")


@hdf5("a soft link to itself", ".h5")
def _(file: h5py.File) -> None:
    file["outputs"] = h5py.SoftLink("/outputs")


@hdf5("a group in itself", ".h5", ".mat")
def _(file: h5py.File) -> None:
    group = file.create_group("a")
    group["b"] = group


@hdf5("groups that double", ".h5", ".mat")
def _(file: h5py.File) -> None:
    groups = [file.create_group(f"g{k}") for k in range(30)]
    for one, other in pairwise(groups):
        one["a"], one["b"] = other, other


@hdf5("groups a thousand deep", ".h5")
def _(file: h5py.File) -> None:
    group = file
    for _ in range(1000):
        group = group.create_group("a")


@hdf5("a class of sixty kilobytes", ".h5")
def _(file: h5py.File) -> None:
    file.create_dataset("output", (3,), "f8").attrs["CLASS"] = "x" * 60_000


@hdf5("lists of their own length", ".h5")
def _(file: h5py.File) -> None:
    item = file.create_dataset("outputs", (3,), h5py.vlen_dtype("f8"))
    item[0] = np.zeros(9)


@hdf5("a million times one text (7.3)", ".mat")
def _(file: h5py.File) -> None:
    text = file.create_dataset("#refs#/a", data=np.full((100_000, 1), 120, "u2"))
    text.attrs["MATLAB_class"] = np.bytes_("char")
    cell = file.create_dataset(
        "output_dofs", data=np.array([text.ref] * 100_000, dtype=h5py.ref_dtype), dtype=h5py.ref_dtype
    )
    cell.attrs["MATLAB_class"] = np.bytes_("cell")


@hdf5("cells of the same cell, eleven deep (7.3)", ".mat")
def _(file: h5py.File) -> None:
    inner = file.create_dataset("#refs#/0", data=np.arange(3.0))
    for k in range(1, 12):
        name = "y" if k == 11 else f"#refs#/{k}"
        inner = file.create_dataset(name, data=np.array([inner.ref] * 8, h5py.ref_dtype))
        inner.attrs["MATLAB_class"] = np.bytes_("cell")


@hdf5("a text of a hundred megabytes (7.3)", ".mat")
def _(file: h5py.File) -> None:
    item = file.create_dataset("quantity", (50 * MB,), "u2", chunks=(MB,))
    item.attrs["MATLAB_class"] = np.bytes_("char")
