"""Read and write Zarr folders of chunked arrays.

A group with an array `outputs` (samples, channels), and `sampling_rate`, `output_dofs`, ... as arrays or attributes; or one array with
attributes. What a folder says of its arrays is read as JSON before anything is opened: pieces that are too large, and ways of packing
that could run a program, are refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, ImpulseResponse, ModalModel, Signals
from modalscope.data.channels import Channels
from modalscope.data.mode_fields import DIRECT
from modalscope.io.arrays import names_of, to_arrays
from modalscope.io.beside import check_links
from modalscope.io.contents import Contents, Options, check_characters, damage_as_error, unreadable
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.limits import Room, room
from modalscope.io.stored import ZarrOutputs, ZarrRows, name_of_outputs, stays_stored, stored_contents, stored_response
from modalscope.numerics.checks import Array
from modalscope.numerics.documents import entries, mapping
from modalscope.numerics.errors import optional_package

#: Numbers in a chunk of the shapes.
_NUMBERS_OF_CHUNK = 1_000_000
#: Arrays that belong to the outputs that modes were identified with.
_OF_OUTPUTS = ("output_dofs", "shapes", "shapes_std", "output_units", *DIRECT)
#: Texts that are attributes, and prefixes of arrays that are omitted: the modes before refinement, and the geometry of their outputs.
_TEXTS, _OMITTED = ("input_dofs", "processing", "quantity"), ("unrefined_", "geometry_")
#: Codecs that only unpack numbers and texts.
_CODECS = {
    *("blosc", "bz2", "gzip", "lz4", "lzma", "zlib", "zstd", "shuffle", "delta", "fixedscaleoffset"),
    *("bytes", "crc32c", "transpose", "vlen-utf8", "sharding_indexed", "crc32", "adler32", "fletcher32"),
}
#: Bytes of a chunk, and of the metadata of an array, at most.
_MAX_BYTES_OF_CHUNK, _MAX_BYTES_OF_HEAD = 512_000_000, 1_000_000


def modes_in_pieces(folder: Path, modes: ModalModel, channels: Channels) -> Any:
    """Return the array of the shapes, to be filled, in a new Zarr folder with all else of some modes.

    `folder`: not there yet. `channels`: whose outputs the shapes will have.
    """
    zarr = optional_package(f"writing {folder.suffix}", "zarr", "zarr")
    group, outputs = zarr.open_group(str(folder), mode="w"), len(channels.output_dofs)
    plain = {name: array for name, array in to_arrays(modes).items() if not name.startswith(_OMITTED)}

    def made(name: str, shape: tuple[int, ...], chunks: tuple[int, ...], kind: Any, **more: Any) -> Any:
        # chunks of zeros are written, too: a missing one is damage
        config = {"write_empty_chunks": True}
        return group.create_array(name, shape=shape, chunks=chunks, dtype=kind, config=config, **more)

    for name, array in plain.items():
        if name not in _OF_OUTPUTS and array.dtype.kind in "biufc":
            made(name, array.shape, tuple(max(n, 1) for n in array.shape), array.dtype)[...] = array
    group.attrs.update({name: plain[name].tolist() for name in _TEXTS if name in plain})
    labels = np.asarray(channels.output_dofs, dtype=np.dtypes.StringDType())
    made("output_dofs", labels.shape, (_NUMBERS_OF_CHUNK,), str)[...] = labels
    count = max(len(modes), 1)
    return made("shapes", (outputs, len(modes)), (max(_NUMBERS_OF_CHUNK // count, 1), count), complex, compressors=None)


def read(path: Path, options: Options) -> Contents:
    """Read a group of arrays, or one array; a record that is large for the memory stays where it is.

    `path`: the folder. `options`: those of named arrays, and `stored`.
    """
    zarr = optional_package(f"reading {path.suffix}", "zarr", "zarr")
    if not path.is_dir():
        raise _damaged(path, "it is a file", "Unpack it: a Zarr folder is read.")
    check_links(path)
    space = room(path.name, sum(file.stat().st_size for file in path.rglob("*") if file.is_file()))
    folders = _arrays(path, space)
    attributes = _attributes(path)
    outputs = folders.pop(name_of_outputs(options), None)
    if outputs is None and "values" in folders and "frequencies" not in folders and not options.get("axes"):
        shape, size = _whole(zarr, folders["values"])
        if len(shape) == 3 and stays_stored(options, size):
            folder = folders.pop("values")
            array = zarr.open_array(str(folder), mode="r")
            chunks = getattr(array, "shards", None) or array.chunks
            small = {name: _values(zarr, name, f, space) for name, f in folders.items()} | attributes
            return stored_response(
                path.name, ZarrOutputs(str(folder), (shape[0], shape[1], shape[2]), int(chunks[1])), small, options
            )
    small = {name: _values(zarr, name, folder, space) for name, folder in folders.items()} | attributes
    if outputs is None:
        return contents_from_arrays(path.name, small, options)
    shape, size = _whole(zarr, outputs)
    if not stays_stored(options, size):
        small[name_of_outputs(options)] = _values(zarr, "outputs", outputs, space)
        return contents_from_arrays(path.name, small, options)
    if len(shape) != 2:
        remedy = "Store one run, samples in rows and channels in columns."
        raise unreadable(f"{path.name} stretch by stretch", f"its outputs have the shape {shape}", remedy)
    return stored_contents(path.name, ZarrRows(str(outputs), (shape[0], shape[1])), small, options)


def _arrays(path: Path, space: Room) -> dict[str, Path]:
    """Return the folders of the arrays by name, their heads examined; one array alone is `outputs`."""
    if _head(path) is not None:
        return {"outputs": path}
    inside = (folder for folder in sorted(path.iterdir()) if folder.is_dir())
    folders = {folder.name: folder for folder in inside if _head(folder) is not None}
    space.parts("arrays", len(folders))
    if not folders:
        raise _damaged(path, "it holds no array", "Give the folder of one array, or of a group of arrays.")
    return folders


def _head(folder: Path) -> Mapping[str, Any] | None:
    """Return what a folder says of its array; None where it holds none."""
    old, new = _json(folder / ".zarray"), _json(folder / "zarr.json")
    head = old if old is not None else new
    if head is None or (old is None and head.get("node_type") != "array"):
        return None
    with _readable(folder):
        grid = mapping(mapping(head.get("chunk_grid", {})).get("configuration", {}))
    chunks, shape = head.get("chunks") if old is not None else grid.get("chunk_shape"), head.get("shape")
    if not all(isinstance(n, list) and all(isinstance(k, int) and k >= 0 for k in n) for n in (chunks, shape)):
        raise _damaged(folder, "it does not say the shape of its array")
    if prod(chunks or ()) * 8 > _MAX_BYTES_OF_CHUNK:
        raise _damaged(folder, f"it comes in pieces of the shape {chunks}", "Write it in pieces of some megabytes.")
    promised = prod(-(-n // max(k, 1)) for n, k in zip(shape or (), chunks or (), strict=False))
    files = sum(1 for file in folder.rglob("*") if file.is_file())
    if promised > files:  # missing ones would read as zeros, and a head may promise more than can be counted
        raise _damaged(folder, f"it says that it comes in {promised} pieces, and there are {files} files")
    with _readable(folder):
        foreign = sorted(set(_codecs_of(head)) - _CODECS)
    if foreign:
        raise _damaged(folder, f"it is packed by {', '.join(foreign)}", "Write it with zstd, or unpacked.")
    return dict(head)


def _codecs_of(head: Any) -> Iterator[str]:
    """Yield the names of all codecs, those inside others, too."""
    of_chunks, of_index = ([*entries(head.get(name) or ())] for name in ("filters", "index_codecs"))
    for codec in (*of_chunks, head.get("compressor"), *entries(head.get("codecs") or ())):
        if codec is not None:
            yield str(mapping(codec).get("id") or codec.get("name")).removeprefix("numcodecs.")
            yield from _codecs_of(mapping(codec.get("configuration") or {}))
    yield from (str(mapping(codec).get("name")) for codec in of_index)


def _json(path: Path) -> Any:
    if not path.is_file():
        return None
    if path.stat().st_size > _MAX_BYTES_OF_HEAD:
        raise _damaged(path.parent, f"its {path.name} has {path.stat().st_size} bytes")
    try:
        head = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise _damaged(path.parent, f"its {path.name} is no JSON ({error})") from None
    if not isinstance(head, dict):
        raise _damaged(path.parent, f"its {path.name} says nothing")
    return head


def _attributes(path: Path) -> dict[str, Array]:
    """Return the attributes that have names of the layout, as arrays."""
    head = _json(path / ".zattrs") or (_json(path / "zarr.json") or {}).get("attributes") or {}
    known = names_of(Signals) | names_of(ImpulseResponse) | names_of(ModalModel)
    with _readable(path):
        return {name: np.asarray(value) for name, value in mapping(head).items() if name in known and value is not None}


def _whole(zarr: Any, folder: Path) -> tuple[tuple[int, ...], int]:
    """Return shape and bytes in memory of an array all of whose pieces are there."""
    with _readable(folder):
        array = zarr.open_array(str(folder), mode="r")
        there, all_ = int(array.nchunks_initialized), int(array.nchunks)
    if there < all_:  # missing ones would read as zeros
        raise _damaged(folder, f"{all_ - there} of its {all_} pieces are missing")
    return tuple(array.shape), 8 * prod(array.shape)


def _values(zarr: Any, name: str, folder: Path, space: Room) -> Array:
    _whole(zarr, folder)
    with _readable(folder):
        array = zarr.open_array(str(folder), mode="r")
        space.array(name, np.dtype(object) if array.dtype.kind not in "biufcUS" else array.dtype, prod(array.shape))
        values = np.asarray(array[...])
        check_characters(name, values)
    if values.dtype.kind in "biufc":
        return values
    return space.texts(name, [str(text) for text in values.ravel()]).reshape(values.shape)


@contextmanager
def _readable(folder: Path) -> Iterator[None]:
    with damage_as_error(f"{folder.name} as Zarr", "Copy or write it again."):
        try:
            yield
        except TypeError as error:  # the package takes names that stand in the file as those of its arguments
            raise ValueError(str(error)) from None


def _damaged(path: Path, fault: str, remedy: str = "Copy or write it again.") -> DataError:
    return unreadable(f"{path.name} as Zarr", fault, remedy)
