"""Pack arrays for the page as one binary blob with a JSON head.

Four bytes give the length of the head (little-endian); the head follows, filled up with blanks so that all that comes is a multiple of
eight, then the arrays, each beginning at such a multiple. The head is the given mapping with "arrays": [{"name", "type", "shape", "at"}],
`at` counted from its end. The page makes typed arrays of them without a copy.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from modalscope.io.arrays import plain
from modalscope.numerics.checks import Array

_ALIGN = 8

#: What a browser has typed arrays for: the kind of an array -> the type that is sent.
_TYPES = {"f": "<f4", "i": "<i4", "u": "|u1", "b": "|u1"}


def pack(head: Mapping[str, Any], arrays: Mapping[str, Array], exact: tuple[str, ...] = ()) -> bytes:
    """Return a head and arrays as one blob.

    `head`: what JSON holds; numbers that are not finite become null. `arrays`: real ones; sent with single precision. `exact`: arrays
    that keep double precision.

    Examples
    --------
    >>> blob = pack({"kind": "poles"}, {"order": np.array([2, 4])})
    >>> blob[4 : 4 + int.from_bytes(blob[:4], "little")].decode().strip()
    '{"kind": "poles", "arrays": [{"name": "order", "type": "i4", "shape": [2], "at": 0}]}'
    """
    listed, parts, at = [], [], 0
    for name, values in arrays.items():
        kind = "<f8" if name in exact else _TYPES[np.asarray(values).dtype.kind]
        array = np.ascontiguousarray(values, dtype=kind)
        listed.append({"name": name, "type": kind[1:], "shape": list(array.shape), "at": at})
        raw = array.tobytes()
        parts.append(raw + bytes(-len(raw) % _ALIGN))
        at += len(parts[-1])
    text = json.dumps(plain({**head, "arrays": listed}), allow_nan=False).encode()
    text += b" " * (-(len(text) + 4) % _ALIGN)
    return len(text).to_bytes(4, "little") + text + b"".join(parts)
