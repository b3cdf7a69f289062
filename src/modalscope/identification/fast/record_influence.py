"""Sensitivity of the poles of records on lines to noise.

A pole moves by dp = sum over lines of a . dY + b . dY*, with a = P(x) u / 2 and b = P~(x) t / 2: vectors of polynomials of degree q, smooth
from line to line, and one number u and t a line, which follow the input and are not. White noise asks for sums of |P|^2 |u|^2 and the
like. Such a product is a polynomial of 2 q + 1 coefficients, which as many points determine: every sum over lines is a sum over these
points, |u|^2 being spread over them once. Nothing of lines times outputs times poles is ever formed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.data.record_spectra import RecordSpectra
from modalscope.identification.fast.few_points import Few, few_points
from modalscope.identification.matrices.influence import LineInfluence, Lines, Moments, Outer
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, freeze
from modalscope.numerics.functions.polynomials import both_sums
from modalscope.numerics.operators import times_real

#: Maximum number of lines on which the influence of noise is stored.
_MAX_LINES = 8192

#: Count of numbers in each array of some poles.
_BLOCK_NUMBERS = 1 << 16


def lines_of_influence(whole: RecordSpectra, judged: RecordSpectra) -> Lines:
    """Return lines on which the influence is stored, as indices into all lines: all, or for long records the nearest to selected ones."""
    if judged.count == whole.count <= _MAX_LINES:
        return Lines(np.arange(whole.count), np.ones(whole.count))
    selected = np.arange(0, judged.count, -(-judged.count // _MAX_LINES))
    used, shares = [], []
    for r, lines in enumerate(whole.spans_of_runs):
        f = whole.frequencies[lines]
        nearest = np.searchsorted(f, judged.frequencies[selected[judged.run[selected] == r]])
        if nearest.size:
            edges = np.concatenate([[0], (nearest[1:] + nearest[:-1] + 1) // 2, [f.size]])
            used.append(nearest + lines.start)
            shares.append(np.diff(edges))
    return Lines(np.concatenate(used), np.concatenate(shares).astype(float))


@dataclass(frozen=True, eq=False)
class InfluenceLines:
    """The lines on which the influence of noise is stored, with the polynomials of the rows.

    `lines`: indices into all lines. `points` (F,), `weights` (F,): of these lines. `degree`: q. `circle`: whether points lie on the unit
    circle. `polynomials`: indices of lines -> p_k on them, (lines, q + 1).
    """

    lines: Lines
    points: ComplexArray
    weights: RealArray
    degree: int
    circle: bool
    polynomials: Callable[[IntArray], ComplexArray]

    @cached_property
    def few(self) -> Few:
        """Points that represent the lines where products of two polynomials are summed."""
        return few_points(self.points, self.degree, circle=self.circle)

    @cached_property
    def spread(self) -> RealArray:
        """Weights that map values on the lines to the few points, (F, points); a quarter for both halves."""
        return self.few.spread * (self.lines.each * self.weights**2 / 4)[:, None]

    def at_few(self, coefficients: ComplexArray, few: Few) -> tuple[ComplexArray, ComplexArray]:
        """Return sum_k c_k p_k and sum_k c_k p_k* at few points of the lines; coefficients (k, q + 1, l)."""
        return both_sums(self.polynomials(self.lines.used[few.place]), coefficients)


class RecordInfluence(LineInfluence):
    """The gradient of poles by the outputs' transforms.

    `kept`: the lines. `left` (k, q + 1, l): coefficients of P, outputs in their own unit. `right`: columns of real and of imaginary parts
    on these lines.
    """

    def __init__(self, kept: InfluenceLines, left: ComplexArray, right: Driven) -> None:
        freeze(self, kept=kept, left=left, right=right)

    kept: InfluenceLines
    left: ComplexArray
    right: Driven

    @property
    def lines(self) -> Lines:
        """The lines of the influence."""
        return self.kept.lines

    @property
    def direct(self) -> tuple[Outer, ...]:
        """A = P u on every line: for small problems and for tests."""
        return (Outer(both_sums(self.kept.polynomials(self.lines.used), self.left)[0], self.drives[0][:, :, None]),)

    @property
    def mirrored(self) -> tuple[Outer, ...]:
        """B = P~ t on every line."""
        return (Outer(both_sums(self.kept.polynomials(self.lines.used), self.left)[1], self.drives[1][:, :, None]),)

    @property
    def drives(self) -> tuple[ComplexArray, ComplexArray]:
        """U and t of every pole on the lines of the influence, (k, F) each."""
        (a, b), (c, d) = self.right.parts(slice(None)).transpose(2, 0, 1, 3)
        weights = self.kept.weights / 2
        return ((a + d) + 1j * (b - c)) * weights, ((a - d) + 1j * (b + c)) * weights

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; of one variance an output, (l, 1), by the few points."""
        if fading is not None or variance.ndim != 2 or not isinstance(other, RecordInfluence):
            return super().joint(other, variance, fading)
        if other is self:
            return self._own(variance[:, 0])
        finer = max(self.kept, other.kept, key=lambda kept: kept.degree)
        few, shares = finer.few, finer.lines.each
        (P, M), (u, t) = self.kept.at_few(self.left, few), self.drives
        (R, N), (v, s) = other.kept.at_few(other.left, few), other.drives

        def summed(one: ComplexArray, two: ComplexArray, drive: Array) -> ComplexArray:
            return np.asarray(np.sum(((one * two) @ variance[:, 0]) * times_real(drive * shares, few.spread), axis=1))

        size = summed(P, R.conj(), u * v.conj()) + summed(M, N.conj(), t * s.conj())
        return Moments(size, summed(P, N, u * s) + summed(M, R, t * v))

    def _own(self, variance: RealArray) -> Moments:
        """Return E|dp|^2 and E dp dp, some poles at a time: sums of |u|^2, |t|^2 and u t, in real numbers."""
        P, M = self.kept.at_few(self.left, self.kept.few)
        plain, mirrored, both = np.abs(P) ** 2 @ variance, np.abs(M) ** 2 @ variance, (P * M) @ variance
        size, square = np.empty(len(P)), np.empty(len(P), complex)
        spread = self.kept.spread
        step = max(_BLOCK_NUMBERS // len(spread), 1)
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
        return RecordInfluence(self.kept, self.left[index], self.right.take(index))


@dataclass(frozen=True, eq=False)
class Driven:
    """Columns of the matrix on the lines of the influence, as combinations of those of the right factor: they are not kept.

    `columns` (2 F, K): rows of Q, those of real parts above those of imaginary ones. `coefficients` (n, k): of the first n of them.
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
