"""Block Hankel matrices of Markov parameters, in full generality (Eqs. 17, 20-21).

Block (j, i) of H(k) is Y_{J_j I_i}(s_j + k + t_i) = C_{J_j} A^{s_j} A^k A^{t_i} B_{I_i}: any sensors in every block row but the
first, any inputs in every block column but the first, any shifts. What acts alike in every block (a weight a channel, a compression
T_0) is applied to the samples, and whole consecutive blocks keep their structure; anything else makes an array.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.compression import adds_channels
from modalscope.blocks.factor import Factors
from modalscope.blocks.layout import block_shifts
from modalscope.blocks.matrix import Evolution, RowShift
from modalscope.blocks.operators import BlockHankel, DenseMatrix, Operator
from modalscope.blocks.side import Side, side_of
from modalscope.model.checks import Array, ComplexArray, DataError, RealArray
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import powers_of, to_continuous, to_discrete

__all__ = ["Hankel", "hankel"]


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
) -> Hankel:
    """Stack Markov parameters into H(0) and H(1); block (j, i) of H(k) is Y(s_j + k + t_i).

    Parameters
    ----------
    response : ImpulseResponse
        values of shape (samples, outputs, inputs).
    block_rows, block_columns : int
        Blocks in a column and in a row of H(0); block_rows + block_columns samples are read.
    row_shifts, column_shifts : sequence of int, optional
        s_j and t_i, increasing from 0; 0, 1, 2, ... by default. They take the place of block_rows and block_columns.
    row_subsets, column_subsets : sequence of sequences of int, optional
        Outputs in each block row and inputs in each block column; the first must be whole.
    row_weights, column_weights : array, optional
        Positive weights: one an output (an input), or one a row (a column) of H(0).
    row_compression, column_compression : array, optional
        T_0 (q, l), applied within every block row, or T_r (q, rows of H(0)), applied to whole columns after the weights (Eq. 31);
        the same for columns. `modalscope.blocks.compression` makes them.

    Returns
    -------
    Hankel

    Raises
    ------
    DataError
        A response that is too short, shifts with a common factor, subsets whose first block is not whole, weights or
        compressions that do not fit.

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
    need = s[-1] + t[-1] + 2
    if need > samples:
        raise DataError(
            f"hankel(block_rows={len(s)}, block_columns={len(t)}) reads samples 0 to {need - 1}",
            f"the response has {samples}",
            f"Lower block_rows + block_columns to at most {samples}, or measure a longer response."
            if row_shifts is None and column_shifts is None
            else f"Lower the last shifts to {samples - 2} in all, or measure a longer response.",
        )
    return Hankel(
        response,
        side_of("row", outputs, s, row_subsets, row_weights, row_compression),
        side_of("column", inputs, t, column_subsets, column_weights, column_compression),
    )


