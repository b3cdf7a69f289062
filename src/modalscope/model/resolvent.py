"""Transfer functions D + C (x I - A)^-1 B at many points."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import ComplexArray, DataError, RealArray
from modalscope.model.scaling import scaled, state_scale

__all__ = ["HELD", "transfer"]

#: Complex numbers that a sum over many lines may hold at once, 64 MB.
HELD = 4_000_000


def transfer(A: RealArray, B: RealArray, C: RealArray, D: RealArray, points: ComplexArray) -> ComplexArray:
    """Return D + C (x I - A)^-1 B at every point, (points, l, m): one Schur form A = Z S Z*, then back substitution (Eq. 75).

    Raises
    ------
    DataError
        A point that is a pole.
    """
    n, m = B.shape
    scale = state_scale(A)
    S, Z = sla.schur(scaled(A, scale), output="complex")
    right, left, poles = Z.conj().T @ (B / scale[:, None]), (C * scale) @ Z, np.diag(S)
    values = np.empty((points.size, C.shape[0], m), dtype=complex)
    step = max(1, HELD // max(1, n * m))
    for first in range(0, points.size, step):
        x = points[first : first + step]
        if np.any(x[:, None] == poles):
            raise DataError(
                "a transfer function was asked at a pole of the model",
                "it is infinite there",
                "Leave that frequency out.",
            )
        solution = np.empty((n, x.size, m), dtype=complex)
        for i in range(n - 1, -1, -1):
            above = np.tensordot(S[i, i + 1 :], solution[i + 1 :], axes=1)
            solution[i] = (right[i] + above) / (x - poles[i])[:, None]
        values[first : first + step] = np.moveaxis(np.tensordot(left, solution, axes=1), 0, 1)
    return np.asarray(values + D)
