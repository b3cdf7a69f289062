"""Block Hankel matrices of Markov parameters (Eq. 17): whole consecutive blocks, whose structure every product uses.

Block (j, i) of H(k) is Y(j + k + i) = C A^j A^k A^i B. What acts alike in every block (a weight a channel, a compression T_0) is applied
to the samples and keeps that structure; anything else is a `GeneralHankel`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.block_hankel import BlockHankel
from modalscope.blocks.compression import adds_channels
from modalscope.blocks.convolved import ConvolvedInfluence, convolved
from modalscope.blocks.costs import Cost, costs_of
from modalscope.blocks.evolved import Evolved, ModalSide
from modalscope.blocks.factor import Factors
from modalscope.blocks.influence import Lines
from modalscope.blocks.layout import block_shifts
from modalscope.blocks.operators import Operator
from modalscope.blocks.real_products import real_times
from modalscope.blocks.row_sums import RowSums, projected_by_gram
from modalscope.blocks.sample_fit import fit_of_samples
from modalscope.blocks.sampled import SampledMatrix
from modalscope.blocks.shift import RowShift
from modalscope.blocks.side import Side, side_of
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.model.checks import Array, DataError, RealArray
from modalscope.model.impulse import ImpulseResponse

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
    rows = side_of("row", outputs, s, row_subsets, row_weights, row_compression)
    columns = side_of("column", inputs, t, column_subsets, column_weights, column_compression)
    if rows.structured and columns.structured:
        return Hankel(response, rows, columns)
    from modalscope.blocks.general_hankel import GeneralHankel

    return GeneralHankel(response, rows, columns)


@dataclass(frozen=True, eq=False)
class Hankel(SampledMatrix):
    """A block Hankel matrix of whole consecutive blocks (made by `hankel`).

    Parameters
    ----------
    response : ImpulseResponse
    rows, columns : Side
        What is combined within the blocks of each side.
    """

    response: ImpulseResponse
    rows: Side
    columns: Side
    by_mode = True

    @property
    def judged(self) -> ImpulseResponse:
        """The samples themselves."""
        return self.response

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
    def values(self) -> RealArray:
        """Samples (N, l', m'), combined within blocks on both sides."""
        T = self.rows.within
        return self._column_values if T is None else np.asarray(T @ self._column_values)

    @cached_property
    def _rows(self) -> BlockHankel:
        """The matrix of `tall()`, kept for all orders: its samples lie as products take them."""
        return BlockHankel(self.values, self.block_rows + 1, self.block_columns)

    def shifted(self, k: int) -> Operator:
        """Return H(k)."""
        return BlockHankel(self.values, self.block_rows, self.block_columns, first=k)

    def tall(self) -> Operator:
        """Return H(0) with one more block row, the rows of H(0) and of H(1) together."""
        return BlockHankel(self.values, self.block_rows + 1, self.block_columns)

    def costs(self, wanted: int) -> tuple[Cost, ...]:
        """Return what the ways of factoring it cost; see `DataMatrix.costs`."""
        return costs_of(self.tall(), wanted)

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1 for factors of `tall()`: E0 drops the last block, E1 the first (Eq. 57, with the words the right way)."""
        block = self.values.shape[1]
        before = np.arange(self.block_rows * block)
        return RowShift(block=block, before=before, after=before + block)

    def projected(self, factors: Factors) -> RealArray:
        """K = P' H(1) Q: of left vectors that are not made, from the Gram matrix."""
        if factors.unmade:
            return projected_by_gram(BlockHankel(self.values, self.block_rows, self.block_columns), factors)
        return super().projected(factors)

    def row_blocks(self, P: Array) -> RealArray | None:
        """Return a left factor (rows, k) by block rows, (blocks, l', k)."""
        return P.reshape(-1, self.values.shape[1], P.shape[1])

    def column_blocks(self, Q: Array) -> RealArray | None:
        """Return a right factor (columns, k) by block columns, (blocks, m', k)."""
        return Q.reshape(-1, self.values.shape[2], Q.shape[1])

    def first_block(self, shapes: Array) -> Array:
        """Return T_0 C: what the first block row of the factor V holds for shapes (l, n)."""
        T = self.rows.within
        return np.asarray(shapes) if T is None else np.asarray(T @ shapes)

    def first_block_of_inputs(self, participation: Array) -> Array:
        """Return B T_0': what the first block column of the factor W holds for participation (n, m)."""
        T = self.columns.within
        return np.asarray(participation) if T is None else np.asarray(participation @ T.T)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return E_l' H(k) X of the uncompressed first block row: C = E_l' H(0) Q d^-1/2 (Eqs. 28, 39)."""
        row = self._column_values[k : k + self.block_columns].transpose(0, 2, 1)
        return np.asarray(row.reshape(-1, self.outputs).T @ right)

    def first_block_column(self, *, tall: bool = False) -> RealArray:
        """Return H(0) E_m, or that of `tall()`, with the inputs themselves: B of the companion forms (Eqs. 53, 54, 65)."""
        return self._row_values[: self.block_rows + tall].reshape(-1, self.response.values.shape[2])

    def first_columns(self, factors: Factors) -> RealArray:
        """Return X (m, k) such that B = d^1/2 X' (Eqs. 28, 37): the first rows of Q, or from P where columns are combined."""
        if self.columns.within is None:
            return factors.Q[: self.response.values.shape[2]]
        return self._first_columns_from(factors)

    def _first_columns_from(self, factors: Factors) -> RealArray:
        """Return X from the left factor, by the first block column before anything was combined."""
        tall = factors.left.shape[0] != self.rows.size
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.first_block_column(tall=tall).T @ factors.P / factors.d)

    def influence(self, left: Array, right: Array, lines: Lines | None = None) -> ConvolvedInfluence:
        """Return g_j[t] = sum_(a + b = t) L_j[a] (x) v_j[b], with what was combined within blocks taken back to the channels."""
        _, rows, columns = self.values.shape
        L, v = left.reshape(len(left), -1, rows), right.T.reshape(len(left), -1, columns)
        T, U = self.rows.within, self.columns.within
        return convolved(L if T is None else L @ T, v if U is None else v @ U)

    @property
    def dt(self) -> float:
        """Sampling interval, seconds."""
        return 1 / self.response.sampling_rate

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X and participation X^-1 B, referred to the impulse (Eqs. 15-16)."""
        return fit_of_samples(self.response, model, eigen)

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return V = P d^a against c_j z^k; of left vectors that are not made by sums over the samples."""
        factors, n = model.factors, model.rank
        if factors is None or not factors.unmade:
            return super().row_side(model, eigen, fit)
        blocks = factors.left.shape[0] // self.values.shape[1]
        states = factors.d[:n, None] ** model.power * eigen.vectors
        right = real_times(factors.Q[:, :n], states / factors.d[:n, None])
        return RowSums(self._rows, right, states, self.first_block(fit.shapes), self.evolution(eigen.values, blocks))

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return W = d^(1-a) Q' against b_j z^k; its columns start from the first sample there is, not from the impulse."""
        if model.factors is None:
            return None
        n = model.rank
        blocks = self.column_blocks(model.factors.Q[:, :n])
        if blocks is None:
            return None
        participation = fit.participation * eigen.values[:, None] ** self.response.first_sample
        states = model.factors.d[:n, None] ** (1 - model.power) * eigen.left.T
        first = self.first_block_of_inputs(participation).T
        return Evolved(blocks, states, first, self.evolution(eigen.values, len(blocks)))

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        shape = f"{self.block_rows} x {self.block_columns} blocks of {self.response.values.shape[1]} x {self.response.values.shape[2]}"
        extra = [
            f"{name} {what}" for name, side in (("rows", self.rows), ("columns", self.columns)) for what in side.words()
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
