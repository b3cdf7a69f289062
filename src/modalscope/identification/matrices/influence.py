"""First-order sensitivities of poles to the response, and the covariance that noise gives poles.

The first-order change of a pole is dp = L dH v with one row and one column vector, H the data matrix. H is linear in the response, so its
adjoint turns the pair into an array g of the response's own shape with dp = sum g dY. That array is an outer product (output by input) on
every line, or at every frequency of its Fourier transform over the samples, and is never formed where the noise is white.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple, Self

import numpy as np
from scipy import fft
from scipy.linalg import matmul_toeplitz

from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, freeze


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

    #: Whether every pole may have a noise variance of its own.
    noise_by_pole: ClassVar[bool] = False

    @abstractmethod
    def joint(self, other: Self, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return what one noise does to these poles and to as many others together.

        `other`: of the same response on the other poles. `variance` (l, m): e|noise|^2 of the values; of lines it may differ from line to
        line. Where `noise_by_pole` also (k, 1, l, m), one per pole. `fading`: what an exponential window makes of it. Of samples, (N,): the
        variance of each over the average. Of lines, (F,): the correlation of one with that k lines below it. By default every value
        stands alone.
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

    `direct`, `mirrored`: a and b on the lines used. `lines`: those that are used.
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

    `terms`: sum_t g[t] exp(-2 pi j f t / N), f = 0 ... N - 1.
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
            length = min(len(g), len(h), len(weights))
            weighted = g[:length] * weights[:length]
            size.append(np.sum(weighted * h[:length].conj()))
            square.append(np.sum(weighted * h[:length]))
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


#: Count of numbers in the rows and columns transformed at a time.
_BLOCK_NUMBERS = 20_000


class Convolution(NamedTuple):
    """Rows (k, block rows, l) and columns (k, block columns, m) of k poles."""

    rows: ComplexArray
    columns: ComplexArray


def transformed(rows: ComplexArray, columns: ComplexArray, length: int) -> Outer:
    """Return g[t] = sum_(a + b = t) rows[a] columns[b]' by its Fourier transform of a length; rows (k, a, l), columns (k, b, m)."""
    return Outer(_transform(rows, length), _transform(columns, length))


def convolved(rows: Array, columns: Array) -> ConvolvedInfluence:
    """Return the gradient g_j[t] = sum_(a + b = t) rows_j[a] columns_j[b]'; block rows behind the last that is not zero count for nothing.

    `rows` (k, block rows, l). `columns` (k, block columns, m).
    """
    used = np.flatnonzero(np.any(rows, axis=(0, 2)))
    rows = rows[:, : max(used.max(initial=0) + 1, 1)]
    return ConvolvedInfluence((Convolution(np.asarray(rows, dtype=complex), np.asarray(columns, dtype=complex)),))


