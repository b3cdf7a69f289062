"""Orthonormal bases of tall arrays by Cholesky factors, where their condition allows it."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray

__all__ = ["orthonormal", "orthonormal_by"]

#: Distance from orthonormal columns within which a pass reaches rounding: the condition is then below (1 + .1) / (1 - .1).
_NEAR = 0.1


def orthonormal(columns: RealArray) -> RealArray:
    """Return orthonormal columns of the same span, (K, k): one or two passes X R^-1 with R'R = X'X, which are products, or Householder's.

    The first pass leaves about eps times the square of the condition, columns brought to one length: rounding where they are nearly
    orthogonal, as what comes out of a Gram matrix' eigenvectors is. Where it is small beside one the second pass leaves rounding; other
    columns cost a tenth more for the trial.

    Parameters
    ----------
    columns : array, (K, k)
        K >= k.

    References
    ----------
    Yamamoto, Nakatsukasa, Yanagisawa and Fukaya, "Roundoff error analysis of the CholeskyQR2 algorithm", ETNA 44 (2015).

    Examples
    --------
    >>> X = np.random.default_rng(0).standard_normal((50, 3)) * [1, 1e-9, 1e5]
    >>> Q = orthonormal(X)
    >>> bool(np.allclose(Q.T @ Q, np.eye(3), atol=1e-14)), bool(np.allclose(Q @ (Q.T @ X), X, rtol=1e-12))
    (True, True)
    """
    base, by = orthonormal_by(columns)
    return base if by is None else np.asarray(base @ by)


def orthonormal_by(columns: RealArray) -> tuple[RealArray, RealArray | None]:
    """Return X (K, k) and T (k, k) of which X T is what `orthonormal` gives, for products that take T last; T is None where X is that."""
    size = np.sqrt(np.einsum("kj,kj->j", columns, columns))
    if not np.all(size > 0) or not np.all(np.isfinite(size)):
        return np.asarray(np.linalg.qr(columns)[0]), None
    found = columns
    for scale in (size, np.ones_like(size)):
        gram = found.T @ found / np.outer(scale, scale)
        near = np.linalg.norm(gram - np.eye(len(size))) <= _NEAR
        if found is not columns and not near:
            break
        try:
            inverse = sla.lapack.dtrtri(sla.cholesky(gram, check_finite=False))[0]
        except sla.LinAlgError:
            break
        by = np.asarray(inverse / scale[:, None])
        if near:
            return found, by
        found = np.asarray(found @ by)
    return np.asarray(np.linalg.qr(columns)[0]), None
