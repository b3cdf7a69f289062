"""From M, D, K to a state-space model and to frequency responses (Eqs. 1-4)."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.channels import QUANTITIES
from modalscope.model.checks import ComplexArray, DataError, RealArray
from modalscope.model.statespace import StateSpace

__all__ = ["dynamic_response", "state_model"]


def state_model(
    M: RealArray, D: RealArray, K: RealArray, rows: list[int], columns: list[int], quantity: str
) -> StateSpace:
    """Return x' = [[0, I], [-M^-1 K, -M^-1 D]] x + [0; M^-1 B_f] u with outputs `rows` of the quantity (Eqs. 2-4)."""
    n = M.shape[0]
    moved = sla.cho_solve(sla.cho_factor(M), np.hstack([K, D, np.eye(n)[:, columns]]))
    lower, force = -moved[:, : 2 * n], moved[:, 2 * n :]
    C = {"displacement": np.eye(n, 2 * n), "velocity": np.eye(n, 2 * n, n), "acceleration": lower}[quantity][rows]
    direct = force[rows] if quantity == "acceleration" else np.zeros((len(rows), len(columns)))
    A = np.vstack([np.eye(n, 2 * n, n), lower])
    return StateSpace(A=A, B=np.vstack([np.zeros_like(force), force]), C=C, D=direct)


def dynamic_response(
    M: RealArray, D: RealArray, K: RealArray, rows: list[int], columns: list[int], quantity: str, lines: RealArray
) -> ComplexArray:
    """Return s^p (s^2 M + s D + K)^-1 at s = 2 pi j f as (lines, rows, columns), p = 0, 1, 2 by the quantity."""
    values = np.empty((lines.size, len(rows), len(columns)), dtype=complex)
    force = np.eye(M.shape[0])[:, columns]
    for k, s in enumerate(2j * np.pi * lines):
        try:
            motion = np.linalg.solve(K + s * (D + s * M), force)
        except np.linalg.LinAlgError:
            raise DataError(
                f"the frequency response at {lines[k]:g} Hz was asked",
                "the structure has an undamped pole there",
                "Leave that line out, or give damping or supports.",
            ) from None
        values[k] = s ** QUANTITIES[quantity] * motion[rows]
    return values
