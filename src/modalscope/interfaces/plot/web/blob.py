"""Pack arrays for the page as one binary blob with a JSON head.

The blob starts with the length of the head (four bytes, little-endian) and the head, padded with blanks to a multiple of eight. The arrays
follow, each at a multiple of eight. The head is the given mapping with "arrays": [{"name", "type", "shape", "at"}], `at` counted from the
end of the head. The page makes typed arrays of them without a copy.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from modalscope.interfaces.plot.picture import Axis, Item, Panel, Picture
from modalscope.io.arrays import plain
from modalscope.numerics.checks import Array

_ALIGN = 8

#: Fields of what pictures are made of that are arrays.
_POINTS = ("x", "y", "tones", "corners", "strength")

#: What a panel has beside its axes and items.
_OF_PANELS = ("title", "aside", "share", "equal", "bare", "grid", "labelled")

#: Kind of an array -> its type in the blob; browsers have typed arrays for these.
_TYPES = {"f": "<f4", "i": "<i4", "u": "|u1", "b": "|u1"}


def pack(
    head: Mapping[str, Any], arrays: Mapping[str, Array], exact: tuple[str, ...] = (), half: tuple[str, ...] = ()
) -> bytes:
    """Return a head and arrays as one blob.

    `head`: JSON values; numbers that are not finite become null. `arrays`: real, stored in single precision. `exact`, `half`: names of
    arrays in double and in half precision.

    Examples
    --------
    >>> blob = pack({"kind": "poles"}, {"order": np.array([2, 4])})
    >>> blob[4 : 4 + int.from_bytes(blob[:4], "little")].decode().strip()
    '{"kind": "poles", "arrays": [{"name": "order", "type": "i4", "shape": [2], "at": 0}]}'
    """
    listed, parts, at = [], [], 0
    for name, values in arrays.items():
        kind = "<f8" if name in exact else "<f2" if name in half else _TYPES[np.asarray(values).dtype.kind]
        array = np.ascontiguousarray(values, dtype=kind)
        listed.append({"name": name, "type": kind[1:], "shape": list(array.shape), "at": at})
        raw = array.tobytes()
        parts.append(raw + bytes(-len(raw) % _ALIGN))
        at += len(parts[-1])
    text = json.dumps(plain({**head, "arrays": listed}), allow_nan=False).encode()
    text += b" " * (-(len(text) + 4) % _ALIGN)
    return len(text).to_bytes(4, "little") + text + b"".join(parts)


def parts_of(**arrays: Array) -> dict[str, Array]:
    """Return the parts of complex arrays under the names `name_real` and `name_imag`: a browser has no complex numbers."""
    return {f"{name}_{part}": getattr(values, part) for name, values in arrays.items() for part in ("real", "imag")}


def picture_blob(picture: Picture) -> bytes:
    """Return a described picture as a blob that the page's canvas paints: words in its head, points in its arrays."""
    arrays: dict[str, Array] = {}

    def stored(values: Any) -> str:
        arrays[f"a{len(arrays)}"] = np.asarray(values, dtype=float)
        return f"a{len(arrays) - 1}"

    def item_of(item: Item) -> dict[str, Any]:
        fields = {name: getattr(item, name) for name in item.__slots__}
        points = {name: stored(v) for name, v in fields.items() if name in _POINTS and v is not None}
        return {**fields, **points, "kind": type(item).__name__}

    def axis_of(axis: Axis) -> dict[str, Any]:
        fields = {name: getattr(axis, name) for name in ("label", "low", "high", "log", "upright")}
        return {**fields, "ticks": [[float(at), words] for at, words in axis.ticks()]}

    def panel_of(panel: Panel) -> dict[str, Any]:
        fields = {name: getattr(panel, name) for name in _OF_PANELS}
        behind = panel.behind and {"axis": axis_of(panel.behind[0]), "items": list(map(item_of, panel.behind[1]))}
        sides = {"x": axis_of(panel.x), "y": axis_of(panel.y), "behind": behind, "named": panel.x.named is not None}
        return {**fields, **sides, "items": list(map(item_of, panel.items)), "marked": list(map(list, panel.marked))}

    key = [item_of(item) for item in picture.key()]
    head = {"words": picture.words, "panels": list(map(panel_of, picture.panels)), "key": key, "size": picture.size}
    return pack(head, arrays)
