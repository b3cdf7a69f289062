"""Block matrices of frequency response functions on the lines of any band, z- and s-domain (Eqs. 82, 89-93, corrected).

The rows are p_k(x_i) H(x_i), with polynomials p_k orthogonal on the measured lines instead of powers of x. From
x^k H = C A^k X + (a polynomial of degree k whose matrix coefficients are the direct term and the initial values) it follows
that p_k(x) H = C p_k(A) X + (a polynomial of degree k). Where its coefficients are unknown it is removed by projecting the columns
on the complement of p_0, ..., p_q; the remainder is [C p_0(A); ...; C p_q(A)] X, whose row shift is the recurrence of the basis.
Columns are real: real and imaginary parts side by side, which is the same as using the lines at -w too.

The matrix is wide (lines times inputs); a triangular factor of as many columns as rows has the same left factor, singular values and
products, and stands in for it. Options of a row beyond its size are in `modalscope.identification.matrices.transfer`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as sla

from modalscope.data.response import output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.identification.matrices.hankel import MAX_COMPANION_STATES, SHORT_SIDE_SHARE
from modalscope.identification.matrices.matrix import DataMatrix, Eigen, ModalFit, RowShift, Triple
from modalscope.identification.method import Built, Problem, fewer_outputs, refuse
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.polynomials import Plane, evaluate, orthogonal_basis, plane_of
from modalscope.numerics.handed import handed, replaceable
from modalscope.numerics.operators import DenseMatrix, Operator

#: Maximum number of rows of transfer functions on lines, whose cube counts, and of rows times lines. Rows and degree that are always
#: allowed.
_MAX_LINE_ROWS, _MAX_LINE_NUMBERS, _CHEAP_ROWS, _CHEAP_DEGREE = 800, 1_500_000, 600, 48


# ------------------------------------------------------------------------------------------------------ of a row's problem


def transfer_of_lines(problem: Problem, order: int) -> Built:
    """Return transfer functions on the lines of any band, initial terms eliminated."""
    options, response = problem.options, problem.response
    if options.source == "samples":
        asked = f"source='samples' in domain {problem.method.domain!r}:"
        raise DataError(asked, "samples need domain='z'", "Omit it, or use domain='z'.")
    refuse(options, "the columns of a frequency-domain matrix are lines", "block_columns")
    if not isinstance(response, FrequencyResponse):
        raise DataError("source='elimination':", "the data are samples, not lines", "Omit it.")
    degree = options.block_rows or default_degree(response, order, truncates=problem.method.orders.truncates)
    names = ("weights", "basis", "initial_values", "row_shifts")
    further = {name: value for name in names if (value := getattr(options, name)) is not None}
    if "weights" in further:
        further["weights"] = handed("line_weights")(response, further["weights"])
    few = None if "initial_values" in further else fewer_outputs(response, order, options)
    matrix = transfer(
        response if few is None else few.response,
        domain=problem.method.domain,
        block_rows=degree,
        order=order,
        equal_outputs=few is None,
        **further,
    )
    settings = replace(options, block_rows=matrix.block_rows, source="elimination")
    return Built(matrix if few is None else few.whole(response, matrix), settings)


@replaceable("transfer_of_response")
def transfer_of_response(problem: Problem, order: int) -> Built:
    """Return the same in z; samples of a window have a matrix of their own, `modalscope.identification.matrices.shifted`."""
    return transfer_of_lines(problem, order)


def default_degree(response: FrequencyResponse, order: int, *, truncates: bool = True) -> int:
    """Return the degree q: a third of the lines, less where there are many lines and outputs.

    Real and imaginary parts of F lines are N = 2 F numbers, and the degree stands for the block rows of samples: with q = N / 6 the
    deviations are 1.2 times the least in z (see `default_windows`). In s, where polynomials have 2 / pi of the zeros in the middle of the
    band, it is 1.4 there; with many more they would be as many as the lines, and take away all there is, beyond sqrt(1 - (q / N)^2) of it.
    Work goes with lines times squared rows and with their cube: no more than 800 rows, and 1.5 million rows times lines, but up to 600 rows
    and a degree of 48 always. The variance goes with 1 / rows: 2000 lines give 1.7 times the least, 48 gave 3 times. Where all block rows
    are states there are 240 of them, or as many as a degree of 48 has. At least 8 and what the order needs, as far as the
    lines carry them.

    `truncates`: whether directions are cut off, so that more rows are no more states.
    """
    lines, outputs, inputs = response.values.shape
    most = min(_MAX_LINE_ROWS, _MAX_LINE_NUMBERS // lines) if truncates else MAX_COMPANION_STATES
    rows = max(most, min(_CHEAP_ROWS, _CHEAP_DEGREE * outputs))
    wanted = max(min(2 * lines // SHORT_SIDE_SHARE, rows // outputs), 8, -(-order // outputs) + 1)
    carried = (2 * lines * inputs - order) // inputs - 1
    return int(max(min(wanted, carried), 1))


# ------------------------------------------------------------------------------------------------------------- the matrix


def real_columns(columns: ComplexArray, weights: Array | None = None) -> RealArray:
    """Return weighted functions of the lines, (F, k) -> (2 F, k): real parts, then imaginary parts."""
    weighted = columns if weights is None else columns * weights[:, None]
    return np.vstack([weighted.real, weighted.imag])


class OnPlane(DataMatrix):
    """A matrix of lines taken to points of a plane: its poles lie there."""

    plane: Plane

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return self.plane.to_s(poles)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles in that plane."""
        return self.plane.from_s(poles)

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None in the s-domain and under the bilinear map."""
        return self.plane.dt


class PolynomialRows(OnPlane):
    """A matrix whose rows are [C p_0(A); ...; C p_q(A)] times states, outputs divided by their scale.

    A concrete matrix has the fields below, and `triangle`.
    """

    basis: ComplexArray
    recurrence: RealArray
    output_scale: RealArray

    @property
    @abstractmethod
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): the matrix times an orthonormal matrix, its exact stand-in."""

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0), which is the degree q."""
        return int(self.recurrence.shape[1])

    @property
    def row_shift(self) -> RowShift:
        """E0 drops the last block, E1 = h' (x) I."""
        return RowShift(block=self.outputs, recurrence=self.recurrence)

    def shifted(self, k: int) -> Operator:
        """Return H(k): E0 and E1 applied to the triangular factor."""
        return DenseMatrix(self.row_shift.split(self.triangle)[k])

    def tall(self) -> Operator:
        """Return all q + 1 block rows."""
        return DenseMatrix(self.triangle)

    @property
    def first_value(self) -> float:
        """p_0, the constant of the basis."""
        return float(self.basis[0, 0].real)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return (first block row of H(k) / p_0) X, such that C = first_rows(Q d^-1/2)."""
        head = self.triangle[: self.outputs]
        if k == 1:  # x p_0 = h_00 p_0 + h_10 p_1
            head = self.recurrence[0, 0] * head + self.recurrence[1, 0] * self.triangle[self.outputs : 2 * self.outputs]
        return np.asarray(self.output_scale[:, None] * (head @ right) / self.first_value)

    def first_block(self, shapes: Array) -> Array:
        """Return C p_0 for shapes C, in the scale of the rows."""
        return np.asarray(shapes) / self.output_scale[:, None] * self.first_value

    def block_indices(self, count: int) -> IntArray:
        """Return which block rows a left factor of `count` blocks stands for."""
        return np.arange(count)

    def shapes(self, V: Array, poles: Array) -> ComplexArray:
        """Return the shapes c of modes from their columns [c p_0; c p_1; ...] of the row factor, by least squares over all blocks.

        The first block alone would do, but far from the axis the polynomials grow beyond 1e15, relative to which it is rounding. Where they
        overflow c is zero: V has nothing of that size.

        `V` (l K, k): row factor times eigenvectors. `poles` (k,): in the plane of the polynomials.
        """
        blocks = np.asarray(V).reshape(-1, self.outputs, len(poles))
        p = evaluate(self.recurrence, self.first_value, poles)[self.block_indices(len(blocks))]
        size = np.max(np.abs(p), axis=0)
        overflow = ~np.isfinite(size)
        p[:, overflow], size[overflow] = 1, np.inf
        unit = p / np.where(overflow, 1, size)
        c = np.einsum("kn,kln->ln", unit.conj(), blocks) / np.sum(np.abs(unit) ** 2, axis=0) / size
        return np.asarray(self.output_scale[:, None] * c)


@dataclass(frozen=True, eq=False)
class Transfer(PolynomialRows):
    """The block matrix of one band, through its exact triangular factor (made by `transfer`).

    `basis` (F, q + 1): p_k on the lines. `eliminated` (2 F, e): orthonormal columns that every input's columns are projected off.
    """

    response: FrequencyResponse
    plane: Plane
    basis: ComplexArray
    recurrence: RealArray
    output_scale: RealArray
    eliminated: RealArray

    def columns_array(self, i: int) -> RealArray:
        """Return all block rows of input i without the initial terms, transposed: (2 F, l (q + 1))."""
        rows = self.basis[:, :, None] * self.response.values[:, None, :, i]
        return self.projected_off(real_columns((rows / self.output_scale).reshape(len(self.basis), -1)))

    def projected_off(self, columns: Array) -> Array:
        """Project the eliminated columns out: twice, so that the remainder is orthogonal to rounding."""
        real = np.ascontiguousarray(columns).view(float)  # complex columns as twice as many real ones
        for _ in range(2):
            real = real - self.eliminated @ (self.eliminated.T @ real)
        return real.view(columns.dtype)

    @cached_property
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): the matrix times an orthonormal matrix, its exact stand-in."""
        columns = np.vstack([self.columns_array(i) for i in range(self.response.values.shape[2])])
        R = sla.qr(columns, mode="r", check_finite=False)[0]
        return np.ascontiguousarray(R[: R.shape[1]].T)

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes by the rows; participation and direct term by least squares over the lines."""
        shapes = self.shapes(model.row_states(eigen.vectors), eigen.values)
        basis = self.response.basis(self.to_s(eigen.values))
        participation, terms = basis.fit_participation(shapes)
        return ModalFit(shapes, participation, terms, reach=basis.reach, basis=basis)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        f = self.response.frequencies
        lines = f"transfer functions on {f.size} lines, {f[0]:g} to {f[-1]:g} Hz"
        return f"{lines}, polynomials to degree {self.block_rows} ({self.plane.name}); initial terms eliminated"


@replaceable("transfer")
def transfer(
    response: FrequencyResponse,
    *,
    domain: str,
    block_rows: int,
    order: int | None = None,
    equal_outputs: bool = True,
    **further: Any,
) -> DataMatrix:
    """Stack p_k(x_i) H(x_i), k = 0 ... q = block_rows, and eliminate the initial terms.

    `order`: largest number of states that will be asked; used to check that the lines suffice. `equal_outputs`: divide every output by
    its root mean square over the band, so that quiet outputs count as much as loud ones in the truncation; shapes are scaled back.

    Raises `DataError`: fewer lines than unknowns: 2 F m must be at least n + (q + 1) m.
    """
    lines, outputs, inputs = response.values.shape
    need, have = (order or 1) + (block_rows + 1) * inputs, 2 * lines * inputs
    if have < need or further:
        raise DataError(
            f"a plain matrix of degree {block_rows} for order {order}{''.join(f', {n}' for n in further)}:",
            f"2 x lines x inputs are {have}, order + (degree + 1) x inputs {need}",
            "Widen the band, lower block_rows or the order, or omit options.",
        )
    plane = plane_of(domain, response.span[1], response.sampling_rate)
    basis, recurrence = orthogonal_basis(plane.point(response.frequencies), block_rows)
    scale = output_scale(response) if equal_outputs else np.ones(outputs)
    return Transfer(response, plane, basis, recurrence, scale, real_columns(basis))
