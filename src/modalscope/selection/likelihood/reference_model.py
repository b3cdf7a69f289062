"""Estimate the noise of every channel from an overparameterized reference model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from modalscope.data.response import Response, window_over_lines
from modalscope.data.whitening import levels_of_channels
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.statistics import telling
from modalscope.selection.likelihood.line_levels import parts_of_level, rows_of_lines, told_rows
from modalscope.selection.likelihood.whitening import (
    LEVEL_LINES,
    Colour,
    Levels,
    colour,
    from_variance,
    gain_factor_under_window,
    levels_of,
    smoothed,
)

#: Maximum number of columns of the reference model relative to the rows.
_MAX_COLUMN_SHARE = 0.5

#: Minimum residual degrees of freedom: rows / 8.
_ROWS_PER_FREEDOM = 8.0

#: Lines over which the correlation of neighbours is smoothed; the residual is white below this many standard deviations; maximum factor in
#: the variance by correlation.
_CORRELATION_LINES, _WHITE_DEVIATIONS, _MAX_CORRELATED_LINES = 81, 2.0, 99.0

#: Rounds in which the reference model is fitted again under levels of lines, at most, and their relative change that tells nothing.
_LINE_ROUNDS, _LINE_TOLERANCE = 6, 1e-7

#: Minimum significance of a decay rate of the noise, in standard deviations; lowest noise level relative to the first sample; maximum
#: number of rounds until rows converge to this relative tolerance.
_MIN_DECAY_DEVIATIONS, _MIN_RELATIVE_LEVEL, _MAX_ROUNDS, _ROW_TOLERANCE = 5.0, 1e-7, 4, 0.05

#: Minimum noise relative to the data: rounding.
_MIN_RELATIVE_NOISE = 1e-13


@dataclass(frozen=True, eq=False, slots=True)
class Floor:
    """The noise of data, from the residual of the reference model.

    `rows` (K,): deviations of the rows, relative to each other. `levels`: deviations of the channels. `variance`: of a row divided by all
    of these. `left` (K, l, m): the residual, not divided; `kept` (K,): the part of white noise on every row that the model leaves in it.
    `data` (K, l, m): not divided; `share`: mean square of the residual relative to theirs. `correlation` (F,): of neighbouring lines around
    each, where rows are divided line by line. `window`: a T of an exponential window that noise on lines lies under; see `colour`.
    """

    rows: RealArray
    levels: Levels
    variance: float
    colour: Colour
    left: RealArray
    kept: RealArray
    data: RealArray
    share: float
    correlation: RealArray | None = None
    window: float = 0.0

    def of_products(self) -> Floor:
        """Return the noise under levels that are products: model error has no levels of single channels."""
        if self.levels.own is None:
            return self
        power, levels = np.mean((self.left / self.rows[:, None, None]) ** 2, axis=0), self.levels.product
        ratio = np.mean(power / levels.channels**2) / np.mean(power / self.levels.channels**2)
        return replace(self, levels=levels, variance=float(self.variance * ratio))

    def quiet(self, count: int) -> Floor:
        """Return the noise of the quieter half of the lines, all of them alike: what a mode that the model lacks leaves is on few.

        The median of the squares of complex noise is ln 2 of their mean.

        `count`: lines.
        """
        squares = np.sum(self.left.reshape(-1, count, *self.left.shape[1:]) ** 2, axis=0)
        sigma = np.sqrt(np.median(squares, axis=0) / (2 * np.log(2) * np.mean(self.kept)))
        levels = levels_of(np.maximum(sigma, _MIN_RELATIVE_NOISE * self.levels.channels), self.levels.channels)
        ratio = sigma / levels.channels
        return replace(self, rows=np.ones(len(self.rows)), levels=levels, variance=float(np.mean(ratio**2)))

    def judged(self) -> Floor:
        """Return what is known of the noise without the residual and the data, which of many channels take much room."""
        return replace(self, left=np.zeros(0), data=np.zeros(0))


def floor_of(response: Response, poles: Array) -> Floor:
    """Fit poles (n,) in rad/s with free residues in every channel, and the residual terms, and judge what is left.

    sigma_om^2 = RSS_om / (rows - columns) of channel (o, m), so s_i nearest to it in the logarithm. Where lines are left more in some
    places than in others, they are divided by levels of their own, see `rows_of_lines`: errors of loud lines are not those of quiet ones.
    """
    few = _few(response, poles)
    basis = response.basis(few, response.outside_powers)
    taken = _taken(response, few, basis.columns.shape[1])
    variance, scattered = response.variance, response.averages is not None
    if variance is not None:
        return _floor(response, basis, taken, *from_variance(variance, len(basis.data), scattered=scattered))
    told = told_rows(response)
    floor = _floor(response, basis, taken, np.ones(len(basis.data)) if told is None else told)
    if response.grid is not None:
        telling_alone = _of_telling(basis)
        whole = telling_alone is basis
        levelled = floor if whole else _floor(response, telling_alone, taken, floor.rows)
        for _ in range(0 if told is not None or floor.window > 0 else _LINE_ROUNDS):
            if not levelled.colour.has_levels:
                break
            by_row = rows_of_lines(levelled.left, levelled.data, response.count, levelled.kept)
            if np.allclose(by_row, levelled.rows, rtol=_LINE_TOLERANCE, atol=0):
                break
            levelled = _floor(response, telling_alone, taken, by_row)
        return levelled if whole else _floor(response, basis, taken, levelled.rows)
    for _ in range(_MAX_ROUNDS):
        if floor.colour.coloured:
            break
        by_row = _faded(floor)
        if np.allclose(by_row, floor.rows, rtol=_ROW_TOLERANCE):
            break
        floor = _floor(response, basis, taken, by_row)
    return floor


def _of_telling(basis: ModalBasis) -> ModalBasis:
    """Return the basis with the channels that tell the levels of lines, which are enough to find them; itself where all do."""
    channels = basis.data[0].size
    if telling(channels).step == 1:
        return basis
    return replace(basis, data=basis.data.reshape(len(basis.data), 1, channels)[..., telling(channels)])


def _floor(
    response: Response, basis: ModalBasis, taken: float, by_row: RealArray, known: Levels | None = None
) -> Floor:
    """Return what the columns leave of the data when rows are divided by their deviations."""
    rows = len(basis.data)
    columns = basis.columns / by_row[:, None]
    size = np.linalg.norm(columns, axis=0)
    Q = np.asarray(sla.qr(columns[:, size > 0] / size[size > 0], mode="economic", check_finite=False)[0])
    flat = basis.data.reshape(rows, -1) / by_row[:, None]
    even = np.outer(*levels_of_channels(flat.reshape(basis.data.shape)))
    left = np.asarray(Q @ (Q.T @ flat))  # of many channels each is large
    left = np.subtract(flat, left, out=left).reshape(basis.data.shape)
    sigma = np.sqrt(np.einsum("kom,kom->om", left, left) / max(rows - taken, rows / _ROWS_PER_FREEDOM, 1))
    sigma = np.maximum(sigma, _MIN_RELATIVE_NOISE * even)
    levels = known or levels_of(sigma, even)
    variance = float(np.mean((sigma / levels.channels) ** 2))
    # a model that is too rich follows the noise of samples while its poles last, and not later: there the level tells nothing
    window = window_over_lines(response)
    kept = 1 - np.einsum("kj,kj->k", Q, Q)
    seen = colour(left, response.count, taken, kept=kept, level=response.grid is not None, window=window)
    left *= by_row[:, None, None]
    missed, whole = (float(np.sum(np.einsum("kom,kom->om", each, each) / even**2)) for each in (left, basis.data))
    share = missed / max(whole, 1e-300)
    return Floor(by_row, levels, variance, seen, left, kept, basis.data, share, window=window)


def _taken(response: Response, poles: Array, unknown: int) -> float:
    """Return how many real rows of noise the columns of poles and terms take up: under an exponential window a pole takes more than two.

    That noise lies where the window is large, as the poles do.
    """
    window = window_over_lines(response)
    if window <= 0:
        return unknown
    each = 1 / gain_factor_under_window(window, -poles.real * window / response.added_damping)
    return float(unknown + 2 * np.sum(each - 1))


def _faded(floor: Floor) -> RealArray:
    """Return exp(-a k) for the rate a at which the residual of samples is likeliest to fade, ones where it does not.

    Noise e_k of variance s^2 exp(-2 a k): the likelihood is largest where the mean of k under the weights e_k^2 exp(2 a k) is the mean
    of all k. The rate of K samples of q channels is known to 1 / sqrt(2 q sum (k - mean k)^2). Noise never rises: a model that is too
    rich follows it while its poles last.
    """
    from scipy.optimize import brentq  # slow to load

    e = floor.left / np.maximum(np.sqrt(np.mean((floor.left / floor.rows[:, None, None]) ** 2, axis=0)), 1e-300)
    size = np.log(np.maximum(np.mean(e**2, axis=(1, 2)), 1e-300))
    k = np.arange(len(size)) - (len(size) - 1) / 2

    def late(a: float) -> float:
        exponent = size + 2 * a * k
        weights = np.exp(exponent - exponent.max())
        return float(weights @ k)

    steepest = -np.log(_MIN_RELATIVE_LEVEL) / len(size)
    least = _MIN_DECAY_DEVIATIONS / np.sqrt(2 * e[0].size * np.sum(k**2))
    if late(least) >= 0:
        return np.ones(len(size))
    a = steepest if late(steepest) < 0 else float(brentq(late, least, steepest))
    return np.asarray(np.exp(-a * np.arange(len(size))))


def by_line(floor: Floor, count: int) -> Floor:
    """Return the noise with deviations line by line, for a residual that is coloured: misfit of the model as much as noise.

    With e the residual, channels brought to unit level: level(f) as in `parts_of_level`, then smoothed,
    rho(f) = Re mean(e_k+1 conj e_k) / mean |e|^2 over neighbours, and a row's deviation sqrt(level tau),
    tau = (1 + rho) / (1 - rho): so many lines tell as much as one of white noise. The variance is that of the residual divided by its level
    alone, or the colour would cancel.

    `count`: lines.
    """
    rows, l, m = floor.left.shape
    each, data = floor.left / floor.rows[:, None, None], floor.data / floor.rows[:, None, None]
    channels = np.maximum(np.sqrt(np.mean(each**2, axis=0)), 1e-300)
    e = (each / channels).reshape(rows // count, count, l * m)
    size = np.mean((data / channels).reshape(e.shape) ** 2, axis=(0, 2))
    power = np.mean(e**2, axis=(0, 2))
    noise, own = parts_of_level(power[:, None], np.ones(count), size[:, None])
    level = (noise + own)[:, 0]
    level = level * smoothed(power / level, LEVEL_LINES)
    around = smoothed(power, _CORRELATION_LINES)
    neighbours = np.append(np.mean(e[:, 1:] * e[:, :-1], axis=(0, 2)), 0)
    rho = smoothed(neighbours, _CORRELATION_LINES) / around
    rho = np.where(rho > _WHITE_DEVIATIONS / np.sqrt(len(e) * l * m * _CORRELATION_LINES), rho, 0)
    tau = (1 + rho) / np.maximum(1 - rho, 2 / (_MAX_CORRELATED_LINES + 1))
    own = np.tile(np.sqrt(level * np.minimum(tau, _MAX_CORRELATED_LINES)), len(e))
    levelled = float(np.mean(e**2 / level[:, None]))
    longest = (_MAX_CORRELATED_LINES - 1) / (_MAX_CORRELATED_LINES + 1)
    return replace(
        floor, rows=floor.rows * own, variance=floor.variance * levelled, correlation=np.clip(rho, 0, longest)
    )


def _few(response: Response, poles: Array) -> Array:
    """Leave out poles that grow, and the most damped of too many."""
    decaying = poles[poles.real < 0]
    most = max(int(_MAX_COLUMN_SHARE * response.count * (2 if response.grid is not None else 1)) // 2, 1)
    return np.asarray(decaying[np.argsort(-decaying.real / np.abs(decaying), kind="stable")[:most]])
