"""Factorize data matrices, H = P diag(d) Q': once, for the models of all orders.

The dense thin singular value decomposition is the plain way. Where structure or sizes allow, cheaper ones give the same leading
triplets: see `modalscope.identification.fast.factorizations`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.handed import replaceable
from modalscope.numerics.operators import Operator, Product

#: Routes of factorization.
FACTORIZATIONS = ("auto", "dense", "gram", "randomized", "lanczos")


@dataclass(frozen=True, eq=False)
class Factors:
    """H = P diag(d) Q', the leading part, with how it was found.

    `left` (rows, k): orthonormal left vectors, or the product H Q d^-1 that gives them when they are first asked for. `d` (k,): singular
    values, decreasing. `Q` (columns, k): orthonormal right vectors. `spectrum`: all singular values that the route gives: the dense one
    all, the Gram route those it carried. `rank`: number of those computed above rounding. `how`: the route, in words. `gram`: the Gram
    matrix that was decomposed in part. `rest`: how many singular values were not computed, and the sum of their squares, where a range
    carried the leading ones. `right`: the right factor on the data's own columns, where Q belongs to a stand-in. `between`: what the data
    matrix has made of them, for the realizations that read their models off them.
    """

    left: RealArray | Product
    d: RealArray
    Q: RealArray
    spectrum: RealArray
    rank: int
    how: str
    gram: RealArray | None = field(default=None, repr=False)
    rest: tuple[int, float] = (0, 0.0)
    right: Any = field(default=None, repr=False)
    between: dict[str, RealArray] = field(default_factory=dict, repr=False, init=False)

    @cached_property
    def P(self) -> RealArray:
        """Orthonormal left vectors, (rows, k)."""
        return self.left.array() if isinstance(self.left, Product) else self.left

    @property
    def unmade(self) -> bool:
        """Whether the left vectors are known as a product only: what needs sums over them alone goes without."""
        return isinstance(self.left, Product)

    def transposed(self) -> Factors:
        """Return the factors of H'."""
        return Factors(self.Q, self.d, self.P, self.spectrum, self.rank, self.how, self.gram, self.rest)

    @property
    def reach(self) -> str:
        """Why no model has more states than `rank`, in words."""
        whole = self.rank < self.d.size or self.d.size == min(self.left.shape[0], self.Q.shape[0])
        return f"the data matrix has rank {self.rank}" if whole else f"{self.rank} singular vectors were computed"

    def check_order(self, order: int) -> None:
        """Raise when `order` states cannot be told from rounding, or were not asked of the factorization."""
        if order > self.rank:
            change = f"Lower the order to at most {self.rank}, or give more block rows and columns; factor for the largest order."
            raise DataError(f"order={order}:", self.reach, change)


@replaceable("factorize")
def factorize(matrix: Operator, rank: int | None = None, route: str = "auto") -> Factors:
    """Return the leading `rank` singular triplets of a matrix (all when None), by the thin singular value decomposition.

    `rank`: how many triplets are wanted. `route`: one of `FACTORIZATIONS`; the plain form has the dense one alone.

    Raises `DataError`: a matrix of zeros.
    """
    check_choice("factorization", route, FACTORIZATIONS)
    return dense_factors(matrix, min(matrix.shape) if rank is None else rank)


@replaceable("left_factor")
def left_factor(matrix: Operator, route: str = "auto") -> Factors:
    """Return all of P and d, Q without columns: what a regression on whole rows needs, with nothing of the columns' size kept."""
    found = dense_factors(matrix, min(matrix.shape))
    return Factors(found.P, found.d, found.Q[:, :0], found.spectrum, found.rank, found.how)


def dense_factors(matrix: Operator, wanted: int) -> Factors:
    """Return the leading triplets by the dense decomposition."""
    H = matrix.dense()
    try:
        P, d, Qt = sla.svd(H, full_matrices=False, lapack_driver="gesdd", check_finite=False)
    except sla.LinAlgError:  # gesdd rarely fails where the slower gesvd converges
        P, d, Qt = sla.svd(H, full_matrices=False, lapack_driver="gesvd", check_finite=False)
    how = f"dense singular value decomposition, {H.shape[0]} x {H.shape[1]}"
    floor = max(H.shape) * float(np.finfo(float).eps)
    return ranked(Factors(np.array(P[:, :wanted]), d[:wanted], np.array(Qt[:wanted].T), d, 0, how), floor)


def ranked(found: Factors, floor: float) -> Factors:
    """Return factors with their rank; `floor`: relative to the largest singular value, rounding lies below."""
    if found.d.size == 0 or found.d[0] <= 0:
        raise DataError("factors of the data:", "all values are zero", "Give data with a response.")
    return replace(found, rank=_rank(found.d, floor))


def _rank(d: RealArray, floor: float) -> int:
    """Count singular values above rounding; a drop of a thousand to below 1e-10 of the first is rounding of the data themselves."""
    above = int(np.count_nonzero(d > floor * d[0]))
    drops = np.flatnonzero((d[1:] < 1e-10 * d[0]) & (d[1:] < 1e-3 * d[:-1]))
    return min(above, int(drops[0]) + 1) if drops.size else above


def h0_factors(matrix: Any, order: int, route: str) -> Factors:
    """Factor H(0)."""
    return factorize(matrix.shifted(0), order, route)


def tall_factors(matrix: Any, order: int, route: str) -> Factors:
    """Factor the matrix with one block row more."""
    return factorize(matrix.tall(), order, route)


def complete_factors(matrix: Any, order: int, route: str) -> Factors:
    """Factor the matrix with one block row more, with all columns of the left factor."""
    return left_factor(matrix.tall(), route)
