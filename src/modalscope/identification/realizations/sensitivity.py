"""First-order change of the poles that a realization reads off its data matrix: one row and one column of it for each pole.

With A = A(H) every pole x moves by dx = L dH v. The coefficients of L and v in bases that serve all orders are small (`sides`), so that
those of several orders go together; the rows and columns themselves are made once (`pairs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.influence import Influence, Lines
from modalscope.identification.matrices.matrix import Eigen, Realization
from modalscope.identification.realizations.balanced import Balanced
from modalscope.identification.realizations.companion import LeastSquaresCompanion, NullSpaceCompanion
from modalscope.identification.realizations.regression import Regression
from modalscope.identification.realizations.shift import Shift
from modalscope.numerics.checks import Array, ComplexArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import padded, times_real


class Sides(NamedTuple):
    """One row (k, a) and one column (b, k) of the data matrix for each of k poles, by coefficients in bases that serve all orders."""

    left: ComplexArray
    right: ComplexArray


def influence_of(realization: Realization, parts: Sequence[tuple[int, Eigen]], lines: Lines | None = None) -> Influence:
    """Return the gradient of eigenvalues of one order, or of several, by the response as it was factored.

    `parts`: orders with eigenvalues of their models. `lines`: those that stand for all; see `FullMatrix.influence`.
    """
    by_order = [sides(realization, n, eigen) for n, eigen in parts]
    both = (
        by_order[0]
        if len(by_order) == 1
        else Sides(padded([s.left for s in by_order]), padded([s.right.T for s in by_order]).T)
    )
    found = pairs(realization, both, np.concatenate([eigen.values for _, eigen in parts]))
    total, *others = (full(realization.matrix).influence(left, right, lines) for left, right in found)
    for more in others:
        total = total.joined(more)
    return total


@singledispatch
def sides(realization: Realization, n: int, eigen: Eigen) -> Sides:
    """Return what `pairs` takes of eigenvalues of the model of order n.

    `eigen`: of the model of the matrix that was factored.

    Raises `DataError`: the first-order change of its poles is not known.
    """
    raise DataError("standard deviations:", "reduced models have none", "Omit reduction, or use method='alternate'.")


@sides.register
def _(realization: Balanced, n: int, eigen: Eigen) -> Sides:
    """F = y d^-1/2 P' and v = Q d^-1/2 x."""
    root = np.sqrt(realization.factors.d[:n])
    return Sides(eigen.left / root, eigen.vectors / root[:, None])


@sides.register
def _(realization: Shift, n: int, eigen: Eigen) -> Sides:
    """F = y d^-1/2 (E0 P)# and v = Q d^-1/2 x."""
    root = np.sqrt(realization.factors.d[:n])
    states = sla.solve(realization.gram[:n, :n], (eigen.left / root).T, assume_a="pos", check_finite=False).T
    return Sides(states, eigen.vectors / root[:, None])


@sides.register
def _(realization: Regression, n: int, eigen: Eigen) -> Sides:
    """F = y P' and v = Q d^-1 x."""
    return Sides(eigen.left, eigen.vectors / realization.factors.d[:n, None])


@sides.register
def _(realization: NullSpaceCompanion, n: int, eigen: Eigen) -> Sides:
    """F = y, whose states are the block rows, and v = Q d^-1 (E0 P)# x."""
    before = realization.P[: realization.shift.block * realization.matrix.block_rows, :n]
    projected = times_real(eigen.vectors.T, before).T
    inner = sla.solve(realization.gram[:n, :n], projected, assume_a="pos", check_finite=False)
    return Sides(eigen.left, np.asarray(inner / realization.factors.d[:n, None], dtype=complex))


@sides.register
def _(realization: LeastSquaresCompanion, n: int, eigen: Eigen) -> Sides:
    """Y and (H H')^-1 x."""
    L = realization.triangle[:n, :n]
    if L.shape[1] < n:  # more rows than columns: the regression is of minimum norm
        return sides.dispatch(Realization)(realization, n, eigen)
    half = sla.solve_triangular(L, eigen.vectors, lower=True, check_finite=False)
    return Sides(eigen.left, sla.solve_triangular(L, half, lower=True, trans="T", check_finite=False))


@singledispatch
def pairs(realization: Realization, found: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
    """Return L and v with dx_j = L_j dH v_j, as `FullMatrix.influence` takes them; several pairs stand for their sum.

    `values` (k,): the eigenvalues.
    """
    basis = realization.factors.P
    return _of_basis(realization, found, values, basis, tall=False)


@pairs.register
def _(realization: Shift, found: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
    """Rows in the basis E0 P."""
    return _of_basis(realization, found, values, realization.before, tall=True)


def _of_basis(
    realization: Realization, found: Sides, values: ComplexArray, basis: Array, *, tall: bool
) -> tuple[tuple[Any, Any], ...]:
    """Return one pair whose left coefficients are those of a basis (rows, k)."""
    matrix = full(realization.matrix)
    rows = times_real(found.left, basis[:, : found.left.shape[1]].T)
    return ((matrix.pencil(rows, values, tall=tall), matrix.right_vectors(realization.factors, found.right)),)


@pairs.register
def _(realization: NullSpaceCompanion, found: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
    """Rows as they are."""
    matrix = full(realization.matrix)
    return ((matrix.pencil(found.left, values, tall=True), matrix.right_vectors(realization.factors, found.right)),)


@pairs.register
def _(realization: LeastSquaresCompanion, found: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
    """F = y with v = H' (H H')^-1 x, and what follows from the rest of the regression, changed rows times what they leave.

    With R = H_p H' (H H')^-1 and E = H_p - R H the change is dR = [(dH_p - R dH) H' + E dH'] (H H')^-1.
    """
    (k, n), block = found.left.shape, realization.shift.block
    left, weights = np.zeros((2, k, realization.stand_in.shape[0]), dtype=complex)
    left[:, block : n + block] = found.left
    left[:, :n] -= values[:, None] * found.left
    weights[:, :n] = found.right.T
    columns = _columns_of(realization, np.vstack([weights, left]))
    return ((left, columns[:, :k]), (weights, columns[:, k:]))


def _columns_of(realization: LeastSquaresCompanion, left: Array) -> ComplexArray:
    """Return H' X' of the rows without weights, (columns, k)."""
    weight = realization.shift.weight
    rows = (left if weight is None else left / weight).T
    both = realization.matrix.tall().transposed_times(np.ascontiguousarray(rows).view(np.float64))
    return np.ascontiguousarray(both.T[::2] + 1j * both.T[1::2]).T  # a vector lies in one piece
