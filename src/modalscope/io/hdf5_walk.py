"""Walk through an HDF5 file and refuse links that leave it and impossible sizes.

The HDF5 library trusts what a file says, and a damaged one can end or hold up the process that reads it. So this module also
runs as a program, in a Python of its own that loads h5py alone (`modalscope.io.limited`), which it may end. It visits what
`modalscope.io` would, with the same calls, and reads all that is packed or of variable length.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any

#: The attributes that readers look at.
ATTRIBUTES = ("CLASS", "MATLAB_class", "MATLAB_empty", "modalscope_layout")
#: Deflate, shuffle, Fletcher's checksum and LZF.
_FILTERS = (1, 2, 3, 32000)
_MAX_DEPTH, _MAX_OBJECTS, _MAX_CHUNKS, _MAX_CELLS = 32, 100_000, 10_000, 20_000
_AS_ARRAY = "Save what its cells hold as one array."
#: Bytes of the file for each chunk beyond `_MAX_CHUNKS`, at least, and of a text as an object.
_MIN_BYTES_BY_CHUNK, _BYTES_OF_TEXT = 64, 64
#: Bytes at most of a chunk of a small array, of a chunk of what is read in stretches, and of an attribute.
_MAX_BYTES_OF_CHUNK, _MAX_BYTES_OF_STRETCH, _MAX_BYTES_OF_ATTRIBUTE = 16_000_000, 512_000_000, 4096
#: What h5py raises on damaged files; TypeError is its word for types that NumPy does not have.
_DAMAGED = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError)


class Refused(Exception):
    """What is wrong with a file, and what to do about it."""

    def __init__(self, fault: str, remedy: str = "Copy or write the file again.") -> None:
        self.fault, self.remedy = fault, remedy
        super().__init__(fault)


@dataclass(slots=True)
class _Visit:
    """The bytes of the file, the bytes that its arrays may still take, and the objects visited."""

    h5py: Any
    size: int
    left: int
    streamed: str = ""
    groups: set[Any] = field(default_factory=set)
    datasets: set[Any] = field(default_factory=set)
    objects: int = 0


def walk(path: str, left: int, streamed: str = "") -> None:
    """Visit every group and dataset.

    `left`: bytes that the arrays of the file may take in memory. `streamed`: a dataset of numbers that is read in stretches: its pieces
    are bounded, not its size.

    Raises
    ------
    Refused
        Something leads out of the file, is larger than the file or the bound, or does not read.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            visit = _Visit(h5py, Path(path).stat().st_size, left, f"/{streamed}")
            _attributes(file, visit)
            _group("", file, visit, 0)
    except _DAMAGED as error:
        raise Refused(f"it is damaged or not HDF5 ({error})") from None


def _group(prefix: str, group: Any, visit: _Visit, depth: int) -> None:
    identity = visit.h5py.h5o.get_info(group.id).addr
    if identity in visit.groups or depth > _MAX_DEPTH:
        raise Refused(f"the group {prefix or '/'} is linked twice, or lies deeper than {_MAX_DEPTH} groups")
    visit.groups.add(identity)
    for name in group:
        visit.objects += 1
        if visit.objects > _MAX_OBJECTS:
            raise Refused(f"it has more than {_MAX_OBJECTS} objects")
        whole = f"{prefix}/{name}"
        if isinstance(group.get(name, getlink=True), visit.h5py.ExternalLink):
            raise Refused(f"{whole} is a link to another file", "Copy what it names into this file.")
        item = group[name]
        if isinstance(item, visit.h5py.Group):
            _attributes(item, visit)
            _group(whole, item, visit, depth + 1)
        elif isinstance(item, visit.h5py.Dataset):
            _dataset(whole, item, visit)


def stated(item: Any) -> dict[str, Any]:
    """Return the attributes of an object that are one number or one text, and short."""
    found = {}
    for name in item.attrs:
        attribute = item.attrs.get_id(name)
        short = attribute.shape in ((), (1,)) and attribute.get_storage_size() <= _MAX_BYTES_OF_ATTRIBUTE
        value: Any = item.attrs[name] if short and attribute.dtype.kind in "iufSO" else None
        value = value[0] if getattr(value, "shape", ()) == (1,) else value
        value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        if isinstance(value, str) or getattr(getattr(value, "dtype", None), "kind", "") in ("i", "u", "f"):
            found[name] = value
    return found


def _attributes(item: Any, visit: _Visit) -> None:
    visit.objects += len(item.attrs)
    stated(item)
    for name in ATTRIBUTES:
        if name in item.attrs:
            attribute = item.attrs.get_id(name)
            if attribute.get_storage_size() > _MAX_BYTES_OF_ATTRIBUTE:
                raise Refused(f"the attribute {name} of {item.name} has {attribute.get_storage_size()} bytes")
            item.attrs[name]


