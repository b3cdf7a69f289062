"""Leading singular vectors of large matrices by their products: a randomized range with powers, and Lanczos."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.blocks.operators import Operator
from modalscope.blocks.orthonormal import orthonormal
from modalscope.model.checks import RealArray

__all__ = ["Triplets", "by_lanczos", "by_range"]

#: Powers of the range to begin with, and at most.
_POWERS, _MOST = 2, 8

#: Directions this many times above the last one carried stand out of the bulk that a range cannot resolve; they must be singular
#: vectors to this share of the bulk, which is noise, or to rounding of the largest.
_ABOVE, _SHARE, _ROUNDING = 2.0, 0.01, 1e-13


class Triplets(NamedTuple):
    """Singular triplets H = P diag(d) Q', the leading ones.

    Parameters
    ----------
    P : array, (rows, k)
    d : array, (k,)
    Q : array, (columns, k)
    reached : bool
        Whether those that stand out are singular vectors to the accuracy asked.
    powers : int
        Products with H H' that it took.
    """

    P: RealArray
    d: RealArray
    Q: RealArray
    reached: bool
    powers: int


def by_range(matrix: Operator, carried: int, seed: int = 0) -> Triplets:
    """Return leading triplets by a randomized range, with as many powers as the accuracy takes.

    The error of a direction falls by (d_last / d)^2 with every power; those within a factor of two of the last are bulk, which no
    factorization separates steadily.

    Parameters
    ----------
    matrix : Operator
    carried : int
        Directions, with those to spare.
    seed : int
        Of the random directions at the start.

    References
    ----------
    Halko, Martinsson and Tropp, "Finding structure with randomness", SIAM Review 53 (2011).
    """
    Q: RealArray = np.random.default_rng(seed).standard_normal((matrix.shape[1], carried))
    for power in range(_MOST + 1):
        left = orthonormal(matrix.times(np.ascontiguousarray(Q)))
        back = matrix.transposed_times(left)
        if power < _POWERS:
            Q = orthonormal(back)
            continue
        U, d, Vt = np.linalg.svd(back.T, full_matrices=False)
        P, turned = left @ U, np.ascontiguousarray(Vt.T)
        out = np.flatnonzero(d > _ABOVE * d[-1])
        # H'P = Q d holds by construction; H Q = P d says how far the range is from an invariant one
        missed = np.linalg.norm(matrix.times(turned[:, out]) - P[:, out] * d[out], axis=0)
        reached = bool(np.all(missed <= max(_SHARE * d[-1], _ROUNDING * d[0])))
        if reached or power == _MOST:
            break
        Q = turned
    return Triplets(P, d, turned, reached, power)


def by_lanczos(matrix: Operator, wanted: int, seed: int = 0) -> Triplets:
    """Return leading triplets by ARPACK on H'H, where few are wanted and stand out.

    Singular values below about 1e-7 of the largest are lost to the square; one product with H and an orthogonalization bring the others
    to rounding.

    Parameters
    ----------
    matrix : Operator
    wanted : int
    seed : int
        Of the vector it starts from.
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
    return Triplets(left @ U, d, np.ascontiguousarray(Vt.T), True, 0)