@dataclass(frozen=True, eq=False)
class Hankel:
    """A block Hankel matrix: which samples, outputs and inputs its rows and columns are (made by `hankel`).

    Parameters
    ----------
    response : ImpulseResponse
    rows, columns : Side
    """

    response: ImpulseResponse
    rows: Side
    columns: Side

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return int(self.response.values.shape[1])

    @property
    def block_rows(self) -> int:
        """Number of different row shifts in H(0)."""
        return int(self.rows.shifts.size)

    @property
    def block_columns(self) -> int:
        """Number of different column shifts."""
        return int(self.columns.shifts.size)

    @cached_property
    def _column_values(self) -> RealArray:
        """Samples (N, l, m'), combined within block columns only."""
        T = self.columns.within
        return self.response.values if T is None else self.response.values @ T.T

    @cached_property
    def _row_values(self) -> RealArray:
        """Samples (N, l', m), combined within block rows only."""
        T = self.rows.within
        return self.response.values if T is None else np.asarray(T @ self.response.values)

    @cached_property
    def _values(self) -> RealArray:
        """Samples (N, l', m'), combined within blocks on both sides."""
        T = self.rows.within
        return self._column_values if T is None else np.asarray(T @ self._column_values)

    def _matrix(self, rows: Side, k: int) -> Operator:
        if rows.structured and self.columns.structured:
            return BlockHankel(self._values, rows.shifts.size, self.block_columns, first=k)
        (s, outputs), (t, inputs) = rows.entries, self.columns.entries
        H = rows.apply(self._values[s[:, None] + k + t, outputs[:, None], inputs])
        return DenseMatrix(np.ascontiguousarray(self.columns.apply(H.T).T))

    def shifted(self, k: int) -> Operator:
        """Return H(k), weighted and compressed."""
        return self._matrix(self.rows, k)

    def tall(self) -> Operator:
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
        """E0 and E1 for factors of `tall()`: E0 drops the last block, E1 the first (Eq. 57, with the words the right way)."""
        side = self._tall_rows
        place = {(int(a), int(b)): i for i, (a, b) in enumerate(side.entries.T)}
        pairs = [(i, place[(a + 1, b)]) for (a, b), i in place.items() if (a + 1, b) in place]
        before, after = np.array(pairs).T
        whole = self.rows.whole
        return RowShift(block=self._values.shape[1], before=before, after=after, weight=side.weights, whole=whole)

    def row_blocks(self, P: Array) -> RealArray | None:
        """Return a left factor (rows, k) by block rows, (blocks, l', k); None where the blocks are not whole."""
        return P.reshape(-1, self._values.shape[1], P.shape[1]) if self.rows.structured else None

    def column_blocks(self, Q: Array) -> RealArray | None:
        """Return a right factor (columns, k) by block columns, (blocks, m', k); None where the blocks are not whole."""
        return Q.reshape(-1, self._values.shape[2], Q.shape[1]) if self.columns.structured else None

    def first_block(self, shapes: Array) -> Array:
        """Return T_0 C: what the first block row of the factor V holds for shapes (l, n)."""
        T = self.rows.within
        return np.asarray(shapes) if T is None else np.asarray(T @ shapes)

    def first_block_of_inputs(self, participation: Array) -> Array:
        """Return B T_0': what the first block column of the factor W holds for participation (n, m)."""
        T = self.columns.within
        return np.asarray(participation) if T is None else np.asarray(participation @ T.T)

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
        tall = factors.P.shape[0] != self.rows.size
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.first_block_column(tall=tall).T @ factors.P / factors.d)

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles ln(z) fs, rad/s."""
        return to_continuous(poles, self.dt)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles of the sampled system, exp(s / fs)."""
        return to_discrete(poles, self.dt)

    @property
    def dt(self) -> float:
        """Sampling interval, seconds."""
        return 1 / self.response.sampling_rate

    def evolution(self, poles: Array, blocks: int) -> Evolution:
        """Return z^k for blocks k = 0, 1, ...: how a mode runs down the rows."""
        return powers_of(poles, blocks)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        shape = f"{self.block_rows} x {self.block_columns} blocks of {self.response.values.shape[1]} x {self.response.values.shape[2]}"
        extra = [
            f"{name} {what}"
            for name, side in (("rows", self.rows), ("columns", self.columns))
            for what, there in (
                ("chosen", not side.whole),
                ("combined or weighted within blocks", side.within is not None),
                ("weighted", side.weights is not None),
                ("compressed", side.over is not None),
            )
            if there
        ]
        return f"Hankel matrix of {shape}" + (f", {', '.join(extra)}" if extra else "")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a result made from this matrix must say."""
        maps = (self.rows.within, self.rows.over, self.columns.within, self.columns.over)
        if any(T is not None and adds_channels(T) for T in maps):
            return (
                "compression by sums: modes whose sum over the added channels vanishes (antisymmetric ones, and all but one "
                "of repeated ones) are lost, and noise weighs more",
            )
        return ()