def _dataset(name: str, item: Any, visit: _Visit) -> None:
    _attributes(item, visit)
    plist, h5d = item.id.get_create_plist(), visit.h5py.h5d
    layout = plist.get_layout()
    if layout == h5d.VIRTUAL:
        raise Refused(f"{name} is a view of other files (a virtual dataset)", "Copy what it shows into this file.")
    if layout == h5d.CONTIGUOUS and plist.get_external_count():
        raise Refused(f"the numbers of {name} lie in another file", "Copy them into this file, with h5repack.")
    if item.shape is None:  # an empty dataset has no shape
        return
    size = prod(item.shape) * item.id.get_type().get_size()
    if name == visit.streamed and item.dtype.kind in "biuf":
        _stretches(name, item, plist, size, visit)
        return
    if size > visit.left:
        sizes = f"{size / 1e6:.0f} MB of memory, and may take {visit.left / 1e6:.0f} MB"
        raise Refused(f"{name} of shape {item.shape} takes {sizes}", "")
    visit.left -= size
    if layout == h5d.CHUNKED:
        _chunks(name, item, plist, visit)
    else:
        _whole(name, item, size, visit)
    if item.dtype.kind == "O":
        _objects(name, item, visit)
    elif layout == h5d.CHUNKED:
        item[()]


def _stretches(name: str, item: Any, plist: Any, size: int, visit: _Visit) -> None:
    """Look at a dataset that is read in stretches: at its pieces, and whether all of them are there."""
    if plist.get_layout() != visit.h5py.h5d.CHUNKED:
        _whole(name, item, size, visit)
        return
    _chunks(name, item, plist, visit)
    if prod(item.chunks) * item.dtype.itemsize > _MAX_BYTES_OF_STRETCH:
        raise Refused(f"{name} comes in pieces of the shape {item.chunks}", "Write it in pieces of some megabytes.")
    count = prod(-(-n // c) for n, c in zip(item.shape, item.chunks, strict=True))
    if item.id.get_num_chunks() < count:  # what is not there would read as zeros
        raise Refused(f"{count - item.id.get_num_chunks()} of the {count} pieces of {name} are missing")


def _whole(name: str, item: Any, size: int, visit: _Visit) -> None:
    """Compare what numbers take in the file with their shape; texts of variable length and references are pointers there."""
    stored = item.id.get_storage_size()
    if stored > visit.size or (stored and stored != size and item.dtype.kind != "O"):
        raise Refused(f"{name} has the shape {item.shape}, and {stored} bytes of the file")


def _chunks(name: str, item: Any, plist: Any, visit: _Visit) -> None:
    foreign = [number for k in range(plist.get_nfilters()) if (number := plist.get_filter(k)[0]) not in _FILTERS]
    if foreign:
        remedy = "Write it with gzip, for instance h5repack -f GZIP=4."
        raise Refused(f"{name} is packed by the filter {foreign[0]}", remedy)
    if prod(item.chunks) * item.dtype.itemsize > max(_MAX_BYTES_OF_CHUNK, item.size * item.dtype.itemsize):
        raise Refused(f"{name} has the shape {item.shape}, and comes in pieces of the shape {item.chunks}")
    count = prod(-(-n // c) for n, c in zip(item.shape, item.chunks, strict=True))
    if count > max(_MAX_CHUNKS, visit.size // _MIN_BYTES_BY_CHUNK) or item.id.get_storage_size() > visit.size:
        raise Refused(f"{name} has {count} pieces of {item.id.get_storage_size()} bytes in a file of {visit.size}")


def _objects(name: str, item: Any, visit: _Visit) -> None:
    """Read texts of variable length a few at a time, and visit what references lead to."""
    texts = visit.h5py.check_string_dtype(item.dtype) is not None
    if not texts and visit.h5py.check_ref_dtype(item.dtype) is not visit.h5py.Reference:
        raise Refused(f"{name} holds neither numbers nor texts", "Store plain arrays.")
    if not texts and item.size > _MAX_CELLS:
        raise Refused(f"{name} has {item.size} cells, where at most {_MAX_CELLS} are expected", _AS_ARRAY)
    if item.ndim == 0 or not texts:
        values = [item[()]] if item.ndim == 0 else item[()].ravel()
        for value in values:
            _text(name, value, visit) if texts else _reference(name, item, value, visit)
        return
    step, start = 1, 0
    while start < item.shape[0]:
        before = visit.left
        for value in item[start : start + step].ravel():
            _text(name, value, visit)
        start += step
        step = min(2 * step, 4096) if before - visit.left < 1_000_000 else 1


def _text(name: str, value: bytes, visit: _Visit) -> None:
    visit.left -= _BYTES_OF_TEXT + len(value)
    if visit.left < 0:
        raise Refused(f"the texts of {name} take more memory than those of such a file may", "")
    value.decode()


def _reference(name: str, item: Any, reference: Any, visit: _Visit) -> None:
    """Visit what a cell of MATLAB leads to; what has a name is visited under it."""
    target = item.file[reference] if reference else None
    if not isinstance(target, visit.h5py.Dataset):
        raise Refused(f"a cell of {name} leads nowhere")
    identity = visit.h5py.h5o.get_info(target.id).addr
    if identity not in visit.datasets:
        visit.datasets.add(identity)
        _dataset(f"{name} (a cell)", target, visit)


def refusal(path: str, left: int, streamed: str) -> list[str]:
    """Return the fault of a file that `walk` refuses, and the remedy; nothing of a file that is sound."""
    try:
        walk(path, left, streamed)
    except Refused as refused:
        return [refused.fault, refused.remedy]
    return []


if __name__ == "__main__":
    sys.stdout.write(json.dumps(refusal(sys.argv[1], int(sys.argv[2]), sys.argv[3])))
