"""The pole that stands out of a residual: a filter that is matched to a decaying oscillation, on a grid of frequencies and damping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.model.poles import poles_from
from modalscope.model.response import Response
from modalscope.model.window import line_step

__all__ = ["REACH", "Peak", "amplitudes", "amplitudes_by_channel", "apart", "grid_of", "strongest_peaks"]

#: Damping ratios of the grid: neighbours lose less than a tenth of the gain between them.
_RATIOS = (0.001, 0.003, 0.007, 0.015, 0.03, 0.06)

#: Peaks that are found together lie so many sums of their half bandwidths apart: nearer ones may be one.
_APART = 4.0

#: Poles whose lines are cut out together, lines so many half bandwidths to either side: beyond lie 2 % of the whole; so many at least.
_TOGETHER, REACH, _FEW = 32, 30.0, 8

#: Samples to this part of the first, far below rounding, tell nothing: rows are divided by no less than 1e-7 of each other.
_FADED = 1e-25

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
    new = ~np.any(np.abs(grid[:, None] - known) < -0.5 * known.real, axis=1)
    # no singular value exceeds the norm, which costs nothing
    may = np.flatnonzero(new & (np.sum(np.abs(A) ** 2, axis=(1, 2)) >= least))
    gain = np.zeros(grid.size)
    gain[may] = np.linalg.norm(A[may], ord=2, axis=(1, 2)) ** 2
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
    A = np.empty((poles.size, left[0].size), dtype=complex)
    flat = left.reshape(len(left), -1)
    for some, parts in _side_by_side(response, rows, poles, len(left)):
        size = np.sum([np.sum(g**2, axis=0) for g, _ in parts], axis=0).reshape(-1, 2).sum(axis=1) / 2
        A[some] = _sums(parts, flat) / np.sqrt(np.maximum(size, 1e-300))[:, None]
    return A.reshape(-1, *left.shape[1:])


def amplitudes_by_channel(
    response: Response, left: RealArray, weights: RealArray, rows: RealArray, poles: Array
) -> tuple[ComplexArray, RealArray]:
    """Return the residue of every pole beside nothing else by weighted least squares, and what it explains in each channel, (n, l, m) each.

    Parameters
    ----------
    response, left, rows
        As in `strongest_peaks`.
    weights : array, (F, l, m)
        One over the variance of every value that is left, of either part of a line.
    poles : array of complex, (n,)
    """
    shape, w = (poles.size, *left.shape[1:]), weights.reshape(len(weights), -1)
    A, sizes = np.empty((poles.size, w.shape[1]), dtype=complex), np.empty((poles.size, w.shape[1]))
    weighted = (weights * left.reshape(-1, *weights.shape)).reshape(len(left), -1)
    for some, parts in _side_by_side(response, rows, poles, len(left)):
        squares, (_, lines) = np.sum([g**2 for g, _ in parts], axis=0), parts[0]
        sizes[some] = np.sum((squares.T @ w[lines]).reshape(-1, 2, w.shape[1]), axis=1) / 2
        A[some] = _sums(parts, weighted)
    sizes = np.maximum(sizes, 1e-300)
    return (A / sizes).reshape(shape), (np.abs(A) ** 2 / sizes).reshape(shape)


def _side_by_side(
    response: Response, rows: RealArray, poles: Array, count: int
) -> Iterator[tuple[IntArray, list[tuple[RealArray, slice]]]]:
    """Yield which poles, neighbours of one damping together, with their divided functions on the rows that they show in, piece by piece."""
    order = np.argsort(-poles.real / np.abs(poles), kind="stable")
    few = min(_TOGETHER, max(1, _HELD // (2 * count)))
    for first in range(0, poles.size, few):
        some = order[first : first + few]
        lines = _near(response, poles[some], count)
        g = response.functions(poles[some], lines=lines)
        pieces = [lines] if response.grid is None else [lines, slice(lines.start + count // 2, lines.stop + count // 2)]
        each = np.split(g, len(pieces))
        yield some, [(part / rows[used, None], used) for part, used in zip(each, pieces, strict=True)]


def _sums(parts: list[tuple[RealArray, slice]], data: RealArray) -> ComplexArray:
    """Return <g1, E> + j <g2, E> of all poles, (n, c), from the pieces of their functions and data (K, c)."""
    sums = np.sum([g.T @ data[used] for g, used in parts], axis=0)
    return np.asarray(sums[::2] + 1j * sums[1::2])


def _near(response: Response, poles: Array, rows: int) -> slice:
    """Return the lines that poles show in: those far off a resonance tell nothing of it; the samples before all have faded."""
    lines, f, half = response.grid, np.abs(poles.imag) / (2 * np.pi), REACH * np.max(-poles.real) / (2 * np.pi)
    if lines is None:
        rate, slowest = response.sampling_rate, float(np.min(-poles.real))
        last = rows if rate is None or slowest <= 0 else np.log(_FADED) / -slowest * rate
        return slice(0, int(min(max(last, _FEW), rows)))
    half = max(half, _FEW * line_step(response))
    low, high = np.searchsorted(lines, [f.min() - half, f.max() + half])
    return slice(min(low, max(lines.size - _FEW, 0)), max(high, min(_FEW, lines.size)))


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
