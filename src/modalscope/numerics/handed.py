"""Names that are loaded when they are first asked for: those that upper packages hand down, and those of a package.

A data class draws, describes and grades itself, and a sweep gives standard deviations, by functions that stand above them. They
ask for these by name here, and import nothing that stands above.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

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
