"""NumPy archives: the arrays of `modalscope.io.arrays`, never a pickle."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.io.arrays import to_arrays
from modalscope.io.contents import Contents, Options, Thing
from modalscope.io.diagrams import DIAGRAM, diagram_arrays, diagram_contents
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.marks import MARK
from modalscope.model import DataError, StabilizationDiagram
from modalscope.model.checks import Array

__all__ = ["read", "write"]

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
        raise DataError(
            f"reading {path.name} as a NumPy archive was asked",
            "it is not one",
            "Write it with numpy.savez, or give it the suffix of what it is.",
        )
    arrays: dict[str, Array] = {}
    try:
        # opened here: numpy leaves its own handle open when the directory of the archive is damaged
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            for name in archive.files:
                arrays[name] = archive[name]
    except _DAMAGED as error:
        raise _refuse(path, error) from None
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):
            raise DataError(
                f"reading {path.name} as a NumPy archive was asked",
                f"its member {name} is not an array",
                "Keep only .npy members in it.",
            )
    if DIAGRAM in arrays:
        return diagram_contents(path.name, arrays)
    return contents_from_arrays(path.name, arrays, options)


def _refuse(path: Path, error: Exception) -> DataError:
    if "pickle" in str(error):
        return DataError(
            f"reading {path.name} was asked",
            "it holds pickled objects, which can run any program when they are loaded",
            "Store plain arrays: numbers, and text as numpy.array([...], dtype=str).",
        )
    return DataError(
        f"reading {path.name} was asked",
        f"the archive is damaged ({type(error).__name__}: {error})",
        "Copy or write the file again.",
    )


def write(path: Path, thing: Thing, options: Options) -> None:
    """Write a noun as named arrays; binary, so that it is read back exactly."""
    arrays: dict[str, Any] = diagram_arrays(thing) if isinstance(thing, StabilizationDiagram) else to_arrays(thing)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = MARK.encode()
