"""Checks that data classes make of what they are given: numbers, arrays, counts, bands, lists and file names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fsencode, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from modalscope.model.errors import DataError, check_choice
from modalscope.model.kinds import check_kind

__all__ = [
    "Array",
    "BoolArray",
    "ComplexArray",
    "DataError",
    "IntArray",
    "RealArray",
    "check_axes",
    "check_band",
    "check_choice",
    "check_count",
    "check_each",
    "check_finite",
    "check_index",
    "check_kind",
    "check_number",
    "check_path",
    "check_positive",
    "complex_array",
    "freeze",
    "locked",
    "real_array",
    "real_stretch",
    "sealed",
]

#: From so many numbers on arrays are looked through without one of their size beside them.
_LONG = 1_000_000

#: What an array holds; `Array` where that is either.
Array = NDArray[Any]
RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


def freeze(data: object, **values: object) -> None:
    """Store validated values in a frozen data class, from its `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(data, name, value)


def locked(array: Array) -> Array:
    """Return the array read-only: itself when nobody can write to it any more, else a copy. A map of a file opened to read stays one."""
    owner: Any = array
    while isinstance(owner, np.ndarray) and not owner.flags.writeable:
        if owner.base is None or (isinstance(owner, np.memmap) and owner.mode == "r"):
            return array
        owner = owner.base
    copy = np.array(array, order="C")
    copy.setflags(write=False)
    return copy


def sealed(array: Array) -> Array:
    """Return an array that nobody else holds, read-only with all that it is a view of: stored as it is, where `locked` would copy."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        owner.setflags(write=False)
        owner = owner.base
    return array


def _numeric(name: str, values: ArrayLike, axes: str, ndim: int | Sequence[int]) -> Array:
    try:
        array = np.asarray(values)
    except ValueError as error:  # ragged nested lists
        raise DataError(
            f"{name} needs one array of axes {axes}", f"it is ragged ({error})", "Give rows of equal length."
        ) from None
    if array.dtype.kind not in "biufc":
        raise DataError(f"{name} needs numbers", f"its type is {array.dtype}", "Convert it to numbers.")
    allowed = (ndim,) if isinstance(ndim, int) else tuple(ndim)
    if array.ndim not in allowed:
        raise DataError(
            f"{name} needs axes {axes}",
            f"the array has shape {array.shape}",
            "Samples or lines come first, then outputs, then inputs; add or move the missing axis.",
        )
    return array


def check_finite(name: str, array: Array, change: str = "Repair or leave out what is not a finite number.") -> None:
    """Raise a `DataError` that names the first NaN or infinite value and how many there are."""
    if array.dtype.kind == "f" and array.size > _LONG and np.isfinite(array.min()) and np.isfinite(array.max()):
        return  # of long records nothing of their size is made
    bad = ~np.isfinite(array)
    count = int(np.count_nonzero(bad))
    if count:
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        raise DataError(
            f"{name} needs finite numbers",
            f"{count} of {array.size} values are NaN or infinite, the first at index {first}",
            change,
        )


def real_array(name: str, values: ArrayLike, axes: str, ndim: int | Sequence[int], *, finite: bool = True) -> RealArray:
    """Return a locked float array, or raise a `DataError` that says what is wrong with it."""
    array = _numeric(name, values, axes, ndim)
    if array.dtype.kind == "c":
        raise DataError(f"{name} needs real numbers", "it is complex", "Give the real samples, not a spectrum.")
    if finite:
        check_finite(name, array)
    return locked(np.asarray(array, dtype=np.float64))


def real_stretch(name: str, place: str, values: ArrayLike) -> Array:
    """Return what was read of a longer array, at a place in words, or raise a `DataError` that says what is wrong with it."""
    read = np.asarray(values)
    if read.dtype.kind not in "biuf":
        raise DataError(f"{name} needs real numbers", f"its type is {read.dtype}", "Give the real samples.")
    check_finite(f"{name}, from {place} on,", read)
    return read


def complex_array(name: str, values: ArrayLike, axes: str, ndim: int | Sequence[int]) -> ComplexArray:
    """Return a locked complex array, or raise a `DataError` that says what is wrong with it."""
    array = _numeric(name, values, axes, ndim)
    check_finite(name, array)
    return locked(np.asarray(array, dtype=np.complex128))


def _finite(value: Any) -> float:
    """Return a value as a float; NaN where it is no finite number."""
    try:
        return float(value) if np.isfinite(float(value)) else np.nan
    except (TypeError, ValueError, OverflowError):
        return np.nan


def check_positive(name: str, value: float) -> float:
    """Return the value as a float, or raise when it is not a finite positive number."""
    number = _finite(value)
    if not number > 0:
        raise DataError(f"{name} needs a positive number", f"it is {value!r}", f"Give {name} in its unit, above zero.")
    return number


def check_count(name: str, value: int, least: int = 1) -> int:
    """Return a whole number not below `least`, or raise."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value < 2**62:
        raise DataError(
            f"{name} needs a whole number of at least {least}", f"it is {value!r}", f"Raise {name} to {least} or more."
        )
    return int(value)


def check_axes(**arrays: tuple[Any, int]) -> None:
    """Raise when one of several arrays has not the number of axes that it should have.

    Parameters
    ----------
    **arrays : (array, int)
        What each is, and how many axes it needs.
    """
    for name, (array, axes) in arrays.items():
        if getattr(array, "ndim", None) != axes:
            raise DataError(
                f"{name} needs an array of {axes} axes",
                f"it is {type(array).__name__} of shape {np.shape(array)}",
                "Add or move the missing axis, and give a NumPy array.",
            )


def check_index(name: str, index: Any, count: int) -> None:
    """Raise when an index does not choose from `count` things."""
    try:
        np.empty(count)[index]
    except IndexError as error:
        raise DataError(
            f"some of {count} {name} were asked", f"{name} is not of them: {error}", "Count from 0."
        ) from None


def check_number(name: str, value: Any) -> float:
    """Return a finite number as a float, or raise."""
    number = _finite(value)
    if np.isnan(number):
        raise DataError(f"{name} needs a finite number", f"it is {value!r}", f"Give {name} as one number.")
    return number


def check_band(band: Any) -> tuple[float, float]:
    """Return the two ends of a band in Hz, or raise when they are not two numbers that increase."""
    try:
        low, high = (float(end) for end in band)
    except (TypeError, ValueError):
        raise DataError(
            "a band of two frequencies in Hz was asked", f"it is {band!r}", "Give band=(lowest, highest)."
        ) from None
    if not low < high:
        raise DataError(
            f"the band {low:g} to {high:g} Hz was asked", "its ends do not increase", "Give the lower end first."
        )
    return low, high


def check_each(name: str, values: Any, what: str) -> list[Any]:
    """Return what a list, a tuple, a range or an array holds; text, one bare value and other things are an error."""
    if not isinstance(values, str | bytes | Mapping):
        try:
            return list(values)
        except TypeError:
            pass
    raise DataError(f"{name} needs {what}", f"it is {type(values).__name__}", f"Give {name} as a list.")


def check_path(path: Any) -> Path:
    """Return the name of a file as a path, or raise."""
    if not isinstance(path, str | PathLike) or isinstance(fspath(path), bytes):
        raise DataError("the name of a file was asked", f"it is {type(path).__name__}", "Give it as text or as a Path.")
    if "\0" in fspath(path):
        raise DataError("the name of a file was asked", "it holds a NUL, which no name may", "Take it out.")
    try:
        fsencode(path)
    except UnicodeEncodeError:
        what = f"{fspath(path)!r} has characters that no name has on this system"
        raise DataError("the name of a file was asked", what, "Take them out.") from None
    return Path(path)
