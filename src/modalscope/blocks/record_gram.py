"""The Gram matrix of records on lines without their columns: sums over lines of products of two polynomials and two channels.

The columns p_j d_i, of the drives and outputs d on the lines, have products sum over lines of p_j* p_k d_i* d_l. Of the polynomials such a
product has 2 q + 1 coefficients, which as many points determine: d_i* d_l is spread over these once for every pair of channels, whatever j
and k. That takes 2 F (2 q + 1) (1 + m + l)^2 products instead of 2 F ((q + 1) (1 + m + l))^2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modalscope.blocks.few_points import chosen_points
from modalscope.model.checks import ComplexArray, IntArray, RealArray

__all__ = ["gram_by_points"]

#: Complex numbers in the products of channels that are taken at a time: 8 MB.
_NUMBERS = 1 << 19

#: Lines among which the points are chosen, and lines a point below which columns are as cheap.
_AMONG, _EACH = 8192, 4


def gram_by_points(
    points: ComplexArray,
    channels: Callable[[slice], ComplexArray],
    polynomials: Callable[[IntArray], ComplexArray],
    *,
    given: int,
    circle: bool,
) -> RealArray | None:
    """Return the Gram matrix of the real columns [p_j d_i (i < given), p_j d_o (the others)]; None where there are too few lines.

    Columns of the given channels run channel by channel, those of the others degree by degree.

    Parameters
    ----------
    points : array of complex, (F,)
    channels : callable
        Some lines -> the channels there times the weights of the lines, (lines, c).
    polynomials : callable
        Lines -> p_0 ... p_q there, (lines, q + 1).
    given : int
    circle : bool
        Whether the points lie on the unit circle; else on the imaginary axis.
    """
    some = np.arange(0, len(points), -(-len(points) // _AMONG))
    degree = polynomials(some[:1]).shape[1] - 1
    if some.size < _EACH * (2 * degree + 1):
        return None
    few = chosen_points(points[some], degree, circle=circle)
    spread = _spread_products(points, channels, few.spread)
    p = polynomials(some[few.place])
    pairs = (p.conj()[:, :, None] * p[:, None, :]).reshape(len(p), -1)
    sums = pairs.real.T @ spread.real - pairs.imag.T @ spread.imag
    return _arranged(sums.reshape(degree + 1, degree + 1, -1), given)


def _spread_products(
    points: ComplexArray,
    channels: Callable[[slice], ComplexArray],
    spread: Callable[[ComplexArray], RealArray],
) -> ComplexArray:
    """Return what d_i* d_l, i <= l, are at the few points, (2 q + 1, pairs)."""
    c = channels(slice(0, 1)).shape[1]
    ends = np.concatenate([[0], np.cumsum(np.arange(c, 0, -1))])
    step = max(_NUMBERS // int(ends[-1]), 1)
    total, products = 0.0, np.empty((min(step, len(points)), int(ends[-1])), complex)
    for start in range(0, len(points), step):
        lines = slice(start, min(start + step, len(points)))
        d = channels(lines)
        own = products[: len(d)]
        for i in range(c):
            np.multiply(d[:, i : i + 1].conj(), d[:, i:], out=own[:, ends[i] : ends[i + 1]])
        total = total + spread(points[lines]).T @ own.view(float)
    return np.ascontiguousarray(total).view(complex)


def _arranged(sums: RealArray, given: int) -> RealArray:
    """Return the matrix of all columns from the sums (q + 1, q + 1, pairs) of p_j* p_k d_i* d_l."""
    blocks, pairs = sums.shape[0], sums.shape[2]
    c = int(np.sqrt(2 * pairs))
    row, column = np.triu_indices(c)
    whole = np.empty((blocks, blocks, c, c))
    whole[:, :, row, column] = sums
    whole[:, :, column, row] = sums.transpose(1, 0, 2)
    edge = given * blocks
    gram = np.empty((c * blocks, c * blocks), order="F")
    gram[:edge, :edge] = whole[:, :, :given, :given].transpose(2, 0, 3, 1).reshape(edge, edge)
    gram[:edge, edge:] = whole[:, :, :given, given:].transpose(2, 0, 1, 3).reshape(edge, -1)
    gram[edge:, edge:] = whole[:, :, given:, given:].transpose(0, 2, 1, 3).reshape(len(gram) - edge, -1)
    gram[edge:, :edge] = gram[:edge, edge:].T
    return gram
