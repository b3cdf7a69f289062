"""Rows and columns of a Hankel matrix: their samples and channels (Eqs. 20-21 checked), weights and compressions (Eqs. 31-41)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from modalscope.numerics.checks import Array, IntArray, RealArray, check_count, check_each, check_shifts, real_array
from modalscope.numerics.errors import DataError

#: A Hankel matrix of more blocks on one side fits in no memory.
_MAX_BLOCKS = 1_000_000


def block_shifts(name: str, shifts: Sequence[int] | None, blocks: int | None, other: str) -> list[int]:
    """Return the shifts of the blocks of one side: 0, 1, 2, ..., or those given, in any order, 0 among them and without a common factor.

    If all shifts are multiples of p, the factor's blocks are C, C A^p, C A^2p, ..., and poles that A^p takes to one place are
    no longer told apart: the rank is lost although every mode is in the data.
    """
    if shifts is None:
        if blocks is None:
            raise DataError(f"a Hankel matrix needs {other} or {name}", "neither is given", f"Give {other}.")
        if check_count(other, blocks) > _MAX_BLOCKS:
            raise DataError(f"{other}={blocks}:", f"no data have more than {_MAX_BLOCKS} blocks", f"Lower {other}.")
        return list(range(blocks))
    numbers = list(check_shifts(name, shifts))
    if blocks is not None and blocks not in (len(numbers), max(numbers) + 1):
        raise DataError(
            f"{other}={blocks}:", f"{name} has {len(numbers)} entries, one per block", f"Give {name} alone."
        )
    factor = gcd(*numbers)
    if factor > 1:
        raise DataError(
            f"{name} needs shifts without a common factor",
            f"all are multiples of {factor}, and A^{factor} may have coinciding poles",
            "Add a shift that is not a multiple.",
        )
    return numbers


def in_order(
    shifts: list[int],
    subsets: Sequence[Sequence[int]] | None,
    weights: ArrayLike | None,
    T: ArrayLike | None,
    count: int,
) -> tuple[list[int], Sequence[Sequence[int]] | None, ArrayLike | None, ArrayLike | None]:
    """Return blocks by increasing shift with what was given for them, row by row, in their own order; `count` channels a whole block."""
    order = np.argsort(shifts, kind="stable")
    if np.array_equal(order, np.arange(len(shifts))):
        return shifts, subsets, weights, T
    sets = None if subsets is None else list(subsets)
    sizes = [count] * len(shifts) if sets is None else [len(each) for each in sets]
    ends = np.cumsum([0, *sizes])
    rows = np.concatenate([np.arange(ends[k], ends[k + 1]) for k in order])
    w, M = (None if given is None else np.asarray(given) for given in (weights, T))
    w = w if w is None or w.shape != rows.shape else w[rows]
    M = M if M is None or M.ndim != 2 or M.shape[1] != rows.size else M[:, rows]
    return [shifts[k] for k in order], None if sets is None else [sets[k] for k in order], w, M


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
            f"{name} needs {len(shifts)} sets, one per block", f"there are {len(chosen)}", "Give one per block."
        )
    if chosen[0] != list(range(count)):
        raise DataError(
            f"{name} needs all {count} {what} in the first block",
            f"it holds {chosen[0]}",
            "Drop channels from all but the first block, or use select().",
        )
    if any(c < 0 or c >= count for subset in chosen for c in subset):
        raise DataError(f"{name} names {what} 0 to {count - 1}", "there is an index outside", "Correct the index.")
    if any(len(set(subset)) < len(subset) for subset in chosen):
        raise DataError(f"{name} names each of the {what} once per block", "one is repeated", "Give each once.")
    return np.array([(s, c) for s, subset in zip(shifts, chosen, strict=True) for c in subset], dtype=np.int64).T


def side_weights(name: str, weights: ArrayLike | None, entries: IntArray, count: int) -> RealArray | None:
    """Return positive weights of one side: one per channel, or one per row (a column)."""
    if weights is None:
        return None
    array = real_array(name, weights, "(channels,) or (rows,)", 1)
    if array.size not in (count, entries.shape[1]):
        raise DataError(
            f"{name} needs {count} or {entries.shape[1]} entries",
            f"it has {array.size}",
            "Give one per channel, or one per row.",
        )
    if np.any(array <= 0):
        raise DataError(
            f"{name} needs positive weights",
            f"the smallest is {array.min():g}",
            "Drop channels with select() instead of a weight of 0.",
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
        raise DataError(f"{name} needs nonzero rows", "one is zero", "Drop that row.")
    return array


@dataclass(frozen=True, eq=False)
class Side:
    """The rows of H(0), or its columns.

    `entries` (2, rows): shift and channel of each; the channels are those after `within`. `whole`: all channels in every block, shifts 0,
    1, 2, ... `within` (q, channels): t_0, applied within every block: a compression, or one weight per channel. `weights` (rows,): one
    weight per row, when they differ from block to block. `over` (q, rows): t_r, applied to whole columns after the weights.
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
    shifts, subsets, weights, compression = in_order(shifts, subsets, weights, compression, count)
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


def adds_channels(T: RealArray) -> bool:
    """Whether T sums rows: entries of one value only, and more than one in a row."""
    return bool(np.all((T == 0) | (T.max() == T)) and np.any(np.count_nonzero(T, axis=1) > 1))
