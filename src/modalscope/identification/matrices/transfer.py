"""Block matrices of frequency response functions with known initial terms, weights, chosen block rows, or by their products.

What they are is said in `modalscope.identification.matrices.lines`, whose plain form they extend.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import derivatives_between, known_quantity
from modalscope.data.response import output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.identification.fast.line_products import LineProducts
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.line_columns import (
    FittedToLines,
    FullPolynomialRows,
    LineMatrix,
    LinePencil,
    kept_block_rows,
    line_pencil,
)
from modalscope.identification.matrices.lines import Transfer, real_columns
from modalscope.identification.matrices.matrix import Eigen, Triple
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count, real_array
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.polynomials import Plane, basis_on, plane_of, remainders
from modalscope.numerics.operators import Operator


def initial_terms(given: ArrayLike | str, response: FrequencyResponse, plane: Plane) -> RealArray:
    """Return the known terms scaled to the plane: H = D + sum_i M_i / x^(i+1), x = s / scale or z."""
    _, outputs, inputs = response.values.shape
    if plane.scale is None:
        raise DataError(
            "initial_values:",
            "the bilinear map mixes direct term and initial values",
            "Use domain='s', or omit them: they are eliminated.",
        )
    if isinstance(given, str):
        if given != "rest" or plane.dt is not None:
            raise DataError(
                f"initial_values={given!r}:",
                f"only arrays are possible, and 'rest' in the s-domain; this is the {plane.name}",
                "Give the terms (K, outputs, inputs), or omit them.",
            )
        # the terms D, CB, ... that vanish for a structure at rest: two for displacements, one for velocities
        quantity = known_quantity(response.quantity, "initial_values='rest':")
        return np.zeros((derivatives_between(quantity, "acceleration"), outputs, inputs))
    terms = real_array("initial_values", given, "(terms, outputs, inputs)", 3)
    if terms.shape[1:] != (outputs, inputs):
        raise DataError(
            f"initial_values needs shape (terms, {outputs}, {inputs})",
            f"it has {terms.shape}",
            "Give one matrix per term: D, CB, CAB, ...",
        )
    return np.asarray(terms / plane.scale ** np.arange(len(terms))[:, None, None])


#: Minimum number of rows at which products are cheaper than the triangular factor.
_MIN_PRODUCT_ROWS = 200


def transfer(
    response: FrequencyResponse,
    *,
    domain: str,
    block_rows: int,
    order: int | None = None,
    weights: ArrayLike | None = None,
    equal_outputs: bool = True,
    basis: str = "orthogonal",
    initial_values: ArrayLike | str | None = None,
    row_shifts: ArrayLike | None = None,
) -> FullTransfer:
    """Stack p_k(x_i) H(x_i), k = 0 ... block_rows, without the initial terms: known ones subtracted, the others eliminated.

    `response`: lines of any band. `block_rows`: q: H(0) holds p_0 ... p_(q-1), H(1) goes to p_q, which is the degree. `order`: largest
    number of states that will be asked; used to check that the lines suffice. `weights` (F,): weights of the lines. `equal_outputs`:
    divide every output by its root mean square over the band, so that quiet outputs count as much as loud ones in the truncation. Shapes
    are scaled back. `basis`: "powers" are the plain powers of the scaled x of the report: for comparison, they fail in noise.
    `initial_values` (K, l, m): the first K of D, CB, CAB, ... in SI units (in the z-domain D, Y(0), Y(1), ...), where they are known.
    "rest": those that are zero for a structure at rest by the response's quantity. `row_shifts`: which of p_0 ... p_(q-1) the rows of
    H(0) are (the arbitrary t_i of Eq. 82), 0 among them; block_rows is then one more than the largest.

    Raises `DataError`: fewer lines than unknowns: 2 F m must be at least n + e m, with e eliminated polynomials.

    Notes
    -----
    Source: the report, Eqs. 82 and 89-93, with the elimination and the basis made right (see the head of this module).
    """
    lines, outputs, inputs = response.values.shape
    rows = kept_block_rows(row_shifts)
    q = check_count("block_rows", block_rows if rows is None else rows[-1] + 1)
    plane = plane_of(domain, response.span[1], response.sampling_rate)
    terms = None if initial_values is None else initial_terms(initial_values, response, plane)
    unknown = q + 1 - (0 if terms is None else min(len(terms), q + 1))
    states = order or 1
    if 2 * lines * inputs < states + unknown * inputs:
        raise DataError(
            f"order {states} with block_rows={q} needs 2 x lines x inputs >= order + {unknown} x inputs = {states + unknown * inputs}",
            f"{lines} lines and {inputs} inputs give {2 * lines * inputs}",
            "Widen the band, lower block_rows or lower the order.",
        )
    w = None if weights is None else np.asarray(weights, dtype=float)
    points = plane.point(response.frequencies)
    values, recurrence = basis_on(points, q, w, basis)
    eliminated = real_columns(values[:, :unknown], w)
    if basis == "powers":
        eliminated = np.linalg.qr(eliminated)[0]
    return FullTransfer(
        response=response,
        plane=plane,
        basis=values,
        recurrence=recurrence,
        weights=w,
        output_scale=output_scale(response) if equal_outputs else np.ones(outputs),
        eliminated=eliminated,
        known=terms,
        known_functions=None
        if terms is None
        else remainders(recurrence, float(values[0, 0].real), points, min(len(terms), q + 1)),
        row_shifts=rows,
        orthogonal=basis == "orthogonal",
    )


@dataclass(frozen=True, eq=False)
class FullTransfer(FullPolynomialRows, LineMatrix, FittedToLines, Transfer):
    """The block matrix of one band, through its exact triangular factor (made by `transfer`)."""

    response: FrequencyResponse
    plane: Plane
    basis: ComplexArray
    recurrence: RealArray
    weights: RealArray | None
    output_scale: RealArray
    eliminated: RealArray
    known: RealArray | None = None
    known_functions: ComplexArray | None = None
    row_shifts: tuple[int, ...] | None = None
    orthogonal: bool = True

    @property
    def inputs(self) -> int:
        """Columns of a line."""
        return int(self.response.values.shape[2])

    @property
    def products(self) -> bool:
        """Whether products serve instead of the triangular factor: many rows of responses alone, and polynomials that are orthonormal."""
        rows, columns = self.outputs * len(self.basis[0]), 2 * len(self.basis) * self.inputs
        return self.orthogonal and self.known is None and _MIN_PRODUCT_ROWS < rows < columns

    def shifted(self, k: int) -> Operator:
        """Return H(k): p_k H and x p_k H by their products, or from the triangular factor."""
        if not self.products:
            return super().shifted(k)
        functions = self.basis[:, : self.block_rows] if k == 0 else self.basis @ self.recurrence
        return self._operator(functions[:, self.block_indices(self.block_rows)])

    def tall(self) -> Operator:
        """Return all q + 1 block rows."""
        return self._operator(self.basis) if self.products else super().tall()

    def _operator(self, functions: ComplexArray) -> LineProducts:
        weighted = functions if self.weights is None else functions * self.weights[:, None]
        return LineProducts(weighted, self.response.values / self.output_scale[:, None], self.eliminated)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return (first block row of H(k) / p_0) X; see `PolynomialRows.first_rows`."""
        if not self.products:
            return super().first_rows(right, k)
        functions = self.basis[:, :1] if k == 0 else (self.basis @ self.recurrence)[:, :1]
        head = self._operator(functions).times(right)
        return np.asarray(self.output_scale[:, None] * head / self.first_value)

    def first_of_states(self, factors: Factors) -> RealArray:
        """Return C, of products from the left factor, which begins with the first block row of H(0)."""
        if not self.products:
            return super().first_of_states(factors)
        head = factors.P[: self.outputs] * np.sqrt(factors.d)
        return np.asarray(self.output_scale[:, None] * head / self.first_value)

    def columns_array(self, i: int) -> RealArray:
        """Return all block rows of input i without the initial terms, transposed: (2 F, l (q + 1)).

        The polynomials are the same for every input, orthonormal in the real inner product.
        """
        rows = self.basis[:, :, None] * self.response.values[:, None, :, i]
        if self.known is not None and self.known_functions is not None:
            count = len(self.known_functions)
            rows = rows - np.einsum("tfk,to->fko", self.known_functions, self.known[:count, :, i], optimize=True)
        columns = real_columns((rows / self.output_scale).reshape(len(self.basis), -1), self.weights)
        return self.projected_off(columns)

    def column_functions(self, poles: Array) -> tuple[ComplexArray, RealArray]:
        """Return 1 / (x_i - s_j) along the columns of one input, as the elimination leaves it (2 F, k), and the share it leaves (k,).

        The state x follows from [Re X, Im X] with X(x_i) = (x_i I - A)^-1 B, so that a modal coordinate has the columns
        (g(x) + g(x*)) / 2 and (g(x) - g(x*)) / 2j with g = 1 / (x - s_j).
        """
        x = self._points[:, None]
        g, mirrored = 1 / (x - poles), 1 / (x.conj() - poles)
        w = 1.0 if self.weights is None else self.weights[:, None]
        whole = np.vstack([w * (g + mirrored) / 2, w * (g - mirrored) / 2j])
        left = self.projected_off(whole)
        return left, np.asarray(np.linalg.norm(left, axis=0) / np.linalg.norm(whole, axis=0))

    def pencil(self, left: Array, values: Array, *, tall: bool) -> LinePencil:
        """Return rows as functions of the lines."""
        return line_pencil(
            self._row_polynomials, self._points, left.reshape(len(left), -1, self.outputs) / self.output_scale, values
        )

    @property
    def _row_polynomials(self) -> ComplexArray:
        return self.basis[:, self.block_indices(self.block_rows)]

    @cached_property
    def _points(self) -> ComplexArray:
        return self.plane.point(self.response.frequencies)

    def residue_scale(self, poles: Array) -> ComplexArray:
        """Participation in this plane for participation of the modes: (k,)."""
        return np.asarray(self.plane.residue_scale(poles), dtype=complex)

    @cached_property
    def level(self) -> RealArray:
        """Size of the scaled response on every line, (F,)."""
        return np.asarray(np.linalg.norm(self.response.values / self.output_scale[:, None], axis=(1, 2)))

    def mode_shapes(self, model: Triple, eigen: Eigen) -> ComplexArray:
        """Return the shapes by the rows of the matrix."""
        return self.shapes(model.row_states(eigen.vectors), eigen.values)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        f = self.response.frequencies
        known = 0 if self.known is None else len(self.known)
        said = [
            f"transfer functions on {f.size} lines, {f[0]:g} to {f[-1]:g} Hz, polynomials to degree {self.block_rows} ({self.plane.name})",
            f"{known} initial terms known, the others eliminated" if known else "initial terms eliminated",
        ]
        if self.row_shifts is not None:
            said.append(f"block rows {', '.join(map(str, self.row_shifts))}")
        if self.weights is not None:
            said.append("weighted lines")
        return "; ".join(said)
