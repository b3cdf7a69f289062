"""Base classes of block matrices whose columns are frequency lines: their weights, right factors, sides and gradients.

The right factor, rows over lines, is brought back from the triangular factor where it is asked for. The plain form of rows of
polynomials is in `modalscope.identification.matrices.lines`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.response import Misfit
from modalscope.data.responses import FrequencyResponse
from modalscope.identification.matrices.evolved import ModalSide, OnLines
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import FullMatrix, pencil_of
from modalscope.identification.matrices.influence import LineInfluence, Lines, Outer, all_lines
from modalscope.identification.matrices.lines import PolynomialRows
from modalscope.identification.matrices.matrix import Eigen, ModalFit, RowShift, Triple
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, check_shifts, real_array
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import LineData, line_basis, line_data
from modalscope.numerics.functions.polynomials import both_sums, evaluate
from modalscope.numerics.operators import DenseMatrix, Operator, real_times
from modalscope.numerics.sums import TriangleSum


@dataclass(frozen=True, eq=False)
class LinePencil:
    """What rows F_j (E1 - x_j E0) of polynomials are on lines: (x - x_j) sum_k F_k p_k(x), for E1 is multiplication by x there.

    `sums`: lines -> sum_k F_k p_k and sum_k F_k p_k* on them, (k, lines, l) each. `values` (k,): x_j. `points` (F,): x of all lines.
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


#: Maximum number of lines of each input in the indicators of the columns.
_MAX_COMPARED_LINES = 1000

#: Minimum share of a mode in its columns after elimination: below it columns are rounding.
_MIN_SHARE_LEFT = 1e-8


def line_weights(response: FrequencyResponse, weights: str | ArrayLike | None) -> RealArray | None:
    """Return one positive weight per line.

    `weights` (F,): 1 / standard deviation of the estimate averaged over channels; from coherence g2 by var = |H|^2 (1 - g2) / g2; or the
    inverse of the root mean square level of the response, which makes weak modes count.
    """
    if weights is None:
        return None
    if not isinstance(weights, str):
        array = real_array("weights", weights, "(lines,)", 1)
        if array.size != response.lines or np.any(array <= 0):
            raise DataError(
                f"weights needs {response.lines} positive entries",
                f"it has {array.size}" + (f", the smallest {array.min():g}" if array.size else ""),
                "Give one per line.",
            )
        return array
    power = np.mean(np.abs(response.values) ** 2, axis=(1, 2))
    if weights == "level":
        variance = power
    elif weights == "variance" and response.variance is not None:
        variance = np.mean(response.variance, axis=(1, 2))
    elif weights == "coherence" and response.coherence is not None:
        g2 = np.clip(response.coherence.reshape(response.lines, -1), 1e-6, 1)
        variance = power * np.mean((1 - g2) / g2, axis=1)
    else:
        have = [name for name in ("variance", "coherence") if getattr(response, name) is not None]
        raise DataError(
            f"weights={weights!r}:",
            f"the response carries {' and '.join(have) or 'neither variance nor coherence'}",
            "Use weights='level', give one per line, or None.",
        )
    floor = 1e-6 * variance.max()
    return np.asarray(np.sqrt(variance.max() / np.maximum(variance, floor))) if floor > 0 else None


def kept_block_rows(shifts: ArrayLike | None) -> tuple[int, ...] | None:
    """Return which block rows are kept, sorted, or raise; None keeps all."""
    return None if shifts is None else tuple(sorted(check_shifts("row_shifts", shifts)))


class VectorsOnLines(NamedTuple):
    """Right vectors over the lines by their coefficients: few lines stand for all where noise is summed, and only those are made.

    `whole` (m, 2 F, n): the right factor of every input, real parts above imaginary ones. `coefficients` (n, k).
    """

    whole: RealArray
    coefficients: Array

    def parts(self, lines: slice | IntArray = slice(None)) -> tuple[Array, Array]:
        """Return real and imaginary rows on some lines, (k, lines, m) each."""
        count = self.whole.shape[1] // 2
        halves = self.whole[:, :count], self.whole[:, count:]
        real, imaginary = (real_times(half[:, lines], self.coefficients).transpose(2, 1, 0) for half in halves)
        return real, imaginary


