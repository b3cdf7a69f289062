"""Values of a noun's fields from the arrays of a file: text, texts, a number, JSON or the array itself, each checked."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from modalscope.io.arrays import JSON, TEXTS
from modalscope.io.limits import room
from modalscope.model import DataError
from modalscope.model.checks import Array

__all__ = ["field_value"]

_TEXT = ("quantity", "kind", "scaling")
_FLOATS = ("sampling_rate", "added_damping", "dt")
_WHOLE = ("averages", "first_sample")
_BOOLEAN = ("held_input", "converged")

#: Characters of a label, at most.
_LONGEST = 1000


def field_value(where: str, name: str, array: Array) -> Any:
    """Return the array as the noun's field wants it: text, texts, a number, JSON or the array itself."""
    textual = array.dtype.kind in "US"
    if textual is not (name in (*_TEXT, *TEXTS, *JSON)) and array.size:
        wanted = "numbers" if textual else "text"
        raise DataError(
            f"{name} in {where} needs {wanted}",
            f"its type is {array.dtype}",
            f"Store {wanted} under that name, or rename the array.",
        )
    if textual and array.dtype.kind == "S":
        array = np.char.decode(array, "utf-8", "replace")
    if name in TEXTS and name != "processing" and array.dtype.kind == "U" and array.dtype.itemsize > 4 * _LONGEST:
        raise DataError(
            f"{name} in {where} needs labels",
            f"the longest has {array.dtype.itemsize // 4} characters",
            f"Shorten it to at most {_LONGEST}.",
        )
    if name in TEXTS:
        texts = tuple(str(text) for text in np.atleast_1d(array).ravel())
        if name == "groups" and texts == ("",):
            return None
        return tuple(text or None for text in texts) if name == "quantities" else texts
    if name in (*_TEXT, *JSON, *_FLOATS, *_WHOLE, *_BOOLEAN):
        if array.size != 1:
            raise DataError(
                f"{name} in {where} needs one entry",
                f"its shape is {array.shape}",
                "Store a single value under that name.",
            )
        return _scalar(where, name, array.reshape(-1)[0].item())
    return array


def _scalar(where: str, name: str, value: Any) -> Any:
    if name in JSON:
        room(where, 0).json(name, value)
        try:
            return json.loads(value)
        except (ValueError, RecursionError) as error:
            raise DataError(
                f"{name} in {where} needs JSON text",
                f"it does not read ({error})",
                "Write the file again, or ignore that array.",
            ) from None
    if name in _WHOLE and isinstance(value, float) and value.is_integer():
        return int(value)
    return (value or None) if name == "quantity" else bool(value) if name in _BOOLEAN else value
