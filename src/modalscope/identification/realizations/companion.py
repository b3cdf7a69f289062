"""Realize models in canonical form: block companion matrices by null space or least squares (Eqs. 42-54, 95-101).

The rows V_0, V_1, ..., V_r of the row factor (V_k = C A^k in the time domain) obey V_r = R [V_0; ...; V_{r-1}], and R is the last block row
of the companion matrix in the basis of the shift. Minimum-norm R = P_r (E P)# uses all columns of the null space and needs none of
them; an arbitrary choice of as many columns as outputs would give extraneous poles anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from modalscope.data.shown import percent
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization, RowShift, Triple
from modalscope.identification.realizations.shift import check_blocks
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError


def companion_matrix(last: Array, shift: RowShift, degree: int) -> RealArray:
    """Return the block companion matrix whose last block row expresses V_degree = `last` [V_0; ...; V_(degree-1)].

    Plain shifts give zeros, identities and `last` (Eqs. 53a, 54a with the sign of V_r = R V); a polynomial basis gives its
    recurrence, h' (x) I, with h[degree, degree - 1] `last` added to the last block row.
    """
    block = shift.block
    size = block * degree
    if shift.recurrence is None:
        A = np.eye(size, k=block)
        A[size - block :] = last
        return A
    h = shift.recurrence
    combined = np.asarray(np.kron(h[:degree, :degree].T, np.eye(block)))
    combined[size - block :] += h[degree, degree - 1] * last
    return combined


def _input(matrix: DataMatrix) -> RealArray | None:
    """B = [Y(0); ...; Y(r-1)], the first block column of the data matrix, unweighted; None where columns are lines."""
    column = matrix.first_block_column(tall=True)
    return None if column is None else matrix.row_shift.split(column)[0]


def _output(matrix: DataMatrix, factors: Factors, block: int, states: Array) -> RealArray:
    """C [T_0 V_0; T_0 V_1; ...] = V_0: by the first block where it holds all outputs, else by regression on all blocks.

    `states` is the row factor of the companion's states with Q' the column factor of both.
    """
    outputs = matrix.outputs
    head = np.asarray(matrix.first_block(np.eye(outputs)))
    if np.linalg.matrix_rank(head) == outputs:
        return np.hstack([np.linalg.pinv(head), np.zeros((outputs, states.shape[0] - block))])
    k = states.shape[1]
    Q = factors.Q if factors.Q.size else matrix.tall().transposed_times(factors.P[:, :k]) / factors.d[:k]
    rows = matrix.first_rows(np.ascontiguousarray(Q[:, :k]))
    return np.asarray(np.linalg.lstsq(states.T, rows.T, rcond=None)[0].T)


def _shift_of_whole_blocks(matrix: DataMatrix) -> RowShift:
    shift = matrix.row_shift
    if not shift.whole:
        raise DataError(
            "a companion form:",
            "its block rows are not whole: channels were left out of some",
            "Leave these channels out altogether with select(), or use method='alternate', 'era' or 'least_squares'.",
        )
    return shift


@dataclass(frozen=True, eq=False, kw_only=True)
class NullSpaceCompanion(Realization):
    """Observable canonical form: models with l r poles at any rank n; the l r - n that the truncation does not explain are extraneous.

    `gram` (k, k): (E P)'(E P). `P` (l (r + 1), k): the left factor without weights. `B` (l r, m): the first block column.
    """

    shift: RowShift
    gram: RealArray
    P: RealArray
    B: RealArray | None

    def triple(self, n: int) -> Triple:
        """Return the companion matrix whose last block row is P_r (E P_n)#."""
        self.factors.check_order(n)
        block, r = self.shift.block, self.matrix.block_rows
        if block * r < n:
            raise DataError(
                f"order={n} in canonical form:",
                f"{r} block rows of {block} channels carry {block * r} states",
                "Raise block_rows (block_columns in the controllable form).",
            )
        check_blocks(self.gram, n, r)
        before, last = self.P[: block * r, :n], self.P[block * r :, :n]
        R = last @ sla.solve(self.gram[:n, :n], before.T, assume_a="pos", check_finite=False)
        C = _output(self.matrix, self.factors, block, before * self.factors.d[:n])
        span = np.linalg.qr(before)[0] if n < block * r else None
        return Triple(companion_matrix(R, self.shift, r), self.B, C, n, span=span)


