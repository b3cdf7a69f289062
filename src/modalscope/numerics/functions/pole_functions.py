"""Compute the functions of poles on lines and on samples, real columns that serve every output and input, and their derivatives."""

from __future__ import annotations

import numpy as np

from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import is_real, powers_of, to_discrete

#: Real and imaginary part.
_Parts = tuple[RealArray, RealArray]


#: Maximum growth exponent over the samples: faster growing poles are no modes, and squares of their functions would overflow.
_MAX_GROWTH = 300.0

#: Numbers computed at a time: they stay in the cache.
_NUMBERS_AT_A_TIME = 32_000


def line_functions(frequencies: RealArray, rate: float | None, poles: Array, *, slopes: bool = False) -> RealArray:
    """Return the functions 1 / (x - pole) and conjugates on lines, (2 F, 2 n); with `slopes` their d/ds behind them, e1, e2 of every pole.

    The transposed matrix is made row by row: each function lies in one piece. Real and imaginary parts apart take a third of the time that
    complex numbers do.
    """
    return _stacked(*_points(frequencies, rate, poles), slopes)


def functions_at(points: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """Return the functions of `line_functions` as complex numbers, (F, 2 n), at points in the plane of the poles."""
    rows = _stacked(points, poles, None, False)
    return rows[: points.size] + 1j * rows[points.size :]


def _stacked(x: ComplexArray, p: ComplexArray, chain: ComplexArray | None, slopes: bool) -> RealArray:
    functions = np.empty((1 + slopes, p.size, 2, 2, x.size))
    step = max(_NUMBERS_AT_A_TIME // max(x.size, 1), 1)
    for some in (slice(first, first + step) for first in range(0, p.size, step)):
        _fill(functions[:, some], x, p[some], None if chain is None else chain[some])
    return functions.reshape((1 + slopes) * 2 * p.size, 2 * x.size).T


def _fill(place: RealArray, x: ComplexArray, p: ComplexArray, chain: ComplexArray | None) -> None:
    """Lay the functions of some poles into their place, (1 or 2, n, 2, 2, F)."""
    direct, pair = _inverse(x, p), _inverse(x, p.conj())
    alone = is_real(p)  # exp(j pi) is -1 but for rounding
    pairs = [(direct, tuple(np.where(alone[:, None], 0, part) for part in pair) if np.any(alone) else pair)]
    if len(place) > 1:
        pairs.append((_squared(direct, chain), _squared(pair, None if chain is None else chain.conj())))
    for to, ((g, g_imag), (h, h_imag)) in zip(place, pairs, strict=True):
        np.add(g, h, out=to[:, 0, 0])
        np.add(g_imag, h_imag, out=to[:, 0, 1])
        np.subtract(h_imag, g_imag, out=to[:, 1, 0])
        np.subtract(g, h, out=to[:, 1, 1])
    place[0, alone, 1] = 0


def _inverse(x: ComplexArray, p: ComplexArray) -> _Parts:
    """Return 1 / (x - p) by its parts, (n, F) each: arrays are large, and few are made."""
    u = x.real - p.real[:, None] if np.any(x.real) else -p.real[:, None]
    v = p.imag[:, None] - x.imag
    size = v * v
    size += u * u
    np.reciprocal(size, out=size)
    return u * size, np.multiply(v, size, out=v)


def _squared(values: _Parts, factors: ComplexArray | None) -> _Parts:
    """Return the squares times a factor per row (n,), where there is one, by their parts."""
    real, imag = values
    squares, products = real * real, real * imag
    squares -= imag * imag
    products *= 2
    if factors is None:
        return squares, products
    a, b = factors.real[:, None], factors.imag[:, None]
    return a * squares - b * products, a * products + b * squares


def _points(
    frequencies: RealArray, rate: float | None, poles: Array
) -> tuple[ComplexArray, ComplexArray, ComplexArray | None]:
    """Return the lines and the poles in one plane, and d pole / d s there where it is not one."""
    x, s = (np.asarray(values, dtype=complex) for values in (2j * np.pi * frequencies, poles))
    if rate is None:
        return x, s, None
    z = to_discrete(s, 1 / rate)
    return np.exp(x / rate), z, np.asarray(z / rate)


def sample_functions(rate: float, first: int, count: int, poles: Array, *, slopes: bool = False) -> RealArray:
    """Return Re and Im of exp(s t_k), (N, 2 n), with `slopes` their d/ds behind them, columns e1, e2 of every pole."""
    s = np.asarray(poles, dtype=complex)
    s = np.minimum(s.real, _MAX_GROWTH * rate / max(first + count, 1)) + 1j * s.imag
    z = to_discrete(s, 1 / rate)
    decay = powers_of(z, count, first, rows=True)
    alone = is_real(z)[:, None]
    # as on lines each function lies in one piece
    functions = np.empty((1 + slopes, s.size, 2, count))
    np.multiply(decay.real, np.where(alone, 1.0, 2.0), out=functions[0, :, 0])
    np.multiply(decay.imag, np.where(alone, 0.0, -2.0), out=functions[0, :, 1])
    if slopes:
        t = (np.arange(count) + first) / rate
        np.multiply(decay.real, 2 * t, out=functions[1, :, 0])
        np.multiply(decay.imag, -2 * t, out=functions[1, :, 1])
    return functions.reshape(-1, count).T
