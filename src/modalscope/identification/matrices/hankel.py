"""Block Hankel matrices of Markov parameters (Eq. 17), of whole consecutive blocks or of chosen ones.

Block (j, i) of H(k) is Y(j + k + i) = C A^j A^k A^i B. What acts alike in every block (a weight a channel, a compression T_0) is applied
to the samples and keeps that structure; anything else is a `GeneralHankel`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.responses import ImpulseResponse
from modalscope.identification.matrices.block_hankel import BlockHankel
from modalscope.identification.matrices.evolved import Evolved, ModalSide, RowSums
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import FullMatrix, pencil_of
from modalscope.identification.matrices.influence import ConvolvedInfluence, Influence, Lines, convolved
from modalscope.identification.matrices.matrix import DerivedMatrix, Eigen, ModalFit, RowShift, Triple
from modalscope.identification.matrices.sampled_rows import SampledMatrix
from modalscope.identification.matrices.sides import Side, adds_channels, block_shifts, side_of
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import DenseMatrix, Operator, real_times


def fit_of_samples(response: ImpulseResponse, model: Triple, eigen: Eigen) -> ModalFit:
    """Return shapes C X, participation X^-1 B referred to the impulse (Eqs. 15-16), and the direct term."""
    assert model.B is not None
    participation = eigen.left @ model.B
    if response.first_sample:
        participation = participation / eigen.values[:, None] ** response.first_sample
    feedthrough = response.feedthrough
    direct = np.zeros(response.values.shape[1:]) if feedthrough is None else feedthrough
    return ModalFit(np.asarray(model.C @ eigen.vectors), participation, direct[None])


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

    `response`: values of shape (samples, outputs, inputs). `block_rows`, `block_columns`: blocks in a column and in a row of H(0);
    block_rows + block_columns samples are read. `row_shifts`, `column_shifts`: s_j and t_i, increasing from 0; 0, 1, 2, ... by default.
    They take the place of block_rows and block_columns. `row_subsets`, `column_subsets`: outputs in each block row and inputs in each
    block column; the first must be whole. `row_weights`, `column_weights`: positive weights: one an output (an input), or one a row (a
    column) of H(0). `row_compression`, `column_compression`: t_0 (q, l), applied within every block row, or T_r (q, rows of H(0)),
    applied to whole columns after the weights (Eq. 31); the same for columns. `modalscope.identification.matrices.hankel` makes them.

    Raises `DataError`: A response that is too short, shifts with a common factor, subsets whose first block is not whole, weights or
    compressions that do not fit.

    Returns
    -------
    Hankel

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
    if rows.structured and columns.structured:
        return Hankel(response, rows, columns)

    return GeneralHankel(response, rows, columns)


@dataclass(frozen=True, eq=False)
class Hankel(SampledMatrix):
    """A block Hankel matrix of whole consecutive blocks (made by `hankel`).

    `rows`, `columns`: what is combined within the blocks of each side.
    """

    response: ImpulseResponse
    rows: Side
    columns: Side
    by_mode = True

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

        Raises `DataError`: shifts that are not consecutive, or compression over whole columns: A cannot be read off a row shift then.
        """
        return self._matrix(self._tall_rows, 0)

    @cached_property
    def _tall_rows(self) -> Side:
        asked = "a realization from the row shift was asked (alternate, polyreference and prce in this form)"
        others = "use the other form (controllable when this is the observable one), or method='era' or 'least_squares'"
        if self.rows.over is not None:
            raise DataError(
                asked,
                "a compression over whole columns has no row shift",
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


@dataclass(frozen=True, eq=False)
class TurnedHankel(FullMatrix, DerivedMatrix):
    """A Hankel matrix of the transposed response, whose models are turned back: (A, B, C) -> (A', C', B').

    `response`: as it was measured. `inner`: of the transposed response.
    """

    response: ImpulseResponse
    inner: Hankel
    by_mode = True

    @property
    def observable(self) -> Hankel:
        """The Hankel matrix of the transposed response, which is factored."""
        return self.inner

    @property
    def block_rows(self) -> int:
        """Blocks on the side of the outputs."""
        return self.inner.block_columns

    def model(self, triple: Triple) -> Triple:
        """Return the model with inputs and outputs in their own places."""
        return triple.dual()

    def as_measured(self, influence: Influence) -> Influence:
        """Return the gradient by the response as it was measured."""
        return influence.transposed()

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X and participation X^-1 B, referred to the impulse."""
        return fit_of_samples(self.response, model, eigen)

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
