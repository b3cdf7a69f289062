"""Read and write MATLAB files, versions 5 to 7.3.

Versions 5 to 7.2 are read here element by element, 7.3 (which is HDF5) by h5py; version 5 is written, by scipy. scipy's reader trusts the
sizes that a file states and can end the whole program on a damaged cell array (version 1.17 does). Here every size is checked before it
is used, and compressed data are inflated within bounds (`limits`). Numeric arrays, text, cells and structures are read; sparse matrices,
objects (tf, table, timetable) and functions are ignored, and named.

Fields of a structure are named with a dot, `test.H`, and `rename` takes these names. Members of cells and of arrays of structures have
their place in their name (`runs{2}`, `test(2).acc`); `members` says what they are together. MATLAB drops trailing axes of length one and
makes vectors of shape (1, n): both are restored for arrays whose number of axes the layout fixes.

Source: MATLAB MAT-File Format, version 5 (The MathWorks).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, StateSpace
from modalscope.data.mode_fields import PER_MODE
from modalscope.io.arrays import INDICATOR, UNREFINED, class_of, joined, to_arrays
from modalscope.io.atomic import MARK
from modalscope.io.contents import ArrayData, Contents, Finding, Options, damage_as_error, unreadable
from modalscope.io.from_arrays import contents_from_arrays
from modalscope.io.hdf5 import check_hdf5
from modalscope.io.limits import MOST_PARTS, Room, room
from modalscope.io.members import BYTES_OF_MEMBER, member_name
from modalscope.numerics.checks import Array
from modalscope.numerics.errors import optional_package

_BYTES_OF_HEADER, _BYTES_OF_DESCRIPTION = 128, 116
#: Bytes of a variable within which its name stands.
_BYTES_OF_NAME = 1024
_HDF5_SIGNATURE = b"MATLAB 7.3"
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {2: "latin-1", 16: "utf-8", 17: "utf-16"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCTURE, _CHARACTERS, _FIRST_NUMBER, _LAST_NUMBER = 1, 2, 4, 6, 15
_IS_COMPLEX = 0x0800
_OBJECT, _OPAQUE = 3, 17
_UNREAD_CLASSES = {_OBJECT: "object", 5: "sparse", 16: "function", _OPAQUE: "object"}
#: Classes of MATLAB 7.3 that are read.
_READ_CLASSES = {
    *("double", "single", "logical", "char", "cell", "struct", "canonical empty"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}
#: Depth of cells and structures in each other, and characters of a name in MATLAB.
_MAX_DEPTH, _MAX_LETTERS = 16, 63
#: Arrays of the layout that are vectors, and those that have three axes.
_VECTORS, _THREE_AXES = ("frequencies", "poles", *PER_MODE), ("values", "variance")

Element = tuple[int, memoryview]


class _Damaged(Exception):
    """A size or a type that is impossible; the reader raises it as a DataError."""


@dataclass(frozen=True, slots=True)
class _Reading:
    """The order of bytes, the room that is left, and variables that are not read, with their class."""

    order: str
    room: Room
    left: dict[str, str]


def read_mat5(data: bytes, room: Room, ignore: Collection[str], left: dict[str, str]) -> dict[str, Array]:
    """Return the variables of a file; fields of structures are named with a dot, cells of text are text arrays.

    Members of other cells are named `runs{1}`, those of arrays of structures `test(1).acc`. `left`: takes up the names of what is not
    read, with the class.

    Raises `DataError`: a damaged file, an older version, or more than the room.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:_BYTES_OF_HEADER])
    if order is None:
        fault = "it has no header of version 5 or later"
        raise unreadable(f"{room.where} as a MATLAB file", fault, "Save it in MATLAB with -v7 or -v7.3.")
    arrays: dict[str, Array] = {}
    file = _Reading(order, room, left)
    damaged = (_Damaged, zlib.error, struct.error, UnicodeDecodeError)
    with damage_as_error(f"{room.where} as a MATLAB file", "Copy it again, or save it again with -v7.", damaged):
        for kind, body in _elements(memoryview(data)[_BYTES_OF_HEADER:], file):
            arrays |= _variable(file, kind, body, ignore)
    return arrays


def _variable(file: _Reading, kind: int, body: memoryview, ignore: Collection[str]) -> dict[str, Array]:
    before, data = file.room.left, b""
    if kind == _COMPRESSED:
        name, size = _name_and_size(body, file)
        if name in ignore:
            return {name: np.array("not read")}
        if size > file.room.left:
            file.room.take(name, size)
        data = _inflated(body, size)
        (kind, body), *others = list(_elements(memoryview(data), file)) or [(kind, body)]
        if others:
            raise _Damaged("a variable has another behind it")
    if kind != _MATRIX:
        raise _Damaged(f"an element of type {kind} stands where a variable should")
    name = _matrix_head(body, file)[2]
    arrays = {name: np.array("not read")} if name in ignore else _matrix(name, body, file) if name else {}
    # what was inflated and not used counts, too
    file.room.take(name or "what is compressed", max(0, len(data) - (before - file.room.left)))
    return arrays


