"""The shift of one factor: the alternate method (Eqs. 55-64 and 110), rows of the table that need no H(1)."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import Factors
from modalscope.blocks.matrix import DataMatrix
from modalscope.model.checks import DataError, RealArray
from modalscope.realizations.balanced import first_blocks
from modalscope.realizations.triple import Realization, Triple

__all__ = ["check_blocks", "shift", "shift_grams"]

#: Beyond this condition of (E0 P)'(E0 P) the last block row carries what the others lack: too few block rows.
_SINGULAR = 1e13


def shift_grams(matrix: DataMatrix, factors: Factors) -> tuple[RealArray, RealArray]:
    """Return (E0 P)'(E0 P) and (E0 P)'(E1 P) of the unweighted left factor; leading blocks of both serve all orders."""
    before, after = matrix.row_shift.split(factors.P)
    return np.asarray(before.T @ before), np.asarray(before.T @ after)


def check_blocks(gram: RealArray, n: int, block_rows: int) -> None:
    """Raise when E0 P has lost rank: fewer block rows than the observability index (57, the inverse of I - p' p)."""
    weights = np.linalg.eigvalsh(gram[:n, :n])
    if weights[0] * _SINGULAR < weights[-1]:
        raise DataError(
            f"order={n} from the shift of one factor was asked",
            f"{block_rows} block rows without the last leave a factor of condition {np.sqrt(weights[-1] / max(weights[0], 1e-300)):.1e}: "
            "fewer than the observability index",
            "Raise block_rows, or lower the order.",
        )


def shift(matrix: DataMatrix, factors: Factors) -> Realization:
    """Shift of the row factor: A = d^-1/2 (E0 P)# (E1 P) d^1/2 (Eqs. 57 and 62, in the frequency domain 110).

    (E0 P)# comes from the normal equations of P's leading columns. P is orthonormal, so that E0 P is nearly so, and nothing is lost
    by them; where E0 drops the last block they are the matrix inversion lemma behind Eq. 57: (E0 P)'(E0 P) = I - p' p.

    Parameters
    ----------
    matrix : DataMatrix
    factors : Factors
        Of the matrix with one block row more (`tall`), the largest order.
    """
    gram, cross = shift_grams(matrix, factors)
    root = np.sqrt(factors.d)
    C, B = first_blocks(matrix, factors)

    def triple(n: int) -> Triple:
        factors.check_order(n)
        check_blocks(gram, n, matrix.block_rows)
        A = sla.solve(gram[:n, :n], cross[:n, :n], assume_a="pos", check_finite=False)
        return Triple(A * root[:n] / root[:n, None], None if B is None else B[:n], C[:, :n], n)

    return Realization(factors, triple)
