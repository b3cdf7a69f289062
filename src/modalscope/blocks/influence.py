"""How small changes of a response move poles: gradients that are kept as outer products, and what noise makes of them.

The first-order change of a pole is dp = L dH v with one row and one column vector, H the data matrix. H is linear in the response, so its
adjoint turns the pair into an array g of the response's own shape with dp = sum g dY. That array is an outer product (output by input) on
every line, or at every frequency of its Fourier transform over the samples, and is never formed where the noise is white.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Self

import numpy as np
from scipy.linalg import matmul_toeplitz

from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray

__all__ = ["Influence", "LineInfluence", "Lines", "Moments", "Outer", "SampleInfluence", "all_lines"]


class Lines(NamedTuple):
    """Lines that stand for all: which, and for how many each, (F',)."""

    used: IntArray
    each: RealArray


def all_lines(count: int) -> Lines:
    """Return all lines, each for itself."""
    return Lines(np.arange(count), np.ones(count))


class Outer(NamedTuple):
    """left[k, f, o] right[k, f, i]: an array (k, F, l, m) that is never formed."""

    left: Array
    right: Array

    def times(self, other: Outer) -> Outer:
        """Return the products of the entries, an outer product again."""
        return Outer(self.left * other.left, self.right * other.right)

    def times_conjugate(self, other: Outer) -> Outer:
        """Return the products of the entries with conjugate ones: of the same their squares, real numbers."""
        if other is self:
            return Outer(*(np.asarray(part.real**2 + part.imag**2, dtype=float) for part in self))
        return Outer(self.left * other.left.conj(), self.right * other.right.conj())

    def take(self, index: Array) -> Outer:
        """Return the entries of some k."""
        return Outer(self.left[index], self.right[index])

    def lengthened(self, length: int) -> Outer:
        """Return the transforms over f of the same sequences, followed by zeros to a length."""
        if length == self.left.shape[1]:
            return self
        return Outer(*(np.fft.fft(np.fft.ifft(part, axis=1), n=length, axis=1) for part in self))

    def transposed(self) -> Outer:
        """Return the entries with outputs and inputs in each other's places."""
        return Outer(self.right, self.left)

    def summed(self, weights: RealArray) -> ComplexArray:
        """Return sum_(f, o, i) weights[f, o, i] left[k, f, o] right[k, f, i], (k,); weights (l, m) are those of every f."""
        if weights.ndim == 2:
            return np.asarray(np.einsum("kfi,kfi->k", self.left @ weights, self.right))
        turned = self.left.transpose(1, 0, 2) @ weights  # (F, k, m)
        return np.asarray(np.sum(turned * self.right.transpose(1, 0, 2), axis=(0, 2)))


class Moments(NamedTuple):
    """What noise does to poles p and q together, the same ones or those of two methods: E[dp dq*] and E[dp dq], (k,) each."""

    size: Array
    square: ComplexArray

    def scaled(self, factor: Array, other: Array) -> Moments:
        """Return the moments of `factor` dp and `other` dq."""
        return Moments(self.size * factor * np.conj(other), self.square * factor * other)

    @property
    def covariance(self) -> RealArray:
        """Covariance of (Re p, Im p) with (Re q, Im q), (k, 2, 2)."""
        plus, minus = self.square + self.size, self.square - self.size
        rows = [[plus.real, minus.imag], [plus.imag, -minus.real]]
        return np.stack([np.stack(row, axis=1) for row in rows], axis=1) / 2


class Influence(ABC):
    """The gradient of poles by the values of a response."""

    #: Whether every pole may be held against a noise of its own.
    noise_by_pole: ClassVar[bool] = False

    @abstractmethod
    def joint(self, other: Self, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return what one noise does to these poles and to as many others together.

        Parameters
        ----------
        other : Influence
            Of the same response on the other poles.
        variance : array, (l, m) or (F, l, m)
            E|noise|^2 of the values; of lines it may differ from line to line. Where `noise_by_pole` also (k, 1, l, m), one a pole.
        fading : array, optional
            What an exponential window makes of it. Of samples, (N,): the variance of each over the average. Of lines, (F,): the
            correlation of one with that k lines below it. By default every value stands alone.
        """

    @abstractmethod
    def take(self, index: Array) -> Self:
        """Return the gradients of some poles."""

    @abstractmethod
    def of(self, change: Array) -> ComplexArray:
        """Return the first-order change of the poles for changes of the response, (d, F or N, l, m) -> (d, k)."""

    @abstractmethod
    def joined(self, other: Self) -> Influence:
        """Return the sum of two gradients."""

    @abstractmethod
    def transposed(self) -> Influence:
        """Return the gradient by the transposed response."""


@dataclass(frozen=True, eq=False)
class LineInfluence(Influence):
    """dp = sum over lines of a dH + b dH*, both sums of outer products.

    Parameters
    ----------
    direct, mirrored : tuple of Outer
        a and b on the lines used.
    lines : Lines
        Those that are used.
    """

    direct: tuple[Outer, ...]
    mirrored: tuple[Outer, ...]
    lines: Lines

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise, E|dH|^2 = variance."""
        if fading is not None:
            return self._faded(other, variance, fading)
        used = variance if variance.ndim == 2 else variance[self.lines.used]
        each = self.lines.each[:, None]

        def summed(products: Iterable[Outer]) -> Array:
            weighted = (Outer(one.left, one.right * each) for one in products)
            return np.asarray(sum(one.summed(used) for one in weighted))

        sides = ((self.direct, other.direct), (self.mirrored, other.mirrored))
        size = summed(one.times_conjugate(two) for own, its in sides for one in own for two in its)
        square = summed(one.times(two) for one in self.direct for two in other.mirrored)
        if other is self:
            return Moments(size, np.asarray(2 * square, dtype=complex))
        return Moments(size, square + summed(one.times(two) for one in self.mirrored for two in other.direct))

    def _faded(self, other: LineInfluence, variance: RealArray, fading: Array) -> Moments:
        """Return sum a C a'* + b C* b'* and sum a C b' + b C* a', with C the covariance of the lines' noise, pole by pole."""
        spread = np.sqrt(np.broadcast_to(variance, (len(fading), *variance.shape[-2:]))[self.lines.used])
        size, square = [], []
        for j in range(len(self.direct[0].left)):
            (a, b), (c, d) = self._plain(j, spread), other._plain(j, spread)
            up, down = ((fading, fading.conj()), (fading.conj(), fading))  # of the column and of the row
            size.append(np.sum(a * matmul_toeplitz(up, c.conj())) + np.sum(b * matmul_toeplitz(down, d.conj())))
            square.append(np.sum(a * matmul_toeplitz(up, d)) + np.sum(b * matmul_toeplitz(down, c)))
        return Moments(np.asarray(size), np.asarray(square, dtype=complex))

    def _plain(self, j: int, spread: RealArray) -> tuple[ComplexArray, ComplexArray]:
        """Return a and b of one pole times a deviation of the values, (F, l m)."""

        def whole(part: tuple[Outer, ...]) -> ComplexArray:
            entries = sum(np.asarray(one.left[j][:, :, None] * one.right[j][:, None, :]) for one in part)
            return np.asarray(entries * spread, dtype=complex).reshape(len(spread), -1)

        return whole(self.direct), whole(self.mirrored)

    def take(self, index: Array) -> LineInfluence:
        """Return the gradients of some poles."""
        direct, mirrored = (tuple(one.take(index) for one in part) for part in (self.direct, self.mirrored))
        return LineInfluence(direct, mirrored, self.lines)

    def of(self, change: Array) -> ComplexArray:
        """Return the change of the poles; where lines were left out an estimate."""
        return np.stack([self._of(one[self.lines.used] * self.lines.each[:, None, None]) for one in change])

    def _of(self, change: Array) -> ComplexArray:
        """Return sum a dH + b dH*, by real and imaginary parts of dH as weights."""
        parts = ((self.direct, 1.0), (self.mirrored, -1.0))
        total = sum(
            one.summed(change.real) + sign * 1j * one.summed(change.imag) for part, sign in parts for one in part
        )
        return np.asarray(total)

    def joined(self, other: LineInfluence) -> LineInfluence:
        """Return the sum of two gradients on the same lines."""
        return LineInfluence(self.direct + other.direct, self.mirrored + other.mirrored, self.lines)

    def transposed(self) -> LineInfluence:
        """Return the gradient by the transposed response."""
        direct, mirrored = (tuple(one.transposed() for one in part) for part in (self.direct, self.mirrored))
        return LineInfluence(direct, mirrored, self.lines)


@dataclass(frozen=True, eq=False)
class SampleInfluence(Influence):
    """dp = sum_t g[t] dY(t), g by its Fourier transform over t: sums of outer products again (Parseval serves the moments).

    Parameters
    ----------
    terms : tuple of Outer
        sum_t g[t] exp(-2 pi j f t / N), f = 0 ... N - 1.
    """

    terms: tuple[Outer, ...]

    @property
    def _length(self) -> int:
        return int(self.terms[0].left.shape[1])

    def joint(self, other: SampleInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under noise of this variance, on average over the samples."""
        if fading is not None:
            return self._faded(other, variance, fading)
        length = max(self._length, other._length)
        pairs = [(one.lengthened(length), two.lengthened(length)) for one in self.terms for two in other.terms]
        size: Array = np.sum([one.times_conjugate(two).summed(variance) for one, two in pairs], axis=0)
        square: Array = np.sum([one.times(_backwards(two)).summed(variance) for one, two in pairs], axis=0)
        return Moments(np.asarray(size / length), np.asarray(square / length, dtype=complex))

    def _faded(self, other: SampleInfluence, variance: RealArray, fading: Array) -> Moments:
        weights = variance * fading[:, None, None]
        size, square = [], []
        for j in range(len(self.terms[0].left)):
            g, h = self.gradient(j), other.gradient(j)
            seen = min(len(g), len(h), len(weights))
            weighted = g[:seen] * weights[:seen]
            size.append(np.sum(weighted * h[:seen].conj()))
            square.append(np.sum(weighted * h[:seen]))
        return Moments(np.asarray(size), np.asarray(square, dtype=complex))

    def take(self, index: Array) -> SampleInfluence:
        """Return the gradients of some poles."""
        return SampleInfluence(tuple(term.take(index) for term in self.terms))

    def of(self, change: Array) -> ComplexArray:
        """Return the change of the poles, one pole at a time; samples beyond the last that was read do nothing."""
        return np.stack([self._of_pole(j, change) for j in range(len(self.terms[0].left))], axis=1)

    def _of_pole(self, j: int, change: Array) -> ComplexArray:
        g = self.gradient(j)[: change.shape[1]]
        return np.asarray(change[:, : len(g)].reshape(len(change), -1) @ g.ravel())

    def gradient(self, j: int) -> ComplexArray:
        """Return g of one pole, (N, l, m): for small problems and for tests."""
        spectrum = sum(term.left[j][:, :, None] * term.right[j][:, None, :] for term in self.terms)
        return np.fft.ifft(np.asarray(spectrum), axis=0)

    def joined(self, other: SampleInfluence) -> SampleInfluence:
        """Return the sum of two gradients of the same length."""
        return SampleInfluence(self.terms + other.terms)

    def transposed(self) -> SampleInfluence:
        """Return the gradient by the transposed response."""
        return SampleInfluence(tuple(term.transposed() for term in self.terms))


def _backwards(term: Outer) -> Outer:
    """Return the values at -f."""
    left, right = (np.roll(part[:, ::-1], 1, axis=1) for part in term)
    return Outer(left, right)
