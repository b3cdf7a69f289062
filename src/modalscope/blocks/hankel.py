"""Block Hankel matrices of Markov parameters, in full generality (Eqs. 17, 20-21).

Block (j, i) of H(k) is Y_{J_j I_i}(s_j + k + t_i) = C_{J_j} A^{s_j} A^k A^{t_i} B_{I_i}: any sensors in every block row but the
first, any inputs in every block column but the first, any shifts. Whole consecutive blocks keep their structure; anything
else is an array of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.matrix import Evolution, RowShift
from modalscope.blocks.operators import BlockHankel, DenseMatrix, Operator
from modalscope.model.checks import Array, ComplexArray, DataError, IntArray, RealArray, check_count, real_array
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import to_continuous, to_discrete

__all__ = ["Hankel", "hankel"]


def hankel(
    response: ImpulseResponse,
    *,
    block_rows: int | None = None,
    block_columns: int | None = None,
    row_shifts: Sequence[int] | None = None,
    column_shifts: Sequence[int] | None = None,
    row_subsets: Sequence[Sequence[int]] | None = None,
    column_subsets: Sequence[Sequence[int]] | None = None,
    row_weights: ArrayLike | None = None,
    column_weights: ArrayLike | None = None,
    row_compression: ArrayLike | None = None,
) -> Hankel:
    """Stack Markov parameters into H(0) and H(1); block (j, i) of H(k) is Y(s_j + k + t_i).

    Parameters
    ----------
    response : ImpulseResponse
        values of shape (samples, outputs, inputs).
    block_rows, block_columns : int
        Blocks in a column and in a row of H(0); block_rows + block_columns samples are read.
    row_shifts, column_shifts : sequence of int, optional
        s_j and t_i, increasing from 0; 0, 1, 2, ... by default. They take the place of block_rows and block_columns.
    row_subsets, column_subsets : sequence of sequences of int, optional
        Outputs in each block row and inputs in each block column; the first must be whole.
    row_weights, column_weights : array, optional
        Positive weights: one an output (an input), or one a row (a column) of H(0).
    row_compression : array, optional
        T_0 (q, l), applied within every block row, or T_r (q, rows of H(0)), applied to whole columns (Eq. 31).

    Returns
    -------
    Hankel

    Raises
    ------
    DataError
        A response that is too short, shifts with a common factor, subsets whose first block is not whole.

    Notes
    -----
    Source: the report, Eqs. 17, 20-21 and 31.
    """
    samples, outputs, inputs = response.values.shape
    s = _shifts("row_shifts", row_shifts, block_rows, "block_rows")
    t = _shifts("column_shifts", column_shifts, block_columns, "block_columns")
    need = s[-1] + t[-1] + 2
    if need > samples:
        raise DataError(
            f"hankel(block_rows={len(s)}, block_columns={len(t)}) reads samples 0 to {need - 1}",
            f"the response has {samples}",
            f"Lower block_rows + block_columns to at most {samples}, or measure a longer response.",
        )
    T = None if row_compression is None else real_array("row_compression", row_compression, "(rows kept, rows)", 2)
    rows = _entries("row_subsets", row_subsets, s, outputs, "outputs")
    columns = _entries("column_subsets", column_subsets, t, inputs, "inputs")
    if T is not None and T.shape[1] not in (outputs, rows.shape[1]):
        raise DataError(
            f"row_compression needs {outputs} columns (within blocks) or {rows.shape[1]} (rows of H)",
            f"it has {T.shape[1]}",
            "Give one column a row.",
        )
    return Hankel(
        response=response,
        row_entries=rows,
        column_entries=columns,
        row_weights=_weights("row_weights", row_weights, rows, outputs),
        column_weights=_weights("column_weights", column_weights, columns, inputs),
        compression=T,
        whole=row_subsets is None and column_subsets is None and s == list(range(len(s))) and t == list(range(len(t))),
    )


@dataclass(frozen=True, eq=False)
class Hankel:
    """A block Hankel matrix: which samples, outputs and inputs its rows and columns are (made by `hankel`).

    Parameters
    ----------
    response : ImpulseResponse
    row_entries, column_entries : array of int, (2, rows), (2, columns)
        Shift and channel of every row and column of H(0).
    row_weights, column_weights : array, optional
        One a row and one a column of H(0).
    compression : array, optional
        T_0 within blocks, or T_r over all rows.
    whole : bool
        Whole consecutive blocks: the structure that makes products and Gram matrices cheap.
    """

    response: ImpulseResponse
    row_entries: IntArray
    column_entries: IntArray
    row_weights: RealArray | None
    column_weights: RealArray | None
    compression: RealArray | None
    whole: bool

    @property
    def block_rows(self) -> int:
        """Number of different row shifts in H(0)."""
        return int(np.unique(self.row_entries[0]).size)

    @property
    def block_columns(self) -> int:
        """Number of different column shifts."""
        return int(np.unique(self.column_entries[0]).size)

    @cached_property
    def _values(self) -> RealArray:
        """Samples, compressed within blocks when that is asked."""
        Y = self.response.values
        return np.einsum("ab,kbc->kac", self.compression, Y) if self._within_blocks else Y

    @property
    def _within_blocks(self) -> bool:
        return (
            self.compression is not None and self.compression.shape[1] == self.response.values.shape[1] and self.whole
        )

    def shifted(self, k: int) -> Operator:
        """Return H(k), weighted and compressed."""
        if (
            self.whole
            and self.row_weights is None
            and self.column_weights is None
            and (self.compression is None or self._within_blocks)
        ):
            return BlockHankel(self._values, self.block_rows, self.block_columns, first=k)
        return DenseMatrix(self._array(self.row_entries, k))

    def tall(self) -> Operator:
        """Return H(0) with one more block row, the rows of H(0) and of H(1) together.

        Raises
        ------
        DataError
            Shifts that are not consecutive, or compression over whole columns: A cannot be read off a row shift then.
        """
        if (
            self.whole
            and self.row_weights is None
            and self.column_weights is None
            and (self.compression is None or self._within_blocks)
        ):
            return BlockHankel(self._values, self.block_rows + 1, self.block_columns)
        return DenseMatrix(self._array(self._tall_entries, 0, tall=True))

    @property
    def row_shift(self) -> RowShift:
        """Return E0 and E1 for factors of `tall()`: E0 drops the last block, E1 the first (Eq. 57, with the words the right way)."""
        entries = self._tall_entries
        rows = {(int(a), int(b)): i for i, (a, b) in enumerate(entries.T)}
        pairs = [(i, rows[(a + 1, b)]) for (a, b), i in rows.items() if (a + 1, b) in rows]
        before, after = np.array(pairs).T
        weight = None if self.row_weights is None else self._tall_weights
        channels = self._values.shape[1]
        return RowShift.selection(before, after, weight, block=channels)

    @cached_property
    def _tall_entries(self) -> IntArray:
        if self.compression is not None and not self._within_blocks:
            raise DataError(
                "a realization from the row shift was asked (alternate or polyreference, observable form)",
                "row_compression acts over whole columns and destroys that shift",
                "Compress within blocks (one column an output), or use form='controllable', method='era' or 'least_squares'.",
            )
        shifts = np.unique(self.row_entries[0])
        if not np.array_equal(shifts, np.arange(shifts.size)):
            raise DataError(
                "a realization from the row shift was asked (alternate or polyreference, observable form)",
                f"the row shifts {shifts[:8].tolist()} are not consecutive",
                "Use consecutive row shifts, form='controllable', or method='era' or 'least_squares'.",
            )
        if self._within_blocks:
            count = self._values.shape[1]
            whole = np.array([(a, b) for a in range(shifts.size + 1) for b in range(count)]).T
            return whole
        last = self.row_entries[:, self.row_entries[0] == shifts[-1]]
        return np.hstack([self.row_entries, np.vstack([last[0] + 1, last[1]])])

    @property
    def _tall_weights(self) -> RealArray:
        assert self.row_weights is not None
        last = self.row_weights[self.row_entries[0] == self.row_entries[0].max()]
        return np.concatenate([self.row_weights, last])

    def _array(self, entries: IntArray, k: int, *, tall: bool = False) -> RealArray:
        """Rows given by `entries`, at shift k: Y[s + k + t, output, input], weighted, compressed."""
        t, inputs = self.column_entries
        values = self._values if self._within_blocks else self.response.values
        H = values[entries[0][:, None] + k + t, entries[1][:, None], inputs]
        if self.column_weights is not None:
            H = H * self.column_weights
        if self.row_weights is not None:
            H = H * (self._tall_weights if tall else self.row_weights)[:, None]
        if self.compression is not None and not self._within_blocks:
            H = self.compression @ H
        return np.ascontiguousarray(H)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return E_l' H(k) X of the uncompressed, unweighted first block row: C = E_l' H(0) Q d^-1/2 (Eqs. 28, 39)."""
        t, inputs = self.column_entries
        row = self.response.values[t + k, :, inputs].T
        return np.asarray((row if self.column_weights is None else row * self.column_weights) @ right)

    def first_columns(self, right: Array) -> RealArray:
        """Return the first block column's rows of the right factor, unweighted, (m, k): B = d^1/2 (first_columns(Q))' (Eqs. 28, 37)."""
        inputs = self.response.values.shape[2]
        return right[:inputs] if self.column_weights is None else right[:inputs] / self.column_weights[:inputs, None]

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles ln(z) fs, rad/s."""
        return to_continuous(poles, self.dt)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles of the sampled system, exp(s / fs)."""
        return to_discrete(poles, self.dt)

    @property
    def dt(self) -> float:
        """Sampling interval, seconds."""
        return 1 / self.response.sampling_rate

    def evolution(self, poles: Array, blocks: int) -> Evolution:
        """Return z^k for blocks k = 0, 1, ...: how a mode runs down the rows."""
        with np.errstate(over="ignore", under="ignore"):
            return np.asarray(poles, dtype=complex)[None, :] ** np.arange(blocks)[:, None]

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        shape = f"{self.block_rows} x {self.block_columns} blocks of {self.response.values.shape[1]} x {self.response.values.shape[2]}"
        extra = [
            name
            for name, there in (
                ("chosen rows and columns", not self.whole),
                ("row weights", self.row_weights is not None),
                ("column weights", self.column_weights is not None),
                ("row compression", self.compression is not None),
            )
            if there
        ]
        return f"Hankel matrix of {shape}" + (f", {', '.join(extra)}" if extra else "")


