"""The matrix fraction's denominators as companion matrices: poles and participation of every degree (LSCF)."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import Factors
from modalscope.blocks.fraction import Fraction
from modalscope.model.checks import DataError, RealArray
from modalscope.realizations.triple import Realization, Triple

__all__ = ["denominator", "fraction_companion", "fraction_factors"]


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


def fraction_factors(matrix: Fraction) -> Factors:
    """Return the eigenvectors of M of the largest degree and the roots of its eigenvalues, the singular values of the data behind it."""
    weights, vectors = np.linalg.eigh(matrix.gram_matrices[-1])
    d, V = np.sqrt(np.clip(weights[::-1], 0, None)), vectors[:, ::-1]
    return Factors(V, d, V, d, d.size, f"normal equations, {d.size} unknowns a column")


def fraction_companion(matrix: Fraction, factors: Factors) -> Realization:
    """Controllable companion form on Gram blocks: the order is the degree of the polynomial.

    The matrix has the roots' inverses mu = 1 / z as eigenvalues, from mu^p w' = - sum_j mu^(p-j) w' A_j, and the rows
    [mu^(p-1) w', ..., w'] as left eigenvectors: their last m entries are the participation w'.
    Shapes and residuals come from least squares over the lines.

    Parameters
    ----------
    matrix : Fraction
    factors : Factors
        Of `fraction_factors`: for the singular values, the companion needs the Gram blocks alone.
    """
    m = matrix.inputs

    def triple(degree: int) -> Triple:
        if not 1 <= degree <= matrix.degree:
            raise DataError(
                f"order={degree} of a matrix fraction was asked",
                f"its order is the degree of the polynomials, here 1 to {matrix.degree}",
                "Ask for a larger order when the fraction is built.",
            )
        size = degree * m
        A = np.zeros((size, size))
        A[:, :m] = -denominator(matrix, degree)
        A[: size - m, m:] = np.eye(size - m)
        B = np.zeros((size, m))
        B[size - m :] = np.eye(m)
        return Triple(A, B, np.zeros((0, size)), size)

    return Realization(factors, triple, canonical=True)
