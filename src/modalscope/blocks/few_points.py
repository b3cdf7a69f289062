"""Few points that stand for all lines where products of two polynomials are summed: as many as such a product has coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.polynomials import evaluate
from modalscope.model.checks import ComplexArray, IntArray, RealArray

__all__ = ["Chosen", "Few", "chosen_points", "few_points"]

#: Lines among which each of the few points is chosen.
_CHOICE = 8


class Few(NamedTuple):
    """Points that stand for all lines where products of two polynomials of a degree are concerned.

    Attributes
    ----------
    place : array of int, (G,)
        Lines that are the points.
    spread : array, (F, G)
        The value of a product on a line is this times its values at the points.
    """

    place: IntArray
    spread: RealArray


class Chosen(NamedTuple):
    """The few points themselves, and what gives the values of a product anywhere from those at the points.

    Attributes
    ----------
    place : array of int, (2 q + 1,)
        Lines that are the points.
    first, recurrence, solved
        Polynomials of degree 2 q, and the inverse of their values at the points.
    circle : bool
    """

    place: IntArray
    first: float
    recurrence: ComplexArray
    solved: ComplexArray
    circle: bool

    def spread(self, points: ComplexArray) -> RealArray:
        """Return how products on any of the points or between them follow from those at the few, (points, 2 q + 1)."""
        return np.asarray((self.solved @ _values(self.recurrence, self.first, points, self.circle)).real.T)


def few_points(points: ComplexArray, degree: int, *, circle: bool) -> Few:
    """Return 2 q + 1 of the points, and how they give any product p(x) r(x)* of two polynomials of degree q on all of them.

    All of them are returned where there are hardly more.

    Parameters
    ----------
    points : array of complex, (F,)
    degree : int
        q.
    circle : bool
        Whether they lie on the unit circle; else on the imaginary axis.

    Examples
    --------
    >>> x = np.exp(1j * np.linspace(0.5, 2.0, 400))
    >>> few = few_points(x, 3, circle=True)
    >>> product = np.abs(x**3 - 0.4 * x + 1) ** 2
    >>> few.place.size, bool(np.allclose(few.spread @ product[few.place], product))
    (7, True)
    """
    place = _place(points, circle)
    distinct, first = np.unique(place, return_index=True)
    if distinct.size <= 2 * (2 * degree + 1):
        return Few(first, (place[:, None] == distinct).astype(float))
    chosen = chosen_points(points, degree, circle=circle)
    return Few(chosen.place, chosen.spread(points))


def chosen_points(points: ComplexArray, degree: int, *, circle: bool) -> Chosen:
    """Return 2 q + 1 of the points that determine any product p(x) r(x)* of two polynomials of degree q, of many more points.

    On the unit circle, where x* = 1 / x, and on the imaginary axis such a product is x^-q, or one, times a polynomial of degree 2 q. The
    points are those that a pivoted factorization takes first: the matrix to invert is as well conditioned as any.

    Parameters
    ----------
    points, degree, circle
        As in `few_points`.
    """
    distinct, first = np.unique(_place(points, circle), return_index=True)
    wanted = 2 * degree + 1
    dense_at_ends = (1 - np.cos(np.linspace(0, np.pi, _CHOICE * wanted))) / 2
    chosen = np.unique(np.searchsorted(distinct, distinct[0] + dense_at_ends * (distinct[-1] - distinct[0])))
    among = first if chosen.size < 2 * wanted else first[chosen]
    basis, recurrence = _orthonormal(points[among], wanted - 1)
    index = among[np.sort(sla.qr(basis.T, mode="r", pivoting=True, check_finite=False)[1][:wanted])]
    level = float(basis[0, 0].real)
    own = _values(recurrence, level, points[index], circle)
    return Chosen(index, level, recurrence, np.asarray(sla.inv(own, check_finite=False)), circle)


def _place(points: ComplexArray, circle: bool) -> RealArray:
    return np.asarray(np.angle(points) if circle else np.imag(points))


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
