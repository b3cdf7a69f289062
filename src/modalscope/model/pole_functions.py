"""The functions of poles on lines and on samples, real columns that are the same for every output and input, and their derivatives."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import powers_of, to_discrete

__all__ = ["line_functions", "sample_functions"]


def line_functions(frequencies: RealArray, rate: float | None, poles: Array, *, slopes: bool = False) -> RealArray:
    """Return the functions 1 / (x - pole) and conjugates on lines, (2 F, 2 n); with `slopes` their d/ds behind them, e1, e2 of every pole.

    The transposed matrix is made row by row: each function lies in one piece.
    """
    x, p, chain = _points(frequencies, rate, poles)
    own, pair = 1 / (x - p[:, None]), 1 / (x - p.conj()[:, None])
    pairs = [(own, np.where((p.imag == 0)[:, None], 0, pair))]
    if slopes:
        pairs.append((chain[:, None] * own**2, chain.conj()[:, None] * pair**2))
    found = np.empty((len(pairs), p.size, 2, 2, x.size))
    for to, (g, h) in zip(found, pairs, strict=True):
        np.add(g.real, h.real, out=to[:, 0, 0])
        np.add(g.imag, h.imag, out=to[:, 0, 1])
        np.subtract(h.imag, g.imag, out=to[:, 1, 0])
        np.subtract(g.real, h.real, out=to[:, 1, 1])
    found[0, p.imag == 0, 1] = 0
    return found.reshape(-1, 2 * x.size).T


def _points(
    frequencies: RealArray, rate: float | None, poles: Array
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return the lines and the poles in one plane, and d pole / d s there."""
    x, s = (np.asarray(values, dtype=complex) for values in (2j * np.pi * frequencies, poles))
    if rate is None:
        return x, s, np.ones(s.size, dtype=complex)
    z = to_discrete(s, 1 / rate)
    return np.exp(x / rate), z, np.asarray(z / rate)


def sample_functions(rate: float, first: int, count: int, poles: Array, *, slopes: bool = False) -> RealArray:
    """Return Re and Im of exp(s t_k), (N, 2 n), with `slopes` their d/ds behind them, columns e1, e2 of every pole."""
    s = np.asarray(poles, dtype=complex)
    z = to_discrete(s, 1 / rate)
    decay = powers_of(z, count, first)
    alone = (s.imag == 0) | (z.imag == 0)
    found = np.empty((count, 1 + slopes, s.size, 2))
    found[:, 0, :, 0] = np.where(alone, decay.real, 2 * decay.real)
    found[:, 0, :, 1] = np.where(alone, 0.0, -2 * decay.imag)
    if slopes:
        t = (np.arange(count) + first) / rate
        grown = t[:, None] * decay
        found[:, 1, :, 0], found[:, 1, :, 1] = 2 * grown.real, -2 * grown.imag
    return found.reshape(count, 2 * s.size * (1 + slopes))
