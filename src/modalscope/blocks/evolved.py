"""Compare the rows or columns of a data matrix in modal coordinates with the evolution of each mode."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: Numbers compared at a time: the arrays in between stay in the cache.
_AT_A_TIME = 16_000

#: Agreement of amplitudes a that were identified with those expected, e, from Re and Im of a conj(e), |a|^2 and |e|^2, of one shape.
Agreement = Callable[[RealArray, RealArray, RealArray, RealArray], RealArray]

#: Share of a mode's largest participation from which on an input counts: what is less is not seen beside it, whatever it gives.
_COUNTS = 1e-100


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
        k = self.states.shape[1]
        inner, size = np.zeros(k, dtype=complex), np.zeros(k)
        at, chosen = np.zeros((self.first.shape[0], k), dtype=complex), step(self.evolution)
        start_of = self.first.conj()
        for start, found in self._identified():
            g = self.evolution[start : start + len(found)]
            inner += np.sum(np.sum(found * start_of, axis=1).conj() * g, axis=0)
            size += squares(found.reshape(-1, k))
            here = np.flatnonzero((chosen >= start) & (chosen < start + len(found)))
            at[:, here] = found[chosen[here] - start, :, here].T
        return compared(inner, size, at, self.first, self.evolution, chosen, agreement)

    def _identified(self) -> Iterator[tuple[int, Array]]:
        """Yield the index of a block, and some blocks from there in modal coordinates, (blocks, c, k)."""
        K, c, N = self.blocks.shape
        states = np.ascontiguousarray(self.states)
        most = max(_AT_A_TIME // max(c * states.shape[1], 1), 1)
        for start in range(0, K, most):
            flat = self.blocks[start : start + most].reshape(-1, N)
            product = np.ascontiguousarray(flat @ states.view(np.float64))
            yield start, product.view(np.complex128).reshape(-1, c, states.shape[1])


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
        counts = strength > _COUNTS**2 * strength.max(axis=0, initial=0.0)
        divided = np.where(counts, self.participation, 1)
        shape = len(self.factor), self.states.shape[1]
        real, imaginary, size, weighted = (np.zeros(shape) for _ in range(4))
        for inputs, a, b, u, v in self._pieces(self.states / divided[:, None]):
            along, across, identified, expected = a * u + b * v, b * u - a * v, a * a + b * b, u * u + v * v
            real[inputs] += along.sum(axis=(0, 3))
            imaginary[inputs] += across.sum(axis=(0, 3))
            size[inputs] += identified.sum(axis=(0, 3))
            weighted[inputs] += np.einsum("sikf,sjkf->ik", agreement(along, across, identified, expected), expected)
        strength = np.where(counts, strength, 0)
        inner = np.sum((real - 1j * imaginary) * strength, axis=0)
        total = np.sum(_squared(self.functions), axis=(0, 2)) * np.sum(strength, axis=0)
        identified = np.sum(size * _squared(divided), axis=0)
        return Compared(inner, identified, total, _share(np.sum(weighted * strength, axis=0), total), self.seen)

    def _pieces(self, states: ComplexArray) -> Iterator[tuple[slice, RealArray, RealArray, RealArray, RealArray]]:
        """Yield some inputs; on some lines real and imaginary part of what was identified, (2, inputs, k, lines), and of the functions.

        `states` (m, N, k).
        """
        count, _, k = states.shape
        lines = self.functions.shape[2]
        rows = np.ascontiguousarray(np.concatenate([states.real, states.imag], axis=2).transpose(0, 2, 1))
        upper, lower = self.factor[:, :, :lines], self.factor[:, :, lines:]
        long = min(max(_AT_A_TIME // max(2 * k, 1), 1), lines)
        most = max(_AT_A_TIME // max(2 * k * long, 1), 1)
        for start in range(0, lines, long):
            s = slice(start, start + long)
            u, v = (np.ascontiguousarray(part[:, None, :, s]) for part in (self.functions.real, self.functions.imag))
            for first in range(0, count, most):
                inputs = slice(first, first + most)
                yield inputs, *_both_signs(rows[inputs] @ upper[inputs, :, s], rows[inputs] @ lower[inputs, :, s]), u, v


def squares(values: Array) -> RealArray:
    """Return the sums of |v|^2 of columns (rows, k)."""
    parts = np.ascontiguousarray(values, dtype=complex).view(np.float64)
    return np.asarray((np.ones(len(parts)) @ (parts * parts)).reshape(-1, 2).sum(axis=1))


def _squared(values: Array) -> RealArray:
    return np.asarray(values.real**2 + values.imag**2)


def _both_signs(real: RealArray, imaginary: RealArray) -> tuple[RealArray, RealArray]:
    """Return the parts at +w and at -w, (2, m, k, F) each, of columns whose real and imaginary rows have those of k modes, (m, 2 k, F)."""
    k = real.shape[1] // 2
    a, b = np.empty((2, 2, len(real), k, real.shape[2]))
    np.subtract(real[:, :k], imaginary[:, k:], out=a[0])
    np.add(real[:, :k], imaginary[:, k:], out=a[1])
    np.add(real[:, k:], imaginary[:, :k], out=b[0])
    np.subtract(real[:, k:], imaginary[:, :k], out=b[1])
    return a, b


def _share(part: RealArray, whole: RealArray) -> RealArray:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
