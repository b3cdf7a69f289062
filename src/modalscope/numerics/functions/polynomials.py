"""Polynomials orthogonal on the lines of a band (Vandermonde with Arnoldi), and the s- or z-plane of these lines.

Powers of j w are useless beyond degree five or so: their Gram matrix is singular to rounding. The basis here satisfies
x p_k = sum_j h_jk p_j with a real Hessenberg matrix h when the points come in conjugate pairs, and is orthonormal in the
weighted sum over the points and their conjugates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.functions.poles import to_continuous, to_discrete


def orthogonal_basis(
    points: ArrayLike, degree: int, weights: ArrayLike | None = None
) -> tuple[ComplexArray, RealArray]:
    """Return p_0 ... p_degree at the points and their recurrence.

    `points` (F,): points in the upper half of the plane; their conjugates are understood. `weights` (F,): positive weights w of the inner
    product sum w^2 Re(conj(p) q).

    Raises `DataError`: more polynomials than the points can carry.

    Returns
    -------
    basis : array of complex, (F, degree + 1)
        p_k at the points, without weights.
    recurrence : array, (degree + 1, degree)
        h with x p_k = sum_j h[j, k] p_j, real.

    Notes
    -----
    Brubeck, Nakatsukasa and Trefethen, Vandermonde with Arnoldi, SIAM Review 63 (2021).
    """
    x = np.asarray(points, dtype=complex)
    w = np.ones(x.size) if weights is None else np.asarray(weights, dtype=float)
    independent = 2 * np.unique(x).size
    if degree + 1 > independent:
        asked, have = f"polynomials to degree {degree}:", f"{np.unique(x).size} lines determine {independent}"
        raise DataError(asked, f"{have} of them", "Use more lines or fewer block rows.")
    rows, squares = np.zeros((degree + 1, 2 * x.size)), np.tile(w**2, 2)  # real parts before imaginary ones
    h = np.zeros((degree + 1, degree))
    rows[0, : x.size] = 1 / np.sqrt(np.sum(w**2))
    for k in range(degree):
        before = x * (rows[k, : x.size] + 1j * rows[k, x.size :])
        v = np.concatenate([before.real, before.imag])
        for _ in range(2):  # a second orthogonalization makes the basis orthogonal to rounding
            c = rows[: k + 1] @ (squares * v)
            h[: k + 1, k] += c
            v -= c @ rows[: k + 1]
        h[k + 1, k] = np.sqrt(np.sum(squares * v**2))
        rows[k + 1] = v / h[k + 1, k]
    basis = np.empty((x.size, degree + 1), dtype=complex)
    basis.real, basis.imag = rows[:, : x.size].T, rows[:, x.size :].T
    return basis, h


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

    `basis` (F, q + 1). `coefficients` (j, q + 1, o).
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


@dataclass(frozen=True)
class Plane:
    """The plane in which the polynomials live: where a line lies, and how poles go back to rad/s.

    `name`: in words. `point`: frequencies in Hz -> points x. `to_s`, `from_s`: poles of the realization -> rad/s, and back. `dt`:
    sampling interval when x = exp(j w dt). `scale`: s / x in the s-plane, 1 for the exponential, None for the bilinear map.
    `residue_scale`: poles in this plane -> residue of 1 / (x - x_j) for one of 1 / (s - s_j), or of the sampled system.
    `made`: the function and its arguments that make it again: functions within functions are not pickled.
    """

    name: str
    point: Callable[[RealArray], ComplexArray]
    to_s: Callable[[Array], ComplexArray]
    from_s: Callable[[Array], ComplexArray]
    dt: float | None = None
    scale: float | None = None
    residue_scale: Callable[[Array], ComplexArray] = np.ones_like
    made: tuple[Any, ...] = ()

    def __reduce__(self) -> tuple[Any, ...]:
        return self.made


def plane_of(domain: str, highest: float, rate: float | None) -> Plane:
    """Return the plane of a domain: s scaled to the band, z by the exponential for sampled responses, else the bilinear map.

    The bilinear map z = (1 + s T/2) / (1 - s T/2), T = 2 / w_max, is exact for continuous responses, the exponential is not.

    `highest`: frequency of the lines, Hz. `rate`: sampling rate of the system, Hz; None where it is continuous.
    """
    top = 2 * np.pi * highest
    if domain == "s":
        if rate is not None:
            fault = f"the response is that of a system sampled at {rate:g} Hz, not rational in j w"
            remedy = "Use domain='z', or omit sampling_rate if the response is that of the structure itself."
            raise DataError("domain='s':", fault, remedy)
        return _scaled(top or 1.0)
    return _bilinear(1 / (top or 1.0)) if rate is None else _exponential(1 / rate)


def _scaled(scale: float) -> Plane:
    """Return the plane of s / scale."""
    return Plane(
        f"s-plane, scaled by {scale / 2 / np.pi:g} Hz",
        lambda f: np.asarray(2j * np.pi * f / scale, dtype=complex),
        lambda x: np.asarray(np.asarray(x) * scale, dtype=complex),
        lambda s: np.asarray(np.asarray(s) / scale, dtype=complex),
        scale=scale,
        residue_scale=lambda x: np.full(np.shape(x), 1 / scale, dtype=complex),
        made=(_scaled, (scale,)),
    )


def _exponential(dt: float) -> Plane:
    """Return the plane of z = exp(s dt)."""
    return Plane(
        "z-plane, exponential",
        lambda f: np.exp(2j * np.pi * f * dt),
        lambda z: to_continuous(z, dt),
        lambda s: to_discrete(s, dt),
        dt,
        1.0,
        made=(_exponential, (dt,)),
    )


def _bilinear(half: float) -> Plane:
    """Return the plane of z = (1 + s T/2) / (1 - s T/2), with T/2 = `half`."""

    def into(s: Array) -> ComplexArray:
        return np.asarray((1 + np.asarray(s) * half) / (1 - np.asarray(s) * half), dtype=complex)

    def back(z: Array) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((np.asarray(z) - 1) / (np.asarray(z) + 1) / half, dtype=complex)

    def residue_scale(z: Array) -> ComplexArray:
        # 1 / (s - s_j) = constant + (T / 4) (1 + z_j)^2 / (z - z_j)
        return np.asarray(half / 2 * (1 + np.asarray(z)) ** 2, dtype=complex)

    return Plane(
        "z-plane, bilinear map",
        lambda f: into(2j * np.pi * f),
        back,
        into,
        residue_scale=residue_scale,
        made=(_bilinear, (half,)),
    )
