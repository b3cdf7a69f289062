"""Check single samples: converters that overflowed, samples that are missing or hold their value, spikes.

Each rule asks for what a sound record of that length shows with a probability of 1e-3 at most, and for a pattern that vibration does
not make: jumps from one end of the range to the other, one channel that holds its value while it moved before, a single sample.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from scipy.special import pdtrc

from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.doctor.findings import channels_of, finding
from modalscope.doctor.prediction import FARTHEST, Joint, joints
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import NORMAL

# ---------------------------------------------------------------------------------------------------- isolated samples
# Samples that disagree with their neighbours in all channels: weak spikes, and numbers that overflowed.

#: How often Gaussian records of any length have one; an isolated sample exceeds that limit by this factor.
_LONE_BY_CHANCE, _LONE_MORE = 1e-3, 1.5

#: The errors around it, once it is subtracted, are below this part of it.
_RESIDUAL = 0.25

#: Samples on either side over which the usual error is computed.
_USUAL = 100


class Lone(NamedTuple):
    """An isolated sample: its value and the one expected from all others, relative to the mean of the channel."""

    run: int
    sample: int
    channel: int
    value: float
    expected: float


def lone_outputs(signals: Signals) -> list[Lone]:
    """Return the samples of the outputs that a number added to one sample explains, and a disturbance of the motion does not.

    With the inverse covariance W of p samples on either side, (W x)_k is the error of predicting sample k from its neighbours, in time and
    in the other channels, times W_kk: normal with variance W_kk, and of all linear tests for one added number the most powerful. A blow
    disturbs what follows: its size, in standard deviations of the prediction from the past, exceeds that of any such number.
    """
    outputs, _ = signals.by_run()
    found = []
    for channels, known in joints(outputs):
        size = np.std(outputs[:, :, channels], axis=(0, 1))
        for each in _isolated(known):
            i, scale = channels[each.channel], float(size[each.channel])
            found.append(Lone(each.run, each.sample, i, each.value * scale, each.expected * scale))
    return sorted(found)


def _isolated(known: Joint) -> list[Lone]:
    """Return the isolated samples of a group of channels, normalized to variance one."""
    p, l = known.depth, known.lags.shape[1]
    W = np.linalg.inv(known.within(2 * p + 1))[p * l : (p + 1) * l].reshape(l, 2 * p + 1, l)
    ahead = np.asarray(np.linalg.inv(known.within(p + 1))[p * l :].reshape(l, p + 1, l), dtype=float)
    root = np.sqrt(np.diagonal(W[:, p]))
    limit = _LONE_MORE * np.sqrt(2 * np.log(known.runs.shape[0] * known.runs.shape[1] * l / _LONE_BY_CHANCE))
    # errors at the times -p ... p of a number added to channel i at time 0
    pattern = W[:, ::-1].transpose(1, 0, 2) / root[:, None] / root
    found = []
    for r, run in enumerate(known.runs):
        z = sum(run[i : i + len(run) - 2 * p] @ W[:, i].T for i in range(2 * p + 1)) / root
        blow = _disturbance(run, ahead, p)[: len(z)]
        for k, i in np.argwhere(np.abs(z) > limit):
            if _explains(z, int(k), int(i), blow, pattern[:, :, i], limit):
                x = float(run[k + p, i])
                found.append(Lone(r, int(k) + p, int(i), x, x - float(z[k, i] / root[i])))
    return found


def _disturbance(run: RealArray, ahead: RealArray, p: int) -> RealArray:
    """Return e' S^-1 e of the prediction from the past at the samples p ..., the largest of three."""
    weighted = sum(run[i : i + len(run) - p] @ ahead[:, i].T for i in range(p + 1))
    size = np.sum(weighted * np.linalg.solve(ahead[:, p], np.asarray(weighted).T).T, axis=1)
    return np.asarray(scipy.ndimage.maximum_filter1d(size, 3))


def _explains(z: RealArray, k: int, i: int, blow: RealArray, pattern: RealArray, limit: float) -> bool:
    """Return whether a number at time k of channel i explains the errors z (N, l) around it, and a disturbance does not."""
    p = len(pattern) // 2
    first, last = max(k - p, 0), min(k + p + 1, len(z))
    own = abs(z[k, i])
    if own < np.abs(z[first:last]).max():
        return False
    residual = z[first:last] - z[k, i] * pattern[first - k + p : last - k + p]
    usual = NORMAL * float(np.median(np.abs(z[max(k - _USUAL, 0) : k + _USUAL, i])))
    return bool(own**2 > blow[k] and np.abs(residual).max() < _RESIDUAL * own and own > limit * usual)


