"""Block Hankel matrices in full generality (Eqs. 20-21, 31): uneven shifts, subsets of channels, weights and compression of whole columns.

Block (j, i) of H(k) is Y_{J_j I_i}(s_j + k + t_i) = C_{J_j} A^{s_j} A^k A^{t_i} B_{I_i}: any sensors in every block row but the
first, any inputs in every block column but the first, any shifts. There is no structure to use: the matrix is an array.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.blocks.convolved import ConvolvedInfluence
from modalscope.blocks.factor import Factors
from modalscope.blocks.hankel import Hankel
from modalscope.blocks.influence import Lines
from modalscope.blocks.operators import DenseMatrix
from modalscope.blocks.shift import RowShift
from modalscope.blocks.side import Side
from modalscope.model.checks import Array, ComplexArray, DataError, IntArray, RealArray

__all__ = ["GeneralHankel"]


@dataclass(frozen=True, eq=False)
class GeneralHankel(Hankel):
    """A block Hankel matrix whose blocks are chosen, weighted or combined as they like (made by `hankel`)."""

    def _matrix(self, rows: Side, k: int) -> DenseMatrix:
        (s, outputs), (t, inputs) = rows.entries, self.columns.entries
        H = rows.apply(self.values[s[:, None] + k + t, outputs[:, None], inputs])
        return DenseMatrix(np.ascontiguousarray(self.columns.apply(H.T).T))

    def shifted(self, k: int) -> DenseMatrix:
        """Return H(k), weighted and compressed."""
        return self._matrix(self.rows, k)

    def tall(self) -> DenseMatrix:
        """Return H(0) with one more block row, the rows of H(0) and of H(1) together.

        Raises
        ------
        DataError
            Shifts that are not consecutive, or compression over whole columns: A cannot be read off a row shift then.
        """
        return self._matrix(self._tall_rows, 0)

    @cached_property
    def _tall_rows(self) -> Side:
        asked = "a realization from the row shift was asked (alternate, polyreference and prce in this form)"
        others = "use the other form (controllable when this is the observable one), or method='era' or 'least_squares'"
        if self.rows.over is not None:
            raise DataError(
                asked,
                "a compression over whole columns leaves nothing of that shift",
                f"Compress within blocks (one column a channel), or {others}.",
            )
        shifts = self.rows.shifts
        if not np.array_equal(shifts, np.arange(shifts.size)):
            last = int(np.flatnonzero(shifts != np.arange(shifts.size))[0]) - 1
            raise DataError(
                asked,
                f"the shifts are not consecutive: {shifts[last + 1]} follows {shifts[last]}",
                f"Use consecutive shifts, or {others}.",
            )
        return self.rows.taller()

    @cached_property
    def row_shift(self) -> RowShift:
        """E0 and E1 for factors of `tall()`: every row that has itself one sample later in the matrix, and that row."""
        side = self._tall_rows
        place = {(int(a), int(b)): i for i, (a, b) in enumerate(side.entries.T)}
        pairs = [(i, place[(a + 1, b)]) for (a, b), i in place.items() if (a + 1, b) in place]
        before, after = np.array(pairs).T
        whole = self.rows.whole
        return RowShift(block=self.values.shape[1], before=before, after=after, weight=side.weights, whole=whole)

    def pencil(self, left: Array, values: Array, *, tall: bool) -> ComplexArray:
        """Return L_j on the rows of whole consecutive blocks, of which the matrix has some."""
        if tall:
            entries = self._tall_rows.entries
            return _scattered(self.row_shift.pencil(left, values, entries.shape[1]), entries, self.values.shape[1])
        F, entries = self.rows.taken_back(left), self.rows.entries
        both = np.hstack([entries, entries + np.array([[1], [0]])])
        return _scattered(np.hstack([-np.asarray(values)[:, None] * F, F]), both, self.values.shape[1])

    def influence(self, left: Array, right: Array, lines: Lines | None = None) -> ConvolvedInfluence:
        """Return the gradient; columns are taken back to whole consecutive blocks first."""
        v = _scattered(self.columns.taken_back(right.T), self.columns.entries, self.values.shape[2])
        return super().influence(left, v.T, lines)

    def row_blocks(self, P: Array) -> RealArray | None:
        """Return a left factor (rows, k) by block rows, (blocks, l', k); None where the blocks are not whole."""
        return super().row_blocks(P) if self.rows.structured else None

    def column_blocks(self, Q: Array) -> RealArray | None:
        """Return a right factor (columns, k) by block columns, (blocks, m', k); None where the blocks are not whole."""
        return super().column_blocks(Q) if self.columns.structured else None

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return E_l' H(k) X of the uncompressed, unweighted first block row: C = E_l' H(0) Q d^-1/2 (Eqs. 28, 39)."""
        t, inputs = self.columns.entries
        row = self._column_values[t + k, :, inputs]
        return np.asarray(self.columns.apply(row).T @ right)

    def first_block_column(self, *, tall: bool = False) -> RealArray:
        """Return H(0) E_m, or that of `tall()`, with the inputs themselves: B of the companion forms (Eqs. 53, 54, 65)."""
        rows = self._tall_rows if tall else self.rows
        s, outputs = rows.entries
        return rows.apply(self._row_values[s, outputs])

    def first_columns(self, factors: Factors) -> RealArray:
        """Return X (m, k) such that B = d^1/2 X' (Eqs. 28, 37): the first rows of Q, or from P where columns are combined."""
        if self.columns.within is None and self.columns.over is None:
            inputs = self.response.values.shape[2]
            w = self.columns.weights
            return factors.Q[:inputs] if w is None else factors.Q[:inputs] / w[:inputs, None]
        return self._first_columns_from(factors)


def _scattered(rows: Array, entries: IntArray, channels: int) -> ComplexArray:
    """Return rows (k, entries) summed into whole blocks by shift and channel, (k, channels x blocks)."""
    blocks = np.zeros((int(entries[0].max()) + 1, channels, len(rows)), dtype=complex)
    np.add.at(blocks, (entries[0], entries[1]), rows.T)
    return np.ascontiguousarray(blocks.reshape(-1, len(rows)).T)
