"""Factorize large data matrices: predict the cost of four routes and choose one.

The dense thin singular value decomposition serves small matrices. Where structure gives the Gram matrix of the shorter side
cheaply, its eigenvectors give the same factors without the matrix; singular values below about 1e-3 of the largest then
lose digits to the square, and one refinement pass (a product with the leading vectors, an orthogonalization, a small
decomposition) brings them back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from modalscope.identification.fast.costs import DENSE_ENTRIES, EXTRA, Cost, costs_of
from modalscope.identification.matrices.factor import FACTORIZATIONS, Factors, dense_factors, ranked
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.operators import Operator, Product
from modalscope.numerics.orthonormal import orthonormal_by
from modalscope.numerics.randomized import Triplets, by_lanczos, by_range
from modalscope.numerics.resources import allowed_memory, check_fits
from modalscope.numerics.sums import TriangleSum

#: Ratio of singular values below which the Gram route needs a refinement pass to keep its digits.
_REFINED_BELOW = 1e-3

#: Maximum condition of all rows for a regression by their Gram matrix: its error, eps times the square, stays below 1e-8.
_MAX_GRAM_CONDITION = 1e4

#: Rows of a streamed triangular factorization processed at a time, in multiples of the columns.
_CHUNK_ROWS = 2


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
    return dense_factors(matrix, wanted)


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
    return dense_factors(matrix, wanted)


def left_factor(matrix: Operator, route: str = "auto") -> Factors:
    """Return all of P and d, Q without columns: what a regression on whole rows needs, with nothing of the columns' size kept.

    From the Gram matrix of the rows where it is known and well conditioned; else by an orthogonal triangularization that takes
    the columns in chunks; small matrices by the dense decomposition.
    """
    rows, columns = matrix.shape
    nothing = np.zeros((columns, 0))
    if route == "dense" or rows * columns <= DENSE_ENTRIES or rows > columns:
        triplets = dense_factors(matrix, min(rows, columns))
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
    return ranked(Factors(P, d, nothing, d, 0, how), max(rows, columns) * float(np.finfo(float).eps))


def _by_products(matrix: Operator, found: Triplets, wanted: int, how: str) -> Factors:
    rows, columns = matrix.shape
    floor = max(rows, columns) * float(np.finfo(float).eps)
    P, d, Q = found.P[:, :wanted], found.d[:wanted], found.Q[:, :wanted]
    made = Factors(P, d, Q, found.d, 0, f"{how}, {rows} x {columns}")
    left = columns - found.d.size, max(matrix.energy - float(np.sum(found.d**2)), 0.0)
    return ranked(replace(made, rest=left), floor)


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
        return ranked(Factors(P, d[:wanted], Q[:, :wanted], d, 0, how, gram), columns * eps)
    left, by = orthonormal_by(matrix.times(np.ascontiguousarray(Q)))
    coefficients = matrix.transposed_times(left)
    U, d, Vt = np.linalg.svd((coefficients if by is None else coefficients @ by).T, full_matrices=False)
    turn = U[:, :wanted] if by is None else by @ U[:, :wanted]
    how = f"structured Gram matrix of {size} with a refinement pass"
    # directions below the Gram matrix' resolution are not separated by it: what the pass finds there is not rank
    return ranked(Factors(left @ turn, d[:wanted], Vt[:wanted].T, d, 0, how, gram), max(matrix.shape) * eps)
