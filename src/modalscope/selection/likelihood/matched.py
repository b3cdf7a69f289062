"""Detect the strongest pole in a residual, by filters matched to decaying oscillations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.response import Response, line_step
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.driven_basis import DrivenLines
from modalscope.numerics.functions.poles import poles_from, to_discrete

# -------------------------------------------------------------------------------------------------------- line filters
# The functions of oscillations on lines together with their squares, for filters that are matched to thousands of poles.


def line_filters(frequencies: RealArray, rate: float | None, poles: Array) -> tuple[RealArray, RealArray]:
    """Return g1 and g2 of poles on lines, real parts before imaginary ones, (n, 2, 2, F), and (|g1|^2 + |g2|^2) / 2, (n, F).

    With h and p of a pole and its conjugate g1 = h + p and g2 = j (h - p), so that their squares are |h|^2 + |p|^2, which is on the way to
    them: h = (u - j v) / (u^2 + v^2), x - pole = u + j v.

    `frequencies` (F,): hz. `rate`: of a sampled system, Hz. `poles` (n,): rad/s, so few that all of this stays in the cache.
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


# ------------------------------------------------------------------------------------------------------------- matched

#: Damping ratios of the grid: a mode between two of them loses less than a tenth of its likelihood ratio.
_DAMPING_RATIOS = (0.001, 0.003, 0.007, 0.015, 0.03, 0.06)

#: Minimum distance of peaks found together, in sums of their half bandwidths: nearer ones may be one.
_MIN_PEAK_DISTANCE = 4.0

#: Poles whose lines are taken together; lines within this many half bandwidths, beyond which lie 2 % of the whole; minimum number of
#: lines.
_POLES_TOGETHER, REACH, _MIN_LINES = 32, 30.0, 8

#: Samples below this level relative to the first are ignored; rows are divided by levels of at least 1e-7 of each other.
_MIN_RELATIVE_SAMPLE = 1e-25

#: Maximum count of numbers stored at a time, and of a function of some poles, so that it stays in the cache.
_MAX_STORED_NUMBERS, _CACHE_NUMBERS = 1 << 23, 48_000

#: Numbers of channels that are weighted at a time.
_CHANNEL_NUMBERS = 1 << 19


@dataclass(frozen=True, eq=False, slots=True)
class Peak:
    """A pole detected in a residual.

    `pole`: as it is in the data, rad/s. `shape`, `participation` (l,): of length one, of the residual's largest singular value there.
    """

    pole: complex
    shape: ComplexArray
    participation: ComplexArray


def strongest_peaks(
    response: Response, left: RealArray, rows: RealArray, known: Array, least: float, most: int = 1
) -> list[Peak]:
    """Detect the strongest oscillations in a residual: those that lower the squared misfit by `least`, far from each other.

    A pole's functions g1 and g2 are orthogonal but for their overlap with the mirror image; a residue of rank one lowers the misfit by
    the square of the largest singular value of its `amplitudes`.

    `response`: one channel of the data. `left` (K, l, m): whitened residual, on rows divided by `rows`. `rows` (K,): the same for both
    parts of a line. `known`: poles that are there already: nothing is taken within half a half bandwidth of them. `most`: peaks at most;
    half bandwidths of any two do not reach a quarter of the way.
    """
    grid = grid_of(response)
    new = ~np.any(np.abs(grid[:, None] - known) < -0.5 * known.real, axis=1)
    gain = np.zeros(grid.size)
    for some, A in _amplitudes(response, left, rows, grid):
        A = A.reshape(-1, *left.shape[1:])
        # no singular value exceeds the norm, which costs nothing
        may = new[some] & (np.sum(A.real**2 + A.imag**2, axis=(1, 2)) >= least)
        gain[some[may]] = np.linalg.norm(A[may], ord=2, axis=(1, 2)) ** 2
    found: list[Peak] = []
    for k in apart(grid, gain, least, most):
        # once more, on the lines that tell of it: those of all strong poles are many times the data
        U, _, Vh = np.linalg.svd(amplitudes(response, left, rows, grid[[k]])[0], full_matrices=False)
        found.append(Peak(complex(grid[k]), U[:, 0], Vh[0]))
    return found


def apart(grid: ComplexArray, gain: RealArray, least: float, most: int) -> list[int]:
    """Return where the largest gains are, far from each other, `most` of them while they reach `least`.

    `grid` (n,). `gain` (n,).
    """
    gain, found = gain.copy(), list[int]()
    while len(found) < most and gain.size and gain[best := int(np.argmax(gain))] >= max(least, 1e-300):
        found.append(best)
        gain[near(grid, grid[best])] = 0
    return found


def near(grid: ComplexArray, poles: ComplexArray) -> Array:
    """Whether poles of a grid are so near others that both may be one peak."""
    return np.asarray(np.abs(grid - poles) < _MIN_PEAK_DISTANCE * np.abs(grid.real + poles.real))


