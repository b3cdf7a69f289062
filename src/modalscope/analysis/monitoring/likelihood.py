"""How likely a mode of a record is each of the tracks: frequency, damping and shape against what is expected of each, in one number.

The log of p(mode | track) P / ((1 - P) p(mode | none)): P is how often the track is seen, and modes of no track come evenly over all
frequencies, damping ratios (both on the scale of the logarithm) and shapes, so many a record.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.special import expit

from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.statistics import assign

#: Part of the modes that are worse than their deviations say, and how many times: the contaminated normal distribution of
#: J. W. Tukey, "A survey of sampling from contaminated distributions", 1960. Their damping and MAC may be anything.
SPOILT, _WIDER = 0.05, 10.0

Each = TypeVar("Each", "Expected", "Found")

#: Probability that a record is of a structure that has changed, and the part that half of all changes move a frequency by at most.
_CHANGED, _MOVED = 1e-3, 0.05

#: Logarithms of k!, up to as many channels as any test has.
_LOG_FACTORIAL = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, 100_000)))])


@dataclass
class Expected:
    """What is expected of every track, (T,) and (T, l)."""

    level: RealArray  # logarithm of the frequency
    variance: RealArray  # of the level
    noise: RealArray  # variance of one measurement of it
    damping: RealArray  # logarithm of the damping ratio
    damping_variance: RealArray
    shape: ComplexArray  # length one over the channels that are known, 0 elsewhere
    shape_variance: RealArray  # of one component
    turn: ComplexArray  # the direction in which the shape turns most, as shapes of close pairs do; length one, or 0
    turn_variance: RealArray  # of the component in it
    seen: RealArray  # probability of being seen in a record
    believed: BoolArray  # whether stated variances are taken


@dataclass(frozen=True)
class Found:
    """The modes of one record, (n,) and (n, l): logarithms, and shapes with 0 at channels that are missing."""

    level: RealArray
    noise: RealArray  # stated variance of the level; NaN where it is not known
    damping: RealArray  # NaN where it is not known
    shape: ComplexArray
    known: BoolArray

    def __len__(self) -> int:
        return int(self.level.size)


@dataclass(frozen=True)
class Nothing:
    """Modes of no track: how many a record, and how far their logarithms reach."""

    number: float
    frequencies: float
    dampings: float


def some(of: Each, which: IntArray | slice) -> Each:
    """Return some of the tracks, or of the modes."""
    return type(of)(*(getattr(of, name)[which] for name in of.__dataclass_fields__))


def shape_misfit(shape: ComplexArray, found: Found) -> tuple[RealArray, RealArray]:
    """Return 1 - MAC on the channels that both have, and how many components are free, (T, n) each."""
    power = np.abs(shape.conj() @ found.shape.T) ** 2
    held = (np.abs(shape) ** 2) @ found.known.T
    both = (shape != 0).astype(float) @ (found.known & (found.shape != 0)).T
    norm = np.sum(np.abs(found.shape) ** 2, axis=1)
    # of the mode, what lies on channels that the track has not is not compared
    shared = norm if (shape != 0).all() else np.maximum((shape != 0).astype(float) @ (np.abs(found.shape) ** 2).T, 0)
    mac = power / np.maximum(held * shared, 1e-300)
    return np.clip(1 - mac, 0, 1), np.maximum(both - 1, 0)


def _log_shapes(expected: Expected, found: Found) -> tuple[RealArray, RealArray]:
    """Return the log of p(shape | track) / p(shape | none), (T, n), of shapes that scatter, and of spoilt ones.

    k free complex components of variances s_i have the density prod exp(-|c_i|^2 / s_i) / (pi s_i), and all directions k! / pi^k. The
    MAC of a spoilt shape may be anything, evenly: of all directions it has the density k (1 - MAC)^(k - 1).
    """
    misfit, free = shape_misfit(expected.shape, found)
    across = expected.turn - expected.shape * np.sum(expected.shape.conj() * expected.turn, axis=1, keepdims=True)
    turned = np.minimum(np.abs(across.conj() @ found.shape.T) ** 2, misfit)
    s, v = expected.shape_variance[:, None], expected.turn_variance[:, None]
    log_normal = (
        -turned / v - (misfit - turned) / s - np.log(v / s) - free * np.log(s) - _LOG_FACTORIAL[free.astype(int)]
    )
    some = np.maximum(free, 1)
    log_even = -np.log(some) - (free - 1) * np.log(np.maximum(misfit, np.minimum(some * s, 1)))
    # where no shape was measured none can be spoilt
    return np.where(free > 0, log_normal, 0.0), np.where(free > 0, log_even, -np.inf)


def noise_of(expected: Expected, stated: RealArray) -> RealArray:
    """Return the variance of a measurement of each track: as stated where that is known and believed, else the scatter."""
    return np.where(expected.believed & np.isfinite(stated), stated, expected.noise)


def gains(expected: Expected, found: Found, nothing: Nothing) -> tuple[RealArray, RealArray]:
    """Return the log likelihood ratio of every mode for every track, (T, n), and that of modes that are not spoilt.

    The frequency of a mode may be spoilt, or its shape: where both are, nothing says that it is the mode. The structure may have changed,
    too: then frequencies are moved by any factor (a Cauchy distribution of its logarithm).
    """
    noise = np.where(expected.believed[:, None] & np.isfinite(found.noise), found.noise, expected.noise[:, None])
    away = (found.level - expected.level[:, None]) ** 2
    shape, other_shape = _log_shapes(expected, found)
    near = _log_normal(away, expected.variance[:, None] + noise)
    wide = _log_normal(away, expected.variance[:, None] + _WIDER**2 * noise)
    moved = np.log(_CHANGED) - np.log(np.pi * _MOVED * (1 + away / _MOVED**2))
    other_shape = other_shape + np.log(SPOILT)
    same_shape = np.logaddexp(np.logaddexp(near + np.log1p(-2 * SPOILT), wide + np.log(SPOILT)), moved) + shape
    log_fu = np.logaddexp(same_shape, np.logaddexp(near, moved) + other_shape)
    log_z = _log_normal((found.damping - expected.damping[:, None]) ** 2, expected.damping_variance[:, None])
    log_z = log_z + np.log(nothing.dampings) + np.log1p(-SPOILT)
    log_z = np.where(np.isnan(log_z), 0.0, np.logaddexp(np.nan_to_num(log_z), np.log(SPOILT)))
    chance = np.log(expected.seen) - np.log1p(-expected.seen)
    rest = np.log(nothing.frequencies) + log_z + chance[:, None] - np.log(nothing.number)
    return np.asarray(log_fu + rest), np.asarray(near + shape + rest)


def _log_normal(square: RealArray, variance: RealArray) -> RealArray:
    return np.asarray(-square / (2 * variance) - 0.5 * np.log(2 * np.pi * variance))


def chance(gain: RealArray, i: int, j: int) -> float:
    """Return the probability that track i has mode j: the odds of the best assignment with the pair against the best one without.

    Each track takes one mode at most, and each mode one track.

    Examples
    --------
    >>> gain = np.array([[30.0, 28.0], [29.0, 30.0]])
    >>> round(chance(gain, 0, 0), 3), round(chance(gain, 0, 1), 3)
    (0.953, 0.047)
    """
    without = gain.copy()
    without[i, j] = -np.inf
    rest = _best(np.delete(np.delete(gain, i, axis=0), j, axis=1))
    return float(expit(gain[i, j] + rest - _best(without)))


def _best(gain: RealArray) -> float:
    """Return the largest sum of log ratios of pairs, each track and mode at most once."""
    positive = np.maximum(gain, 0)
    return float(positive[assign(-positive)].sum())
