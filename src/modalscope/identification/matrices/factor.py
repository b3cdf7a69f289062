"""Factorize data matrices, H = P diag(d) Q': predict the cost of four routes and choose one.

The dense thin singular value decomposition serves small matrices. Where structure gives the Gram matrix of the shorter side
cheaply, its eigenvectors give the same factors without the matrix; singular values below about 1e-3 of the largest then
lose digits to the square, and one refinement pass (a product with the leading vectors, an orthogonalization, a small
decomposition) brings them back.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.linalg as sla

from modalscope.identification.matrices.costs import DENSE_ENTRIES, EXTRA, Cost, costs_of
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.operators import Operator, Product
from modalscope.numerics.orthonormal import orthonormal_by
from modalscope.numerics.randomized import Triplets, by_lanczos, by_range
from modalscope.numerics.resources import allowed_memory, check_fits
from modalscope.numerics.sums import TriangleSum

#: Routes of factorization.
FACTORIZATIONS = ("auto", "dense", "gram", "randomized", "lanczos")

#: Ratio of singular values below which the Gram route needs a refinement pass to keep its digits.
_REFINED_BELOW = 1e-3

#: Maximum condition of all rows for a regression by their Gram matrix: its error, eps times the square, stays below 1e-8.
_MAX_GRAM_CONDITION = 1e4

#: Rows of a streamed triangular factorization processed at a time, in multiples of the columns.
_CHUNK_ROWS = 2


class RightFactor(Protocol):
    """The right factor on the columns that indicators compare, computed when it is first asked for."""

    @property
    def blocks(self) -> RealArray:
        """Rows of Q by input that are compared, (m, rows, k)."""

    @property
    def whole(self) -> RealArray:
        """All rows of Q by input."""


@dataclass(frozen=True, eq=False)
class Factors:
    """H = P diag(d) Q', the leading part, with how it was found.

    `left` (rows, k): orthonormal left vectors, or the product H Q d^-1 that gives them when they are first asked for. `d` (k,): singular
    values, decreasing. `Q` (columns, k): orthonormal right vectors. `spectrum`: all singular values that the route gives: the dense one
    all, the Gram route those it carried. `rank`: number of singular values above rounding. `how`: the route, in words. `gram`: the Gram
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
    right: RightFactor | None = field(default=None, repr=False)
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

    @cached_property
    def complete_spectrum(self) -> RealArray:
        """All singular values, down to sqrt(eps) of the first where they come from the Gram matrix.

        Those that a range did not carry are drawn as d_last (1 - u)^p, u from 0 to 1, with p by the energy that they have together.
        """
        count, energy = self.rest
        if count:
            last = self.spectrum[-1]
            p = max(last**2 * count / max(energy, np.finfo(float).tiny) - 1, 0) / 2
            return np.concatenate([self.spectrum, last * (1 - (np.arange(count) + 0.5) / count) ** p])
        if self.gram is None:
            return self.spectrum
        values = sla.eigvalsh(self.gram, check_finite=False)[::-1]
        return np.concatenate([self.spectrum, np.sqrt(np.clip(values[self.spectrum.size :], 0, None))])

    def check_order(self, order: int) -> None:
        """Raise when `order` states cannot be told from rounding."""
        if order > self.rank:
            raise DataError(
                f"order={order} was asked",
                f"the data matrix has rank {self.rank}",
                f"Lower the order to at most {self.rank}, or give more block rows and columns.",
            )


def factorize(matrix: Operator, rank: int | None = None, route: str = "auto") -> Factors:
    """Return the leading `rank` singular triplets of a matrix (all when None), by the cheaper exact enough route.

    `rank`: how many triplets will be used. `route`: "auto" takes the dense decomposition for small matrices, and of large ones the
    cheapest that memory allows (see `modalscope.identification.matrices.factor`): the structured Gram matrix, a randomized range unless
    directions that stand out do not settle, or dense.

    Raises `DataError`: A matrix of zeros, the Gram route without structure, or more memory than there is.
    """
    rows, columns = matrix.shape
    if rows < columns:
        return factorize(matrix.transposed(), rank, route).transposed()
    check_choice("factorization", route, FACTORIZATIONS)
    wanted = columns if rank is None else min(rank, columns)
    if route != "auto":
        factors = _by(route, matrix, wanted, asked=True)
        assert factors is not None
        return factors
    for cost in _that_fit(matrix, wanted):
        factors = _by(cost.route, matrix, wanted, asked=False)
        if factors is not None:
            return factors
    return _dense(matrix, wanted)


def _that_fit(matrix: Operator, wanted: int) -> list[Cost]:
    """Return the ways that memory allows, the cheapest first, or raise when there is none."""
    costs = costs_of(matrix, wanted)
    rows, columns = matrix.shape
    least = min(cost.memory for cost in costs)
    change = "Lower the order or the block sizes, choose fewer channels or a narrower band, or raise --max-memory."
    check_fits(f"{wanted} singular vectors of a matrix of {rows} x {columns}", least, change)
    return [cost for cost in costs if cost.memory <= allowed_memory()]


def _by(route: str, matrix: Operator, wanted: int, *, asked: bool) -> Factors | None:
    """Return the factors by one way; None where it does not reach its accuracy, or has no structure, and was not asked for."""
    columns = matrix.shape[1]
    if route == "lanczos" and wanted < columns:
        return _by_products(matrix, by_lanczos(matrix, wanted), wanted, "Lanczos")
    if route == "randomized":
        triplets = by_range(matrix, min(wanted + EXTRA, columns))
        how = f"randomized range of {triplets.directions} directions"
        return _by_products(matrix, triplets, wanted, how) if triplets.reached or asked else None
    if route == "gram":
        gram = matrix.gram()
        if gram is not None:
            return _by_gram(matrix, gram, wanted)
        if not asked:
            return None
        raise DataError(
            "route='gram' was asked",
            "this data matrix has no structure that gives its Gram matrix",
            "Use route='auto'.",
        )
    return _dense(matrix, wanted)