def _name_and_size(body: memoryview, file: _Reading) -> tuple[str, int]:
    """Return the name of a compressed variable and the bytes that it states, of which no more is inflated."""
    begin = memoryview(zlib.decompressobj().decompress(body, _BYTES_OF_NAME))
    head = [data for _, data in islice(_elements(begin[8:], file), 3)] if len(begin) > 8 else []
    return str(head[-1], "latin-1") if len(head) == 3 else "", struct.unpack_from(file.order + "I", begin, 4)[0] + 8


def _inflated(body: memoryview, size: int) -> bytes:
    """Return data uncompressed; they stay in memory with the arrays that are made of them."""
    stream = zlib.decompressobj()
    data = stream.decompress(body, size + 8)
    if not stream.eof:
        raise _Damaged("compressed data are cut off, or more than they say")
    return data


def _elements(data: memoryview, file: _Reading) -> Iterator[Element]:
    position = count = 0
    while position < len(data):
        if len(data) - position < 8:
            raise _Damaged("an element is cut off")
        kind, size = struct.unpack_from(file.order + "II", data, position)
        start = position + 8
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, size, start = kind & 0xFFFF, kind >> 16, position + 4
        limit = position + 8 if start == position + 4 else len(data)
        if start + size > limit:
            raise _Damaged(f"an element counts {size} bytes where {limit - start} are left")
        count += 1
        if count > MOST_PARTS:
            file.room.parts("members of one array", count)
        yield kind, data[start : start + size]
        position = position + 8 if start == position + 4 else start + size
        if kind != _COMPRESSED:
            position += -position % 8


