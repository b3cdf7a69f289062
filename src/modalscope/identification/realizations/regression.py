"""Realize models by least-squares regression on H(0), truncated to n states (Eqs. 65-66)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization, Triple
from modalscope.numerics.checks import RealArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Regression(Realization):
    """Least-squares regression on H(0), truncated: leading blocks of an n x n problem.

    `A` (k, k): P' H(1) Q d^-1. `B`, `CA`: d Q' E_m (None where columns are lines) and E_l' H(1) Q d^-1.
    """

    A: RealArray
    B: RealArray | None
    CA: RealArray

    def triple(self, n: int) -> Triple:
        """Return the model of order n; C comes from C A."""
        self.factors.check_order(n)
        A = self.A[:n, :n]
        C = np.asarray(np.linalg.lstsq(A.T, self.CA[:, :n].T, rcond=None)[0].T, dtype=float)
        return Triple(A, None if self.B is None else self.B[:n], C, n, self.factors, power=0.0)


def regression(matrix: DataMatrix, factors: Factors) -> Regression:
    """Regression A = H(1) H(0)#_n (Eq. 65): the n states in which its nonzero poles lie.

    The matrix of Eq. 65 is of the order of the rows of H(0); with the rank-n pseudo-inverse H(0)#_n = Q d^-1 P' all but n of
    its poles are zero, and those n are the poles of P' H(1) Q d^-1. In these states B = d Q' E_m and C A = E_l' H(1) Q d^-1, so that
    C A^k B = E_l' [H(1) H(0)#_n]^k H(0)_n E_m for every k >= 1.

    `factors`: of H(0), the largest order.
    """
    d = factors.d
    with np.errstate(divide="ignore", invalid="ignore"):
        A = matrix.between(factors) / d
        CA = matrix.first_rows(factors.Q / d, 1)
    first = matrix.first_columns(factors)
    B = None if first is None else np.ascontiguousarray((first * d).T)
    return Regression(factors=factors, matrix=matrix, A=A, B=B, CA=CA)
