"""Block rows C p_k(A) of polynomials orthogonal on lines: their shift is the recurrence, and shapes are read off all of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.blocks.influence import LineInfluence, Lines, Outer, all_lines
from modalscope.blocks.lines import RowsOnLines
from modalscope.blocks.plane import Plane
from modalscope.blocks.polynomials import evaluate
from modalscope.blocks.shift import RowShift
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.model.response import Response

__all__ = ["PolynomialRows"]


class PolynomialRows(RowsOnLines):
    """A matrix whose rows are [C p_0(A); ...; C p_q(A)] times states, outputs divided by their scale.

    A concrete matrix has the fields below.
    """

    response: Response
    plane: Plane
    basis: ComplexArray
    recurrence: RealArray
    output_scale: RealArray
    weights: RealArray | None

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0), which is the degree q."""
        return int(self.recurrence.shape[1])

    @property
    def full_shift(self) -> RowShift:
        """E0 drops the last block, E1 = h' (x) I."""
        return RowShift(block=self.outputs, recurrence=self.recurrence)

    @property
    def first_value(self) -> float:
        """p_0, the constant of the basis."""
        return float(self.basis[0, 0].real)

    def polynomials(self, lines: slice | IntArray) -> ComplexArray:
        """Return p_k on some lines, (lines, q + 1)."""
        return np.asarray(self.basis[lines])

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return (first block row of H(k) / p_0) X, such that C = first_rows(Q d^-1/2)."""
        head = self.triangle[: self.outputs]
        if k == 1:  # x p_0 = h_00 p_0 + h_10 p_1
            head = self.recurrence[0, 0] * head + self.recurrence[1, 0] * self.triangle[self.outputs : 2 * self.outputs]
        return np.asarray(self.output_scale[:, None] * (head @ right) / self.first_value)

    def first_block(self, shapes: Array) -> Array:
        """Return C p_0 for shapes C, in the scale of the rows."""
        return np.asarray(shapes) / self.output_scale[:, None] * self.first_value

    def shapes(self, V: Array, poles: Array) -> ComplexArray:
        """Return the shapes c of modes from their columns [c p_0; c p_1; ...] of the row factor, by least squares over all blocks.

        The first block alone would do, but far from the axis the polynomials grow beyond 1e15, and it is rounding beside them.

        Parameters
        ----------
        V : array of complex, (l K, k)
            Row factor times eigenvectors.
        poles : array of complex, (k,)
            In the plane of the polynomials.
        """
        blocks = np.asarray(V).reshape(-1, self.outputs, len(poles))
        p = evaluate(self.recurrence, self.first_value, poles)[self.block_indices(len(blocks))]
        size = np.max(np.abs(p), axis=0)
        p = p / size
        c = np.einsum("kn,kln->ln", p.conj(), blocks) / np.sum(np.abs(p) ** 2, axis=0) / size
        return np.asarray(self.output_scale[:, None] * c)

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return self.plane.to_s(poles)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles in the plane of the polynomials."""
        return self.plane.from_s(poles)

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None in the s-domain and under the bilinear map."""
        return self.plane.dt

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return p_k(x) / p_0 at the poles."""
        return evaluate(self.recurrence, 1.0, poles)[self.block_indices(blocks)]

    def influence(self, left: Any, right: Any, lines: Lines | None = None) -> LineInfluence:
        """Return the gradient: the row on the lines by output times the right vector by input, on dH; the mirror image on dH*.

        The rows come as a `LinePencil`.

        What is eliminated is orthogonal to the right vectors already.
        """
        kept = all_lines(self.response.count) if lines is None else lines
        index = kept.used
        at, mirrored = left.on(index)
        w = 0.5 if self.weights is None else self.weights[index] / 2
        real, imaginary = right.parts(index)
        upper, lower = (real - 1j * imaginary), (real + 1j * imaginary)
        half = np.broadcast_to(w, index.shape)[:, None]
        return LineInfluence((Outer(at, upper * half),), (Outer(mirrored, lower * half),), kept)
