"""Products of functions of the lines times responses, phi_r(x) H(x), without what polynomials explain; the matrix is never made.

Its Gram matrix of rows needs the responses only through S(x) = H(x)* H(x)', the same for all pairs of functions, so that it costs as much
as for one input, whatever their number:

    (phi_r H_o)' (phi_s H_p) = Re sum_x conj(phi_r) phi_s sum_i conj(H_oi) H_pi.

The projections of the rows on the eliminated columns are such sums, too, with H in place of S. Where these columns are the polynomials
that the rows begin with, or the other way round, one pass over the pairs of functions gives both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.operators import TransposedOperator

#: Count of numbers in a temporary array, and maximum number of lines of a block: temporary arrays stay in the cache.
_BLOCK_NUMBERS, _MAX_BLOCK_LINES = 2_000_000, 128


#: Maximum of inputs times outputs squared at which sums over rows are cheaper than over pairs of functions, which move more memory.
_MAX_ROW_SUM_SIZE = 25


#: Minimum share of the energy of the rows after elimination, for the difference of two Gram matrices to exceed rounding.
_MIN_ENERGY_LEFT = 1e-6


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
        projected = self.eliminated.T @ X.reshape(inputs, 2 * lines, k)
        return np.asarray(product.reshape(-1, k) - self._explained_rows @ projected.transpose(1, 0, 2).reshape(-1, k))

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
        projected = (self._explained_rows.T @ Z).reshape(-1, inputs, k)
        for i, of_input in enumerate(
            columns.reshape(inputs, 2 * lines, k)
        ):  # input by input, in place: the whole is large
            of_input -= self.eliminated @ np.ascontiguousarray(projected[:, i])
        return columns.reshape(-1, k)

    def gram(self) -> None:
        """None: the columns are many, and have no structure."""

    def row_gram(self) -> RealArray | None:
        """H H', whole rows less what the eliminated columns explain of them; None where too little is left to tell from rounding."""
        rows = self._explained_rows
        whole, explained = self._whole_gram(), rows @ rows.T
        gram = whole - explained
        return gram if np.trace(gram) > _MIN_ENERGY_LEFT * np.trace(whole) else None

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
        return bool(inputs * outputs**2 <= _MAX_ROW_SUM_SIZE)

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
        basis = self.eliminated[:lines] + 1j * self.eliminated[lines:]
        projected = np.zeros((e * r, self.values[0].size))
        for s in self._pieces(max(e * r // self.values.shape[1], 1)):
            product = (basis[s].conj()[:, :, None] * self.functions[s][:, None]).reshape(-1, e * r)
            flat = self._responses(s)
            projected += np.ascontiguousarray(product.real).T @ np.ascontiguousarray(flat.real)
            projected -= np.ascontiguousarray(product.imag).T @ np.ascontiguousarray(flat.imag)
        return self._rows_of(projected.reshape(e, r, -1))

    @cached_property
    def _shared(self) -> tuple[RealArray, RealArray] | None:
        """Gram matrix and explained rows by one pass over pairs; None where these would be more, or eliminated columns are others."""
        lines, e, r = len(self.functions), self.eliminated.shape[1], self.functions.shape[1]
        basis, few, most = self.eliminated[:lines] + 1j * self.eliminated[lines:], min(e, r), max(e, r)
        if most * (most + 1) > r * (r + 1 + 2 * e) or not np.array_equal(basis[:, :few], self.functions[:, :few]):
            return None
        both = self._pairs(
            self.functions if r >= e else basis, lambda s: np.hstack([self._spectra(s), self._responses(s)])
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
        sums = np.zeros((2, n, n, real.shape[1]))
        sums[0, first, second], sums[1, first, second] = real - imaginary, real + imaginary
        return sums[0], sums[1]

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
        most = min(max(_BLOCK_NUMBERS // max(outputs * columns, 1), 1), _MAX_BLOCK_LINES)
        for start in range(0, lines, most):
            yield slice(start, min(start + most, lines))


def _parts(functions: ComplexArray) -> RealArray:
    """Return functions (lines, r) as real rows, real and imaginary part of every line, (2 lines, r)."""
    lines, r = functions.shape
    return np.stack([functions.real, functions.imag], axis=1).reshape(2 * lines, r)


def _both_halves(ahead: RealArray, behind: RealArray) -> RealArray:
    """Return sums of all pairs (n, n, c): below the diagonal functions have changed places, and their product is the conjugate."""
    swapped = behind.transpose(1, 0, 2).copy()
    first, second = np.triu_indices(len(ahead))
    swapped[first, second] = ahead[first, second]
    return swapped
