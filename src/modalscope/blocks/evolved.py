"""One factor of a data matrix in modal coordinates beside what modes must give there, compared in pieces that stay in the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["Agreement", "Compared", "Evolved", "ModalSide", "OnLines", "compared", "squares"]

#: Numbers compared at a time: the arrays in between stay in the cache.
_AT_A_TIME = 16_000

#: Agreement (c, k) of amplitudes a that were identified with those that were expected, e, from a conj(e), |a|^2 and |e|^2, (c, k) each.
Agreement = Callable[[ComplexArray, RealArray, RealArray], RealArray]


class Compared(NamedTuple):
    """Sums over one side for k modes: what a coherence and a weighted mean of agreements need of it.

    Parameters
    ----------
    inner : array of complex, (k,)
        sum conj(identified) expected.
    identified, expected : array, (k,)
        sum |identified|^2 and sum |expected|^2.
    agreement : array, (k,)
        Mean agreement, weighted by the squared amplitude of the first block.
    seen : array of bool, (k,), optional
        Modes of which something is left to compare; all when None.
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

        Parameters
        ----------
        agreement : callable
        step : callable
            Evolution (K, k) -> the block of each mode whose agreement counts.
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

    Parameters
    ----------
    inner, identified : array, (k,)
        As in `Compared`.
    at : array of complex, (c, k)
        The chosen block as it was identified.
    first : array of complex, (c, k)
        The block that starts the evolution.
    evolution : array of complex, (K, k)
    chosen : array of int, (k,)
        Which block.
    agreement : callable
    """
    weight = _squared(first)
    total = np.sum(weight, axis=0)
    # over many blocks a real pole that is no mode grows beyond all numbers: nothing agrees with that
    with np.errstate(over="ignore", invalid="ignore"):
        expected = first * evolution[chosen, np.arange(len(chosen))]
        agreed = agreement(at * expected.conj(), _squared(at), _squared(expected))
    mean = _share(np.sum(weight * agreed, axis=0), total)
    return Compared(inner, identified, total * squares(evolution), mean)


@dataclass(frozen=True, eq=False, slots=True)
class Evolved:
    """A factor that runs in blocks: block k is the first times g_k.

    Parameters
    ----------
    blocks : array, (K, c, N)
        Blocks of the factor.
    states : array of complex, (N, k)
        What takes the factor's states to modes.
    first : array of complex, (c, k)
        The block that starts the evolution.
    evolution : array of complex, (K, k)
        g_k.
    """

    blocks: Array
    states: ComplexArray
    first: ComplexArray
    evolution: ComplexArray

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare all blocks by their sums, and by agreement the one that `step` chooses; see `ModalSide`."""
        k = self.states.shape[1]
        inner, size = np.zeros(k, dtype=complex), np.zeros(k)
        at, chosen = np.zeros((self.first.shape[0], k), dtype=complex), step(self.evolution)
        for start, found in self._identified():
            g = self.evolution[start : start + len(found)]
            inner += np.sum(np.sum(found.conj() * g[:, None], axis=0) * self.first, axis=0)
            size += squares(found.reshape(-1, k))
            here = np.flatnonzero((chosen >= start) & (chosen < start + len(found)))
            at[:, here] = found[chosen[here] - start, :, here].T
        return compared(inner, size, at, self.first, self.evolution, chosen, agreement)

    def _identified(self) -> Iterator[tuple[int, Array]]:
        """Yield the index of a block, and some blocks from there in modal coordinates, (blocks, c, k)."""
        K, c, N = self.blocks.shape
        states = np.ascontiguousarray(self.states)
        real = not np.iscomplexobj(self.blocks)
        columns = states.view(np.float64) if real else states
        most = max(_AT_A_TIME // max(c * states.shape[1], 1), 1)
        for start in range(0, K, most):
            flat = self.blocks[start : start + most].reshape(-1, N)
            product = np.ascontiguousarray(flat @ columns)
            found = np.asarray(product.view(np.complex128) if real else product, dtype=complex)
            yield start, found.reshape(-1, c, states.shape[1])


@dataclass(frozen=True, eq=False, slots=True)
class OnLines:
    """A factor that runs over lines: every line stands for itself, at +w and at -w.

    Parameters
    ----------
    factor : array, (m, 2 F, N)
        Rows of the factor, real parts above imaginary ones, of every input.
    states : array of complex, (N, k)
    functions : array of complex, (2 F, k)
        What runs along the lines for a mode of unit participation.
    participation : array of complex, (m, k)
    seen : array of bool, (k,)
        Modes of which something is left to compare.
    """

    factor: RealArray
    states: ComplexArray
    functions: ComplexArray
    participation: ComplexArray
    seen: Array

    def compare(self, agreement: Agreement, step: Callable[[Array], Array]) -> Compared:
        """Compare line by line; see `ModalSide`."""
        k = self.states.shape[1]
        inner, size, weighted, total = np.zeros(k, dtype=complex), np.zeros(k), np.zeros(k), np.zeros(k)
        participation = self.participation[:, None]
        strength = _squared(participation)
        for found, function in self._pieces():
            product = found * (function.conj() * participation.conj())
            identified, expected = _squared(found), _squared(function) * strength
            inner += product.sum(axis=(0, 1)).conj()
            size += identified.sum(axis=(0, 1))
            total += expected.sum(axis=(0, 1))
            weighted += np.einsum("ifj,ifj->j", expected, agreement(product, identified, expected))
        return Compared(inner, size, total, _share(weighted, total), self.seen)

    def _pieces(self) -> Iterator[tuple[ComplexArray, ComplexArray]]:
        """Yield what was identified on some lines, of every input (m, lines, k), and the functions there (lines, k)."""
        lines, k, inputs = len(self.functions) // 2, self.states.shape[1], len(self.factor)
        columns = np.ascontiguousarray(self.states).view(np.float64)
        most = max(_AT_A_TIME // max(k * inputs, 1), 1)
        for start in range(0, lines, most):
            s = slice(start, start + most)
            real, imaginary = (
                (part[:, s] @ columns).view(np.complex128) for part in (self.factor[:, :lines], self.factor[:, lines:])
            )
            sides = _both_signs(real, imaginary), _both_signs(self.functions[:lines][s], self.functions[lines:][s])
            yield from zip(*sides, strict=True)


def squares(values: Array) -> RealArray:
    """Return the sums of |v|^2 of columns (rows, k)."""
    return np.asarray(np.einsum("ij,ij->j", values.real, values.real) + np.einsum("ij,ij->j", values.imag, values.imag))


def _squared(values: Array) -> RealArray:
    return np.asarray(values.real**2 + values.imag**2)


def _both_signs(real: ComplexArray, imaginary: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the values at +w and at -w of columns in real and imaginary parts."""
    turned = 1j * imaginary
    return real + turned, real - turned


def _share(part: RealArray, whole: RealArray) -> RealArray:
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
