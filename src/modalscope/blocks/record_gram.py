"""The Gram matrix of records on lines without their columns: sums over lines of products of two polynomials and two channels.

The columns p_j d_i, of the drives and outputs d on the lines, have products sum over lines of p_j* p_k d_i* d_l. Of the polynomials such a
product has 2 q + 1 coefficients, which as many points determine: d_i* d_l is spread over these once for every pair of channels, whatever j
and k. That takes 2 F (2 q + 1) (1 + m + l)^2 products instead of 2 F ((q + 1) (1 + m + l))^2.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from modalscope.blocks.few_points import chosen_points
from modalscope.model.checks import ComplexArray, IntArray, RealArray
from modalscope.model.memory import scratch

__all__ = ["gram_by_points"]

#: Numbers in the products of channels that are taken at a time: 4 MB, and as many again for imaginary parts.
_NUMBERS = 1 << 19

#: Lines among which the points are chosen, and lines a point below which columns are as cheap.
_AMONG, _EACH = 8192, 4


def gram_by_points(
    count: int,
    points: Callable[[slice], ComplexArray],
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
    count : int
        F, lines.
    points, channels : callable
        Some lines -> where they are, (lines,), and the channels there times the weights of the lines, (lines, c).
    polynomials : callable
        Lines -> p_0 ... p_q there, (lines, q + 1).
    given : int
    circle : bool
        Whether the points lie on the unit circle; else on the imaginary axis.
    """
    every = -(-count // _AMONG)
    some = np.arange(0, count, every)
    degree = polynomials(some[:1]).shape[1] - 1
    if some.size < _EACH * (2 * degree + 1):
        return None
    few = chosen_points(points(slice(0, count, every)), degree, circle=circle)
    products = _Products(channels(slice(0, 1)).shape[1])
    for start in range(0, count, products.lines):
        lines = slice(start, min(start + products.lines, count))
        products.add(channels(lines), few.spread(points(lines)))
    p = polynomials(some[few.place])
    pairs = (p.conj()[:, :, None] * p[:, None, :]).reshape(len(p), -1)
    sums = pairs.real.T @ products.real.T - pairs.imag.T @ products.imag.T
    return _arranged(sums.reshape(degree + 1, degree + 1, -1), given)


class _Products:
    """What d_i* d_l, i <= l, of c channels are at the few points: real and imaginary parts, (pairs, points) each."""

    def __init__(self, c: int) -> None:
        self.ends = np.concatenate([[0], np.cumsum(np.arange(c, 0, -1))])
        self.lines = max(_NUMBERS // int(self.ends[-1]), 1)
        self._place = scratch(3 * int(self.ends[-1]) * self.lines).reshape(3, -1)
        self.real: RealArray = np.zeros(1)
        self.imag: RealArray = np.zeros(1)

    def add(self, d: ComplexArray, spread: RealArray) -> None:
        """Add some lines: channels (lines, c), and how lines are spread, (lines, points)."""
        x, y = np.ascontiguousarray(d.real.T), np.ascontiguousarray(d.imag.T)
        shape = (int(self.ends[-1]), len(d))
        real, imag, beside = (part[: shape[0] * shape[1]].reshape(shape) for part in self._place)
        for i, (start, stop) in enumerate(pairwise(self.ends)):
            re, im, other = real[start:stop], imag[start:stop], beside[: stop - start]
            np.multiply(x[i], x[i:], out=re)
            re += np.multiply(y[i], y[i:], out=other)
            np.multiply(x[i], y[i:], out=im)
            im -= np.multiply(y[i], x[i:], out=other)
        self.real, self.imag = self.real + real @ spread, self.imag + imag @ spread


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
