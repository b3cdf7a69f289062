"""What a block data matrix offers to the realizations, whatever its domain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from modalscope.blocks.factor import Factors
from modalscope.blocks.operators import Operator
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray

__all__ = ["DataMatrix", "Evolution", "RowShift"]

Evolution = ComplexArray


@dataclass(frozen=True, eq=False)
class RowShift:
    """E0 and E1 with (E1 V) = (E0 V) A for the row factor V = [C g_0; C g_1; ...] of the matrix with one block row more.

    In the time domain both select rows. On a polynomial basis E1 combines the block rows by the basis' recurrence
    x p_k = sum_j h_jk p_j, so that E1 = h' (x) I.

    Parameters
    ----------
    before, after : array of int, optional
        Rows that E0 and E1 select.
    recurrence : array, (degree + 1, degree), optional
        h, when E1 combines.
    block : int
        Rows in a block.
    weight : array, optional
        Row weights that the factor still carries; they are removed first.
    whole : bool
        Whether every block row holds all `block` channels, as companion forms need.
    """

    block: int
    before: IntArray | None = None
    after: IntArray | None = None
    recurrence: RealArray | None = None
    weight: RealArray | None = None
    whole: bool = True

    def unweighted(self, V: Array) -> RealArray:
        """Return V without the row weights."""
        return V if self.weight is None else V / self.weight[:, None]

    def split(self, V: Array) -> tuple[RealArray, RealArray]:
        """Return E0 V and E1 V."""
        V = self.unweighted(V)
        if self.recurrence is None:
            assert self.before is not None
            assert self.after is not None
            return _rows(V, self.before), _rows(V, self.after)
        h = self.recurrence
        blocks = V.reshape(h.shape[0], self.block, -1)
        combined = np.tensordot(h.T, blocks, axes=1).reshape(h.shape[1] * self.block, -1)
        return V[: h.shape[1] * self.block], combined


def _rows(V: Array, index: IntArray) -> RealArray:
    """Select rows: a view when they are consecutive, as they are for whole blocks."""
    first, last = int(index[0]), int(index[-1])
    if last - first + 1 == index.size and np.array_equal(index, np.arange(first, last + 1)):
        return V[first : last + 1]
    return np.asarray(V[index])


class DataMatrix(Protocol):
    """The object between the data and the factorizations.

    `tall()` holds the rows of H(0) and of H(1) together; `row_shift` belongs to its factors. What the structure does not
    allow is a DataError that says so.
    """

    @property
    def outputs(self) -> int:
        """Outputs of the response (inputs, when it was transposed)."""

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0)."""

    def shifted(self, k: int) -> Operator:
        """H(k), k = 0 or 1."""

    def tall(self) -> Operator:
        """H with one block row more than H(0)."""

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1."""

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """The first block row of H(k), times X, in outputs: C = first_rows(Q d^-1/2), C A = first_rows(Q d^-1/2, 1)."""

    def first_block_column(self, *, tall: bool = False) -> RealArray | None:
        """H(0) E_m, or that of tall(), with the inputs themselves; None where columns are lines."""

    def first_columns(self, factors: Factors) -> RealArray | None:
        """X (m, k) such that B = d^1/2 X', as a rule the first rows of Q; None where columns are lines."""

    def first_block(self, shapes: Array) -> Array:
        """What the first block row of the factor V holds for given shapes (l, n): T_0 C, or C p_0 on polynomials."""

    def row_blocks(self, P: Array) -> RealArray | None:
        """A left factor (rows, k) by block rows, (blocks, channels, k); None where the blocks are not whole."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a result made from this matrix must say."""

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""

    def from_s(self, poles: Array) -> ComplexArray:
        """The matrix' own poles from continuous ones."""

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None when it is continuous."""

    def evolution(self, poles: Array, blocks: int) -> Evolution:
        """How a mode runs down the block rows: (blocks, n) factors of its first block."""

    def describe(self) -> str:
        """What the matrix is, in words."""
