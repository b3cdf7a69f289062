"""Axes that analysers write as a start, an increment and a number: `x_values` beside `y_values`, as Testlab exports structures."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from modalscope.io.columns.words import kind_of_unit
from modalscope.model.checks import Array

__all__ = ["with_vectors"]

_INCREMENT = re.compile(r"(?P<of>(?:.*\.)?)x_values\.increment\Z")


def with_vectors(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Return arrays with the vector x(k) = start + k increment, k < number, in the place of the scalars that give it.

    It is of frequencies where `y_values` are complex or the unit says so, else of times. Equal vectors of several signals are one.
    Arrays without such scalars are returned as they are.

    Parameters
    ----------
    arrays : mapping of name to array

    Examples
    --------
    >>> held = {"Signal.x_values.increment": np.array([[0.5]]), "Signal.y_values.values": np.zeros((3, 2))}
    >>> {name: array.tolist() for name, array in with_vectors(held).items() if name.endswith("time")}
    {'Signal.x_values.time': [0.0, 0.5, 1.0]}
    """
    held = dict(arrays)
    vectors: list[Array] = []
    for name in arrays:
        found = _INCREMENT.match(name)
        vector = None if found is None else _vector(found["of"], arrays)
        if found is None or vector is None:
            continue
        for part in [part for part in held if part.startswith(f"{found['of']}x_values.")]:
            del held[part]
        if not any(np.array_equal(vector, other) for other in vectors):
            held[f"{found['of']}x_values.{_kind(found['of'], arrays)}"] = vector
            vectors.append(vector)
    return held


def _vector(of: str, arrays: Mapping[str, Array]) -> Array | None:
    """Return the axis; None where a scalar is none, or the number is not that of the values beside it."""
    values = _values(of, arrays)
    step, start = _scalar(arrays.get(f"{of}x_values.increment")), _scalar(arrays.get(f"{of}x_values.start_value"))
    number = _scalar(arrays.get(f"{of}x_values.number_of_values"))
    if values is None or step is None or step <= 0:
        return None
    count = max(values.shape) if number is None else int(number)
    if count not in values.shape:
        return None
    return (start or 0.0) + step * np.arange(count)


def _values(of: str, arrays: Mapping[str, Array]) -> Array | None:
    """Return the first numbers of the values beside an axis."""
    named = (array for name, array in arrays.items() if name.startswith(f"{of}y_values"))
    return next((array for array in named if array.dtype.kind in "biufc" and array.size > 1), None)


def _scalar(array: Array | None) -> float | None:
    """Return a finite number; None for anything else."""
    if array is None or array.size != 1 or array.dtype.kind not in "biuf" or not np.isfinite(array).all():
        return None
    return float(array.reshape(-1)[0])


def _kind(of: str, arrays: Mapping[str, Array]) -> str:
    values = _values(of, arrays)
    told = [
        str(array) for name, array in arrays.items() if name.startswith(f"{of}x_values.quantity") and not array.ndim
    ]
    lines = (values is not None and np.iscomplexobj(values)) or any(kind_of_unit(text) == "frequency" for text in told)
    return "frequency" if lines else "time"