def left_factor(matrix: Operator, route: str = "auto") -> Factors:
    """Return all of P and d, Q without columns: what a regression on whole rows needs, with nothing of the columns' size kept.

    From the Gram matrix of the rows where it is known and well conditioned; else by an orthogonal triangularization that takes
    the columns in chunks; small matrices by the dense decomposition.
    """
    rows, columns = matrix.shape
    nothing = np.zeros((columns, 0))
    if route == "dense" or rows * columns <= DENSE_ENTRIES or rows > columns:
        triplets = _dense(matrix, min(rows, columns))
        return Factors(triplets.P, triplets.d, nothing, triplets.spectrum, triplets.rank, triplets.how)
    gram = matrix.transposed().gram()
    if gram is not None:
        weights, P = sla.eigh(gram, check_finite=False)
        if weights[0] * _MAX_GRAM_CONDITION**2 > weights[-1]:
            d = np.sqrt(weights[::-1])
            how = f"structured Gram matrix of the rows of {rows} x {columns}"
            return Factors(np.ascontiguousarray(P[:, ::-1]), d, nothing, d, d.size, how)
    total = TriangleSum(rows)
    for chunk in matrix.transposed().row_chunks(_CHUNK_ROWS * rows):
        total.add(chunk)
    P, d, _ = sla.svd(total.finish().T, full_matrices=False, check_finite=False)
    how = f"triangular factor of {rows} x {columns}"
    return _finish(P, d, nothing, d, max(rows, columns) * float(np.finfo(float).eps), how)


def _finish(
    P: RealArray | Product,
    d: RealArray,
    Q: RealArray,
    spectrum: RealArray,
    floor: float,
    how: str,
    gram: RealArray | None = None,
) -> Factors:
    if d.size == 0 or d[0] <= 0:
        raise DataError("a data matrix with content was asked", "it is zero", "Give data with a response in them.")
    return Factors(P, d, Q, spectrum, _rank(d, floor), how, gram)


def _rank(d: RealArray, floor: float) -> int:
    """Count singular values above rounding; a drop of a thousand to below 1e-10 of the first is rounding of the data themselves."""
    above = int(np.count_nonzero(d > floor * d[0]))
    drops = np.flatnonzero((d[1:] < 1e-10 * d[0]) & (d[1:] < 1e-3 * d[:-1]))
    return min(above, int(drops[0]) + 1) if drops.size else above


def _dense(matrix: Operator, wanted: int) -> Factors:
    H = matrix.dense()
    try:
        P, d, Qt = sla.svd(H, full_matrices=False, lapack_driver="gesdd", check_finite=False)
    except sla.LinAlgError:  # gesdd rarely fails where the slower gesvd converges
        P, d, Qt = sla.svd(H, full_matrices=False, lapack_driver="gesvd", check_finite=False)
    floor = max(H.shape) * np.finfo(float).eps
    return _finish(
        np.array(P[:, :wanted]),
        d[:wanted],
        np.array(Qt[:wanted].T),
        d,
        floor,
        f"dense singular value decomposition, {H.shape[0]} x {H.shape[1]}",
    )


def _by_products(matrix: Operator, found: Triplets, wanted: int, how: str) -> Factors:
    rows, columns = matrix.shape
    floor = max(rows, columns) * float(np.finfo(float).eps)
    P, d, Q = found.P[:, :wanted], found.d[:wanted], found.Q[:, :wanted]
    made = _finish(P, d, Q, found.d, floor, f"{how}, {rows} x {columns}")
    return replace(made, rest=(columns - found.d.size, max(matrix.energy - float(np.sum(found.d**2)), 0.0)))


def _by_gram(matrix: Operator, gram: RealArray, wanted: int) -> Factors:
    columns = gram.shape[0]
    eps = np.finfo(float).eps
    carried = min(wanted + EXTRA, columns)
    weights, Q = sla.eigh(gram, subset_by_index=(columns - carried, columns - 1), check_finite=False)
    weights, Q = np.clip(weights[::-1], 0, None), Q[:, ::-1]
    d = np.sqrt(weights)
    size = f"{matrix.shape[0]} x {columns}"
    if d[0] > 0 and d[wanted - 1] > _REFINED_BELOW * d[0]:
        P = Product(matrix, np.ascontiguousarray(Q[:, :wanted]) / d[:wanted])
        how = f"structured Gram matrix of {size}"
        return _finish(P, d[:wanted], Q[:, :wanted], d, columns * eps, how, gram)
    left, by = orthonormal_by(matrix.times(np.ascontiguousarray(Q)))
    coefficients = matrix.transposed_times(left)
    U, d, Vt = np.linalg.svd((coefficients if by is None else coefficients @ by).T, full_matrices=False)
    turn = U[:, :wanted] if by is None else by @ U[:, :wanted]
    how = f"structured Gram matrix of {size} with a refinement pass"
    # directions below the Gram matrix' resolution are not separated by it: what the pass finds there is not rank
    return _finish(left @ turn, d[:wanted], Vt[:wanted].T, d, max(matrix.shape) * eps, how, gram)
