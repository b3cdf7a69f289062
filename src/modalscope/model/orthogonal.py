"""Orthonormal columns with the same span, for matrices of many rows and few columns."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray

__all__ = ["orthogonalized"]

#: From so many rows on reflections take longer than two Cholesky factors; they serve while columns stand so far out of each other's span.
_MANY_ROWS, _WELL_APART = 3000, 1e-4


def orthogonalized(X: RealArray) -> tuple[RealArray, RealArray]:
    """Return Q R = X: of many rows by two Cholesky factors of the Gram matrix, as exact as reflections up to a condition of 1e4.

    Yamamoto et al., "Roundoff error analysis of the CholeskyQR2 algorithm", Electronic Transactions on Numerical Analysis 44 (2015).
    """
    first = _triangle(X) if len(X) > _MANY_ROWS else None
    if first is not None:
        Q = X @ np.linalg.inv(first)
        second = _triangle(Q)
        if second is not None:
            return Q @ np.linalg.inv(second), second @ first
    factors = sla.qr(X, mode="economic", check_finite=False)
    return np.asarray(factors[0], dtype=float), np.asarray(factors[1], dtype=float)


def _triangle(X: RealArray) -> RealArray | None:
    """Return R with R'R = X'X; None where columns lie so near each other's span that it has few digits."""
    try:
        R = np.linalg.cholesky(X.T @ X).T
    except np.linalg.LinAlgError:
        return None
    diagonal = np.diag(R)
    return np.asarray(R) if diagonal.min() > _WELL_APART * diagonal.max() else None
