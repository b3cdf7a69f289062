"""The pole that stands out of a residual: a filter that is matched to a decaying oscillation, on a grid of frequencies and damping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import poles_from
from modalscope.model.response import Response

__all__ = ["REACH", "Peak", "amplitudes", "amplitudes_by_channel", "apart", "grid_of", "strongest_peaks"]

#: Damping ratios of the grid: neighbours lose less than a tenth of the gain between them.
_RATIOS = (0.001, 0.003, 0.007, 0.015, 0.03, 0.06)

#: Peaks that are found together lie so many sums of their half bandwidths apart: nearer ones may be one.
_APART = 4.0

#: Poles whose lines are cut out together, lines so many half bandwidths to either side: beyond lie 2 % of the whole; so many at least.
_TOGETHER, REACH, _FEW = 32, 30.0, 8

#: Numbers held at a time.
_HELD = 1 << 23


@dataclass(frozen=True, eq=False, slots=True)
class Peak:
    """A pole that stands out.

    Parameters
    ----------
    pole : complex
        As it is in the data, rad/s.
    shape, participation : array of complex, (l,), (m,)
        Of length one, of the residual's largest singular value there.
    """

    pole: complex
    shape: ComplexArray
    participation: ComplexArray


def strongest_peaks(
    response: Response, left: RealArray, rows: RealArray, known: Array, least: float, most: int = 1
) -> list[Peak]:
    """Return where a residual holds the strongest oscillations: those that lower the squared misfit by `least`, far from each other.

    A pole's functions g1 and g2 are orthogonal but for their overlap with the mirror image; a residue of rank one lowers the misfit by
    the square of the largest singular value of its `amplitudes`.

    Parameters
    ----------
    response : Response
        One channel of the data.
    left : array, (K, l, m)
        Whitened residual, on rows divided by `rows`.
    rows : array, (K,)
    known : array of complex
        Poles that are there already: nothing is taken within half a half bandwidth of them.
    least : float
    most : int
        Peaks at most; half bandwidths of any two do not reach a quarter of the way.
    """
    grid = grid_of(response)
    A = amplitudes(response, left, rows, grid)
    gain = np.linalg.norm(A, ord=2, axis=(1, 2)) ** 2
    gain[np.any(np.abs(grid[:, None] - known) < -0.5 * known.real, axis=1)] = 0
    found: list[Peak] = []
    for best in apart(grid, gain, least, most):
        U, _, Vh = np.linalg.svd(A[best])
        found.append(Peak(complex(grid[best]), U[:, 0], Vh[0]))
    return found


def apart(grid: ComplexArray, gain: RealArray, least: float, most: int) -> list[int]:
    """Return where the largest gains are, far from each other, `most` of them while they reach `least`.

    Parameters
    ----------
    grid : array of complex, (n,)
    gain : array, (n,)
    least : float
    most : int
    """
    gain, found = gain.copy(), list[int]()
    while len(found) < most and gain.size and gain[best := int(np.argmax(gain))] >= max(least, 1e-300):
        found.append(best)
        gain[np.abs(grid - grid[best]) < _APART * np.abs(grid.real + grid[best].real)] = 0
    return found


def amplitudes(response: Response, left: RealArray, rows: RealArray, poles: Array) -> ComplexArray:
    """Return A = (<g1, E> + j <g2, E>) / |g| of every pole, (n, l, m): its residue beside nothing else, in deviations of a row.

    Parameters
    ----------
    response, left, rows
        As in `strongest_peaks`.
    poles : array of complex, (n,)
    """
    A = np.empty((poles.size, *left.shape[1:]), dtype=complex)
    order = np.argsort(-poles.real / np.abs(poles), kind="stable")  # neighbours of one damping side by side
    few = min(_TOGETHER, max(1, _HELD // (2 * len(left))))
    for first in range(0, poles.size, few):
        some = order[first : first + few]
        part, used = _near(response, poles[some], len(left))
        g = part.basis(poles[some], ()).functions / rows[used, None]
        size = np.sqrt(np.maximum(np.sum(g.reshape(len(g), -1, 2) ** 2, axis=(0, 2)) / 2, 1e-300))
        both = (g.T @ left[used].reshape(len(g), -1)).reshape(-1, 2, *left.shape[1:])
        A[some] = (both[:, 0] + 1j * both[:, 1]) / size[:, None, None]
    return A


def amplitudes_by_channel(
    response: Response, left: RealArray, weights: RealArray, rows: RealArray, poles: Array
) -> tuple[ComplexArray, RealArray]:
    """Return the residue of every pole beside nothing else by weighted least squares, and what it explains in each channel, (n, l, m) each.

    Parameters
    ----------
    response, left, rows
        As in `strongest_peaks`.
    weights : array, (K, l, m)
        One over the variance of every value that is left.
    poles : array of complex, (n,)
    """
    shape = (poles.size, *left.shape[1:])
    residues, explained = np.empty(shape, dtype=complex), np.empty(shape)
    order = np.argsort(-poles.real / np.abs(poles), kind="stable")
    for first in range(0, poles.size, _TOGETHER):
        some = order[first : first + _TOGETHER]
        part, used = _near(response, poles[some], len(left))
        g = part.basis(poles[some], ()).functions / rows[used, None]
        w = weights[used].reshape(len(g), -1)
        size = np.maximum(np.sum(((g**2).T @ w).reshape(-1, 2, w.shape[1]), axis=1) / 2, 1e-300)
        both = (g.T @ (w * left[used].reshape(len(g), -1))).reshape(-1, 2, w.shape[1])
        A = both[:, 0] + 1j * both[:, 1]
        residues[some], explained[some] = (
            (A / size).reshape(-1, *shape[1:]),
            (np.abs(A) ** 2 / size).reshape(-1, *shape[1:]),
        )
    return residues, explained


def _near(response: Response, poles: Array, rows: int) -> tuple[Response, Array]:
    """Return the part of a response that poles show in, and its rows: lines far off a resonance tell nothing of it."""
    lines, f, half = response.grid, np.abs(poles.imag) / (2 * np.pi), REACH * np.max(-poles.real) / (2 * np.pi)
    if lines is None or rows != 2 * lines.size:
        return response, np.arange(rows)
    half = max(half, _FEW * float(np.median(np.diff(lines)))) if lines.size > 1 else half
    low, high = np.searchsorted(lines, [f.min() - half, f.max() + half])
    low, high = min(low, max(lines.size - _FEW, 0)), max(high, min(_FEW, lines.size))
    part = response.in_band((float(lines[low]), float(lines[high - 1])))
    return part, np.concatenate([np.arange(low, high), lines.size + np.arange(low, high)])


def grid_of(response: Response) -> ComplexArray:
    """Return poles in the band of the data: every line, or every half bandwidth where lines lie closer than that."""
    low, high = response.span
    low = max(low, high / 1000)
    lines = response.grid if response.grid is not None else np.linspace(low, high, max(response.count // 2, 2))
    found = []
    for ratio in _RATIOS:
        even = low * (1 + ratio) ** np.arange(int(np.log(high / low) / np.log1p(ratio)) + 1)
        places = even if even.size < lines.size else lines[lines > 0]
        found.append(poles_from(places, np.full(places.size, ratio)))
    return np.concatenate(found)
