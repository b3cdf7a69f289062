"""Compare the rows of a Hankel matrix with the evolution of modes by sums over the samples: left vectors are never made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import fft

from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.identification.matrices.evolved import Agreement, Compared, compared, squares
from modalscope.numerics.checks import Array, ComplexArray

#: Rows within one in so many of the columns are computed together: a quarter more is multiplied, mostly by zeros.
_GROUPED_ROW_SHARE = 4


@dataclass(frozen=True, eq=False, slots=True)
class RowSums:
    """Rows P d^a of a Hankel matrix, compared with the evolution of modes by sums over the samples.

    `right` (columns, k): X = Q d^-1 times the states: H X are the rows in modal coordinates. `states` (N, k): those of the orthonormal P,
    which tell the size of the rows. `first` (l, k): the block that starts the evolution. `evolution` (K, k): g_k.
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
        sums = np.empty((self.matrix.values.shape[1], len(chosen)), dtype=complex)
        near = max(len(X) // _GROUPED_ROW_SHARE, 1)
        while by_row.size:
            first = chosen[by_row[0]]
            some = by_row[chosen[by_row] < first + near]
            filters = np.zeros((chosen[some[-1]] - first + len(X), *X.shape[1:-1], some.size), dtype=complex)
            for j, k in enumerate(some):
                start = chosen[k] - first
                filters[start : start + len(X), :, j] = X[:, :, k]
            sums[:, some] = self._of_samples(filters, int(first))
            by_row = by_row[some.size :]
        return sums

    def _of_samples(self, filters: ComplexArray, first: int) -> ComplexArray:
        """Return the samples from `first` on times filters (samples, m, k), (l, k)."""
        columns = np.ascontiguousarray(filters).reshape(-1, filters.shape[2]).view(np.float64)
        product = self.matrix.samples_times(columns, first)
        return np.asarray(np.ascontiguousarray(product).view(np.complex128))
