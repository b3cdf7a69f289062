"""Rows that are functions of the line times the responses, phi_r(x) H(x), without what polynomials explain: known by their products.

Nothing of the size of the matrix exists. Its Gram matrix of rows needs the responses only through S(x) = H(x)* H(x)', the same for all
pairs of functions, so that it costs as much as for one input, whatever their number:

    (phi_r H_o)' (phi_s H_p) = Re sum_x conj(phi_r) phi_s sum_i conj(H_oi) H_pi.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.blocks.operators import TransposedOperator
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["LineProducts"]

#: Numbers in an array in between: lines are taken so many at a time.
_AT_A_TIME = 2_000_000

#: Further inputs times outputs squared up to which sums over rows are cheaper than over pairs of functions, which move more memory.
_FEW = 100

#: Share of the rows' energy that the elimination must leave for the difference of two Gram matrices to be told from rounding.
_LEFT = 1e-6


@dataclass(frozen=True, eq=False)
class LineProducts:
    """A wide matrix, (l r, 2 F m): real and imaginary parts of each input's lines side by side, input by input.

    Parameters
    ----------
    functions : array of complex, (F, r)
        phi_r on the lines, times their weights.
    values : array of complex, (F, l, m)
        H, each output divided by its scale.
    eliminated : array, (2 F, e)
        Orthonormal columns that every input's columns are projected off, real parts above imaginary ones.
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
        """H X = Re sum_x phi_r(x) sum_i H_oi(x) conj(X_i(x))."""
        lines, outputs, inputs = self.values.shape
        k = right.shape[1]
        X = self._projected(np.array(right, dtype=float).reshape(inputs, 2 * lines, k))
        product = np.zeros((self.functions.shape[1], outputs * k))
        for s in self._pieces(k):
            conjugate = (X[:, :lines][:, s] - 1j * X[:, lines:][:, s]).transpose(1, 0, 2)
            Y = (self.values[s] @ conjugate).reshape(-1, outputs * k)
            phi = self.functions[s]
            product += phi.real.T @ np.ascontiguousarray(Y.real) - phi.imag.T @ np.ascontiguousarray(Y.imag)
        return product.reshape(-1, k)

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z: the functions with their coefficients first, then the responses of all outputs together."""
        lines, outputs, inputs = self.values.shape
        k = left.shape[1]
        Z = np.asarray(left, dtype=float).reshape(self.functions.shape[1], outputs * k)
        columns = np.empty((inputs, 2 * lines, k))
        for s in self._pieces(k):
            phi = self.functions[s]
            G = np.empty((len(phi), outputs * k), dtype=complex)
            G.real, G.imag = np.ascontiguousarray(phi.real) @ Z, np.ascontiguousarray(phi.imag) @ Z
            product = self.values[s].transpose(0, 2, 1) @ G.reshape(-1, outputs, k)
            columns[:, :lines][:, s] = product.real.transpose(1, 0, 2)
            columns[:, lines:][:, s] = product.imag.transpose(1, 0, 2)
        return self._projected(columns).reshape(-1, k)

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
        return bool((inputs - 1) * outputs**2 <= _FEW)

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
        _, outputs, _ = self.values.shape
        r = self.functions.shape[1]
        if self._few:
            return np.asarray(sum(rows.T @ rows for _, _, rows in self._rows()))
        first, second = np.triu_indices(r)
        pairs = np.zeros((first.size, outputs**2))
        for s in self._pieces(max(outputs, first.size // outputs)):
            S = (self.values[s].conj() @ self.values[s].transpose(0, 2, 1)).reshape(-1, outputs**2)
            product = self.functions[s][:, first].conj() * self.functions[s][:, second]
            pairs += np.ascontiguousarray(product.real).T @ np.ascontiguousarray(S.real)
            pairs -= np.ascontiguousarray(product.imag).T @ np.ascontiguousarray(S.imag)
        gram = np.empty((r, outputs, r, outputs))
        blocks = pairs.reshape(-1, outputs, outputs)
        gram[first, :, second], gram[second, :, first] = blocks, blocks.transpose(0, 2, 1)
        return gram.reshape(r * outputs, r * outputs)

    @cached_property
    def _explained_rows(self) -> RealArray:
        """What the eliminated columns see of the rows, (l r, e m)."""
        lines, outputs, inputs = self.values.shape
        e, r = self.eliminated.shape[1], self.functions.shape[1]
        if self._few:
            found = np.zeros((r * outputs, e, inputs))
            for i, s, rows in self._rows():
                both = np.concatenate([self.eliminated[:lines][s], self.eliminated[lines:][s]])
                found[:, :, i] += rows.T @ both
            return found.reshape(r * outputs, e * inputs)
        known = (self.eliminated[:lines] - 1j * self.eliminated[lines:])[:, :, None]
        seen = np.zeros((e * r, outputs * inputs))
        for s in self._pieces(max(e * r // outputs, 1)):
            product = (known[s] * self.functions[s][:, None]).reshape(-1, e * r)
            flat = self.values[s].reshape(-1, outputs * inputs)
            seen += np.ascontiguousarray(product.real).T @ np.ascontiguousarray(flat.real)
            seen -= np.ascontiguousarray(product.imag).T @ np.ascontiguousarray(flat.imag)
        return seen.reshape(e, r, outputs, inputs).transpose(1, 2, 0, 3).reshape(r * outputs, e * inputs)

    def _pieces(self, columns: int) -> Iterator[slice]:
        """Yield stretches of lines such that an array of an output and so many columns a line stays small."""
        lines, outputs, _ = self.values.shape
        most = max(_AT_A_TIME // max(outputs * columns, 1), 1)
        for start in range(0, lines, most):
            yield slice(start, min(start + most, lines))

    def _projected(self, columns: RealArray) -> RealArray:
        """Take the eliminated columns off, (m, 2 F, k), twice: what is left is orthogonal to rounding."""
        E = self.eliminated
        for own in columns:  # input by input, in place: the whole is large
            for _ in range(2):
                own -= E @ (E.T @ own)
        return columns
