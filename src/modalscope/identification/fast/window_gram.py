"""Compute Gram matrices of all windows of a record by their structure."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import RealArray

#: Maximum condition of a Gram matrix for nine digits of its Cholesky factor; above it rows are orthogonalized.
_MAX_CONDITION = 1e7


def window_gram(run: RealArray, blocks: int) -> RealArray:
    """Return G[i, j] = sum_t y(t + i) y(t + j)', i, j < blocks, over all t such that a window lies inside, (blocks l) square.

    The first block row takes `blocks` products of the record with itself, the others an update each,
    G[i + 1, j + 1] = G[i, j] - y(i) y(j)' + y(T + i) y(T + j)', with T windows.

    `run` (N, l). `blocks`: samples in a window.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((40, 2))
    >>> windows = np.lib.stride_tricks.sliding_window_view(y, 3, axis=0).transpose(0, 2, 1).reshape(-1, 6)
    >>> bool(np.allclose(window_gram(y, 3), windows.T @ windows))
    True
    """
    samples, channels = run.shape
    count = samples - blocks + 1
    gram = np.zeros((blocks * channels, blocks * channels))
    for j in range(blocks):
        gram[:channels, j * channels : (j + 1) * channels] = run[:count].T @ run[j : j + count]
    first, behind = run[: blocks - 1].ravel(), run[count:].ravel()  # samples that leave, and that enter
    for i in range(blocks - 1):
        row, below = slice(i * channels, (i + 1) * channels), slice((i + 1) * channels, (i + 2) * channels)
        update = np.outer(behind[row], behind[i * channels :]) - np.outer(first[row], first[i * channels :])
        gram[below, (i + 1) * channels :] = gram[row, i * channels : -channels] + update
    return np.asarray(np.triu(gram) + np.triu(gram, 1).T)


def triangle_of(gram: RealArray) -> RealArray | None:
    """Return L with L L' = G, rows brought to one size first; None where the condition leaves too few digits."""
    size = np.sqrt(np.diag(gram))
    if not np.all(size > 0):
        return None
    level = gram / np.outer(size, size)
    try:
        L = sla.cholesky(level, lower=True, check_finite=False)
    except sla.LinAlgError:
        return None
    inverse, _ = sla.lapack.dpocon(L, np.linalg.norm(level, 1), uplo="L")
    return np.asarray(size[:, None] * L) if inverse * _MAX_CONDITION > 1 else None
