"""Block Hankel matrices whose products, Gram matrices and sides are computed by structure, with what is combined within blocks.

Nothing of the matrix' size is formed: products run over slices of the samples, or by Fourier transforms
(`modalscope.identification.fast.block_hankel`). What acts alike in every block (a weight per channel, a compression T_0) is applied to the
samples and keeps the structure. The plain form is `modalscope.identification.matrices.hankel`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.data.responses import ImpulseResponse
from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.identification.fast.factorizations import costs_of
from modalscope.identification.fast.row_sums import RowSums
from modalscope.identification.matrices.evolved import Evolved, ModalSide
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import FullMatrix
from modalscope.identification.matrices.hankel import Hankel, TurnedHankel
from modalscope.identification.matrices.influence import ConvolvedInfluence, Influence, Lines, convolved
from modalscope.identification.matrices.matrix import Eigen, ModalFit, RowShift, Triple
from modalscope.identification.matrices.sampled_rows import FullSampled
from modalscope.identification.matrices.sides import Side, adds_channels
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.operators import Operator, real_times

#: The long side becomes rows where that saves this many operations: five milliseconds.
_MIN_SAVED_OPERATIONS = 2e8


def cheaper_windows(
    response: ImpulseResponse, order: int, lying: tuple[int, int], standing: tuple[int, int]
) -> tuple[int, int]:
    """Return the block sizes that cost less to factor."""
    like = np.broadcast_to(0.0, response.values.shape)
    costs = [costs_of(BlockHankel(like, *sizes), order)[0] for sizes in (lying, standing)]
    saved = costs[0].operations - costs[0].passing - costs[1].operations + costs[1].passing
    return standing if saved > _MIN_SAVED_OPERATIONS else lying


@dataclass(frozen=True, eq=False)
class StructuredHankel(FullSampled, Hankel):
    """A block Hankel matrix of whole consecutive blocks (made by `hankel`).

    `rows`, `columns`: what is combined within the blocks of each side.
    """

    rows: Side
    columns: Side
    by_mode = True

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

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1 for factors of `tall()`."""
        return RowShift.by_block(self.values.shape[1], self.block_rows)

    def projected(self, factors: Factors) -> RealArray:
        """K = P' H(1) Q, from the Gram matrix where the left vectors are not computed."""
        if not factors.unmade:
            return super().projected(factors)
        # d^-1 Q' (H(0)' H(1)) Q: the block columns of H(0)' H(1) but the last are those of the Gram matrix H(0)' H(0)
        gram, Q, m, r, s = factors.gram, factors.Q, self.values.shape[2], self.block_rows, self.block_columns
        assert gram is not None
        last = self.values[s : s + r].reshape(-1, m)
        product = gram[:, m:] @ Q[:-m] + self.shifted(0).transposed_times(last) @ Q[-m:]
        return np.asarray(Q.T @ product / factors.d[:, None])

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
        T = self.columns.within
        first = participation.T if T is None else T @ participation.T
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
                "Compression by sums loses modes whose sum over the channels vanishes (antisymmetric ones, and all but one "
                "of repeated ones), and raises noise",
            )
        return ()


@dataclass(frozen=True, eq=False)
class FullTurnedHankel(FullMatrix, TurnedHankel):
    """A Hankel matrix of the transposed response, with its sides and its influence in their own places."""

    inner: StructuredHankel
    by_mode = True

    def as_measured(self, influence: Influence) -> Influence:
        """Return the gradient by the response as it was measured."""
        return influence.transposed()

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the columns of the transposed response's matrix: the side of the outputs."""
        return self.inner.column_side(model, eigen.dual(), self._exchanged(eigen, fit))

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the rows of the transposed response's matrix: the side of the inputs."""
        return self.inner.row_side(model, eigen.dual(), self._exchanged(eigen, fit))

    def _exchanged(self, eigen: Eigen, fit: ModalFit) -> ModalFit:
        """Return shapes and participation in each other's places; the steps to the first sample stay on the side of the columns."""
        late = eigen.values[:, None] ** self.response.first_sample
        return ModalFit((fit.participation * late).T, fit.shapes.T / late, fit.terms.transpose(0, 2, 1))
