"""A single NumPy array (.npy): samples in rows, channels in columns; what its shape cannot say, options do."""

from __future__ import annotations

from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from modalscope.io.columns import COLUMN_OPTIONS, Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options
from modalscope.io.limits import Room, room
from modalscope.model import DataError
from modalscope.model.checks import Array

__all__ = ["NPY_OPTIONS", "columns_of_array", "read"]

NPY_OPTIONS = COLUMN_OPTIONS

_MAGIC = b"\x93NUMPY"


def read(path: Path, options: Options) -> Contents:
    """Read an array (options of tables; `sampling_rate` where no column is of times).

    Raises
    ------
    DataError
        No array, a pickle, another size than its head says, more than two axes, more channels than samples.
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

    Parameters
    ----------
    where : str
        The file, for messages.
    array : array, (N,) or (N, c)
    transpose : bool
        Whether it is (c, N).

    Raises
    ------
    DataError
        More axes, none, or no numbers.
    """
    if array.dtype.kind not in "biufc" or array.ndim not in (1, 2) or not array.size:
        raise DataError(
            f"reading {where} needs numbers, samples in rows and channels in columns",
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
                raise DataError(
                    f"reading {path.name} was asked",
                    "it holds pickled objects, which can run any program when they are loaded",
                    "Store plain numbers.",
                )
            if min(shape, default=0) < 0 or file.tell() + prod(shape) * dtype.itemsize != space.size:
                raise ValueError(f"its head says {shape}, and it has {space.size} bytes")
            space.array("its array", dtype, prod(shape))
            file.seek(0)
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
    except (ValueError, EOFError, SyntaxError, OverflowError, TypeError, KeyError, MemoryError, TokenError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"reading {path.name} as a NumPy array was asked",
            f"it is damaged or none ({error})",
            "Write it again with numpy.save.",
        ) from None
