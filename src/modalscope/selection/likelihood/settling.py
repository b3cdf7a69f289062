"""Iterate poles and channel noise to convergence, with out-of-band poles where they whiten the residual."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import singledispatch
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.record_residual import excess, excess_notes
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.response import Response, line_step, output_scale, window_over_lines
from modalscope.data.whitening import levels_of_channels
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.orthonormal import triangle_of
from modalscope.numerics.statistics import telling
from modalscope.selection.likelihood.descent import Descent, descend_from
from modalscope.selection.likelihood.driven import whitened_records
from modalscope.selection.likelihood.information import residual, residuals, window_noise
from modalscope.selection.likelihood.likelihood import Whitened, unit_vectors, whitened
from modalscope.selection.likelihood.line_levels import rows_of_lines, told_rows
from modalscope.selection.likelihood.whitening import (
    Colour,
    Levels,
    chi_squared_bound,
    colour_of_lines,
    from_variance,
    gain_factor_under_window,
    levels_of,
    residual_spectrum,
    row_deviations,
    search_bound,
)

# -------------------------------------------------------------------------------------------------------------- out-of-band poles
# The response of modes outside a band, approximated by fixed out-of-band poles.
#
# It is smooth in the band, less so the nearer its poles lie. With d the distance from an end, it is approximated by n fixed poles at
# distances d, d / 2, d / 4, ... to an error that falls with exp(-c sqrt(n)); their residues follow by least squares.
#
# Source: A. Gopal and L. N. Trefethen, SIAM J. Numer. Anal. 57, 2019.

#: Ratio of the distances of successive out-of-band poles to their end of the band, and distance of the nearest in lines: nearer ones
#: would be modes.
_DISTANCE_RATIO, MIN_DISTANCE_LINES = 2.0, 8.0


def out_of_band_poles(response: Response, ends: tuple[float, float] | None = None) -> ComplexArray:
    """Return poles on either side of a band (n,) in rad/s, at 45 degrees off each end; none of few lines, and of samples without ends.

    `ends`: Hz; by default those of the lines.
    """
    if response.grid is None and ends is not None:
        step = 1 / (response.count / (response.sampling_rate or 1.0))
    elif response.grid is None or len(response.grid) < 2 * MIN_DISTANCE_LINES:
        return np.zeros(0, dtype=complex)
    else:
        step = line_step(response)
    low, high = 2 * np.pi * np.array(response.span if ends is None else ends)
    farthest, nearest = high - low, 2 * np.pi * MIN_DISTANCE_LINES * step
    count = max(int(np.log(farthest / nearest) / np.log(_DISTANCE_RATIO)) + 1, 0)
    away = farthest / _DISTANCE_RATIO ** np.arange(count) / np.sqrt(2)
    below, above = 1j * low - (1 + 1j) * away, 1j * high - (1 - 1j) * away
    top = np.inf if response.sampling_rate is None else np.pi * response.sampling_rate
    poles = np.concatenate([below[below.imag > 0], above[above.imag < top]]) + response.added_damping
    return np.asarray(poles, dtype=complex)


# -------------------------------------------------------------------------------------------------------------- beside
# Significant poles that are no modes take part in the fit, so that the modes need not compensate for them.

#: A pole within this many decay rates of a mode may be part of it.
_SEPARATION_DECAY_RATES = 3.0

#: Chance of any false pole in a data set of noise.
_CHANCE_OF_ANY = 1e-3

#: Numbers of data that are taken at a time.
_NUMBERS_AT_A_TIME = 1 << 22


def needed_beside(response: Response, modes: Array, candidates: Array) -> ComplexArray:
    """Return the candidates that are significant given the modes, all residues free.

    The weakest goes first, and the others are judged again. A pole with free residues in l m channels explains of white noise a
    chi-squared number of k = 2 l m degrees (in records 2 l (m + R), R the ends of runs); what is kept exceeds k + 2 sqrt(k t) + 2 t,
    t = ln(positions / 1e-3), in variances of what all poles together leave.

    `modes` (n,): rad/s. `candidates` (k,): rad/s; those that grow, and those near a mode, are left out.
    """
    added = response.added_damping
    far = np.abs(candidates[:, None] - modes) > _SEPARATION_DECAY_RATES * np.abs(modes.real)
    poles = candidates[(candidates.real < added) & far.all(axis=1)]
    taken = _projected(response, np.concatenate([modes, poles]) - added)
    R, Z, width, channels = taken.R, taken.data, taken.width, taken.data.shape[1]
    free = (taken.rows - R.shape[1]) * channels
    if not poles.size or free < channels:
        return np.zeros(0, dtype=complex)
    variance = taken.left / free
    least = variance * chi_squared_bound(width * channels, np.log(taken.rows / 2 / _CHANCE_OF_ANY))
    before = R.shape[1] - width * len(poles)
    kept = np.arange(poles.size)
    while kept.size:
        gains = _gains(np.hstack([R[:, :before], _of_poles(R[:, before:], kept, width)]), Z, width)[-kept.size :]
        weakest = int(np.argmin(gains))
        if gains[weakest] >= least:
            break
        kept = np.delete(kept, weakest)
    return np.asarray(poles[kept])


class _Projected(NamedTuple):
    """Data of one level in the span of terms and poles: columns of length one Q R, Q'Y (columns, l m), and the squares left of `rows` rows.

    `width`: columns of a pole, which stand behind the terms, pole by pole.
    """

    R: RealArray
    data: RealArray
    left: float
    rows: int
    width: int


@singledispatch
def _projected(response: Response, poles: Array) -> _Projected:
    """Return the data in the span of poles with free residues, as they are in the data, and terms."""
    basis = response.whole_basis(poles, response.refined_powers)
    columns = _unit(_columns_of(basis))
    Q, R = (np.asarray(each, float) for each in sla.qr(columns, mode="economic", check_finite=False))
    Z, left, outputs = np.empty((R.shape[0], *basis.data.shape[1:])), 0.0, basis.data.shape[1]
    level = np.outer(*levels_of_channels(basis.data))
    step = max(_NUMBERS_AT_A_TIME // basis.data[:, 0].size, 1)
    for few in (slice(k, k + step) for k in range(0, outputs, step)):
        flat = (basis.data[:, few] / level[few]).reshape(len(columns), -1)
        own = Q.T @ flat
        flat -= Q @ own
        left, Z[:, few] = left + float(np.vdot(flat, flat)), own.reshape(Z[:, few].shape)
    return _Projected(R, Z.reshape(len(Z), -1), left, len(columns), basis.by_pole.shape[2])


@_projected.register
def _(response: RecordSpectra, poles: Array) -> _Projected:
    """Return the same from products of some lines at a time."""
    level, width = output_scale(response), 2 * response.drives

    def chunks() -> Iterator[RealArray]:
        for basis in response.pieces(poles, response.refined_powers):
            yield np.hstack([_columns_of(basis), basis.data[:, :, 0] / level])

    columns = next(chunks()).shape[1] - len(level)
    R = triangle_of(chunks, columns + len(level))
    left = float(np.sum(R[columns:, columns:] ** 2))
    return _Projected(_unit(R[:columns, :columns]), R[:columns, columns:], left, 2 * response.count, width)


def _columns_of(basis: ModalBasis) -> RealArray:
    return np.hstack([basis.terms, basis.by_pole.reshape(len(basis.terms), -1)])


def _unit(columns: RealArray) -> RealArray:
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))


def _of_poles(columns: RealArray, which: Array, width: int) -> RealArray:
    return columns.reshape(len(columns), -1, width)[:, which].reshape(len(columns), -1)


def _gains(columns: RealArray, data: RealArray, width: int) -> RealArray:
    """Return the rise of the squared misfit without each set of `width` columns; those left over stand first, for themselves."""
    odd = columns.shape[1] % width
    U, d, Vt = sla.svd(columns, full_matrices=False, check_finite=False)
    rank = int(np.count_nonzero(d > 1e-11 * d[0]))
    back = Vt[:rank].T / d[:rank]
    c = (back @ (U[:, :rank].T @ data))[odd:].reshape(-1, width, data.shape[1])
    sets = back[odd:].reshape(-1, width, rank)
    own = np.linalg.pinv(sets @ sets.transpose(0, 2, 1), hermitian=True)
    return np.asarray(np.sum(c * (own @ c), axis=(1, 2)))


# ------------------------------------------------------------------------------------------------------------ settling

#: Maximum number of rounds, and the relative change of any noise level at which they end.
_MAX_ROUNDS, _LEVEL_TOLERANCE = 30, 1e-7


#: Rounds in which lines are weighted by the level of what is left of them.
_WEIGHTED_ROUNDS = 2

#: Number of powers added to the terms at a time.
_FURTHER_POWERS = 3


@dataclass(frozen=True, eq=False, slots=True)
class Task:
    """Data, and what is fixed while modes are refined.

    `fixed`: poles, as they are in the data, that are held and free in every channel. `powers`: residual terms. `rows` (K,): standard
    deviations of the rows, relative to each other. `known`: of the channels, where they are known.
    `even` (l, m): what brings the data of all channels to one size. `products`: whether levels are an output's times an input's.
    """

    response: Response
    fixed: ComplexArray
    powers: tuple[int, ...]
    rows: RealArray
    known: Levels | None
    even: RealArray
    progress: Callable[[int, int], None] | None = None
    products: bool = False

    @property
    def channels(self) -> tuple[int, int]:
        """Numbers of a shape and of what drives a pole."""
        return int(self.response.values.shape[1]), self.response.drives


def task_of(
    response: Response, fixed: ComplexArray, weights: Array | None, progress: Callable[[int, int], None] | None
) -> Task:
    """Return the task of a response: noise from its variance where it carries one and no weights are given, else as data tell it.

    `weights` (lines or samples,).
    """
    powers = response.refined_powers
    rows = response.count * (1 + bool(np.iscomplexobj(response.values)))
    variance, even = response.variance, np.outer(*levels_of_channels(response.values))
    if weights is None and variance is not None:
        by_row, known = from_variance(variance, rows, scattered=response.averages is not None)
        return Task(response, fixed, powers, by_row, known, even, progress)
    told = told_rows(response) if weights is None else None
    by_row = row_deviations(rows, weights) if told is None else told
    return Task(response, fixed, powers, by_row, None, even, progress)


@dataclass(frozen=True, eq=False, slots=True)
class Settled:
    """The optimum, and the noise that goes with it.

    `variance`: of a row of the whitened data. `unknown`: unknowns per channel. `colour`: of the residual. `worth` (n,): what a gain in
    variances counts beside one in white noise; see `gain_factor_under_window`. `levels`: of the channels' noise. `powers`: of the terms.
    `levelled`: whether lines were divided by levels of their own.
    """

    descent: Descent
    variance: float
    unknown: int
    colour: Colour
    worth: RealArray
    levels: Levels
    powers: tuple[int, ...]
    levelled: bool = False

    @property
    def gain(self) -> RealArray:
        """Rise of the squared misfit without each mode, in variances, (n,)."""
        return self.descent.fitted.gain / self.variance * self.worth

    @property
    def residues(self) -> tuple[ComplexArray, ComplexArray]:
        """Shapes (l, n) and participation (n, m)."""
        return self.descent.point.problem.scaled_back(self.descent.point, self.descent.fitted)


class _Start(NamedTuple):
    """Where a round begins: modes, the side with fewer channels as it is and the other to follow, and the noise of the channels."""

    poles: ComplexArray
    shapes: ComplexArray
    participation: ComplexArray
    levels: Levels


def settle(
    task: Task,
    poles: ComplexArray,
    shapes: ComplexArray,
    participation: ComplexArray,
    most: int = 60,
    home: ComplexArray | None = None,
) -> Settled:
    """Return the optimum from modes on.

    The first descent divides the channels by their own size. What it leaves tells the noise of each channel where it is white, and
    further descents and levels settle together. Where it is coloured it is model error, and no second descent: channels that happen
    to fit well would draw all weight to themselves. For the same reason levels of single channels hold in white noise alone. Terms get
    further powers as long as these explain more than noise. Lines that are left more in some places than in others are divided by levels
    of their own; where what remains is still no white noise, only gains are.

    `poles` (n,): as they are in the data. `shapes`, `participation` (l, n): the side with fewer channels is where the descent starts; the
    other follows. `most`: iterations of a descent. `home` (n,): where the poles belong.

    Raises `DataError`: no more data than unknowns; `Astray`: a pole left its home.
    """
    levels = task.known or levels_of(np.sqrt(np.mean(np.abs(task.response.values) ** 2, axis=0)), task.even)
    alike = replace(task, products=True), _Start(poles, shapes, participation, levels.product), most, home
    if window_over_lines(task.response) > 0:
        return _settled(*alike)
    settled = _settled(task, _Start(poles, shapes, participation, levels), most, home)
    own = settled.levels.own is not None
    return _settled(*alike) if own and (settled.levelled or settled.colour.coloured) else settled


def _settled(task: Task, start: _Start, most: int, home: ComplexArray | None) -> Settled:
    """Return the optimum with the terms and the levels of lines that the data need."""
    settled = _optimum(task, start, most, home)
    while len(powers := _needed_powers(task, settled)) > len(task.powers):
        task = replace(task, powers=powers)
        settled = _optimum(task, _Start(settled.descent.point.poles, *settled.residues, settled.levels), most, home)
    even = settled
    for _ in range(_WEIGHTED_ROUNDS if most and _uneven(task.response, task, settled) else 0):
        task = replace(task, rows=levels_of_lines(task.response, task, settled))
        settled = _optimum(task, _Start(settled.descent.point.poles, *settled.residues, settled.levels), most, home)
    if settled is even or settled.descent.point.problem.records:
        return settled
    return _of_correlated(task, even) if settled.colour.coloured else replace(settled, levelled=True)


def _of_correlated(task: Task, even: Settled) -> Settled:
    """Return the fit without levels, gains counted in them: beside lines of their own levels, errors are correlated.

    Shifts leave errors near the poles that no level describes, and a descent in levels would rest on what lies between.
    """
    rows = levels_of_lines(task.response, task, even)
    start = _Start(even.descent.point.poles, *even.residues, even.levels)
    counted = _optimum(replace(task, rows=rows), start, 0)
    return replace(even, worth=counted.gain * even.variance / np.maximum(even.descent.fitted.gain, 1e-300))


@singledispatch
def _uneven(response: Response, task: Task, settled: Settled) -> bool:
    """Whether lines are left more in some places than in others, and nothing given tells by how much; not of samples."""
    given = task.known is not None or np.ptp(task.rows) > 0
    if given or response.grid is None or window_over_lines(response) > 0:
        return False
    return settled.colour.has_levels


@_uneven.register
def _(response: RecordSpectra, task: Task, settled: Settled) -> bool:
    """Whether lines near modes are left more, as unmeasured forces make it, by the test that gives the note."""
    level = settled.levels.outputs * settled.levels.inputs[0]
    poles, resolution = settled.descent.point.poles, 1 / max(response.durations)
    power = _power(settled.descent, response.count)
    return bool(excess_notes(excess(response.frequencies, power, response.values[:, :, 0], poles, resolution, level)))


@singledispatch
def levels_of_lines(response: Response, task: Task, settled: Settled) -> RealArray:
    """Return the standard deviation of every row by what is left of lines, (K,)."""
    point = settled.descent.point
    outputs, inputs = point.problem.sides
    left = residual(point, settled.descent.fitted)
    left = left.transpose(0, 2, 1) if point.problem.turned else left
    some = telling(left[0].size)
    left = left.reshape(len(left), -1)[:, some] * point.problem.rows[:, None]
    values = response.values.reshape(response.count, -1)[:, some]
    sizes = (np.broadcast_to(each, response.values.shape[1:]).ravel()[some] for each in (outputs[:, None], inputs))
    whole = np.concatenate([values.real, values.imag]) / next(sizes) / next(sizes)
    return rows_of_lines(left, whole, response.count, point.kept(), smooth=True)


@levels_of_lines.register
def _(response: RecordSpectra, task: Task, settled: Settled) -> RealArray:
    """Return the same by the spectrum of the residual."""
    power = _power(settled.descent, response.count).mean(axis=1)
    S = residual_spectrum(power, response.points, response.in_plane(settled.descent.point.poles))
    return np.asarray(task.rows * np.tile(np.sqrt(S / S.mean()), 2))


def _power(descent: Descent, count: int) -> RealArray:
    """Return the squares of the whitened residual of records, (F, l)."""
    power = np.empty((count, descent.point.problem.channels[0]))
    for rows, left in residuals(descent.point, descent.fitted):
        lines = np.arange(2 * count)[rows][: len(left) // 2]
        power[lines] = np.sum(left.reshape(2, len(lines), -1) ** 2, axis=0)
    return power


def _optimum(task: Task, start: _Start, most: int, home: ComplexArray | None = None) -> Settled:
    """Return the optimum with the terms of a task, under the levels that it leaves where these settle."""
    levels, window = start.levels, window_over_lines(task.response)
    problem = _divided(task.response, task, levels)
    _check_freedom(task, problem, len(start.poles))
    sides = unit_vectors((start.shapes.T if problem.turned else start.participation) / problem.varying)
    point, unknown = problem.at(start.poles, sides), problem.terms.shape[1] + 2 * len(start.poles)
    for later in reversed(range(_MAX_ROUNDS)):
        descent = descend_from(point, most=most, home=home, progress=task.progress)
        power = descent.point.left_by_channel(descent.fitted) / len(task.rows)
        seen = _colour(descent, power, task.response.count, unknown, window)
        following = levels_of(np.sqrt(power) * levels.channels, task.even)
        following = following.product if task.products else following
        # under levels far from their own, noise of loud channels is model error in quiet ones: once these are tried
        coloured = seen.coloured and (levels.own is not None or following.own is None)
        done = task.known or coloured or not descent.converged or following.change(levels) < _LEVEL_TOLERANCE
        if done or not later:
            break
        point, levels = descent.point.releveled(following), following
    variance = descent.cost / _expected_cost(task, descent)
    if (
        task.known is not None and variance <= 1
    ):  # what is left is no more than the noise that is known: its colour is none of a model's
        variance, seen = 1.0, replace(seen, excess=0.0)
    return Settled(descent, variance, unknown, seen, _worth(task.response, descent.point.poles), levels, task.powers)


def _expected_cost(task: Task, descent: Descent) -> float:
    """Return the squared misfit that noise of variance one leaves."""
    point = descent.point
    noise = window_noise(point, descent.fitted, task.response)
    return point.problem.freedom - 2 * len(point.poles) * sum(task.channels) if noise is None else noise.free


def _needed_powers(task: Task, settled: Settled) -> tuple[int, ...]:
    """Return the powers that the terms need at an optimum, poles and participation held.

    Further powers are added while they lower the squared misfit by more than noise lets them, `chi_squared_bound` of their unknowns.
    """
    point, powers, cost = settled.descent.point, task.powers, settled.descent.cost
    terms, t = point.problem.terms.shape[1], -np.log(_CHANCE_OF_ANY)
    while len(powers) + _FURTHER_POWERS <= task.response.max_powers:
        more = tuple(range(len(powers) + _FURTHER_POWERS))
        problem = _divided(task.response, replace(task, powers=more), settled.levels)
        trial = problem.at(point.poles, point.sides, slopes=False)
        lower, unknowns = trial.cost(trial.fitted()), (problem.terms.shape[1] - terms) * task.channels[0]
        free = problem.freedom - 2 * len(point.poles) * sum(task.channels)
        if free <= 0 or cost - lower <= chi_squared_bound(unknowns, t) * lower / free:
            break
        powers, cost, terms = more, lower, problem.terms.shape[1]
    return powers


def _colour(descent: Descent, power: RealArray, count: int, unknown: float, window: float) -> Colour:
    """Return the colour of what a descent leaves; `power` (l, m): mean squares of the channels."""
    problem = descent.point.problem
    each = (power.T if problem.turned else power).reshape(-1)
    parts = len(problem.rows) // count
    lines = (left.reshape(parts, -1, each.size) for _, left in residuals(descent.point, descent.fitted))
    kept = None if problem.records else descent.point.kept()
    return colour_of_lines(lines, each, count, unknown, kept=kept, window=window)


def _worth(response: Response, poles: ComplexArray) -> RealArray:
    """Return the factor of each pole's gain relative to white noise, (n,)."""
    window = window_over_lines(response)
    if window <= 0:
        return np.ones(len(poles))
    return gain_factor_under_window(window, -poles.real * window / response.added_damping)


@singledispatch
def _divided(response: Response, task: Task, levels: Levels) -> Whitened:
    """Return the data divided by the noise, ready for a descent."""
    return whitened(response, task.fixed, task.powers, task.rows, levels.outputs, levels.inputs, own=levels.own)


@_divided.register
def _(response: RecordSpectra, task: Task, levels: Levels) -> Whitened:
    outputs = levels.outputs * levels.inputs[0]
    return whitened_records(response, task.fixed, task.powers, task.rows, outputs)


def _check_freedom(task: Task, problem: Whitened, modes: int) -> None:
    l, m = task.channels
    if problem.freedom <= 2 * modes * (l + m):
        raise DataError(
            f"refinement of {modes} modes, {l} outputs and {m} inputs has {2 * modes * (l + m)} unknowns",
            f"the data have {max(problem.freedom, 0)} real values besides the residual terms",
            "Give more lines or samples, or fewer modes.",
        )


def least_gain(task: Task) -> float:
    """Return half of what the search over noise may explain: no noise explains more than half of the whole; see `search_bound`."""
    return search_bound(*task.channels, len(task.rows)) / 2
