"""The rows of a block Hankel matrix in modal coordinates by sums over the samples: the left factor is never made.

Block i of the row factor is the samples Y(i), Y(i + 1), ... times one small array X, so that every sum over blocks with weights g_i is
a sum of the samples with the convolution of g and X.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import fft

from modalscope.blocks.block_hankel import BlockHankel
from modalscope.blocks.evolved import Agreement, Compared, compared, squares
from modalscope.blocks.factor import Factors
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["RowSums", "projected_by_gram"]


def projected_by_gram(matrix: BlockHankel, factors: Factors) -> RealArray:
    """Return K = P' H(1) Q = d^-1 Q' (H(0)' H(1)) Q: all block columns of H(0)' H(1) but the last are those of the Gram matrix.

    Parameters
    ----------
    matrix : BlockHankel
        H(0).
    factors : Factors
        With the Gram matrix H(0)' H(0).
    """
    gram, Q, m = factors.gram, factors.Q, matrix.values.shape[2]
    assert gram is not None
    first, columns = matrix.first + matrix.block_columns, matrix.shape[0]
    last = matrix.values[first : first + matrix.block_rows].reshape(columns, m)
    product = gram[:, m:] @ Q[:-m] + matrix.transposed_times(last) @ Q[-m:]
    return np.asarray(Q.T @ product / factors.d[:, None])


@dataclass(frozen=True, eq=False, slots=True)
class RowSums:
    """Rows P d^a of a Hankel matrix beside what modes must give there.

    Parameters
    ----------
    matrix : BlockHankel
    right : array of complex, (columns, k)
        X = Q d^-1 times the states: H X are the rows in modal coordinates.
    states : array of complex, (N, k)
        Those of the orthonormal P, which tell the size of the rows.
    first : array of complex, (l, k)
        The block that starts the evolution.
    evolution : array of complex, (K, k)
        g_k.
    """

    matrix: BlockHankel
    right: ComplexArray
    states: ComplexArray
    first: ComplexArray
    evolution: ComplexArray

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare all blocks by their sums, and by agreement the one that `step` chooses; see `ModalSide`."""
        chosen = step(self.evolution)
        summed, at = self._sums(chosen).transpose(1, 0, 2)
        inner = np.sum(self.first * summed.conj(), axis=0)
        return compared(inner, squares(self.states), at, self.first, self.evolution, chosen, agreement)

    def _sums(self, chosen: Array) -> ComplexArray:
        """Return sum_i conj(g_i) H_i X over the block rows H_i, and H_i X of the one that is chosen, (l, 2, k)."""
        blocks, k = self.evolution.shape
        _, outputs, inputs = self.matrix.values.shape
        X = self.right.reshape(-1, inputs, k)
        length = blocks + len(X) - 1
        whole = fft.next_fast_len(length)  # the sum of two numbers of blocks is often prime
        spectrum = fft.fft(self.evolution.conj(), n=whole, axis=0)[:, None] * fft.fft(X, n=whole, axis=0)
        filters = np.zeros((length, inputs, 2, k), dtype=complex)
        filters[:, :, 0] = fft.ifft(spectrum, axis=0)[:length]
        for j, start in enumerate(chosen):  # a sum over one block alone is that block's samples
            filters[start : start + len(X), :, 1, j] = X[:, :, j]
        product = self.matrix.samples_times(filters.reshape(length * inputs, -1).view(np.float64))
        return np.asarray(np.ascontiguousarray(product).view(np.complex128).reshape(outputs, 2, k))
