"""Transfer functions over a finite window of samples, Y_t(z) = sum_(k < K) Y(k + t) z^-k, and what modes and models give there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.checks import Array, ComplexArray, DataError, RealArray, check_choice, check_count
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.resolvent import HELD
from modalscope.model.statespace import StateSpace

__all__ = ["is_full_grid", "model_transfer", "shifted_transfer", "window_lines", "window_sum"]


def model_transfer(model: StateSpace, frequencies: ArrayLike, shift: int = 0) -> ComplexArray:
    """Return C A^i (x I - A)^-1 B on lines in Hz, (F, l, m): the i-th derivative (Eqs. 71, 75), or the shift by i samples (Eq. 81).

    It is x^i H - sum_k C A^k B x^(i-1-k) - D x^i: what is left of x^i H without its initial-value terms.

    Parameters
    ----------
    model : StateSpace
        Continuous, x = j 2 pi f, or sampled, x = exp(j 2 pi f dt).
    frequencies : array, (F,)
    shift : int
        i.
    """
    power = np.linalg.matrix_power(model.A, check_count("shift", shift, least=0))
    rest = StateSpace(A=model.A, B=model.B, C=model.C @ power, dt=model.dt)
    return rest.frequency_response(frequencies).values


def window_lines(window: int, sampling_rate: float) -> RealArray:
    """Return the lines of a window of samples from 0 to half the sampling rate, Hz."""
    return np.asarray(np.fft.rfftfreq(window, 1 / sampling_rate), dtype=float)


def shifted_transfer(
    values: Array,
    points: ArrayLike,
    window: int,
    shifts: Sequence[int],
    route: str = "recursion",
    start: ComplexArray | None = None,
) -> ComplexArray:
    """Return Y_t(z) = sum_(k < K) Y(k + t) z^-k for every shift t, (shifts, F, l, m).

    Parameters
    ----------
    values : array, (N, l, m)
        Markov parameters; K + the last shift of them are read.
    points : array of complex, (F,)
        z of the lines, on the unit circle.
    window : int
        K.
    shifts : sequence of int
        Increasing.
    route : {"recursion", "definition"}
        Y_(t+1) = z (Y_t - Y(t) + z^-K Y(K + t)) (Eq. 81), or the sum itself.
    start : array of complex, (F, l, m), optional
        Y_0, where it is known already.
    """
    z = np.asarray(points, dtype=complex)
    need = window + max(shifts)
    if need > len(values):
        raise DataError(
            f"a window of {window} samples with shifts to {max(shifts)} reads {need} samples",
            f"the response has {len(values)}",
            f"Lower block_columns to at most {len(values) - max(shifts)}, or measure a longer response.",
        )
    if check_choice("route", route, ("recursion", "definition")) == "definition":
        return np.stack([_sum(values[t : t + window], z) for t in shifts])
    current = _sum(values[:window], z) if start is None else start
    last = z**-window
    found = []
    for t in range(max(shifts) + 1):
        if t in shifts:
            found.append(current)
        current = z[:, None, None] * (current - values[t])
        if window + t < len(values):
            current += (z * last)[:, None, None] * values[window + t]
    return np.stack(found)


def _sum(values: Array, z: ComplexArray) -> ComplexArray:
    """Return sum_k values[k] z^-k, some lines at a time."""
    steps = np.arange(len(values))
    at_once = max(1, HELD // len(values))
    parts = [np.tensordot(z[i : i + at_once, None] ** -steps, values, axes=1) for i in range(0, z.size, at_once)]
    return np.concatenate(parts)


def is_full_grid(response: FrequencyResponse) -> bool:
    """Whether the lines are all of a sampled system's DFT grid from 0 to (nearly) half the sampling rate."""
    f, rate = response.frequencies, response.sampling_rate
    if rate is None or f.size < 3 or f[0] != 0:
        return False
    step = f[1]
    length = rate / step
    even = np.max(np.abs(f - step * np.arange(f.size))) < 1e-6 * step
    return bool(even and abs(length - round(length)) < 1e-6 and f.size == round(length) // 2 + 1)


def window_sum(poles: Array, points: ComplexArray, window: int) -> ComplexArray:
    """Return sum_(k < K) r^k = (1 - r^K) / (1 - r), r = z_j / z_i."""
    r = np.asarray(poles)[None, :] / points[:, None]
    with np.errstate(under="ignore", divide="ignore", invalid="ignore", over="ignore"):
        total = (1 - r**window) / (1 - r)
    return np.where(np.abs(1 - r) < 1e-14, complex(window), total)
