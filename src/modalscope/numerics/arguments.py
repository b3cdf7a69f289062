"""Check the arguments of public functions: names of keywords, declared limits, and the argument that made a function fail.

`named` checks names and limits before a call. `plainly` checks nothing before a failure; the arguments are then compared with the
annotations of the call, and searched for values that no computation bears (not finite, empty, of absurd size). Where none is found
the error is the library's and is raised as it is.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import is_dataclass
from functools import wraps
from numbers import Complex, Integral, Real
from os import PathLike
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np

from modalscope.numerics.checks import check_count, check_kind, check_number, check_positive
from modalscope.numerics.errors import DataError, check_choice, check_option_names

#: Errors that Python and numpy raise on wrong values.
LIBRARY_ERRORS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
)

#: Range of numbers that can be a measure, a count or a factor.
_MIN_NUMBER, _MAX_NUMBER = 1e-100, 1e15
_COMPUTABLE = "of a size that can be computed with"

#: Types of defaults that are equal to others of the same value.
_PLAIN = (str, int, float, complex, tuple, frozenset)

#: Abstract types of numbers.
_NUMBER_TYPES: dict[Any, Any] = {int: Integral, float: Real, complex: Complex, bool: bool | np.bool_}

#: Names that modules have for type checkers alone, and where they come from once pictures are drawn.
_LATE_MODULES = {"Axes": "matplotlib.axes"}

_TYPE_WORDS: dict[Any, str] = {
    int: "a whole number",
    float: "a number",
    complex: "a number",
    str: "text",
    bool: "True or False",
    None: "None",
    NoneType: "None",
    Mapping: "a mapping of name to value",
    dict: "a mapping of name to value",
    np.ndarray: "an array of numbers",
    PathLike: "the name of a file",
    Callable: "a function",
}


def plainly(verb: Callable[P, R]) -> Callable[P, R]:
    """Return a public function whose failures on wrong arguments are `DataError`.

    Examples
    --------
    >>> @plainly
    ... def half(number: float) -> float:
    ...     return number / 2
    >>> half("three")
    Traceback (most recent call last):
    modalscope.numerics.errors.DataError: half(number=...) needs a number, but it is 'three'.
    Give number as a number.
    """

    @wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return verb(*args, **kwargs)
        except DataError:
            raise
        except LIBRARY_ERRORS as error:
            blamed = _blame(verb, args, kwargs)
            if blamed is None and isinstance(error, MemoryError):
                have = f"this machine has less ({str(error)[:100] or 'its memory is used up'})"
                change = "Use fewer samples, lines, orders or channels, or a band."
                blamed = DataError(f"{verb.__name__}() needs more memory than there is", have, change)
            if blamed is None:
                raise
            raise blamed from error

    return run


def plain_methods(*kinds: type[Any]) -> None:
    """Make the public methods of classes, and the making of their objects, answer in plain words, as `plainly` does."""
    classes = [
        base for kind in kinds for base in kind.__mro__ if base.__module__.startswith(__package__.partition(".")[0])
    ]
    for base in dict.fromkeys(classes):
        for name, member in list(vars(base).items()):
            if (name != "__init__" and name.startswith("_")) or hasattr(member, "__wrapped__"):
                continue
            if inspect.isfunction(member):
                setattr(base, name, plainly(member))
            elif isinstance(member, classmethod):
                setattr(base, name, classmethod(plainly(member.__func__)))


def _blame(verb: Callable[..., Any], args: Sequence[Any], kwargs: Mapping[str, Any]) -> DataError | None:
    """Return an error that names the argument which cannot be meant; None where none stands out."""
    try:
        given = list(_arguments(verb, args, kwargs))
    except TypeError:  # too many or too few: Python's words name them
        return _misnamed(verb, kwargs)
    # a program gives defaults, too: what is as it would be without is nobody's fault
    parameters = inspect.signature(verb).parameters
    given = [one for one in given if not _is_default(one[1], parameters.get(one[0]))]
    for fault in (_unlike, _odd, _without_axis):
        for argument, value, hint in given:
            if words := fault(value, hint):
                return _error(verb.__qualname__.removesuffix(".__init__"), argument, value, words)
    return None


def _is_default(value: Any, parameter: inspect.Parameter | None) -> bool:
    """Whether a value is what its argument is without it; an empty tuple is what programs give for nothing."""
    if isinstance(value, tuple) and not value:
        return True
    default = inspect.Parameter.empty if parameter is None else parameter.default
    return value is default or (type(value) is type(default) and isinstance(value, _PLAIN) and value == default)


def _misnamed(verb: Callable[..., Any], kwargs: Mapping[str, Any]) -> DataError | None:
    """Return an error that names a keyword which the function does not know, and the nearest that it knows."""
    parameters = inspect.signature(verb).parameters.values()
    if any(p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters):
        return None
    known = [p.name for p in parameters if p.name != "self" and p.kind is not inspect.Parameter.POSITIONAL_ONLY]
    try:
        check_option_names(verb.__qualname__.removesuffix(".__init__"), kwargs, known)
    except DataError as error:
        return error
    return None


def also_called(*places: str, **names: str) -> Callable[[type[T]], type[T]]:
    """Return a decorator of a data class that accepts other names of its fields, `other="field"`, where the field is not given.

    `places`: fields that may be given by their place, in this order.
    """

    def wrap(kind: type[T]) -> type[T]:
        make: Any = kind.__init__

        def init(self: T, *args: Any, **kwargs: Any) -> None:
            if len(args) <= len(places) and not kwargs.keys() & set(places[: len(args)]):
                args, kwargs = (), {**dict(zip(places, args, strict=False)), **kwargs}
            elif len(args) > len(places):
                asked = f"{kind.__name__} takes {' and '.join(places)} by position"
                raise DataError(asked, f"there are {len(args)} values", "Give the others by name: name=value.")
            for other, field in names.items():
                if other in kwargs and field not in kwargs:
                    kwargs[field] = kwargs.pop(other)
            make(self, *args, **kwargs)

        init.__signature__ = inspect.signature(make)  # type: ignore[attr-defined]
        init.__qualname__, init.__module__, init.__doc__ = make.__qualname__, make.__module__, make.__doc__
        setattr(kind, "__init__", init)  # noqa: B010 - a type checker knows the fields alone
        return kind

    return wrap


def _error(verb: str, argument: str, value: Any, words: str) -> DataError:
    shown = repr(value) if isinstance(value, str | bytes | float | int | complex | NoneType | np.generic) else ""
    if not shown or len(shown) > _MAX_VALUE_LENGTH:
        shown = f"{type(value).__name__}{f' of shape {value.shape}' if isinstance(value, np.ndarray) else ''}"
    return DataError(f"{verb}({argument}=...) needs {words}", f"it is {shown}", f"Give {argument} as {words}.")


#: Maximum number of characters of a value in a message.
_MAX_VALUE_LENGTH = 60


def _arguments(
    verb: Callable[..., Any], args: Sequence[Any], kwargs: Mapping[str, Any]
) -> Iterator[tuple[str, Any, Any]]:
    """Give name, value and annotation of every argument that was given; options behind ** by their own names."""
    parameters = inspect.signature(verb).parameters
    for name, value in inspect.signature(verb).bind(*args, **kwargs).arguments.items():
        hint = _resolved(parameters[name].annotation, verb)
        if parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
            options = getattr(next(iter(get_args(hint)), None), "__annotations__", {})
            yield from ((key, item, _resolved(options.get(key, Any), verb)) for key, item in value.items())
        elif name not in ("self", "cls"):
            yield name, value, hint


def _resolved(annotation: Any, verb: Callable[..., Any]) -> Any:
    """Return an annotation as the type that it names; Any where that is known to type checkers alone."""
    text = getattr(annotation, "__forward_arg__", annotation)
    names = dict(vars(sys.modules[inspect.unwrap(verb).__module__]))
    names |= {name: vars(sys.modules[home])[name] for name, home in _LATE_MODULES.items() if home in sys.modules}
    try:
        hint = eval(text, names) if isinstance(text, str) else annotation
    except (NameError, AttributeError, TypeError, SyntaxError):
        return Any
    if isinstance(hint, TypeVar):
        return hint.__bound__ or Union[hint.__constraints__ or (Any,)]  # noqa: UP007 - made of a tuple
    return hint


def _unlike(value: Any, hint: Any) -> str:
    """Return what an annotation asks for, where a value is not that."""
    return "" if _fits(value, hint) else _words(hint) or "another value"


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is what an annotation says, as far as that can be told from outside."""
    origin, inner = get_origin(hint), get_args(hint)
    kind = origin or hint
    if origin in (Union, UnionType):
        return any(_fits(value, each) for each in _meant(inner))
    if hint is None or hint is NoneType:
        return value is None
    if origin is Literal:
        return any(value is each or (isinstance(value, type(each)) and value == each) for each in inner)
    if hint in _NUMBER_TYPES:
        return _number(value, hint)
    if hint is Any or not isinstance(kind, type):
        return True
    if kind.__module__.startswith("numpy"):  # arrays, and the protocols of what becomes one
        return _numbers(value) and (kind is not np.ndarray or np.ndim(value) > 0)
    if kind is PathLike:
        return isinstance(value, str | PathLike)
    return getattr(kind, "_is_protocol", False) or _holds(value, kind, inner)


