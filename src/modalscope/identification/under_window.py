"""Noise under an exponential window: correlated between lines, what it lets through to the unknowns, and how much of it a fit takes up.

With T the correlation of noise on lines, T_fg = 1 / (1 + j pi (f - g) / a) at lines f, g and the rate a of the window, noise
e = e_r + j e_i is circular, and compressed rows Q'(e_r, e_i) have the covariance C = Re Z^H T Z with Z = Q_r + j Q_i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft as sfft

from modalscope.identification.information import covariance_of_scores, inverse, normal
from modalscope.identification.likelihood import Fitted, Point
from modalscope.model.checks import ComplexArray, RealArray
from modalscope.model.response import Response
from modalscope.model.window import window_over_lines

__all__ = ["WindowNoise", "correlated", "window_noise"]


@dataclass(frozen=True, eq=False, slots=True)
class WindowNoise:
    """What noise of variance one does to a fit.

    Parameters
    ----------
    covariance : array, (2 n p, 2 n p)
        Of the unknowns, J'J^-1 J'C J J'J^-1.
    free : float
        Expected squared misfit.
    """

    covariance: RealArray
    free: float


def window_noise(point: Point, fitted: Fitted, response: Response) -> WindowNoise | None:
    """Return what noise under the window of a response does to a fit; None without a window, and of samples, whose rows are divided by it.

    Parameters
    ----------
    point, fitted
        Of the response.
    response : Response
    """
    window, grid = window_over_lines(response), response.grid
    if window <= 0 or grid is None:
        return None
    problem, (q, p) = point.problem, point.data.shape[1:]
    noise = _of_rows(point.span, grid, window)
    back = inverse(normal(point, fitted)[0])
    scores = covariance_of_scores(point, fitted, noise)
    kept = fitted.kept.reshape(len(noise), -1)
    linear = float(np.vdot(kept, noise @ kept))
    fixed = float(np.trace(_of_rows(problem.terms, grid, window)))
    taken = q * p * fixed + q * linear + float(np.vdot(back, scores))
    return WindowNoise(np.asarray(back @ scores @ back), problem.data.size - taken)


def _of_rows(Q: RealArray, grid: RealArray, window: float) -> RealArray:
    """Return the covariance C of Q'(e_r, e_i)."""
    real, imag = np.split(Q, 2)
    Z = real + 1j * imag
    return np.asarray((Z.conj().T @ correlated(Z, grid, window)).real)


def correlated(columns: ComplexArray, grid: RealArray, window: float) -> ComplexArray:
    """Return T times columns (F, k).

    Parameters
    ----------
    columns : array of complex, (F, k)
    grid : array, (F,)
        Hz, evenly spaced but for gaps.
    window : float
        The rate a over the distance of lines.
    """
    place = np.rint((grid - grid[0]) / np.median(np.diff(grid))).astype(int)
    longest = int(place[-1])
    size = sfft.next_fast_len(2 * longest + 1)
    lags = 1 / (1 + 1j * np.pi * np.arange(longest + 1) / window)
    kernel, spread = np.zeros(size, dtype=complex), np.zeros((size, columns.shape[1]), dtype=complex)
    kernel[: longest + 1], kernel[size - longest :] = lags, lags[:0:-1].conj()
    spread[place] = columns
    together = sfft.ifft(sfft.fft(spread, axis=0) * sfft.fft(kernel)[:, None], axis=0)
    return np.asarray(together[place])
