"""Matrices known by their products: a block Hankel matrix that is never formed, and a plain array."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from modalscope.model.checks import Array, RealArray

__all__ = ["BlockHankel", "DenseMatrix", "Operator"]


class Operator(Protocol):
    """What a factorization may ask of a matrix."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""

    def dense(self) -> RealArray:
        """The matrix as an array."""

    def times(self, right: Array) -> RealArray:
        """H X."""

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z."""

    def gram(self) -> RealArray | None:
        """H' H when structure makes it cheap, else None."""

    def transposed(self) -> Operator:
        """H'."""

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows from first to last, about `rows` at a time."""


@dataclass(frozen=True, eq=False)
class DenseMatrix:
    """An array that answers as an operator."""

    array: RealArray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.array.shape
        return rows, columns

    def dense(self) -> RealArray:
        """The matrix as an array."""
        return self.array

    def times(self, right: Array) -> RealArray:
        """H X."""
        return self.array @ right

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z."""
        return self.array.T @ left

    def gram(self) -> RealArray | None:
        """None: nothing is gained by forming it."""
        return None

    def transposed(self) -> DenseMatrix:
        """H'."""
        return DenseMatrix(self.array.T)

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows from first to last, `rows` at a time."""
        for i in range(0, len(self.array), rows):
            yield self.array[i : i + rows]


@dataclass(frozen=True, eq=False)
class BlockHankel:
    """Whole consecutive blocks: block (i, j) is Y(first + i + j) (Eq. 17), i < block_rows, j < block_columns.

    Products run over block rows as matrix products with slices of one array, so that nothing of the matrix' size exists.
    """

    values: RealArray
    block_rows: int
    block_columns: int
    first: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        _, outputs, inputs = self.values.shape
        return outputs * self.block_rows, inputs * self.block_columns

    @cached_property
    def _strip(self) -> RealArray:
        """(l, N m): columns i m to (i + block_columns) m are block row i."""
        used = self.values[self.first : self.first + self.block_rows + self.block_columns - 1]
        return np.ascontiguousarray(used.transpose(1, 0, 2)).reshape(self.values.shape[1], -1)

    def _row(self, i: int) -> RealArray:
        inputs = self.values.shape[2]
        return self._strip[:, i * inputs : (i + self.block_columns) * inputs]

    def dense(self) -> RealArray:
        """The matrix as an array, for small ones and for tests."""
        return np.vstack([self._row(i) for i in range(self.block_rows)])

    def times(self, right: Array) -> RealArray:
        """H X, block row by block row."""
        outputs = self.values.shape[1]
        product = np.empty((self.shape[0], right.shape[1]))
        for i in range(self.block_rows):
            np.matmul(self._row(i), right, out=product[i * outputs : (i + 1) * outputs])
        return product

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z, summed over block rows."""
        outputs = self.values.shape[1]
        product = np.zeros((self.shape[1], left.shape[1]))
        for i in range(self.block_rows):
            product += self._row(i).T @ left[i * outputs : (i + 1) * outputs]
        return product

    def gram(self) -> RealArray:
        """H' H by its structure: G[i+1, j+1] = G[i, j] - Y(i)' Y(j) + Y(i+r)' Y(j+r), from the first block row of r products."""
        m, r, s = self.values.shape[2], self.block_rows, self.block_columns
        strip = self._strip
        gram = np.zeros((s * m, s * m))
        head = gram[:m]
        for k in range(r):
            head += strip[:, k * m : (k + 1) * m].T @ self._row(k)
        for i in range(s - 1):
            row, below = slice(i * m, (i + 1) * m), slice((i + 1) * m, (i + 2) * m)
            leave, enter = strip[:, i * m : (i + 1) * m], strip[:, (i + r) * m : (i + r + 1) * m]
            update = enter.T @ strip[:, (i + r) * m : (s - 1 + r) * m] - leave.T @ strip[:, i * m : (s - 1) * m]
            gram[below, (i + 1) * m :] = gram[row, i * m : (s - 1) * m] + update
        upper = np.triu(gram)
        return np.asarray(upper + np.triu(gram, 1).T)

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows from first to last, whole blocks and about `rows` at a time."""
        step = max(rows // self.values.shape[1], 1)
        for i in range(0, self.block_rows, step):
            yield np.vstack([self._row(k) for k in range(i, min(i + step, self.block_rows))])

    def transposed(self) -> BlockHankel:
        """H': the block Hankel matrix of the transposed samples."""
        return BlockHankel(self.values.transpose(0, 2, 1), self.block_columns, self.block_rows, self.first)