def _meant(members: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the members of a union without the texts and bytes that numpy counts among what becomes an array."""
    arrays = any(_module(each).startswith("numpy") for each in members)
    return tuple(each for each in members if not (arrays and each in (str, bytes)))


def _module(hint: Any) -> str:
    return getattr(get_origin(hint) or hint, "__module__", "")


def _holds(value: Any, kind: type[Any], inner: tuple[Any, ...]) -> bool:
    """Whether a value is of a kind, and what it holds is what it should hold."""
    if not issubclass(kind, Iterable) or issubclass(kind, str | bytes | Mapping) or is_dataclass(kind):
        return isinstance(value, kind)
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    if not inner or not isinstance(value, Sized):
        return True
    if kind is tuple and inner[-1] is not Ellipsis:
        return len(value) == len(inner) and all(map(_fits, value, inner))
    return all(_fits(item, inner[0]) for item in value)


def _number(value: Any, kind: type[Any]) -> bool:
    """Whether a value is one number of a kind; True and False are none."""
    value = value[()] if isinstance(value, np.ndarray) else value
    return isinstance(value, bool | np.bool_) == (kind is bool) and isinstance(value, _NUMBER_TYPES[kind])


def _numbers(value: Any) -> bool:
    """Whether a value becomes an array of numbers."""
    try:
        return np.asarray(value).dtype.kind in "biufc"
    except (ValueError, TypeError, OverflowError):
        return False


def _odd(value: Any, hint: Any) -> str:
    """Return what a number or an array of numbers should be and is not; nothing of other values."""
    odd = _oddity(value)
    return f"{_words(hint) or 'a value'} that is {odd}" if odd else ""


def _oddity(value: Any) -> str:
    if isinstance(value, Iterator):
        return "there to be read again"
    if isinstance(value, str | bytes | Mapping) or is_dataclass(value):
        return ""
    if not _numbers(value):
        return _COMPUTABLE if isinstance(value, int) and abs(value) > _MAX_NUMBER else ""
    array = np.abs(np.asarray(value, dtype=complex))
    if not array.size:
        return "not empty"
    if not np.isfinite(array).all():
        return "finite"
    largest = array.max()
    return _COMPUTABLE if largest > _MAX_NUMBER or 0 < largest < _MIN_NUMBER else ""


def _without_axis(value: Any, hint: Any) -> str:
    """Return what an array should have, where a number was given for it."""
    alone = "array" in _words(hint) and _numbers(value) and np.ndim(value) == 0
    return "an array of numbers that has an axis" if alone else ""


def _words(hint: Any) -> str:
    """Return an annotation in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        members = [each for each in _meant(inner) if each is not NoneType]
        if any(_module(each).startswith("numpy") for each in members):  # single numbers are arrays without axes
            members = [each for each in members if each not in (int, float, complex, bool)]
        return " or ".join(dict.fromkeys(filter(None, map(_words, members))))
    if origin is Literal:
        return " or ".join(repr(each) for each in inner)
    kind = origin or hint
    if kind in _TYPE_WORDS:
        return _TYPE_WORDS[kind]
    if not isinstance(kind, type):
        return ""
    if kind.__module__.startswith("numpy"):
        return "an array of numbers"
    if issubclass(kind, Iterable) and kind.__module__ in ("builtins", "collections.abc"):
        items = [words for each in inner if each is not Ellipsis and (words := _words(each))]
        return f"a list of {items[0]}" if items and len(set(items)) == 1 else "a list"
    return kind.__name__


P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

#: What an argument may be: a type or several, one of some texts, or a function of name and value that returns the value checked.
Limit = type[Any] | tuple[type[Any], ...] | Sequence[str] | Callable[[str, Any], Any]


def at_least(least: int) -> Limit:
    """Return the limit of a whole number."""
    return lambda name, value: check_count(name, value, least)


def between(low: float, high: float, *, low_included: bool = False) -> Limit:
    """Return the limit of a number between two ends, of which the lower one may be included and the upper one is not."""

    def check(name: str, value: Any) -> float:
        number = check_number(name, value)
        if not (low < number < high or (low_included and number == low)):
            ends = f"{f'from {low:g}' if low_included else f'above {low:g}'} and below {high:g}"
            raise DataError(f"{name} needs a number {ends}", f"it is {number:g}", f"Give {name} {ends}.")
        return number

    return check


#: Limits of a whole number from 1 on, of a positive number, and of a finite one.
COUNT, POSITIVE, NUMBER = at_least(1), check_positive, check_number


def _checked(verb: str, name: str, value: Any, limit: Limit) -> Any:
    """Return a value within its limit; `verb` is what errors name where a type is wrong."""
    if isinstance(limit, type) or (isinstance(limit, tuple) and isinstance(limit[0], type)):
        check_kind(verb, value, limit)
        return value
    return limit(name, value) if callable(limit) else check_choice(name, value, map(str, limit))


def named(
    *options: Iterable[str], elsewhere: Mapping[str, Iterable[str]] | None = None, **limits: Limit
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that checks the names and the limits of arguments before a function is called.

    Where the function fails nevertheless, it names the argument of a wrong value, as `plainly` does.

    `options`: what the function takes by `**options`, beside its own parameters. `elsewhere`: where other names belong. `limits`: the limit
    of an argument by its name; None is allowed where it is the default.

    Examples
    --------
    >>> @named(value=COUNT)
    ... def double(value: int, *, twice: bool = False) -> int:
    ...     return 4 * value if twice else 2 * value
    >>> double(2, twise=True)
    Traceback (most recent call last):
    modalscope.numerics.errors.DataError: double() has no option 'twise'; did you mean 'twice'?
    >>> double(0)
    Traceback (most recent call last):
    modalscope.numerics.errors.DataError: value needs a whole number of at least 1, but it is 0.
    Raise it to 1.
    """
    more = [name for names in options for name in names]

    def decorate(verb: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(verb)
        parameters = {name: p for name, p in signature.parameters.items() if name not in ("self", "cls")}
        own = [p.name for p in parameters.values() if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
        data, plain = next(iter(parameters), ""), plainly(verb)

        @wraps(verb)
        def run(*args: P.args, **kwargs: P.kwargs) -> R:
            check_option_names(verb.__name__, kwargs, [*own, *more], elsewhere)
            if not limits:
                return plain(*args, **kwargs)
            try:
                bound = signature.bind(*args, **kwargs)
            except TypeError:  # too many, or too few: Python's words name them
                return plain(*args, **kwargs)
            for name, value in bound.arguments.items():
                if name in limits and not (value is parameters[name].default is None):
                    said = verb.__name__ if name == data else name
                    bound.arguments[name] = _checked(said, name, value, limits[name])
            return plain(*bound.args, **bound.kwargs)

        return run

    return decorate
