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
        blocks, k = self.evolution.shape
        chosen = step(self.evolution)
        alone = np.zeros((blocks, k))
        alone[chosen, np.arange(k)] = 1
        summed, at = np.split(self._weighted(np.hstack([self.evolution.conj(), alone])), 2, axis=1)
        inner = np.sum(self.first * summed.conj(), axis=0)
        return compared(inner, squares(self.states), at, self.first, self.evolution, chosen, agreement)

    def _weighted(self, weights: Array) -> ComplexArray:
        """Return sum_i w_i H_i X of the block rows H_i, (l, count), the columns of X as often as there are weights."""
        blocks, count = weights.shape
        _, outputs, inputs = self.matrix.values.shape
        X = self.right.reshape(-1, inputs, self.right.shape[1])
        length = blocks + len(X) - 1
        whole = fft.next_fast_len(length)  # the sum of two numbers of blocks is often prime
        spectrum = (
            fft.fft(weights, n=whole, axis=0).reshape(whole, 1, -1, X.shape[2])
            * fft.fft(X, n=whole, axis=0)[:, :, None]
        )
        filters = np.ascontiguousarray(fft.ifft(spectrum, axis=0)[:length]).reshape(length * inputs, count)
        product = self.matrix.samples_times(filters.view(np.float64))
        return np.asarray(np.ascontiguousarray(product).view(np.complex128).reshape(outputs, count))
