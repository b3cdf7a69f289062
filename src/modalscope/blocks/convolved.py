"""Gradients of poles by samples that are convolutions of a row and a column: what noise makes of them, by their correlations.

    g_oi[t] = sum_(a + b = t) L_o[a] v_i[b],   sum_t g h* = sum_u P(u) Q(-u),

P the correlation of the rows L with those of h over the lags u, outputs summed, and Q that of the columns. Only lags shorter than the
shorter side are needed: many rows of few blocks meet columns of many without ever being as long. Where rows and columns are few the
transforms of both over all samples are less: their products are summed as they are.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.blocks.influence import Moments, Outer, SampleInfluence
from modalscope.model.checks import Array, ComplexArray, RealArray, freeze

__all__ = ["Convolution", "ConvolvedInfluence", "convolved", "transformed"]


#: Numbers of rows and columns that are transformed at a time.
_AT_A_TIME = 20_000


class Convolution(NamedTuple):
    """Rows and columns of k poles.

    Attributes
    ----------
    rows : array of complex, (k, block rows, l)
    columns : array of complex, (k, block columns, m)
    """

    rows: ComplexArray
    columns: ComplexArray


def transformed(rows: ComplexArray, columns: ComplexArray, length: int | None = None) -> Outer:
    """Return g[t] = sum_(a + b = t) rows[a] columns[b]' by its Fourier transform.

    Parameters
    ----------
    rows : array of complex, (k, block rows, l)
    columns : array of complex, (k, block columns, m)
    length : int, optional
        Samples of the transform; by default as many as block rows and columns need together.
    """
    if length is None:
        length = _fast(rows.shape[1] + columns.shape[1] - 1)
    return Outer(_transform(rows, length), _transform(columns, length))


def convolved(rows: Array, columns: Array) -> ConvolvedInfluence:
    """Return the gradient g_j[t] = sum_(a + b = t) rows_j[a] columns_j[b]'; block rows behind the last that is not zero count for nothing.

    Parameters
    ----------
    rows : array of complex, (k, block rows, l)
    columns : array of complex, (k, block columns, m)
    """
    used = np.flatnonzero(np.any(rows, axis=(0, 2)))
    rows = rows[:, : max(used.max(initial=0) + 1, 1)]
    return ConvolvedInfluence((Convolution(np.asarray(rows, dtype=complex), np.asarray(columns, dtype=complex)),))


class ConvolvedInfluence(SampleInfluence):
    """Dp = sum_t g[t] dY(t), g a sum of convolutions; by Fourier transforms over t where more is asked than white noise.

    Parameters
    ----------
    parts : tuple of Convolution
    """

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
    most = max(2 * _AT_A_TIME // each, 1)
    found = []
    for start in range(0, max(len(mine[0].rows), 1), most):
        own, level = _some(mine, start, most), variance if variance.ndim == 2 else variance[start : start + most]
        found.append(_of_some(own, own if its is mine else _some(its, start, most), level))
    return Moments(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


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
    found = fft.ifft(spectrum, axis=1)
    return np.concatenate([found[:, found.shape[1] - lags :], found[:, : lags + 1]], axis=1)


def _mirrored(spectrum: ComplexArray) -> ComplexArray:
    """Return the values at -f."""
    return np.concatenate([spectrum[:, :1], spectrum[:, :0:-1]], axis=1)


def _transform(values: ComplexArray, length: int) -> ComplexArray:
    return np.asarray(fft.fft(values, n=length, axis=1), dtype=complex)


def _fast(length: int) -> int:
    return int(fft.next_fast_len(length))
