"""Read and write HDF5: the arrays of `modalscope.io.arrays` as datasets of the root group.

Layout: a complex array `values` is two datasets, `values_real` and `values_imag`; texts are variable-length UTF-8; single
values are scalar datasets. The axes carry dimension scales (`line` = `frequencies`, `output`, `input`, `sample`, `run`,
`mode`), which netCDF readers take for named dimensions. The root attribute `modalscope_layout` is 1. Arrays carry Fletcher's
checksum, which HDF5 itself compares, and the whole file ends in a seal (`hdf5_guard`).
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, ImpulseResponse
from modalscope.io.arrays import joined, to_arrays
from modalscope.io.contents import Contents, Options, Plain
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.hdf5_guard import check_hdf5, seal
from modalscope.io.limits import Room, room
from modalscope.io.stored import Hdf5Rows, name_of_outputs, stays_stored, stored_contents
from modalscope.numerics.checks import Array
from modalscope.numerics.extras import optional_package

_LAYOUT = 1

#: What h5py raises on damaged files.
DAMAGED = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError, OverflowError)

_DIMENSIONS = {
    "frequencies": ("line",),
    "values": ("line", "output", "input"),
    "variance": ("line", "output", "input"),
    "coherence": ("line", "output", "input"),
    "outputs": ("run", "sample", "output"),
    "inputs": ("run", "sample", "input"),
    "poles": ("mode",),
    "shapes": ("output", "mode"),
    "participation": ("mode", "input"),
    "feedthrough": ("output", "input"),
    "lower_residual": ("output", "input"),
    "upper_residual": ("output", "input"),
    "output_dofs": ("output",),
    "output_units": ("output",),
    "quantities": ("output",),
    "input_dofs": ("input",),
    "input_units": ("input",),
}


def write(path: Path, thing: Plain, options: Options) -> None:
    """Write a data object; binary, so that it is read back exactly."""
    h5py = optional_package(f"writing {path.suffix}", "h5py", "hdf5")
    axes: dict[str, tuple[str, ...]] = {}
    # in memory: HDF5 that meets a full disk while it closes a file can take the whole process with it
    image = BytesIO()
    # metadata of version 1.10 have checksums of their own
    with h5py.File(image, "w", libver=("v110", "v110")) as file:
        file.attrs["modalscope_layout"] = _LAYOUT
        for name, array in to_arrays(thing).items():
            if array.dtype.kind == "U":
                file.create_dataset(name, data=array.astype(object), dtype=h5py.string_dtype("utf-8"))
                parts: tuple[str, ...] = (name,)
            elif array.dtype.kind == "c":
                parts = (f"{name}_real", f"{name}_imag")
                _store(file, parts[0], array.real)
                _store(file, parts[1], array.imag)
            else:
                _store(file, name, array)
                parts = (name,)
            axes |= dict.fromkeys(parts, _axes(thing, name, array))
        # the frequencies are a scale of their own, so that all datasets are there before their axes are named
        for name, names in axes.items():
            _label(file, name, names)
    path.write_bytes(image.getbuffer())
    seal(path)


def _store(file: Any, name: str, array: Array) -> None:
    """Write numbers; single ones and none at all have no pieces that could carry a checksum."""
    file.create_dataset(name, data=array, fletcher32=bool(array.ndim and array.size))


def _axes(thing: Plain, name: str, array: Array) -> tuple[str, ...]:
    """Return the names of an array's axes; the first ones of a data object that may lack runs or inputs."""
    axes = _DIMENSIONS.get(name, ())
    if isinstance(thing, ImpulseResponse):
        axes = tuple("sample" if axis == "line" else axis for axis in axes)
    if name in ("outputs", "inputs") and array.ndim == 2:
        axes = axes[1:]
    return axes[: array.ndim]


def _label(file: Any, name: str, axes: tuple[str, ...]) -> None:
    for k, axis in enumerate(axes):
        scale = "frequencies" if axis == "line" else axis
        if scale == name:
            file[name].make_scale(name)
            continue
        if scale not in file:
            file.create_dataset(scale, data=np.arange(file[name].shape[k]))
            file[scale].make_scale(scale)
        file[name].dims[k].attach_scale(file[scale])


def read(path: Path, options: Options) -> Contents:
    """Read a file in this layout, or any HDF5 file whose root datasets are renamed to it."""
    h5py = optional_package(f"reading {path.suffix}", "h5py", "hdf5")
    space = room(path.name, path.stat().st_size)
    # a file says truly how large its arrays are when it has been walked through: until then its own size decides
    streamed = name_of_outputs(options) if stays_stored(options, path.stat().st_size) else ""
    check_hdf5(path, space, streamed)
    rows: Hdf5Rows | None = None
    try:
        with h5py.File(path, "r") as file:
            if streamed in file:
                rows = _rows(path, streamed, file[streamed])
            arrays = {
                name: _values(name, item, space)
                for name, item in file.items()
                if isinstance(item, h5py.Dataset) and not _is_axis(name, item) and not (rows and name == streamed)
            }
            if not all(isinstance(name, str) for name in arrays):
                raise ValueError("a name in it is no text")
    except DAMAGED as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"reading {path.name} as HDF5 was asked",
            f"it is damaged or not HDF5 ({error})",
            "Copy or write the file again.",
        ) from None
    for name in [name for name in arrays if name.endswith("_real") and name.removesuffix("_real") + "_imag" in arrays]:
        base = name.removesuffix("_real")
        try:
            arrays[base] = joined(arrays.pop(name), arrays.pop(base + "_imag"))
        except ValueError as error:
            raise DataError(
                f"{base} in {path.name} needs real and imaginary parts of one shape",
                str(error),
                "Write the file again.",
            ) from None
    if rows is not None:
        return stored_contents(path.name, rows, arrays, options)
    return contents_from_arrays(path.name, arrays, options)


def _rows(path: Path, name: str, item: Any) -> Hdf5Rows | None:
    """Return a dataset of samples and channels as rows; None of another."""
    if len(item.shape or ()) != 2 or item.dtype.kind not in "biuf":
        return None
    return Hdf5Rows(str(path), name, (int(item.shape[0]), int(item.shape[1])))


def _is_axis(name: str, item: Any) -> bool:
    """Whether a dataset only counts an axis; `is_scale` of h5py breaks off in damaged files."""
    return name in ("output", "input", "sample", "run", "mode") and item.attrs.get("CLASS") == b"DIMENSION_SCALE"


def _values(name: str, item: Any, space: Room) -> Array:
    space.array(name, item.dtype, item.size or 0)
    if item.dtype.kind != "O":
        return np.asarray(item[()])
    texts = np.asarray(item.asstr()[()])
    return space.texts(name, [str(text) for text in texts.ravel()]).reshape(texts.shape)
