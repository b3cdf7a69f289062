"""Split the residual of records into parts near resonances and away from them, and find poles that are not the structure's.

Forces that were not measured, and noise on the measured ones, shake the structure: the residual is resonant. Noise of the output
sensors is not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.shown import percent
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.poles import is_real

#: Kinds of the notes on a residual that stands out at the modes, and on channels that come late.
UNMEASURED, DELAY = "unmeasured forces", "delay"

#: Excess of the residual at the modes from which it is reported (sensor noise alone gives 0 to 3 dB), and its minimum share of the
#: data there: damping is biased by about the square of that share.
_MIN_DECIBELS, _MIN_SHARE = 6.0, 0.01

#: Maximum distance of a drift's pole from z = 1 in multiples of 1 / T, maximum modulus of a delay's pole, and maximum delay in samples:
#: more such poles are damped noise.
_MAX_DRIFT, _MAX_DELAY_MODULUS, _MAX_DELAY_SAMPLES = 0.5, 1e-3, 6

#: Maximum chance that as many poles of noise lie as near z = 0.
_CHANCE_OF_DELAY = 1e-3

#: Distance from a mode, in half bandwidths, up to which lines are near it, and from which they are away from it.
_NEAR_HALF_BANDWIDTHS, _FAR_HALF_BANDWIDTHS = 2.0, 10.0

#: Lines away from all modes with which each line near one is compared.
_COMPARED_LINES = 10


class Excess(NamedTuple):
    """Residual at resonances.

    Attributes
    ----------
    decibels : float
        Mean square near the modes over that away from them, outputs brought level; NaN where there are no such lines.
    share : float
        Root mean square near the modes over that of the data there.
    """

    decibels: float
    share: float


def excess(
    frequencies: RealArray, power: RealArray, values: Array, poles: Array, resolution: float, level: RealArray | float
) -> Excess:
    """Compare the residual of a fit near modes with that between them.

    `frequencies` (F,): hz. `power` (F, l): squares of the residuals, divided by `level` (l,). `values` (F, l): not divided.
    `poles` (n,): rad/s, as they are in the data. `resolution`: distance of the lines of a run, Hz; no mode is taken to be narrower.
    """
    f = np.abs(poles) / (2 * np.pi)
    half = np.maximum(np.abs(poles.real) / (2 * np.pi), resolution)
    apart = np.min(np.abs(frequencies[:, None] - f) / half, axis=1, initial=np.inf)
    near, away = np.flatnonzero(apart <= _NEAR_HALF_BANDWIDTHS), np.flatnonzero(apart > _FAR_HALF_BANDWIDTHS)
    if not near.size or not away.size:
        return Excess(np.nan, np.nan)
    away = away[np.argsort(frequencies[away], kind="stable")]
    place = np.searchsorted(frequencies[away], frequencies[near])
    beside = away[np.clip(place[:, None] + np.arange(-_COMPARED_LINES // 2, _COMPARED_LINES // 2), 0, away.size - 1)]
    ratio, count, missed, whole = 0.0, 0, 0.0, 0.0
    sizes = np.broadcast_to(level, power.shape[1])
    for left, data, size in zip(
        power.T, values.T, sizes, strict=True
    ):  # of long records all outputs together are large
        floor = left[beside].mean(axis=1)
        usable = floor > 0
        ratio += float(np.sum(left[near[usable]] / floor[usable]))
        count += int(np.count_nonzero(usable))
        missed += float(np.sum(left[near]))
        whole += float(np.sum(np.abs(data[near] / size) ** 2))
    decibels = 10 * np.log10(ratio / count) if count and ratio > 0 else np.nan
    return Excess(float(decibels), float(np.sqrt(missed / whole)) if whole > 0 else np.nan)


def excess_notes(found: Excess) -> tuple[Note, ...]:
    """Return a note where the residual is larger at the modes and matters."""
    if not (found.decibels >= _MIN_DECIBELS and found.share >= _MIN_SHARE):
        return ()
    text = (
        f"unmeasured forces, or noise on the inputs: the residual is {found.decibels:.0f} dB higher at the modes than between them "
        f"({percent(found.share, 2)} of the response there). Unmeasured forces widen intervals, noise on the inputs biases damping; "
        "one record cannot separate the two."
    )
    return (Note(UNMEASURED, {"decibels": found.decibels, "share": found.share}, text),)


def pole_notes(poles: Array, sampling_rate: float | None, duration: float) -> tuple[Note, ...]:
    """Return notes on poles of a drift and of a delay.

    `poles` (n,): of the sampled system, or rad/s where there is no sampling rate. `duration`: seconds of the longest run.
    """
    notes = []
    distance = np.abs(poles - 1) * sampling_rate if sampling_rate is not None else np.abs(poles)
    alone = is_real(poles, 1e-9)  # a negative pole has been through logarithm and exponential
    if np.any(alone & (distance < _MAX_DRIFT / duration)):
        notes.append(Note("drift", {}, "A pole at 0 Hz: the records drift. This takes one state and does no harm"))
    if sampling_rate is not None:
        size = np.sort(np.repeat(np.abs(poles), np.where(alone, 1, 2)))
        # a pole of multiplicity k is known to the k-th root of what one is known to
        late = max(
            (
                k
                for k, r in enumerate(size[:_MAX_DELAY_SAMPLES].tolist(), start=1)
                if r**k < _MAX_DELAY_MODULUS and _chance(size, k) < _CHANCE_OF_DELAY
            ),
            default=0,
        )
        if late:
            text = f"{late} poles at z = 0: some channels come about {late} samples late in all"
            notes.append(Note(DELAY, {"samples": late}, f"a delay of about {late} samples: {text}"))
    return tuple(notes)


def _chance(size: RealArray, count: int) -> float:
    """Return the probability that noise has the first `count` poles where they are, as near z = 0 as the last of them.

    Poles of noise are as dense there as the next ones, as many again: evenly in the disc, a single one evenly on the real axis.
    `size`: moduli of all poles, increasing.
    """
    others = size[count : 2 * count]
    inner, outer = (float(r) ** min(count, 2) for r in (size[count - 1], others[-1] if others.size else 1.0))
    if outer <= inner:
        return 1.0
    expected = max(others.size, 1) * inner / (outer - inner)
    return 1 - math.exp(-expected) * sum(expected**k / math.factorial(k) for k in range(count))
