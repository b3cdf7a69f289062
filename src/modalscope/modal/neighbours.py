"""Poles that may be repeated: those near to each other, found without holding each of many against each."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components

from modalscope.model.checks import Array, ComplexArray

__all__ = ["repeated"]


def repeated(poles: ArrayLike, width: float = 2e-3) -> list[Array]:
    """Return the groups of poles, two and more, of which each lies within `width` (relative) of a neighbour.

    Parameters
    ----------
    poles : array of complex, (n,)
        rad/s.
    width : float
        Largest distance of neighbours over the larger of their moduli.
    """
    s = np.asarray(poles, dtype=np.complex128)
    some = _alike_in_size(s, width)
    near = np.abs(s[some, None] - s[some]) <= width * np.maximum(np.abs(s[some, None]), np.abs(s[some]))
    count, label = connected_components(near, directed=False)
    return [group for k in range(count) if (group := some[label == k]).size > 1]


def _alike_in_size(s: ComplexArray, width: float) -> Array:
    """Return the indices, in order, of numbers whose moduli are nearer to another's than `width`: no others can be neighbours."""
    size = np.abs(s)
    by_size = np.argsort(size)
    apart = np.diff(size[by_size]) > width * size[by_size[1:]] * (1 + 1e-12)  # a difference of moduli is rounded
    alone = np.append(True, apart)[: s.size] & np.append(apart, True)[: s.size]
    return np.sort(by_size[~alone])
