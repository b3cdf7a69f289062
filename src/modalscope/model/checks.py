"""One voice for errors, and the checks that every noun makes at the door."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Array",
    "ComplexArray",
    "DataError",
    "IntArray",
    "RealArray",
    "check_choice",
    "check_count",
    "check_finite",
    "check_positive",
    "complex_array",
    "freeze",
    "locked",
    "real_array",
]

# The names say what an array holds; numpy's own stubs cannot follow element types through most expressions.
Array = NDArray[Any]
RealArray = NDArray[Any]
ComplexArray = NDArray[Any]
IntArray = NDArray[Any]


class DataError(ValueError):
    """Data that cannot be used, or an option that cannot be met.

    Parameters
    ----------
    asked : str
        What was asked for.
    found : str
        What there is.
    change : str
        What to change.

    Examples
    --------
    >>> print(DataError("order=12 was asked", "the data have rank 10", "Lower the order to at most 10."))
    order=12 was asked, but the data have rank 10.
    Lower the order to at most 10.
    """

    def __init__(self, asked: str, found: str, change: str) -> None:
        self.asked, self.found, self.change = asked, found, change
        super().__init__(f"{asked}, but {found}.\n{change}")

    def __reduce__(self) -> tuple[type[DataError], tuple[str, str, str]]:
        return type(self), (self.asked, self.found, self.change)


def freeze(noun: object, **values: object) -> None:
    """Store validated values in a frozen noun, from its `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(noun, name, value)


def locked(array: Array) -> Array:
    """Return the array read-only: itself when nobody can write to it any more, else a copy."""
    owner: Any = array
    while isinstance(owner, np.ndarray) and not owner.flags.writeable:
        if owner.base is None:
            return array
        owner = owner.base
    copy = np.array(array, order="C")
    copy.setflags(write=False)
    return copy


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


def complex_array(name: str, values: ArrayLike, axes: str, ndim: int | Sequence[int]) -> ComplexArray:
    """Return a locked complex array, or raise a `DataError` that says what is wrong with it."""
    array = _numeric(name, values, axes, ndim)
    check_finite(name, array)
    return locked(np.asarray(array, dtype=np.complex128))


def check_positive(name: str, value: float) -> float:
    """Return the value as a float, or raise when it is not a finite positive number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not (np.isfinite(number) and number > 0):
        raise DataError(f"{name} needs a positive number", f"it is {value!r}", f"Give {name} in its unit, above zero.")
    return number


def check_count(name: str, value: int, least: int = 1) -> int:
    """Return a whole number not below `least`, or raise."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise DataError(
            f"{name} needs a whole number of at least {least}", f"it is {value!r}", f"Raise {name} to {least} or more."
        )
    return int(value)


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value` if it is one of the choices, or raise and name the nearest."""
    known = list(choices)
    if value in known:
        return str(value)
    near = get_close_matches(str(value), known, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    raise DataError(f"{name}={value!r} was asked", f"there are only {', '.join(known)}", f"{hint}Choose one of these.")
