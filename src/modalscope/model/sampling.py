"""Exact sampling of x' = A x + B u and its inverse (Eqs. 5-8)."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import DataError, RealArray
from modalscope.model.modal_form import block_diagonal_basis
from modalscope.model.poles import is_real
from modalscope.model.scaling import scaled, state_scale

__all__ = ["continuous", "sampled"]


def sampled(A: RealArray, B: RealArray, dt: float, *, held: bool) -> tuple[RealArray, RealArray]:
    """Return exp(A dt), and B itself or, for a held input, the integral of exp(A t) B over one step (Eq. 8).

    exp([[A, B], [0, 0]] dt) = [[exp(A dt), integral exp(A t) B], [0, I]] holds for singular A, too.
    """
    n, m = B.shape
    whole = np.block([[A, B], [np.zeros((m, n + m))]]) if held else A
    scale = state_scale(A)
    if held:
        scale = np.append(scale, np.full(m, 1.0))
    step = scaled(sla.expm(scaled(whole, scale) * dt), 1 / scale)
    return step[:n, :n], step[:n, n:] if held else B


def continuous(A: RealArray, B: RealArray, dt: float, *, held: bool) -> tuple[RealArray, RealArray]:
    """Return the continuous A and B whose exact sampling is given; the logarithm is that of the modal form's blocks."""
    z = np.asarray(np.linalg.eigvals(A), dtype=complex)
    bad = is_real(z) & (z.real <= 0)
    if bad.any():
        few = ", ".join(f"{v:.3g}" for v in z[bad].real[:4])
        raise DataError(
            "a real continuous model was asked",
            f"{int(bad.sum())} poles of the sampled one lie on the real axis at or below zero ({few})",
            "Lower the order, or remove those states first: their poles are at the Nyquist frequency and carry no mode.",
        )
    T, M, blocks, _ = block_diagonal_basis(A, np.abs(np.log(z)))
    for block in blocks:
        M[block.states, block.states] = _logarithm(M[block.states, block.states], block.separate) / dt
    rates = np.asarray(np.linalg.solve(T.T, (T @ M).T).T, dtype=float)
    if not held:
        return rates, B
    step = sampled(rates, np.eye(len(A)), dt, held=True)[1]
    return rates, np.asarray(np.linalg.solve(step, B), dtype=float)


def _logarithm(block: RealArray, separate: bool) -> RealArray:
    """Return the logarithm of a block of the modal form: of its eigenvalue, or of the matrix where poles share it."""
    if not separate:
        return np.asarray(np.real(sla.logm(block)))
    if block.shape == (1, 1):
        return np.log(block)
    s = np.log(complex(block[0, 0], block[0, 1]))
    return np.array([[s.real, s.imag], [-s.imag, s.real]])
