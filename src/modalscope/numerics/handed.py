"""Names that are loaded when they are first asked for: those that upper packages hand down, and those of a package.

A data class draws, describes and grades itself, and a sweep gives standard deviations, by functions that stand above them. They
ask for these by name here, and import nothing that stands above. So does a step of an identification that has a faster form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

#: Where each of them stands: "package.module:name".
_PLACES: dict[str, str] = {}


def hand_down(**places: str) -> None:
    """State where functions stand, each as "package.module:name"."""
    _PLACES.update(places)


def handed(name: str) -> Any:
    """Return what was handed down under a name.

    Examples
    --------
    >>> hand_down(square_root="math:sqrt")
    >>> handed("square_root")(4.0)
    2.0
    """
    place, _, attribute = _PLACES[name].partition(":")
    return getattr(import_module(place), attribute)


P = ParamSpec("P")
R = TypeVar("R")

#: Whether plain steps run although faster ones are there.
_PLAIN: ContextVar[bool] = ContextVar("plain", default=False)


def replaceable(name: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate the plain form of a step: what is handed down under the name gives the same faster, or for more data, and runs instead.

    Examples
    --------
    >>> @replaceable("larger_root")
    ... def larger_root(a, b):
    ...     return max(a, b) ** 0.5
    >>> larger_root(2.0, 9.0)
    3.0
    """

    def either(plain: Callable[P, R]) -> Callable[P, R]:
        @wraps(plain)
        def step(*args: P.args, **kwargs: P.kwargs) -> R:
            taken: Callable[P, R] = plain if name not in _PLACES or _PLAIN.get() else handed(name)
            return taken(*args, **kwargs)

        return step

    return either


@contextmanager
def plain_steps() -> Iterator[None]:
    """Take the plain form of every step within a `with` block: what faster ones are compared with."""
    token = _PLAIN.set(True)
    try:
        yield
    finally:
        _PLAIN.reset(token)


def later(package: str, homes: Mapping[str, tuple[str, ...]]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package whose modules are loaded when one of their names is first asked for.

    `homes`: the names of each module, which may lie in another package: "modalscope.data.notes".
    """
    home_of = {name: home if "." in home else f"{package}.{home}" for home, names in homes.items() for name in names}

    def found(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home_of[name]), name)

    return found
