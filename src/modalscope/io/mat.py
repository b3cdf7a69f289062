"""MATLAB files up to version 7.3: the arrays of `modalscope.io.arrays` as variables.

Versions 5 to 7.2 are read by `mat5`, 7.3 (which is HDF5) by h5py; version 5 is written, by scipy. Fields of a structure are
named with a dot, `test.H`, and `rename` takes these names. MATLAB drops trailing axes of length one and makes vectors of
shape (1, n): both are put right for arrays whose number of axes the layout fixes.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io as sio

from modalscope.io.arrays import INDICATOR, UNREFINED, joined, to_arrays
from modalscope.io.contents import Contents, Options, Plain
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.hdf5 import DAMAGED
from modalscope.io.hdf5_guard import check_hdf5
from modalscope.io.limits import Room, room
from modalscope.io.marks import MARK
from modalscope.io.mat5 import read_mat5
from modalscope.io.members import MEMBER, member_name
from modalscope.model import DataError
from modalscope.model.checks import Array
from modalscope.model.extras import optional_package
from modalscope.model.mode_fields import PER_MODE

__all__ = ["read", "write"]

_VECTORS = ("frequencies", "poles", *PER_MODE)
_THREE_AXES = ("values", "variance")
_DESCRIPTION = 116
_HDF5_SIGNATURE = b"MATLAB 7.3"
#: Cells in structures in structures ...
_DEEPEST = 16


def write(path: Path, thing: Plain, options: Options) -> None:
    """Write a data object as variables of a version 5 file."""
    arrays: dict[str, Any] = {
        name: array.astype(object) if array.dtype.kind == "U" and array.ndim else array
        for name, array in to_arrays(thing).items()
    }
    long = [name for name in arrays if len(name) > 63]
    if long:
        raise DataError(
            f"writing {path.suffix} was asked",
            f"the name {long[0]!r} is longer than MATLAB's 63 characters",
            "Use .npz or .h5.",
        )
    sio.savemat(str(path), arrays, appendmat=False, long_field_names=True, oned_as="column")
    with path.open("r+b") as file:  # no date: the same data give the same file
        file.write(f"MATLAB 5.0 MAT-file, written by {MARK}".ljust(_DESCRIPTION).encode())


def read(path: Path, options: Options) -> Contents:
    """Read the variables of a file (options of `contents_from_arrays`)."""
    space = room(path.name, path.stat().st_size)
    with path.open("rb") as file:
        new = file.read(len(_HDF5_SIGNATURE)) == _HDF5_SIGNATURE
    ignore = options.get("ignore") or ()
    ignored = [ignore] if isinstance(ignore, str) else list(ignore)
    arrays = _read_new(path, space, ignored) if new else read_mat5(path.read_bytes(), space, ignored)
    names = dict(options.get("rename") or {})
    shaped = {name: _as_layout(names.get(name, name), array, options) for name, array in arrays.items()}
    return contents_from_arrays(path.name, shaped, options, members=True)


def _as_layout(name: str, array: Array, options: Options) -> Array:
    if name in (options.get("axes") or {}):
        return array
    name = name.removeprefix(UNREFINED)
    if name in _VECTORS or name.startswith(INDICATOR) or array.dtype.kind == "U":
        return array.ravel()
    return array[..., None] if name in _THREE_AXES and array.ndim == 2 else array


def _read_new(path: Path, space: Room, ignore: Collection[str]) -> dict[str, Array]:
    h5py = optional_package("reading a MATLAB 7.3 file", "h5py", "mat")
    check_hdf5(path, space)
    arrays: dict[str, Array] = {}
    seen: set[int] = set()

    def take(name: str, item: Any, depth: int = 0) -> None:
        if depth > _DEEPEST:
            raise ValueError(f"arrays lie deeper than {_DEEPEST} in each other")
        if name in ignore:
            arrays[name] = np.array("not read")
        elif isinstance(item, h5py.Group):
            for key, part in item.items():
                if not key.startswith("#"):
                    take(f"{name}.{key}" if name else key, part, depth + 1)
        elif (members := _members(name, item, space, seen)) is not None:
            for key, part in members:
                take(key, part, depth + 1)
        else:
            arrays[name] = _of_dataset(name, item, space)

    try:
        with h5py.File(path, "r") as file:
            take("", file)
    except DAMAGED as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"reading {path.name} as a MATLAB file was asked",
            f"it is damaged ({error})",
            "Save it again with -v7 or -v7.3.",
        ) from None
    return arrays


def _members(name: str, item: Any, space: Room, seen: set[int]) -> list[tuple[str, Any]] | None:
    """Return what a dataset refers to, by its places: members of a cell, or one field of an array of structures.

    None of cells of text, and where it holds values itself. Each is `seen` once: cells that stand in each other again and again are more
    than the file holds.
    """
    import h5py

    if item.attrs.get("MATLAB_empty", 0) or h5py.check_ref_dtype(item.dtype) is not h5py.Reference:
        return None
    place = h5py.h5o.get_info(item.id).addr
    if place in seen:
        raise ValueError(f"{name} stands in several places")
    seen.add(place)
    space.take(f"the members of {name}", MEMBER * item.size)  # the same part may be referred to again and again
    held = [item.file[reference] for reference in np.asarray(item[()]).ravel()]
    of, _, field = name.rpartition(".")
    cell = _class_of(item) == "cell"
    if cell and all(_holds_text(part) or part.attrs.get("MATLAB_empty", 0) for part in held):
        return None
    named = [
        member_name(name, k) if cell or not of else f"{member_name(of, k, '()')}.{field}"
        for k in range(1, len(held) + 1)
    ]
    return list(zip(named, held, strict=True))


def _of_dataset(name: str, item: Any, space: Room) -> Array:
    if item.attrs.get("MATLAB_empty", 0):
        return np.zeros(0)
    space.array(name, item.dtype, item.size or 0)
    kind = _class_of(item)
    values = np.asarray(item[()])
    if kind == "char":
        return np.array(_text(name, values, space))
    if kind == "cell":
        cells = [item.file[reference] for reference in values.ravel()]
        texts = [_text(name, np.asarray(cell[()]), space) if _holds_text(cell) else "" for cell in cells]
        return space.texts(name, texts)
    if values.dtype.names == ("real", "imag"):
        values = joined(values["real"], values["imag"])
    if values.dtype.kind not in "biufc":
        found = (
            f"it is of MATLAB's class {kind}" if "MATLAB_class" in item.attrs else "it holds what MATLAB does not write"
        )
        raise DataError(
            f"reading {name} in {space.where} was asked",
            found,
            f"Save plain arrays, and labels as cells of text, or leave it out: --ignore '{name}'",
        )
    return values.T  # MATLAB stores columns first


def _class_of(item: Any) -> str:
    kind = item.attrs.get("MATLAB_class", b"double")
    return kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)


def _holds_text(cell: Any) -> bool:
    return _class_of(cell) == "char" and not cell.attrs.get("MATLAB_empty", 0)


def _text(name: str, codes: Array, space: Room) -> str:
    """Return the text of MATLAB's 16-bit characters; in a file it stands column after column."""
    space.array(name, np.dtype("S1"), codes.size)
    return codes.T.ravel().astype("<u2", casting="same_kind").tobytes().decode("utf-16-le")
