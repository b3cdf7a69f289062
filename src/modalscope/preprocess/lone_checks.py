"""Samples that do not agree with those around them in any channel: weak spikes, and numbers that overflowed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.model.checks import RealArray
from modalscope.model.robust import NORMAL
from modalscope.model.signals import Signals
from modalscope.preprocess.joint_prediction import Joint, joints

__all__ = ["Lone", "lone_outputs"]

#: How often Gaussian records of any length have one; a sample stands out by so much more than that.
_BY_CHANCE, _MORE = 1e-3, 1.5

#: What is left around it once it is taken out is below this part of it.
_LEFT = 0.25

#: Samples on either side that say how large errors usually are.
_NEAR = 100


class Lone(NamedTuple):
    """A sample that stands alone.

    Attributes
    ----------
    run, sample, channel : int
    value, expected : float
        As it is, and as all others would have it; zero is the mean of the channel.
    """

    run: int
    sample: int
    channel: int
    value: float
    expected: float


def lone_outputs(signals: Signals) -> list[Lone]:
    """Return the samples of the outputs that one number added there explains: of a channel for itself, and of nothing that goes on.

    With the inverse covariance W of p samples on either side, (W x)_k is what the sample k has beside its neighbours, in time and in the
    other channels, times W_kk: normal with variance W_kk, and of all linear tests for one added number the most powerful. A blow disturbs
    what follows: its size, in deviations of the prediction from the past, exceeds that of any such number.

    Parameters
    ----------
    signals : Signals
    """
    outputs, _ = signals.by_run()
    found = []
    for channels, known in joints(outputs):
        size = np.std(outputs[:, :, channels], axis=(0, 1))
        found += [
            each._replace(
                channel=channels[each.channel],
                value=each.value * float(size[each.channel]),
                expected=each.expected * float(size[each.channel]),
            )
            for each in _alone(known)
        ]
    return sorted(found)


def _alone(known: Joint) -> list[Lone]:
    """Return the samples of some channels that stand alone."""
    p, l = known.depth, known.lags.shape[1]
    W = np.linalg.inv(known.within(2 * p + 1))[p * l : (p + 1) * l].reshape(l, 2 * p + 1, l)
    ahead = np.asarray(np.linalg.inv(known.within(p + 1))[p * l :].reshape(l, p + 1, l), dtype=float)
    root = np.sqrt(np.diagonal(W[:, p]))
    limit = _MORE * np.sqrt(2 * np.log(known.runs.shape[0] * known.runs.shape[1] * l / _BY_CHANCE))
    # of one number added to channel i at time 0, in the errors at the times -p ... p
    pattern = W[:, ::-1].transpose(1, 0, 2) / root[:, None] / root
    found = []
    for r, run in enumerate(known.runs):
        z = sum(run[i : i + len(run) - 2 * p] @ W[:, i].T for i in range(2 * p + 1)) / root
        blow = _blows(run, ahead, p)[: len(z)]
        for k, i in np.argwhere(np.abs(z) > limit):
            if _stands(z, int(k), int(i), blow, pattern[:, :, i], limit):
                x = float(run[k + p, i])
                found.append(Lone(r, int(k) + p, int(i), x, x - float(z[k, i] / root[i])))
    return found


def _blows(run: RealArray, ahead: RealArray, p: int) -> RealArray:
    """Return e' S^-1 e of the prediction from the past at the samples p ..., the largest of three."""
    weighted = sum(run[i : i + len(run) - p] @ ahead[:, i].T for i in range(p + 1))
    size = np.sum(weighted * np.linalg.solve(ahead[:, p], np.asarray(weighted).T).T, axis=1)
    padded = np.concatenate([[0.0], size, [0.0]])
    return np.asarray(np.maximum(np.maximum(padded[:-2], padded[2:]), size))


def _stands(z: RealArray, k: int, i: int, blow: RealArray, pattern: RealArray, limit: float) -> bool:
    """Say whether one number at time k of channel i explains the errors z (N, l) around it, and no blow does."""
    p = len(pattern) // 2
    first, last = max(k - p, 0), min(k + p + 1, len(z))
    own = abs(z[k, i])
    if own < np.abs(z[first:last]).max():
        return False
    left = z[first:last] - z[k, i] * pattern[first - k + p : last - k + p]
    usual = NORMAL * float(np.median(np.abs(z[max(k - _NEAR, 0) : k + _NEAR, i])))
    return bool(own**2 > blow[k] and np.abs(left).max() < _LEFT * own and own > limit * usual)
