"""Block matrices of frequency response functions on the lines of any band, z- and s-domain (Eqs. 82, 89-93, corrected).

The rows are p_k(x_i) H(x_i), with polynomials p_k orthogonal on the measured lines instead of powers of x. From
x^k H = C A^k X + (a polynomial of degree k whose matrix coefficients are the direct term and the initial values) it follows
that p_k(x) H = C p_k(A) X + (a polynomial of degree k). Where its coefficients are unknown it is removed by projecting the columns
on the complement of p_0, ..., p_q; what is left is [C p_0(A); ...; C p_q(A)] X, whose row shift is the recurrence of the basis.
Columns are real: real and imaginary parts side by side, which is the same as using the lines at -w too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.factor import Cost, Factors, costs_of
from modalscope.blocks.lines import LineMatrix, PolynomialRows, kept_block_rows, real_columns
from modalscope.blocks.matrix import LinePencil, line_pencil
from modalscope.blocks.polynomials import Plane, basis_on, plane_of, remainders
from modalscope.blocks.triple import Eigen, Misfit, ModalFit, Triple
from modalscope.data.channels import derivatives_between, known_quantity
from modalscope.data.response import output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.functions.pole_basis import LineData, line_basis, line_data
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count, real_array
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import Operator, TransposedOperator

# ------------------------------------------------------------------------------------------------------- initial terms
# The first terms D, CB, CAB, ... of a response where they are known, in the plane of its matrix.


def initial_terms(given: ArrayLike | str, response: FrequencyResponse, plane: Plane) -> RealArray:
    """Return the known terms scaled to the plane: H = D + sum_i M_i / x^(i+1), x = s / scale or z."""
    _, outputs, inputs = response.values.shape
    if plane.scale is None:
        raise DataError(
            "initial_values were asked",
            "under the bilinear map the direct term and the initial values mix",
            "Use domain='s', or leave them out: they are eliminated.",
        )
    if isinstance(given, str):
        if given != "rest" or plane.dt is not None:
            raise DataError(
                f"initial_values={given!r} was asked",
                f"there are arrays, and 'rest' in the s-domain (this is the {plane.name})",
                "Give the terms (K, outputs, inputs), or leave them out.",
            )
        # the terms D, CB, ... that vanish for a structure at rest: two for displacements, one for velocities
        quantity = known_quantity(response.quantity, "initial_values='rest' was asked")
        return np.zeros((derivatives_between(quantity, "acceleration"), outputs, inputs))
    terms = real_array("initial_values", given, "(terms, outputs, inputs)", 3)
    if terms.shape[1:] != (outputs, inputs):
        raise DataError(
            f"initial_values needs shape (terms, {outputs}, {inputs})",
            f"it has {terms.shape}",
            "Give one matrix a term: D, CB, CAB, ...",
        )
    return np.asarray(terms / plane.scale ** np.arange(len(terms))[:, None, None])


# ------------------------------------------------------------------------------------------------------- line products
# Rows that are functions of the line times the responses, phi_r(x) H(x), without what polynomials explain: known by their products.
#
# Nothing of the size of the matrix exists. Its Gram matrix of rows needs the responses only through S(x) = H(x)* H(x)', the same for all
# pairs of functions, so that it costs as much as for one input, whatever their number:
#
#     (phi_r H_o)' (phi_s H_p) = Re sum_x conj(phi_r) phi_s sum_i conj(H_oi) H_pi.
#
# What the eliminated columns see of the rows is such a sum, too, with H in place of S; where they are the polynomials that the rows begin
# with, or the other way round, one pass over the pairs of functions gives both.

#: Numbers in an array in between, and the most lines taken at a time: what lies between two products stays in the cache.
_AT_A_TIME, _LINES = 2_000_000, 128

#: Inputs times outputs squared up to which sums over rows are cheaper than over pairs of functions, which move more memory.
_FEW = 25

#: Share of the rows' energy that the elimination must leave for the difference of two Gram matrices to be told from rounding.
_LEFT = 1e-6


@dataclass(frozen=True, eq=False)
class LineProducts:
    """A wide matrix, (l r, 2 F m): real and imaginary parts of each input's lines side by side, input by input.

    `functions` (F, r): phi_r on the lines, times their weights. `values` (F, l, m): h, each output divided by its scale. `eliminated` (2
    F, e): orthonormal columns that every input's columns are projected off, real parts above imaginary ones.
    """

    functions: ComplexArray
    values: ComplexArray
    eliminated: RealArray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        lines, outputs, inputs = self.values.shape
        return outputs * self.functions.shape[1], 2 * lines * inputs

    @property
    def product_operations(self) -> float:
        """Those of the functions, of the responses, which are complex and short, and of the elimination."""
        lines, outputs, inputs = self.values.shape
        e, r = self.eliminated.shape[1], self.functions.shape[1]
        return float(lines * (4 * outputs * r + 16 * outputs * inputs + 16 * e * inputs))

    @property
    def gram_operations(self) -> None:
        """None."""

    @property
    def energy(self) -> float:
        """Sum of the squares of all entries."""
        size = np.sum(np.abs(self.functions) ** 2, axis=1)
        return float(size @ np.sum(np.abs(self.values) ** 2, axis=(1, 2)) - np.sum(self._explained_rows**2))

    @property
    def row_gram_operations(self) -> float:
        """Those of the pairs of functions on S, and of what is explained."""
        lines, outputs, inputs = self.values.shape
        e, r = self.eliminated.shape[1], self.functions.shape[1]
        pairs = 2.0 * lines * (r * outputs) ** 2 + 4.0 * lines * e * r * outputs * inputs
        return float(pairs + 8 * lines * outputs**2 * inputs + 2 * (r * outputs) ** 2 * e * inputs)

    def dense(self) -> RealArray:
        """The matrix as an array."""
        return self.transposed_times(np.eye(self.shape[0])).T

    def times(self, right: Array) -> RealArray:
        """H X = Re sum_x phi_r(x) sum_i H_oi(x) conj(X_i(x)), less what the eliminated columns see of both."""
        lines, outputs, inputs = self.values.shape
        k = right.shape[1]
        X = np.asarray(right, dtype=float).reshape(inputs, 2, lines, k)
        product = np.zeros((self.functions.shape[1], outputs * k))
        for s in self._pieces(k):
            columns = np.ascontiguousarray(X[:, :, s].transpose(2, 1, 0, 3)).reshape(-1, 2 * inputs, k)
            Y = self._blocks(s) @ columns
            product += _parts(self.functions[s]).T @ Y.reshape(-1, outputs * k)
        seen = self.eliminated.T @ X.reshape(inputs, 2 * lines, k)
        return np.asarray(product.reshape(-1, k) - self._explained_rows @ seen.transpose(1, 0, 2).reshape(-1, k))

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z: the functions with their coefficients first, then the responses of all outputs together."""
        lines, outputs, inputs = self.values.shape
        k = left.shape[1]
        Z = np.ascontiguousarray(left, dtype=float)
        columns = np.empty((inputs, 2, lines, k))
        for s in self._pieces(k):
            G = _parts(self.functions[s]) @ Z.reshape(-1, outputs * k)
            product = self._blocks(s).transpose(0, 2, 1) @ G.reshape(-1, 2 * outputs, k)
            columns[:, :, s] = product.reshape(-1, 2, inputs, k).transpose(2, 1, 0, 3)
        seen = (self._explained_rows.T @ Z).reshape(-1, inputs, k)
        for i, own in enumerate(columns.reshape(inputs, 2 * lines, k)):  # input by input, in place: the whole is large
            own -= self.eliminated @ np.ascontiguousarray(seen[:, i])
        return columns.reshape(-1, k)

    def gram(self) -> None:
        """None: the columns are many, and have no structure."""

    def row_gram(self) -> RealArray | None:
        """H H', whole rows less what the eliminated columns explain of them; None where too little is left to tell from rounding."""
        rows = self._explained_rows
        whole, explained = self._whole_gram(), rows @ rows.T
        found = whole - explained
        return found if np.trace(found) > _LEFT * np.trace(whole) else None

    def transposed(self) -> TransposedOperator:
        """H'."""
        return TransposedOperator(self)

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows from first to last, `rows` at a time."""
        for start in range(0, self.shape[0], rows):
            unit = np.eye(self.shape[0])[:, start : start + rows]
            yield self.transposed_times(unit).T

    def column_chunks(self, columns: int) -> Iterator[RealArray]:
        """The columns from first to last, those of some inputs at a time, as rows."""
        for i in range(self.values.shape[2]):
            part = LineProducts(self.functions, self.values[:, :, i : i + 1], self.eliminated)
            yield part.transposed_times(np.eye(self.shape[0]))

    @property
    def _few(self) -> bool:
        """Whether the rows themselves, input by input, are cheaper than all pairs of functions."""
        _, outputs, inputs = self.values.shape
        return bool(inputs * outputs**2 <= _FEW)

    def _rows(self) -> Iterator[tuple[int, slice, RealArray]]:
        """Yield an input, some of the lines and all rows there, transposed: real parts above imaginary ones, (2 F', l r)."""
        _, outputs, inputs = self.values.shape
        r = self.functions.shape[1]
        for s in self._pieces(2 * r):
            phi = self.functions[s][:, :, None]
            for i in range(inputs):
                rows = (phi * self.values[s, None, :, i]).reshape(-1, r * outputs)
                yield i, s, np.concatenate([rows.real, rows.imag])

    def _whole_gram(self) -> RealArray:
        if self._few:
            return np.asarray(sum(rows.T @ rows for _, _, rows in self._rows()))
        if self._shared is not None:
            return self._shared[0]
        return self._gram_of(*self._pairs(self.functions, self._spectra))

    @cached_property
    def _explained_rows(self) -> RealArray:
        """What the eliminated columns see of the rows, (l r, e m)."""
        lines, e, r = len(self.functions), self.eliminated.shape[1], self.functions.shape[1]
        if self._few:
            found = np.zeros((r * self.values.shape[1], e, self.values.shape[2]))
            for i, s, rows in self._rows():
                both = np.concatenate([self.eliminated[:lines][s], self.eliminated[lines:][s]])
                found[:, :, i] += rows.T @ both
            return found.reshape(len(found), -1)
        if self._shared is not None:
            return self._shared[1]
        known = self.eliminated[:lines] + 1j * self.eliminated[lines:]
        seen = np.zeros((e * r, self.values[0].size))
        for s in self._pieces(max(e * r // self.values.shape[1], 1)):
            product = (known[s].conj()[:, :, None] * self.functions[s][:, None]).reshape(-1, e * r)
            flat = self._responses(s)
            seen += np.ascontiguousarray(product.real).T @ np.ascontiguousarray(flat.real)
            seen -= np.ascontiguousarray(product.imag).T @ np.ascontiguousarray(flat.imag)
        return self._rows_of(seen.reshape(e, r, -1))

    @cached_property
    def _shared(self) -> tuple[RealArray, RealArray] | None:
        """Gram matrix and explained rows by one pass over pairs; None where these would be more, or eliminated columns are others."""
        lines, e, r = len(self.functions), self.eliminated.shape[1], self.functions.shape[1]
        known, few, most = self.eliminated[:lines] + 1j * self.eliminated[lines:], min(e, r), max(e, r)
        if most * (most + 1) > r * (r + 1 + 2 * e) or not np.array_equal(known[:, :few], self.functions[:, :few]):
            return None
        both = self._pairs(
            self.functions if r >= e else known, lambda s: np.hstack([self._spectra(s), self._responses(s)])
        )
        split = both[0].shape[2] - self.values[0].size
        gram = self._gram_of(*(part[:r, :r, :split] for part in both))
        return gram, self._rows_of(_both_halves(*(part[:, :, split:] for part in both))[:e, :r])

    def _pairs(self, functions: ComplexArray, what: Callable[[slice], ComplexArray]) -> tuple[RealArray, RealArray]:
        """Return Re sum_x conj(f_r) f_s v and Re sum_x f_r conj(f_s) v for r <= s, (n, n, c) each: the rest is zero.

        `functions` (F, n). `what`: some lines -> v on them, (lines, c).
        """
        n = functions.shape[1]
        first, second = np.triu_indices(n)
        rows = np.ascontiguousarray(functions.T)
        real = imaginary = np.zeros((first.size, what(slice(0, 1)).shape[1]))
        for s in self._pieces(max(self.values.shape[1], first.size // self.values.shape[1])):
            product, v = rows[first, s].conj() * rows[second, s], what(s)
            real = real + np.ascontiguousarray(product.real) @ np.ascontiguousarray(v.real)
            imaginary = imaginary + np.ascontiguousarray(product.imag) @ np.ascontiguousarray(v.imag)
        found = np.zeros((2, n, n, real.shape[1]))
        found[0, first, second], found[1, first, second] = real - imaginary, real + imaginary
        return found[0], found[1]

    def _spectra(self, s: slice) -> ComplexArray:
        """S on and above its diagonal on some lines, (lines, l (l + 1) / 2)."""
        first, second = np.triu_indices(self.values.shape[1])
        return (self.values[s].conj() @ self.values[s].transpose(0, 2, 1))[:, first, second]

    def _responses(self, s: slice) -> ComplexArray:
        """H on some lines, (lines, l m)."""
        return self.values[s].reshape(-1, self.values[0].size)

    def _gram_of(self, ahead: RealArray, behind: RealArray) -> RealArray:
        """Return the Gram matrix of the whole rows from the sums of pairs with S, which is its own conjugate transpose."""
        r, outputs = len(ahead), self.values.shape[1]
        first, second = np.triu_indices(outputs)
        blocks = np.empty((r, outputs, r, outputs))
        blocks[:, second, :, first] = behind.transpose(2, 0, 1)
        blocks[:, first, :, second] = ahead.transpose(2, 0, 1)
        i, j = np.triu_indices(r)
        blocks[j, :, i, :] = blocks[i, :, j, :].transpose(0, 2, 1)
        return blocks.reshape(r * outputs, r * outputs)

    def _rows_of(self, seen: RealArray) -> RealArray:
        """Return the explained rows (l r, e m) from sums by eliminated column and function, (e, r, l m)."""
        e, r, _ = seen.shape
        _, outputs, inputs = self.values.shape
        return seen.reshape(e, r, outputs, inputs).transpose(1, 2, 0, 3).reshape(r * outputs, e * inputs)

    def _blocks(self, s: slice) -> RealArray:
        """Return on some lines what takes real and imaginary parts of the inputs' columns to those of the outputs', (lines, 2 l, 2 m)."""
        H = self.values[s]
        return np.concatenate(
            [np.concatenate([H.real, H.imag], axis=2), np.concatenate([-H.imag, H.real], axis=2)], axis=1
        )

    def _pieces(self, columns: int) -> Iterator[slice]:
        """Yield stretches of lines such that an array of an output and so many columns a line stays small."""
        lines, outputs, _ = self.values.shape
        most = min(max(_AT_A_TIME // max(outputs * columns, 1), 1), _LINES)
        for start in range(0, lines, most):
            yield slice(start, min(start + most, lines))


def _parts(functions: ComplexArray) -> RealArray:
    """Return functions (lines, r) as real rows, real and imaginary part of every line, (2 lines, r)."""
    lines, r = functions.shape
    return np.stack([functions.real, functions.imag], axis=1).reshape(2 * lines, r)


def _both_halves(ahead: RealArray, behind: RealArray) -> RealArray:
    """Return sums of all pairs (n, n, c): below the diagonal functions have changed places, and their product is the conjugate."""
    found = behind.transpose(1, 0, 2).copy()
    first, second = np.triu_indices(len(ahead))
    found[first, second] = ahead[first, second]
    return found


# ------------------------------------------------------------------------------------------------------------ transfer

#: From this many rows on products are cheaper than the triangular factor; fewer are also few beside the orders that are asked.
_MANY_ROWS = 200


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
) -> Transfer:
    """Stack p_k(x_i) H(x_i), k = 0 ... block_rows, without the initial terms: known ones subtracted, the others eliminated.

    `response`: lines of any band. `block_rows`: q: H(0) holds p_0 ... p_(q-1), H(1) goes to p_q, which is the degree. `order`: largest
    number of states that will be asked; used to check that the lines suffice. `weights` (F,): weights of the lines. `equal_outputs`:
    divide every output by its root mean square over the band, so that quiet outputs count as much as loud ones in the truncation. Shapes
    are scaled back. `basis`: "powers" are the plain powers of the scaled x of the report: for comparison, they fail in noise.
    `initial_values` (K, l, m): the first K of D, CB, CAB, ... in SI units (in the z-domain D, Y(0), Y(1), ...), where they are known.
    "rest": those that are zero for a structure at rest by the response's quantity. `row_shifts`: which of p_0 ... p_(q-1) the rows of
    H(0) are (the arbitrary t_i of Eq. 82), increasing from 0; block_rows is then one more than the last.

    Raises `DataError`: fewer lines than unknowns: 2 F m must be at least n + e m, with e eliminated polynomials.

    Notes
    -----
    Source: the report, Eqs. 82 and 89-93, with the elimination and the basis made right (see the head of this module).
    """
    lines, outputs, inputs = response.values.shape
    rows = kept_block_rows(row_shifts)
    q = check_count("block_rows", block_rows if rows is None else rows[-1] + 1)
    plane = plane_of(domain, response)
    known = None if initial_values is None else initial_terms(initial_values, response, plane)
    unknown = q + 1 - (0 if known is None else min(len(known), q + 1))
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
    return Transfer(
        response=response,
        plane=plane,
        basis=values,
        recurrence=recurrence,
        weights=w,
        output_scale=output_scale(response) if equal_outputs else np.ones(outputs),
        eliminated=eliminated,
        known=known,
        known_functions=None
        if known is None
        else remainders(recurrence, float(values[0, 0].real), points, min(len(known), q + 1)),
        row_shifts=rows,
        orthogonal=basis == "orthogonal",
    )


@dataclass(frozen=True, eq=False)
class Transfer(PolynomialRows, LineMatrix):
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
    fits_states = True

    @property
    def judged(self) -> FrequencyResponse:
        """The lines themselves."""
        return self.response

    @property
    def outputs(self) -> int:
        """Rows of a block."""
        return int(self.response.values.shape[1])

    @property
    def inputs(self) -> int:
        """Columns of a line."""
        return int(self.response.values.shape[2])

    @property
    def products(self) -> bool:
        """Whether products serve instead of the triangular factor: many rows of responses alone, and polynomials that are orthonormal."""
        rows, columns = self.outputs * len(self.basis[0]), 2 * len(self.basis) * self.inputs
        return self.orthogonal and self.known is None and _MANY_ROWS < rows < columns

    def shifted(self, k: int) -> Operator:
        """Return H(k): p_k H and x p_k H by their products, or from the triangular factor."""
        if not self.products:
            return super().shifted(k)
        functions = self.basis[:, : self.block_rows] if k == 0 else self.basis @ self.recurrence
        return self._operator(functions[:, self.block_indices(self.block_rows)])

    def tall(self) -> Operator:
        """Return all q + 1 block rows."""
        return self._operator(self.basis) if self.products else super().tall()

    def costs(self, wanted: int) -> tuple[Cost, ...]:
        """Return what the ways of factoring it cost; see `DataMatrix.costs`."""
        return costs_of(self.tall(), wanted) if self.products else super().costs(wanted)

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
        return self._project(columns)

    def _project(self, columns: Array) -> Array:
        real = np.ascontiguousarray(columns).view(float)  # complex columns as twice as many real ones
        for _ in range(2):  # twice, so that what is left is orthogonal to rounding
            real = real - self.eliminated @ (self.eliminated.T @ real)
        return real.view(columns.dtype)

    def column_functions(self, poles: Array) -> tuple[ComplexArray, RealArray]:
        """Return 1 / (x_i - s_j) along the columns of one input, as the elimination leaves it (2 F, k), and the share it leaves (k,).

        The state x follows from [Re X, Im X] with X(x_i) = (x_i I - A)^-1 B, so that a modal coordinate has the columns
        (g(x) + g(x*)) / 2 and (g(x) - g(x*)) / 2j with g = 1 / (x - s_j).
        """
        x = self._points[:, None]
        g, mirrored = 1 / (x - poles), 1 / (x.conj() - poles)
        w = 1.0 if self.weights is None else self.weights[:, None]
        whole = np.vstack([w * (g + mirrored) / 2, w * (g - mirrored) / 2j])
        left = self._project(whole)
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

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes from all block rows; participation and direct term by least squares over the lines."""
        shapes = self.shapes(model.row_states(eigen.vectors), eigen.values)
        lines, poles = self.response, self.to_s(eigen.values)
        basis = line_basis(lines.frequencies, lines.sampling_rate, self._line_data, poles, (0,), self.weights)
        found = basis.solved(shapes)
        fit = ModalFit(shapes, found.side, found.terms, reach=basis.reach, basis=basis)
        if self.weights is not None:
            return fit
        return replace(fit, misfit=self._misfit.of_left(found.left), unexplained=found.unexplained)

    @cached_property
    def _line_data(self) -> LineData:
        return line_data(self.response.values, self.weights)

    @cached_property
    def _misfit(self) -> Misfit:
        return Misfit(self.response, self.output_scale)

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
