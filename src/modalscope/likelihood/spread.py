"""Compute standard deviations of refined modes: from lines one by one, from parts in time, and from the scatter between groups."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modalscope.data.channels import Groups
from modalscope.data.response import Response
from modalscope.likelihood.covariance import (
    Parts,
    degrees_of_lines,
    degrees_of_wider,
    deviations_of_poles,
    gradients_of_poles,
    joined,
    lower_damping,
    of_parts,
    pole_blocks,
    sandwich,
    shape_deviations,
    variances_of_lines,
)
from modalscope.likelihood.descent import (
    influence_on_poles,
    information_of_channels,
    inverse,
    leverage,
    normal,
    on_rows,
    scores,
    scores_of_lines,
    window_noise,
)
from modalscope.likelihood.likelihood import Fitted, Point, across
from modalscope.likelihood.whitening import Colour
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray

#: Fewer groups say too little about how far they disagree.
LEAST_GROUPS = 4

#: Standard deviation of a frequency in half bandwidths above which the data leave a mode open.
_MAX_OPEN = 0.3

#: Minimum of one minus a leverage: rounding.
_MIN_FREE = 1e-6

#: Lines of the longest gap-filled axis relative to the number of lines: above it lines are taken as even.
_MAX_GAPS = 8


@dataclass(frozen=True, eq=False, slots=True)
class Spread:
    """Standard deviations of refined modes.

    `frequency`, `damping` (n,): from the noise: Hz, ratio. `degrees` (n, 2): of freedom of the wider of these and those between groups;
    0 where the data leave a mode open.
    `lower` (n,): see `ModalModel.damping_ratios_lower`. `shapes` (l, n): of the shapes as they were fitted. `frequency_between`,
    `damping_between` (n,): between groups.
    """

    frequency: RealArray
    damping: RealArray
    degrees: RealArray
    lower: RealArray
    shapes: RealArray
    frequency_between: RealArray | None
    damping_between: RealArray | None


def spread_of(
    point: Point, fitted: Fitted, poles: ComplexArray, variance: float, response: Response, groups: Groups, seen: Colour
) -> Spread:
    """Return the deviations at an optimum.

    Errors of records are independent from line to line, whatever their spectrum and their coherence: lines left out one at a time tell
    the covariance. White noise of responses has one variance a channel; where their residual is coloured, the widest of this, of lines
    and of what channels disagree by counts. Parts in time show what correlates lines.

    `poles` (n,): rad/s, as the modes are to have them. `variance`: of a row of the whitened noise. `response`: that was refined.
    `groups`: one label an input, or a run. `seen`: of the residual.
    """
    information = normal(point, fitted)[0]
    C, known = inverse(information), inverse(information, 0.0)
    asked = point.problem.records or seen.coloured
    rows = _rows(point, fitted, known, response) if asked else None
    between = _between(point, fitted, C, groups, rows)
    own = variance * np.diag(fitted.spread).reshape(-1, 2).sum(axis=1)
    candidates: list[_Candidate] = []
    if not point.problem.records:
        noise = window_noise(point, fitted, response)
        meat = information_of_channels(point, fitted, variance, alike=response.variance is not None)
        found = C @ meat @ C if noise is None else variance * noise.covariance
        candidates.append(_Candidate(found, np.full((2, len(poles)), float(point.problem.freedom)), own))
    if rows is not None:
        free, parts = rows.told(gradients_of_poles(poles), known)
        candidates.append(_Candidate(rows.covariance(known) + C - known, free, rows.own))
    if seen.coloured and not point.problem.records and between is None:
        each = [part for part in _by_channels(point, fitted) if len(part) >= LEAST_GROUPS]
        candidates += [_Candidate(sandwich(C, part), np.full((2, len(poles)), len(part) - 1.0), own) for part in each]
    variances = np.array([_of_poles(poles, each.covariance, point) ** 2 for each in candidates])
    widest = np.argmax(variances, axis=0)[None]
    degrees = np.take_along_axis(np.array([each.degrees for each in candidates]), widest, axis=0)[0]
    variances = np.take_along_axis(variances, widest, axis=0)[0]
    opened = np.sqrt(variances[0]) > _MAX_OPEN * np.abs(poles.real) / (2 * np.pi)
    lower = np.full(len(poles), np.nan)
    if rows is not None:
        lower = lower_damping(poles, variances[0], degrees[0], parts[0])
        both = [joined(*each) for each in zip(variances, degrees, parts, strict=True)]
        variances, degrees = (np.array(each) for each in zip(*both, strict=True))
    f, zeta = np.sqrt(variances)
    shapes = np.max([_of_shapes(point, fitted, each.covariance, each.own) for each in candidates], axis=0)
    if between is None or groups is None:
        return Spread(f, zeta, np.where(opened, 0, degrees).T, lower, shapes, None, None)
    apart = _of_poles(poles, between, point)
    degrees = degrees_of_wider(np.sqrt(variances), degrees, apart, len(set(groups)))
    return Spread(f, zeta, np.where(opened, 0, degrees).T, lower, shapes, *apart)


class _Candidate(NamedTuple):
    """A covariance of the unknowns, its degrees of freedom (2, n), and the variance of the side that follows, all else held."""

    covariance: RealArray
    degrees: RealArray
    own: RealArray


def _by_channels(point: Point, fitted: Fitted) -> list[RealArray]:
    """Return the scores of outputs, of inputs and of channels: where no groups are known, model error may lie in any of them."""
    each = scores(point, fitted)
    return [each.sum(axis=1), each.sum(axis=0), each.reshape(-1, each.shape[2])]


def _of_poles(poles: ComplexArray, covariance: RealArray, point: Point) -> RealArray:
    """Return the deviations of frequencies and of damping ratios, (2, n)."""
    n, p = point.sides.shape
    return np.array(deviations_of_poles(poles, pole_blocks(covariance, 2 * p * np.arange(n))))


def _between(
    point: Point, fitted: Fitted, information: RealArray, groups: Groups, rows: _Rows | None
) -> RealArray | None:
    """Sandwich over the groups of inputs, or of runs by their lines; None without at least four."""
    labels = np.unique(groups) if groups is not None else np.zeros(0)
    if labels.size < LEAST_GROUPS:
        return None
    member = np.asarray(groups)[None, :] == labels[:, None]
    if rows is None or point.problem.parts is None:
        return sandwich(information, member.astype(float) @ scores(point, fitted).sum(axis=0))
    return sandwich(information, member.astype(float) @ rows.by_run)


# ---------------------------------------------------------------------------------------------------------------- rows


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
        power = np.sum((self.kept @ fitted.back.T) ** 2, axis=0)
        each = np.einsum("fib,foi->ob", power, np.sum(self.residual(1) ** 2, axis=0), optimize=True) / 2
        return np.asarray(each.reshape(len(each), -1, 2).sum(axis=2))

    def seen(self, across: RealArray, power: float) -> RealArray:
        """Return what combinations (q, r) of the channels have of that residual, (2, r p, f)."""
        rows = (self.residual(power).swapaxes(2, 3) @ across).transpose(0, 3, 2, 1)
        return np.asarray(rows.reshape(2, -1, rows.shape[3]))


@dataclass(eq=False, slots=True)
class _Rows:
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
        steps = np.stack([g[:, None] @ inverse.reshape(n, -1, len(inverse))[:, :2] for g in gradients])
        steps = steps.reshape(2 * n, -1)
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


def _rows(point: Point, fitted: Fitted, inverse: RealArray, response: Response) -> _Rows:
    """Return what all lines tell, `inverse` of the information."""
    (q, n), p, width = fitted.linear.shape, point.data.shape[2], 2 * point.sides.size
    across, R = np.linalg.qr(np.hstack([fitted.linear.real, fitted.linear.imag]))
    in_time = response.grid is None
    count = len(point.problem.rows) // 2 + 1 if in_time else response.count
    run = np.zeros(count, int) if point.problem.parts is None else point.problem.parts[:count]
    rows = _Rows(
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


# -------------------------------------------------------------------------------------------------------------- shapes


def _of_shapes(point: Point, fitted: Fitted, covariance: RealArray, own: RealArray) -> RealArray:
    """Return the deviations of all shapes, (l, n); `own` (n,) or (q, n): variance of the side that follows, all else held."""
    shapes, _ = point.problem.scaled_back(point, fitted)
    turned = point.problem.turned
    scale = point.problem.varying if turned else point.problem.linear
    alone = np.zeros(shapes.shape) if turned else np.broadcast_to(own, shapes.shape)
    moved = _among_unknowns(point) if turned else _by_substitution(point, fitted)
    each = [
        shape_deviations(shapes[:, j], alone[:, j] * scale**2, scale[:, None] * A, covariance)
        for j, A in enumerate(moved)
    ]
    return np.stack(each, axis=1)


def _among_unknowns(point: Point) -> Iterator[ComplexArray]:
    """Yield db / d theta of every mode, (p, 2 n p): the shapes themselves are the unknown unit vectors."""
    n, p = point.sides.shape
    bases = across(point.sides)
    for j in range(n):
        A = np.zeros((p, n, p, 2), dtype=complex)
        A[:, j, 1:, 0], A[:, j, 1:, 1] = bases[j], 1j * bases[j]
        yield A.reshape(p, -1)


def _by_substitution(point: Point, fitted: Fitted) -> Iterator[ComplexArray]:
    """Yield dc / d theta of every mode, (q, 2 n p), with c the least-squares solution (but for the sign)."""
    X = fitted.back @ (fitted.kept.T @ point.directions())  # (2 n, n p)
    c = np.repeat(fitted.linear, point.sides.shape[1], axis=1)
    for j in range(len(point.poles)):
        by_real, by_imag = (c * (X[2 * j + k]) for k in (0, 1))
        A = np.stack([by_real.real + 1j * by_imag.real, -by_real.imag - 1j * by_imag.imag], axis=-1)
        yield A.reshape(len(c), -1)
