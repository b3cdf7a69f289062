"""Data as they come: a path or an object, with what tells later that they are still the same."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.io import survey
from modalscope.io.arrays import to_arrays
from modalscope.model import ModalModel, Note
from modalscope.model.analysis import SourceFile
from modalscope.model.checks import DataError
from modalscope.preprocess.merging import merge

__all__ = ["are_paths", "opened", "source_of_data", "source_of_file"]

#: Bytes of a file that are hashed at a time.
_CHUNK = 1 << 20


def opened(data: Any, reading: Mapping[str, Any]) -> tuple[Any, tuple[SourceFile, ...], tuple[Note, ...]]:
    """Return the data, where they came from, and what of a file was left; a path is read, several are parts of one test.

    Parameters
    ----------
    data : path, sequence of paths, or data object
        Several files are merged: those of the same outputs are runs, others are setups (see `merge`).
    reading : mapping
        Options of `read`.

    Raises
    ------
    DataError
        A file that holds modes already, or options of reading for data that are read.
    """
    if isinstance(data, list | tuple) and are_paths(data):
        parts = [_opened(each, reading) for each in data]
        thing = parts[0][0] if len(parts) == 1 else merge([part for part, _, _ in parts])
        told = dict.fromkeys(note for _, _, notes in parts for note in notes)
        return thing, tuple(source for _, source, _ in parts), tuple(told)
    thing, source, notes = _opened(data, reading)
    return thing, (source,), notes


def are_paths(data: Any) -> bool:
    """Whether data are a path, or a sequence of nothing but paths."""
    several = data if isinstance(data, list | tuple) else (data,)
    return bool(several) and all(isinstance(each, str | Path) for each in several)


def _opened(data: Any, reading: Mapping[str, Any]) -> tuple[Any, SourceFile, tuple[Note, ...]]:
    if not isinstance(data, str | Path):
        if reading:
            raise DataError(
                f"reading with {', '.join(reading)} was asked",
                f"the data are {type(data).__name__} already",
                "Give a path, or make the data with these values.",
            )
        return data, source_of_data(data), ()
    path = Path(data)
    found = survey(path, **reading)
    if isinstance(found.thing, ModalModel):
        raise DataError(
            f"modes in {path} were asked", "the file holds modes already", "Give a file of responses or records."
        )
    return found.thing, source_of_file(path, reading), found.told


def source_of_file(path: Path, reading: Mapping[str, Any]) -> SourceFile:
    """Return size and hash of a file, in pieces."""
    digest = sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return SourceFile(path=str(path), size=path.stat().st_size, sha256=digest.hexdigest(), reading=dict(reading))


def source_of_data(data: Any) -> SourceFile:
    """Return size and hash of the arrays of a data object; nothing of what has none."""
    try:
        arrays = to_arrays(data)
    except (TypeError, AttributeError, DataError):
        return SourceFile()
    digest, size = sha256(), 0
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
        size += array.nbytes
    return SourceFile(size=size, sha256=digest.hexdigest())
