"""Sums over the lines of an arc of the unit circle, of given weights times trigonometric polynomials, at as few points as these need.

On an arc of half width h a polynomial of degree D in z and 1 / z is a smooth function of the angle, whose Chebyshev coefficients fall off
beyond D h like Bessel functions: its values at q Chebyshev points, q a little above D h, say all of it. A sum over lines of weights times
it is a sum over these points of other weights, which follow from the first q moments of the weights, those that serve all degrees.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.special import jv

from modalscope.model.checks import Array, RealArray

__all__ = ["Arc", "arc_of", "moments_on", "nodes_needed", "weights_at"]

#: Chebyshev coefficients below this share of the polynomial's size are rounding.
_SMALL = 1e-16

#: Lines whose moments are gathered at a time.
_LINES = 2048


class Arc(NamedTuple):
    """An arc of the unit circle.

    Attributes
    ----------
    middle, half : float
        Its middle and half its width, rad.
    """

    middle: float
    half: float

    def angles(self, count: int) -> RealArray:
        """Return the Chebyshev points, from the upper end down, (count,)."""
        return np.asarray(self.middle + self.half * np.cos(np.pi * (np.arange(count) + 0.5) / count))


def arc_of(angles: RealArray) -> Arc:
    """Return the arc that angles lie on."""
    low, high = float(angles.min()), float(angles.max())
    return Arc((low + high) / 2, (high - low) / 2)


def nodes_needed(arc: Arc, degree: int) -> int:
    """Return how many Chebyshev points say a polynomial of z and 1 / z of a degree to rounding.

    The coefficients of exp(j D h x) are 2 j^r J_r(D h).

    Source
    ------
    L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 3 and 4.

    Examples
    --------
    >>> nodes_needed(Arc(1.0, 1.0), 100)
    153
    """
    reach = degree * arc.half
    orders = np.arange(int(reach), int(2 * reach) + 40)
    return int(orders[np.argmax(np.abs(jv(orders, reach)) < _SMALL)]) + 1


def moments_on(arc: Arc, angles: RealArray, weights: RealArray, count: int) -> RealArray:
    """Return sum_f weights[f] T_r(x_f) of the first Chebyshev polynomials, x from -1 to 1 along the arc: (count, c).

    Parameters
    ----------
    arc : Arc
    angles : array, (F,)
    weights : array, (F, c)
    count : int
    """
    total = np.zeros((count, weights.shape[1]))
    turned = np.arccos(np.clip((angles - arc.middle) / (arc.half or 1.0), -1, 1))
    for start in range(0, angles.size, _LINES):
        some = slice(start, start + _LINES)
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
