"""Validate what data classes are given: types, numbers, arrays, counts, bands, lists and file names."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import fields
from os import PathLike, fsencode, fspath
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from modalscope.numerics.errors import DataError

#: Calls that turn arrays into data.
_WRAPPING = {
    "FrequencyResponse": "FrequencyResponse(values=..., frequencies=...)",
    "ImpulseResponse": "ImpulseResponse(values=..., sampling_rate=...)",
    "Signals": "Signals(outputs=..., sampling_rate=...)",
    "ModalModel": "ModalModel(poles=..., shapes=...)",
    "Geometry": "Geometry(nodes=..., coordinates=...)",
    "StateSpace": "StateSpace(A=..., B=..., C=...)",
}

#: Types that reading a file gives.
_READ_TYPES = ("FrequencyResponse", "ImpulseResponse", "Signals", "Records", "Setups", "ModalModel", "Geometry")

_MEASURED_TYPES = ("FrequencyResponse", "ImpulseResponse", "Signals", "Records", "Setups")

#: (expected, given) -> how the one is made of the other.
_CONVERSIONS: dict[tuple[str, str], str] = {
    ("FrequencyResponse", "Signals"): "estimate it first: ms.estimate_frf(record)",
    ("FrequencyResponse", "Records"): "estimate it from one of its runs: ms.estimate_frf(records.runs[0])",
    ("FrequencyResponse", "ImpulseResponse"): "transform it: response.to_frequency_response()",
    ("FrequencyResponse", "StateSpace"): "compute it: model.frequency_response(frequencies)",
    ("FrequencyResponse", "ModalModel"): "compute it: modes.frequency_response(frequencies)",
    ("FrequencyResponse", "Structure"): "compute it: structure.frequency_response(frequencies)",
    ("ImpulseResponse", "Signals"): "estimate it first: ms.estimate_correlation(record) or ms.estimate_markov(record)",
    ("ImpulseResponse", "FrequencyResponse"): "transform it: response.to_impulse_response()",
    ("ImpulseResponse", "StateSpace"): "compute it: model.impulse_response(samples)",
    ("ImpulseResponse", "ModalModel"): "compute it: modes.impulse_response(samples)",
    ("ImpulseResponse", "Structure"): "compute it: structure.impulse_response(samples)",
    ("Signals", "Records"): "give one of its runs: records.runs[0]",
    ("Signals", "Setups"): "give one of its setups: setups.parts[0]",
    ("Signals", "Structure"): "simulate it: structure.simulate(duration=...)",
    ("ModalModel", "StabilizationDiagram"): "select them first: ms.select(diagram)",
    ("ModalModel", "Identification"): "give its modes: result.modes",
    ("ModalModel", "Structure"): "compute them: structure.modes()",
    ("ModalModel", "Mode"): "give all of them: mode.modes",
    ("StabilizationDiagram", "ModalModel"): "give the diagram that they were selected from",
    ("StabilizationDiagram", "Identification"): "that is one order; ms.stabilize(data) tries all",
    ("StateSpace", "Identification"): "give its model: result.state_space",
    ("StateSpace", "Structure"): "compute it: structure.state_space()",
    ("Result", "Comparison"): "ask for it there: ms.compare(data, replicates=40)",
    **{
        ("Result", kind): "analyse the data: ms.analyze(data)"
        for kind in (*_MEASURED_TYPES, "ModalModel", "StabilizationDiagram")
    },
    **{("ModalModel", kind): "identify them first: ms.select(ms.stabilize(data))" for kind in _MEASURED_TYPES},
    **{("StabilizationDiagram", kind): "make it first: ms.stabilize(data)" for kind in _MEASURED_TYPES},
    **{("StateSpace", kind): "identify it first: ms.realize(data, order=...)" for kind in _MEASURED_TYPES},
}

#: Python's own types in plain words.
_TYPE_WORDS = {"str": "text", "bool": "True or False", "Mapping": "a mapping of name to value", "NoneType": "None"}


def check_kind(name: str, value: Any, kinds: type[Any] | tuple[type[Any], ...]) -> None:
    """Raise when a value is not of the type that is expected, and say how to make it so.

    `name`: the verb or the option that expects it.

    Examples
    --------
    >>> import numpy as np
    >>> from modalscope.data import FrequencyResponse
    >>> check_kind("mmif", np.ones(3) * 1j, FrequencyResponse)
    Traceback (most recent call last):
    modalscope.numerics.errors.DataError: mmif: expected FrequencyResponse, got ndarray: wrap it as FrequencyResponse(values=...,
    frequencies=...)
    """
    if isinstance(value, kinds):
        return
    accepted = kinds if isinstance(kinds, tuple) else (kinds,)
    words = [_TYPE_WORDS.get(kind.__name__, kind.__name__) for kind in accepted]
    expected = _one_of(words)
    given = type(value).__name__
    fallback = "give one of these" if len(accepted) > 1 else f"give {expected}"
    hint = _hint(value, given, [kind.__name__ for kind in accepted], accepted) or fallback
    asked, found = f"{name}: expected {expected}", f"got {_TYPE_WORDS.get(given, given)}"
    raise DataError(asked, found, f"{hint[0].upper()}{hint[1:]}.", f"{asked}, {found}: {hint}")


def _hint(value: Any, given: str, expected: Sequence[str], kinds: tuple[type[Any], ...]) -> str | None:
    """Return how to make what is expected of what was given; None where nothing is known to help."""
    if isinstance(value, str | PathLike):
        return "read it first: ms.read(path)" if set(expected) & set(_READ_TYPES) else None
    if isinstance(value, tuple | list) and value:
        fitting = [k for k, item in enumerate(value) if isinstance(item, kinds)]
        if len(fitting) == len(value) > 1:
            several = "put them together first, ms.merge([...]), or " if expected[0] in _MEASURED_TYPES else ""
            return f"{several}give them one by one"
        if fitting:
            return f"give only its item {fitting[0]}, counted from 0"
        if all(hasattr(item, "__dataclass_fields__") for item in value):
            return None
    if given in ("ndarray", "list", "tuple", "memmap", "Tensor"):
        return _wrapped(value, expected)
    if given in ("DataFrame", "Series"):
        wrapped = _wrapped(None, expected)
        return None if wrapped is None else f"take its numbers, table.to_numpy(), and {wrapped}"
    return next((_CONVERSIONS[kind, given] for kind in expected if (kind, given) in _CONVERSIONS), None)


def _wrapped(array: Any, expected: Sequence[str]) -> str | None:
    """Return how numbers become one of what is expected; complex ones are no samples, and real ones no response over frequency."""
    fitting = [_WRAPPING[kind] for kind in expected if kind in _WRAPPING]
    kind = getattr(getattr(array, "dtype", None), "kind", None)
    if len(fitting) > 1 and kind in ("c", "f"):
        fitting = [form for form in fitting if form.startswith("Frequency") is (kind == "c")] or fitting
    return f"wrap it as {_one_of(fitting)}" if fitting else None


def _one_of(words: Sequence[str]) -> str:
    return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


#: Size from which arrays are checked without a temporary array of their size.
_MIN_LONG_SIZE = 1_000_000

#: What an array holds; `Array` where that is either.
Array = NDArray[Any]
RealArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.intp]
Noun = TypeVar("Noun")
#: Entries of a list that is no array, at most: a range may have more than a machine can hold.
MOST_ENTRIES = 10**8
BoolArray = NDArray[np.bool_]


def freeze(data: object, **values: object) -> None:
    """Store validated values in a frozen data class, from its `__post_init__`."""
    for name, value in values.items():
        object.__setattr__(data, name, value)


def stays_locked(kind: type[Noun]) -> type[Noun]:
    """Let the arrays of a frozen data class be read-only in its copies, too: those of pickle and deepcopy can be written to."""

    def restore(self: Any, state: Sequence[Any]) -> None:
        for field, value in zip(fields(self), state, strict=True):
            for array in value.values() if isinstance(value, Mapping) else (value,):
                if isinstance(array, np.ndarray):
                    array.setflags(write=False)
            object.__setattr__(self, field.name, value)

    kind.__setstate__ = restore  # type: ignore[attr-defined]
    return kind


def _masked(values: Any) -> int:
    """Return how many values of an array, or of a list of arrays, are masked: NumPy gives what lies under the mask."""
    parts = values if isinstance(values, list | tuple) else [values]
    return int(sum(np.count_nonzero(np.ma.getmaskarray(part)) for part in parts if isinstance(part, np.ma.MaskedArray)))


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
    if isinstance(values, range) and len(values) > MOST_ENTRIES:
        raise DataError(f"{name} needs axes {axes}", f"it is {values!r}", f"Give at most {MOST_ENTRIES} numbers.")
    try:
        array = np.asarray(values)
    except ValueError as error:  # ragged nested lists
        raise DataError(f"{name} needs axes {axes}", f"it is ragged ({error})", "Give rows of equal length.") from None
    if array.dtype.kind not in "iufc":
        raise DataError(f"{name} needs numbers", f"its type is {array.dtype}", "Convert it to numbers.")
    if masked := _masked(values):
        raise DataError(f"{name} needs finite numbers", f"{masked} of {array.size} are masked", "Leave them out.")
    allowed = (ndim,) if isinstance(ndim, int) else tuple(ndim)
    if array.ndim not in allowed:
        remedy = "The order is samples or lines, outputs, inputs: add the missing axis, or move axes to this order."
        raise DataError(f"{name} needs axes {axes}", f"the array has shape {array.shape}", remedy)
    return array


def check_finite(name: str, array: Array, change: str = "Repair or leave out what is not a finite number.") -> None:
    """Raise a `DataError` that names the first NaN or infinite value and how many there are."""
    if (
        array.dtype.kind == "f"
        and array.size > _MIN_LONG_SIZE
        and np.isfinite(array.min())
        and np.isfinite(array.max())
    ):
        return  # of long records nothing of their size is made
    bad = ~np.isfinite(array)
    count = int(np.count_nonzero(bad))
    if count:
        first = tuple(int(i) for i in np.argwhere(bad)[0])
        fault = f"{count} of {array.size} values are NaN or infinite, the first at index {first}"
        raise DataError(f"{name} needs finite numbers", fault, change)


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


def check_shape(name: str, array: Array, axes: str, shape: Sequence[int | None]) -> None:
    """Raise when an array has another shape; None stands for any length."""
    if array.ndim != len(shape) or any(n not in (None, size) for n, size in zip(shape, array.shape, strict=True)):
        sizes = ", ".join("any" if n is None else str(n) for n in shape)
        raise DataError(f"{name} needs shape ({sizes}), {axes}", f"it has {array.shape}", "Transpose or complete it.")


def optional_array(
    name: str,
    values: ArrayLike | None,
    axes: str,
    shape: Sequence[int | None],
    *,
    make: Callable[..., Array] | None = None,
    **options: Any,
) -> Array | None:
    """Return a locked array of a shape, real unless another `make` is given; None where there is none."""
    if values is None:
        return None
    array = (make or real_array)(name, values, axes, len(shape), **options)
    check_shape(name, array, axes, shape)
    return array


def _finite(value: Any) -> float:
    """Return a value as a float; NaN where it is no finite number, as True is none."""
    if isinstance(value, bool | np.bool_):
        return np.nan
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


def check_count(name: str, value: int, least: int = 1, most: int = 2**62 - 1) -> int:
    """Return a whole number not below `least` and not above `most`, or raise."""
    # NumPy takes a duration for an integer
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)
    if whole and most < value < 2**62:
        raise DataError(f"{name} needs at most {most}", f"it is {value}", f"Give {most} or less.")
    if not whole or not least <= value <= most:
        remedy = f"Raise it to {least}." if whole and value < least else "Give a whole number, such as 4."
        raise DataError(f"{name} needs a whole number of at least {least}", f"it is {value!r}", remedy)
    return int(value)


def check_axes(**arrays: tuple[Any, int]) -> None:
    """Raise when one of several arrays has not the number of axes that it should have.

    `**arrays`: what each is, and how many axes it needs.
    """
    for name, (array, axes) in arrays.items():
        if getattr(array, "ndim", None) != axes:
            fault = f"it is {type(array).__name__} of shape {np.shape(array)}"
            raise DataError(f"{name} needs an array of {axes} axes", fault, "Change its axes.")


def check_index(name: str, index: Any, count: int) -> None:
    """Raise when an index does not choose from `count` items."""
    try:
        np.empty(count)[index]
    except IndexError as error:
        raise DataError(f"{name} of {count}:", f"the index is wrong: {error}", "Count from 0.") from None


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
        raise DataError("a band needs two frequencies", f"it is {band!r}", "Give band=(lowest, highest).") from None
    if not low < high:
        raise DataError(f"band {low:g} to {high:g} Hz:", "it does not increase", "Give the lower end first.")
    return low, high


def check_each(name: str, values: Any, what: str, most: int = MOST_ENTRIES) -> list[Any]:
    """Return what a list, a tuple, a range or an array holds; text, one bare value and other things are an error.

    `most`: entries: a range may have more than a machine can hold.
    """
    if isinstance(values, Sized) and getattr(values, "ndim", 1) != 0 and len(values) > most:
        raise DataError(f"{name} needs {what}, at most {most}", f"there are {len(values)}", "Give fewer.")
    if not isinstance(values, str | bytes | Mapping):
        try:
            return list(values)
        except TypeError:
            pass
    raise DataError(f"{name} needs {what}", f"it is {type(values).__name__}", f"Give {name} as a list.")


def check_shifts(name: str, values: Any) -> tuple[int, ...]:
    """Return the shifts of blocks, or raise where one is no whole number or stands twice, or 0 is missing."""
    what = "different whole numbers, 0 among them"
    numbers = tuple(check_count(name, s, least=0) for s in check_each(name, values, what))
    if 0 not in numbers or len(set(numbers)) < len(numbers):
        raise DataError(f"{name} needs {what}", f"they are {list(numbers[:8])}", "Give 0, and each shift once.")
    return numbers


def check_path(path: Any) -> Path:
    """Return the name of a file as a path, or raise."""
    if not isinstance(path, str | PathLike) or isinstance(fspath(path), bytes):
        raise DataError("the name of a file needs text or a Path", f"it is {type(path).__name__}", "Give one of these.")
    if "\0" in fspath(path):
        raise DataError("the name of a file cannot contain a NUL character", "this one does", "Remove it.")
    try:
        fsencode(path)
    except UnicodeEncodeError:
        what = f"{fspath(path)!r} has characters that this system does not allow in names"
        raise DataError("the name of a file:", what, "Take them out.") from None
    return Path(path)
