"""Gather what lines of the data and parts in time tell of refined modes: covariance, degrees of freedom, variance of shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.selection.likelihood.covariance import (
    LEAST_GROUPS,
    Parts,
    degrees_of_lines,
    of_parts,
    steps_of_poles,
    variances_of_lines,
)
from modalscope.selection.likelihood.information import influence_on_poles, leverage, on_rows, scores_of_lines
from modalscope.selection.likelihood.likelihood import Fitted, Point

#: Minimum of one minus a leverage: rounding.
_MIN_FREE = 1e-6

#: Lines of the longest gap-filled axis relative to the number of lines: above it lines are taken as even.
_MAX_GAPS = 8


class _Lines(NamedTuple):
    """Some lines of the data at an optimum, real and imaginary parts first; of samples lines of their transform.

    `which`: of all lines. `W` (2, f, p, 2 n p), `kept` (2, f, p, r): columns of `OnRows`, real and imaginary part of every unknown side by
    side. `left` (2, f, q, p): residual. `free` (f, q, p): one minus its leverage.
    """

    which: IntArray
    W: RealArray
    kept: RealArray
    left: RealArray
    free: RealArray

    def residual(self, power: float) -> RealArray:
        """Return the residual over a power of one minus its leverage, (2, f, q, p)."""
        return np.asarray(self.left / self.free**power)

    def scores(self, point: Point, fitted: Fitted, power: float) -> ComplexArray:
        """Return the scores of that residual, (f, 2 n p)."""
        W, e = _joined(self.W), _joined(self.residual(power))
        return scores_of_lines((W[..., ::2], W[..., 1::2]), point, fitted, e)

    def own_of_shapes(self, fitted: Fitted) -> RealArray:
        """Return what the lines add to the variance of the side that follows, poles and the other side held, (q, n)."""
        power = np.sum((self.kept @ fitted.only.back.T) ** 2, axis=0)
        each = np.einsum("fib,foi->ob", power, np.sum(self.residual(1) ** 2, axis=0), optimize=True) / 2
        return np.asarray(each.reshape(len(each), -1, 2).sum(axis=2))

    def seen(self, across: RealArray, power: float) -> RealArray:
        """Return what combinations (q, r) of the channels have of that residual, (2, r p, f)."""
        rows = (self.residual(power).swapaxes(2, 3) @ across).transpose(0, 3, 2, 1)
        return np.asarray(rows.reshape(2, -1, rows.shape[3]))


@dataclass(eq=False, slots=True)
class ToldByLines:
    """What all lines tell at an optimum, gathered some at a time: of long records all lines of all channels are large.

    Influences lie in the span of the shapes, whose coordinates stand for the channels where these are more.

    `shapes` (r, n): in these coordinates. `total` (2 n p, 2 n p): sum_f Re z z^H, z the scores of a line that is left out. `by_run` (R, 2 n
    p): scores of every run. `own` (q, n): variance of the side that follows by least squares, from lines alike. `W`: of every mode (2, a,
    p, F), its columns, each in one piece. `left` (2, r p, F): residual. `half` (F, r p): over the square root of one minus its leverage,
    complex. `places`: of the lines of each run, from zero; of samples how many.
    """

    shapes: ComplexArray
    total: RealArray
    by_run: RealArray
    own: RealArray
    W: list[RealArray]
    left: RealArray
    half: ComplexArray
    places: tuple[tuple[slice, Array], ...] | int

    def times(self, parts: RealArray) -> RealArray:
        """Return lines (2, ..., F) over time, (1, ..., T) of samples, and (2, ..., T) of all runs: their transform is complex."""
        if isinstance(self.places, int):
            return _samples_of(parts, self.places)[None]
        count = [int(place.max()) + 1 for _, place in self.places]
        ends, flat = np.cumsum([0, *count]), parts.reshape(2, -1, parts.shape[-1])
        found = np.empty((2, flat.shape[1], ends[-1]))
        for (lines, place), first, last in zip(self.places, ends, ends[1:], strict=False):
            whole = np.zeros((flat.shape[1], last - first), complex)
            whole[:, place] = _joined(flat[:, :, lines])
            whole = np.fft.ifft(whole, norm="ortho")
            found[0, :, first:last], found[1, :, first:last] = whole.real, whole.imag
        return found.reshape(*parts.shape[:-1], -1)

    def covariance(self, inverse: RealArray) -> RealArray:
        """Return C (sum_f Re z z^H) C / 2: the covariance of the unknowns, (2 n p, 2 n p)."""
        return np.asarray(inverse @ self.total @ inverse / 2)

    def told(self, gradients: tuple[RealArray, RealArray], inverse: RealArray) -> tuple[RealArray, tuple[Parts, Parts]]:
        """Return degrees of freedom of lines (2, n), and what parts in time say, of frequencies and of damping ratios.

        Columns are taken over time in their own place: they are large, and nothing else asks for them.

        `gradients`: of both by Re s and Im s of their pole, (n, 2) each.
        """
        n = self.shapes.shape[1]
        steps = np.concatenate([steps_of_poles(g, inverse) for g in gradients])
        degrees = degrees_of_lines(self._by_line(steps)).reshape(2, n)
        self.W, self.left = [self.times(self.W.pop(0)) for _ in range(n)], self.times(self.left)
        power, pull = np.zeros((2, 2 * n, self.left.shape[2]))
        for k, found in enumerate(self.left):
            for s in _some(found.shape[1], len(steps) * len(found)):
                u = self._influence(k, s, steps)
                power[:, s] += np.einsum("bct,bct->bt", u, u)
                pull[:, s] += np.einsum("bct,ct->bt", u, found[:, s])
        of_both = (of_parts(power[k], pull[k]) for k in (slice(n), slice(n, None)))
        return degrees, (next(of_both), next(of_both))

    def _by_line(self, steps: RealArray) -> RealArray:
        """Return what each line adds to the variances of numbers, (F, b)."""
        w = np.empty((len(self.half), len(steps)))
        for s in _some(len(w), len(steps) * self.half.shape[1]):
            u = _joined([self._influence(k, s, steps) for k in (0, 1)])
            w[s] = variances_of_lines(np.ascontiguousarray(u.transpose(2, 0, 1)), self.half, s.start)
        return w

    def _influence(self, part: int, some: slice, steps: RealArray) -> RealArray:
        """Return the influence of one part of some lines, or of samples, on numbers, all channels side by side, (b, r p, k)."""
        u = influence_on_poles([own[part, :, :, some] for own in self.W], self.shapes, steps)
        return u.reshape(len(u), -1, u.shape[3])


#: Numbers that are computed at a time: 8 MB.
_NUMBERS_AT_A_TIME = 1 << 20


def _some(count: int, width: int) -> Iterator[slice]:
    """Yield parts of so many lines, each of `width` numbers."""
    step = max(_NUMBERS_AT_A_TIME // width, 1)
    return (slice(k, min(k + step, count)) for k in range(0, count, step))


def _joined(parts: RealArray | Sequence[RealArray]) -> ComplexArray:
    real, imag = parts
    return np.asarray(real + 1j * imag)


def told_by_lines(point: Point, fitted: Fitted, inverse: RealArray, response: Response) -> ToldByLines:
    """Return what all lines tell, `inverse` of the information."""
    (q, n), p, width = fitted.linear.shape, point.data.shape[2], 2 * point.sides.size
    across, R = np.linalg.qr(np.hstack([fitted.linear.real, fitted.linear.imag]))
    in_time = response.grid is None
    count = len(point.problem.rows) // 2 + 1 if in_time else response.count
    run = np.zeros(count, int) if point.problem.parts is None else point.problem.parts[:count]
    rows = ToldByLines(
        shapes=R[:, :n] + 1j * R[:, n:],
        total=np.zeros((width, width)),
        by_run=np.zeros((int(run.max()) + 1, width)),
        own=np.zeros((q, n)),
        W=[np.empty((2, width // n, p, count)) for _ in range(n)],
        left=np.empty((2, p * across.shape[1], count)),
        half=np.empty((count, p * across.shape[1]), dtype=complex),
        places=len(point.problem.rows) if in_time else _places_of(run, getattr(response, "frequencies", np.zeros(0))),
    )
    for lines in _lines(point, fitted, inverse, in_time):
        z, which = lines.scores(point, fitted, 1), lines.which
        rows.total += (z.conj().T @ z).real
        rows.own += lines.own_of_shapes(fitted)
        if len(rows.by_run) >= LEAST_GROUPS:
            np.add.at(rows.by_run, run[which], lines.scores(point, fitted, 0).real)
        for own, columns in zip(rows.W, np.split(lines.W, n, axis=3), strict=True):
            own[..., which] = columns.transpose(0, 3, 2, 1)
        rows.left[..., which], rows.half[which] = lines.seen(across, 0), _joined(lines.seen(across, 0.5)).T
    return rows


def _lines(point: Point, fitted: Fitted, inverse: RealArray, in_time: bool) -> Iterator[_Lines]:
    """Yield all lines, some at a time; of samples one number stands for the leverage of all: a line has a part of each."""
    for rows, W, kept, left in on_rows(point, fitted, together=in_time):
        h = leverage(point.problem.terms[rows], fitted.linear, W, kept, inverse, 1 if in_time else 2)
        arrays = (W.view(np.float64), kept, left)
        if in_time:
            lines = [_lines_of(each) for each in arrays]
            free = np.broadcast_to(np.maximum(1 - h.mean(axis=0), _MIN_FREE), (lines[0].shape[1], *h.shape[1:]))
            which = np.arange(len(free))
        else:
            lines = [each.reshape(2, len(h), *each.shape[1:]) for each in arrays]
            free, which = np.maximum(1 - h, _MIN_FREE), np.arange(len(point.problem.rows))[rows][: len(h)]
        for s in _some(len(free), W[0].size * 2 + left[0].size):
            columns, of_modes, residual = (each[:, s] for each in lines)
            yield _Lines(which[s], columns, of_modes, residual, free[s])


def _places_of(run: IntArray, frequencies: RealArray) -> tuple[tuple[slice, Array], ...]:
    """Return the lines of every run, and where they stand."""
    ends = np.flatnonzero(np.diff(run, prepend=-1, append=-1))
    return tuple((slice(a, b), _places(frequencies[a:b])) for a, b in pairwise(ends))


def _lines_of(samples: RealArray) -> RealArray:
    """Return real and imaginary parts of the lines of samples (K, ...), (2, F, ...), that have the same power."""
    found = np.sqrt(2) * np.fft.rfft(samples, axis=0, norm="ortho")
    found[_alone(len(samples))] /= np.sqrt(2)
    return np.stack([found.real, found.imag])


def _samples_of(lines: RealArray, count: int) -> RealArray:
    """Return the samples of such lines, (2, ..., F) -> (..., count)."""
    found = (lines[0] + 1j * lines[1]) / np.sqrt(2)
    found[..., _alone(count)] *= np.sqrt(2)
    return np.asarray(np.fft.irfft(found, count, norm="ortho"))


def _alone(count: int) -> list[int]:
    """Return the lines that have no imaginary part: 0 Hz and half the rate."""
    return [0, -1] if count % 2 == 0 else [0]


def _places(f: RealArray) -> Array:
    """Return where lines of one run stand, counted in their distance from the first; one after the other where they are uneven."""
    step = float(np.min(np.diff(f), initial=np.inf))
    place = np.rint((f - f[0]) / step).astype(int)
    return np.arange(f.size) if place[-1] > _MAX_GAPS * f.size else place
