"""MATLAB files of version 5 to 7, element by element.

scipy's reader trusts the sizes that a file states and can end the whole program on a damaged cell array (version 1.17 does).
Here every size is checked before it is used. Read are numeric arrays, text, cells of text and structures; sparse
matrices, objects and functions are errors that name them.

Source: MATLAB MAT-File Format, version 5 (The MathWorks).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator

import numpy as np

from modalscope.model import DataError
from modalscope.model.checks import Array

__all__ = ["read_mat5"]

_HEADER = 128
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_TEXTS = {2: "latin-1", 16: "utf-8", 17: "utf-16"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCTURE, _CHARACTERS, _FIRST_NUMBER, _LAST_NUMBER = 1, 2, 4, 6, 15
_IS_COMPLEX = 0x0800
_CLASSES = {3: "object", 5: "sparse", 16: "function", 17: "opaque (string or table)"}

Element = tuple[int, bytes]


class _Damaged(Exception):
    """A size or a type that cannot be, told by the reader as a DataError."""


def read_mat5(where: str, data: bytes, ignore: Collection[str] = ()) -> dict[str, Array]:
    """Return the variables of a file; fields of structures are named with a dot, cells of text are text arrays.

    Raises
    ------
    DataError
        A damaged file, an older version, or a variable of a class that is not read and not ignored.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:_HEADER])
    if order is None:
        raise DataError(
            f"reading {where} as a MATLAB file was asked",
            "it has no header of version 5 or later",
            "Save it in MATLAB with -v7 or -v7.3.",
        )
    arrays: dict[str, Array] = {}
    try:
        for kind, body in _elements(data[_HEADER:], order):
            whole = list(_elements(_inflated(body), order)) if kind == _COMPRESSED else [(kind, body)]
            if len(whole) != 1 or whole[0][0] != _MATRIX:
                raise _Damaged(f"an element of type {whole[0][0] if whole else kind} stands where a variable should")
            name = _matrix_head(whole[0][1], order)[2]
            if name:
                arrays |= {name: np.array("not read")} if name in ignore else _matrix(where, name, whole[0][1], order)
    except (_Damaged, zlib.error, struct.error, UnicodeDecodeError, RecursionError) as error:
        raise DataError(
            f"reading {where} as a MATLAB file was asked",
            f"it is damaged ({error})",
            "Copy it again, or save it again with -v7.",
        ) from None
    return arrays


def _inflated(body: bytes) -> bytes:
    stream = zlib.decompressobj()
    data = stream.decompress(body)
    if not stream.eof:
        raise _Damaged("compressed data are cut off")
    return data


def _elements(data: bytes, order: str) -> Iterator[Element]:
    position = 0
    while position < len(data):
        if len(data) - position < 8:
            raise _Damaged("an element is cut off")
        kind, count = struct.unpack_from(order + "II", data, position)
        start = position + 8
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, count, start = kind & 0xFFFF, kind >> 16, position + 4
        limit = position + 8 if start == position + 4 else len(data)
        if start + count > limit:
            raise _Damaged(f"an element counts {count} bytes where {limit - start} are left")
        yield kind, data[start : start + count]
        position = position + 8 if start == position + 4 else start + count
        if kind != _COMPRESSED:
            position += -position % 8


