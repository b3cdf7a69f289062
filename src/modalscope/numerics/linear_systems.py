"""Sample and evaluate linear systems given by their matrices A, B, C, D."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.errors import DataError


def state_scale(A: RealArray) -> RealArray:
    """Return the powers of two s, (n,), for which rows and columns of A s_j / s_i have like norms (LAPACK's balancing)."""
    if not A.size:
        return np.ones(0)
    _, (scale, _) = sla.matrix_balance(A, permute=False, separate=True)
    return np.asarray(scale, dtype=float)


def scaled(A: RealArray, scale: RealArray) -> RealArray:
    """Return A in the states x_i / s_i: A s_j / s_i."""
    return A * scale / scale[:, None]


def sampled(A: RealArray, B: RealArray, dt: float, *, held: bool) -> tuple[RealArray, RealArray]:
    """Return exp(A dt), and B itself or, for a held input, the integral of exp(A t) B over one step (Eq. 8).

    exp([[A, B], [0, 0]] dt) = [[exp(A dt), integral exp(A t) B], [0, I]] holds for singular A, too.
    """
    n, m = B.shape
    scale, whole = state_scale(A), A
    if held:
        scale, whole = np.append(scale, np.ones(m)), np.block([[A, B], [np.zeros((m, n + m))]])
    step = scaled(sla.expm(scaled(whole, scale) * dt), 1 / scale)
    return step[:n, :n], step[:n, n:] if held else B


def markov_parameters(A: RealArray, B: RealArray, C: RealArray, samples: int) -> RealArray:
    """Return Y(k) = C A^k B, k = 0 ... samples - 1, (samples, l, m)."""
    states, state = np.empty((samples, B.shape[1], len(A))), np.array(B)
    for k in range(samples):
        states[k] = state.T
        state = A @ state
    # one product for all samples: outputs are many beside inputs
    values = states.reshape(-1, len(A)) @ C.T
    return np.ascontiguousarray(values.reshape(samples, B.shape[1], len(C)).transpose(0, 2, 1))


#: Complex numbers that a sum over many lines may hold at once, 64 MB.
HELD = 4_000_000


def transfer(A: RealArray, B: RealArray, C: RealArray, D: RealArray, points: ComplexArray) -> ComplexArray:
    """Return D + C (x I - A)^-1 B at every point, (points, l, m): one Schur form A = Z S Z*, then back substitution (Eq. 75).

    Raises `DataError`: A point that is a pole.
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
            raise DataError("the response at a pole:", "it is infinite", "Leave that frequency out.")
        solution = np.empty((n, x.size, m), dtype=complex)
        for i in range(n - 1, -1, -1):
            above = np.tensordot(S[i, i + 1 :], solution[i + 1 :], axes=1)
            solution[i] = (right[i] + above) / (x - poles[i])[:, None]
        values[first : first + step] = np.moveaxis(np.tensordot(left, solution, axes=1), 0, 1)
    return np.asarray(values + D)