# ----------------------------------------------------------------------------------------------------- missing samples
# Samples that are missing without a gap in the numbers: the past no longer agrees with what follows, but with what would follow later.

#: Past and future are compared in the canonical variates whose correlation exceeds this, so many at most.
_ALIKE, _PAIRS = 0.5, 24


class Slip(NamedTuple):
    """The first sample of a run after missing ones, and how many are missing, most likely."""

    run: int
    sample: int
    missing: int


def slips(signals: Signals, kind: str) -> list[Finding]:
    """Find times at which samples are missing from all channels, or clocks jumped, in random vibration: hits and sweeps begin at once."""
    outputs, _ = signals.by_run()
    places = jumps(outputs) if kind in ("random", "ambient") else []
    if not places:
        return []
    where = ", ".join(
        f"{place.sample / signals.sampling_rate:.6g} s" + (f" of run {place.run + 1}" if signals.runs > 1 else "")
        for place in places[:3]
    )
    where += ", ..." if len(places) > 3 else ""
    lost = int(np.median([place.missing for place in places]))
    return [finding("missing samples", *signals.output_dofs, count=len(places), lost=lost, where=where)]


def jumps(runs: RealArray) -> list[Slip]:
    """Return where samples of runs (R, N, l) are missing, the clearest first.

    u and v are the canonical variates of the p samples before and after a time: E u v' = C_0, diagonal, and C_g where g samples lie in
    between. The likelihood of (u, v) with C_g over that with C_0 exceeds x by chance with probability 1 / x at most,
    whatever else is estimated: its expectation is 1. Times at which that is less than 1e-3 over all times and g <= 60 are events. A blow
    is one, too: there v - C_0 u is large, with variances of its variates by maximum likelihood. The likelihood ratio of all events
    together must exceed 1e3 times the number of g. Their number of samples is common, or differs at an event whose ratio pays for it.

    `runs` (R, N, l).

    References
    ----------
    The likelihood ratio's bound is Markov's inequality; canonical variates as in Larimore, "Canonical variate analysis in
    identification, filtering, and adaptive control", 1990.
    """
    known = next((known for _, known in joints(runs)), None)
    if known is None:
        return []
    U, V, C = _variates(known)
    events = [(r, *event) for r, run in enumerate(known.runs) for event in _events(run, known, U, V, C)]
    if not events:
        return []
    ratios = np.array([ratio for _, _, ratio in events])  # logarithms, (events, g)
    penalty = np.log(ratios.shape[1])
    own = ratios.max(axis=1) - penalty
    total = np.maximum(ratios, own[:, None])
    usual = int(np.argmax(total.sum(axis=0)))
    if float(total[:, usual].sum()) - penalty < -np.log(_BY_CHANCE):
        return []
    lost = np.where(ratios[:, usual] >= own, usual, np.argmax(ratios, axis=1)) + 1
    order = np.argsort(-total[:, usual])
    return [Slip(events[i][0], events[i][1] + known.depth, int(lost[i])) for i in order]


def _variates(known: Joint) -> tuple[RealArray, RealArray, RealArray]:
    """Return the weights (p, l, n) of u in the past and of v in the future, and C_g for g = 0 ... FARTHEST."""
    p, l = known.depth, known.lags.shape[1]
    L = scipy.linalg.cholesky(known.within(p), lower=True)

    def whitened(M: Array) -> Array:
        half = scipy.linalg.solve_triangular(L, M, lower=True)
        return np.asarray(scipy.linalg.solve_triangular(L, half.T, lower=True).T)

    left, d, right = np.linalg.svd(whitened(known.between(0)))
    n = min(int(np.count_nonzero(d > _ALIKE)), _PAIRS)
    left, right = left[:, :n], right[:n].T
    C = np.array([left.T @ whitened(known.between(g)) @ right for g in range(FARTHEST + 1)])
    U, V = (scipy.linalg.solve_triangular(L, side, lower=True, trans=1).reshape(p, l, n) for side in (right, left))
    return U, V, C


def _events(run: RealArray, known: Joint, U: RealArray, V: RealArray, C: RealArray) -> list[tuple[int, RealArray]]:
    """Return the events of a run (N, l): time, and log likelihood ratios of g = 1, 2, ... missing samples over a blow."""
    if not C.shape[1]:
        return []
    p = known.depth
    count = len(run) - 2 * p + 1
    u = np.asarray(sum(run[i : i + count] @ U[i] for i in range(p)))
    v = np.asarray(sum(run[p + i : p + i + count] @ V[i] for i in range(p)))
    limit = np.log(len(known.runs) * count * (len(C) - 1) / _BY_CHANCE)
    w, Q = _spread(C[0])
    squares = ((v - u @ C[0].T) @ Q) ** 2
    # no log ratio exceeds half of this sum
    k = np.flatnonzero(np.sum(squares / w, axis=1) > 2 * limit)
    if not k.size:
        return []
    each = np.array([_likelihood(u[k], v[k], M) for M in C])
    free = np.maximum(w, squares[k])
    blow = -0.5 * np.sum(np.log(free) + squares[k] / free, axis=1)
    ratio = each[1:].max(axis=0) - each[0]
    found: list[tuple[int, RealArray]] = []
    for i in np.argsort(-ratio):
        if ratio[i] < limit:
            break
        if all(abs(k[i] - other) > FARTHEST for other, _ in found):
            found.append((int(k[i]), each[1:, i] - blow[i]))
    return found


