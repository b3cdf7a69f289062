"""Polynomials orthogonal on the lines of a band, built by the Arnoldi process (Vandermonde with Arnoldi).

Powers of j w are useless beyond degree five or so: their Gram matrix is singular to rounding. The basis here satisfies
x p_k = sum_j h_jk p_j with a real Hessenberg matrix h when the points come in conjugate pairs, and is orthonormal in the
weighted sum over the points and their conjugates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.checks import Array, ComplexArray, DataError, RealArray, check_choice

__all__ = ["basis_on", "both_sums", "evaluate", "following", "orthogonal_basis", "remainders"]


def orthogonal_basis(
    points: ArrayLike, degree: int, weights: ArrayLike | None = None
) -> tuple[ComplexArray, RealArray]:
    """Return p_0 ... p_degree at the points and their recurrence.

    Parameters
    ----------
    points : array of complex, (F,)
        Points in the upper half of the plane; their conjugates are understood.
    degree : int
    weights : array, (F,), optional
        Positive weights w of the inner product sum w^2 Re(conj(p) q).

    Returns
    -------
    basis : array of complex, (F, degree + 1)
        p_k at the points, without weights.
    recurrence : array, (degree + 1, degree)
        h with x p_k = sum_j h[j, k] p_j, real.

    Raises
    ------
    DataError
        More polynomials than the points can carry.

    Notes
    -----
    Brubeck, Nakatsukasa and Trefethen, Vandermonde with Arnoldi, SIAM Review 63 (2021).
    """
    x = np.asarray(points, dtype=complex)
    w = np.ones(x.size) if weights is None else np.asarray(weights, dtype=float)
    independent = 2 * np.unique(x).size
    if degree + 1 > independent:
        raise DataError(
            f"polynomials to degree {degree} were asked",
            f"{np.unique(x).size} lines carry {independent} of them",
            "Use more lines or fewer block rows.",
        )
    basis = np.zeros((x.size, degree + 1), dtype=complex)
    h = np.zeros((degree + 1, degree))
    basis[:, 0] = 1 / np.sqrt(np.sum(w**2))
    for k in range(degree):
        v, h[: k + 1, k] = following(basis[:, : k + 1], x, w)
        h[k + 1, k] = np.sqrt(np.sum(w**2 * np.abs(v) ** 2))
        basis[:, k + 1] = v / h[k + 1, k]
    return basis, h


def following(basis: ComplexArray, points: ComplexArray, weights: RealArray) -> tuple[ComplexArray, RealArray]:
    """Return x p_k less what p_0 ... p_k have of it, and that, (F,) and (k + 1,): h p_(k+1), of which h is the length."""
    v, w2 = points * basis[:, -1], weights**2
    taken = np.zeros(basis.shape[1])
    for _ in range(2):  # a second orthogonalization makes the basis orthogonal to rounding
        c = (basis.conj().T @ (w2 * v)).real
        taken += c
        v = v - basis @ c
    return v, taken


def evaluate(recurrence: Array, first: float, points: ArrayLike) -> ComplexArray:
    """Return p_0 ... p_q at any points (poles, say) by the recurrence, (q + 1, points); p_0 = `first`."""
    x = np.asarray(points, dtype=complex)
    degree = recurrence.shape[1]
    values = np.empty((degree + 1, x.size), dtype=complex)
    values[0] = first
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(degree):
            values[k + 1] = (x * values[k] - recurrence[: k + 1, k] @ values[: k + 1]) / recurrence[k + 1, k]
    return values


def both_sums(basis: ComplexArray, coefficients: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return sum_k c_k p_k and sum_k c_k p_k* at the points, each (j, F, o), by four real products for both.

    Parameters
    ----------
    basis : array of complex, (F, q + 1)
    coefficients : array of complex, (j, q + 1, o)
    """
    p, q = np.ascontiguousarray(basis.real), np.ascontiguousarray(basis.imag)
    c, d = np.ascontiguousarray(coefficients.real), np.ascontiguousarray(coefficients.imag)
    pc, qd, pd, qc = p @ c, q @ d, p @ d, q @ c
    return (pc - qd) + 1j * (pd + qc), (pc + qd) + 1j * (pd - qc)


def basis_on(
    points: ArrayLike, degree: int, weights: ArrayLike | None = None, kind: str = "orthogonal"
) -> tuple[ComplexArray, RealArray]:
    """Return a basis and its recurrence as `orthogonal_basis` does, or the plain powers, x p_k = p_(k+1), for comparison."""
    if check_choice("basis", kind, ("orthogonal", "powers")) == "orthogonal":
        return orthogonal_basis(points, degree, weights)
    x = np.asarray(points, dtype=complex)
    return np.asarray(x[:, None] ** np.arange(degree + 1), dtype=complex), np.eye(degree + 1, degree, -1)


def remainders(recurrence: RealArray, first: float, points: ArrayLike, count: int) -> ComplexArray:
    """Return the polynomial parts of p_k(x) / x^i, i = 0 ... count - 1, at the points: (count, points, q + 1).

    From sum_j h_jk [p_j / x^i] = x [p_k / x^i] + (constant of [p_k / x^(i-1)]): the coefficient of 1 / x of p_k / x^i
    becomes a constant when it is multiplied by x.
    """
    x = np.append(np.asarray(points, dtype=complex), 0)  # the constants are the values at x = 0
    degree = recurrence.shape[1]
    parts = np.zeros((count, x.size, degree + 1), dtype=complex)
    for i in range(count):
        parts[i, :, 0] = first if i == 0 else 0
        for k in range(degree):
            carried = 0 if i == 0 else parts[i - 1, -1, k]
            shifted = x * parts[i, :, k] + carried
            parts[i, :, k + 1] = (shifted - parts[i, :, : k + 1] @ recurrence[: k + 1, k]) / recurrence[k + 1, k]
    return parts[:, :-1]
