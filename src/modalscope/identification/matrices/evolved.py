"""Compare the rows or columns of a data matrix in modal coordinates with the evolution of each mode."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy import fft

from modalscope.identification.matrices.block_hankel import BlockHankel
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.operators import times_real

#: Values of modes on lines that are compared at a time, 16 MB of complex numbers.
_MAX_VALUES = 1 << 20

#: Agreement of amplitudes a that were identified with those expected, e, from Re and Im of a conj(e), |a|^2 and |e|^2, of one shape.
Agreement = Callable[[RealArray, RealArray, RealArray, RealArray], RealArray]

#: Minimum participation of an input relative to the largest one of a mode: smaller squares underflow.
_MIN_PARTICIPATION = 1e-100


class Compared(NamedTuple):
    """Sums over one side for k modes: what a coherence and a weighted mean of agreements need of it.

    `inner` (k,): sum conj(identified) expected. `identified`, `expected` (k,): sum |identified|^2 and sum |expected|^2. `agreement` (k,):
    mean agreement, weighted by the squared amplitude of the first block. `seen` (k,): modes of which something is left to compare; all
    when None.
    """

    inner: ComplexArray
    identified: RealArray
    expected: RealArray
    agreement: RealArray
    seen: Array | None = None


class ModalSide(Protocol):
    """The rows or the columns of a data matrix in modal coordinates."""

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare what was identified with what modes must give.

        `step`: evolution (K, k) -> the block of each mode whose agreement counts.
        """


def compared(
    inner: ComplexArray,
    identified: RealArray,
    at: ComplexArray,
    first: ComplexArray,
    evolution: ComplexArray,
    chosen: Array,
    agreement: Agreement,
) -> Compared:
    """Return the sums of a factor that runs in blocks, and the agreement of one block of each mode.

    `inner`, `identified` (k,): as in `Compared`. `at` (c, k): the chosen block as it was identified. `first` (c, k): the block that
    starts the evolution. `evolution` (K, k). `chosen` (k,): which block.
    """
    weight = _squared(first)
    total = np.sum(weight, axis=0)
    # over many blocks a real pole that is no mode grows beyond all numbers: nothing agrees with that
    with np.errstate(over="ignore", invalid="ignore"):
        expected = first * evolution[chosen, np.arange(len(chosen))]
        product = at * expected.conj()
        agreed = agreement(product.real, product.imag, _squared(at), _squared(expected))
        evolved = total * squares(evolution)
    mean = _share(np.sum(weight * agreed, axis=0), total)
    return Compared(inner, identified, evolved, mean)


@dataclass(frozen=True, eq=False, slots=True)
class Evolved:
    """A factor that runs in blocks: block k is the first times g_k.

    `blocks` (K, c, N): blocks of the factor. `states` (N, k): what takes the factor's states to modes. `first` (c, k): the block that
    starts the evolution. `evolution` (K, k): g_k.
    """

    blocks: RealArray
    states: ComplexArray
    first: ComplexArray
    evolution: ComplexArray

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare all blocks by their sums, and by agreement the one that `step` chooses; see `ModalSide`."""
        K, c, N = self.blocks.shape
        identified = times_real(self.states.T, self.blocks.reshape(-1, N).T).T.reshape(K, c, -1)
        inner = np.sum(np.sum(identified * self.first.conj(), axis=1).conj() * self.evolution, axis=0)
        size = squares(identified.reshape(K * c, -1))
        chosen = step(self.evolution)
        at = identified[chosen, :, np.arange(chosen.size)].T
        return compared(inner, size, at, self.first, self.evolution, chosen, agreement)


@dataclass(frozen=True, eq=False, slots=True)
class OnLines:
    """A factor that runs over lines: every line stands for itself, at +w and at -w.

    `factor` (m, N, 2 F): the factor of every input, real parts of the lines before imaginary ones. `states` (N, k). `functions` (2, k,
    F): what runs along the lines for a mode of unit participation, at +w and at -w. `participation` (m, k). `seen` (k,): modes of which
    something is left to compare.
    """

    factor: RealArray
    states: ComplexArray
    functions: ComplexArray
    participation: ComplexArray
    seen: Array

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare line by line; see `ModalSide`.

        Of every input what was identified is divided by its participation, so that all of them are compared with the same functions: the
        sums over its lines come back by |participation|^2.
        """
        strength = _squared(self.participation)
        counts = strength > _MIN_PARTICIPATION**2 * strength.max(axis=0, initial=0.0)
        strength, divided = np.where(counts, strength, 0), np.where(counts, self.participation, 1)
        inner, size, weighted = np.zeros(strength.shape, complex), np.zeros(strength.shape), np.zeros(strength.shape)
        real, imaginary = np.split(self.factor, 2, axis=2)
        lines = real.shape[2]
        width = max(_MAX_VALUES // max(self.functions[..., 0].size, 1), 1)
        for part in (slice(start, start + width) for start in range(0, lines, width)):
            functions, expected = self.functions[..., part], _squared(self.functions[..., part])  # at +w and at -w
            for i, participation in enumerate(divided):
                states = (self.states / participation).T
                a, b = times_real(states, real[i, :, part]), 1j * times_real(states, imaginary[i, :, part])
                identified = np.stack([a + b, a - b])
                product, power = identified * functions.conj(), _squared(identified)
                inner[i] += product.conj().sum(axis=(0, 2))
                size[i] += power.sum(axis=(0, 2))
                weighted[i] += np.sum(agreement(product.real, product.imag, power, expected) * expected, axis=(0, 2))
        total = np.sum(_squared(self.functions), axis=(0, 2)) * np.sum(strength, axis=0)
        return Compared(
            np.sum(inner * strength, axis=0),
            np.sum(size * _squared(divided), axis=0),
            total,
            _share(np.sum(weighted * strength, axis=0), total),
            self.seen,
        )


def squares(values: Array) -> RealArray:
    """Return the sums of |v|^2 of columns (rows, k)."""
    parts = np.ascontiguousarray(values, dtype=complex).view(np.float64)
    return np.asarray((np.ones(len(parts)) @ (parts * parts)).reshape(-1, 2).sum(axis=1))


def _squared(values: Array) -> RealArray:
    return np.asarray(values.real**2 + values.imag**2)


def _share(part: RealArray, whole: RealArray) -> RealArray:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)