def _spread(C: RealArray) -> tuple[RealArray, RealArray]:
    """Return the variances of v - C u and their directions."""
    w, Q = np.linalg.eigh(np.eye(len(C)) - C @ C.T)
    return np.maximum(w, 1e-6), Q


def _likelihood(u: RealArray, v: RealArray, C: RealArray) -> RealArray:
    """Return the log density of v given u, up to a constant."""
    w, Q = _spread(C)
    return np.asarray(-0.5 * np.sum(np.log(w)) - 0.5 * np.sum(((v - u @ C.T) @ Q) ** 2 / w, axis=1))


# ------------------------------------------------------------------------------------------- overflow, holding, spikes

#: How often a sound record of any length may have a finding.
_BY_CHANCE = 1e-3

#: An overflow joins the outer tenths of the range, where no signal but one of two levels spends most of its time.
_OUTER, _MOSTLY = 0.8, 0.6

#: A signal whose steps from or to the outer halves of its range are usually below this part of half that range is smooth.
_SMOOTH, _LOUD = 0.1, 0.5

#: Before and after a stretch of equal samples the channel moves by this part of its standard deviation, over so many samples.
_MOVES, _NEIGHBOURS = 0.1, 50

#: The shortest stretch of equal samples that is a finding.
_HOLDS = 8

#: The second differences next to a single spike are minus half of it, within this part.
_ALONE = 0.25

#: Samples on either side over which the usual difference is computed; a spike exceeds the largest of noise by this factor.
_NEAR, _MORE = 25, 1.5


def wrapped(signals: Signals, lone: Sequence[Lone] = ()) -> list[Finding]:
    """Find channels that jump from one end of their range to the other and go on from there: the converter overflowed.

    An isolated sample of an output counts, too, when it is at one end of the range and expected at the other.
    """
    found = []
    for i, (where, x) in enumerate(channels_of(signals)):
        places = {(r, int(k) + 1) for r, run in enumerate(x) for k in wraps(run)}
        places |= {(each.run, each.sample) for each in lone if each.channel == i and _across(each, x[each.run])}
        if places:
            found.append(finding("overflow", where, count=len(places)))
    return found


def _across(lone: Lone, x: RealArray) -> bool:
    """Return whether a sample is in one outer tenth of the range of its run x (N,), and is expected in the other."""
    low, high = float(x.min()), float(x.max())
    value, expected = (2 * (each + float(x.mean()) - low) / (high - low) - 1 for each in (lone.value, lone.expected))
    outer = value * expected < 0 and min(abs(value), abs(expected)) > _OUTER
    # a large spike sets the range by itself, and its expected value lies near the mean
    return bool(outer and abs(lone.expected) > abs(lone.value) / 2)


def wraps(x: RealArray) -> Array:
    """Return the samples k of x (N,) at which it jumps between the outer tenths of its range, where that is more than chance.

    Neighbours that are not correlated negatively lie in opposite tails at most as often as independent samples do (Slepian's
    inequality): N p q times, with p and q the parts of the samples in the two tails, of the N samples while there is vibration.
    """
    none = np.zeros(0, dtype=int)
    span, y = float(np.ptp(x)), x - np.mean(x)
    if len(x) < 4 or span == 0 or float(y[1:] @ y[:-1]) < 0:
        return none
    side = (x - x.min()) / span * 2 - 1
    high, low = side > _OUTER, side < -_OUTER
    if np.mean(high) + np.mean(low) > _MOSTLY:  # a signal of two levels
        return none
    jumps = np.flatnonzero((high[:-1] & low[1:]) | (low[:-1] & high[1:]))
    if not jumps.size:
        return none
    steps = np.abs(np.diff(side))
    loud = np.maximum(np.abs(side[1:]), np.abs(side[:-1])) > _LOUD
    loud[jumps] = False
    if float(np.median(steps[loud] if np.any(loud) else steps)) < _SMOOTH:  # no vibration crosses its range in one step
        return np.asarray(jumps, dtype=int)
    # bursts fill a part of the record: Gaussian samples of one size have mean y^4 = 3 (mean y^2)^2
    part = min(3 * float(np.mean(y**2)) ** 2 / float(np.mean(y**4)), 1.0)
    expected = 2 * len(x) * float(np.mean(high) * np.mean(low)) / part
    return np.asarray(jumps, dtype=int) if pdtrc(len(jumps) - 1, expected) < _BY_CHANCE else none


