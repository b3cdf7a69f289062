"""Lines between neighbouring points, where nobody drew any."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import RealArray

__all__ = ["neighbour_lines"]

#: So many nearest points of each may be its neighbours.
_NEAREST = 12
#: Distances of a measured grid are equal within this part.
_EQUAL = 1e-3


def neighbour_lines(points: RealArray) -> list[tuple[int, int]]:
    """Return the pairs (p, q) between which no point lies: there is no r with max(|p - r|, |q - r|) < |p - q|.

    On a grid these are its meshes, without diagonals; along a beam one point follows the other. Every set of points hangs together by
    them, as far as the twelve nearest of each reach.

    Parameters
    ----------
    points : array, (n, 3)

    Notes
    -----
    The relative neighbourhood graph of G. T. Toussaint, Pattern Recognition 12 (1980).

    Examples
    --------
    >>> neighbour_lines(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    [(0, 1), (0, 2), (1, 3), (2, 3)]
    """
    from scipy.spatial import cKDTree

    count = len(points)
    if count < 2:
        return []
    found = cKDTree(points).query(points, k=min(_NEAREST + 1, count))
    distances, nearest = np.asarray(found[0]), np.asarray(found[1])
    pairs = set()
    for p in range(count):
        for distance, q in zip(distances[p], nearest[p], strict=True):
            if q == p or not distance:
                continue
            closer = nearest[p][(distances[p] < distance * (1 - _EQUAL)) & (nearest[p] != p)]
            between = np.linalg.norm(points[closer] - points[q], axis=1) < distance * (1 - _EQUAL)
            if not between.any():
                pairs.add((min(p, int(q)), max(p, int(q))))
    return sorted(pairs)
