"""Compute the exact modes of M q'' + D q' + K q = f."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sla

from modalscope.data.modes import ModalModel
from modalscope.numerics.arguments import plainly
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import QUANTITIES, one_of_each_pair

#: Coupling of modes through damping below this fraction of the largest entry is rounding of the matrices' entries.
_UNCOUPLED = 1e-12

#: Eigenvectors of a condition above this have lost half of the digits: a pole lacks an eigenvector.
_DEFECTIVE = 1e8

#: Poles, shapes (n, modes) and participation (modes, n) on all degrees of freedom, and the shapes of rigid motions (n, k).
_Modes = tuple[ComplexArray, ComplexArray, ComplexArray, RealArray]


def undamped_modes(M: RealArray, K: RealArray) -> tuple[RealArray, RealArray]:
    """Return w (rad/s) and Phi of K Phi = M Phi diag(w^2), Phi' M Phi = I; the w of a rigid motion is exactly 0."""
    squares, Phi = sla.eigh(K, M)
    noise = M.shape[0] * np.finfo(float).eps * np.abs(squares).max()
    if squares[0] < -100 * noise:
        raise DataError(
            "vibration modes need a stiffness matrix without negative eigenvalues",
            "this one has some",
            "Correct K: the structure is unstable.",
        )
    return np.sqrt(np.where(squares <= 100 * noise, 0, squares)), Phi


@plainly
def modal_damping(M: RealArray, K: RealArray, ratios: Array | float) -> RealArray:
    """Return the damping matrix M Phi diag(2 zeta w) Phi' M that gives the modes, by rising frequency, these ratios.

    Parameters
    ----------
    M, K : array, (n, n)
        Mass and stiffness, kg and N/m.
    ratios : float or array, (n,)
        Damping ratios; one for all modes, or one each.

    Raises
    ------
    DataError
        Neither one ratio nor one per mode.
    """
    w, Phi = undamped_modes(M, K)
    if np.shape(ratios) not in ((), w.shape):
        raise DataError(
            f"damping ratios of {w.size} modes:",
            f"their shape is {np.shape(ratios)}",
            "Give one for all modes, or one per mode.",
        )
    carried = M @ Phi
    return np.asarray((carried * (2 * np.broadcast_to(ratios, w.shape) * w)) @ carried.T)


def modal_model(
    M: RealArray, D: RealArray, K: RealArray, rows: list[int], columns: list[int], quantity: str, labels: dict[str, Any]
) -> ModalModel:
    """Return the modes seen by the outputs `rows` and the inputs `columns`.

    A displacement has the residues phi phi' / (2 j w_d) for shapes of unit modal mass, a velocity s times and an
    acceleration s^2 times them, the latter with the direct term C M^-1 B_f.
    """
    poles, shapes, part, rigid = _uncoupled(M, D, K) or _coupled(M, D, K)
    order = one_of_each_pair(poles)
    poles, shapes, part = poles[order], shapes[:, order], part[order]
    power = QUANTITIES[quantity]
    direct = np.asarray(np.linalg.inv(M)[np.ix_(rows, columns)], dtype=float) if power == 2 else None
    # an acceleration of the rigid body is a constant over frequency and already in the direct term
    drift = rigid[rows] @ rigid[columns].T if rigid.size and power < 2 else None
    return ModalModel(
        poles=poles,
        shapes=shapes[rows],
        participation=part[:, columns] * (poles**power)[:, None],
        feedthrough=direct,
        lower_residual=drift,
        quantity=quantity,
        scaling="unit modal mass",
        **labels,
    )


def _uncoupled(M: RealArray, D: RealArray, K: RealArray) -> _Modes | None:
    """Return modes whose shapes diagonalise D too (classical damping), or None; repeated frequencies are exact here."""
    w, Phi = undamped_modes(M, K)
    tolerance = 100 * M.shape[0] * np.finfo(float).eps * w[-1] ** 2
    starts = np.flatnonzero(np.r_[True, np.diff(w**2) > tolerance])
    for first, last in zip(starts, np.r_[starts[1:], w.size], strict=True):
        block = Phi[:, first:last]  # any basis will do for M and K: take the one that diagonalises D
        Phi[:, first:last] = block @ np.linalg.eigh(block.T @ D @ block)[1]
    damping = Phi.T @ D @ Phi
    rates = np.diag(damping) / 2
    if np.abs(damping - np.diag(2 * rates)).max() > _UNCOUPLED * np.abs(damping).max():
        return None
    is_rigid = (w == 0) & (np.abs(rates) <= _UNCOUPLED * max(w[-1], np.abs(rates).max()))
    poles, shapes, part = [], [], []
    for shape, frequency, rate in zip(Phi.T[~is_rigid], w[~is_rigid], rates[~is_rigid], strict=True):
        root = np.sqrt(complex(rate**2 - frequency**2))
        if abs(root) <= _UNCOUPLED * frequency:
            raise _critical()
        # the smaller real root by the product of both, or it would lose its digits to cancellation
        far = -rate - root if root.imag == 0 and rate > 0 else -rate + root
        near = frequency**2 / far
        poles += [far, near]
        shapes += [shape, shape]
        part += [shape / (far - near), shape / (near - far)]
    size = (-1, M.shape[0])
    stacked = np.array(shapes, dtype=complex).reshape(size).T
    return np.array(poles, dtype=complex), stacked, np.array(part, dtype=complex).reshape(size), Phi[:, is_rigid]


def _coupled(M: RealArray, D: RealArray, K: RealArray) -> _Modes:
    """Return the complex modes of the quadratic eigenvalue problem, shapes scaled to phi'(2 s M + D) phi = 2 j w_d."""
    n = M.shape[0]
    factor = sla.cho_factor(M)
    poles, X = np.linalg.eig(np.vstack([np.eye(n, 2 * n, n), -sla.cho_solve(factor, np.hstack([K, D]))]))
    if np.linalg.cond(X) > _DEFECTIVE:
        raise _critical()
    shapes = X[:n].astype(complex)
    products = np.einsum("ij,ij->j", shapes, M @ shapes * (2 * poles) + D @ shapes)
    real = poles.imag == 0
    scale = np.where(real, 1 / np.linalg.norm(shapes, axis=0), np.sqrt(2j * poles.imag / products))
    largest = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(2 * n)] * scale
    X = np.asarray(X * np.where(largest.real < 0, -scale, scale), dtype=complex)
    # from the inverse, not from phi again: repeated poles need shapes orthogonal to each other, which X need not hold
    part = sla.cho_solve(factor, np.linalg.inv(X)[:, n:].T).T
    return np.asarray(poles, dtype=complex), X[:n], np.asarray(part, dtype=complex), np.zeros((n, 0))


def _critical() -> DataError:
    return DataError(
        "the modes of the structure:",
        "a pole is repeated without an eigenvector of its own (critical damping, or a rigid motion with coupled damping)",
        "Use state_space() and its modal_form(), or change the damping a little.",
    )