class RowsOnLines(FullMatrix):
    """A block matrix that stands for many columns on lines: its rows through one exact triangular factor.

    A concrete matrix gives `triangle` and `full_shift`, and what every `DataMatrix` must give.
    """

    row_shifts: tuple[int, ...] | None

    @property
    @abstractmethod
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): the matrix times an orthonormal matrix: it has the same singular values."""

    @property
    @abstractmethod
    def full_shift(self) -> RowShift:
        """E0 and E1 on all q + 1 block rows."""

    @property
    def kept_rows(self) -> IntArray:
        """Rows of the q block rows that H(0) and H(1) keep: all, unless block rows were chosen."""
        blocks = np.arange(self.block_rows) if self.row_shifts is None else np.asarray(self.row_shifts)
        return (blocks[:, None] * self.outputs + np.arange(self.outputs)).ravel()

    def shifted(self, k: int) -> Operator:
        """Return H(k): E0 and E1 applied to the triangular factor."""
        part = self.full_shift.split(self.triangle)[k]
        return DenseMatrix(part if self.row_shifts is None else part[self.kept_rows])

    def tall(self) -> Operator:
        """Return all q + 1 block rows."""
        self._need_all_rows()
        return DenseMatrix(self.triangle)

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1."""
        self._need_all_rows()
        return self.full_shift

    def _need_all_rows(self) -> None:
        if self.row_shifts is not None:
            raise DataError(
                "a shift of the rows:",
                f"only block rows {', '.join(map(str, self.row_shifts))} are kept, which have no shift",
                "Use method='era' or 'least_squares', or omit row_shifts.",
            )

    def pencil(self, left: Array, values: Array, *, tall: bool) -> Any:
        """Return L_j on all q + 1 block rows, of which H(0) may keep some."""
        F = np.zeros((len(left), self.outputs * self.block_rows), dtype=complex)
        F[:, self.kept_rows] = left
        return pencil_of(self.full_shift, F, values, self.outputs * (self.block_rows + 1))

    def right_vectors(self, factors: Factors, coefficients: Array) -> Any:
        """Return v_j over the lines, made where they are asked."""
        if factors.right is None:
            self._has_no("right factor over lines")
        return VectorsOnLines(factors.right.whole[:, :, : len(coefficients)], np.asarray(coefficients))

    def row_blocks(self, P: Array) -> RealArray | None:
        """Return a left factor (rows, k) by block rows, (blocks, l, k); None where it is that of fewer rows than H(0) has."""
        return None if P.shape[0] < self.block_rows * self.outputs else P.reshape(-1, self.outputs, P.shape[1])

    def block_indices(self, count: int) -> IntArray:
        """Return which block rows a left factor of `count` blocks stands for."""
        return np.arange(count) if self.row_shifts is None else np.asarray(self.row_shifts)


