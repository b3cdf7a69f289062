"""Canonical forms: block companion matrices from the null space of the data matrix, or by least squares (Eqs. 42-54, 95-101).

The rows V_0, V_1, ..., V_r of the row factor (V_k = C A^k in the time domain) obey V_r = R [V_0; ...; V_{r-1}], and R is the last block row
of the companion matrix in the basis of the shift. Minimum-norm R = P_r (E P)# uses all columns of the null space and needs none of
them; an arbitrary choice of as many columns as outputs would give extraneous poles anywhere.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import Factors
from modalscope.blocks.matrix import DataMatrix, RowShift
from modalscope.model.checks import Array, DataError, RealArray
from modalscope.realize.shift import check_blocks, shift_grams
from modalscope.realize.triple import Realization, Triple

__all__ = ["companion_matrix", "least_squares_companion", "null_space_companion"]


def companion_matrix(last: Array, shift: RowShift, degree: int) -> RealArray:
    """Return the block companion matrix whose last block row expresses V_degree = `last` [V_0; ...; V_(degree-1)].

    Plain shifts give zeros, identities and `last` (Eq. 53a, 54a with the sign of V_r = R V); a polynomial basis gives its recurrence, h' (x) I, with
    h[degree, degree - 1] `last` added to the last block row.
    """
    block = shift.block
    size = block * degree
    if shift.recurrence is None:
        A = np.zeros((size, size))
        A[: size - block, block:] = np.eye(size - block)
        A[size - block :] = last
        return A
    h = shift.recurrence
    A = np.kron(h[:degree, :degree].T, np.eye(block))
    A[size - block :] += h[degree, degree - 1] * last
    return A


def _output(matrix: DataMatrix, block: int, degree: int) -> RealArray:
    """C = [I 0 ... 0], over p_0 on a polynomial basis; compression within blocks is undone by `first_rows` elsewhere."""
    first = float(getattr(matrix, "first_value", 1.0))
    return np.hstack([np.eye(block) / first, np.zeros((block, block * (degree - 1)))])


def _input(matrix: DataMatrix, degree: int) -> RealArray | None:
    """B = [Y(0); ...; Y(r-1)], the first block column of the data matrix; None where columns are lines."""
    columns = matrix.shifted(0).shape[1]
    unit = matrix.first_columns(np.eye(columns))
    if unit is None:
        return None
    column = matrix.row_shift.split(matrix.tall().times(np.ascontiguousarray(unit.T)))[0]
    return column[: matrix.row_shift.block * degree]


def _needs_whole_blocks(matrix: DataMatrix, factors: Factors) -> tuple[RowShift, int]:
    shift = matrix.row_shift
    rows, outputs = factors.P.shape[0], matrix.first_rows(factors.Q[:, :1]).shape[0]
    if shift.block != outputs or rows != shift.block * (matrix.block_rows + 1):
        raise DataError(
            "a companion form was asked",
            "its block rows are not whole: sensors were left out of some, or compressed",
            "Leave the sensors out altogether with select(), or use method='alternate', 'era' or 'least_squares'.",
        )
    return shift, matrix.block_rows


def null_space_companion(matrix: DataMatrix, factors: Factors) -> Realization:
    """Observable canonical form: last block row P_r (E P_n)#, which is -[X_0 ... X_(r-1)] of Eqs. 52-54 from all columns, minimum norm.

    Parameters
    ----------
    matrix : DataMatrix
    factors : Factors
        Of the matrix with one block row more, the largest rank.

    Returns
    -------
    Realization
        Models with l r poles at any rank n; the l r - n that the truncation does not explain are extraneous.
    """
    shift, r = _needs_whole_blocks(matrix, factors)
    gram, _ = shift_grams(matrix, factors)
    P = shift.unweighted(factors.P)
    block = shift.block
    before, last = P[: block * r], P[block * r :]
    C, B = _output(matrix, block, r), _input(matrix, r)

    def triple(n: int) -> Triple:
        factors.check_order(n)
        if block * r < n:
            raise DataError(
                f"order={n} in canonical form was asked",
                f"{r} block rows of {block} outputs carry {block * r} states",
                "Raise block_rows.",
            )
        check_blocks(gram, n, r)
        R = last[:, :n] @ sla.solve(gram[:n, :n], before[:, :n].T, assume_a="pos", check_finite=False)
        return Triple(companion_matrix(R, shift, r), B, C, n)

    return Realization(factors, triple, canonical=True)


def least_squares_companion(matrix: DataMatrix, factors: Factors) -> Realization:
    """Least-squares form without truncation: the last block row H_p [H_0; ...; H_(p-1)]#, every degree p from one factorization.

    The regression of Eq. 65 without truncation, and with the roles of inputs and outputs exchanged the polyreference complex exponential (PRCE; LSCE with
    one input). The order is the number of states, p times the size of a block.

    Parameters
    ----------
    matrix : DataMatrix
    factors : Factors
        Of the matrix with one block row more, complete.
    """
    shift, r = _needs_whole_blocks(matrix, factors)
    block = shift.block
    # P diag(d) differs from the matrix by orthonormal columns only
    stand_in = shift.unweighted(factors.P * factors.d)
    rcond = max(stand_in.shape) * np.finfo(float).eps

    def triple(n: int) -> Triple:
        p, rest = divmod(n, block)
        if rest or not 1 <= p <= r:
            raise DataError(
                f"order={n} of a least-squares companion was asked",
                f"its order is a multiple of {block}, at most {block * r} with block_rows={r}",
                "Choose such an order, or raise block_rows.",
            )
        known, target = stand_in[: block * p], stand_in[block * p : block * (p + 1)]
        R = np.linalg.lstsq(known.T, target.T, rcond=rcond)[0].T
        return Triple(companion_matrix(R, shift, p), _input(matrix, p), _output(matrix, block, p), n)

    return Realization(factors, triple, canonical=True)
