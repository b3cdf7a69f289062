"""Base classes of data matrices whose block rows are samples."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import scipy.linalg as sla

from modalscope.identification.matrices.full import FullMatrix
from modalscope.identification.matrices.hankel import SampledMatrix
from modalscope.identification.matrices.matrix import RowShift
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import powers_of
from modalscope.numerics.operators import DenseMatrix

#: Maximum growth over all blocks, as an exponent of e: its square leaves room for sums.
_MAX_EXPONENT = 300.0


class FullSampled(FullMatrix, SampledMatrix):
    """Block rows are samples, down which modes run by powers of their poles."""

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return z^k for blocks k = 0, 1, ...: how a mode runs down the rows; what outgrows all numbers is held below them."""
        most = np.exp(_MAX_EXPONENT / max(blocks, 1))
        return powers_of(np.asarray(poles) * (most / np.maximum(np.abs(poles), most)), blocks)


class SampleRows(FullSampled):
    """Block row k holds what is known of the outputs k samples on; `triangle` is the matrix times an orthonormal one."""

    @property
    @abstractmethod
    def triangle(self) -> RealArray:
        """All block rows, (l (q + 1), k)."""

    def tall(self) -> DenseMatrix:
        """Return all q + 1 block rows."""
        return DenseMatrix(self.triangle)

    def shifted(self, k: int) -> DenseMatrix:
        """Return H(k): the first q block rows, or the last."""
        return DenseMatrix(self.row_shift.split(self.triangle)[k])

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1."""
        return RowShift.by_block(self.outputs, self.block_rows)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return the first block row of H(k), times X: C = first_rows(Q d^-1/2)."""
        return np.asarray(self.triangle[k * self.outputs : (k + 1) * self.outputs] @ right)

    def row_blocks(self, P: Array) -> RealArray:
        """Return a left factor (rows, k) by block rows, (blocks, l, k)."""
        return np.asarray(P.reshape(-1, self.outputs, P.shape[1]))


class MixedRows(SampleRows):
    """Rows that are whitened before they are factored: L^-1 times the triangle, and L takes the rows back to outputs."""

    @property
    @abstractmethod
    def mixing(self) -> RealArray:
        """L (l (q + 1), l (q + 1)), lower triangular: what takes whitened rows back to outputs."""

    def tall(self) -> DenseMatrix:
        """Return all q + 1 block rows, whitened."""
        return DenseMatrix(sla.solve_triangular(self.mixing, self.triangle, lower=True, check_finite=False))

    def shifted(self, k: int) -> DenseMatrix:
        """Return H(k): the first q block rows, or the last, whitened by those of the first."""
        rows = self.block_rows * self.outputs
        part = self.triangle[k * self.outputs : k * self.outputs + rows]
        return DenseMatrix(sla.solve_triangular(self.mixing[:rows, :rows], part, lower=True, check_finite=False))

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1 of rows that are mapped back to outputs first."""
        return RowShift.by_block(self.outputs, self.block_rows, self.mixing)

    def row_blocks(self, P: Array) -> RealArray:
        """Return a left factor (rows, k) by block rows in outputs, (blocks, l, k)."""
        return super().row_blocks(self.mixing[: len(P), : len(P)] @ P)
