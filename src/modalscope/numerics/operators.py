"""Linear operators: matrices known by their products, transposes, and plain arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.executors import executor
from modalscope.numerics.resources import fetched


def real_times(left: RealArray, right: Array) -> Array:
    """Return left @ right of a real left side, (..., a, n) and (n, k)."""
    if not np.iscomplexobj(right):
        return left @ right
    return np.ascontiguousarray(left @ np.ascontiguousarray(right).view(np.float64)).view(np.complex128)


def times_real(left: Array, right: RealArray) -> Array:
    """Return left @ right of a real right side, (k, n) and (n, b)."""
    if not np.iscomplexobj(left):
        return left @ right
    product = np.empty((len(left), right.shape[1]), dtype=complex)
    product.real, product.imag = np.ascontiguousarray(left.real) @ right, np.ascontiguousarray(left.imag) @ right
    return product


def padded(rows: Sequence[Array]) -> ComplexArray:
    """Return rows of several orders below each other, zeros behind those that are shorter than the longest."""
    table, start = np.zeros((sum(map(len, rows)), max(part.shape[1] for part in rows)), dtype=complex), 0
    for part in rows:
        table[start : start + len(part), : part.shape[1]] = part
        start += len(part)
    return table


class Operator(Protocol):
    """What a factorization may ask of a matrix."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""

    @property
    def product_operations(self) -> float:
        """Operations of H x for one column x, in units of those of a matrix product."""

    @property
    def gram_operations(self) -> float | None:
        """Operations of `gram`; None where there is none."""

    @property
    def energy(self) -> float:
        """Sum of the squares of all entries."""

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


class WideOperator(Operator, Protocol):
    """One that knows the Gram matrix of its rows, and gives its columns."""

    @property
    def row_gram_operations(self) -> float | None:
        """Operations of `row_gram`."""

    def row_gram(self) -> RealArray | None:
        """H H' when structure makes it cheap, else None."""

    def column_chunks(self, columns: int) -> Iterator[RealArray]:
        """The columns as rows, from first to last."""


@dataclass(frozen=True, eq=False)
class TransposedOperator:
    """H' of a wide operator."""

    inner: WideOperator

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.inner.shape
        return columns, rows

    @property
    def product_operations(self) -> float:
        """Those of H Z."""
        return self.inner.product_operations

    @property
    def gram_operations(self) -> float | None:
        """Those of H H'."""
        return self.inner.row_gram_operations

    @property
    def energy(self) -> float:
        """Sum of the squares of all entries."""
        return self.inner.energy

    def dense(self) -> RealArray:
        """The matrix as an array."""
        return self.inner.dense().T

    def times(self, right: Array) -> RealArray:
        """H' X."""
        return self.inner.transposed_times(right)

    def transposed_times(self, left: Array) -> RealArray:
        """H Z."""
        return self.inner.times(left)

    def gram(self) -> RealArray | None:
        """H H'."""
        return self.inner.row_gram()

    def transposed(self) -> Operator:
        """H."""
        return self.inner

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows of H', some at a time."""
        return self.inner.column_chunks(rows)


@dataclass(frozen=True, eq=False)
class DenseMatrix:
    """An array that answers as an operator."""

    array: RealArray

    @cached_property
    def _placed(self) -> Any:
        return executor().place(self.array)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.array.shape
        return rows, columns

    @property
    def product_operations(self) -> float:
        """2 rows columns."""
        return 2.0 * self.array.size

    @property
    def gram_operations(self) -> float | None:
        """None."""
        return None

    @property
    def energy(self) -> float:
        """Sum of the squares of all entries."""
        return float(np.sum(self.array**2))

    def dense(self) -> RealArray:
        """The matrix as an array."""
        return self.array

    def times(self, right: Array) -> RealArray:
        """H X."""
        return fetched(self._placed @ executor().place(right))

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z."""
        return fetched(self._placed.T @ executor().place(left))

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
class LargeMatrix(DenseMatrix):
    """An array of about as many rows as columns of which few directions are asked: its products are a fraction of its decomposition."""

    @property
    def gram_operations(self) -> float:
        """Rows columns^2: half of the products of all columns."""
        return float(self.array.size * self.array.shape[1])

    def gram(self) -> RealArray:
        """H' H."""
        return fetched(self._placed.T @ self._placed)

    def transposed(self) -> LargeMatrix:
        """H'."""
        return LargeMatrix(self.array.T)


@dataclass(frozen=True, eq=False)
class Product:
    """H X, made when it is asked for.

    `matrix`: h. `right` (columns, k): x.
    """

    matrix: Operator
    right: RealArray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.matrix.shape[0], self.right.shape[1]

    def array(self) -> RealArray:
        """The product."""
        return self.matrix.times(self.right)
