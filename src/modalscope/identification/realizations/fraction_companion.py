"""Realize models from the Gram blocks of a matrix fraction: controllable companion forms of every degree (LSCF)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.fraction import Fraction
from modalscope.identification.matrices.matrix import Eigen, Realization, Triple
from modalscope.identification.realizations.sensitivity import Sides, pairs, sides
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.errors import DataError


@dataclass(frozen=True, eq=False)
class ReciprocalTriple(Triple):
    """A controllable companion whose eigenvalues are mu = 1 / z and whose left eigenvectors are [mu^(p-1) w', ..., w']."""

    def eigen(self) -> Eigen:
        """Return the stable roots z and left eigenvectors; right ones are not needed, and zero.

        Unstable roots are what no mode explains (see `denominator`) and do not take part.
        """
        reciprocal, vectors = np.linalg.eig(self.A.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(reciprocal == 0, np.inf, 1 / reciprocal)
        stable = np.flatnonzero((np.abs(z) < 1) & (z != 0))
        left = vectors[:, stable].T.astype(complex)
        return Eigen(z[stable], np.zeros_like(left.T), left)


@dataclass(frozen=True, eq=False, kw_only=True)
class FractionCompanion(Realization):
    """Controllable companion form on Gram blocks: the order is the degree of the polynomial.

    The matrix has the roots' inverses mu = 1 / z as eigenvalues, from mu^p w' = - sum_j mu^(p-j) w' A_j, and the rows
    [mu^(p-1) w', ..., w'] as left eigenvectors: their last m entries are the participation w'.
    Shapes and residuals come from least squares over the lines.
    """

    matrix: Fraction

    def triple(self, n: int) -> ReciprocalTriple:
        """Return the companion of degree n."""
        if not 1 <= n <= self.matrix.degree:
            raise DataError(
                f"order={n} of a matrix fraction:",
                f"its order is the degree of the polynomials, here 1 to {self.matrix.degree}",
                "Ask for a larger order when the fraction is built.",
            )
        m = self.matrix.inputs
        size = n * m
        A = np.zeros((size, size))
        A[:, :m] = -self.matrix.denominator(n)
        A[: size - m, m:] = np.eye(size - m)
        return ReciprocalTriple(A, None, np.zeros((0, size)), size)


def fraction_companion(matrix: Fraction, factors: Factors) -> FractionCompanion:
    """Return the companion forms of every degree.

    `factors`: of the normal equations: for the singular values, the companion needs the Gram blocks alone.
    """
    return FractionCompanion(factors=factors, matrix=matrix)


@sides.register
def _(realization: FractionCompanion, n: int, eigen: Eigen) -> Sides:
    """Y z^2 / (y x) and r, the first block of the right eigenvector x: dmu = -y dA r / (y x), z = 1 / mu.

    r spans the null space of I + sum_j z^j A_j; the other blocks follow from the last, x_i = z (x_(i+1) - A_i r).
    """
    m, z = realization.matrix.inputs, eigen.values
    A = realization.matrix.denominator(n).reshape(n, m, m)
    powers = z[:, None] ** np.arange(1, n + 1)
    polynomial = np.eye(m) + np.einsum("kj,jab->kab", powers, A, optimize=True)
    r = np.linalg.svd(polynomial)[2][:, -1].conj()  # (k, m)
    x = np.empty((z.size, n, m), dtype=complex)
    following = np.zeros((z.size, m), dtype=complex)
    for i in range(n - 1, -1, -1):
        following = z[:, None] * (following - r @ A[i].T)
        x[:, i] = following
    scale = z**2 / np.sum(eigen.left * x.reshape(z.size, -1), axis=1)
    return Sides(scale[:, None] * eigen.left, r.T)


@pairs.register
def _(realization: FractionCompanion, found: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
    """Both as they are, of one order."""
    return (found,)
