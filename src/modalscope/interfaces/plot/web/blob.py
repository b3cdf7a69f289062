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

from modalscope.io.arrays import plain
from modalscope.numerics.checks import Array

_ALIGN = 8

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
