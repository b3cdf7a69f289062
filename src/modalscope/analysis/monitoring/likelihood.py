"""How likely a mode of a record is each of the tracks: frequency, damping and shape against what is expected of each, in one number.

The log of p(mode | track) P / ((1 - P) p(mode | none)): P is how often the track is seen, and modes of no track come evenly over all
frequencies, damping ratios (both on the scale of the logarithm) and shapes, so many a record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray

#: Part of the modes that are worse than their deviations say, and how many times: the contaminated normal distribution of
#: J. W. Tukey, "A survey of sampling from contaminated distributions", 1960. Their damping and MAC may be anything.
SPOILT, _WIDER = 0.05, 10.0

#: Log ratio below which a pair cannot matter: its probability is less than e to this power, as not taking it weighs 1.
_NEGLIGIBLE = -15.0

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

    def take(self, which: IntArray) -> Expected:
        """Return some of the tracks."""
        return Expected(*(getattr(self, name)[which] for name in Expected.__dataclass_fields__))


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


def gains(expected: Expected, found: Found, nothing: Nothing, spoilt: float = SPOILT) -> RealArray:
    """Return the log likelihood ratio of every mode for every track, (T, n). `spoilt`: part that may be anything; 0: none.

    The frequency of a mode may be spoilt, or its shape: where both are, nothing says that it is the mode.
    """
    noise = np.where(expected.believed[:, None] & np.isfinite(found.noise), found.noise, expected.noise[:, None])
    away = (found.level - expected.level[:, None]) ** 2
    shape, other_shape = _log_shapes(expected, found)
    log_fu = _log_normal(away, expected.variance[:, None] + noise) + shape
    if spoilt:
        wide = _log_normal(away, expected.variance[:, None] + _WIDER**2 * noise) + shape
        log_fu = log_fu + np.log1p(-2 * spoilt)
        log_fu = np.logaddexp(log_fu, wide + np.log(spoilt))
        log_fu = np.logaddexp(
            log_fu, _log_normal(away, expected.variance[:, None] + noise) + other_shape + np.log(spoilt)
        )
    Z = expected.damping_variance[:, None]
    log_z = (
        _log_normal((found.damping - expected.damping[:, None]) ** 2, Z) + np.log(nothing.dampings) + np.log1p(-SPOILT)
    )
    log_z = np.where(np.isnan(log_z), 0.0, np.logaddexp(np.nan_to_num(log_z), np.log(SPOILT)))
    chance = np.log(expected.seen) - np.log1p(-expected.seen)
    return np.asarray(log_fu + np.log(nothing.frequencies) + log_z + chance[:, None] - np.log(nothing.number))


def _log_normal(square: RealArray, variance: RealArray) -> RealArray:
    return np.asarray(-square / (2 * variance) - 0.5 * np.log(2 * np.pi * variance))


def marginals(gain: RealArray) -> RealArray:
    """Return the probability of every pair, (T, n), when each track takes one mode at most, and each mode one track.

    Sums over all assignments, track by track, by the modes that are taken; of groups of tracks and modes that can be confused, one by
    one. Belief propagation would be certain of close pairs that are not.

    Examples
    --------
    >>> marginals(np.array([[30.0, 28.0], [29.0, 30.0]])).round(3)
    array([[0.953, 0.047],
           [0.047, 0.953]])
    """
    found = np.zeros(gain.shape)
    near = gain > _NEGLIGIBLE
    left = set(np.flatnonzero(near.any(axis=1)).tolist())
    while left:
        tracks, modes = {left.pop()}, set[int]()
        while True:
            more = set(np.flatnonzero(near[sorted(tracks)].any(axis=0)).tolist())
            wider = set(np.flatnonzero(near[:, sorted(more)].any(axis=1)).tolist())
            if wider == tracks and more == modes:
                break
            tracks, modes = wider, more
        left -= tracks
        place = np.ix_(sorted(tracks), sorted(modes))
        found[place] = _summed(np.where(near[place], gain[place], -np.inf))
    return found


def _summed(gain: RealArray) -> RealArray:
    """Return the marginals of one group."""
    scale = np.maximum(gain.max(axis=1, keepdims=True), 0)
    w, none = np.exp(gain - scale), np.exp(-scale[:, 0])
    if w.size == 1:
        return np.asarray(w / (w + none))
    before: list[dict[int, float]] = [{0: 1.0}]  # weight of all that tracks above can do, by the modes that it takes
    for row, alone in zip(w, none, strict=True):
        after: dict[int, float] = {}
        for taken, weight in before[-1].items():
            after[taken] = after.get(taken, 0.0) + weight * alone
            for j in np.flatnonzero(row):
                if not taken >> int(j) & 1:
                    after[taken | 1 << int(j)] = after.get(taken | 1 << int(j), 0.0) + weight * row[j]
        least = 1e-12 * max(after.values())
        before.append({taken: weight for taken, weight in after.items() if weight > least})
    total = sum(before[-1].values())
    found, below = np.zeros(w.shape), dict.fromkeys(before[-1], 1.0)
    for i in range(len(w) - 1, -1, -1):
        here: dict[int, float] = {}
        for taken, weight in before[i].items():
            here[taken] = none[i] * below.get(taken, 0.0)
            for j in np.flatnonzero(w[i]):
                rest = 0.0 if taken >> int(j) & 1 else w[i, j] * below.get(taken | 1 << int(j), 0.0)
                here[taken] += rest
                found[i, j] += weight * rest / total
        below = here
    return found
