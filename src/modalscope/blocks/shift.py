"""E0 and E1: the two row selections, or recurrences, that a realization reads the state matrix off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.blocks.real_products import real_times
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray

__all__ = ["RowShift"]


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
    mixing : array, (rows, rows), optional
        What takes the factor's rows back where they were mixed by a full triangle.
    whole : bool
        Whether every block row holds all `block` channels, as companion forms need.
    """

    block: int
    before: IntArray | None = None
    after: IntArray | None = None
    recurrence: RealArray | None = None
    weight: RealArray | None = None
    mixing: RealArray | None = None
    whole: bool = True

    def unweighted(self, V: Array) -> RealArray:
        """Return V without the row weights, or taken back by the mixing."""
        if self.mixing is not None:
            return np.asarray(self.mixing @ V)
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

    def pencil(self, left: Array, values: Array, rows: int) -> ComplexArray:
        """Return L_j = F_j E1 - x_j F_j E0 on the rows that E0 and E1 were given, (k, rows), without weights or mixing.

        Parameters
        ----------
        left : array, (k, rows of E0)
            F_j, one a row.
        values : array of complex, (k,)
            x_j.
        rows : int
        """
        F, x = np.asarray(left), np.asarray(values)[:, None]
        L = np.zeros((len(F), rows), dtype=complex)
        if self.recurrence is None:
            assert self.before is not None
            assert self.after is not None
            L[:, _place(self.after)] = F
            L[:, _place(self.before)] -= x * F
            return L
        h = self.recurrence
        blocks = F.reshape(len(F), h.shape[1], self.block)
        L += real_times(h, blocks).reshape(len(F), -1)
        L[:, : F.shape[1]] -= x * F
        return L


def _rows(V: Array, index: IntArray) -> RealArray:
    """Select rows: a view when they are consecutive, as they are for whole blocks."""
    return np.asarray(V[_place(index)])


def _place(index: IntArray) -> slice | IntArray:
    """Return rows that are consecutive as a slice, which takes no time, others as they are."""
    first, last = int(index[0]), int(index[-1])
    if last - first + 1 == index.size and np.array_equal(index, np.arange(first, last + 1)):
        return slice(first, last + 1)
    return index
