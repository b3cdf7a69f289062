"""Which poles act as one mode."""

from __future__ import annotations

import numpy as np

from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, ComplexArray

__all__ = ["ONE_SHAPE", "collinear"]

#: Poles that overlap are one mode above this MAC, and those of single channels nearer than this part of both half bandwidths.
ONE_SHAPE, _CLOSE = 0.9, 0.25


def collinear(poles: ComplexArray, shapes: ComplexArray, participation: ComplexArray) -> Array:
    """Return which pairs of poles act as one mode, (n, n): they overlap, and their shapes are one.

    With a single output or input, shapes or participation tell little: there any two poles are one that lie much closer yet.
    """
    w, half = poles.imag, -poles.real
    apart = np.abs(w[:, None] - w) / (half[:, None] + half)
    one = (apart < 1) & (mac(shapes) > ONE_SHAPE)
    if 1 in (len(shapes), participation.shape[1]):
        one |= apart < _CLOSE
    return np.asarray(one)
