"""Compute standard deviations of refined modes: from lines one by one, from parts in time, and from the scatter between groups."""

from __future__ import annotations

from collections.abc import Iterator
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
    columns_on_rows,
    influence_on_poles,
    information_of_channels,
    inverse,
    leverage,
    normal,
    residual,
    scores,
    scores_of_lines,
    window_noise,
)
from modalscope.likelihood.likelihood import Fitted, Point, across
from modalscope.likelihood.whitening import Colour
from modalscope.numerics.checks import Array, ComplexArray, RealArray

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
        candidates.append(_Candidate(rows.covariance(known) + C - known, free, rows.own_of_shapes()))
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
    by_run = np.zeros((member.shape[1], len(information)))
    for lines, each in rows.scores(0):
        np.add.at(by_run, point.problem.parts[lines], each.real)
    return sandwich(information, member.astype(float) @ by_run)


# ---------------------------------------------------------------------------------------------------------------- rows


@dataclass(frozen=True, eq=False, slots=True)
class _Rows:
    """Lines of the data at an optimum, and what is left there; of samples their transform. Real and imaginary parts come first.

    `W` (2, F, p, 2 n p), `kept` (2, F, p, r): `columns_on_rows`, real and imaginary part of every unknown side by side. `left`
    (2, F, q, p): residual. `free` (F, q, p): one minus its leverage. `places`: of the lines of each run, from zero; of samples how many.
    """

    point: Point
    fitted: Fitted
    W: RealArray
    kept: RealArray
    left: RealArray
    free: RealArray
    places: tuple[tuple[slice, Array], ...] | int

    def _some(self, width: int) -> Iterator[slice]:
        """Yield some lines at a time, of so many numbers each."""
        step = max(_NUMBERS_AT_A_TIME // width, 1)
        return (slice(k, min(k + step, len(self.free))) for k in range(0, len(self.free), step))

    def of_lines(self, lines: slice, power: float) -> ComplexArray:
        """Return the residual of some lines over a power of one minus the leverage, (f, q, p)."""
        real, imag = self.left[:, lines] / self.free[lines] ** power
        return np.asarray(real + 1j * imag)

    def times(self, parts: RealArray) -> RealArray:
        """Return lines (2, F, ...) over time, (1, T, ...) of samples, and (2, T, ...) of all runs: their transform is complex."""
        if isinstance(self.places, int):
            return _samples_of(parts, self.places)[None]
        count = [int(place.max()) + 1 for _, place in self.places]
        ends, flat = np.cumsum([0, *count]), parts.reshape(*parts.shape[:2], -1)
        found = np.empty((2, ends[-1], flat.shape[2]))
        for (lines, place), first, last in zip(self.places, ends, ends[1:], strict=False):
            for column in range(flat.shape[2]):
                whole = np.zeros(last - first, complex)
                whole[place] = flat[0, lines, column] + 1j * flat[1, lines, column]
                whole = np.fft.ifft(whole, norm="ortho")
                found[0, first:last, column], found[1, first:last, column] = whole.real, whole.imag
        return found.reshape(2, -1, *parts.shape[2:])

    def scores(self, power: float) -> Iterator[tuple[slice, ComplexArray]]:
        """Yield some lines, and their scores of the residual over a power of one minus its leverage, (f, 2 n p)."""
        for lines in self._some(self.W[0, 0].size + self.left[0, 0].size):
            real, imag = self.W[:, lines]
            W = real + 1j * imag
            yield (
                lines,
                scores_of_lines((W[..., ::2], W[..., 1::2]), self.point, self.fitted, self.of_lines(lines, power)),
            )

    def covariance(self, inverse: RealArray) -> RealArray:
        """Return C (sum_f Re z z^H) C / 2, z the scores of a line that is left out: the covariance of the unknowns, (2 n p, 2 n p)."""
        total = np.zeros_like(inverse)
        for _, Z in self.scores(1):
            total += (Z.conj().T @ Z).real
        return np.asarray(inverse @ total @ inverse / 2)

    def own_of_shapes(self) -> RealArray:
        """Return the variance of the side that follows by least squares, poles and the other side held, from lines alike, (q, n)."""
        each = np.zeros((self.left.shape[2], self.kept.shape[3]))
        for lines in self._some(self.left[0, 0].size):
            power = np.sum((self.kept[:, lines] @ self.fitted.back.T) ** 2, axis=0)
            each += np.einsum("fib,foi->ob", power, np.abs(self.of_lines(lines, 1)) ** 2, optimize=True) / 2
        return np.asarray(each.reshape(len(each), -1, 2).sum(axis=2))

    def told(self, gradients: tuple[RealArray, RealArray], inverse: RealArray) -> tuple[RealArray, tuple[Parts, Parts]]:
        """Return degrees of freedom of lines (2, n), and what parts in time say, of frequencies and of damping ratios.

        `gradients`: of both by Re s and Im s of their pole, (n, 2) each. Influences lie in the span of the shapes, whose coordinates stand
        for the channels where these are more.
        """
        n = self.fitted.linear.shape[1]
        steps = np.stack([g[:, None] @ inverse.reshape(n, -1, len(inverse))[:, :2] for g in gradients]).reshape(
            2 * n, -1
        )
        across, R = np.linalg.qr(np.hstack([self.fitted.linear.real, self.fitted.linear.imag]))
        shapes = R[:, :n] + 1j * R[:, n:]
        w, half = np.empty((len(self.free), 2 * n)), self._seen(across, 0.5)
        e = half[0] + 1j * half[1]
        for lines in self._some(2 * n * e.shape[1]):
            real, imag = (_level(influence_on_poles(part, shapes, steps)) for part in self.W[:, lines])
            w[lines] = variances_of_lines(real + 1j * imag, e, lines.start)
        W, left = self.times(self.W), self.times(self._seen(across, 0))
        power, pull = np.zeros((2, 2 * n, W.shape[1]))
        step = max(_NUMBERS_AT_A_TIME // (2 * n * left.shape[2]), 1)
        for columns, found in zip(W, left, strict=True):
            for start in range(0, len(columns), step):
                s = slice(start, start + step)
                u = _level(influence_on_poles(columns[s], shapes, steps))
                power[:, s] += np.einsum("tbc,tbc->bt", u, u)
                pull[:, s] += (u @ found[s, :, None])[:, :, 0].T
        of_both = (of_parts(power[k], pull[k]) for k in (slice(n), slice(n, None)))
        return degrees_of_lines(w).reshape(2, n), (next(of_both), next(of_both))

    def _seen(self, across: RealArray, power: float) -> RealArray:
        """Return what combinations (q, r) of the channels are left of the residual over a power of one minus its leverage, (2, F, p r)."""
        found = np.empty((*self.left.shape[:2], self.left.shape[3] * across.shape[1]))
        for lines in self._some(self.left[0, 0].size):
            rows = self.left[:, lines] / self.free[lines] ** power
            found[:, lines] = (rows.swapaxes(2, 3) @ across).reshape(*rows.shape[:2], -1)
        return found


#: Numbers that are computed at a time: 8 MB.
_NUMBERS_AT_A_TIME = 1 << 20


def _level(u: RealArray) -> RealArray:
    """Return influence (K, b, p, q) with all channels side by side."""
    return u.reshape(*u.shape[:2], -1)


def _rows(point: Point, fitted: Fitted, inverse: RealArray, response: Response) -> _Rows:
    W, kept = columns_on_rows(point, fitted)
    count = 0 if response.grid is None else response.count
    h, left = leverage(point, fitted, W, kept, inverse, 2 if count else 1), residual(point, fitted)
    free = np.maximum(1 - (h if count else h.mean(axis=0)), _MIN_FREE)
    rows = (W.view(np.float64), kept, left)
    if not count:
        lines = [_lines_of(each) for each in rows]
        free = np.broadcast_to(free, (lines[0].shape[1], *free.shape))
        return _Rows(point, fitted, lines[0], lines[1], lines[2], free, len(W))
    runs = point.problem.parts
    run = np.zeros(count, int) if runs is None else runs[:count]
    ends = np.flatnonzero(np.diff(run, prepend=-1, append=-1))
    frequencies = getattr(response, "frequencies", np.zeros(0))
    places = tuple((slice(a, b), _places(frequencies[a:b])) for a, b in pairwise(ends))
    lines = [each.reshape(2, count, *each.shape[1:]) for each in rows]
    return _Rows(point, fitted, lines[0], lines[1], lines[2], free, places)


def _lines_of(samples: RealArray) -> RealArray:
    """Return real and imaginary parts of the lines of samples (K, ...), (2, F, ...), that have the same power."""
    found = np.sqrt(2) * np.fft.rfft(samples, axis=0, norm="ortho")
    found[_alone(len(samples))] /= np.sqrt(2)
    return np.stack([found.real, found.imag])


def _samples_of(lines: RealArray, count: int) -> RealArray:
    """Return the samples of such lines."""
    found = (lines[0] + 1j * lines[1]) / np.sqrt(2)
    found[_alone(count)] *= np.sqrt(2)
    return np.asarray(np.fft.irfft(found, count, axis=0, norm="ortho"))


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
