"""Orthonormal columns with the same span, for matrices of many rows and few columns."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray

__all__ = ["less", "orthogonalized", "spanning"]

#: From so many rows on reflections take longer than two Cholesky factors; they serve while columns stand so far out of each other's span.
_MANY_ROWS, _WELL_APART = 3000, 1e-4

#: Eigenvalues of a Gram matrix below this part of the largest are near rounding; what is left below that part of the data is, too.
_DEPENDENT, _LEAST = 1e-11, 1e-8


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


def spanning(columns: RealArray) -> tuple[RealArray, RealArray]:
    """Return W and R of columns P (K, k), from their products: P W is orthonormal, and P = P W R.

    With columns of length one P'P = V L V', W = V L^-1/2 and R = L^1/2 V', without directions that products cannot tell from dependent
    ones.
    """
    gram = columns.T @ columns
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    kept = values > _DEPENDENT * values.max(initial=0.0)
    root, V = np.sqrt(values[kept]), vectors[:, kept]
    return V / root / size[:, None], (root[:, None] * V.T) * size


def less(data: RealArray, columns: RealArray) -> RealArray:
    """Return data (K, q) less all that columns (K, k) explain.

    By their products, in a third of the time of an orthogonal basis; twice, as what is left is inexact to rounding times the condition;
    data that are explained to 1e-4 by the orthogonal basis.
    """
    W, left = spanning(columns)[0], data
    for _ in range(2):
        left = left - columns @ (W @ (W.T @ (columns.T @ left)))
    if np.sum(left**2) < _LEAST * np.sum(data**2):
        size = np.linalg.norm(columns, axis=0)
        Q = np.asarray(np.linalg.qr(columns[:, size > 0] / size[size > 0])[0])
        left = data - Q @ (Q.T @ data)
    return np.asarray(left)


def _triangle(X: RealArray) -> RealArray | None:
    """Return R with R'R = X'X; None where columns lie so near each other's span that it has few digits."""
    try:
        R = np.linalg.cholesky(X.T @ X).T
    except np.linalg.LinAlgError:
        return None
    diagonal = np.diag(R)
    return np.asarray(R) if diagonal.min() > _WELL_APART * diagonal.max() else None
