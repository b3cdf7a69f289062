"""MATLAB files up to version 7.3: the arrays of `modalscope.io.arrays` as variables.

Versions 5 to 7.2 are read by `mat5`, 7.3 (which is HDF5) by h5py; version 5 is written, by scipy. Fields of a structure are
named with a dot, `test.H`, and `rename` takes these names. MATLAB drops trailing axes of length one and makes vectors of
shape (1, n): both are put right for arrays whose number of axes the layout fixes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy import io as sio

from modalscope.io.arrays import INDICATOR, UNREFINED, to_arrays
from modalscope.io.contents import Contents, Options, Plain
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.marks import MARK
from modalscope.io.mat5 import read_mat5
from modalscope.model import DataError
from modalscope.model.checks import Array
from modalscope.model.extras import optional_package
from modalscope.model.mode_fields import PER_MODE

__all__ = ["read", "write"]

_VECTORS = ("frequencies", "poles", *PER_MODE)
_THREE_AXES = ("values", "variance")
_DESCRIPTION = 116
_HDF5_SIGNATURE = b"MATLAB 7.3"

#: What h5py raises on damaged files.
_DAMAGED = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError)


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
    data = path.read_bytes()
    if data.startswith(_HDF5_SIGNATURE):
        arrays = _read_new(path)
    else:
        ignore = options.get("ignore") or ()
        arrays = read_mat5(path.name, data, [ignore] if isinstance(ignore, str) else list(ignore))
    names = dict(options.get("rename") or {})
    shaped = {name: _as_layout(names.get(name, name), array, options) for name, array in arrays.items()}
    return contents_from_arrays(path.name, shaped, options)


def _as_layout(name: str, array: Array, options: Options) -> Array:
    if name in (options.get("axes") or {}):
        return array
    name = name.removeprefix(UNREFINED)
    if name in _VECTORS or name.startswith(INDICATOR) or array.dtype.kind == "U":
        return array.ravel()
    return array[..., None] if name in _THREE_AXES and array.ndim == 2 else array


def _read_new(path: Path) -> dict[str, Array]:
    h5py = optional_package("reading a MATLAB 7.3 file", "h5py", "mat")
    arrays: dict[str, Array] = {}

    def take(prefix: str, group: Any) -> None:
        for name, item in group.items():
            if name.startswith("#"):
                continue
            if isinstance(item, h5py.Group):
                take(f"{prefix}{name}.", item)
            else:
                arrays[prefix + name] = _of_dataset(prefix + name, item, path)

    try:
        with h5py.File(path, "r") as file:
            take("", file)
    except DataError:
        raise
    except _DAMAGED as error:
        raise DataError(
            f"reading {path.name} as a MATLAB file was asked",
            f"it is damaged ({error})",
            "Save it again with -v7 or -v7.3.",
        ) from None
    return arrays


def _of_dataset(name: str, item: Any, path: Path) -> Array:
    kind = item.attrs.get("MATLAB_class", b"double")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    values = np.asarray(item[()])
    if item.attrs.get("MATLAB_empty", 0):
        return np.zeros(0)
    if kind == "char":
        return np.array("".join(map(chr, values.T.ravel())))
    if kind == "cell":
        cells = [item.file[reference] for reference in values.ravel()]
        return np.array(
            [str(_of_dataset(name, cell, path)) if cell.attrs.get("MATLAB_class") == b"char" else "" for cell in cells],
            dtype=np.str_,
        )
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    if values.dtype.kind not in "biufc":
        raise DataError(
            f"reading {name} in {path.name} was asked",
            f"it is of MATLAB's class {kind}",
            "Save plain arrays, and labels as cells of text.",
        )
    return values.T  # MATLAB stores columns first
