"""Names that users give to modes, by frequency."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["named_near"]

#: A name belongs to the mode within this part of its frequency.
_NEAR = 0.005


def named_near(names: Mapping[str, str], frequency: float) -> str:
    """Return the name that was given nearest to a frequency; empty where there is none.

    Examples
    --------
    >>> named_near({"177.05": "first bending", "480": "second"}, 177.2)
    'first bending'
    """
    near = [(abs(float(text) - frequency), name) for text, name in names.items()]
    distance, name = min(near, default=(float("inf"), ""))
    return name if distance <= _NEAR * frequency else ""
