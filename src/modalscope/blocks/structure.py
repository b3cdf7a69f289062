"""Block Hankel products by structure, the sides of Hankel matrices, and the base class of sampled data matrices."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from modalscope.blocks.matrix import DataMatrix
from modalscope.functions.poles import powers_of, to_continuous, to_discrete
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, check_count, check_each, real_array
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import executor
from modalscope.numerics.resources import fetched, namespace, transforms

# -------------------------------------------------------------------------------------------------------------- layout
# Which samples, outputs and inputs the rows and columns of a Hankel matrix are, with the conditions of Eqs. 20-21 checked.


def block_shifts(name: str, shifts: Sequence[int] | None, blocks: int | None, other: str) -> list[int]:
    """Return the shifts of the blocks of one side: 0, 1, 2, ..., or those given, which must begin at 0 and have no common factor.

    If all shifts are multiples of p, the factor's blocks are C, C A^p, C A^2p, ..., and poles that A^p takes to one place are
    no longer told apart: the rank is lost although every mode is in the data.
    """
    if shifts is None:
        if blocks is None:
            raise DataError(f"a Hankel matrix needs {other} or {name}", "neither is given", f"Give {other}.")
        return list(range(check_count(other, blocks)))
    found = [check_count(name, s, least=0) for s in shifts]
    if not found or found[0] != 0 or any(b <= a for a, b in pairwise(found)):
        raise DataError(
            f"{name} needs whole numbers that increase from 0",
            f"they are {found[:8]}",
            "Start at 0 and give each shift once.",
        )
    if blocks is not None and blocks != len(found):
        raise DataError(
            f"{other}={blocks} was asked", f"{name} has {len(found)} entries, one a block", f"Give {name} alone."
        )
    factor = gcd(*found)
    if factor > 1:
        raise DataError(
            f"{name} needs shifts without a common factor",
            f"all are multiples of {factor}, and A^{factor} may have coinciding poles",
            "Add a shift that is not a multiple.",
        )
    return found


def block_entries(
    name: str, subsets: Sequence[Sequence[int]] | None, shifts: list[int], count: int, what: str
) -> IntArray:
    """Return shift and channel of every row (or column), (2, rows): all channels in each block, or the subsets given."""
    if subsets is None:
        return np.stack([np.repeat(shifts, count), np.tile(np.arange(count), len(shifts))]).astype(np.int64)
    sets = check_each(name, subsets, "one set of indices a block")
    chosen = [[check_count(name, c, least=0) for c in check_each(name, subset, "sets of indices")] for subset in sets]
    if len(chosen) != len(shifts):
        raise DataError(
            f"{name} needs {len(shifts)} sets, one a block", f"there are {len(chosen)}", "Give one a block."
        )
    if chosen[0] != list(range(count)):
        raise DataError(
            f"{name} needs all {count} {what} in the first block",
            f"it holds {chosen[0]}",
            "Leave channels out of later blocks only, or use select().",
        )
    if any(c < 0 or c >= count for subset in chosen for c in subset):
        raise DataError(f"{name} names {what} 0 to {count - 1}", "there is an index outside", "Correct the index.")
    if any(len(set(subset)) < len(subset) for subset in chosen):
        raise DataError(f"{name} names each of the {what} once a block", "one is repeated", "Give each once.")
    return np.array([(s, c) for s, subset in zip(shifts, chosen, strict=True) for c in subset], dtype=np.int64).T


def side_weights(name: str, weights: ArrayLike | None, entries: IntArray, count: int) -> RealArray | None:
    """Return positive weights of one side: one a channel, or one a row (a column)."""
    if weights is None:
        return None
    array = real_array(name, weights, "(channels,) or (rows,)", 1)
    if array.size not in (count, entries.shape[1]):
        raise DataError(
            f"{name} needs {count} or {entries.shape[1]} entries",
            f"it has {array.size}",
            "Give one a channel, or one a row.",
        )
    if np.any(array <= 0):
        raise DataError(
            f"{name} needs positive weights",
            f"the smallest is {array.min():g}",
            "Leave channels out with select() instead of weighting by 0.",
        )
    return array


def side_map(name: str, T: ArrayLike | None, entries: IntArray, count: int, whole: bool) -> RealArray | None:
    """Return a compression of one side: T_0 (q, channels), for each block when blocks are whole, or T_r (q, rows)."""
    if T is None:
        return None
    array = real_array(name, T, "(rows kept, rows)", 2)
    rows = entries.shape[1]
    allowed = (count, rows) if whole else (rows,)
    if array.shape[1] not in allowed:
        within = f"{count} columns (within blocks) or " if whole else ""
        raise DataError(
            f"{name} needs {within}{rows} columns (over whole columns of the matrix)",
            f"it has {array.shape[1]}",
            "Give one column for each row that is combined.",
        )
    if not np.all(np.any(array, axis=1)):
        raise DataError(f"{name} needs rows that combine something", "a row of it is zero", "Leave that row out.")
    return array


# ---------------------------------------------------------------------------------------------------------------- side
# One side of a Hankel matrix: which samples and channels its rows (or columns) are, and what is done to them.


@dataclass(frozen=True, eq=False)
class Side:
    """The rows of H(0), or its columns.

    `entries` (2, rows): shift and channel of each; the channels are those after `within`. `whole`: all channels in every block, shifts 0,
    1, 2, ... `within` (q, channels): t_0, applied within every block: a compression, or one weight a channel. `weights` (rows,): one
    weight a row, when they differ from block to block. `over` (q, rows): t_r, applied to whole columns after the weights.
    """

    entries: IntArray
    whole: bool
    within: RealArray | None = None
    weights: RealArray | None = None
    over: RealArray | None = None

    @cached_property
    def shifts(self) -> IntArray:
        """The different shifts, increasing."""
        return np.unique(self.entries[0])

    @property
    def structured(self) -> bool:
        """Whole consecutive blocks and nothing over them: what products and Gram matrices can use."""
        return self.whole and self.weights is None and self.over is None

    @property
    def size(self) -> int:
        """Number of rows, after compression."""
        return int(self.entries.shape[1] if self.over is None else self.over.shape[0])

    def taller(self) -> Side:
        """Return the side with one block more: the last block again, one sample on, with its weights."""
        last = self.entries[0] == self.shifts[-1]
        return replace(
            self,
            entries=np.hstack([self.entries, self.entries[:, last] + np.array([[1], [0]])]),
            weights=None if self.weights is None else np.concatenate([self.weights, self.weights[last]]),
        )

    def words(self) -> list[str]:
        """What was done to the side, in words."""
        done = (
            ("chosen", not self.whole),
            ("combined or weighted within blocks", self.within is not None),
            ("weighted", self.weights is not None),
            ("compressed", self.over is not None),
        )
        return [what for what, there in done if there]

    def apply(self, rows: Array) -> RealArray:
        """Return rows of the matrix weighted and combined."""
        weighted = rows if self.weights is None else rows * self.weights[:, None]
        return np.asarray(weighted if self.over is None else self.over @ weighted)

    def taken_back(self, left: Array) -> Array:
        """Return X (k, size) on the rows before they were weighted and combined: the transpose of `apply`."""
        before = left if self.over is None else left @ self.over
        return before if self.weights is None else before * self.weights


def side_of(
    name: str,
    count: int,
    shifts: list[int],
    subsets: Sequence[Sequence[int]] | None,
    weights: ArrayLike | None,
    compression: ArrayLike | None,
) -> Side:
    """Return one side with its conditions checked; what acts alike in every block goes into `within`."""
    what = {"row": "outputs", "column": "inputs"}[name]
    entries = block_entries(f"{name}_subsets", subsets, shifts, count, what)
    full = entries.shape[1] == count * len(shifts)
    w = side_weights(f"{name}_weights", weights, entries, count)
    T = side_map(f"{name}_compression", compression, entries, count, full)
    in_blocks = T is not None and full and T.shape[1] == count
    if w is not None and w.size == count and full and (T is None or in_blocks):
        T, w, in_blocks = np.asarray(np.diag(w) if T is None else T * w), None, True
    elif w is not None and w.size == count:
        w = w[entries[1]]
    if T is not None and in_blocks and w is not None:  # weights that differ from block to block come first
        T, in_blocks = np.asarray(np.kron(np.eye(len(shifts)), T), dtype=float), False
    if in_blocks:
        assert T is not None
        entries = block_entries("", None, shifts, T.shape[0], what)
    whole = full and shifts == list(range(len(shifts)))
    return Side(entries, whole, T if in_blocks else None, w, None if in_blocks else T)


# -------------------------------------------------------------------------------------------------------- block hankel
# A block Hankel matrix known by its products: it is never formed.

#: Operations of a transform take so many times as long as those of a matrix product.
_SLOWER = 4

#: Complex numbers in an array in between.
_AT_A_TIME = 1_000_000

#: Samples whose products with the others are taken together, and rows of the matrix.
_TOGETHER, _ROWS = 16, 64


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
        return by_rows, float(_SLOWER * n * (4 * l * m + 2.5 * np.log2(n) * (l + m)))

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
        k, found, fft = right.shape[1], np.empty((blocks, rows, right.shape[1])), transforms(transform)
        step = max(_AT_A_TIME // (lines * max(rows, inner)), 1)
        for c in range(0, k, step):
            X = executor().place(np.ascontiguousarray(right[:, c : c + step]).reshape(-1, inner, min(step, k - c)))
            product = transform @ fft.ihfft(X, n=self._length, axis=0, norm="forward")  # conjugates, not scaled
            found[:, :, c : c + step] = fetched(fft.irfft(product, n=self._length, axis=0)[:blocks])
        return found.reshape(blocks * rows, k)

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
        stop, step = used[-1] // outputs + 1 if used.size else 1, max(_ROWS // outputs, 1)
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

    def _first_row(self, found: Any) -> None:
        """Add sum_k Y(k)' Y(k + j) of all block rows, sample by sample, or with many inputs block by block."""
        outputs, m, r, s = *self.values.shape[1:], self.block_rows, self.block_columns
        if m <= 2 * outputs:
            for _, row in self._products(0, r, s):
                found += row[:, : s * m]
            return
        rows = [executor().place(self.values[self.first + j : self.first + j + r].reshape(-1, m)) for j in range(s)]
        for j in range(s):
            found[:, j * m : (j + 1) * m] = rows[0].T @ rows[j]

    def _products(self, start: int, stop: int, blocks: int) -> Iterator[tuple[int, Any]]:
        """Yield k and Y(k)' [Y(k), Y(k + 1), ...], at least `blocks` blocks where there are as many, from start to before stop."""
        m, together = self.values.shape[2], max(min(_TOGETHER, blocks // 4), 1)
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


# ------------------------------------------------------------------------------------------------------------- sampled

#: Growth over all blocks, in exponents of e, whose square is a number with room for sums.
_GROWN = 300.0


class SampledMatrix(DataMatrix):
    """Block rows are samples, one after the other."""

    @property
    @abstractmethod
    def dt(self) -> float:
        """Sampling interval, seconds."""

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles ln(z) fs, rad/s."""
        return to_continuous(poles, self.dt)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles of the sampled system, exp(s / fs)."""
        return to_discrete(poles, self.dt)

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return z^k for blocks k = 0, 1, ...: how a mode runs down the rows; what outgrows all numbers is held below them."""
        most = np.exp(_GROWN / max(blocks, 1))
        return powers_of(np.asarray(poles) * (most / np.maximum(np.abs(poles), most)), blocks)
