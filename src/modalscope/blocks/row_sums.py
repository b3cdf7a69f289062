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

#: Rows that lie within this part of the columns of each other are taken together: a quarter more is multiplied, mostly by zeros.
_NEAR = 4


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
        inner = np.sum(self.first * self._sums().conj(), axis=0)
        return compared(inner, squares(self.states), self._at(chosen), self.first, self.evolution, chosen, agreement)

    @property
    def _blocks(self) -> ComplexArray:
        """X by block columns, (blocks, m, k)."""
        return self.right.reshape(-1, self.matrix.values.shape[2], self.right.shape[1])

    def _sums(self) -> ComplexArray:
        """Return sum_i conj(g_i) H_i X over the block rows H_i, (l, k)."""
        X = self._blocks
        length = len(self.evolution) + len(X) - 1
        whole = fft.next_fast_len(length)  # the sum of two numbers of blocks is often prime
        spectrum = fft.fft(X, n=whole, axis=0)
        spectrum *= fft.fft(self.evolution.conj(), n=whole, axis=0)[:, None]
        return self._of_samples(fft.ifft(spectrum, axis=0, overwrite_x=True)[:length], 0)

    def _at(self, chosen: Array) -> ComplexArray:
        """Return H_i X of the block row that is chosen for each mode, (l, k): of rows close to each other by one product."""
        X, by_row = self._blocks, np.argsort(chosen, kind="stable")
        found, near = np.empty((self.matrix.values.shape[1], len(chosen)), dtype=complex), max(len(X) // _NEAR, 1)
        while by_row.size:
            first = chosen[by_row[0]]
            some = by_row[chosen[by_row] < first + near]
            filters = np.zeros((chosen[some[-1]] - first + len(X), *X.shape[1:-1], some.size), dtype=complex)
            for j, k in enumerate(some):
                start = chosen[k] - first
                filters[start : start + len(X), :, j] = X[:, :, k]
            found[:, some] = self._of_samples(filters, int(first))
            by_row = by_row[some.size :]
        return found

    def _of_samples(self, filters: ComplexArray, first: int) -> ComplexArray:
        """Return the samples from `first` on times filters (samples, m, k), (l, k)."""
        columns = np.ascontiguousarray(filters).reshape(-1, filters.shape[2]).view(np.float64)
        product = self.matrix.samples_times(columns, first)
        return np.asarray(np.ascontiguousarray(product).view(np.complex128))
