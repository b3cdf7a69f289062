"""Few points that represent all lines where smooth functions are summed over them.

`few_points`: products of two polynomials of degree q have 2 q + 1 coefficients; as many of the lines determine their values on all.
`nodes_needed`, `moments_on`, `weights_at`: on an arc of the unit circle of half width h a polynomial of degree D in z and 1 / z is a smooth
function of the angle, whose Chebyshev coefficients beyond D h decay like Bessel functions. A sum over lines of weights times it is a sum
over Chebyshev points of other weights, which follow from the first moments of the weights; one set of moments serves all degrees.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from scipy import fft
from scipy.special import jv

from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.polynomials import evaluate

#: Candidate lines for each of the few points.
_CANDIDATES_PER_POINT = 8


class Few(NamedTuple):
    """Points that stand for all lines where products of two polynomials of a degree are concerned.

    `place` (G,): indices of the points. `spread` (F, G): maps values of a product at the points to all lines.
    """

    place: IntArray
    spread: RealArray


def few_points(points: ComplexArray, degree: int, *, circle: bool) -> Few:
    """Return 2 q + 1 of the points, and how they give any product p(x) r(x)* of two polynomials of degree q on all of them.

    On the unit circle, where x* = 1 / x, and on the imaginary axis such a product is x^-q, or one, times a polynomial of degree 2 q. The
    points are those that a pivoted factorization takes first: the matrix to invert is as well conditioned as any. All points are
    returned where there are hardly more.

    `points` (F,). `degree`: q. `circle`: whether they lie on the unit circle; else on the imaginary axis.

    Examples
    --------
    >>> x = np.exp(1j * np.linspace(0.5, 2.0, 400))
    >>> few = few_points(x, 3, circle=True)
    >>> product = np.abs(x**3 - 0.4 * x + 1) ** 2
    >>> few.place.size, bool(np.allclose(few.spread @ product[few.place], product))
    (7, True)
    """
    place = np.angle(points) if circle else np.imag(points)
    distinct, first = np.unique(place, return_index=True)
    if distinct.size <= 2 * (2 * degree + 1):
        return Few(first, (place[:, None] == distinct).astype(float))
    wanted = 2 * degree + 1
    dense_at_ends = (1 - np.cos(np.linspace(0, np.pi, _CANDIDATES_PER_POINT * wanted))) / 2
    chosen = np.unique(np.searchsorted(distinct, distinct[0] + dense_at_ends * (distinct[-1] - distinct[0])))
    among = first if chosen.size < 2 * wanted else first[chosen]
    basis, recurrence = _orthonormal(points[among], wanted - 1)
    index = among[np.sort(sla.qr(basis.T, mode="r", pivoting=True, check_finite=False)[1][:wanted])]
    level = float(basis[0, 0].real)
    solved = sla.inv(_values(recurrence, level, points[index], circle), check_finite=False)
    return Few(index, (solved @ _values(recurrence, level, points, circle)).real.T)


def _values(recurrence: ComplexArray, first: float, points: ComplexArray, circle: bool) -> ComplexArray:
    """Return polynomials of degree 2 q at points, (2 q + 1, points); on the circle times x^-q, as products of two of degree q are."""
    whole = evaluate(recurrence, first, points)
    return whole * points ** -(len(whole) // 2) if circle else whole


def _orthonormal(points: ComplexArray, degree: int) -> tuple[ComplexArray, ComplexArray]:
    """Return polynomials orthonormal on the points alone, without their conjugates, and their recurrence, as `orthogonal_basis` does."""
    basis, h = np.zeros((points.size, degree + 1), complex), np.zeros((degree + 1, degree), complex)
    basis[:, 0] = 1 / np.sqrt(points.size)
    for k in range(degree):
        v = points * basis[:, k]
        for _ in range(2):
            c = basis[:, : k + 1].conj().T @ v
            h[: k + 1, k] += c
            v -= basis[:, : k + 1] @ c
        h[k + 1, k] = np.linalg.norm(v)
        basis[:, k + 1] = v / h[k + 1, k]
    return basis, h


#: Chebyshev coefficients below this fraction of the size of the polynomial are rounding.
_ROUNDING = 1e-16


#: Lines whose moments are summed at a time.
_BLOCK_LINES = 2048


class Arc(NamedTuple):
    """An arc of the unit circle: its middle and half its width, rad."""

    middle: float
    half: float

    def angles(self, count: int) -> RealArray:
        """Return the Chebyshev points, from the upper end down, (count,)."""
        return np.asarray(self.middle + self.half * np.cos(np.pi * (np.arange(count) + 0.5) / count))


def arc_of(angles: RealArray) -> Arc:
    """Return the arc that angles lie on."""
    low, high = float(angles.min()), float(angles.max())
    return Arc((low + high) / 2, (high - low) / 2)


@lru_cache(maxsize=1024)
def nodes_needed(arc: Arc, degree: int) -> int:
    """Return how many Chebyshev points say a polynomial of z and 1 / z of a degree to rounding.

    The coefficients of exp(j D h x) are 2 j^r J_r(D h).

    Source: L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 3 and 4.

    Examples
    --------
    >>> nodes_needed(Arc(1.0, 1.0), 100)
    153
    """
    reach = degree * arc.half
    orders = np.arange(int(reach), int(2 * reach) + 40)
    return int(orders[np.argmax(np.abs(jv(orders, reach)) < _ROUNDING)]) + 1


def moments_on(arc: Arc, angles: RealArray, weights: RealArray, count: int) -> RealArray:
    """Return sum_f weights[f] T_r(x_f) of the first Chebyshev polynomials, x from -1 to 1 along the arc: (count, c).

    `angles` (F,). `weights` (F, c).
    """
    total = np.zeros((count, weights.shape[1]))
    turned = np.arccos(np.clip((angles - arc.middle) / (arc.half or 1.0), -1, 1))
    for start in range(0, angles.size, _BLOCK_LINES):
        some = slice(start, start + _BLOCK_LINES)
        total += np.cos(np.arange(count)[:, None] * turned[some]) @ weights[some]
    return total


def weights_at(moments: Array) -> RealArray:
    """Return the weights of as many Chebyshev points as there are moments: every polynomial of lower degree has its sum over the lines.

    Examples
    --------
    >>> arc, angles = Arc(1.0, 0.5), np.linspace(0.5, 1.5, 1000)
    >>> count = nodes_needed(arc, 6)
    >>> few = weights_at(moments_on(arc, angles, np.ones((1000, 1)), count))[:, 0]
    >>> bool(np.isclose(few @ np.cos(6 * arc.angles(count)), np.cos(6 * angles).sum()))
    True
    """
    return np.asarray(fft.dct(moments, type=3, axis=0) / len(moments))
