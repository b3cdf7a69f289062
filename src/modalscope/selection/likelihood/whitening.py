"""Estimate levels that whiten the noise, test residuals for whiteness, and bound what noise alone may explain."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypedDict, Unpack

import numpy as np

from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError

#: Minimum level of a channel relative to its own size, over the largest such level: a channel fitted to rounding must not decide alone.
_MIN_RELATIVE_LEVEL = 1e-7

#: Lines over which the level of a residual is smoothed.
LEVEL_LINES = 41

#: Lines over which a scattered variance is averaged: as wide as the narrowest resonance, and as far as noise is stationary.
_NEAR_LINES, _FAR_LINES = 3, 21

#: Thresholds of the test for white noise, exceeded by one of a thousand sets: standard deviations of the correlation, and of the
#: smoothed level.
_CORRELATION_DEVIATIONS, _LEVEL_DEVIATIONS = 5.0, 3.0

#: Least part of the noise of a line that a fit is taken to leave: lines that it follows altogether tell nothing.
_LEAST_KEPT = 1e-2

#: Steps of the fit of a residual's spectrum.
_SPECTRUM_STEPS = 200

#: Lines further apart are taken as uncorrelated.
_MAX_LAGS = 400

#: Numbers that are computed at a time: they stay in the cache.
_NUMBERS_AT_A_TIME = 1 << 16

#: Chance of any false mode in a data set of noise.
_CHANCE_OF_ANY = 1e-3


@dataclass(frozen=True, eq=False, slots=True)
class Levels:
    """Standard deviations of one real row of the noise: the product of these, channel by channel.

    `outputs`, `inputs` (l,). `own` (l, m): what a channel has beyond the product, in powers of two; None where it is that.
    """

    outputs: RealArray
    inputs: RealArray
    own: RealArray | None = None

    @property
    def channels(self) -> RealArray:
        """Deviations of all channels, (l, m)."""
        product = np.outer(self.outputs, self.inputs)
        return product if self.own is None else product * self.own

    @property
    def product(self) -> Levels:
        """The product alone."""
        return replace(self, own=None)

    def change(self, other: Levels) -> float:
        """Return the largest relative difference of any channel's deviation."""
        return float(np.max(np.abs(np.log(self.channels / other.channels))))


def levels_of(deviations: RealArray, even: RealArray) -> Levels:
    """Return the nearest product of an output's and an input's part, in the logarithm; no unit of a channel counts.

    `deviations` (l, m). `even` (l, m): what brings the data of all channels to one size.
    """
    share = deviations / even
    d = np.maximum(share, max(_MIN_RELATIVE_LEVEL * float(share.max(initial=0.0)), 1e-290)) * even
    log = np.log(d)
    levels = Levels(np.exp(log.mean(axis=1)), np.exp(log.mean(axis=0) - log.mean()))
    own = np.exp2(np.rint(np.log2(d / levels.channels)))
    return levels if np.all(own == own[0]) else replace(levels, own=own)


