"""Compute leading singular triplets of large matrices by a randomized block Krylov range or by Lanczos."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.numerics.checks import RealArray
from modalscope.numerics.operators import Operator
from modalscope.numerics.orthonormal import orthonormal

#: Blocks in which the directions of a range are computed: smaller ones need fewer products, larger ones quicker ones.
_BLOCKS_PER_RANGE = 4

#: Minimum and maximum size of a range, in multiples of the wanted directions. With the minimum the last wanted singular value of
#: noise alone is accurate to about a tenth.
_MIN_MULTIPLE, _MAX_MULTIPLE = 2, 4

#: Directions this many times above the last one carried stand out of the bulk that a range cannot resolve; they must be singular
#: vectors to this share of the bulk, which is noise, or to rounding of the largest.
_MIN_GAP, _MAX_ERROR_OF_BULK, _ROUNDING_OF_LARGEST = 2.0, 0.01, 1e-13

#: Columns that keep this part of their length, however combined, have nothing in common with a basis but rounding once its part is
#: taken off; others take it off again, so many times at most.
_MIN_REMAINDER, _MAX_PASSES = 0.1, 4

_TINY = float(np.finfo(float).tiny)


class Triplets(NamedTuple):
    """Singular triplets H = P diag(d) Q', the leading ones.

    `P` (rows, k). `d` (k,). `Q` (columns, k). `reached`: whether those that stand out are singular vectors to the accuracy asked.
    `directions`: how many there are in the range that they lie in.
    """

    P: RealArray
    d: RealArray
    Q: RealArray
    reached: bool
    directions: int


class _Basis:
    """Orthonormal columns that grow by blocks.

    `rows`, `most`: their length, and how many there may be.
    """

    def __init__(self, rows: int, most: int) -> None:
        self._all, self.size = np.empty((rows, most), order="F"), 0

    @property
    def columns(self) -> RealArray:
        """Those that there are, (rows, size)."""
        return self._all[:, : self.size]

    def residual(self, block: RealArray) -> RealArray:
        """Return the residual of a block, (rows, b), after projection on the columns."""
        return block - self.columns @ (self.columns.T @ block)

    def grow(self, block: RealArray) -> tuple[RealArray, RealArray]:
        """Add the orthonormalized residual of a block, (rows, b); return it, and the coordinates of the block in all columns.

        Where a block has lost rank directions without meaning take the place of those that it does not have.
        """
        basis, rest = self.columns, block
        common = projected = basis.T @ block
        for _ in range(_MAX_PASSES):
            size = np.linalg.norm(rest, axis=0)
            rest = rest - basis @ projected
            new = orthonormal(rest)
            if np.linalg.svd(new.T @ rest / np.maximum(size, _TINY), compute_uv=False)[-1] > _MIN_REMAINDER:
                break
            rest, projected = new, basis.T @ new
        self._all[:, self.size : self.size + new.shape[1]] = new
        self.size += new.shape[1]
        return new, np.vstack([common, new.T @ block])


def by_range(matrix: Operator, carried: int, seed: int = 0) -> Triplets:
    """Return leading triplets from the Krylov space of H'H and some random directions, as large as the accuracy takes.

    With blocks of orthonormal U and V made by turns from H V_j and H' U_j, H V = U B and H' U = V B' but for the last block. With
    B = X diag(d) Y', P = U X and Q = V Y, H Q = P d holds to rounding, and H' P - Q d is what V misses of H' U_last times the last
    rows of X. Directions within a factor of two of the last one carried are bulk, which no factorization separates steadily.

    `matrix`: as many rows as columns, or more. `carried`: directions, with those to spare. `seed`: of the random directions at the start.

    References
    ----------
    Golub, Luk and Overton, "A block Lanczos method for computing the singular values and corresponding singular vectors of a matrix",
    ACM Transactions on Mathematical Software 7 (1981); Musco and Musco, "Randomized block Krylov methods for stronger and faster
    approximate singular value decomposition", NIPS (2015).
    """
    rows, columns = matrix.shape
    least, most = (min(times * carried, columns) for times in (_MIN_MULTIPLE, _MAX_MULTIPLE))
    U, V, B = _Basis(rows, most), _Basis(columns, most), np.zeros((most, most))
    last, _ = V.grow(np.random.default_rng(seed).standard_normal((columns, -(-carried // _BLOCKS_PER_RANGE))))
    while True:
        start, n = U.size, V.size
        left, B[:n, start:n] = U.grow(matrix.times(last))
        rest = V.residual(matrix.transposed_times(left))
        if n >= least:
            X, d, Yt = np.linalg.svd(B[:n, :n])
            d = d[:carried]
            out = np.flatnonzero(d > _MIN_GAP * d[-1])
            missed = np.linalg.norm(rest @ X[start:, out], axis=0)
            reached = bool(np.all(missed <= max(_MAX_ERROR_OF_BULK * d[-1], _ROUNDING_OF_LARGEST * d[0])))
            if reached or n == most:
                return Triplets(U.columns @ X[:, :carried], d, V.columns @ Yt[:carried].T, reached, n)
        last, _ = V.grow(rest[:, : most - n])


def by_lanczos(matrix: Operator, wanted: int, seed: int = 0) -> Triplets:
    """Return leading triplets by ARPACK on H'H, where few are wanted and stand out.

    Singular values below about 1e-7 of the largest are lost to the square; one product with H and an orthogonalization bring the others
    to rounding.

    `seed`: of the vector it starts from.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh

    columns = matrix.shape[1]
    start = np.random.default_rng(seed).standard_normal(columns)

    def square(x: RealArray) -> RealArray:
        return matrix.transposed_times(matrix.times(x.reshape(columns, -1)))

    operator = LinearOperator((columns, columns), matvec=square, matmat=square, dtype=np.float64)
    _, Q = eigsh(operator, k=wanted, v0=start, tol=0)
    left = orthonormal(matrix.times(np.ascontiguousarray(Q[:, ::-1])))
    U, d, Vt = np.linalg.svd(matrix.transposed_times(left).T, full_matrices=False)
    return Triplets(left @ U, d, np.ascontiguousarray(Vt.T), True, wanted)
