"""Compute the likelihood of modes in records with inputs, transients of every run included.

    Y_o(x) = sum_j c_oj (b_j' d(x)) / (x - p_j) + conjugate + D_o U(x),      d = [U; ends]

Participation of inputs and ends together is the side b_j that varies, unit vectors after division of each drive by its size; shapes and D
are eliminated. The rows are compressed at every point to the span of what the modes give and of its derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from modalscope.data.record_spectra import RecordSpectra
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.driven_basis import DrivenLines
from modalscope.numerics.orthonormal import span_by_products, triangle_of
from modalscope.selection.likelihood.likelihood import Point, Whitened, across
from modalscope.selection.likelihood.matched import Peak, strongest_driven
from modalscope.selection.likelihood.whitening import Levels

#: Count of numbers in the columns of the rows that are computed at a time: 2 MB.
_BLOCK_NUMBERS = 1 << 18

#: Minimum length of a unit column after projection on those before it, for a Gram matrix to be accurate enough.
_MIN_COLUMN_REMAINDER = 1e-3

#: Singular values below this fraction of the largest are rounding.
_ROUNDING = 1e-11


@dataclass(frozen=True, eq=False, slots=True)
class DrivenWhitened(Whitened):
    """Records whose noise is white and of one deviation, without what terms explain.

    The divided data are made some lines at a time, where they are asked: of long records a copy is large.

    `light`: one output. `lines`: of the drives divided by their sizes, 1 / `varying`. `values` (F, q): outputs as they are. `taken` (t, q):
    what the terms have of the divided outputs. `squares` (q,): of what they leave, summed.
    """

    light: RecordSpectra
    lines: DrivenLines
    values: ComplexArray
    taken: RealArray
    squares: RealArray

    @property
    def channels(self) -> tuple[int, int]:
        """All outputs, and one side of all drives together."""
        return self.values.shape[1], 1

    @property
    def size(self) -> float:
        """Sum of the squares of the data."""
        return float(self.squares.sum())

    def releveled(self, levels: Levels) -> tuple[Whitened, RealArray]:
        """Return the data divided by other deviations of the outputs, those of a level at the one input; see `Whitened.releveled`."""
        linear = levels.outputs * levels.inputs[0]
        growth = self.linear / linear
        squares = self.squares * growth**2
        return replace(self, linear=linear, taken=self.taken * growth, squares=squares), growth[:, None]

    @property
    def parts(self) -> IntArray | None:
        """The run that each row belongs to, (K,)."""
        return np.tile(self.light.run, 2)

    def peaks(self, left: RealArray, known: Array, least: float) -> list[Peak]:
        """Return the strongest oscillation in a whitened residual (K, l, 1), its sides in the scale of the data."""
        found = strongest_driven(self.light, self.lines, left[:, :, 0], self.rows, known, least)
        return [Peak(peak.pole, peak.shape * self.linear, peak.participation * self.varying) for peak in found]

    def at(self, poles: ComplexArray, sides: ComplexArray, *, slopes: bool = True) -> Point:
        """Return the likelihood at poles (n,) and unit vectors (n, m + R), and all that a step needs unless there is to be none.

        Only the triangular factor of [terms, columns, data] is kept, not the rows.
        """
        n, p = sides.shape
        t, width = self.terms.shape[1], 2 * n * (1 + p if slopes else 1)

        def chunks() -> Iterator[RealArray]:
            for rows, columns, data in self.blocks(poles, sides, slopes=slopes):
                yield np.hstack([self.terms[rows], columns, data])

        R = triangle_of(chunks, t + width + self.channels[0], _MIN_COLUMN_REMAINDER)
        own = R[t : t + width, t : t + width]
        beyond = np.sum(R[t + width :, t + width :] ** 2, axis=0)
        Z, taken = R[t : t + width, t + width :], R[:t, :t].T @ R[:t, t : t + width]
        each = own[:, ::2] - 1j * own[:, 1::2]
        return DrivenPoint(self, poles, sides, each[:, :n], each[:, n:], Z[:, :, None], beyond[:, None], (taken, own))

    def blocks(
        self, poles: ComplexArray, sides: ComplexArray, *, slopes: bool
    ) -> Iterator[tuple[IntArray, RealArray, RealArray]]:
        """Yield the rows of some lines, and on them the functions of the modes and their derivatives, with terms, and the data.

        Derivatives are by the pole and by b across itself.
        """
        n, p = sides.shape
        where, chain, count = self.light.in_plane(poles), self.light.chain(poles), len(self.lines.points)
        width = 2 * n * (1 + p if slopes else 1)
        step = max(_BLOCK_NUMBERS // (2 * width), 1)
        for start in range(0, count, step):
            s = slice(start, min(start + step, count))
            lines = DrivenLines(self.lines.points[s], self.lines.drives[s], self.lines.inputs)
            both = np.empty((2 * (s.stop - s.start), width))
            _lay(both[:, : 2 * n], lines.columns(where, sides), 1)
            if slopes:
                moved = both[:, 2 * n :]
                _lay(moved, lines.columns(where, sides, chain), p)
                for k, side in enumerate(across(sides).transpose(2, 0, 1), start=1):
                    _lay(moved[:, 2 * k :], lines.columns(where, side), p)
            rows = np.concatenate([np.arange(s.start, s.stop), count + np.arange(s.start, s.stop)])
            both /= self.rows[rows, None]
            data = _divided(self.values[s], self.rows[rows], self.linear)
            data -= self.terms[rows] @ self.taken
            yield rows, both, data


@dataclass(frozen=True, eq=False, slots=True)
class DrivenPoint(Point):
    """Poles and unit vectors in records; `own` are the columns of the modes (K, n), `derived` those of their unknowns (K, n p).

    `basis`: the part of the columns in the terms (t, c), and the triangular factor of the remainder (c, c).
    """

    def spanned(
        self, coefficients: RealArray, lines: int | None = None
    ) -> Iterator[tuple[slice | IntArray, RealArray, RealArray]]:
        """Yield the rows of some lines, (columns - terms T'columns) R^-1 coefficients (c, k) there, and the data; see `Point.spanned`."""
        taken, R = self.basis
        assert R is not None
        size = np.maximum(np.linalg.norm(R, axis=0), 1e-300)
        weights = sla.lstsq(R / size, coefficients, cond=_ROUNDING, check_finite=False)[0] / size[:, None]
        problem, slopes = self.problem, self.derived.shape[1] > 0
        assert isinstance(problem, DrivenWhitened)
        for rows, columns, data in problem.blocks(self.poles, self.sides, slopes=slopes):
            yield rows, columns @ weights - problem.terms[rows] @ (taken @ weights), data[:, :, None]

    def columns(self) -> ComplexArray:
        """Return what the modes give, (K, n)."""
        return self.own

    def directions(self) -> ComplexArray:
        """Return its derivatives by the pole and by b across itself, (K, n p), mode by mode."""
        return self.derived


def _lay(place: RealArray, columns: ComplexArray, apart: int) -> None:
    """Put real parts and minus imaginary parts side by side, every pair `apart` pairs from the one before."""
    place[:, :: 2 * apart] = columns.real
    place[:, 1 :: 2 * apart] = -columns.imag


def _divided(values: ComplexArray, rows: RealArray, outputs: RealArray) -> RealArray:
    """Return values on lines, (F, q) -> (2 F, q), real parts above imaginary ones, divided by the deviations of rows and outputs."""
    data = np.concatenate([values.real, values.imag])
    data /= rows[:, None]
    data /= outputs
    return data


def whitened_records(
    records: RecordSpectra, fixed: Array, powers: tuple[int, ...], rows: RealArray, outputs: RealArray
) -> DrivenWhitened:
    """Divide records by the deviation of rows and outputs, the drives by their size, and take out what the terms explain.

    `fixed`, `powers`, `rows`, `outputs`: as in `likelihood.whitened`.
    """
    light, lines, values = records.select(outputs=[0]), records.lines, records.values[:, :, 0]
    terms = span_by_products(light.whole_basis(fixed, powers).columns / rows[:, None])
    taken, whole = np.zeros((terms.shape[1], values.shape[1])), np.zeros(values.shape[1])
    step, count = max(_BLOCK_NUMBERS // values.shape[1], 1), len(values)
    for start in range(0, count, step):
        s = slice(start, start + step)
        data = _divided(values[s], np.concatenate([rows[:count][s], rows[count:][s]]), outputs)
        taken += np.concatenate([terms[:count][s], terms[count:][s]]).T @ data
        whole += np.einsum("kq,kq->q", data, data)
    size = np.sqrt(np.mean(np.abs(lines.drives) ** 2, axis=0))
    size[lines.inputs :] = 1
    size = np.where(size > 0, size, 1)
    left = np.maximum(whole - np.sum(taken**2, axis=0), 0)
    return DrivenWhitened(light, rows, terms, outputs, 1 / size, False, lines.divided(size), values, taken, left)
