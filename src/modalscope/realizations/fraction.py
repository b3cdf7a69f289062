"""The matrix fraction's denominators as companion matrices: poles and participation of every degree (LSCF)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import Factors
from modalscope.blocks.fraction import Fraction
from modalscope.blocks.triple import Eigen, Triple
from modalscope.model.checks import DataError, RealArray
from modalscope.realizations.realization import Realization

__all__ = ["FractionCompanion", "ReciprocalTriple", "denominator", "fraction_companion"]


def denominator(matrix: Fraction, degree: int) -> RealArray:
    """Return A_1, ..., A_p stacked, (p m, m), for A_0 = I: the minimum of the quadratic form of M.

    With the lowest coefficient fixed, what no mode explains goes to roots outside the unit circle: unstable poles,
    told by their sign.
    """
    m = matrix.inputs
    M = matrix.gram_matrices[degree]
    inner, target = M[m:, m:], -M[m:, :m]
    try:
        return np.asarray(sla.cho_solve(sla.cho_factor(inner, check_finite=False), target, check_finite=False))
    except sla.LinAlgError:  # singular to rounding: data without noise, more degrees than modes
        return np.asarray(np.linalg.lstsq(inner, target, rcond=inner.shape[0] * np.finfo(float).eps)[0])


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

    Parameters
    ----------
    matrix : Fraction
    """

    matrix: Fraction

    def triple(self, n: int) -> ReciprocalTriple:
        """Return the companion of degree n."""
        if not 1 <= n <= self.matrix.degree:
            raise DataError(
                f"order={n} of a matrix fraction was asked",
                f"its order is the degree of the polynomials, here 1 to {self.matrix.degree}",
                "Ask for a larger order when the fraction is built.",
            )
        m = self.matrix.inputs
        size = n * m
        A = np.zeros((size, size))
        A[:, :m] = -denominator(self.matrix, n)
        A[: size - m, m:] = np.eye(size - m)
        return ReciprocalTriple(A, None, np.zeros((0, size)), size)


def fraction_companion(matrix: Fraction, factors: Factors) -> FractionCompanion:
    """Return the companion forms of every degree.

    Parameters
    ----------
    matrix : Fraction
    factors : Factors
        Of the normal equations: for the singular values, the companion needs the Gram blocks alone.
    """
    return FractionCompanion(factors=factors, matrix=matrix)
