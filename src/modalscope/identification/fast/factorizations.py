"""Factorize large data matrices: predict the cost of four routes and choose one.

The dense thin singular value decomposition serves small matrices. Where structure gives the Gram matrix of the shorter side
cheaply, its eigenvectors give the same factors without the matrix; singular values below about 1e-3 of the largest then
lose digits to the square, and one refinement pass (a product with the leading vectors, an orthogonalization, a small
decomposition) brings them back.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

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


#: Directions in excess of the wanted ones, so that the last wanted one is as accurate as the first.
EXTRA = 20


#: Maximum number of entries, and of the shorter side, for which only the dense route is considered: a fraction of a second.
DENSE_ENTRIES, _DENSE_SIDE = 250_000, 400


#: Measured cost of an operation, on one thread, in operations of a matrix product: of an orthogonalization by two Cholesky
#: factors, of eigenvectors, of a singular value decomposition.
_CHOLESKY_COST, _EIGEN_COST, _SVD_COST = 2.0, 2.0, 4.0


#: Below this number of operations, half a second, exact directions of the noise are preferred.
_EXACT_OPERATIONS = 2e10


#: Directions of a randomized range per direction kept; each takes a product from either side.
_RANGE_RATIO = 2


class Cost(NamedTuple):
    """One way of factoring.

    `route`: as `factorize` takes it. `operations`: in units of those of a matrix product. `memory`: bytes beside the data. `passing`:
    operations among them of a refinement pass, which only data without noise, or with modes far below the strongest, need.
    """

    route: str
    operations: float
    memory: float
    passing: float = 0.0

    @property
    def exact_enough(self) -> bool:
        """Whether it gives every direction to rounding and takes little time."""
        return self.route in ("gram", "dense") and self.operations < _EXACT_OPERATIONS


def costs_of(matrix: Operator, wanted: int) -> tuple[Cost, ...]:
    """Return the ways that there are for the leading triplets of a tall matrix, in the order in which they are tried.

    The cheapest comes first, but the Gram matrix and the dense decomposition before a range where they are a matter of half a second: a
    range knows directions in the bulk of the noise, into which diagrams reach, to a few per cent.
    """
    rows, columns = matrix.shape
    if rows < columns:
        return costs_of(matrix.transposed(), wanted)
    k = min(wanted + EXTRA, columns)
    dense = Cost("dense", _SVD_COST * 6 * rows * columns**2, 8.0 * 3 * rows * columns)
    if k == columns or (rows * columns <= DENSE_ENTRIES and columns <= _DENSE_SIDE):
        return (dense,)
    product = matrix.product_operations * k
    both = 8.0 * k * (rows + columns)
    sides = _CHOLESKY_COST * 2.0 * _RANGE_RATIO * (_RANGE_RATIO + 1) * k**2 * (rows + columns)
    ranged = 2 * _RANGE_RATIO * product + sides
    costs = [dense, Cost("randomized", ranged, (_RANGE_RATIO + 1) * both)]
    if matrix.gram_operations is not None:
        eigen = _EIGEN_COST * (4 / 3 * columns**3 + 4 * columns**2 * k)
        refined = 2 * product + _CHOLESKY_COST * 4.0 * k**2 * rows
        memory = 8.0 * 3 * columns**2 + 2 * both
        costs.append(Cost("gram", matrix.gram_operations + eigen + refined, memory, refined))
    return tuple(sorted(costs, key=lambda cost: (not cost.exact_enough, cost.operations)))


def factorize(matrix: Operator, rank: int | None = None, route: str = "auto") -> Factors:
    """Return the leading `rank` singular triplets of a matrix (all when None), by the cheaper exact enough route.

    `rank`: how many triplets will be used. `route`: "auto" takes the dense decomposition for small matrices, and of large ones the
    cheapest that memory allows: the structured Gram matrix, a randomized range unless
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
            "route='gram':", "this data matrix has no structure that gives its Gram matrix", "Use route='auto'."
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
