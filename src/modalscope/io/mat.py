"""MATLAB files up to version 7.3: the arrays of `modalscope.io.arrays` as variables.

Versions up to 7.2 are read by scipy, 7.3 (which is HDF5) by h5py. Fields of a structure are named with a dot, `test.H`, and
`rename` takes these names. MATLAB drops trailing axes of length one and makes vectors of shape (1, n): both are put right for
arrays whose number of axes the layout fixes.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io as sio

from modalscope.io.arrays import to_arrays
from modalscope.io.contents import Contents, Options, Thing
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.hdf5 import need_h5py
from modalscope.model import DataError
from modalscope.model.checks import Array

__all__ = ["read", "write"]

_VECTORS = (
    "frequencies",
    "poles",
    "frequencies_spread",
    "damping_ratios_spread",
    "frequencies_std",
    "damping_ratios_std",
)
_THREE_AXES = ("values", "variance")
_HDF5_SIGNATURE = b"MATLAB 7.3"

#: What scipy raises on damaged files.
_DAMAGED = (
    ValueError,
    TypeError,
    OSError,
    KeyError,
    IndexError,
    EOFError,
    NotImplementedError,
    OverflowError,
    MemoryError,
    AttributeError,
    zlib.error,
    sio.matlab.MatReadError,
)


def write(path: Path, thing: Thing, options: Options) -> None:
    """Write a noun as variables of a version 5 file."""
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


def read(path: Path, options: Options) -> Contents:
    """Read the variables of a file (options of `contents_from_arrays`)."""
    with path.open("rb") as file:
        new = file.read(len(_HDF5_SIGNATURE)) == _HDF5_SIGNATURE
    try:
        arrays = _read_new(path) if new else _read_old(path)
    except DataError:
        raise
    except _DAMAGED as error:
        raise DataError(
            f"reading {path.name} as a MATLAB file was asked",
            f"it is damaged or none ({type(error).__name__}: {error})",
            "Save it again with -v7 or -v7.3.",
        ) from None
    names = dict(options.get("rename") or {})
    shaped = {name: _as_layout(names.get(name, name), array, options) for name, array in arrays.items()}
    return contents_from_arrays(path.name, shaped, options)


def _as_layout(name: str, array: Array, options: Options) -> Array:
    if name in (options.get("axes") or {}):
        return array
    if name in _VECTORS or name.startswith("indicator_") or array.dtype.kind == "U":
        return array.ravel()
    return array[..., None] if name in _THREE_AXES and array.ndim == 2 else array


def _read_old(path: Path) -> dict[str, Array]:
    variables = sio.loadmat(path, squeeze_me=False, struct_as_record=True, chars_as_strings=True)
    arrays: dict[str, Array] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            arrays |= _flat(name, value)
    return arrays


def _flat(name: str, value: Any) -> dict[str, Array]:
    """Return structures as dotted names, cells of text as text arrays."""
    array = np.asarray(value)
    if array.dtype.names:
        if array.size != 1:
            raise DataError(
                f"reading {name} was asked",
                f"it is an array of {array.size} structures",
                "Save one structure, or plain arrays.",
            )
        record = array.reshape(-1)[0]
        return {key: a for field in array.dtype.names for key, a in _flat(f"{name}.{field}", record[field]).items()}
    if array.dtype.kind == "O":
        texts = [np.asarray(item).reshape(-1) for item in array.reshape(-1)]
        if any(text.dtype.kind != "U" or text.size > 1 for text in texts if text.size):
            raise DataError(
                f"reading {name} was asked",
                "it is a cell array of something other than text",
                "Save plain arrays, and labels as cells of text.",
            )
        return {name: np.array([str(text[0]) if text.size else "" for text in texts], dtype=np.str_)}
    return {name: array}


def _read_new(path: Path) -> dict[str, Array]:
    h5py = need_h5py("reading a MATLAB 7.3 file", "mat")
    arrays: dict[str, Array] = {}

    def take(prefix: str, group: Any) -> None:
        for name, item in group.items():
            if name.startswith("#"):
                continue
            if isinstance(item, h5py.Group):
                take(f"{prefix}{name}.", item)
            else:
                arrays[prefix + name] = _of_dataset(prefix + name, item, path)

    with h5py.File(path, "r") as file:
        take("", file)
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
