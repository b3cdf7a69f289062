"""The variance of noise by what a model leaves of the data."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray

__all__ = ["residual_variance"]


def residual_variance(left: Array, free: float, is_complex: bool) -> RealArray:
    """Return the variance E|noise|^2 (l, m) of noise by what a model leaves.

    NaN where there are no more values than unknowns.

    Parameters
    ----------
    left : array, (K, l, m)
        Real rows.
    free : float
        Real values of a channel less the real numbers that were fitted to it.
    is_complex : bool
        Whether the values are lines, of two real numbers each.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        energy = np.sum(left**2, axis=0)
    return np.asarray((1 + is_complex) * energy / free if free > 0 else np.full(energy.shape, np.nan))
