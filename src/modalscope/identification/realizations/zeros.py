"""Realize models from the zeros of a scalar fraction in partial fractions: AAA and vector fitting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.identification.matrices.common_poles import CommonPoles
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.triple import Triple
from modalscope.identification.realizations.realization import Realization
from modalscope.numerics.errors import DataError


@dataclass(frozen=True, eq=False, kw_only=True)
class Zeros(Realization):
    """Eigenvalues of L - b c'/d, of an interpolant those of the arrow pencil [0 c'; b L] - x [0 0; 0 I]."""

    matrix: CommonPoles

    def triple(self, n: int) -> Triple:
        """Return the model of order n; shapes and residuals come from least squares over the lines."""
        if not 1 <= n <= self.matrix.largest:
            raise DataError(
                f"order={n} was asked",
                f"the fraction has orders 1 to {self.matrix.largest}",
                "Ask for a larger order when it is built.",
            )
        A = self.matrix.sigma(n).zeros_matrix()
        return Triple(A, None, np.zeros((0, len(A))), len(A))


def zeros(matrix: CommonPoles, factors: Factors) -> Zeros:
    """Return the zeros of the denominators of every order; their first-order change with the data is not known."""
    return Zeros(factors=factors, matrix=matrix)