def _shifts(name: str, shifts: Sequence[int] | None, blocks: int | None, other: str) -> list[int]:
    if shifts is None:
        if blocks is None:
            raise DataError(f"a Hankel matrix needs {other} or {name}", "neither is given", f"Give {other}.")
        return list(range(check_count(other, blocks)))
    found = [int(v) for v in shifts]
    if not found or found[0] != 0 or any(b <= a for a, b in zip(found, found[1:], strict=False)):
        raise DataError(
            f"{name} needs whole numbers that increase from 0",
            f"they are {found[:8]}",
            "Start at 0 and give each shift once.",
        )
    factor = gcd(*found)
    if factor > 1:
        raise DataError(
            f"{name} needs shifts without a common factor",
            f"all are multiples of {factor}, and A^{factor} may have coinciding poles",
            "Add a shift that is not a multiple.",
        )
    return found


def _entries(name: str, subsets: Sequence[Sequence[int]] | None, shifts: list[int], count: int, what: str) -> IntArray:
    if subsets is None:
        return np.array([(s, c) for s in shifts for c in range(count)], dtype=np.int64).T
    chosen = [[int(c) for c in subset] for subset in subsets]
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
    return np.array([(s, c) for s, subset in zip(shifts, chosen, strict=True) for c in subset], dtype=np.int64).T


def _weights(name: str, weights: ArrayLike | None, entries: IntArray, count: int) -> RealArray | None:
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
    return array if array.size == entries.shape[1] and array.size != count else array[entries[1]]
