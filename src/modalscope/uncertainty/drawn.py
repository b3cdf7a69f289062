"""Noise drawn at random for replicates: with the correlation of lines under a window, or with the spectrum of what a model leaves."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, ComplexArray

__all__ = ["coloured", "correlated"]

#: Neighbours on either side whose spectrum stands for that of a line.
_NEAR = 20


def correlated(shape: tuple[int, ...], correlation: Array, rng: np.random.Generator) -> ComplexArray:
    """Return circular noise of variance one on lines that correlate as given, by circulant embedding.

    Parameters
    ----------
    shape : (int, int, int)
        Lines, outputs and inputs.
    correlation : array of complex, (F,)
        Of one line with that k lines below it.
    rng : numpy Generator

    Notes
    -----
    C. R. Dietrich and G. N. Newsam, SIAM J. Sci. Comput. 18 (1997) 1088-1107.
    """
    weights = np.maximum(np.fft.fft(np.concatenate([correlation, [0], correlation[:0:-1].conj()])).real, 0)
    long = (weights.size, *shape[1:])
    drawn = np.sqrt(weights / 2)[:, None, None] * (rng.standard_normal(long) + 1j * rng.standard_normal(long))
    return np.asarray(np.fft.ifft(drawn, axis=0)[: shape[0]] * np.sqrt(weights.size))


def coloured(left: Array, rng: np.random.Generator) -> ComplexArray:
    """Return circular noise whose covariance on every line is that of the neighbouring lines of a residual.

    n(f) = sum_j g_j e(f + j) / sqrt(2 k + 1), g_j normal and new for every line: channels keep what they have in common.

    Parameters
    ----------
    left : array of complex, (F, l, m)
        e.
    rng : numpy Generator
    """
    count = len(left)
    total = np.zeros(left.shape, dtype=complex)
    for j in range(-_NEAR, _NEAR + 1):
        weights = (rng.standard_normal(count) + 1j * rng.standard_normal(count)) / np.sqrt(2 * (2 * _NEAR + 1))
        index = np.abs(np.arange(count) + j)
        index = np.minimum(np.where(index >= count, 2 * (count - 1) - index, index), count - 1)
        total += weights[:, None, None] * left[np.maximum(index, 0)]
    return total
