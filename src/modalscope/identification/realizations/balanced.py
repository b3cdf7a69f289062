"""Realize models by balanced projection: the eigensystem realization algorithm (Eqs. 24-28, 39-41)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization, Triple
from modalscope.numerics.checks import RealArray


def first_blocks(matrix: DataMatrix, factors: Factors) -> tuple[RealArray, RealArray | None]:
    """Return C = E_l' H(0) Q d^-1/2 and B = d^1/2 Q' E_m for all kept directions (Eq. 28; 37 and 39 after compression)."""
    C, first = matrix.first_of_states(factors), matrix.first_columns(factors)
    return C, None if first is None else np.ascontiguousarray((first * np.sqrt(factors.d)).T)


@dataclass(frozen=True, eq=False, kw_only=True)
class Balanced(Realization):
    """Balanced projection: the model of order n is the leading n x n block of the largest one.

    `A`, `B`, `C`: of the largest order; B is None where columns are lines.
    """

    A: RealArray
    B: RealArray | None
    C: RealArray

    def triple(self, n: int) -> Triple:
        """Return the leading block of order n."""
        self.factors.check_order(n)
        B = None if self.B is None else self.B[:n]
        return Triple(self.A[:n, :n], B, self.C[:, :n], n, self.factors)


def balanced(matrix: DataMatrix, factors: Factors) -> Balanced:
    """Balanced projection: A = d^-1/2 P' H(1) Q d^-1/2 (Eq. 28, the eigensystem realization algorithm).

    `factors`: of H(0), the largest order.

    Returns
    -------
    Balanced
    """
    K, root = matrix.between(factors), np.sqrt(factors.d)
    with np.errstate(divide="ignore", invalid="ignore"):
        A = K / np.outer(root, root)
    C, B = first_blocks(matrix, factors)
    return Balanced(factors=factors, matrix=matrix, A=A, B=B, C=C)
