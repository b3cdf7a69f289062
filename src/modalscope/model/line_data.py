"""Values on lines as real rows, which are the same for whatever poles are fitted to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["LineData", "energy_of", "line_data", "real_data", "real_rows"]


class LineData(NamedTuple):
    """Values on lines for any number of fits.

    Parameters
    ----------
    values : array, (2 F, l, m)
        Weighted, real parts above imaginary parts.
    energy : array, (l, m)
        Of every channel.
    """

    values: RealArray
    energy: RealArray


def line_data(values: ComplexArray, weights: Array | None) -> LineData:
    """Return values on lines, (F, l, m), as fits take them."""
    data = real_data(values, weights)
    return LineData(data, energy_of(data))


def energy_of(values: RealArray) -> RealArray:
    """Return sum over the rows of |v|^2 of every channel, (l, m)."""
    return np.asarray(np.einsum("klm,klm->lm", values, values))


def real_rows(columns: Array, weights: Array | None) -> RealArray:
    """Return real parts above imaginary parts, (F, k) -> (2 F, k), with the weights of the lines."""
    weighted = columns if weights is None else columns * np.asarray(weights)[:, None]
    return np.concatenate([weighted.real, weighted.imag])


def real_data(values: Array, weights: Array | None) -> RealArray:
    """Return the same of values of channels, (F, l, m) -> (2 F, l, m)."""
    lines, *channels = values.shape
    return real_rows(values.reshape(lines, -1), weights).reshape(2 * lines, *channels)
