"""Block Hankel matrices whose blocks are chosen, weighted or combined as they like, and what makes one of either kind (Eqs. 17-21, 31)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.responses import ImpulseResponse
from modalscope.identification.fast.structured_hankel import FullTurnedHankel, StructuredHankel
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import pencil_of
from modalscope.identification.matrices.hankel import transposed
from modalscope.identification.matrices.influence import ConvolvedInfluence, Lines
from modalscope.identification.matrices.matrix import RowShift
from modalscope.identification.matrices.sides import Side, block_shifts, side_of
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import DenseMatrix


def hankel(
    response: ImpulseResponse,
    *,
    block_rows: int | None = None,
    block_columns: int | None = None,
    row_shifts: Sequence[int] | None = None,
    column_shifts: Sequence[int] | None = None,
    row_subsets: Sequence[Sequence[int]] | None = None,
    column_subsets: Sequence[Sequence[int]] | None = None,
    row_weights: ArrayLike | None = None,
    column_weights: ArrayLike | None = None,
    row_compression: ArrayLike | None = None,
    column_compression: ArrayLike | None = None,
) -> StructuredHankel:
    """Stack Markov parameters into H(0) and H(1); block (j, i) of H(k) is Y(s_j + k + t_i).

    `response`: values of shape (samples, outputs, inputs). `block_rows`, `block_columns`: blocks in a column and in a row of H(0);
    block_rows + block_columns samples are read. `row_shifts`, `column_shifts`: s_j and t_i, increasing from 0; 0, 1, 2, ... by default.
    They take the place of block_rows and block_columns. `row_subsets`, `column_subsets`: outputs in each block row and inputs in each
    block column; the first must be whole. `row_weights`, `column_weights`: positive weights: one per output (an input), or one per row (a
    column) of H(0). `row_compression`, `column_compression`: t_0 (q, l), applied within every block row, or T_r (q, rows of H(0)),
    applied to whole columns after the weights (Eq. 31); the same for columns. `modalscope.identification.matrices.hankel` makes them.

    Raises `DataError`: A response that is too short, shifts with a common factor, subsets whose first block is not whole, weights or
    compressions that do not fit.

    Returns
    -------
    StructuredHankel

    Notes
    -----
    Source: the report, Eqs. 17, 20-21 and 31.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> response = chain5().impulse_response(12, outputs=[0], inputs=[0])
    >>> hankel(response, block_rows=3, block_columns=4).shifted(1).dense().shape
    (3, 4)
    """
    samples, outputs, inputs = response.values.shape
    s = block_shifts("row_shifts", row_shifts, block_rows, "block_rows")
    t = block_shifts("column_shifts", column_shifts, block_columns, "block_columns")
    need = max(s) + max(t) + 2
    if need > samples:
        raise DataError(
            f"hankel(block_rows={len(s)}, block_columns={len(t)}) reads samples 0 to {need - 1}",
            f"the response has {samples}",
            f"Lower block_rows + block_columns to at most {samples}, or measure a longer response."
            if row_shifts is None and column_shifts is None
            else f"Lower the sum of the last shifts to {samples - 2}, or measure a longer response.",
        )
    rows = side_of("row", outputs, s, row_subsets, row_weights, row_compression)
    columns = side_of("column", inputs, t, column_subsets, column_weights, column_compression)
    kind = StructuredHankel if rows.structured and columns.structured else GeneralHankel
    return kind(response, (rows.shifts.size, columns.shifts.size), rows, columns)


def turned_hankel(
    response: ImpulseResponse, *, block_rows: int, block_columns: int, **general: Any
) -> FullTurnedHankel:
    """Return the matrix of the transposed response: what is asked of rows concerns the columns there."""
    sides = {"row": "column", "column": "row"}
    exchanged = {re.sub("row|column", lambda m: sides[m[0]], name): value for name, value in general.items()}
    inner = hankel(transposed(response), block_rows=block_columns, block_columns=block_rows, **exchanged)
    return FullTurnedHankel(response, inner)


@dataclass(frozen=True, eq=False)
class GeneralHankel(StructuredHankel):
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

        Raises `DataError`: shifts that are not consecutive, or compression over whole columns: A cannot be read off a row shift then.
        """
        return self._matrix(self._tall_rows, 0)

    @cached_property
    def _tall_rows(self) -> Side:
        asked = "a realization from the row shift (alternate, polyreference and prce in this form):"
        others = "use the other form (controllable when this is the observable one), or method='era' or 'least_squares'"
        if self.rows.over is not None:
            raise DataError(
                asked,
                "a compression over whole columns has no row shift",
                f"Compress within blocks (one column per channel), or {others}.",
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
            return _scattered(pencil_of(self.row_shift, left, values, entries.shape[1]), entries, self.values.shape[1])
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
        return np.asarray(self.columns.apply(self._column_values[t + k, :, inputs]).T @ right)

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
