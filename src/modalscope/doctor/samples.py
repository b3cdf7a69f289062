"""Faults of single samples: converters that overflowed, samples that are missing or hold, spikes.

Each rule asks for what a sound record of that length shows with a probability of 1e-3 at most, and for a pattern that vibration does
not make: jumps from one end of the range to the other, a value that holds while all others move, a sample that stands alone.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from scipy.special import pdtrc

from modalscope.data.records import Signals
from modalscope.doctor.findings import Finding
from modalscope.doctor.prediction import FARTHEST, Joint, joints
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import NORMAL

__all__ = ["frozen", "jumps", "lone_outputs", "slips", "spikes", "wrapped"]


# --------------------------------------------------------------------------------------------------------- lone checks
# Samples that do not agree with those around them in any channel: weak spikes, and numbers that overflowed.

#: How often Gaussian records of any length have one; a sample stands out by so much more than that.
_LONE_BY_CHANCE, _LONE_MORE = 1e-3, 1.5

#: What is left around it once it is taken out is below this part of it.
_LEFT = 0.25

#: Samples on either side that say how large errors usually are.
_LONE_NEAR = 100


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
    limit = _LONE_MORE * np.sqrt(2 * np.log(known.runs.shape[0] * known.runs.shape[1] * l / _LONE_BY_CHANCE))
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
    usual = NORMAL * float(np.median(np.abs(z[max(k - _LONE_NEAR, 0) : k + _LONE_NEAR, i])))
    return bool(own**2 > blow[k] and np.abs(left).max() < _LEFT * own and own > limit * usual)


# --------------------------------------------------------------------------------------------------------- slip checks
# Samples that are missing without a gap in the numbers: the past no longer agrees with what follows, but with what would follow later.

#: Past and future are compared in the pairs of combinations that are correlated more than this, so many at most.
_ALIKE, _PAIRS = 0.5, 24


class Slip(NamedTuple):
    """A time at which samples are missing.

    Attributes
    ----------
    run, sample : int
        The first sample after it.
    missing : int
        How many, most likely.
    """

    run: int
    sample: int
    missing: int


def slips(signals: Signals, kind: str) -> list[Finding]:
    """Find times at which samples are missing from all channels, or clocks jumped.

    Parameters
    ----------
    signals : Signals
    kind : str
        Of the excitation; hits, bursts and sweeps begin at once and are not looked at.
    """
    outputs, _ = signals.by_run()
    places = jumps(outputs) if kind in ("random", "ambient") else []
    if not places:
        return []
    where = ", ".join(
        f"{place.sample / signals.sampling_rate:.6g} s" + (f" of run {place.run + 1}" if signals.runs > 1 else "")
        for place in places[:3]
    )
    more = ", ..." if len(places) > 3 else ""
    lost = int(np.median([place.missing for place in places]))
    return [
        Finding(
            "missing samples",
            signals.output_dofs,
            f"at {len(places)} times all channels go on as if some {lost} samples were missing: at {where}{more}",
            "Look for lost blocks or a clock that jumped; give the parts before and after as runs, merge([...]).",
        )
    ]


def jumps(runs: RealArray) -> list[Slip]:
    """Return where samples of runs (R, N, l) are missing, the clearest first.

    u and v are the canonical variates of the p samples before a time and of the p samples after it: E u v' = C_0, diagonal, and C_g where g
    samples lie in between. The likelihood of (u, v) with C_g over that with C_0 exceeds x by chance with probability 1 / x at most,
    whatever else is estimated: its expectation is 1. Times at which that is less than 1e-3 over all times and g <= 60 are events. A blow
    is one, too: there v - C_0 u is large, in some variates more than in others, and is given the variances that suit it best. All events
    together must speak for missing samples, by 1e3 times the number of g; their number may be the same at all events, or another, for
    which its own event pays that number.

    Parameters
    ----------
    runs : array, (R, N, l)

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
    gains = np.array([gain for _, _, gain in events])
    dear = np.log(gains.shape[1])
    own = gains.max(axis=1) - dear
    together = np.maximum(gains, own[:, None])
    usual = int(np.argmax(together.sum(axis=0)))
    if float(together[:, usual].sum()) - dear < -np.log(_BY_CHANCE):
        return []
    lost = np.where(gains[:, usual] >= own, usual, np.argmax(gains, axis=1)) + 1
    order = np.argsort(-together[:, usual])
    return [Slip(events[i][0], events[i][1] + known.depth, int(lost[i])) for i in order]


