"""The likelihood of modes in records: every pole is driven by all inputs and by the ends of every run, in one column of outputs.

    Y_o(x) = sum_j c_oj (b_j' d(x)) / (x - p_j) + conjugate + D_o U(x),      d = [U; ends]

Participation of inputs and ends together is the side b_j that varies, unit vectors after division of each drive by its size; shapes and D
are eliminated. The rows are compressed at every point to the span of what the modes give and of its derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from modalscope.identification.likelihood import Point, Whitened, across, orthonormal
from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.model.driven_lines import DrivenLines
from modalscope.model.record_spectra import RecordSpectra

__all__ = ["DrivenWhitened", "whitened_records"]


@dataclass(frozen=True, eq=False, slots=True)
class DrivenWhitened(Whitened):
    """Records whose noise is white and of one deviation, without what terms explain.

    Parameters
    ----------
    light : RecordSpectra
        One output.
    lines : DrivenLines
        Of the drives divided by their sizes, 1 / `varying`.
    """

    light: RecordSpectra
    lines: DrivenLines = field(kw_only=True)

    @property
    def parts(self) -> IntArray | None:
        """The run that each row belongs to, (K,)."""
        return np.tile(self.light.run, 2)

    def at(self, poles: ComplexArray, sides: ComplexArray, *, slopes: bool = True) -> Point:
        """Return the likelihood at poles (n,) and unit vectors (n, m + R), and all that a step needs unless there is to be none."""
        n, p = sides.shape
        where = self.light.in_plane(poles)
        columns = self.lines.columns(where, sides)
        if slopes:
            moved = [self.lines.columns(where, sides, self.light.chain(poles))]
            moved += [self.lines.columns(where, side) for side in across(sides).transpose(2, 0, 1)]
            columns = np.hstack([columns, np.stack(moved, axis=2).reshape(-1, n * p)])
        both = np.stack([columns.real, -columns.imag], axis=2).reshape(len(columns), -1) / self.rows[:, None]
        both -= self.terms @ (self.terms.T @ both)
        Q, R, Z, beyond = self.compressed(both)
        own = R[:, ::2] - 1j * R[:, 1::2]
        return DrivenPoint(self, poles, sides, own[:, :n], own[:, n:], Z[:, :, None], beyond[:, None], Q)


@dataclass(frozen=True, eq=False, slots=True)
class DrivenPoint(Point):
    """Poles and unit vectors in records; `own` are the columns of the modes (K, n), `derived` those of their unknowns (K, n p)."""

    def columns(self) -> ComplexArray:
        """Return what the modes give, (K, n)."""
        return self.own

    def directions(self) -> ComplexArray:
        """Return its derivatives by the pole and by b across itself, (K, n p), mode by mode."""
        return self.derived


def whitened_records(
    records: RecordSpectra, fixed: Array, powers: tuple[int, ...], rows: RealArray, outputs: RealArray
) -> DrivenWhitened:
    """Divide records by the deviation of rows and outputs, the drives by their size, and take out what the terms explain.

    Parameters
    ----------
    records : RecordSpectra
    fixed, powers, rows, outputs
        As in `likelihood.whitened`.
    """
    basis = records.whole_basis(fixed, powers)
    terms = orthonormal(basis.columns / rows[:, None])
    flat = basis.data[:, :, 0] / rows[:, None] / outputs
    flat = flat - terms @ (terms.T @ flat)
    lines = records.lines
    size = np.sqrt(np.mean(np.abs(lines.drives) ** 2, axis=0))
    size[lines.inputs :] = 1
    size = np.where(size > 0, size, 1)
    light = records.select(outputs=[0])
    return DrivenWhitened(light, rows, terms, flat[:, :, None], outputs, 1 / size, False, lines=lines.divided(size))
