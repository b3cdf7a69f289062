"""Least squares with free residues in every channel, each line with its own weight, and what correlated errors leave open of them.

With columns X of a channel, its covariance C = D T D of errors, D their deviations and T what they have in common: residues
a = (X' D^-2 X)^-1 X' D^-2 y have the covariance B = M^-1 X' D^-1 T D^-1 X M^-1 / 2 with M = X' D^-2 X.

Channels differ by their weights alone, so that the M of all of them are one product of weights with products of columns, line by line.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from modalscope.judging.coloured_errors import ColouredErrors
from modalscope.model.checks import Array, RealArray

__all__ = ["ChannelFits"]

#: Numbers in the matrices M of channels that are held, and in columns of channels that are made at a time.
_HELD, _TOGETHER = 1 << 23, 1 << 18

#: Columns of length one that stand so far out of the span of those before them have an inverse by Cholesky's factor.
_WELL_APART = 1e-5

#: Squares of columns below this part of the largest are those of rounding.
_NOTHING = float(np.finfo(float).eps) ** 2


class ChannelFits:
    """Fits of poles and terms to all channels.

    Parameters
    ----------
    terms : array, (K, t)
    functions : array, (K, 2 n)
        Of poles.
    data : array, (K, q, p)
    errors : ColouredErrors
    """

    def __init__(self, terms: RealArray, functions: RealArray, data: RealArray, errors: ColouredErrors) -> None:
        self._columns, self._first = np.vstack([terms.T, functions.T]), terms.shape[1]
        self._data, self._errors = data.reshape(len(data), -1), errors
        self._weights = 1 / errors.variance.reshape(-1, self._data.shape[1])
        self._known: tuple[RealArray, RealArray] | None = None

    def residues(
        self, which: Array, without: Array | None = None, beside: RealArray | None = None, told: int | None = None
    ) -> tuple[RealArray, RealArray]:
        """Return residues a (c, k, 2) of modes in all channels, and their covariances B (c, k, 2, 2).

        Parameters
        ----------
        which : array of int, (k,)
            Modes.
        without : array of int, optional
            Lines that do not count.
        beside : array, (K, 2 b), optional
            More columns in pairs, which count as modes behind those that there are.
        told : int, optional
            How many of the modes, from the first on, have a covariance; by default all.
        """
        columns = self._columns if beside is None else np.vstack([self._columns, beside.T])
        own = (self._first + 2 * np.asarray(which)[:, None] + [0, 1]).ravel()
        told = len(which) if told is None else told
        channels, weights = self._data.shape[1], self._weights
        if without is not None:
            weights = weights.copy()
            weights[without] = 0
        a, B = np.empty((channels, len(which), 2)), np.empty((channels, told, 2, 2))
        parts = _side_by_side(columns)
        weighted = (weights * self._data.reshape(-1, *weights.shape)).reshape(self._data.shape)
        step = max(_TOGETHER // (columns.shape[1] * max(2 * told, 1)), 1)
        for some in (slice(first, first + step) for first in range(0, channels, step)):
            # rows are those of a symmetric matrix
            back = self._inverses(some, without, beside)[:, own]
            a[some] = np.einsum("cik,kc->ci", back, columns @ weighted[:, some]).reshape(-1, len(which), 2)
            rows = (back[:, : 2 * told].reshape(-1, len(columns)) @ parts).view(np.complex128)
            if without is not None:
                rows[:, without] = 0
            B[some] = self._errors.covariances(some, rows.reshape(len(back), told, 2, -1)) / 2
        return a, B

    def _inverses(self, some: slice, without: Array | None, beside: RealArray | None) -> RealArray:
        """Return M^-1 of channels; with more columns from those without, by Schur's complement."""
        M, known = self._normals(some)
        weights = self._weights[:, some]
        if without is not None:
            count = len(weights)
            left_out = self._columns[:, np.append(without, without + count)]
            return _inverses(M - _products(left_out, left_out, weights[without]))
        if beside is None:
            return known
        more = beside.T
        across = _products(self._columns, more, weights)
        explained = known @ across
        own = _inverses(_products(more, more, weights) - across.transpose(0, 2, 1) @ explained)
        shared = explained @ own
        upper = np.concatenate([known + shared @ explained.transpose(0, 2, 1), -shared], axis=2)
        return np.concatenate([upper, np.concatenate([-shared.transpose(0, 2, 1), own], axis=2)], axis=1)

    def _normals(self, some: slice) -> tuple[RealArray, RealArray]:
        """Return M and M^-1 of channels, those of all held while they are few numbers."""
        whole = self._data.shape[1] * len(self._columns) ** 2 <= _HELD
        if not whole or self._known is None:
            M = _products(self._columns, self._columns, self._weights if whole else self._weights[:, some])
            found = M, _inverses(M)
            if not whole:
                return found
            self._known = found
        return self._known[0][some], self._known[1][some]


def _side_by_side(columns: RealArray) -> RealArray:
    """Return columns (k, 2 F) with the real and the imaginary part of every line side by side."""
    return np.ascontiguousarray(columns.reshape(len(columns), 2, -1).transpose(0, 2, 1)).reshape(columns.shape)


def _products(left: RealArray, right: RealArray, weights: RealArray) -> RealArray:
    """Return the products of columns (k, K) and (b, K) under weights (F, c) of lines, real parts above imaginary ones, (c, k, b)."""
    lines, same = len(weights), left is right
    found = np.empty((weights.shape[1], len(left), len(right)))
    (x, x_imag), (y, y_imag) = ((each[:, :lines], each[:, lines:]) for each in (left, right))
    for j in range(len(right)):
        first = j if same else 0
        line_by_line = x[first:] * y[j] + x_imag[first:] * y_imag[j]
        found[:, first:, j] = (line_by_line @ weights).T
        if same:
            found[:, j, j:] = found[:, j:, j]
    return found


def _inverses(M: RealArray) -> RealArray:
    return np.array([_inverse(each) for each in M]).reshape(M.shape)


def _inverse(M: RealArray) -> RealArray:
    """Return the inverse, columns brought to one level first; where they lie near each other's span, of what stands out of rounding.

    Columns that are nothing but rounding are left at zero: one function of a pole on the real axis has no length.
    """
    square = np.diag(M)
    size = np.sqrt(np.where(square > _NOTHING * square.max(initial=0.0), square, np.inf))
    scale = np.outer(size, size)
    even = M / scale
    L, failed = dpotrf(even, lower=True)
    if not failed and np.diag(L).min() > _WELL_APART:
        root = dtrtri(L, lower=True)[0]
        return np.asarray(root.T @ root / scale)
    return np.asarray(np.linalg.pinv(even, hermitian=True) / scale)
