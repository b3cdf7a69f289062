"""Orthonormal columns with the same span, for matrices of many rows and few columns."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray

__all__ = ["energy_left", "less", "resolved", "scaled_span", "spanning"]

#: From so many rows on reflections take longer than two Cholesky factors.
_MANY_ROWS = 3000

#: Distance from orthonormal columns, after the first factor, within which the second is exact: the condition is below (1 + .1) / (1 - .1).
_NEAR = 0.1

#: Rows that two products take at a time: what lies between them stays in the cache.
_AT_A_TIME = 256

#: Eigenvalues of a Gram matrix below this part of the largest are near rounding; what is left below that part of the data is, too.
_DEPENDENT, _LEAST = 1e-11, 1e-8

#: Largest relative error, by a bound that is met to a hundredth or so, of an energy that is told as a difference.
_EXACT = 1e-7


def resolved(X: RealArray, data: RealArray) -> tuple[RealArray, RealArray]:
    """Return Q'D and R of Q R = X: of many rows by two Cholesky factors of Gram matrices, as exact as reflections.

    Columns are brought to one length for that. The first basis X R1^-1, by substitution row by row, is orthonormal but for eps times the
    squared condition; where its own Gram matrix shows that to be small, the second factor leaves rounding. It is applied to what the first
    basis sees of the data, as reflections are to the data: Q is never made.

    Parameters
    ----------
    X : array, (K, k)
        Columns that are not zero.
    data : array, (K, q)

    References
    ----------
    Yamamoto et al., "Roundoff error analysis of the CholeskyQR2 algorithm", Electronic Transactions on Numerical Analysis 44 (2015).
    """
    if not X.size:  # no modes: LAPACK has no reflections for them
        return np.zeros((0, data.shape[1])), np.zeros((0, X.shape[1]))
    gram = X.T @ X
    scale = np.sqrt(np.diag(gram))
    first = _triangle(gram / np.outer(scale, scale)) if len(X) > _MANY_ROWS else None
    if first is not None:
        first = np.asfortranarray(first * scale)
        near, seen = np.zeros_like(gram), np.zeros((len(scale), data.shape[1]))
        for start in range(0, len(X), _AT_A_TIME):
            some = np.array(X[start : start + _AT_A_TIME], order="F")
            rows = sla.blas.dtrsm(1.0, first, some, side=1, overwrite_b=1)
            near += rows.T @ rows
            seen += rows.T @ data[start : start + _AT_A_TIME]
        second = _triangle(near) if np.linalg.norm(near - np.eye(len(near))) <= _NEAR else None
        if second is not None:
            found = sla.solve_triangular(second, seen, trans=1, check_finite=False)
            return np.asarray(found), np.asarray(second @ first)
    mirrored, R = sla.qr_multiply(X / scale, data.T, mode="right", overwrite_a=True)
    return np.asarray(mirrored.T, dtype=float), np.asarray(R * scale, dtype=float)


def spanning(gram: RealArray) -> tuple[RealArray, RealArray]:
    """Return W and R of columns P (K, k), from their products P'P (k, k): P W is orthonormal, and P = P W R.

    With columns of length one P'P = V L V', W = V L^-1/2 and R = L^1/2 V', without directions that products cannot tell from dependent
    ones.
    """
    W, R, _ = _spanned(gram)
    return W, R


def less(data: RealArray, columns: RealArray) -> RealArray:
    """Return data (K, q) less all that columns (K, k) explain.

    By their products, in a third of the time of an orthogonal basis; twice, as what is left is inexact to rounding times the condition;
    data that are explained to 1e-4 by the orthogonal basis.
    """
    columns = _finite(columns)
    return _less(data, columns, _spanned(columns.T @ columns)[0])


def energy_left(data: RealArray, columns: RealArray) -> RealArray:
    """Return the sums of squares of `less(data, columns)`, (q,): as differences where digits allow, else of the values themselves."""
    columns = _finite(columns)
    W, _, spread = _spanned(columns.T @ columns)
    whole, seen = np.einsum("kq,kq->q", data, data), W.T @ (columns.T @ data)
    left = whole - np.einsum("kq,kq->q", seen, seen)
    # a direction is known to rounding times the condition, and takes that share of all others with it
    error = np.finfo(float).eps * np.sqrt(whole) * (spread @ np.abs(seen))
    rounded = ~(left * _EXACT > error)
    if np.any(rounded):
        rest = _less(data[:, rounded], columns, W)
        left[rounded] = np.einsum("kq,kq->q", rest, rest)
    return np.asarray(left)


def _finite(columns: RealArray) -> RealArray:
    """Return columns whose squares can be summed: only what they span counts."""
    if np.isfinite(np.einsum("kc,kc->", columns, columns)):
        return columns
    size = np.abs(columns).max(axis=0)
    return np.asarray(columns / np.where(size > 0, size, 1.0))


def _spanned(gram: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return W and R as `spanning` does, and by how much smaller than the largest each direction is, squared."""
    size = np.sqrt(np.diag(gram))
    used = np.flatnonzero(size)
    values, vectors = np.linalg.eigh(gram[np.ix_(used, used)] / np.outer(size[used], size[used]))
    kept = values > _DEPENDENT * values.max(initial=0.0)
    root, V = np.sqrt(values[kept]), vectors[:, kept]
    W, R = np.zeros((size.size, root.size)), np.zeros((root.size, size.size))
    W[used], R[:, used] = V / root / size[used, None], (root[:, None] * V.T) * size[used]
    return W, R, values.max(initial=0.0) / values[kept]


def _less(data: RealArray, columns: RealArray, W: RealArray) -> RealArray:
    left = data
    for _ in range(2):
        left = left - columns @ (W @ (W.T @ (columns.T @ left)))
    if np.sum(left**2) < _LEAST * np.sum(data**2):
        Q = np.asarray(np.linalg.qr(columns[:, np.any(W, axis=1)])[0])
        left = data - Q @ (Q.T @ data)
    return np.asarray(left)


def _triangle(gram: RealArray) -> RealArray | None:
    """Return R with R'R the Gram matrix; None where rounding leaves it no such factor."""
    try:
        return np.asarray(np.linalg.cholesky(gram).T)
    except np.linalg.LinAlgError:
        return None


def scaled_span(columns: RealArray) -> RealArray:
    """Return an orthonormal basis of what columns span, each brought to length one first, with one copy of long columns beside it.

    Parameters
    ----------
    columns : array, (K, k)
    """
    size = np.sqrt(np.einsum("kj,kj->j", columns, columns))
    if not np.any(size > 0):
        return np.zeros((len(columns), 0))
    # LAPACK makes no copy of columns that lie one after the other
    scaled = columns.copy("F") if np.all(size > 0) else np.asfortranarray(columns[:, size > 0])
    scaled /= size[size > 0]
    U, s, _ = sla.svd(scaled, full_matrices=False, overwrite_a=True)
    return np.asarray(U[:, : np.count_nonzero(s > max(scaled.shape) * np.finfo(float).eps * s[0])])
