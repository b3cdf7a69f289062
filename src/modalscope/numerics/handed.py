"""What upper rooms hand down: functions by name, which the face of the package lists, loaded when they are first called.

A data class draws, describes and grades itself, and a sweep gives standard deviations, by functions that stand above them. They
ask for these by name here, and import nothing that stands above.
"""

from __future__ import annotations

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
