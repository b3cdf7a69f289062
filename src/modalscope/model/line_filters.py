"""The functions of oscillations on lines together with their squares, for filters that are matched to thousands of poles."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.poles import to_discrete

__all__ = ["line_filters"]


def line_filters(frequencies: RealArray, rate: float | None, poles: Array) -> tuple[RealArray, RealArray]:
    """Return g1 and g2 of poles on lines, real parts before imaginary ones, (n, 2, 2, F), and (|g1|^2 + |g2|^2) / 2, (n, F).

    With h and p of a pole and its conjugate g1 = h + p and g2 = j (h - p), so that their squares are |h|^2 + |p|^2, which is on the way to
    them: h = (u - j v) / (u^2 + v^2), x - pole = u + j v.

    Parameters
    ----------
    frequencies : array, (F,)
        Hz.
    rate : float or None
        Of a sampled system, Hz.
    poles : array of complex, (n,)
        rad/s, so few that all of this stays in the cache.
    """
    x, s = 2j * np.pi * frequencies, np.asarray(poles, dtype=complex)
    if rate is not None:
        x, s = np.exp(x / rate), to_discrete(s, 1 / rate)
    u = (x.real if rate is not None else 0.0) - s.real[:, None]
    found, squares = np.empty((s.size, 2, 2, x.size)), np.empty((s.size, x.size))
    g1, g1_imag, g2, g2_imag = found[:, 0, 0], found[:, 0, 1], found[:, 1, 0], found[:, 1, 1]
    v, w = x.imag - s.imag[:, None], -x.imag - s.imag[:, None]
    own, pair = np.multiply(v, v, out=g1), np.multiply(w, w, out=g2_imag)
    for size in (own, pair):
        size += u * u
        np.reciprocal(size, out=size)
    v *= own
    w *= pair
    np.subtract(w, v, out=g1_imag)
    np.add(v, w, out=g2)
    np.add(own, pair, out=squares)
    own -= pair
    np.multiply(own, u, out=g2_imag)
    np.multiply(squares, u, out=g1)
    return found, squares