def _variates(known: Joint) -> tuple[RealArray, RealArray, RealArray]:
    """Return rows that make u of the past and v of the future (p, l, n), and C_g for g = 0 ... FARTHEST."""
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


def _sides(y: RealArray, p: int, U: RealArray, V: RealArray) -> tuple[RealArray, RealArray]:
    """Return u and v of every time of a run (N, l)."""
    count = len(y) - 2 * p + 1
    u = sum(y[i : i + count] @ U[i] for i in range(p))
    v = sum(y[p + i : p + i + count] @ V[i] for i in range(p))
    return np.asarray(u), np.asarray(v)


def _events(run: RealArray, known: Joint, U: RealArray, V: RealArray, C: RealArray) -> list[tuple[int, RealArray]]:
    """Return the events of a run (N, l): time, and logarithms of the likelihood of g = 1, 2, ... over that of a blow."""
    if not C.shape[1]:
        return []
    u, v = _sides(run, known.depth, U, V)
    bar = np.log(len(known.runs) * len(u) * (len(C) - 1) / _BY_CHANCE)
    w, Q = _spread(C[0])
    squares = ((v - u @ C[0].T) @ Q) ** 2
    # no ratio is larger than half of this
    k = np.flatnonzero(np.sum(squares / w, axis=1) > 2 * bar)
    if not k.size:
        return []
    each = np.array([_likelihood(u[k], v[k], M) for M in C])
    free = np.maximum(w, squares[k])
    blow = -0.5 * np.sum(np.log(free) + squares[k] / free, axis=1)
    ratio = each[1:].max(axis=0) - each[0]
    found: list[tuple[int, RealArray]] = []
    for i in np.argsort(-ratio):
        if ratio[i] < bar:
            break
        if all(abs(k[i] - other) > FARTHEST for other, _ in found):
            found.append((int(k[i]), each[1:, i] - blow[i]))
    return found


def _spread(C: RealArray) -> tuple[RealArray, RealArray]:
    """Return variances and directions of v - C u."""
    w, Q = np.linalg.eigh(np.eye(len(C)) - C @ C.T)
    return np.maximum(w, 1e-6), Q


def _likelihood(u: RealArray, v: RealArray, C: RealArray) -> RealArray:
    """Return the logarithm of the density of v where u is known, up to a constant."""
    w, Q = _spread(C)
    return np.asarray(-0.5 * np.sum(np.log(w)) - 0.5 * np.sum(((v - u @ C.T) @ Q) ** 2 / w, axis=1))


# ------------------------------------------------------------------------------------------------------- sample checks

#: How often a sound record of any length may be named.
_BY_CHANCE = 1e-3

#: A wrap joins the outer tenths of the range, where no signal but one of two levels spends most of its time.
_OUTER, _MOSTLY = 0.8, 0.6

#: A signal whose steps from or to the outer halves of its range are usually below this part of half that range is smooth.
_SMOOTH, _LOUD = 0.1, 0.5

#: Of an interval that holds, both neighbourhoods must move by this part of the channel's deviation; they have so many samples.
_MOVES, _BESIDE = 0.1, 50

#: The least stretch of equal samples that is worth a word.
_HOLDS = 8

#: A lone sample leaves half of its size with the other sign in the second differences beside it, within this part.
_ALONE = 0.25

#: Samples on either side that say how large differences usually are; a spike stands out by so many deviations more than chance.
_NEAR, _MORE = 25, 1.5


