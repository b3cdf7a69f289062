"""Base classes of data matrices whose block rows are samples, and Gram matrices of all windows of a record by their structure."""

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


#: Maximum condition of a Gram matrix for nine digits of its Cholesky factor; above it rows are orthogonalized.
_MAX_CONDITION = 1e7


def window_gram(run: RealArray, blocks: int) -> RealArray:
    """Return G[i, j] = sum_t y(t + i) y(t + j)', i, j < blocks, over all t such that a window lies inside, (blocks l) square.

    The first block row takes `blocks` products of the record with itself, the others an update each,
    G[i + 1, j + 1] = G[i, j] - y(i) y(j)' + y(T + i) y(T + j)', with T windows.

    `run` (N, l). `blocks`: samples in a window.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((40, 2))
    >>> windows = np.lib.stride_tricks.sliding_window_view(y, 3, axis=0).transpose(0, 2, 1).reshape(-1, 6)
    >>> bool(np.allclose(window_gram(y, 3), windows.T @ windows))
    True
    """
    samples, channels = run.shape
    count = samples - blocks + 1
    gram = np.zeros((blocks * channels, blocks * channels))
    for j in range(blocks):
        gram[:channels, j * channels : (j + 1) * channels] = run[:count].T @ run[j : j + count]
    first, behind = run[: blocks - 1].ravel(), run[count:].ravel()  # samples that leave, and that enter
    for i in range(blocks - 1):
        row, below = slice(i * channels, (i + 1) * channels), slice((i + 1) * channels, (i + 2) * channels)
        update = np.outer(behind[row], behind[i * channels :]) - np.outer(first[row], first[i * channels :])
        gram[below, (i + 1) * channels :] = gram[row, i * channels : -channels] + update
    return np.asarray(np.triu(gram) + np.triu(gram, 1).T)


def triangle_of(gram: RealArray) -> RealArray | None:
    """Return L with L L' = G, rows brought to one size first; None where the condition leaves too few digits."""
    size = np.sqrt(np.diag(gram))
    if not np.all(size > 0):
        return None
    level = gram / np.outer(size, size)
    try:
        L = sla.cholesky(level, lower=True, check_finite=False)
    except sla.LinAlgError:
        return None
    inverse, _ = sla.lapack.dpocon(L, np.linalg.norm(level, 1), uplo="L")
    return np.asarray(size[:, None] * L) if inverse * _MAX_CONDITION > 1 else None
