"""Open records that are too large for memory: the samples stay in the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, ImpulseResponse, Signals, StoredResponse, StoredSignals
from modalscope.data.stored import Rows
from modalscope.io.contents import DAMAGED, Contents, Finding, Options, unreadable
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.numerics.checks import Array
from modalscope.numerics.errors import optional_package
from modalscope.numerics.resources import allowed_memory

#: A record larger than the memory divided by this stays in its file.
_PARTS_OF_MEMORY = 4


def stays_stored(options: Options, size: int) -> bool:
    """Whether a record of so many bytes stays in its file: as asked, or where it is large for the memory.

    `options`: with `stored` True or False where that was asked.
    """
    asked = options.get("stored")
    if asked is None:
        return size > allowed_memory() // _PARTS_OF_MEMORY
    if not isinstance(asked, bool):
        raise DataError(f"stored={asked!r}:", "it can only be True or False", "Give one of these, or leave it out.")
    return asked


def name_of_outputs(options: Options) -> str:
    """Return the name in the file of what is called `outputs` here.

    `options`: with `rename`.

    Examples
    --------
    >>> name_of_outputs({"rename": {"y": "outputs"}}), name_of_outputs({})
    ('y', 'outputs')
    """
    renamed = dict(options.get("rename") or {})
    return next((name for name, meant in renamed.items() if meant == "outputs"), "outputs")


def identity_of(path: Path) -> str:
    """Return name, size and date of a file, which change with it."""
    status = path.stat()
    return f"{path.resolve()} {status.st_size} {status.st_mtime_ns}"


@dataclass(frozen=True)
class Hdf5Rows:
    """A dataset of an HDF5 file."""

    path: str
    name: str
    shape: tuple[int, int]

    @property
    def identity(self) -> str:
        """The file, and the dataset."""
        return f"{identity_of(Path(self.path))} {self.name} {self.shape}"

    def read(self, start: int, stop: int) -> Array:
        """Return some rows; the file is open no longer than that."""
        h5py = optional_package("reading an HDF5 file", "h5py", "hdf5")
        with _readable(self.path, f"samples {start} to {stop - 1}"), h5py.File(self.path, "r") as file:
            return np.asarray(file[self.name][start:stop])


@dataclass(frozen=True)
class ZarrRows:
    """An array of a Zarr folder.

    `path`: of the array's own folder.
    """

    path: str
    shape: tuple[int, int]

    @property
    def identity(self) -> str:
        """The folder, and what it says of the array."""
        heads = (Path(self.path) / name for name in ("zarr.json", ".zarray"))
        return " ".join(identity_of(head) for head in heads if head.exists())

    def read(self, start: int, stop: int) -> Array:
        """Return some rows."""
        return _of_zarr(self.path, (slice(start, stop),), f"samples {start} to {stop - 1}")


@dataclass(frozen=True)
class ZarrOutputs:
    """Impulse responses in an array of a Zarr folder, some outputs at a time.

    `path`: of the array's own folder. `shape`: samples, outputs, inputs. `together`: outputs that lie in one piece.
    """

    path: str
    shape: tuple[int, int, int]
    together: int

    @property
    def identity(self) -> str:
        """The folder, and what it says of the array."""
        return ZarrRows(self.path, self.shape[:2]).identity

    def read(self, start: int, stop: int) -> Array:
        """Return some outputs, (N, outputs, m)."""
        return _of_zarr(self.path, (slice(None), slice(start, stop)), f"outputs {start} to {stop - 1}")


def _of_zarr(path: str, part: tuple[slice, ...], what: str) -> Array:
    zarr = optional_package("reading a Zarr folder", "zarr", "zarr")
    with _readable(path, what):
        return np.asarray(zarr.open_array(path, mode="r")[part])


@contextmanager
def _readable(path: str, what: str) -> Iterator[None]:
    try:
        yield
    except DAMAGED as error:
        fault = f"the file is damaged or gone ({error})"
        raise unreadable(f"{what} of {Path(path).name}", fault, "Copy or write the file again.") from error


def stored_contents(where: str, rows: Rows, arrays: Mapping[str, Array], options: Options) -> Contents:
    """Return a record whose samples stay where they are.

    `rows`: the outputs. `arrays`: the others, by the names in the file: rate, labels, units. `options`: of files of named
    arrays.

    Raises `DataError`: more than two axes, inputs, no sampling rate, what the data object refuses.
    """
    name, samples = name_of_outputs(options), rows.shape[0]
    kept = {key: array for key, array in arrays.items() if array.ndim == 0 or len(array) != samples}
    options = dict(options)
    if "time" in arrays and "sampling_rate" not in {*kept, *options}:
        time = np.asarray(arrays["time"], dtype=float)
        options["sampling_rate"] = float((len(time) - 1) / (time[-1] - time[0]))
    ignored = [options["ignore"]] if isinstance(options.get("ignore"), str) else list(options.get("ignore") or ())
    options["ignore"] = [key for key in ignored if key in kept or key not in arrays]
    unused = [key for key in arrays if key not in kept and key not in ("time", *ignored)]
    renamed = dict(options.get("rename") or {})
    if any(renamed.get(key, key) == "inputs" for key in unused):
        fault = "it holds inputs, and only records of outputs are read so"
        remedy = "Leave them out, ignore=['inputs'], or allow it the memory: --max-memory."
        raise unreadable(f"{where} stretch by stretch", fault, remedy)
    contents = contents_from_arrays(where, kept | {name: np.asarray(rows.read(0, 2))}, options)
    head = contents.thing
    assert isinstance(head, Signals)
    record = StoredSignals(rows=rows, sampling_rate=head.sampling_rate, quantities=head.quantities, **head.labelled())
    findings = [Finding(part=name, what=f"{'x'.join(map(str, rows.shape))}, read stretch by stretch")]
    findings += [finding for finding in contents.found if finding.part != name]
    findings += [Finding(part=key, what="", taken=False, reason="unused") for key in unused]
    return replace(contents, thing=record, found=tuple(findings))


def stored_response(where: str, blocks: ZarrOutputs, arrays: Mapping[str, Array], options: Options) -> Contents:
    """Return impulse responses whose samples stay where they are.

    `arrays`: the others, by the names in the file. `options`: of files of named arrays.

    Raises `DataError`: no sampling rate, what the data object refuses.
    """
    labels = arrays.get("output_dofs")
    kept = {key: array for key, array in arrays.items() if key not in ("output_dofs", "output_units", "feedthrough")}
    contents = contents_from_arrays(where, kept | {"values": np.asarray(blocks.read(0, 1))}, options)
    head = contents.thing
    assert isinstance(head, ImpulseResponse)
    names = {field.name for field in fields(StoredResponse)} - {"blocks", "output_dofs", "units"}
    values: dict[str, Any] = {name: getattr(head, name) for name in names}
    values["output_dofs"] = None if labels is None else tuple(map(str, labels))
    response = StoredResponse(blocks=blocks, **values | {"units": (None, head.units[1])})
    finding = Finding(part="values", what=f"{'x'.join(map(str, blocks.shape))}, read some outputs at a time")
    others = (other for other in contents.found if other.part != "values")
    return replace(contents, thing=response, found=(finding, *others))
