"""Balance, sample and evaluate linear systems given by their matrices A, B, C, D.

Observability of (A, C) is controllability of (A', C').
"""

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


def gramian_factor(A: RealArray, B: RealArray, sampled: bool) -> RealArray:
    """Return L, (n, n), with L L' the Gramian over all time of a stable model.

    By Smith's doubling, L <- [L, A^(2^k) L] compressed by QR: the factor is found without squaring it, so that small
    Hankel singular values keep their digits. A continuous model is first mapped to a sampled one of the same Gramian.

    Raises `DataError`: A pole that does not decay.
    """
    values = np.linalg.eigvals(A)
    growing = np.abs(values) >= 1 if sampled else values.real >= 0
    if growing.any():
        raise DataError(
            "a Gramian over all time needs poles that decay",
            f"{int(growing.sum())} poles do not decay",
            "Leave those states out first.",
        )
    n, scale = A.shape[0], state_scale(A)
    A, B = scaled(A, scale), B / scale[:, None]
    if not sampled:
        # Cayley's map at the geometric mean of the poles' moduli keeps fast and slow ones alike away from the unit circle
        shift = float(np.exp(np.mean(np.log(np.abs(values))))) if n else 1.0
        inverse = np.linalg.inv(shift * np.eye(n) - A)
        A, B = inverse @ (shift * np.eye(n) + A), np.sqrt(2 * shift) * inverse @ B
    L, power = _compressed(B), A
    while np.linalg.norm(power) > np.finfo(float).eps:
        L = _compressed(np.hstack([L, power @ L]))
        power = power @ power
    return np.hstack([L, np.zeros((n, n - L.shape[1]))]) * scale[:, None]


def _compressed(L: RealArray) -> RealArray:
    """Return at most n columns with the same L L'."""
    triangle: RealArray = np.linalg.qr(L.T)[1]
    return triangle.T


def balancing(A: RealArray, B: RealArray, C: RealArray, sampled: bool) -> tuple[RealArray, RealArray, RealArray]:
    """Return T (n, k) of balanced coordinates x = T z, its left inverse (k, n) and all Hankel singular values.

    With L L' the Gramian of (A, B), M M' that of (A', C') and M' L = U S V': T = L V S^-1/2 and T^-1 = S^-1/2 U' M'. The k
    states with a singular value above n eps times the first are kept; the others are not observable or not controllable.
    """
    L, M = gramian_factor(A, B, sampled), gramian_factor(A.T, C.T, sampled)
    U, s, Vt = np.linalg.svd(M.T @ L)
    k = int(np.count_nonzero(s > s.size * np.finfo(float).eps * s[0])) if s.size and s[0] > 0 else 0
    root = np.sqrt(s[:k])
    return L @ Vt[:k].T / root, (U[:, :k] / root).T @ M.T, s


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
            raise DataError(
                "a transfer function at a pole was asked", "it is infinite there", "Leave that frequency out."
            )
        solution = np.empty((n, x.size, m), dtype=complex)
        for i in range(n - 1, -1, -1):
            above = np.tensordot(S[i, i + 1 :], solution[i + 1 :], axes=1)
            solution[i] = (right[i] + above) / (x - poles[i])[:, None]
        values[first : first + step] = np.moveaxis(np.tensordot(left, solution, axes=1), 0, 1)
    return np.asarray(values + D)
