"""Least squares with free residues in every channel, each line with its own weight, and what correlated errors leave open of them.

With columns X of a channel, its covariance C = D T D of errors, D their deviations and T what they have in common: residues
a = (X' D^-2 X)^-1 X' D^-2 y have the covariance B = M^-1 X' D^-1 T D^-1 X M^-1 / 2 with M = X' D^-2 X.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from modalscope.judging.coloured_errors import ColouredErrors
from modalscope.model.checks import Array, RealArray

__all__ = ["ChannelFits"]

#: Numbers in the matrices M of channels that are held, and in columns of channels that are made at a time.
_HELD, _TOGETHER = 1 << 23, 1 << 21

#: Columns of length one that stand so far out of the span of those before them have an inverse by Cholesky's factor.
_WELL_APART = 1e-5


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
        self._columns, self._first, self._errors = np.hstack([terms, functions]), terms.shape[1], errors
        self._data = data.reshape(len(data), -1)
        self._weights = np.tile(1 / errors.variance.reshape(-1, self._data.shape[1]), (2, 1))
        self._known: dict[int, tuple[RealArray, RealArray]] = {}

    def residues(
        self, which: Array, without: Array | None = None, beside: RealArray | None = None
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
        """
        columns = self._columns if beside is None else np.hstack([self._columns, beside])
        own = (self._first + 2 * np.asarray(which)[:, None] + [0, 1]).ravel()
        channels, pairs = self._data.shape[1], (len(which), 2)
        a, B = np.empty((channels, *pairs)), np.empty((channels, *pairs, 2))
        step = max(_TOGETHER // (len(columns) * max(own.size, 1)), 1)
        for some in (slice(first, first + step) for first in range(0, channels, step)):
            weights = self._weights[:, some].T.copy()
            if without is not None:
                weights[:, np.append(without, without + len(columns) // 2)] = 0
            # rows are those of a symmetric matrix
            back = np.array([self._inverse(c, without, beside)[own] for c in range(channels)[some]])
            from_errors = (back.reshape(-1, columns.shape[1]) @ columns.T).reshape(len(back), own.size, -1)
            from_errors *= np.sqrt(weights)[:, None]
            target = self._data[:, some].T * np.sqrt(weights)
            a[some] = np.einsum("cik,ck->ci", from_errors, target).reshape(-1, *pairs)
            real, imag = np.split(from_errors, 2, axis=2)
            B[some] = self._errors.covariances(some, (real + 1j * imag).reshape(-1, *pairs, real.shape[2])) / 2
        return a, B

    def _inverse(self, channel: int, without: Array | None, beside: RealArray | None) -> RealArray:
        """Return M^-1 of a channel; with more columns from the one without, by Schur's complement."""
        M, known = self._normal(channel)
        if without is not None:
            left_out = self._weighted(self._columns, channel, np.append(without, without + len(self._columns) // 2))
            return _inverse(M - left_out.T @ left_out)
        if beside is None:
            return known
        E = self._weights[:, [channel]] * beside
        across = self._columns.T @ E
        explained = known @ across
        own = _inverse(beside.T @ E - across.T @ explained)
        told = explained @ own
        return np.block([[known + told @ explained.T, -told], [-told.T, own]])

    def _normal(self, channel: int) -> tuple[RealArray, RealArray]:
        """Return M and M^-1 of a channel, held while they are few numbers."""
        found = self._known.get(channel)
        if found is None:
            Z = self._weighted(self._columns, channel)
            M = Z.T @ Z
            found = M, _inverse(M)
            if (len(self._known) + 1) * M.size <= _HELD:
                self._known[channel] = found
        return found

    def _weighted(self, columns: RealArray, channel: int, rows: Array | slice = slice(None)) -> RealArray:
        return np.asarray(columns[rows] * np.sqrt(self._weights[rows, channel])[:, None])


def _inverse(M: RealArray) -> RealArray:
    """Return the inverse, columns brought to one level first; where they lie near each other's span, of what stands out of rounding."""
    size = np.sqrt(np.maximum(np.diag(M), 1e-300))
    scale = np.outer(size, size)
    even = M / scale
    L, failed = dpotrf(even, lower=True)
    if not failed and np.diag(L).min() > _WELL_APART:
        root = dtrtri(L, lower=True)[0]
        return np.asarray(root.T @ root / scale)
    return np.asarray(np.linalg.pinv(even, hermitian=True) / scale)
