"""The pole that stands out of a residual: a filter that is matched to a decaying oscillation, on a grid of frequencies and damping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modalscope.model.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.model.line_filters import line_filters
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

#: Numbers held at a time, and numbers of a function of some poles: what lies in between stays in the cache.
_HELD, _AT_A_TIME = 1 << 23, 48_000


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
        The same for both parts of a line.
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
        Oscillations.
    """
    divided = (left / rows[:, None, None]).reshape(len(left), -1)
    quiet = _of_places(response, rows) ** -2.0
    A = np.empty((poles.size, divided.shape[1]), dtype=complex)
    for some, used, g, squares in _side_by_side(response, poles, len(left)):
        A[some] = _sums(g, used, divided) / np.sqrt(np.maximum(squares @ quiet[used], 1e-300))[:, None]
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
    weighted = (weights / rows.reshape(-1, len(weights), 1, 1) * left.reshape(-1, *weights.shape)).reshape(
        len(left), -1
    )
    w = w / _of_places(response, rows)[:, None] ** 2
    for some, used, g, squares in _side_by_side(response, poles, len(left)):
        sizes[some] = squares @ w[used]
        A[some] = _sums(g, used, weighted)
    sizes = np.maximum(sizes, 1e-300)
    return (A / sizes).reshape(shape), ((A.real**2 + A.imag**2) / sizes).reshape(shape)


def _of_places(response: Response, rows: RealArray) -> RealArray:
    """Return the deviations of samples, or of lines, whose real and imaginary parts have one."""
    return rows if response.grid is None else rows[: len(rows) // 2]


def _side_by_side(
    response: Response, poles: Array, count: int
) -> Iterator[tuple[IntArray, slice, RealArray, RealArray]]:
    """Yield some poles, the lines or samples that they show in, their functions there (n, 2, r, F) and half their squares (n, F).

    Neighbours of one damping share their lines; r are real and imaginary parts, or samples alone.
    """
    order = np.argsort(-poles.real / np.abs(poles), kind="stable")
    few = min(_TOGETHER, max(1, _HELD // (2 * count)))
    for near in (order[first : first + few] for first in range(0, poles.size, few)):
        used = _near(response, poles[near], count)
        step = max(_AT_A_TIME // (used.stop - used.start), 1)
        for some in (near[first : first + step] for first in range(0, near.size, step)):
            yield some, used, *_filters(response, poles[some], used)


def _filters(response: Response, poles: Array, used: slice) -> tuple[RealArray, RealArray]:
    """Return the functions g1 and g2 of poles on lines or samples, and half the sum of their squares at each; see `line_filters`."""
    if response.grid is not None:
        return line_filters(response.grid[used], response.sampling_rate, poles)
    g = response.functions(poles, lines=used).T.reshape(poles.size, 2, 1, -1)
    return g, np.einsum("njrf,njrf->nf", g, g) / 2


def _sums(g: RealArray, used: slice, data: RealArray) -> ComplexArray:
    """Return <g1, E> + j <g2, E> of all poles, (n, c), from their functions on some lines and data (K, c)."""
    n, _, parts, _ = g.shape
    each = data.reshape(parts, -1, data.shape[1])[:, used]
    sums = np.sum([g[:, :, r].reshape(2 * n, -1) @ each[r] for r in range(parts)], axis=0)
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
