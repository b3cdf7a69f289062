"""Compute the effect of an exponential window on stationary noise, over samples and lines."""

from __future__ import annotations

import numpy as np

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, RealArray

#: Relative rounding of single precision, in which many responses are stored.
_STORED = 1e-7


def line_step(response: Response) -> float:
    """Return the distance of the lines, Hz; 0 of samples and of one line."""
    grid = response.grid
    return 0.0 if grid is None or grid.size < 2 else float(np.median(np.diff(grid)))


def window_over_lines(response: Response) -> float:
    """Return a T, the rate of an exponential window times the length that a line's distance tells; 0 without a window, and of samples.

    Noise under the window has the correlation 1 / (1 + j pi i / (a T)) between lines i apart.
    """
    step = line_step(response)
    return response.added_damping / step if step else 0.0


def fading(response: Response) -> RealArray | None:
    """Return exp(-a t), by which an exponential window lets steady noise fade over samples, (K,); None without one, and of lines.

    No smaller than rounding of what is stored: what lies below it does not fade with the window.
    """
    a = response.added_damping
    if a <= 0 or response.grid is not None or response.sampling_rate is None:
        return None
    return np.asarray(np.maximum(np.exp(-a / response.sampling_rate * np.arange(response.count)), _STORED))


def faded_noise(response: Response) -> Array | None:
    """Return what an exponential window exp(-a t) makes of steady noise: exp(-2 a t) over its mean, of lines its transform.

    On lines df apart, those of a record of 1 / df seconds, E n_(f + k) n_f* = variance / (1 + j pi k df / a).
    """
    a, grid = response.added_damping, response.grid
    if a <= 0:
        return None
    if grid is not None:
        return np.asarray(1 / (1 + 1j * np.pi * np.arange(response.count) * line_step(response) / a))
    decay = fading(response)
    assert decay is not None
    return np.asarray(decay**2 / np.mean(decay**2))
