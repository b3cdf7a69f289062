"""What projections of records in time have in common: block rows of samples, and one triangular factor that stands in for the times."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.operators import DenseMatrix
from modalscope.blocks.sampled import SampledMatrix
from modalscope.blocks.shift import RowShift
from modalscope.model.checks import Array, RealArray

__all__ = ["MixedRows", "SampleRows"]


class SampleRows(SampledMatrix):
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
        """E0 drops the last block, E1 the first."""
        before = np.arange(self.block_rows * self.outputs)
        return RowShift(block=self.outputs, before=before, after=before + self.outputs)

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
        """E0 drops the last block, E1 the first, of rows that are taken back to outputs first."""
        before = np.arange(self.block_rows * self.outputs)
        return RowShift(block=self.outputs, before=before, after=before + self.outputs, mixing=self.mixing)

    def row_blocks(self, P: Array) -> RealArray:
        """Return a left factor (rows, k) by block rows in outputs, (blocks, l, k)."""
        return super().row_blocks(self.mixing[: len(P), : len(P)] @ P)
