"""Row compressions T for a small computer (Eqs. 31-41): selection, sums, random projection, leading directions.

Each function returns an array for the option `row_compression` (or `column_compression`). With as many columns as there are
outputs it is T_0 and acts within every block row, I (x) T_0, which every realization survives. With as many columns as H(0) has
rows it is T_r, which leaves nothing of the row shift: it serves "era", "least_squares" and the controllable forms. What is needed is
that the rank of T V equals the order; what is wanted is that noise is not raised with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from modalscope.blocks.factor import factorize
from modalscope.blocks.operators import Operator
from modalscope.model.checks import DataError, RealArray, check_count

__all__ = ["adds_channels", "leading_directions", "random_projection", "selection", "sums"]


def selection(kept: Iterable[int], rows: int) -> RealArray:
    """Return T that keeps some rows, (len(kept), rows).

    Parameters
    ----------
    kept : iterable of int
        Rows to keep, counted from zero.
    rows : int
        Outputs, or rows of H(0).

    Raises
    ------
    DataError
        A row that does not exist.

    Examples
    --------
    >>> selection([0, 2], 3)
    array([[1., 0., 0.],
           [0., 0., 1.]])
    """
    index = [int(i) for i in kept]
    outside = [i for i in index if not 0 <= i < rows]
    if outside or not index:
        raise DataError(
            f"rows 0 to {rows - 1} can be kept",
            f"{outside[0]} was asked" if outside else "none was asked",
            "Correct the indices.",
        )
    return np.eye(rows)[index]


def sums(groups: Sequence[Sequence[int]], rows: int) -> RealArray:
    """Return T that adds rows up, one sum a group, (len(groups), rows).

    A mode whose sum over a group vanishes, as an antisymmetric one over symmetric sensors, is lost with it, and of repeated
    modes all but one: `identify` repeats that warning in the notes of its result. Sums are also the noisiest of the four.

    Raises
    ------
    DataError
        A row that does not exist.

    Examples
    --------
    >>> sums([[0, 1], [2]], 3)
    array([[1., 1., 0.],
           [0., 0., 1.]])
    """
    return np.array([selection(group, rows).sum(axis=0) for group in groups])


def random_projection(kept: int, rows: int, *, seed: int = 0) -> RealArray:
    """Return T with orthonormal random rows, (kept, rows), the same for the same seed.

    Its rank is full with probability one, but a random direction sees little of a weak mode: in noise the damping found is worse by one or
    two decades than that of `leading_directions` with as many rows.
    """
    if not 1 <= check_count("kept", kept) <= rows:
        raise DataError(f"{kept} random directions were asked", f"there are {rows} rows", f"Keep at most {rows}.")
    square = np.random.default_rng(seed).standard_normal((rows, kept))
    return np.ascontiguousarray(np.linalg.qr(square)[0].T)


def leading_directions(matrix: Operator, kept: int) -> RealArray:
    """Return T = P_n', the leading left singular directions of a matrix, (kept, rows): with them nothing of rank n is lost.

    Parameters
    ----------
    matrix : Operator
        H(0), for T_r; or for T_0 the samples side by side, `DenseMatrix` of (outputs, samples x inputs).
    kept : int

    Examples
    --------
    >>> import numpy as np
    >>> from modalscope.blocks.operators import DenseMatrix
    >>> abs(leading_directions(DenseMatrix(np.diag([3.0, 1.0])), 1)).round(6)
    array([[1., 0.]])
    """
    if check_count("kept", kept) > min(matrix.shape):
        raise DataError(
            f"{kept} leading directions were asked",
            f"the matrix is {matrix.shape[0]} x {matrix.shape[1]}",
            f"Keep at most {min(matrix.shape)}.",
        )
    return np.ascontiguousarray(factorize(matrix, kept).P.T)


def adds_channels(T: RealArray) -> bool:
    """Whether T sums rows: entries of one value only, and more than one in a row."""
    return bool(np.all((T == 0) | (T.max() == T)) and np.any(np.count_nonzero(T, axis=1) > 1))