def wrapped(signals: Signals, lone: Sequence[Lone] = ()) -> list[Finding]:
    """Find channels that jump from one end of their range to the other and go on from there: the converter overflowed.

    Parameters
    ----------
    signals : Signals
    lone : sequence of Lone
        Outputs' samples that stand alone: one at an end of the range that all others expect at the other end overflowed, too.
    """
    found = []
    for i, (where, x) in enumerate(_channels(signals)):
        places = {(r, int(k) + 1) for r, run in enumerate(x) for k in wraps(run)}
        count = len(
            places | {(each.run, each.sample) for each in lone if each.channel == i and _across(each, x[each.run])}
        )
        if count:
            found.append(
                Finding(
                    "overflow",
                    (where,),
                    f"at {count} samples it jumps from one end of its range to the other, as a number that overflowed",
                    "Measure again with a wider range, or leave the channel out.",
                )
            )
    return found


def _across(lone: Lone, x: RealArray) -> bool:
    """Say whether a sample lies in one outer tenth of the range of its run x (N,), and is expected as far on the other side."""
    low, high = float(x.min()), float(x.max())
    value, expected = (2 * (each + float(x.mean()) - low) / (high - low) - 1 for each in (lone.value, lone.expected))
    outer = value * expected < 0 and min(abs(value), abs(expected)) > _OUTER
    # a large spike makes the range by itself, and what is expected there lies near the mean
    return bool(outer and abs(lone.expected) > abs(lone.value) / 2)


def wraps(x: RealArray) -> Array:
    """Return the samples k of x (N,) at which it jumps between the outer tenths of its range, where that is more than chance.

    Neighbours that are not correlated negatively lie in opposite tails at most as often as independent samples do (Slepian's
    inequality): N p q times, with p and q the parts of the samples in the two tails, of the N samples while there is vibration.

    Parameters
    ----------
    x : array, (N,)
    """
    none = np.zeros(0, dtype=int)
    span, y = float(np.ptp(x)), x - np.mean(x)
    if len(x) < 4 or span == 0 or float(y[1:] @ y[:-1]) < 0:
        return none
    side = (x - x.min()) / span * 2 - 1
    high, low = side > _OUTER, side < -_OUTER
    if np.mean(high) + np.mean(low) > _MOSTLY:  # a signal of two levels lives at its ends
        return none
    jumps = np.flatnonzero((high[:-1] & low[1:]) | (low[:-1] & high[1:]))
    if not jumps.size:
        return none
    steps = np.abs(np.diff(side))
    loud = np.maximum(np.abs(side[1:]), np.abs(side[:-1])) > _LOUD
    loud[jumps] = False
    if float(np.median(steps[loud] if np.any(loud) else steps)) < _SMOOTH:  # no vibration crosses its range in one step
        return np.asarray(jumps, dtype=int)
    # bursts live in a part of the record: Gaussian samples of one size have mean y^4 = 3 (mean y^2)^2
    part = min(3 * float(np.mean(y**2)) ** 2 / float(np.mean(y**4)), 1.0)
    expected = 2 * len(x) * float(np.mean(high) * np.mean(low)) / part
    return np.asarray(jumps, dtype=int) if pdtrc(len(jumps) - 1, expected) < _BY_CHANCE else none


def frozen(signals: Signals) -> list[Finding]:
    """Find stretches in which a channel holds one value while it moves before and after: samples were lost, or the sensor was.

    Where equal neighbours are common, as in coarse steps, the stretch must be longer than chance makes one.
    """
    names, held = [], []
    channels = _channels(signals)
    for where, x in channels:
        stretches = [(r, a, b) for r, run in enumerate(x) for a, b in holds(run)]
        if stretches:
            names.append(where)
            held.append(stretches)
    gaps = set(held[0]).intersection(*held[1:]) if len(held) == len(channels) > 1 else set()
    found = [] if not gaps else [_hold("gap", tuple(names), sorted(gaps), signals)]
    for where, stretches in zip(names, held, strict=True):
        own = [stretch for stretch in stretches if stretch not in gaps]
        if own:
            found.append(_hold("frozen", (where,), own, signals))
    return found


