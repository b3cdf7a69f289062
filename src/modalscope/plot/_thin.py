"""What is drawn of more than can be seen apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.model import Geometry
from modalscope.model.checks import Array

__all__ = ["spaced", "thinned"]

#: More lines, faces or nodes than this are thinned.
_DRAWN = 20_000


def thinned(geometry: Geometry, measured: Array) -> tuple[Geometry, Array]:
    """Return a geometry with every so many of its lines and faces, and which measured nodes are drawn."""
    some = (
        geometry
        if max(len(geometry.lines), len(geometry.faces)) <= _DRAWN
        else replace(
            geometry,
            lines=geometry.lines[spaced(len(geometry.lines))],
            faces=geometry.faces[spaced(len(geometry.faces))],
        )
    )
    nodes = np.flatnonzero(measured)
    shown = np.zeros_like(measured)
    shown[nodes[spaced(len(nodes))]] = True
    return some, shown


def spaced(count: int, most: int = _DRAWN) -> slice:
    """Return every so many of `count` things that `most` are left.

    Examples
    --------
    >>> spaced(1_000_000).step, spaced(100).step
    (50, 1)
    """
    return slice(None, None, max(-(-count // most), 1))
