"""Compare the rows or columns of a data matrix in modal coordinates with the evolution of each mode."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

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
