"""Realize models from the shift of the row factor: the alternate method (Eqs. 55-64 and 110), which needs no H(1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization, Triple
from modalscope.identification.realizations.balanced import first_blocks
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError

#: Maximum condition of (E0 P)'(E0 P): beyond, there are too few block rows.
_MAX_CONDITION = 1e13


def check_blocks(gram: RealArray, n: int, block_rows: int) -> None:
    """Raise when E0 P has lost rank: fewer block rows than the observability index (57, the inverse of I - p' p)."""
    weights = np.linalg.eigvalsh(gram[:n, :n])
    if weights[0] * _MAX_CONDITION < weights[-1]:
        raise DataError(
            f"order={n} from the shift of one factor:",
            f"{block_rows} block rows without the last leave a factor of condition {np.sqrt(weights[-1] / max(weights[0], 1e-300)):.1e}: "
            "fewer than the observability index",
            "Raise block_rows, or lower the order.",
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Shift(Realization):
    """Shift of the row factor: leading blocks of two small Gram matrices serve all orders.

    `before`: E0 P. `gram`, `cross` (k, k): (E0 P)'(E0 P) and (E0 P)'(E1 P). `B`, `C`: of the largest order; B is None where columns
    are lines or times.
    """

    before: RealArray
    gram: RealArray
    cross: RealArray
    B: RealArray | None
    C: RealArray

    @cached_property
    def _sound(self) -> bool:
        """Whether E0 P has full rank at the largest order, and so at all: eigenvalues of leading blocks lie between the whole's."""
        weights = np.linalg.eigvalsh(self.gram)
        return bool(weights[0] * _MAX_CONDITION >= weights[-1])

    def triple(self, n: int) -> Triple:
        """Return the model of order n from the leading blocks."""
        self.factors.check_order(n)
        if not self._sound:
            check_blocks(self.gram, n, self.matrix.block_rows)
        over, under = self._triangles if self._sound else self._triangles_of(n)
        B = None if self.B is None else self.B[:n]
        return Triple(over[:n, :n] @ under[:n, :n], B, self.C[:, :n], n, self.factors)

    @cached_property
    def _triangles(self) -> tuple[RealArray, RealArray]:
        return self._triangles_of(len(self.gram))

    def _triangles_of(self, n: int) -> tuple[RealArray, RealArray]:
        """Return d^-1/2 L^-T and L^-1 (E0 P)'(E1 P) d^1/2 with (E0 P)'(E0 P) = L L': A is the product of leading blocks."""
        root = np.sqrt(self.factors.d[:n])
        L = np.linalg.cholesky(self.gram[:n, :n])
        inverse = sla.solve_triangular(L, np.eye(n), lower=True, check_finite=False)
        return inverse.T / root[:, None], inverse @ self.cross[:n, :n] * root


def shift(matrix: DataMatrix, factors: Factors) -> Shift:
    """Shift of the row factor: A = d^-1/2 (E0 P)# (E1 P) d^1/2 (Eqs. 57 and 62, in the frequency domain 110).

    (E0 P)# comes from the normal equations of P's leading columns. P is orthonormal, so that E0 P is nearly so, and nothing is lost
    by them; where E0 drops the last block they are the matrix inversion lemma behind Eq. 57: (E0 P)'(E0 P) = I - p' p.

    `factors`: of the matrix with one block row more (`tall`), the largest order.
    """
    before, after = matrix.row_shift.split(factors.P)
    gram, cross = before.T @ before, before.T @ after
    C, B = first_blocks(matrix, factors)
    return Shift(factors=factors, matrix=matrix, before=before, gram=gram, cross=cross, B=B, C=C)
