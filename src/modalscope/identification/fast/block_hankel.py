"""Block Hankel products by structure, the sides of Hankel matrices, and the base class of sampled data matrices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import fft

from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.executors import executor
from modalscope.numerics.resources import fetched, namespace, transforms

#: Cost of an operation of a Fourier transform in operations of a matrix product.
_TRANSFORM_COST = 4

#: Count of complex numbers in a temporary array.
_BLOCK_NUMBERS = 1_000_000

#: Samples whose products with the others are computed together, and rows of the matrix.
_BLOCK_SAMPLES, _BLOCK_ROWS = 16, 64


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
    def strip(self) -> Any:
        """The samples used, (l, N m), where products are computed: columns i m to (i + block_columns) m are block row i."""
        used = self.values[self.first : self.first + self.block_rows + self.block_columns - 1]
        return executor().place(np.ascontiguousarray(used.transpose(1, 0, 2)).reshape(self.values.shape[1], -1))

    def samples_times(self, right: Array, first: int = 0) -> RealArray:
        """Return the samples used from a first one on, (l, N m), times an array."""
        start = first * self.values.shape[2]
        return fetched(self.strip[:, start : start + len(right)] @ executor().place(right))

    def _row(self, i: int) -> Any:
        inputs = self.values.shape[2]
        return self.strip[:, i * inputs : (i + self.block_columns) * inputs]

    def dense(self) -> RealArray:
        """The matrix as an array, for small ones and for tests."""
        return np.vstack([fetched(self._row(i)) for i in range(self.block_rows)])

    @property
    def _length(self) -> int:
        """Length of the transforms that hold all samples used: products do not wrap around within it."""
        return int(fft.next_fast_len(self.block_rows + self.block_columns - 1, real=True))

    @property
    def _operations(self) -> tuple[float, float]:
        """Operations of a product by block rows and by Fourier transforms, for one column."""
        _, l, m = self.values.shape
        n = self._length
        by_rows = 2.0 * self.block_rows * self.block_columns * l * m
        return by_rows, float(_TRANSFORM_COST * n * (4 * l * m + 2.5 * np.log2(n) * (l + m)))

    @property
    def by_transforms(self) -> bool:
        """Whether products by Fourier transforms take fewer operations than those by block rows."""
        by_rows, transforms = self._operations
        return transforms < by_rows

    @property
    def product_operations(self) -> float:
        """Those of the cheaper way."""
        return float(min(self._operations))

    @property
    def gram_operations(self) -> float:
        """Those of the first block row, and of the updates."""
        _, l, m = self.values.shape
        r, s = self.block_rows, self.block_columns
        return float(2 * l * m * m * s * (r + s))

    @property
    def energy(self) -> float:
        """Sum of the squares of all entries: every sample as often as it stands on its antidiagonal."""
        r, s = self.block_rows, self.block_columns
        k = np.arange(r + s - 1)
        often = np.minimum(np.minimum(k + 1, r + s - 1 - k), min(r, s))
        used = self.values[self.first : self.first + r + s - 1]
        return float(often @ np.einsum("klm,klm->k", used, used))

    @cached_property
    def _transform(self) -> Any:
        """Transform of the samples used, (length / 2 + 1, l, m)."""
        used = executor().place(self.values[self.first : self.first + self.block_rows + self.block_columns - 1])
        return transforms(used).rfft(used, n=self._length, axis=0)

    def _correlated(self, transform: Any, blocks: int, right: Array) -> RealArray:
        """Return sum_j Y(i + j) X_j of block vectors for `blocks` blocks i, some columns at a time."""
        lines, rows, inner = transform.shape
        k, products, fft = right.shape[1], np.empty((blocks, rows, right.shape[1])), transforms(transform)
        step = max(_BLOCK_NUMBERS // (lines * max(rows, inner)), 1)
        for c in range(0, k, step):
            X = executor().place(np.ascontiguousarray(right[:, c : c + step]).reshape(-1, inner, min(step, k - c)))
            product = transform @ fft.ihfft(X, n=self._length, axis=0, norm="forward")  # conjugates, not scaled
            products[:, :, c : c + step] = fetched(fft.irfft(product, n=self._length, axis=0)[:blocks])
        return products.reshape(blocks * rows, k)

    def times(self, right: Array) -> RealArray:
        """H X, by one transform of each block column, or block row by block row."""
        if self.by_transforms:
            return self._correlated(self._transform, self.block_rows, right)
        outputs, X = self.values.shape[1], executor().place(right)
        product = np.empty((self.shape[0], right.shape[1]))
        for i in range(self.block_rows):
            product[i * outputs : (i + 1) * outputs] = fetched(self._row(i) @ X)
        return product

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z, by transforms, or summed over block rows up to the last that is not zero."""
        if self.by_transforms:
            return self._correlated(self._transform.swapaxes(1, 2), self.block_columns, left)
        outputs, Z = self.values.shape[1], executor().place(left)
        used = np.flatnonzero(np.any(left, axis=1))
        stop, step = used[-1] // outputs + 1 if used.size else 1, max(_BLOCK_ROWS // outputs, 1)
        total: Any = 0
        for i in range(0, stop, step):
            last = min(i + step, stop)
            rows = namespace(self.strip).concat([self._row(k) for k in range(i, last)])
            total = total + rows.T @ Z[i * outputs : last * outputs]
        return fetched(total)

    def gram(self) -> RealArray:
        """H' H by its structure: G[i+1, j+1] = G[i, j] - Y(i)' Y(j) + Y(i+r)' Y(j+r), from the first block row of r products."""
        m, r, s, strip = self.values.shape[2], self.block_rows, self.block_columns, self.strip
        gram = namespace(strip).zeros((s * m, s * m), dtype=strip.dtype, device=strip.device)
        self._first_row(gram[:m])
        both = zip(self._products(0, s - 1, s - 1), self._products(r, r + s - 1, s - 1), strict=True)
        for (i, leave), (_, enter) in both:
            left = (s - 1 - i) * m
            update = enter[:, :left] - leave[:, :left]
            update += gram[i * m : (i + 1) * m, i * m : (s - 1) * m]
            gram[(i + 1) * m : (i + 2) * m, (i + 1) * m :] = update
        for i in range(s):
            gram[i * m :, i * m : (i + 1) * m] = gram[i * m : (i + 1) * m, i * m :].T
        return fetched(gram)

    def _first_row(self, target: Any) -> None:
        """Add sum_k Y(k)' Y(k + j) of all block rows, sample by sample, or with many inputs block by block."""
        outputs, m, r, s = *self.values.shape[1:], self.block_rows, self.block_columns
        if m <= 2 * outputs:
            for _, row in self._products(0, r, s):
                target += row[:, : s * m]
            return
        rows = [executor().place(self.values[self.first + j : self.first + j + r].reshape(-1, m)) for j in range(s)]
        for j in range(s):
            target[:, j * m : (j + 1) * m] = rows[0].T @ rows[j]

    def _products(self, start: int, stop: int, blocks: int) -> Iterator[tuple[int, Any]]:
        """Yield k and Y(k)' [Y(k), Y(k + 1), ...], at least `blocks` blocks where there are as many, from start to before stop."""
        m, together = self.values.shape[2], max(min(_BLOCK_SAMPLES, blocks // 4), 1)
        for first in range(start, stop, together):
            last = min(first + together, stop)
            rows = self.strip[:, first * m : last * m].T @ self.strip[:, first * m : (last + blocks) * m]
            for k in range(last - first):
                yield first + k, rows[k * m : (k + 1) * m, k * m :]

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows from first to last, whole blocks and about `rows` at a time."""
        step = max(rows // self.values.shape[1], 1)
        for i in range(0, self.block_rows, step):
            yield np.vstack([fetched(self._row(k)) for k in range(i, min(i + step, self.block_rows))])

    def transposed(self) -> BlockHankel:
        """H': the block Hankel matrix of the transposed samples."""
        return BlockHankel(self.values.transpose(0, 2, 1), self.block_columns, self.block_rows, self.first)
