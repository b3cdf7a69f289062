"""Predict samples from their neighbours in time and in other channels, and find those that disagree: isolated and missing ones.

The prediction is linear, by the block Toeplitz covariance of groups of channels.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from scipy import fft

from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import NORMAL
from modalscope.signals.doctor.findings import finding
from modalscope.signals.preprocess.stored_correlation import LagSum

#: Maximum number of channels of a group, and of rows of one side of its matrix: samples of the past times channels.
_MAX_GROUP, _MAX_ROWS = 6, 120

#: Minimum and maximum number of samples of the past.
_MIN_DEPTH, _MAX_DEPTH = 6, 40

#: Maximum number of missing samples: lags beyond the past and the future.
_MAX_MISSING = 60

#: Samples for every coefficient that is estimated: its error adds a fortieth of the prediction's variance at most.
_SAMPLES_PER_COEFFICIENT = 40

#: Part of a channel's variance that is added to it: filtered records would be predicted to rounding.
_ADDED_VARIANCE = 1e-8

#: How often a sound record of any length may have a finding; and the factor by which an isolated sample exceeds that limit.
_FALSE_ALARM, _ISOLATED_FACTOR = 1e-3, 1.5

#: Maximum of the errors around an isolated sample, once it is subtracted, as a part of it.
_MAX_RESIDUAL = 0.25

#: Samples on either side over which the usual error is computed.
_NEIGHBOURS = 100

#: Samples of a block that is filtered, over those of the weights, and their minimum; numbers that are transformed at a time: they stay
#: in the cache.
_BLOCK_OVER_WEIGHTS, _MIN_BLOCK, _NUMBERS_AT_A_TIME = 8, 512, 200_000

#: Past and future are compared in the canonical variates whose correlation exceeds this, and in so many at most.
_MIN_CORRELATION, _MAX_VARIATES = 0.5, 24


class Correlations(NamedTuple):
    """Records of a group of channels, each of variance one, and their correlations."""

    runs: RealArray  # (R, N, l), without means
    depth: int  # p, samples of the past and of the future
    lags: RealArray  # E y(t + k) y(t)', (2 p + _MAX_MISSING + 1, l, l)
    factor: RealArray  # lower Cholesky factor of `within(2 p + 1)`

    def middle(self) -> RealArray:
        """Return the rows of the inverse of `within(2 p + 1)` that belong to the sample in the middle, (l, (2 p + 1) l)."""
        rows = np.zeros(((2 * self.depth + 1) * self.lags.shape[1], self.lags.shape[1]))
        at = self.depth * self.lags.shape[1]
        rows[at : at + len(rows[0])] = np.eye(len(rows[0]))
        return np.asarray(scipy.linalg.cho_solve((self.factor, True), rows).T)

    def between(self, distance: int) -> RealArray:
        """Return E f p' (p l, p l) of a future f that begins `distance` samples late after the past p; block i, j is R(d + p + i - j)."""
        p, l = self.depth, self.lags.shape[1]
        number = distance + p + np.arange(p)[:, None] - np.arange(p)
        return np.asarray(self.lags[number].transpose(0, 2, 1, 3).reshape(p * l, p * l))

    def within(self, blocks: int) -> RealArray:
        """Return E x x' (blocks l, blocks l) of consecutive samples x; block i, j is R(i - j)."""
        number = np.arange(blocks)[:, None] - np.arange(blocks)
        whole = np.where((number >= 0)[:, :, None, None], self.lags[abs(number)], self.lags[abs(number)].swapaxes(2, 3))
        size = blocks * self.lags.shape[1]
        return np.asarray(whole.transpose(0, 2, 1, 3).reshape(size, size))


