"""Pairs between two sets, at least cost in all."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray

__all__ = ["assign"]


def assign(cost: RealArray) -> tuple[Array, Array]:
    """Return rows and columns of the pairs whose costs have the least sum; of the longer side some stay alone.

    Parameters
    ----------
    cost : array, (a, b)
        What it costs to pair i with j, finite.

    Returns
    -------
    rows, columns : array of int, (min(a, b),)
        Rows rise.

    Examples
    --------
    >>> rows, columns = assign(np.array([[1.0, 2.0], [2.0, 9.0]]))
    >>> columns.tolist()
    [1, 0]
    """
    from scipy.optimize import linear_sum_assignment  # a quarter of a second, for those who pair

    rows, columns = linear_sum_assignment(cost)
    return np.asarray(rows), np.asarray(columns)
