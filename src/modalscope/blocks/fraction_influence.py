"""How the response moves the denominators of a matrix fraction, with the share of what the equation leaves.

    dA = -M_in^-1 sum_o [X_o' P dX_o A + dX_o' r_o],

X_o the weighted lines of output o times powers of z, P what the numerators leave, r_o = P X_o A the misfit of the equation. The second
term is no smaller than the first: without it deviations are 15 to 60 % wrong at 40 dB. The level of an output, by which it is divided,
is taken as given.

On a line the gradient of a pole is a = sum_q H_oq* K_qi + B_oi, with K and B polynomials in z and 1 / z. White noise asks for sums of |a|^2
and a b, b the mirror image, over the lines, in which only 1, H and H* H are rough: sums over few points of the arc are these (see
`modalscope.blocks.arc_nodes`), and nothing of lines times outputs times poles is formed.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.fraction_sums import moments_of_noise
from modalscope.blocks.influence import LineInfluence, Lines, Moments, Outer, all_lines
from modalscope.blocks.polynomials import both_sums
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray, freeze

if TYPE_CHECKING:
    from modalscope.blocks.fraction import Fraction

__all__ = ["FractionInfluence", "fraction_influence"]

#: Lines that a point of the arc has to save before it is worth its while.
_SAVED = 2

#: Share of its terms below which a sum by few points is rounding beside them.
_TOLD = 1e-7


def fraction_influence(matrix: Fraction, left: Array, right: Array, lines: Lines | None = None) -> FractionInfluence:
    """Return the gradient of left_j dA right_j, A = [A_1; ...; A_p] of the degree that the length of the rows says.

    Parameters
    ----------
    matrix : Fraction
    left : array, (k, p m)
    right : array, (m, k)
    lines : Lines, optional
        Those that stand for all; by default all.
    """
    m, degree = matrix.inputs, left.shape[1] // matrix.inputs
    rows = np.concatenate([np.zeros((len(left), m)), -matrix.solved(degree, left.T).T], axis=1)
    kept = all_lines(matrix.response.lines) if lines is None else lines
    return FractionInfluence(matrix, rows.reshape(len(left), degree + 1, m), np.asarray(right.T, dtype=complex), kept)


Pair = tuple[ComplexArray, ComplexArray]


class FractionInfluence(LineInfluence):
    """The gradient of eigenvalues of a matrix fraction.

    Parameters
    ----------
    matrix : Fraction
    rows : array of complex, (k, p + 1, m)
        Coefficients of the row by which X is multiplied.
    right : array of complex, (k, m)
        What A is multiplied by.
    lines : Lines
        Those that stand for all where lines are needed.
    """

    def __init__(self, matrix: Fraction, rows: ComplexArray, right: ComplexArray, lines: Lines) -> None:
        freeze(self, matrix=matrix, rows=rows, right=right, lines=lines)

    matrix: Fraction
    rows: ComplexArray
    right: ComplexArray

    @property
    def direct(self) -> tuple[Outer, ...]:
        """A on every line."""
        return self._on_lines[0]

    @property
    def mirrored(self) -> tuple[Outer, ...]:
        """B on every line."""
        return self._on_lines[1]

    @cached_property
    def _on_lines(self) -> tuple[tuple[Outer, ...], tuple[Outer, ...]]:
        of_row, row = _projected(self.matrix, self.rows, self.lines.used)
        column = np.einsum("bqi,ki->kbq", self.denominator, self.right, optimize=True)
        misfit, model = _projected(self.matrix, column, self.lines.used)
        return (
            (Outer(of_row[1], model[0]), Outer(misfit[1], row[0])),
            (Outer(of_row[0], model[1]), Outer(misfit[0], row[1])),
        )

    @cached_property
    def denominator(self) -> RealArray:
        """A_0, ..., A_p, (p + 1, m, m)."""
        m, degree = self.matrix.inputs, self.rows.shape[1] - 1
        return np.vstack([np.eye(m), self.matrix.denominator(degree)]).reshape(-1, m, m)

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; those of these poles alone by few points of the arc, where that is less."""
        degree = self.rows.shape[1] - 1
        count = self.matrix.sums.nodes(degree)
        if fading is not None or other is not self or _SAVED * count > self.lines.used.size:
            return super().joint(other, variance, fading)
        found, told = moments_of_noise(self, variance, count)
        lost = np.flatnonzero(~(found.size > _TOLD * told))
        if not lost.size:
            return found
        part = self.take(lost)
        again = LineInfluence(part.direct, part.mirrored, part.lines)
        exact = again.joint(again, variance)
        size, square = found.size.copy(), found.square.copy()
        size[lost], square[lost] = np.real(exact.size), exact.square
        return Moments(size, square)

    def take(self, index: Array) -> FractionInfluence:
        """Return the gradients of some poles."""
        return FractionInfluence(self.matrix, self.rows[index], self.right[index], self.lines)


def _projected(matrix: Fraction, c: ComplexArray, lines: IntArray) -> tuple[Pair, Pair]:
    """Return what P leaves of X c, weighted and halved (k, F, l), and sum_j c_j z^j (k, F, m), each at z and at 1 / z."""
    count = c.shape[1]
    z = np.exp(1j * np.outer(matrix.angles[lines], np.arange(count)))
    U, L = matrix.gram_blocks[1][:count, :, :count], matrix.lower_triangle[:count, :count]
    explained = np.einsum("aobi,kbi->aok", U, c, optimize=True)
    beta = sla.solve_triangular(L, explained.reshape(count, -1), lower=True, trans="T", check_finite=False)
    at, mirrored = both_sums(z, c)
    numerators = both_sums(z, beta.reshape(explained.shape).transpose(2, 0, 1))
    H = (matrix.response.values[lines] / matrix.output_scale[:, None]).transpose(0, 2, 1)
    w = 0.5 if matrix.weights is None else matrix.weights[lines, None] ** 2 / 2
    above, below = (
        ((values.transpose(1, 0, 2) @ response).transpose(1, 0, 2) + numerator) * w / matrix.output_scale
        for values, response, numerator in ((at, H, numerators[0]), (mirrored, H.conj(), numerators[1]))
    )
    return (above, below), (at, mirrored)