class LineMatrix(RowsOnLines):
    """A block matrix whose columns are lines, real and imaginary parts side by side, input by input.

    A concrete matrix gives `inputs`, `columns_array`, `column_functions`, `residue_scale` and `level`, and what `RowsOnLines` must give.
    """

    @property
    @abstractmethod
    def inputs(self) -> int:
        """Columns of a line."""

    @abstractmethod
    def columns_array(self, i: int) -> RealArray:
        """Return all block rows for input i, transposed: (2 F, l (q + 1))."""

    @abstractmethod
    def column_functions(self, poles: Array) -> tuple[ComplexArray, RealArray]:
        """Return what runs along the columns of one input for modes at these poles, (2 F, k), and the share not eliminated (k,)."""

    @abstractmethod
    def residue_scale(self, poles: Array) -> ComplexArray:
        """Return participation as the columns have it for one of a mode: (k,)."""

    @property
    @abstractmethod
    def level(self) -> RealArray:
        """Size of the response on every line, (F,)."""

    @cached_property
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): the matrix times an orthonormal matrix, its exact stand-in, input by input."""
        total = TriangleSum(self.outputs * (self.block_rows + 1))
        for i in range(self.inputs):
            total.add(self.columns_array(i))
        return np.ascontiguousarray(total.finish().T)

    @cached_property
    def compared_lines(self) -> IntArray:
        """Lines on which the right factor is compared with what modes must be: all, of many some evenly and the strongest."""
        level = self.level
        if level.size <= _MAX_COMPARED_LINES:
            return np.arange(level.size)
        evenly = np.linspace(0, level.size - 1, _MAX_COMPARED_LINES // 2).astype(int)
        return np.union1d(evenly, np.argsort(-level, kind="stable")[: _MAX_COMPARED_LINES // 2])

    def with_columns(self, factors: Factors) -> Factors:
        """Return the factors with their rows of Q over the lines: Q itself, or H' P d^-1 for when they are asked."""
        return replace(factors, right=LineColumns(self, factors))

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the rows of W over the lines against b_j / (x_i - s_j) at +w and -w, without what was eliminated.

        There is no last block: every line stands for itself.
        """
        if model.factors is None or model.factors.right is None:
            return None
        n = model.rank
        states = model.factors.d[:n, None] ** (1 - model.power) * eigen.left.T
        functions, share = self.column_functions(eigen.values)
        real, imaginary = np.split(functions[self.both_parts].T, 2, axis=1)
        both = np.stack([real + 1j * imaginary, real - 1j * imaginary])
        participation = self.residue_scale(eigen.values) * fit.participation.T
        return OnLines(model.factors.right.blocks[:, :n], states, both, participation, share > _MIN_SHARE_LEFT)

    @cached_property
    def both_parts(self) -> IntArray:
        """Real and imaginary parts of the lines that are compared."""
        return np.concatenate([self.compared_lines, len(self.level) + self.compared_lines])


@dataclass(frozen=True, eq=False)
class LineColumns:
    """The right factor over the lines that indicators compare, computed when it is first asked for.

    `factors`: of the triangular stand-in.
    """

    matrix: LineMatrix
    factors: Factors

    @cached_property
    def blocks(self) -> RealArray:
        """Q' (m, k, 2 F') of every input, on the lines that are compared."""
        return np.ascontiguousarray(self.whole[:, self.matrix.both_parts].transpose(0, 2, 1))

    @cached_property
    def whole(self) -> RealArray:
        """Rows of Q (m, 2 F, k) of every input."""
        matrix, factors = self.matrix, self.factors
        if len(factors.Q) == 2 * len(matrix.level) * matrix.inputs:
            return factors.Q.reshape(matrix.inputs, 2 * len(matrix.level), -1)
        n = max(min(factors.rank, factors.d.size), 1)
        rows = factors.P.shape[0]
        everything = rows == matrix.outputs * (matrix.block_rows + 1)
        kept = np.arange(rows) if everything else matrix.kept_rows
        back = factors.P[:, :n] / factors.d[:n]
        pick = slice(None) if kept.size == matrix.triangle.shape[0] else kept
        return np.stack([matrix.columns_array(i)[:, pick] @ back for i in range(matrix.inputs)])


class FullPolynomialRows(RowsOnLines, PolynomialRows):
    """Rows of polynomials with their pencils and their influence.

    A concrete matrix has the fields of `PolynomialRows`, and weights of the lines.
    """

    weights: RealArray | None

    @property
    def full_shift(self) -> RowShift:
        """E0 drops the last block, E1 = h' (x) I."""
        return RowShift(block=self.outputs, recurrence=self.recurrence)

    def polynomials(self, lines: slice | IntArray) -> ComplexArray:
        """Return p_k on some lines, (lines, q + 1)."""
        return np.asarray(self.basis[lines])

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return p_k(x) / p_0 at the poles."""
        return evaluate(self.recurrence, 1.0, poles)[self.block_indices(blocks)]

    def influence(self, left: Any, right: Any, lines: Lines | None = None) -> LineInfluence:
        """Return the gradient: the row on the lines by output times the right vector by input, on dH; the mirror image on dH*.

        The rows come as a `LinePencil`.

        What is eliminated is orthogonal to the right vectors already.
        """
        kept = all_lines(self.response.count) if lines is None else lines
        index = kept.used
        at, mirrored = left.on(index)
        w = 0.5 if self.weights is None else self.weights[index] / 2
        real, imaginary = right.parts(index)
        upper, lower = (real - 1j * imaginary), (real + 1j * imaginary)
        half = np.broadcast_to(w, index.shape)[:, None]
        return LineInfluence((Outer(at, upper * half),), (Outer(mirrored, lower * half),), kept)


class FittedToLines(FullMatrix):
    """A matrix of a response on lines whose shapes come from its rows; participation is fitted to the lines.

    A concrete matrix has the fields below, and `mode_shapes`.
    """

    response: FrequencyResponse
    output_scale: RealArray
    weights: RealArray | None
    fits_states = True

    @abstractmethod
    def mode_shapes(self, model: Triple, eigen: Eigen) -> ComplexArray:
        """Return the shapes (l, k) of the modes of a model, from its rows as a rule."""

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes as they are known best; participation and direct term by least squares over the lines."""
        shapes = self.mode_shapes(model, eigen)
        lines, poles = self.response, self.to_s(eigen.values)
        basis = line_basis(lines.frequencies, lines.sampling_rate, self._line_data, poles, (0,), self.weights)
        participation = basis.solved(shapes)
        fit = ModalFit(shapes, participation.side, participation.terms, reach=basis.reach, basis=basis)
        if self.weights is not None:
            return fit
        return replace(fit, misfit=self._misfit.of_left(participation.left), unexplained=participation.unexplained)

    @cached_property
    def _line_data(self) -> LineData:
        return line_data(self.response.values, self.weights)

    @cached_property
    def _misfit(self) -> Misfit:
        return Misfit(self.response, self.output_scale)