def amplitudes(response: Response, left: RealArray, rows: RealArray, poles: Array) -> ComplexArray:
    """Return A = (<g1, E> + j <g2, E>) / |g| of every pole, (n, l, m): its residue in a fit of it alone, in deviations of a row.

    `response`, `left`, `rows`: as in `strongest_peaks`. `poles` (n,): oscillations.
    """
    A = np.empty((poles.size, left[0].size), dtype=complex)
    for some, own in _amplitudes(response, left, rows, poles):
        A[some] = own
    return A.reshape(-1, *left.shape[1:])


def _amplitudes(
    response: Response, left: RealArray, rows: RealArray, poles: Array
) -> Iterator[tuple[IntArray, ComplexArray]]:
    """Yield some poles after others, and their amplitudes in all channels, (poles, l m): those of a grid are many."""
    divided = (left / rows[:, None, None]).reshape(len(left), -1)
    # of lines real and imaginary parts have one deviation
    quiet = (rows if response.grid is None else rows[: len(rows) // 2]) ** -2.0
    for some, used, g, squares in _side_by_side(response, poles, len(left)):
        yield some, _sums(g, used, divided) / np.sqrt(np.maximum(squares @ quiet[used], 1e-300))[:, None]


def explained_by_channel(
    response: Response, left: RealArray, variance: RealArray, rows: RealArray, poles: Array
) -> RealArray:
    """Return what every pole explains alone, by weighted least squares with a residue in every channel, (n,).

    `response`, `left`, `rows`: as in `strongest_peaks`. `variance` (F, l, m): of every complex value that is left. `poles` (n,).
    """
    found = np.zeros(poles.size)
    for some, _, A, sizes in _by_channel(response, left, variance, rows, poles):
        found[some] += np.sum((A.real**2 + A.imag**2) / sizes, axis=1)
    return found


def residues_by_channel(
    response: Response, left: RealArray, variance: RealArray, rows: RealArray, pole: complex
) -> ComplexArray:
    """Return the residues of a pole in that fit, (l, m)."""
    found = np.empty(left[0].size, dtype=complex)
    for _, few, A, sizes in _by_channel(response, left, variance, rows, np.array([pole])):
        found[few] = A[0] / sizes[0]
    return found.reshape(left.shape[1:])


def _by_channel(
    response: Response, left: RealArray, variance: RealArray, rows: RealArray, poles: Array
) -> Iterator[tuple[IntArray, slice, ComplexArray, RealArray]]:
    """Yield some poles, some channels, and sums (poles, channels) of the poles' functions with what is left, and with themselves."""
    flat, whole = (each.reshape(len(each), -1) for each in (left, variance))
    parts, step = rows.reshape(-1, len(whole), 1), max(_CHANNEL_NUMBERS // len(left), 1)
    for few in (slice(first, first + step) for first in range(0, flat.shape[1], step)):
        weights = 2 / whole[:, few]
        weighted = (weights / parts * flat[:, few].reshape(len(parts), len(whole), -1)).reshape(len(left), -1)
        weights /= parts[0] ** 2
        for some, used, g, squares in _side_by_side(response, poles, len(left)):
            yield some, few, _sums(g, used, weighted), np.maximum(squares @ weights[used], 1e-300)


def _side_by_side(
    response: Response, poles: Array, count: int
) -> Iterator[tuple[IntArray, slice, RealArray, RealArray]]:
    """Yield some poles, the lines or samples that they show in, their functions there (n, 2, r, F) and half their squares (n, F).

    Neighbours of one damping share their lines; r are real and imaginary parts, or samples alone.
    """
    order = _by_damping(poles)
    few = min(_POLES_TOGETHER, max(1, _MAX_STORED_NUMBERS // (2 * count)))
    for near in (order[first : first + few] for first in range(0, poles.size, few)):
        used = _near(response, poles[near], count)
        step = max(_CACHE_NUMBERS // (used.stop - used.start), 1)
        for some in (near[first : first + step] for first in range(0, near.size, step)):
            yield some, used, *_filters(response, poles[some], used)


def _by_damping(poles: Array) -> IntArray:
    """Return the order of poles by damping, alike within a factor of two, then by frequency.

    Poles of a grid have one damping but for its rounding, which would mix neighbours with poles of any frequency: they would share all
    lines in place of those near them.
    """
    return np.lexsort((poles.imag, np.floor(np.log2(np.maximum(-poles.real / np.abs(poles), np.finfo(float).tiny)))))


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
    """Return the lines that poles show in, or the samples before all have faded."""
    if response.grid is not None:
        return _lines_near(response.grid, poles, _MIN_LINES, _MIN_LINES * line_step(response))
    rate, slowest = response.sampling_rate, float(np.min(-poles.real))
    last = rows if rate is None or slowest <= 0 else np.log(_MIN_RELATIVE_SAMPLE) / -slowest * rate
    return slice(0, int(min(max(last, _MIN_LINES), rows)))


def _lines_near(lines: RealArray, poles: Array, fewest: int, least: float = 0.0) -> slice:
    """Return the lines that poles show in: those far off a resonance tell nothing of it. `least`: how far they reach at least, Hz."""
    f, half = np.abs(poles.imag) / (2 * np.pi), max(REACH * np.max(-poles.real) / (2 * np.pi), least)
    low, high = np.searchsorted(lines, [f.min() - half, f.max() + half])
    return slice(max(min(low, lines.size - fewest), 0), max(high, low + fewest))


def grid_of(response: Response) -> ComplexArray:
    """Return poles in the band of the data: every line, or every half bandwidth where lines lie closer than that."""
    low, high = response.span
    low = max(low, high / 1000)
    lines = response.grid if response.grid is not None else np.linspace(low, high, max(response.count // 2, 2))
    found = []
    for ratio in _DAMPING_RATIOS:
        even = low * (1 + ratio) ** np.arange(int(np.log(high / low) / np.log1p(ratio)) + 1)
        places = even if even.size < lines.size else lines[lines > 0]
        found.append(poles_from(places, np.full(places.size, ratio)))
    return np.concatenate(found)


# ----------------------------------------------------------------------------------------------------- matched records
# The strongest pole in the residual of records: a matched filter under every input and the ends of every run.
#
# With a_i = d_i / (x - p) for every drive i and E the residual, H = a^H a = L L^H and g = a^H E: a mode of shape c under b lowers
# the squared misfit by the square of the largest singular value of L^-1 g, and b and c are its vectors.

#: Poles whose lines of records are taken together, minimum number of these lines, and numbers stored at a time.
_RECORD_POLES_TOGETHER, _MIN_RECORD_LINES, _MAX_RECORD_NUMBERS = 32, 16, 1 << 22

#: Drive directions below this fraction of the strongest on the lines of a pole are ignored.
_MIN_DRIVE_SHARE = 1e-6


class _Seen(NamedTuple):
    """Lines in the order of their frequencies: where, points, drives and residual, both divided by the deviation of the row."""

    frequencies: RealArray
    points: ComplexArray
    drives: ComplexArray
    left: ComplexArray


def strongest_driven(
    records: RecordSpectra, lines: DrivenLines, left: RealArray, rows: RealArray, known: Array, least: float
) -> list[Peak]:
    """Detect the strongest oscillation in the residual of records, if it lowers the squared misfit by `least`.

    `records`: one output: where the lines are. `lines`: the drives, each in its own size. `left` (2 F, l): whitened residual. `rows` (2
    F,): what rows were divided by. `known`: poles that are there already: nothing is taken within half a half bandwidth of them.
    """
    count, order = records.count, np.argsort(records.frequencies, kind="stable")
    seen = _Seen(
        records.frequencies[order],
        lines.points[order],
        lines.drives[order] / rows[:count][order, None],
        (left[:count] + 1j * left[count:])[order],
    )
    grid = grid_of(records)
    best, gain = 0j, 0.0
    for poles, (_, M) in _matched(records, seen, grid):
        found = np.linalg.norm(M, ord=2, axis=(1, 2)) ** 2
        found[np.any(np.abs(poles[:, None] - known) < -0.5 * known.real, axis=1)] = 0
        if found.max() > gain:
            best, gain = complex(poles[np.argmax(found)]), float(found.max())
    if gain < max(least, 1e-300):
        return []
    ((_, (back, M)),) = _matched(records, seen, np.array([best]))
    u, _, Vh = np.linalg.svd(M[0], full_matrices=False)
    b = back[0] @ u[:, 0]
    return [Peak(best, Vh[0], b / np.linalg.norm(b))]


def _matched(
    records: RecordSpectra, seen: _Seen, grid: ComplexArray
) -> Iterator[tuple[ComplexArray, tuple[ComplexArray, ComplexArray]]]:
    """Yield poles and their (B, B^H g), B B^H the inverse of H: (k, D, D) and (k, D, l)."""
    D, l = seen.drives.shape[1], seen.left.shape[1]
    order = _by_damping(grid)
    few = min(_RECORD_POLES_TOGETHER, max(1, _MAX_RECORD_NUMBERS // (len(seen.points) * max(D, 1))))
    for start in range(0, grid.size, few):
        poles = grid[order[start : start + few]]
        s = _lines_near(seen.frequencies, poles, _MIN_RECORD_LINES)
        d, E = seen.drives[s], seen.left[s]
        filters = 1 / (seen.points[s] - records.in_plane(poles)[:, None])  # (k, F)
        H = (np.abs(filters) ** 2 @ (d.conj()[:, :, None] * d[:, None, :]).reshape(len(d), -1)).reshape(-1, D, D)
        g = np.stack([(filters.conj() * drive.conj()) @ E for drive in d.T], axis=1).reshape(-1, D, l)
        weights, V = np.linalg.eigh(H)
        kept = weights > _MIN_DRIVE_SHARE * weights[:, -1:]
        B = V * np.where(kept, 1 / np.sqrt(np.where(kept, weights, 1)), 0)[:, None, :]
        yield poles, (B, B.conj().transpose(0, 2, 1) @ g)
