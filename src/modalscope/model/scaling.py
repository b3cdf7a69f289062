"""Units of the states: positions and velocities differ by orders of magnitude, and rounding should not see it."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray

__all__ = ["scaled", "state_scale"]


def state_scale(A: RealArray) -> RealArray:
    """Return the powers of two s, (n,), for which rows and columns of A s_j / s_i have like norms (LAPACK's balancing)."""
    if not A.size:
        return np.ones(0)
    _, (scale, _) = sla.matrix_balance(A, permute=False, separate=True)
    return np.asarray(scale, dtype=float)


def scaled(A: RealArray, scale: RealArray) -> RealArray:
    """Return A in the states x_i / s_i: A s_j / s_i."""
    return A * scale / scale[:, None]