class ConvolvedInfluence(SampleInfluence):
    """Dp = sum_t g[t] dY(t), g a sum of convolutions; by Fourier transforms over t where more is asked than white noise."""

    noise_by_pole = True
    parts: tuple[Convolution, ...]

    def __init__(self, parts: tuple[Convolution, ...]) -> None:
        freeze(self, parts=parts)

    @cached_property
    def terms(self) -> tuple[Outer, ...]:
        """The transforms of the parts."""
        length = _fast(max(part.rows.shape[1] + part.columns.shape[1] - 1 for part in self.parts))
        return tuple(transformed(part.rows, part.columns, length) for part in self.parts)

    def joint(self, other: SampleInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under noise of this variance, on average over the samples."""
        if fading is not None or variance.ndim == 3 or not isinstance(other, ConvolvedInfluence):
            return super().joint(other, variance, fading)
        return _moments(self.parts, other.parts, variance if variance.ndim == 2 else variance[:, 0])

    def take(self, index: Array) -> ConvolvedInfluence:
        """Return the gradients of some poles."""
        return ConvolvedInfluence(tuple(Convolution(part.rows[index], part.columns[index]) for part in self.parts))

    def joined(self, other: SampleInfluence) -> SampleInfluence:
        """Return the sum of two gradients."""
        if isinstance(other, ConvolvedInfluence):
            return ConvolvedInfluence(self.parts + other.parts)
        return super().joined(other)

    def transposed(self) -> ConvolvedInfluence:
        """Return the gradient by the transposed response."""
        return ConvolvedInfluence(tuple(Convolution(part.columns, part.rows) for part in self.parts))


def _moments(mine: tuple[Convolution, ...], its: tuple[Convolution, ...], variance: RealArray) -> Moments:
    """Return sum_t g h* and sum_t g h, weighted by the variance of output and input: of so many poles at a time as stay in the cache."""
    each = sum(side.shape[1] * side.shape[2] for part in (*mine, *its) for side in part)
    most = max(2 * _BLOCK_NUMBERS // each, 1)
    moments = []
    for start in range(0, max(len(mine[0].rows), 1), most):
        own, level = _some(mine, start, most), variance if variance.ndim == 2 else variance[start : start + most]
        moments.append(_of_some(own, own if its is mine else _some(its, start, most), level))
    return Moments(*(np.concatenate(parts) for parts in zip(*moments, strict=True)))


def _some(parts: tuple[Convolution, ...], start: int, most: int) -> tuple[Convolution, ...]:
    return tuple(Convolution(*(side[start : start + most] for side in part)) for part in parts)


def _of_some(mine: tuple[Convolution, ...], its: tuple[Convolution, ...], variance: RealArray) -> Moments:
    """Return the sums over all pairs of parts; of g with itself a pair and the pair turned round are conjugate, and each is made once."""
    lags, lengths = _lengths((*mine, *its))
    first = [tuple(_transform(*each) for each in zip(part, lengths, strict=True)) for part in mine]
    second = (
        first if its is mine else [tuple(_transform(*each) for each in zip(part, lengths, strict=True)) for part in its]
    )
    size, square = np.zeros((2, len(mine[0].rows)), dtype=complex)
    for j, one in enumerate(first):
        for k, two in enumerate(second):
            if its is mine and k < j:
                continue
            found = _pair(one, two, lags, variance)
            both = its is mine and k > j
            size += 2 * found.size.real if both else found.size
            square += 2 * found.square if both else found.square
    return Moments(size, square)


def _lengths(parts: tuple[Convolution, ...]) -> tuple[int | None, tuple[int, int]]:
    """Return the lags at which rows and columns meet, and the lengths of their transforms; of lags None where all samples cost less."""
    (rows, outputs), (columns, inputs) = (np.max([part[side].shape[1:] for part in parts], axis=0) for side in range(2))
    lags, whole = int(min(rows, columns)) - 1, _fast(int(rows + columns) - 1)
    each = _fast(int(rows) + lags), _fast(int(columns) + lags)
    back = 2 * inputs * sum(each)
    return (
        (None, (whole, whole))
        if whole * (outputs + inputs) < outputs * each[0] + inputs * each[1] + back
        else (lags, each)
    )


def _pair(
    one: tuple[ComplexArray, ...], two: tuple[ComplexArray, ...], lags: int | None, variance: RealArray
) -> Moments:
    """Return the moments of two convolutions by the transforms of their rows and columns."""
    (L, v), (M, w) = one, two
    by_rows = [_with_conjugate(L, M), L * _mirrored(M)]
    by_columns: list[Array] = [_with_conjugate(v, w), v * _mirrored(w)]
    pairs = zip(by_rows, by_columns, strict=True)
    if lags is None:
        each = (np.swapaxes(P, 1, 2) @ Q / L.shape[1] for P, Q in pairs)
        return Moments(*(np.sum(found * variance, axis=(1, 2)) for found in each))
    met = ((_lags(P @ variance, lags), _lags(Q, lags)[:, ::-1]) for P, Q in pairs)
    return Moments(*(np.einsum("kui,kui->k", P, Q) for P, Q in met))


def _with_conjugate(one: ComplexArray, two: ComplexArray) -> Array:
    """Return one two*; of the same values their squares, real numbers, whose transform costs half."""
    return one.real**2 + one.imag**2 if two is one else one * two.conj()


def _lags(spectrum: Array, lags: int) -> ComplexArray:
    """Return correlations at the lags -lags ... lags, (k, 2 lags + 1, c)."""
    values = fft.ifft(spectrum, axis=1)
    return np.concatenate([values[:, values.shape[1] - lags :], values[:, : lags + 1]], axis=1)


def _mirrored(spectrum: ComplexArray) -> ComplexArray:
    """Return the values at -f."""
    return np.concatenate([spectrum[:, :1], spectrum[:, :0:-1]], axis=1)


def _transform(values: ComplexArray, length: int) -> ComplexArray:
    return np.asarray(fft.fft(values, n=length, axis=1), dtype=complex)


def _fast(length: int) -> int:
    return int(fft.next_fast_len(length))
