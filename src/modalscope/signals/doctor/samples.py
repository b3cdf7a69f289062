"""Check single samples of a channel: converters that overflowed, stretches that hold one value, spikes.

Each rule asks for what a sound record of that length shows with a probability of 1e-3 at most, and for a pattern that vibration does
not make: jumps from one end of the range to the other, one channel that holds its value while it moved before, a single sample.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np
from scipy.special import pdtrc

from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import NORMAL
from modalscope.signals.doctor.findings import channels_of, finding
from modalscope.signals.doctor.prediction import IsolatedSample

#: How often a sound record of any length may have a finding.
_FALSE_ALARM = 1e-3

#: The outer tenths of the range (-1 to 1), which an overflow joins; a signal of two levels spends more than this part of its time there.
_OUTER, _TWO_LEVELS = 0.8, 0.6

#: Samples on either side of a jump over which neighbours are compared.
_BESIDE = 12

#: Maximum median step, from or to the outer halves of the range, of a smooth signal.
_SMOOTH_STEP, _OUTER_HALF = 0.1, 0.5

#: Minimum motion before and after a stretch of equal samples, in standard deviations of the channel, over so many samples.
_MIN_MOTION, _MOTION_SAMPLES = 0.1, 50

#: Minimum number of equal samples that are a finding.
_MIN_STRETCH = 8

#: Maximum deviation of the second differences next to a single spike from minus half of it, as a part of it.
_SPIKE_TOLERANCE = 0.25

#: Samples on either side over which the usual difference is computed; a spike exceeds the largest of noise by this factor.
_NEIGHBOURS, _SPIKE_FACTOR = 25, 1.5


def overflows(signals: Signals, kind: str, isolated: Sequence[IsolatedSample] = ()) -> list[Finding]:
    """Find channels that jump from one end of their range to the other and go on from there: the converter overflowed.

    The force of a hammer goes through its range in a sample or two.

    An isolated sample of an output counts, too, when it is at one end of the range and expected at the other.
    """
    findings = []
    for i, (dof, x) in enumerate(channels_of(signals, inputs=kind != "impact")):
        places = {(r, int(k) + 1) for r, run in enumerate(x) for k in wraps(run)}
        places |= {(s.run, s.sample) for s in isolated if s.channel == i and _across(s, x[s.run])}
        if places:
            findings.append(finding("overflow", dof, count=len(places)))
    return findings


def _across(sample: IsolatedSample, x: RealArray) -> bool:
    """Return whether a sample is in one outer tenth of the range of its run x (N,), and is expected in the other."""
    low, high = float(x.min()), float(x.max())
    value, expected = (2 * (v + float(x.mean()) - low) / (high - low) - 1 for v in (sample.value, sample.expected))
    outer = value * expected < 0 and min(abs(value), abs(expected)) > _OUTER
    # a large spike sets the range by itself, and its expected value lies near the mean
    return bool(outer and abs(sample.expected) > abs(sample.value) / 2)


def wraps(x: RealArray) -> Array:
    """Return the samples k of x (N,) at which it jumps between the outer tenths of its range, where that is more than chance.

    Neighbours that are not correlated negatively lie in opposite tails at most as often as independent samples do (Slepian's
    inequality): N p q times, with p and q the parts of the samples in the two tails, of the N samples while there is vibration.
    """
    none = np.zeros(0, dtype=int)
    span, y = float(np.ptp(x)), x - np.mean(x)
    if len(x) < 4 or span == 0 or float(y[1:] @ y[:-1]) < 0:
        return none
    if float(np.max(np.abs(np.diff(x)))) <= _OUTER * span:  # from one outer tenth to the other
        return none
    side = (x - x.min()) / span * 2 - 1
    high, low = side > _OUTER, side < -_OUTER
    if np.mean(high) + np.mean(low) > _TWO_LEVELS:
        return none
    jumps = np.flatnonzero((high[:-1] & low[1:]) | (low[:-1] & high[1:]))
    jumps = jumps[[_smooth_beside(side, int(k)) for k in jumps]] if jumps.size else jumps
    if not jumps.size:
        return none
    steps = np.abs(np.diff(side))
    outer = np.maximum(np.abs(side[1:]), np.abs(side[:-1])) > _OUTER_HALF
    outer[jumps] = False
    if (
        float(np.median(steps[outer] if np.any(outer) else steps)) < _SMOOTH_STEP
    ):  # no vibration crosses its range in one step
        return jumps
    # bursts fill a part of the record: Gaussian samples of one size have mean y^4 = 3 (mean y^2)^2
    part = min(3 * float(np.mean(y**2)) ** 2 / float(np.mean(y**4)), 1.0)
    expected = 2 * len(x) * float(np.mean(high) * np.mean(low)) / part
    return jumps if pdtrc(len(jumps) - 1, expected) < _FALSE_ALARM else none


def _smooth_beside(x: RealArray, k: int) -> bool:
    """Return whether neighbours around a jump from sample k to the next are correlated positively: a blow rings up and down."""
    around = x[max(k - _BESIDE, 0) : k + 2 + _BESIDE]
    products = around[1:] * around[:-1]
    return float(np.sum(products[products > -(_OUTER**2)])) > 0


def frozen(signals: Signals) -> list[Finding]:
    """Find stretches in which a channel holds one value while it moves before and after: samples or the sensor were lost.

    Where equal neighbours are common, as in coarse steps, the stretch must be longer than chance makes one.
    """
    of_channels = [
        (dof, [(r, a, b) for r, x in enumerate(runs) for a, b in equal_stretches(x)])
        for dof, runs in channels_of(signals)
    ]
    stretches = [of_channel for _, of_channel in of_channels]
    gaps = set.intersection(*map(set, stretches)) if len(stretches) > 1 else set()
    findings = []
    if gaps:
        dofs = [dof for dof, of_channel in of_channels if of_channel]
        findings.append(finding("gap", *dofs, stretches=_in_words(sorted(gaps), signals)))
    for dof, of_channel in of_channels:
        if alone := [stretch for stretch in of_channel if stretch not in gaps]:
            findings.append(finding("frozen", dof, stretches=_in_words(alone, signals)))
    return findings


def equal_stretches(x: RealArray) -> list[tuple[int, int]]:
    """Return (start, stop) of the stretches of equal samples of x (N,) that are longer than chance, with motion on either side."""
    equal = x[1:] == x[:-1]
    if np.count_nonzero(equal) < _MIN_STRETCH - 1:
        return []
    size = float(np.std(x))
    if size == 0:
        return []
    often = min(max(float(np.mean(equal)), 1 / len(x)), 0.99)
    least = max(_MIN_STRETCH, int(np.log(_FALSE_ALARM / len(x)) / np.log(often)) + 2)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], equal.astype(int), [0]])))
    stretches = []
    for a, b in zip(edges[::2], edges[1::2] + 1, strict=True):
        before, after = x[max(a - _MOTION_SAMPLES, 0) : a], x[b : b + _MOTION_SAMPLES]
        moving = len(before) >= 2 and len(after) >= 2 and min(np.std(before), np.std(after)) > _MIN_MOTION * size
        if b - a >= least and moving:
            stretches.append((int(a), int(b)))
    return stretches


def spikes(
    signals: Signals, kind: str, but: Container[str] = (), isolated: Sequence[IsolatedSample] = ()
) -> list[Finding]:
    """Find isolated samples, but not in the force of a hammer, which is one by nature, nor in the channels `but`.

    Of the samples that only all channels together show (`isolated`), two of a channel are needed: one changes no estimate measurably.
    """
    findings = []
    for i, (dof, x) in enumerate(channels_of(signals, inputs=kind != "impact")):
        weak = {(s.run, s.sample) for s in isolated if s.channel == i}
        large = {(r, int(k)) for r, run in enumerate(x) for k in spikes_of(run)}
        places = [] if dof in but else sorted(large | weak if len(weak) > 1 else large)
        if places:
            times = ", ".join(f"{k / signals.sampling_rate:.6g} s" for _, k in places[:3])
            times += ", ..." if len(places) > 3 else ""
            findings.append(finding("spikes", dof, count=len(places), times=times))
    return findings


def spikes_of(x: RealArray) -> Array:
    """Return the spikes of x (N,): x[k] minus the mean of its neighbours is r, and -r / 2 at those."""
    if len(x) < 2 * _NEIGHBOURS:
        return np.zeros(0, dtype=int)
    r = x[1:-1] - (x[:-2] + x[2:]) / 2
    # of N differences of Gaussian noise the largest is below this many deviations but for one record in a thousand
    limit = _SPIKE_FACTOR * np.sqrt(2 * np.log(len(x) / _FALSE_ALARM))
    size = np.abs(r)
    # the median is as large as a number that half of all do not exceed: without sorting them
    if 2 * np.count_nonzero(size < size.max() / (limit * NORMAL)) < len(size) - 1:
        return np.zeros(0, dtype=int)
    rough = np.flatnonzero(size[1:-1] > limit * NORMAL * np.median(size)) + 1
    places = []
    for k in rough:
        around = np.concatenate([r[max(k - _NEIGHBOURS, 0) : max(k - 1, 0)], r[k + 2 : k + 2 + _NEIGHBOURS]])
        single = np.abs(r[[k - 1, k + 1]] + r[k] / 2).max() < _SPIKE_TOLERANCE * abs(r[k])
        if single and abs(r[k]) > limit * np.sqrt(np.mean(around**2)):
            places.append(k + 1)
    return np.array(places, dtype=int)


def _in_words(stretches: list[tuple[int, int, int]], signals: Signals) -> str:
    r, a, b = max(stretches, key=lambda stretch: stretch[2] - stretch[1])
    run = f" of run {r + 1}" if signals.runs > 1 else ""
    where = f"{a / signals.sampling_rate:.6g} to {b / signals.sampling_rate:.6g} s{run}"
    total = sum(stop - start for _, start, stop in stretches)
    return f"{total} samples in {len(stretches)} stretches, the longest from {where}"