def _matrix_head(body: memoryview, file: _Reading) -> tuple[int, tuple[int, ...], str, list[Element]]:
    """Return flags, dimensions, name and the elements that follow; what is opaque has no dimensions, but its class behind its name."""
    parts = list(_elements(body, file))
    flags = struct.unpack_from(file.order + "I", parts[0][1])[0] if parts and len(parts[0][1]) >= 4 else 0
    if flags & 0xFF == _OPAQUE and len(parts) > 3:
        return flags, (), str(parts[1][1], "latin-1"), parts[3:]
    if len(parts) < 3 or len(parts[0][1]) < 4 or parts[1][0] != 5 or not 2 <= len(parts[1][1]) // 4 <= 32:
        raise _Damaged("a variable has no flags, dimensions and name")
    shape = tuple(int(n) for n in np.frombuffer(parts[1][1][: len(parts[1][1]) // 4 * 4], file.order + "i4"))
    if min(shape) < 0:
        raise _Damaged(f"a variable has the dimensions {shape}")
    return flags, shape, str(parts[2][1], "latin-1"), parts[3:]


def _matrix(name: str, body: memoryview, file: _Reading, depth: int = 0) -> dict[str, Array]:
    if not body:
        return {name: np.zeros((0, 0))}
    if depth > _MAX_DEPTH:
        raise _Damaged(f"arrays lie deeper than {_MAX_DEPTH} in each other")
    flags, shape, _, parts = _matrix_head(body, file)
    kind = flags & 0xFF
    if _FIRST_NUMBER <= kind <= _LAST_NUMBER:
        values = _numbers(name, parts[:1], shape, file)
        return {name: joined(values, _numbers(name, parts[1:2], shape, file)) if flags & _IS_COMPLEX else values}
    if kind == _CHARACTERS:
        return {name: _characters(name, parts[:1], shape, file)}
    if kind == _CELL:
        return _cell(name, parts, shape, file, depth)
    if kind == _STRUCTURE:
        return _structure(name, parts, shape, file, depth)
    if kind not in _UNREAD_CLASSES:
        raise _Damaged(f"a variable is of class {kind}")
    named = kind in (_OBJECT, _OPAQUE) and parts and len(parts[0][1]) <= _MAX_LETTERS
    file.left[name] = (str(parts[0][1], "latin-1") if named else "").strip("\0") or _UNREAD_CLASSES[kind]
    return {}


def _numbers(name: str, parts: list[Element], shape: tuple[int, ...], file: _Reading) -> Array:
    if not parts or parts[0][0] not in _NUMBERS:
        raise _Damaged("an array has no numbers")
    kind, data = parts[0]
    word = np.dtype(file.order + _NUMBERS[kind])
    if len(data) != prod(shape) * word.itemsize:
        raise _Damaged(f"an array of shape {shape} has {len(data)} bytes of numbers")
    file.room.array(name, word, prod(shape))
    return np.frombuffer(data, word).reshape(shape, order="F").astype(word.newbyteorder("="))


def _characters(name: str, parts: list[Element], shape: tuple[int, ...], file: _Reading) -> Array:
    if not prod(shape):
        return np.array("")
    if not parts:
        raise _Damaged("a text has no characters")
    kind, data = parts[0]
    file.room.take(name, 4 * len(data))
    if kind == 4:  # characters of two bytes, each by itself
        text, count = str(data[: len(data) // 2 * 2], "utf-16-" + ("le" if file.order == "<" else "be")), len(data) // 2
    else:
        text = str(data, _TEXTS.get(kind, "latin-1"))
        count = len(text)
    if count != prod(shape) or len(shape) != 2:
        raise _Damaged(f"a text of shape {shape} has {count} characters")
    rows = [text[k :: shape[0]].rstrip() for k in range(shape[0])]
    return file.room.texts(name, rows) if shape[0] > 1 else np.array(text, dtype=np.str_)


def _cell(name: str, parts: list[Element], shape: tuple[int, ...], file: _Reading, depth: int) -> dict[str, Array]:
    """Return a cell array: one array of texts where it holds nothing else, else its members by their places."""
    if len(parts) != prod(shape) or any(kind != _MATRIX for kind, _ in parts):
        raise _Damaged(f"a cell array of shape {shape} has {len(parts)} members")
    file.room.take(f"the members of {name}", BYTES_OF_MEMBER * len(parts))
    members = [_matrix(member_name(name, k), body, file, depth + 1) for k, (_, body) in enumerate(parts, 1)]
    bare = [member.get(member_name(name, k)) if len(member) == 1 else None for k, member in enumerate(members, 1)]
    if all(item is not None and (not item.size or (item.dtype.kind == "U" and item.size == 1)) for item in bare):
        return {name: file.room.texts(name, [str(item) if item is not None and item.size else "" for item in bare])}
    return {key: array for member in members for key, array in member.items()}


def _structure(name: str, parts: list[Element], shape: tuple[int, ...], file: _Reading, depth: int) -> dict[str, Array]:
    width = struct.unpack(file.order + "i", parts[0][1])[0] if parts and len(parts[0][1]) == 4 else 0
    names = bytes(parts[1][1]) if len(parts) > 1 and width > 0 else b""
    if len(names) > width * len(parts):
        raise _Damaged(f"a structure of {len(parts) - 2} values has {len(names)} bytes of names")
    fields = [names[k : k + width].split(b"\0")[0].decode("latin-1") for k in range(0, len(names), max(width, 1))]
    count = prod(shape)
    if not fields or len(parts) != 2 + len(fields) * count or any(kind != _MATRIX for kind, _ in parts[2:]):
        raise _Damaged(f"{count} structures of {len(fields)} fields have {len(parts) - 2} values")
    arrays: dict[str, Array] = {} if count else {name: np.zeros((0, 0))}
    file.room.take(f"the members of {name}", BYTES_OF_MEMBER * (len(parts) - 2))
    for k, (_, body) in enumerate(parts[2:]):
        place, field = divmod(k, len(fields))
        owner = name if count == 1 else member_name(name, place + 1, "()")
        arrays |= _matrix(f"{owner}.{fields[field]}", body, file, depth + 1)
    return arrays


def write(path: Path, thing: ArrayData, options: Options) -> None:
    """Write a data object as variables of a version 5 file."""
    arrays: dict[str, Any] = {
        name: array.astype(object) if array.dtype.kind == "U" and array.ndim else array
        for name, array in to_arrays(thing).items()
    }
    long = [name for name in arrays if len(name) > _MAX_LETTERS]
    if long:
        fault = f"the name {long[0]!r} is longer than MATLAB's {_MAX_LETTERS} characters"
        raise DataError(f"writing {path.suffix}:", fault, "Use .npz or .h5.")
    from scipy.io import savemat  # takes .025 s, and reading needs none of it

    savemat(str(path), arrays, appendmat=False, long_field_names=True, oned_as="column")
    with path.open("r+b") as file:  # no date: the same data give the same file
        file.write(f"MATLAB 5.0 MAT-file, written by {MARK}".ljust(_BYTES_OF_DESCRIPTION).encode())


def read(path: Path, options: Options) -> Contents:
    """Read the variables of a file (options of `contents_from_arrays`)."""
    space = room(path.name, path.stat().st_size)
    with path.open("rb") as file:
        new = file.read(len(_HDF5_SIGNATURE)) == _HDF5_SIGNATURE
    ignore = options.get("ignore") or ()
    ignored = [ignore] if isinstance(ignore, str) else list(ignore)
    left: dict[str, str] = {}
    arrays = _read_new(path, space, ignored, left) if new else read_mat5(path.read_bytes(), space, ignored, left)
    names = dict(options.get("rename") or {})
    # a state-space model has a gain, too, which is a matrix
    vectors = _VECTORS if class_of(names.get(name, name) for name in arrays) is not StateSpace else ()
    shaped = {name: _as_layout(names.get(name, name), array, options, vectors) for name, array in arrays.items()}
    try:
        contents = contents_from_arrays(path.name, shaped, options, members=True)
    except DataError as error:
        if not left:
            raise
        name, kind = next(iter(left.items()))
        fault = f"it is of class {kind}, and without it {error.fault}"
        remedy = "Save plain arrays, and labels as cells of text, such as those of its columns."
        raise unreadable(f"{name} in {path.name}", fault, remedy) from error
    reasons = {name: f"{name} is of class {kind}, no plain array" for name, kind in left.items()}
    skipped = (Finding(part=name, what="", taken=False, reason=reason) for name, reason in reasons.items())
    return replace(contents, found=(*contents.found, *skipped))


def _as_layout(name: str, array: Array, options: Options, vectors: Collection[str]) -> Array:
    if name in (options.get("axes") or {}):
        return array
    name = name.removeprefix(UNREFINED)
    if name in vectors or name.startswith(INDICATOR) or array.dtype.kind == "U":
        return array.ravel()
    return array[..., None] if name in _THREE_AXES and array.ndim == 2 else array


def _read_new(path: Path, space: Room, ignore: Collection[str], left: dict[str, str]) -> dict[str, Array]:
    h5py = optional_package("reading a MATLAB 7.3 file", "h5py", "mat")
    check_hdf5(path, space)
    arrays: dict[str, Array] = {}
    visited: set[int] = set()

    def take(name: str, item: Any, depth: int = 0) -> None:
        if depth > _MAX_DEPTH:
            raise ValueError(f"arrays lie deeper than {_MAX_DEPTH} in each other")
        if name in ignore:
            arrays[name] = np.array("not read")
        elif "MATLAB_class" in item.attrs and _class_of(item) not in _READ_CLASSES:
            left[name] = _class_of(item)
        elif isinstance(item, h5py.Group):
            for key, part in item.items():
                if not key.startswith("#"):
                    take(f"{name}.{key}" if name else key, part, depth + 1)
        elif (members := _members(name, item, space, visited)) is not None:
            for key, part in members:
                take(key, part, depth + 1)
        else:
            arrays[name] = _of_dataset(name, item, space)

    remedy = "Save it again with -v7 or -v7.3."
    with damage_as_error(f"{path.name} as a MATLAB file", remedy), h5py.File(path, "r") as file:
        take("", file)
    return arrays


def _members(name: str, item: Any, space: Room, visited: set[int]) -> list[tuple[str, Any]] | None:
    """Return the names and datasets that a dataset refers to: members of a cell, or one field of an array of structures.

    None for cells of text, and for a dataset of values. `visited` holds the addresses of those visited: a cell that contains itself is
    damage.
    """
    import h5py

    if item.attrs.get("MATLAB_empty", 0) or h5py.check_ref_dtype(item.dtype) is not h5py.Reference:
        return None
    place = h5py.h5o.get_info(item.id).addr
    if place in visited:
        raise ValueError(f"{name} stands in several places")
    visited.add(place)
    # the same part may be referred to again and again
    space.take(f"the members of {name}", BYTES_OF_MEMBER * item.size)
    members = [item.file[reference] for reference in np.asarray(item[()]).ravel()]
    of, _, field = name.rpartition(".")
    cell = _class_of(item) == "cell"
    if cell and all(_holds_text(part) or part.attrs.get("MATLAB_empty", 0) for part in members):
        return None
    if cell or not of:
        return [(member_name(name, k), part) for k, part in enumerate(members, 1)]
    return [(f"{member_name(of, k, '()')}.{field}", part) for k, part in enumerate(members, 1)]


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
        fault = f"it is of class {kind}" if "MATLAB_class" in item.attrs else "it holds what MATLAB does not write"
        remedy = f"Save plain arrays, and labels as cells of text, or leave it out: --ignore '{name}'"
        raise unreadable(f"{name} in {space.where}", fault, remedy)
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
