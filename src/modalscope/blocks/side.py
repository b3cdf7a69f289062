"""One side of a Hankel matrix: which samples and channels its rows (or columns) are, and what is done to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.layout import block_entries, side_map, side_weights
from modalscope.model.checks import Array, IntArray, RealArray

__all__ = ["Side", "side_of"]


@dataclass(frozen=True, eq=False)
class Side:
    """The rows of H(0), or its columns.

    Parameters
    ----------
    entries : array of int, (2, rows)
        Shift and channel of each; the channels are those after `within`.
    whole : bool
        All channels in every block, shifts 0, 1, 2, ...
    within : array, (q, channels), optional
        T_0, applied within every block: a compression, or one weight a channel.
    weights : array, (rows,), optional
        One weight a row, when they differ from block to block.
    over : array, (q, rows), optional
        T_r, applied to whole columns after the weights.
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