def _matrix_head(body: bytes, order: str) -> tuple[int, tuple[int, ...], str, list[Element]]:
    """Return flags, dimensions, name and the elements that follow."""
    parts = list(_elements(body, order))
    if len(parts) < 3 or len(parts[0][1]) < 4 or parts[1][0] != 5 or not 2 <= len(parts[1][1]) // 4 <= 32:
        raise _Damaged("a variable has no flags, dimensions and name")
    flags = struct.unpack_from(order + "I", parts[0][1])[0]
    shape = tuple(int(n) for n in np.frombuffer(parts[1][1][: len(parts[1][1]) // 4 * 4], order + "i4"))
    if min(shape) < 0:
        raise _Damaged(f"a variable has the dimensions {shape}")
    return flags, shape, parts[2][1].decode("latin-1"), parts[3:]


def _size(shape: tuple[int, ...]) -> int:
    size = 1
    for n in shape:
        size *= n
    return size


def _matrix(where: str, name: str, body: bytes, order: str) -> dict[str, Array]:
    if not body:
        return {name: np.zeros((0, 0))}
    flags, shape, _, parts = _matrix_head(body, order)
    kind = flags & 0xFF
    if _FIRST_NUMBER <= kind <= _LAST_NUMBER:
        values = _numbers(parts[:1], shape, order)
        return {name: values + 1j * _numbers(parts[1:2], shape, order) if flags & _IS_COMPLEX else values}
    if kind == _CHARACTERS:
        return {name: _characters(parts[:1], shape, order)}
    if kind == _CELL:
        return {name: _cell(where, name, parts, shape, order)}
    if kind == _STRUCTURE:
        return _structure(where, name, parts, shape, order)
    if kind not in _CLASSES:
        raise _Damaged(f"a variable is of class {kind}")
    raise DataError(
        f"reading {name} in {where} was asked",
        f"it is of MATLAB's class {_CLASSES[kind]}",
        "Save plain arrays and labels as cells of text, or ignore it.",
    )


def _numbers(parts: list[Element], shape: tuple[int, ...], order: str) -> Array:
    if not parts or parts[0][0] not in _NUMBERS:
        raise _Damaged("an array has no numbers")
    kind, data = parts[0]
    word = np.dtype(order + _NUMBERS[kind])
    if len(data) != _size(shape) * word.itemsize:
        raise _Damaged(f"an array of shape {shape} has {len(data)} bytes of numbers")
    values = np.frombuffer(data, word).reshape(shape, order="F")
    return values.astype(word.newbyteorder("="))


def _characters(parts: list[Element], shape: tuple[int, ...], order: str) -> Array:
    if not _size(shape):
        return np.array("")
    if not parts:
        raise _Damaged("a text has no characters")
    kind, data = parts[0]
    text = (
        "".join(map(chr, np.frombuffer(data[: len(data) // 2 * 2], order + "u2")))
        if kind == 4
        else data.decode(_TEXTS.get(kind, "latin-1"))
    )
    if len(text) != _size(shape) or len(shape) != 2:
        raise _Damaged(f"a text of shape {shape} has {len(text)} characters")
    rows = [text[k :: shape[0]].rstrip() for k in range(shape[0])]
    return np.array(rows if shape[0] > 1 else text, dtype=np.str_)


def _cell(where: str, name: str, parts: list[Element], shape: tuple[int, ...], order: str) -> Array:
    if len(parts) != _size(shape) or any(kind != _MATRIX for kind, _ in parts):
        raise _Damaged(f"a cell array of shape {shape} has {len(parts)} members")
    texts = []
    for _, body in parts:
        item = _matrix(where, name, body, order).get(name)
        if item is None or item.size > 1 or (item.size and item.dtype.kind != "U"):
            raise DataError(
                f"reading {name} in {where} was asked",
                "it is a cell array of something other than text",
                "Save plain arrays, and labels as cells of text.",
            )
        texts.append(str(item) if item.size else "")
    return np.array(texts, dtype=np.str_)


def _structure(where: str, name: str, parts: list[Element], shape: tuple[int, ...], order: str) -> dict[str, Array]:
    if _size(shape) != 1:
        raise DataError(
            f"reading {name} in {where} was asked",
            f"it is an array of {_size(shape)} structures",
            "Save one structure, or plain arrays.",
        )
    width = struct.unpack(order + "i", parts[0][1])[0] if parts and len(parts[0][1]) == 4 else 0
    names = parts[1][1] if len(parts) > 1 and width > 0 else b""
    fields = [names[k : k + width].split(b"\0")[0].decode("latin-1") for k in range(0, len(names), max(width, 1))]
    if not fields or len(parts) != 2 + len(fields) or any(kind != _MATRIX for kind, _ in parts[2:]):
        raise _Damaged(f"a structure of {len(fields)} fields has {len(parts) - 2} values")
    arrays: dict[str, Array] = {}
    for field, (_, body) in zip(fields, parts[2:], strict=True):
        arrays |= _matrix(where, f"{name}.{field}", body, order)
    return arrays
