"""Predict samples from their neighbours in time and in other channels, by the block Toeplitz covariance of groups of channels."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy

from modalscope.numerics.checks import RealArray
from modalscope.preprocess.stored_correlation import LagSum

#: Channels of a group, and rows of one side of its matrix: samples of the past times channels.
_TOGETHER, _ROWS = 6, 120

#: Samples of the past, the fewest and the most.
_FEWEST, _DEPTH = 6, 40

#: Lags beyond the past and the future: how many samples may be missing.
FARTHEST = 60

#: Samples for every coefficient that is estimated: its error adds a fortieth of the prediction's variance at most.
_SAMPLES = 40

#: Part of a channel's variance that is added to it: filtered records would be predicted to rounding.
_ROUNDING = 1e-8


class Joint(NamedTuple):
    """Records of a group of channels, each of variance one, and their correlations."""

    runs: RealArray  # (R, N, l), without means
    depth: int  # p, samples of the past and of the future
    lags: RealArray  # E y(t + k) y(t)', (2 p + FARTHEST + 1, l, l)

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


def side_by_side(channels: int) -> list[list[int]]:
    """Return groups of up to six channels, each taking every so many.

    Examples
    --------
    >>> side_by_side(8)
    [[0, 2, 4, 6], [1, 3, 5, 7]]
    """
    groups = -(-channels // _TOGETHER)
    return [list(range(first, channels, groups)) for first in range(groups)]


def joint(runs: RealArray) -> Joint | None:
    """Return the correlations of runs (R, N, l) of a group of channels; None where they are too short, or singular."""
    count, l = runs.shape[0] * runs.shape[1], runs.shape[2]
    depth = min(_DEPTH, _ROWS // l, count // (2 * _SAMPLES * l))
    y = runs - runs.mean(axis=1, keepdims=True)
    size = np.sqrt(np.mean(y**2, axis=(0, 1)))
    far = 2 * depth + FARTHEST
    if depth < _FEWEST or runs.shape[1] < 4 * far or not np.all(size > 0):
        return None
    y = y / size
    total = LagSum(l, range(l), far)
    for run in y:
        of_run = LagSum(l, range(l), far)
        of_run.add(run)
        total.merge(of_run)
    lags = total.finish() / count
    lags[0] += _ROUNDING * np.eye(l)
    found = Joint(np.asarray(y), depth, lags)
    try:
        scipy.linalg.cholesky(found.within(2 * depth + 1), lower=True)
    except np.linalg.LinAlgError:  # channels that depend on each other, to rounding
        return None
    return found


def joints(runs: RealArray) -> Iterator[tuple[list[int], Joint]]:
    """Yield groups of the channels of runs (R, N, l) that are not constant, and their correlations where they can be estimated."""
    alive = np.flatnonzero(np.ptp(runs, axis=(0, 1)) > 0)
    for group in side_by_side(alive.size):
        known = joint(runs[:, :, alive[group]])
        if known is not None:
            yield alive[group].tolist(), known


def unexplained(runs: RealArray) -> RealArray:
    """Return the part of every channel's variance (l,) that no other sample of its group explains; zero where it cannot be estimated.

    1 / (W_kk)_ii of the inverse covariance W of p samples on either side of k: the variance of the best linear estimate of a sample from
    all others. White noise of the channel alone cannot exceed it; forces on its own mass show in the later motion.
    """
    part = np.zeros(runs.shape[2])
    for channels, known in joints(runs):
        p, l = known.depth, len(channels)
        part[channels] = 1 / np.diagonal(np.linalg.inv(known.within(2 * p + 1)))[p * l : (p + 1) * l]
    return part
