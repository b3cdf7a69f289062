"""Rows of a left factor by what takes its states to them: what depends on the data alone is made once, for the poles of all orders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.blocks.polynomials import both_sums
from modalscope.blocks.real_products import times_real
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray

if TYPE_CHECKING:
    from modalscope.blocks.matrix import DataMatrix

__all__ = ["FunctionRows", "LeftRows", "LinePencil", "line_pencil"]


@dataclass(frozen=True, eq=False)
class LeftRows:
    """Rows F_j = s_j P' on those of a data matrix.

    Parameters
    ----------
    matrix : DataMatrix
    basis : array, (rows, n)
        P.
    tall : bool
        As in `DataMatrix.pencil`.
    """

    matrix: DataMatrix
    basis: RealArray
    tall: bool

    def pencil(self, states: Array, values: Array) -> Any:
        """Return what `DataMatrix.pencil` does of F, by s (k, n' <= n)."""
        left = times_real(states, self.basis[:, : states.shape[1]].T)
        return self.matrix.pencil(left, values, tall=self.tall)


@dataclass(frozen=True, eq=False)
class LinePencil:
    """What rows F_j (E1 - x_j E0) of polynomials are on lines: (x - x_j) sum_k F_k p_k(x), for E1 is multiplication by x there.

    Parameters
    ----------
    sums : callable
        Lines -> sum_k F_k p_k and sum_k F_k p_k* on them, (k, lines, l) each.
    values : array of complex, (k,)
        x_j.
    points : array of complex, (F,)
        x of all lines.
    """

    sums: Callable[[IntArray], tuple[ComplexArray, ComplexArray]]
    values: Array
    points: ComplexArray

    def on(self, lines: IntArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the rows at some lines and at their mirror images, (k, lines, l) each."""
        (at, mirrored), x = self.sums(lines), self.points[lines]
        at *= (x - self.values[:, None])[:, :, None]
        mirrored *= (x.conj() - self.values[:, None])[:, :, None]
        return at, mirrored


def line_pencil(polynomials: ComplexArray, points: ComplexArray, left: Array, values: Array) -> LinePencil:
    """Return the pencil of rows F_j (k, q, l), outputs in their own unit; polynomials (F, q) of the block rows."""
    F = np.asarray(left, dtype=complex)
    return LinePencil(lambda lines: both_sums(polynomials[lines], F), values, points)


@dataclass(frozen=True, eq=False)
class FunctionRows:
    """Rows F_j = s_j P' whose blocks are polynomials: functions of the lines.

    Parameters
    ----------
    polynomials : array of complex, (F, q)
        Of the block rows.
    points : array of complex, (F,)
    basis : array, (q, l, n)
        P, outputs in their own unit.
    """

    polynomials: ComplexArray
    points: ComplexArray
    basis: RealArray

    @cached_property
    def functions(self) -> RealArray:
        """Real and imaginary parts of sum_k p_k P_k on all lines, (2, n, F, l)."""
        (lines, blocks), channels = self.polynomials.shape, self.basis.shape[1:]
        parts = np.stack([self.polynomials.real, self.polynomials.imag]) @ self.basis.reshape(blocks, -1)
        return np.ascontiguousarray(np.moveaxis(parts.reshape(2, lines, *channels), 3, 1))

    def pencil(self, states: Array, values: Array) -> LinePencil:
        """Return the rows of F (E1 - x E0), by s (k, n' <= n)."""

        def sums(lines: IntArray) -> tuple[ComplexArray, ComplexArray]:
            some = self.functions[:, : states.shape[1]]
            some = some if lines.size == len(self.points) else some[:, :, lines]
            shape = len(states), lines.size, some.shape[3]
            real, imaginary = (times_real(states, part.reshape(len(part), -1)).reshape(shape) for part in some)
            imaginary *= 1j
            return real + imaginary, real - imaginary

        return LinePencil(sums, values, self.points)