def row_deviations(rows: int, weights: Array | None) -> RealArray:
    """Return what K real rows are divided by: one over the weights of lines, whose real and imaginary parts are rows; ones without."""
    if weights is None:
        return np.ones(rows)
    w = np.asarray(weights, dtype=float)
    if w.ndim != 1 or w.size == 0 or rows % w.size or not (np.all(np.isfinite(w)) and np.all(w > 0)):
        raise DataError(
            "refine(weights=...) with one positive number per line or sample:",
            f"weights have shape {w.shape}, the data {rows} real rows",
            "Give 1 / standard deviation of each line or sample.",
        )
    return np.tile(1 / w, rows // w.size)


def from_variance(variance: RealArray, rows: int, *, scattered: bool = False) -> tuple[RealArray, Levels]:
    """Return deviations of rows and levels of channels from the variance E |error|^2 of every value, (F, l, m).

    A variance that is itself estimated line by line, from few averages, is `scattered`: a line that is quiet by chance would draw a
    pole to itself. A row has then the larger of what its near and its far neighbours have in the mean: far ones for noise, which is
    smooth, near ones at a resonance that noise on the force makes louder.
    """
    known = variance[variance > 0]
    log = np.log(np.maximum(variance, known.min() if known.size else 1.0)) / 2
    level = log.mean(axis=(1, 2))
    by_row = np.exp(np.maximum(smoothed(level, _NEAR_LINES), smoothed(level, _FAR_LINES)) if scattered else level)
    each = log - np.log(by_row)[:, None, None]
    parts = rows // len(variance)
    levels = np.exp(each.mean(axis=0)) / np.sqrt(parts)
    return np.tile(by_row, parts), levels_of(levels, levels)


def smoothed(values: RealArray, length: int) -> RealArray:
    """Return the mean over neighbours, of those that there are at the ends."""
    window = np.ones(min(length, len(values)))
    return np.asarray(np.convolve(values, window, mode="same") / np.convolve(np.ones(len(values)), window, mode="same"))


@dataclass(frozen=True, eq=False, slots=True)
class Colour:
    """How far a residual is from white noise.

    `correlation`: of neighbouring lines or samples. `uneven`: scatter of the smoothed level over that of white noise; 0 with too few rows
    to smooth. `excess`: the larger of both over what white noise may show.
    """

    correlation: float
    uneven: float
    excess: float

    @property
    def coloured(self) -> bool:
        """Whether this is no white noise."""
        return self.excess > 1

    @property
    def has_levels(self) -> bool:
        """Whether lines have levels of their own: the smoothed level changes by more than that of white noise."""
        return self.uneven > _LEVEL_DEVIATIONS


class _Known(TypedDict, total=False):
    """What is known of a residual besides its size; see `colour_of_lines`."""

    kept: RealArray | None
    level: bool
    window: float


def colour(left: RealArray, count: int, unknown: float, **known: Unpack[_Known]) -> Colour:
    """Judge a whitened residual by how far neighbours agree, and by how its level changes along lines or samples.

    `left` (K, q, p). `count`: lines or samples; K is that, or twice that with real and imaginary parts one after the other. Others: see
    `colour_of_lines`.
    """
    e = left.reshape(-1, count, left[0].size)
    power = np.einsum("rkc,rkc->c", e, e) / len(left)  # no copy: of long records each is large
    return colour_of_lines([e], power, count, unknown, **known)


def colour_of_lines(
    lines: Iterable[RealArray],
    power: RealArray,
    count: int,
    unknown: float,
    *,
    kept: RealArray | None = None,
    level: bool = True,
    window: float = 0.0,
) -> Colour:
    """Judge the same, of lines or samples that come some after others, (1 or 2, f, c) each, real and imaginary parts first.

    `power` (c,): mean square of every channel. `count`: of all lines or samples. `unknown`: unknowns per channel: a fit itself correlates
    what it leaves by about unknown / K. `kept` (K,): the part of white noise that the fit leaves on every row: little where its functions
    are large, and many channels show it. `level`: whether a level that changes counts. `window`: a T of an exponential window over the
    length that a line's distance tells: its noise has the correlation rho_i = 1 / (1 + j pi i / (a T)) between lines, and
    sum |rho_i|^2 = a T coth(a T) lines tell as much as one.
    """
    unit, step = 1 / np.sqrt(np.maximum(power, 1e-300)), max(_NUMBERS_AT_A_TIME // power.size, 1)
    squares, together, first, parts = np.empty(count), 0.0, 0, 1
    before = np.zeros((1, 0, power.size))
    for own in (each[:, k : k + step] * unit for each in lines for k in range(0, each.shape[1], step)):
        e = np.concatenate([before, own], axis=1) if first else own
        together += float(np.einsum("rkc,rkc->", e[:, 1:], e[:, :-1]))
        parts, last = len(own), first + own.shape[1]
        squares[first:last] = np.einsum("rkc,rkc->k", own, own)
        first, before = last, own[:, -1:]
    neighbours = parts * (count - 1) * power.size
    rho = together / neighbours if count > 1 else 0.0
    deviation = 1 / np.sqrt(max(neighbours, 1))
    uneven = 0.0
    if count >= 4 * LEVEL_LINES:
        over = np.ones(LEVEL_LINES)
        smooth = np.convolve(squares, over, mode="valid") / np.convolve(share_of_lines(kept, count), over, mode="valid")
        # the square of a standard normal number scatters by sqrt 2
        uneven = float(np.std(np.log(smooth)) * np.sqrt(LEVEL_LINES * parts * power.size / 2))
    expected = window**2 / (window**2 + np.pi**2)
    alike = np.sqrt(window / np.tanh(window)) if window > 0 else 1.0
    correlated = abs(rho - expected) / (_CORRELATION_DEVIATIONS * deviation * alike + unknown / (parts * count))
    excess = max(correlated, uneven / _LEVEL_DEVIATIONS / alike if level else 0.0)
    return Colour(rho, uneven, float(excess))


def share_of_lines(kept: RealArray | None, count: int) -> RealArray:
    """Return the part of white noise that a fit leaves on every line, (F,), from that of the rows, (K,); all of it by default."""
    if kept is None:
        return np.ones(count)
    return np.asarray(np.maximum(kept.reshape(-1, count).mean(axis=0), _LEAST_KEPT))


def residual_spectrum(power: RealArray, points: Array, poles: Array) -> RealArray:
    """Return the spectrum of what is left of records, a0 + a1 / |x - 1| + a2 / |x - 1|^2 + sum_j q_j / |x - p_j|^2, (F,); all factors >= 0.

    Forces that were not measured shake the modes; a sensor's noise may rise towards 0 Hz. The factors maximize the likelihood of
    `power`, which scatters as the squares of normal numbers do, by steps that keep them positive: q *= W'(power / S^2) / W'(1 / S).

    `power` (F,): mean square of the residual of a line. `points` (F,): where lines lie. `poles` (n,): in the same plane.

    Source: C. Févotte, N. Bertin and J.-L. Durrieu, Neural Computation 21, 2009.
    """
    centre = 1.0 if np.max(np.abs(points.real)) > 0 else 0.0  # of lines in s, 0 Hz
    away = np.maximum(np.abs(points - centre), 1e-9 * np.abs(points).max())
    W = np.stack([np.ones(len(points)), 1 / away, away**-2.0, *np.abs(points - poles[:, None]) ** -2.0], axis=1)
    W /= W.mean(axis=0)
    level = max(float(power.mean()), 1e-300)
    V, q = np.maximum(power / level, 1e-12), np.full(W.shape[1], 1 / W.shape[1])
    for _ in range(_SPECTRUM_STEPS):
        S = W @ q
        q *= (W.T @ (V / S**2)) / (W.T @ (1 / S))
    return np.asarray(level * (W @ q))


def gain_factor_in_correlated_noise(correlation: RealArray, half: RealArray) -> RealArray:
    """Return the factor of gains in correlated noise, relative to white noise of tau = (1 + rho) / (1 - rho) times the variance, (n,).

    Of noise with correlations rho^i the matched filter of a resonance of half bandwidth h (in lines) has
    1 + 2 sum_i rho^i / (1 + (i / 2 h)^2) times the variance that white noise gives it: the correlation of 1 / (j w - s) with itself i lines
    off is 1 / (1 + j i / 2 h). That is tau for wide resonances, and much less for those narrower than the noise is correlated.

    `correlation`, `half` (n,).
    """
    own = lag_factor(correlation[:, None] ** np.arange(1, _MAX_LAGS), half)
    return np.asarray((1 + correlation) / (1 - correlation) / own)


def gain_factor_under_window(window: float, decay: RealArray) -> RealArray:
    """Return the factor of gains in noise under an exponential window, relative to white noise of the same power, (n,).

    With w = exp(-a t), r = exp(-b t), b >= a the decay in the data, over a length T,
    mean(w^2) mean(r^2) / mean(w^2 r^2).

    `window`: a T. `decay` (n,): b T.
    """

    def mean(rate: RealArray) -> RealArray:
        rate = np.maximum(2 * rate, 1e-9)
        return np.asarray(-np.expm1(-rate) / rate)

    return mean(np.asarray(window)) * mean(decay) / mean(window + decay)


def lag_factor(correlation: RealArray, half: RealArray) -> RealArray:
    """Return 1 + 2 sum_i r_i / (1 + (i / 2 h)^2), (n,): how errors of correlations r_i raise the variance of a resonance's amplitude.

    `correlation` (k,): r_i of lines i = 1 ... k apart. `half` (n,): half bandwidths h in lines.
    """
    lags = np.arange(1, correlation.shape[-1] + 1)
    return np.asarray(1 + 2 * np.sum(correlation / (1 + (lags / (2 * np.maximum(half, 1e-6)[:, None])) ** 2), axis=-1))


def free_bound(channels: int, rows: int) -> float:
    """Return k + 2 sqrt(k t) + 2 t, k = 2 channels, t = ln(positions / 1e-3): what noise gives a pole with free residues, in variances.

    `rows`: real values per channel; half as many positions.
    """
    return chi_squared_bound(2 * channels, np.log(max(rows / 2, 2.0) / _CHANCE_OF_ANY))


def chi_squared_bound(unknowns: int, t: float) -> float:
    """Return k + 2 sqrt(k t) + 2 t, which a chi-squared number of k degrees of freedom exceeds with probability exp(-t) at most.

    Source: B. Laurent and P. Massart, Ann. Statist. 28, 2000, Lemma 1.
    """
    return float(unknowns + 2 * np.sqrt(unknowns * t) + 2 * t)


def search_bound(outputs: int, inputs: int, rows: int) -> float:
    """Return 2 (sqrt l + sqrt m + sqrt t)^2, t = ln(positions / 1e-3): the squared misfit, in variances, that a mode of noise may explain.

    The bound on the largest singular value of an l x m complex normal matrix (K. R. Davidson and S. J. Szarek, 2001), over all
    frequencies that a pole may take, half as many as rows. It counts the free shape and participation and the search.

    `outputs`, `inputs`: channels. `rows`: real values per channel.
    """
    positions = max(rows / 2, 2.0)
    return float(2 * (np.sqrt(outputs) + np.sqrt(inputs) + np.sqrt(np.log(positions / _CHANCE_OF_ANY))) ** 2)