def null_space_companion(matrix: DataMatrix, factors: Factors) -> NullSpaceCompanion:
    """Observable canonical form: last block row P_r (E P_n)#, which is -[X_0 ... X_(r-1)] of Eqs. 52-54 from all columns, minimum norm.

    `factors`: of the matrix with one block row more, the largest rank.
    """
    shift = _shift_of_whole_blocks(matrix)
    P = shift.unweighted(factors.P)
    before = P[: shift.block * matrix.block_rows]
    return NullSpaceCompanion(
        factors=factors, matrix=matrix, shift=shift, gram=before.T @ before, P=P, B=_input(matrix)
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastSquaresCompanion(Realization):
    """Least-squares companion forms of every degree p, of p blocks.

    `stand_in` (l (r + 1), k): P diag(d) without weights: it differs from the matrix by orthonormal columns only. `B` (l r, m): the first
    block column.
    """

    shift: RowShift
    stand_in: RealArray
    B: RealArray | None

    @cached_property
    def triangle(self) -> RealArray:
        """L (l (r + 1), k), lower triangular: the rows in orthonormal coordinates."""
        return np.asarray(sla.qr(self.stand_in.T, mode="r", check_finite=False)[0].T)

    def triple(self, n: int) -> Triple:
        """Return the companion matrix of n / block blocks."""
        block, r = self.shift.block, self.matrix.block_rows
        p, rest = divmod(n, block)
        if rest or not 1 <= p <= r:
            raise DataError(
                f"order={n} of a least-squares companion:",
                f"the order must be a multiple of {block}, at most {block * r} with {r} blocks",
                "Choose such an order, or raise block_rows (block_columns in the controllable form).",
            )
        R = self._last_block_row(n)
        C = _output(self.matrix, self.factors, block, self.stand_in[:n])
        B = None if self.B is None else self.B[:n]
        return Triple(companion_matrix(R, self.shift, p), B, C, min(n, self.factors.rank))

    def _last_block_row(self, n: int) -> RealArray:
        """Return L[p, :p] L[:p, :p]^-1; where these blocks have lost rank the minimum-norm one, if they give the next at all."""
        block, L = self.shift.block, self.triangle
        rcond = max(self.stand_in.shape) * np.finfo(float).eps
        factor, target = L[:n, :n], L[n : n + block, :n]
        pivots = np.abs(np.diag(factor))
        if n <= L.shape[1] and pivots.min() > np.sqrt(rcond) * pivots.max():
            return sla.solve_triangular(factor, target.T, lower=True, trans="T", check_finite=False).T
        R = np.linalg.lstsq(factor.T, target.T, rcond=rcond)[0].T
        share = np.linalg.norm(L[n : n + block] - R @ L[:n]) / max(
            np.linalg.norm(L[n : n + block]), np.finfo(float).tiny
        )
        if share > np.sqrt(rcond):
            raise DataError(
                f"a least-squares companion of {n // block} blocks:",
                f"they are singular and leave {percent(float(share), 2)} of the next one: fewer than the observability index",
                "Raise the order by a block or more.",
            )
        return np.asarray(R)


def least_squares_companion(matrix: DataMatrix, factors: Factors) -> LeastSquaresCompanion:
    """Least-squares form without truncation: the last block row H_p [H_0; ...; H_(p-1)]#, every degree p from one factorization.

    The regression of Eq. 65 without truncation, and with the roles of inputs and outputs exchanged the polyreference complex
    exponential (PRCE; LSCE with one input). The order is the number of states, p times the size of a block. With H = L Q' and L
    lower triangular the degrees are nested: the last block row is L[p, :p] L[:p, :p]^-1, whatever follows. Where L[:p, :p] has
    lost rank (no noise, or more rows than columns) the minimum-norm solution takes its place.

    `factors`: of the matrix with one block row more, complete.
    """
    shift = _shift_of_whole_blocks(matrix)
    stand_in = shift.unweighted(factors.P * factors.d)
    return LeastSquaresCompanion(factors=factors, matrix=matrix, shift=shift, stand_in=stand_in, B=_input(matrix))