def _correlations(runs: RealArray) -> Correlations | None:
    """Return the correlations of runs (R, N, l) of a group of channels; None where they are too short, or singular."""
    count, l = runs.shape[0] * runs.shape[1], runs.shape[2]
    depth = min(_MAX_DEPTH, _MAX_ROWS // l, count // (2 * _SAMPLES_PER_COEFFICIENT * l))
    y = runs - runs.mean(axis=1, keepdims=True)
    size = np.sqrt(np.mean(y**2, axis=(0, 1)))
    max_lag = 2 * depth + _MAX_MISSING
    if depth < _MIN_DEPTH or runs.shape[1] < 4 * max_lag or not np.all(size > 0):
        return None
    y = y / size
    total = LagSum(l, range(l), max_lag)
    for run in y:
        total.add(run)
    lags = total.finish() / count
    lags[0] += _ADDED_VARIANCE * np.eye(l)
    model = Correlations(np.asarray(y), depth, lags, np.zeros((0, 0)))
    try:
        return model._replace(factor=scipy.linalg.cholesky(model.within(2 * depth + 1), lower=True))
    except np.linalg.LinAlgError:  # channels that depend on each other, to rounding
        return None


def groups_of(runs: RealArray) -> Iterator[tuple[list[int], Correlations]]:
    """Yield groups of the channels of runs (R, N, l) that are not constant, and their correlations where they can be estimated.

    With k groups each takes every k-th channel.
    """
    moving = np.flatnonzero(np.ptp(runs, axis=(0, 1)) > 0)
    count = -(-moving.size // _MAX_GROUP)
    for group in (moving[first::count] for first in range(count)):
        model = _correlations(runs[:, :, group])
        if model is not None:
            yield group.tolist(), model


class IsolatedSample(NamedTuple):
    """An isolated sample: its value and the one expected from all others, relative to the mean of the channel."""

    run: int
    sample: int
    channel: int
    value: float
    expected: float


class Prediction(NamedTuple):
    """What the prediction of outputs from each other shows.

    `isolated`: samples, in order. `unexplained` (l,): the part of every channel's variance that no other sample of its group explains; zero
    where it cannot be estimated: 1 / (W_kk)_ii of the inverse covariance W of p samples on either side of k. White noise of the channel
    alone cannot exceed it; forces on its own mass show in the later motion. `first`: the correlations of the first group of channels; None
    without any.
    """

    isolated: list[IsolatedSample]
    unexplained: RealArray
    first: Correlations | None


#: Of records that are not steady.
NO_PREDICTION = Prediction([], np.zeros(0), None)


def prediction_of(runs: RealArray) -> Prediction:
    """Return what every group of channels of runs (R, N, l) shows, each visited once."""
    samples, part, first = [], np.zeros(runs.shape[2]), None
    for channels, model in groups_of(runs):
        p, l = model.depth, len(channels)
        W = model.middle()
        part[channels] = 1 / np.diagonal(W[:, p * l : (p + 1) * l])
        first = first or model
        for run, sample, channel, value, expected in _isolated(model, W.reshape(l, 2 * p + 1, l)):
            scale = float(np.std(runs[:, :, channels[channel]]))
            samples.append(IsolatedSample(run, sample, channels[channel], value * scale, expected * scale))
    return Prediction(sorted(samples), part, first)


def _isolated(model: Correlations, W: RealArray) -> list[IsolatedSample]:
    """Return the samples of a group of channels that a number added to one explains, and a disturbance of the motion does not.

    With the inverse covariance W of p samples on either side, (W x)_k is the error of predicting sample k from its neighbours, in time and
    in the other channels, times W_kk: normal with variance W_kk, and of all linear tests for one added number the most powerful. A blow
    disturbs what follows: its size, in standard deviations of the prediction from the past, exceeds that of any such number.

    `model`: normalized to variance one. `W` (l, 2 p + 1, l).
    """
    p, l = model.depth, model.lags.shape[1]
    root = np.sqrt(np.diagonal(W[:, p]))
    limit = _ISOLATED_FACTOR * np.sqrt(2 * np.log(model.runs.shape[0] * model.runs.shape[1] * l / _FALSE_ALARM))
    # errors at the times -p ... p of a number added to channel i at time 0
    pattern = W[:, ::-1].transpose(1, 0, 2) / root[:, None] / root
    samples = []
    for r, run in enumerate(model.runs):
        z = _filtered(run, np.asarray(W)) / root
        large = np.argwhere(np.abs(z) > limit)
        if not len(large):
            continue
        ahead = np.asarray(np.linalg.inv(model.within(p + 1))[p * l :].reshape(l, p + 1, l), dtype=float)
        # e' S^-1 e of the prediction from the past at the samples p ..., the largest of three: the size of a blow
        e = _filtered(run, np.asarray(ahead))
        squares = np.sum(e * np.linalg.solve(ahead[:, p], e.T).T, axis=1)
        blow = scipy.ndimage.maximum_filter1d(squares, 3)[: len(z)]
        for k, i in large:
            if _explains(z, int(k), int(i), blow, pattern[:, :, i], limit):
                x = float(run[k + p, i])
                samples.append(IsolatedSample(r, int(k) + p, int(i), x, x - float(z[k, i] / root[i])))
    return samples


def _filtered(run: RealArray, weights: RealArray) -> RealArray:
    """Return sum_i w_i x(t + i) of a run (N, l) at all times t that it covers, for weights (n, count, l) of `count` samples.

    Overlapping blocks are transformed, multiplied by the conjugate transforms of the weights, and transformed back without the times at
    which a block wraps around.
    """
    n, count, l = weights.shape
    times = len(run) - count + 1
    length = int(fft.next_fast_len(min(max(_BLOCK_OVER_WEIGHTS * count, _MIN_BLOCK), 2 * len(run)), real=True))
    each = length - count + 1  # times of a block
    blocks = -(-times // each)
    padded = np.concatenate([run, np.zeros((blocks * each + count - 1 - len(run), l))])
    under = sliding_window_view(padded, length, axis=0)[::each]  # (blocks, l, length)
    W = fft.rfft(weights, n=length, axis=1).conj().transpose(1, 0, 2)  # (F, n, l)
    filtered = np.empty((blocks, each, n))
    step = max(_NUMBERS_AT_A_TIME // (length * max(n, l)), 1)
    for k in range(0, blocks, step):
        X = fft.rfft(under[k : k + step].transpose(2, 1, 0), axis=0)  # (F, l, blocks)
        filtered[k : k + step] = fft.irfft(W @ X, n=length, axis=0)[:each].transpose(2, 0, 1)
    return filtered.reshape(-1, n)[:times]


def _explains(z: RealArray, k: int, i: int, blow: RealArray, pattern: RealArray, limit: float) -> bool:
    """Return whether a number at time k of channel i explains the errors z (N, l) around it, and a disturbance does not."""
    p = len(pattern) // 2
    first, last = max(k - p, 0), min(k + p + 1, len(z))
    size = abs(z[k, i])
    if size < np.abs(z[first:last]).max():
        return False
    residual = z[first:last] - z[k, i] * pattern[first - k + p : last - k + p]
    usual = NORMAL * float(np.median(np.abs(z[max(k - _NEIGHBOURS, 0) : k + _NEIGHBOURS, i])))
    return bool(size**2 > blow[k] and np.abs(residual).max() < _MAX_RESIDUAL * size and size > limit * usual)


class Gap(NamedTuple):
    """The first sample of a run after missing ones, and how many are missing, most likely."""

    run: int
    sample: int
    missing: int


def missing_samples(signals: Signals, first: Correlations | None) -> list[Finding]:
    """Find times at which samples are missing from all channels, or clocks jumped, by the correlations of the first group of channels."""
    gaps = [] if first is None else _gaps(first)
    if not gaps:
        return []
    runs = [f" of run {gap.run + 1}" if signals.runs > 1 else "" for gap in gaps]
    times = [f"{gap.sample / signals.sampling_rate:.6g} s{run}" for gap, run in zip(gaps, runs, strict=True)]
    where = ", ".join([*times[:3], "..."] if len(times) > 3 else times)
    lost = int(np.median([gap.missing for gap in gaps]))
    return [finding("missing samples", *signals.output_dofs, count=len(gaps), lost=lost, where=where)]


def _gaps(model: Correlations) -> list[Gap]:
    """Return where samples of a group of channels are missing, the clearest first: the past agrees with what would follow later.

    u and v are the canonical variates of the p samples before and after a time: E u v' = C_0, diagonal, and C_g where g samples lie in
    between. The likelihood of (u, v) with C_g over that with C_0 exceeds x by chance with probability 1 / x at most,
    whatever else is estimated: its expectation is 1. Times at which that is less than 1e-3 over all times and g <= 60 are events. A blow
    is one, too: there v - C_0 u is large, with variances of its variates by maximum likelihood. The likelihood ratio of all events
    together must exceed 1e3 times the number of g. Their number of samples is common, or differs at an event whose ratio exceeds that by
    the number of g.

    References
    ----------
    The likelihood ratio's bound is Markov's inequality; canonical variates as in Larimore, "Canonical variate analysis in
    identification, filtering, and adaptive control", 1990.
    """
    U, V, C = _variates(model)
    events = [(r, *event) for r, run in enumerate(model.runs) for event in _events(run, model, U, V, C)]
    if not events:
        return []
    ratios = np.array([ratio for _, _, ratio in events])  # logarithms, (events, g)
    penalty = np.log(ratios.shape[1])
    best = ratios.max(axis=1) - penalty
    total = np.maximum(ratios, best[:, None])
    common = int(np.argmax(total.sum(axis=0)))
    if float(total[:, common].sum()) - penalty < -np.log(_FALSE_ALARM):
        return []
    lost = np.where(ratios[:, common] >= best, common, np.argmax(ratios, axis=1)) + 1
    order = np.argsort(-total[:, common], kind="stable")
    return [Gap(events[i][0], events[i][1] + model.depth, int(lost[i])) for i in order]


def _variates(model: Correlations) -> tuple[RealArray, RealArray, RealArray]:
    """Return the weights (p, l, n) of u in the past and of v in the future, and C_g for g = 0 ... 60."""
    p, l = model.depth, model.lags.shape[1]
    L = model.factor[: p * l, : p * l]  # of `within(p)`

    def whitened(M: Array) -> Array:
        half = scipy.linalg.solve_triangular(L, M, lower=True)
        return np.asarray(scipy.linalg.solve_triangular(L, half.T, lower=True).T)

    left, d, right = np.linalg.svd(whitened(model.between(0)))
    n = min(int(np.count_nonzero(d > _MIN_CORRELATION)), _MAX_VARIATES)
    left, right = left[:, :n], right[:n].T
    C = np.array([left.T @ whitened(model.between(g)) @ right for g in range(_MAX_MISSING + 1)])
    U, V = (scipy.linalg.solve_triangular(L, side, lower=True, trans=1).reshape(p, l, n) for side in (right, left))
    return U, V, C


def _events(
    run: RealArray, model: Correlations, U: RealArray, V: RealArray, C: RealArray
) -> list[tuple[int, RealArray]]:
    """Return the events of a run (N, l): time, and log likelihood ratios of g = 1, 2, ... missing samples over a blow."""
    if not C.shape[1]:
        return []
    p = model.depth
    count = len(run) - 2 * p + 1
    limit = np.log(len(model.runs) * count * (len(C) - 1) / _FALSE_ALARM)
    w, Q = _spread(C[0])
    # (v - C_0 u) Q / sqrt(w) at all times: no log ratio exceeds half of the sum of squares
    errors = _filtered(run, (np.concatenate([-U @ C[0].T, V]) @ (Q / np.sqrt(w))).transpose(2, 0, 1))
    k = np.flatnonzero(np.einsum("tn,tn->t", errors, errors) > 2 * limit)
    if not k.size:
        return []
    u, v = (sum(run[k + start + i] @ side[i] for i in range(p)) for start, side in ((0, U), (p, V)))
    squares = errors[k] ** 2 * w
    densities = np.array([_log_density(u, v, M) for M in C])
    free = np.maximum(w, squares)
    blow = -0.5 * np.sum(np.log(free) + squares / free, axis=1)
    ratio = densities[1:].max(axis=0) - densities[0]
    events: list[tuple[int, RealArray]] = []
    for i in np.argsort(-ratio, kind="stable"):
        if ratio[i] < limit:
            break
        if all(abs(k[i] - other) > _MAX_MISSING for other, _ in events):
            events.append((int(k[i]), densities[1:, i] - blow[i]))
    return events


def _spread(C: RealArray) -> tuple[RealArray, RealArray]:
    """Return the variances of v - C u and their directions."""
    w, Q = np.linalg.eigh(np.eye(len(C)) - C @ C.T)
    return np.maximum(w, 1e-6), Q


def _log_density(u: RealArray, v: RealArray, C: RealArray) -> RealArray:
    """Return the log density of v given u, up to a constant."""
    w, Q = _spread(C)
    return np.asarray(-0.5 * np.sum(np.log(w)) - 0.5 * np.sum(((v - u @ C.T) @ Q) ** 2 / w, axis=1))