def frozen(signals: Signals) -> list[Finding]:
    """Find stretches in which a channel holds one value while it moves before and after: samples or the sensor were lost.

    Where equal neighbours are common, as in coarse steps, the stretch must be longer than chance makes one.
    """
    held = [(where, [(r, a, b) for r, run in enumerate(x) for a, b in holds(run)]) for where, x in channels_of(signals)]
    gaps = set.intersection(*(set(stretches) for _, stretches in held)) if len(held) > 1 else set()
    names = [where for where, stretches in held if stretches]
    found = [finding("gap", *names, stretches=_in_words(sorted(gaps), signals))] if gaps else []
    for where, stretches in held:
        own = [stretch for stretch in stretches if stretch not in gaps]
        if own:
            found.append(finding("frozen", where, stretches=_in_words(own, signals)))
    return found


def holds(x: RealArray) -> list[tuple[int, int]]:
    """Return (start, stop) of the stretches of equal samples of x (N,) that are longer than chance, with motion on either side."""
    size = float(np.std(x))
    if size == 0:
        return []
    equal = np.diff(x) == 0
    often = min(max(float(np.mean(equal)), 1 / len(x)), 0.99)
    longest = max(_HOLDS, int(np.log(_BY_CHANCE / len(x)) / np.log(often)) + 2)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], equal.astype(int), [0]])))
    found = []
    for a, b in zip(edges[::2], edges[1::2] + 1, strict=True):
        before, after = x[max(a - _NEIGHBOURS, 0) : a], x[b : b + _NEIGHBOURS]
        moving = len(before) >= 2 and len(after) >= 2 and min(np.std(before), np.std(after)) > _MOVES * size
        if b - a >= longest and moving:
            found.append((int(a), int(b)))
    return found


def spikes(signals: Signals, kind: str, but: Container[str] = (), lone: Sequence[Lone] = ()) -> list[Finding]:
    """Find isolated samples, but not in the force of a hammer, which is one by nature, nor in the channels `but`.

    Of the samples that only all channels together show (`lone`), two of a channel are needed: one changes no estimate measurably.
    """
    found = []
    for i, (where, x) in enumerate(channels_of(signals, inputs=kind != "impact")):
        weak = {(each.run, each.sample) for each in lone if each.channel == i}
        large = {(r, int(k)) for r, run in enumerate(x) for k in lone_samples(run)}
        places = [] if where in but else sorted(large | weak if len(weak) > 1 else large)
        if places:
            times = ", ".join(f"{k / signals.sampling_rate:.6g} s" for _, k in places[:3])
            times += ", ..." if len(places) > 3 else ""
            found.append(finding("spikes", where, count=len(places), times=times))
    return found


def lone_samples(x: RealArray) -> Array:
    """Return the isolated samples of x (N,): x[k] minus the mean of its neighbours is r, and -r / 2 at those."""
    if len(x) < 2 * _NEAR:
        return np.zeros(0, dtype=int)
    r = x[1:-1] - (x[:-2] + x[2:]) / 2
    # of N differences of Gaussian noise the largest is below this many deviations but for one record in a thousand
    limit = _MORE * np.sqrt(2 * np.log(len(x) / _BY_CHANCE))
    rough = np.flatnonzero(np.abs(r[1:-1]) > limit * NORMAL * np.median(np.abs(r))) + 1
    found = []
    for k in rough:
        near = np.concatenate([r[max(k - _NEAR, 0) : max(k - 1, 0)], r[k + 2 : k + 2 + _NEAR]])
        alone = np.abs(r[[k - 1, k + 1]] + r[k] / 2).max() < _ALONE * abs(r[k])
        if alone and abs(r[k]) > limit * np.sqrt(np.mean(near**2)):
            found.append(k + 1)
    return np.array(found, dtype=int)


def _in_words(stretches: list[tuple[int, int, int]], signals: Signals) -> str:
    r, a, b = max(stretches, key=lambda stretch: stretch[2] - stretch[1])
    run = f" of run {r + 1}" if signals.runs > 1 else ""
    where = f"{a / signals.sampling_rate:.6g} to {b / signals.sampling_rate:.6g} s{run}"
    total = sum(stop - start for _, start, stop in stretches)
    return f"{total} samples in {len(stretches)} stretches, the longest from {where}"
