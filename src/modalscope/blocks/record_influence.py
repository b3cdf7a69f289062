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

__all__ = ["RecordColumns", "RecordInfluence", "told_lines"]

#: Lines of long records on which the influence is kept.
_TOLD = 8192


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
    if judged is every and every.count <= _TOLD:
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
    right : array of complex, (k, 2, F)
        What the columns of real and of imaginary parts have on the told lines, times the weights of the lines.
    """

    def __init__(self, matrix: RecordLines, left: ComplexArray, right: ComplexArray) -> None:
        freeze(self, matrix=matrix, left=left, right=right)

    matrix: RecordLines
    left: ComplexArray
    right: ComplexArray

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
        real, imaginary = self.right[:, 0], self.right[:, 1]
        return np.asarray(real - 1j * imaginary) / 2, np.asarray(real + 1j * imaginary) / 2

    def at(self, lines: IntArray) -> tuple[ComplexArray, ComplexArray]:
        """Return P and P~ on some lines, (k, lines, l) each."""
        return both_sums(self.matrix.polynomials(lines), self.left)

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; of one variance an output, (l, 1), by the few points."""
        if fading is not None or variance.ndim != 2 or not isinstance(other, RecordInfluence):
            return super().joint(other, variance, fading)
        finer = max(self.matrix, other.matrix, key=lambda one: one.block_rows)
        few, (used, each) = finer.few, finer.told
        (P, M), (u, t) = self.at(used[few.place]), self.drives
        (R, N), (v, s) = ((P, M), (u, t)) if other is self else (other.at(used[few.place]), other.drives)

        def summed(one: ComplexArray, two: ComplexArray, drive: Array) -> ComplexArray:
            at = (one * two) @ variance[:, 0]
            return np.asarray(np.sum(at * spread_over(drive * each, few), axis=1))

        level = (np.abs(u) ** 2, np.abs(t) ** 2) if other is self else (u * v.conj(), t * s.conj())
        size = summed(P, R.conj(), level[0]) + summed(M, N.conj(), level[1])
        square = summed(P, N, u * s)
        return Moments(size, square + (square if other is self else summed(M, R, t * v)))

    def take(self, index: Array) -> RecordInfluence:
        """Return the gradients of some poles."""
        return RecordInfluence(self.matrix, self.left[index], self.right[index])


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