def holds(x: RealArray) -> list[tuple[int, int]]:
    """Return (start, stop) of the stretches of equal samples of x (N,) that are longer than chance, motion on either side.

    Parameters
    ----------
    x : array, (N,)
    """
    size = float(np.std(x))
    if size == 0:
        return []
    equal = np.diff(x) == 0
    often = min(max(float(np.mean(equal)), 1 / len(x)), 0.99)
    longest = max(_HOLDS, int(np.log(_BY_CHANCE / len(x)) / np.log(often)) + 2)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], equal.astype(int), [0]])))
    found = []
    for a, b in zip(edges[::2], edges[1::2] + 1, strict=True):
        before, after = x[max(a - _BESIDE, 0) : a], x[b : b + _BESIDE]
        moving = len(before) >= 2 and len(after) >= 2 and min(np.std(before), np.std(after)) > _MOVES * size
        if b - a >= longest and moving:
            found.append((int(a), int(b)))
    return found


def spikes(signals: Signals, kind: str, but: Container[str] = (), lone: Sequence[Lone] = ()) -> list[Finding]:
    """Find single samples that stand alone; the force of a hammer is a spike by nature.

    Parameters
    ----------
    signals : Signals
    kind : str
        Of the excitation.
    but : container of str
        Channels that are not looked at: those that jump for another reason.
    lone : sequence of Lone
        Outputs' samples that stand alone beside all channels: two of one channel are spikes, one changes nothing that could be measured.
    """
    found = []
    for i, (where, x) in enumerate(_channels(signals, inputs=kind != "impact")):
        weak = {(each.run, each.sample) for each in lone if each.channel == i}
        large = {(r, int(k)) for r, run in enumerate(x) for k in lone_samples(run)}
        places = [] if where in but else sorted(large | weak if len(weak) > 1 else large)
        if places:
            times = ", ".join(f"{k / signals.sampling_rate:.6g} s" for _, k in places[:3]) + (
                ", ..." if len(places) > 3 else ""
            )
            found.append(
                Finding(
                    "spikes",
                    (where,),
                    f"{len(places)} single samples stand far out, at {times}",
                    "Look for a loose contact; replace these samples by the mean of their neighbours, or leave the channel out.",
                )
            )
    return found


def lone_samples(x: RealArray) -> Array:
    """Return the samples of x (N,) that stand alone: x[k] minus the mean of its neighbours is r, and -r / 2 on either side of it.

    Parameters
    ----------
    x : array, (N,)
    """
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


def _channels(signals: Signals, *, inputs: bool = True) -> list[tuple[str, list[RealArray]]]:
    """Return every channel with its label, run by run."""
    outputs, forces = signals.by_run()
    sides = [(outputs, signals.output_dofs)]
    if forces is not None and inputs:
        sides.append((forces, signals.input_dofs))
    return [(dof, [run[:, i] for run in runs]) for runs, labels in sides for i, dof in enumerate(labels)]


def _hold(kind: str, channels: tuple[str, ...], stretches: list[tuple[int, int, int]], signals: Signals) -> Finding:
    r, a, b = max(stretches, key=lambda stretch: stretch[2] - stretch[1])
    run = f" of run {r + 1}" if signals.runs > 1 else ""
    where = f"{a / signals.sampling_rate:.6g} to {b / signals.sampling_rate:.6g} s{run}"
    total = sum(stop - start for _, start, stop in stretches)
    words = "all channels hold their values" if kind == "gap" else "it holds one value"
    return Finding(
        kind,
        channels,
        f"{words} over {total} samples in {len(stretches)} stretches, the longest from {where}, while there is motion before and after",
        "Cut the record there: give the parts before and after as runs, merge([...]).",
    )
