"""Read and write HDF5: the arrays of `modalscope.io.arrays` as datasets of the root group.

Layout: a complex array `values` is two datasets, `values_real` and `values_imag`; texts are variable-length UTF-8; single
values are scalar datasets. The axes carry dimension scales (`line` = `frequencies`, `output`, `input`, `sample`, `run`,
`mode`), which netCDF readers take for named dimensions. The root attribute `modalscope_layout` is 1. Arrays carry Fletcher's
checksum, which HDF5 itself compares, and the whole file ends in a seal, the SHA-256 of all before it, behind what HDF5 reads.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data.mode_fields import DIRECT
from modalscope.io import hdf5_walk
from modalscope.io.apart import python, run_apart
from modalscope.io.arrays import AXES, joined, to_arrays
from modalscope.io.columns.vocabulary import key_meaning
from modalscope.io.columns.words import is_unit
from modalscope.io.contents import ArrayData, Contents, Options, damage_as_error, unreadable
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.limits import Room, raise_the_limit, room
from modalscope.io.stored import Hdf5Rows, name_of_outputs, stays_stored, stored_contents
from modalscope.numerics.checks import Array
from modalscope.numerics.errors import optional_package

_MARK = b"\nmodalscope sha256 "
_DIGITS = 64
_LAYOUT = 1
#: What attributes state.
_STATED = ("rate", "step", "frequency step", "first", "unit")
#: Axes of arrays beside those of `AXES`.
_DIMENSIONS = {
    **dict.fromkeys(("output_dofs", "output_units", "quantities"), ("outputs",)),
    **dict.fromkeys(("input_dofs", "input_units"), ("inputs",)),
    **dict.fromkeys(DIRECT, ("outputs", "inputs")),
    "frequencies": ("lines",),
    "poles": ("modes",),
}


def write(path: Path, thing: ArrayData, options: Options) -> None:
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


def _axes(thing: ArrayData, name: str, array: Array) -> tuple[str, ...]:
    """Return the names of an array's axes; the first ones of a data object that may lack runs or inputs."""
    axes = AXES.get(type(thing), {}).get(name) or _DIMENSIONS.get(name, ())
    if name in ("outputs", "inputs") and array.ndim == 2:
        axes = axes[1:]
    return tuple(axis.removesuffix("s") for axis in axes[: array.ndim])


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
    """Read a file in this layout, or any HDF5 file by the names of its datasets and what attributes state."""
    h5py = optional_package(f"reading {path.suffix}", "h5py", "hdf5")
    space = room(path.name, path.stat().st_size)
    # a file says truly how large its arrays are when it has been walked through: until then its own size decides
    streamed = name_of_outputs(options) if stays_stored(options, path.stat().st_size) else ""
    check_hdf5(path, space, streamed)
    rows: Hdf5Rows | None = None
    with damage_as_error(f"{path.name} as HDF5", "Copy or write the file again."):
        with h5py.File(path, "r") as file:
            if streamed in file:
                rows = _rows(path, streamed, file[streamed])
            arrays = _arrays(h5py, file, space, "", streamed if rows else "")
            if not all(isinstance(name, str) for name in arrays):
                raise ValueError("a name in it is no text")
        for name in [name for name in arrays if name.endswith("_real")]:
            base = name.removesuffix("_real")
            if f"{base}_imag" in arrays:
                arrays[base] = joined(arrays.pop(name), arrays.pop(f"{base}_imag"))
    if rows is not None:
        return stored_contents(path.name, rows, arrays, options)
    return contents_from_arrays(path.name, arrays, options)


def _arrays(h5py: Any, group: Any, space: Room, prefix: str, streamed: str) -> dict[str, Array]:
    """Return the datasets of a group and of those in it, and what attributes state, names parted by points.

    A unit stands behind the name of its dataset, in brackets; rates, steps and first values are arrays of one number.
    """
    arrays: dict[str, Array] = {}
    own = "modalscope_layout" in group.file.attrs
    for name, item in group.items():
        attributes = {} if own else hdf5_walk.stated(item)
        said = {key: value for key, value in attributes.items() if key_meaning(key) in _STATED}
        unit = next((str(value) for key, value in said.items() if key_meaning(key) == "unit"), "")
        # one without a shape is null, and holds nothing
        if isinstance(item, h5py.Dataset) and item.shape is not None and not _is_axis(name, item) and name != streamed:
            head = f"{prefix}{name} [{unit}]" if is_unit(unit) else f"{prefix}{name}"
            arrays[head] = _values(name, item, space)
            arrays |= _numbers(prefix, said)
        elif isinstance(item, h5py.Group) and not own:
            arrays |= _arrays(h5py, item, space, f"{prefix}{name}.", streamed)
    return arrays | ({} if own else _numbers(prefix, hdf5_walk.stated(group)))


def _numbers(prefix: str, said: Mapping[str, Any]) -> dict[str, Array]:
    """Return the attributes that state a rate, a step or a first value as arrays."""
    held = {key: np.asarray(value) for key, value in said.items() if key_meaning(key) in _STATED}
    return {f"{prefix}{key}": value for key, value in held.items() if value.dtype.kind in "iuf"}


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


def seal(path: Path) -> None:
    """Append the checksum of a file that is complete."""
    with path.open("r+b") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0, os.SEEK_END)
        file.write(_MARK + digest.encode())


def check_hdf5(path: Path, room: Room, streamed: str = "") -> None:
    """Raise a `DataError` where a file is damaged, leads out of itself, or is larger than it may be.

    A file whose seal holds is walked in this process; another one by a Python of its own first (`hdf5_walk`). The seal finds damage, not
    malice: what leads out of a file is refused in both cases.

    `room`: what its arrays may take. `streamed`: the dataset that is read stretch by stretch: its chunks are bounded, not its size.
    """
    try:
        here = _is_sealed(path) or not python()
        answer = hdf5_walk.refusal(str(path), room.left, streamed) if here else _apart(path, room, streamed)
    except UnicodeEncodeError:
        answer = ["its name has characters that no text has", "Rename the file."]
    if answer:
        raise unreadable(f"{path.name} as HDF5", answer[0], answer[1] or raise_the_limit())


def names_in(path: Path) -> list[str]:
    """Return the names in the root group of a file that was checked."""
    h5py = optional_package(f"reading {path.suffix}", "h5py", "hdf5")
    with damage_as_error(f"{path.name} as HDF5", "Copy or write the file again."), h5py.File(path, "r") as file:
        return list(map(str, file))


def _is_sealed(path: Path) -> bool:
    """Whether the file carries a seal that holds."""
    size = path.stat().st_size - len(_MARK) - _DIGITS
    if size < 0:
        return False
    digest = hashlib.sha256()
    with path.open("rb") as file:
        file.seek(size)
        mark, written = file.read(len(_MARK)), file.read(_DIGITS)
        if mark != _MARK:
            return False
        file.seek(0)
        while size > 0:
            part = file.read(min(size, 1 << 20))
            digest.update(part)
            size -= len(part)
    if digest.hexdigest().encode() != written:
        fault = "its contents do not match its checksum: it is damaged"
        raise unreadable(f"{path.name} as HDF5", fault, "Copy or write it again.")
    return True


def _apart(path: Path, room: Room, streamed: str) -> list[str]:
    """Walk in a Python of its own, which finds h5py where this one does and nothing else."""
    fault, told = run_apart("h5py", room, [hdf5_walk.__file__, str(path), str(room.left), streamed])
    try:
        return list(json.loads(told))
    except ValueError:
        return [f"it is damaged: {fault or 'its reader says nothing'}", "Copy or write it again."]
