"""How noise in records moves poles: sums over all lines of products of two polynomials, taken at as few points as these have coefficients.

A pole moves by dp = sum over lines of a . dY + b . dY*, with a = P(x) u / 2 and b = P~(x) t / 2: vectors of polynomials of degree q, smooth
from line to line, and one number u and t a line, which follow the input and are not. White noise asks for sums of |P|^2 |u|^2 and the
like. Such a product is a polynomial of 2 q + 1 coefficients, which as many points determine: every sum over lines is a sum over these
points, |u|^2 being spread over them once. Nothing of lines times outputs times poles is ever formed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from modalscope.blocks.factor import Factors
from modalscope.blocks.few_points import Few
from modalscope.blocks.influence import LineInfluence, Lines, Moments, Outer
from modalscope.blocks.polynomials import both_sums
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray, freeze

if TYPE_CHECKING:
    from modalscope.blocks.record_lines import RecordLines

__all__ = ["Driven", "RecordColumns", "RecordInfluence", "told_lines"]

#: Lines of long records on which the influence is kept.
_TOLD = 8192

#: Numbers of each of the arrays that are made of some poles at a time.
_NUMBERS = 1 << 16


def spread_over(weights: Array, few: Few) -> Array:
    """Return what weights of the lines (k, F) are at the points, (k, G)."""
    if not np.iscomplexobj(weights):
        return np.asarray(weights @ few.spread)
    both = np.concatenate([weights.real, weights.imag]) @ few.spread
    return np.asarray(both[: len(weights)] + 1j * both[len(weights) :])


def told_lines(matrix: RecordLines) -> Lines:
    """Return the lines on which the influence is kept, as places among all: all, of long records some, each for those nearest to it.

    Parameters
    ----------
    matrix : RecordLines
    """
    judged, every = matrix.judged, matrix.response
    if judged.count == every.count <= _TOLD:
        return Lines(np.arange(every.count), np.ones(every.count))
    thin = np.arange(0, judged.count, -(-judged.count // _TOLD))
    used, each = [], []
    for r, own_lines in enumerate(every.spans_of_runs):
        there = every.frequencies[own_lines]
        own = np.searchsorted(there, judged.frequencies[thin[judged.run[thin] == r]])
        if own.size:
            edges = np.concatenate([[0], (own[1:] + own[:-1] + 1) // 2, [there.size]])
            used.append(own + own_lines.start)
            each.append(np.diff(edges))
    return Lines(np.concatenate(used), np.concatenate(each).astype(float))


class RecordInfluence(LineInfluence):
    """The gradient of poles by the outputs' transforms.

    Parameters
    ----------
    matrix : RecordLines
    left : array of complex, (k, q + 1, l)
        Coefficients of P, outputs in their own unit.
    right : Driven
        What the columns of real and of imaginary parts have on the told lines.
    """

    def __init__(self, matrix: RecordLines, left: ComplexArray, right: Driven) -> None:
        freeze(self, matrix=matrix, left=left, right=right)

    matrix: RecordLines
    left: ComplexArray
    right: Driven

    @property
    def lines(self) -> Lines:
        """The told lines."""
        return self.matrix.told

    @property
    def direct(self) -> tuple[Outer, ...]:
        """A = P u on every line: for small problems and for tests."""
        return (Outer(self.at(self.lines.used)[0], self.drives[0][:, :, None]),)

    @property
    def mirrored(self) -> tuple[Outer, ...]:
        """B = P~ t on every line."""
        return (Outer(self.at(self.lines.used)[1], self.drives[1][:, :, None]),)

    @property
    def drives(self) -> tuple[ComplexArray, ComplexArray]:
        """U and t of every pole on the told lines, (k, F) each."""
        (real, beside), (imaginary, pair) = self.right.parts(slice(None)).transpose(2, 0, 1, 3)
        weights = self.matrix.told_weights / 2
        u, t = (real + pair) + 1j * (beside - imaginary), (real - pair) + 1j * (beside + imaginary)
        return np.asarray(u * weights), np.asarray(t * weights)

    def at(self, lines: IntArray) -> tuple[ComplexArray, ComplexArray]:
        """Return P and P~ on some lines, (k, lines, l) each."""
        return both_sums(self.matrix.polynomials(lines), self.left)

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; of one variance an output, (l, 1), by the few points."""
        if fading is not None or variance.ndim != 2 or not isinstance(other, RecordInfluence):
            return super().joint(other, variance, fading)
        if other is self:
            return self._own(variance[:, 0])
        finer = max(self.matrix, other.matrix, key=lambda one: one.block_rows)
        few, (used, each) = finer.few, finer.told
        (P, M), (u, t) = self.at(used[few.place]), self.drives
        (R, N), (v, s) = other.at(used[few.place]), other.drives

        def summed(one: ComplexArray, two: ComplexArray, drive: Array) -> ComplexArray:
            at = (one * two) @ variance[:, 0]
            return np.asarray(np.sum(at * spread_over(drive * each, few), axis=1))

        size = summed(P, R.conj(), u * v.conj()) + summed(M, N.conj(), t * s.conj())
        return Moments(size, summed(P, N, u * s) + summed(M, R, t * v))

    def _own(self, variance: RealArray) -> Moments:
        """Return E|dp|^2 and E dp dp, some poles at a time: sums of |u|^2, |t|^2 and u t, in real numbers."""
        P, M = self.at(self.matrix.told.used[self.matrix.few.place])
        plain, mirrored, both = np.abs(P) ** 2 @ variance, np.abs(M) ** 2 @ variance, (P * M) @ variance
        size, square = np.empty(len(P)), np.empty(len(P), complex)
        spread = self.matrix.told_spread
        step = max(_NUMBERS // len(spread), 1)
        for start in range(0, len(P), step):
            s = slice(start, start + step)
            # u = a + b + j (c - d), t = a - b + j (c + d), over two
            (a, d), (c, b) = self.right.parts(s).transpose(0, 2, 1, 3)
            a2, b2, c2, d2 = a * a, b * b, c * c, d * d
            sums = np.stack([a2 + b2 + c2 + d2, 2 * (a * b - c * d), a2 - b2 - c2 + d2, 2 * (a * c + b * d)]) @ spread
            size[s] = np.sum((plain + mirrored)[s] * sums[0] + (plain - mirrored)[s] * sums[1], axis=1)
            square[s] = np.sum(both[s] * (sums[2] + 1j * sums[3]), axis=1)
        return Moments(size, 2 * square)

    def take(self, index: Array) -> RecordInfluence:
        """Return the gradients of some poles."""
        return RecordInfluence(self.matrix, self.left[index], self.right.take(index))


@dataclass(frozen=True, eq=False)
class RecordColumns:
    """The right factor on the told lines of all runs, computed when it is first asked for.

    Parameters
    ----------
    matrix : RecordLines
    factors : Factors
        Of the triangular stand-in.
    """

    matrix: RecordLines
    factors: Factors

    @property
    def blocks(self) -> RealArray:
        """Rows of Q (1, 2 F, k), all of them."""
        return self.whole

    @cached_property
    def whole(self) -> RealArray:
        """Rows of Q (1, 2 F, k)."""
        matrix, factors = self.matrix, self.factors
        n = max(min(factors.rank, factors.d.size), 1)
        rows = np.zeros((matrix.outputs * (matrix.block_rows + 1), n))
        kept = np.arange(len(rows)) if len(factors.P) == len(rows) else matrix.kept_rows
        rows[kept] = factors.P[:, :n] / factors.d[:n]
        return matrix.on_lines(rows)[None]


@dataclass(frozen=True, eq=False)
class Driven:
    """Columns of the matrix on the told lines, as combinations of those of the right factor: they are not kept.

    Parameters
    ----------
    columns : array, (2 F, K)
        Rows of Q, those of real parts above those of imaginary ones.
    coefficients : array of complex, (n, k)
        Of the first n of them.
    """

    columns: RealArray
    coefficients: ComplexArray

    def parts(self, some: slice) -> RealArray:
        """Return what real and imaginary parts of coefficients give on rows of real and of imaginary parts, (2, k, 2, F), of some poles."""
        chosen = self.coefficients[:, some]
        both = np.hstack([chosen.real, chosen.imag]).T @ self.columns[:, : len(chosen)].T
        return np.asarray(both.reshape(2, chosen.shape[1], 2, -1))

    def take(self, index: Array) -> Driven:
        """Return the columns of some poles."""
        return Driven(self.columns, self.coefficients[:, index])
