"""Frequency responses for the eye from the lines of records: H1 over neighbouring lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.model.checks import ComplexArray, RealArray
from modalscope.model.frequency import FrequencyResponse

__all__ = ["picture_of"]

#: Lines that a picture has at most, and its neighbours on either side that each value is averaged over.
_LINES, _NEAR = 4000, 3

#: Power of an input below this share of the largest is no force.
_SILENT = 1e-12


def picture_of(
    frequencies: RealArray, outputs: ComplexArray, inputs: ComplexArray, labels: dict[str, Any]
) -> FrequencyResponse:
    """Return H = S_yu S_uu^-1 with spectra averaged over groups of neighbouring lines, of all runs together.

    Parameters
    ----------
    frequencies : array, (F,)
        Hz, in any order.
    outputs : array of complex, (F, l)
    inputs : array of complex, (F, m)
    labels : mapping
        Labels, units and quantity of the response.
    """
    order = np.argsort(frequencies, kind="stable")
    starts = np.arange(0, order.size, max(-(-order.size // _LINES), 1))
    f, Y, U = frequencies[order], outputs[order], inputs[order]
    cross = _near(np.add.reduceat(Y[:, :, None] * U[:, None, :].conj(), starts))
    power = _near(np.add.reduceat(U[:, :, None] * U[:, None, :].conj(), starts))
    m = U.shape[1]
    level = np.einsum("fii->f", power).real
    floor = _SILENT * max(float(level.max()), np.finfo(float).tiny)
    H = cross @ np.linalg.inv(power + (_SILENT * level + floor)[:, None, None] * np.eye(m))
    middle = np.add.reduceat(f, starts) / np.diff(np.append(starts, f.size))
    lines, first = np.unique(middle, return_index=True)
    return FrequencyResponse(values=H[first], frequencies=lines, **labels)


def _near(sums: ComplexArray) -> ComplexArray:
    """Return sums over each group of lines and its neighbours."""
    total = np.concatenate([np.zeros_like(sums[:1]), np.cumsum(sums, axis=0)])
    k = np.arange(len(sums))
    return np.asarray(total[np.minimum(k + _NEAR + 1, len(sums))] - total[np.maximum(k - _NEAR, 0)])