#: Rows within one in so many of the columns are computed together: a quarter more is multiplied, mostly by zeros.
_GROUPED_ROW_SHARE = 4


@dataclass(frozen=True, eq=False, slots=True)
class RowSums:
    """Rows P d^a of a Hankel matrix, compared with the evolution of modes by sums over the samples.

    `right` (columns, k): X = Q d^-1 times the states: H X are the rows in modal coordinates. `states` (N, k): those of the orthonormal P,
    which tell the size of the rows. `first` (l, k): the block that starts the evolution. `evolution` (K, k): g_k.
    """

    matrix: BlockHankel
    right: ComplexArray
    states: ComplexArray
    first: ComplexArray
    evolution: ComplexArray

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare all blocks by their sums, and by agreement the one that `step` chooses; see `ModalSide`."""
        chosen = step(self.evolution)
        inner = np.sum(self.first * self._sums().conj(), axis=0)
        return compared(inner, squares(self.states), self._at(chosen), self.first, self.evolution, chosen, agreement)

    @property
    def _blocks(self) -> ComplexArray:
        """X by block columns, (blocks, m, k)."""
        return self.right.reshape(-1, self.matrix.values.shape[2], self.right.shape[1])

    def _sums(self) -> ComplexArray:
        """Return sum_i conj(g_i) H_i X over the block rows H_i, (l, k)."""
        X = self._blocks
        length = len(self.evolution) + len(X) - 1
        whole = fft.next_fast_len(length)  # the sum of two numbers of blocks is often prime
        spectrum = fft.fft(X, n=whole, axis=0)
        spectrum *= fft.fft(self.evolution.conj(), n=whole, axis=0)[:, None]
        return self._of_samples(fft.ifft(spectrum, axis=0, overwrite_x=True)[:length], 0)

    def _at(self, chosen: Array) -> ComplexArray:
        """Return H_i X of the block row that is chosen for each mode, (l, k): of rows close to each other by one product."""
        X, by_row = self._blocks, np.argsort(chosen, kind="stable")
        sums, near = (
            np.empty((self.matrix.values.shape[1], len(chosen)), dtype=complex),
            max(len(X) // _GROUPED_ROW_SHARE, 1),
        )
        while by_row.size:
            first = chosen[by_row[0]]
            some = by_row[chosen[by_row] < first + near]
            filters = np.zeros((chosen[some[-1]] - first + len(X), *X.shape[1:-1], some.size), dtype=complex)
            for j, k in enumerate(some):
                start = chosen[k] - first
                filters[start : start + len(X), :, j] = X[:, :, k]
            sums[:, some] = self._of_samples(filters, int(first))
            by_row = by_row[some.size :]
        return sums

    def _of_samples(self, filters: ComplexArray, first: int) -> ComplexArray:
        """Return the samples from `first` on times filters (samples, m, k), (l, k)."""
        columns = np.ascontiguousarray(filters).reshape(-1, filters.shape[2]).view(np.float64)
        product = self.matrix.samples_times(columns, first)
        return np.asarray(np.ascontiguousarray(product).view(np.complex128))
