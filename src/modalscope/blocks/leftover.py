"""What polynomials orthogonal on lines leave of 1 / (x - s): by Christoffel and Darboux two functions of the line stand for all.

With the real inner product <f, g> of the lines and their conjugates, in which p_0 ... p_q are orthonormal, and P = h p_(q+1) the next one,

    on the imaginary axis   r = -(p_q(x) <P, g> + P(x) <p_q, g>) / (x - s),
    on the unit circle      r = (f*(x) <f*, x g> - f(x) <f, x g>) / (x - s),   f = p_(q+1), f* = x^(q+1) conj(f),

is g = 1 / (x - s) less its projection. (x - s) r is 1 less a polynomial of degree q + 1, and as x g = 1 + s g and multiplication by x is
skew (or keeps lengths) there, its products with p_0 ... p_(q-1) vanish (or those with x p_0 ... x p_(q-1)). Nothing is subtracted: of a
pole far away, of which little is left, that little is exact to rounding of the two sums.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.blocks.polynomials import following
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray

__all__ = ["Leftover", "leftover"]


@dataclass(frozen=True, eq=False, slots=True)
class Leftover:
    """Two functions on the lines and two that g is multiplied with: r = (sum_i on_i(x) <by_i, g>) / (x - s).

    Parameters
    ----------
    points : array of complex, (F,)
        x.
    on : array of complex, (2, F)
        With the weights of the lines.
    by : array, (2 F, 2)
        Weighted, real parts above imaginary ones.
    weights : array, (F,)
        Of the lines.
    """

    points: ComplexArray
    on: ComplexArray
    by: RealArray
    weights: RealArray

    def sums(self, functions: RealArray) -> RealArray:
        """Return <by_i, f> of weighted functions, real parts above imaginary ones, (2 F, c) -> (2, c)."""
        return np.asarray(self.by.T @ functions)

    def of_functions(self, poles: ComplexArray) -> tuple[ComplexArray, RealArray]:
        """Return <by_i, g> of weighted g = 1 / (x - s), (2, k), and the sum of |g|^2 over both signs and the lines, (k,).

        Parameters
        ----------
        poles : array of complex, (k,)
            s, in the plane of x.
        """
        w, x, s = self.weights[:, None], self.points[:, None], np.asarray(poles)
        ahead, behind = w / (x - s), w / (x.conj() - s)
        above, below = np.split(self.by.T, 2, axis=1)
        # real parts are (ahead + behind) / 2, imaginary ones (ahead - behind) / 2j
        sums = ((above - 1j * below) @ ahead + (above + 1j * below) @ behind) / 2
        return np.asarray(sums), energy(np.stack([ahead.T, behind.T]))

    def of_poles(self, poles: ComplexArray, sums: ComplexArray, lines: slice | IntArray) -> ComplexArray:
        """Return r on some lines at +w and at -w, (2, k, lines).

        Parameters
        ----------
        poles : array of complex, (k,)
            s, in the plane of x.
        sums : array of complex, (2, k)
            <by_i, g>.
        lines : slice or array of int
        """
        x, on = self.points[lines], self.on[:, lines]
        first, second = sums[:, :, None]
        s = np.asarray(poles)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([(first * f + second * g) / (z - s) for z, (f, g) in ((x, on), (x.conj(), on.conj()))])


def leftover(points: ComplexArray, basis: ComplexArray, weights: RealArray | None) -> Leftover:
    """Return what p_0 ... p_q, (F, q + 1), leave.

    Parameters
    ----------
    points : array of complex, (F,)
        On the imaginary axis, or on the unit circle.
    basis : array of complex, (F, q + 1)
        Orthonormal, without weights.
    weights : array, (F,), optional
        Of the lines.
    """
    w = np.ones(points.size) if weights is None else weights
    following_one, _ = following(basis, points, w)
    if not np.any(points.real):
        last = basis[:, -1]
        on, by = np.stack([-last, -following_one]), np.stack([following_one, last])
    else:
        f = following_one / np.sqrt(np.sum(np.abs(w * following_one) ** 2))
        turned = points ** basis.shape[1] * f.conj()
        on = np.stack([turned, -f])
        by = points.conj() * np.stack([turned, f])
    weighted = by * w
    return Leftover(points, on * w, np.concatenate([weighted.real, weighted.imag], axis=1).T, w)


def energy(functions: Array) -> RealArray:
    """Return the sum over both signs and lines of |r|^2, (2, k, lines) -> (k,)."""
    return np.asarray(
        np.einsum("skf,skf->k", functions.real, functions.real)
        + np.einsum("skf,skf->k", functions.imag, functions.imag)
    )
