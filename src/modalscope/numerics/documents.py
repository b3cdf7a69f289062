"""Take values out of documents that anybody may have written: what is of another kind is a ValueError, as a wrong number is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any, TypeVar

import numpy as np

from modalscope.numerics.checks import RealArray

T = TypeVar("T")


def mapping(value: Any) -> Mapping[str, Any]:
    """Return what stands in the place of names with values.

    Examples
    --------
    >>> mapping([1])
    Traceback (most recent call last):
    ValueError: there is list instead of names with values
    """
    found: Mapping[str, Any] = _of_kind(value, Mapping, "names with values")
    return found


def entries(value: Any) -> Sequence[Any]:
    """Return what stands in the place of a list."""
    found: Sequence[Any] = _of_kind(value, list | tuple, "a list")
    return found


def number(value: Any) -> float:
    """Return what stands in the place of a number."""
    return float(_of_kind(value, int | float | str, "a number"))


def numbers(value: Any) -> RealArray:
    """Return what stands in the place of numbers, or of lists of them, as an array; null is NaN."""
    try:
        return np.array(value, dtype=float)
    except TypeError as error:  # an object among the numbers
        raise ValueError(str(error)) from None


def made(kind: type[T], values: Any) -> T:
    """Return an object of a data class from its fields by name."""
    given, known = mapping(values), {f.name: f for f in fields(kind) if f.init}  # type: ignore[arg-type]
    needed = [name for name, f in known.items() if f.default is MISSING and f.default_factory is MISSING]
    for names, others, word in ((given, known, "not known"), (needed, given, "missing")):
        wrong: Iterable[str] = (name for name in names if name not in others)
        for name in wrong:
            raise ValueError(f"the field {name} is {word}")
    return kind(**given)


def _of_kind(value: Any, kind: Any, words: str) -> Any:
    if not isinstance(value, kind):
        raise ValueError(f"there is {type(value).__name__} instead of {words}")
    return value
