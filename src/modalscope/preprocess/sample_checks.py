"""Faults of single samples: converters that overflowed, samples that are missing or hold, spikes.

Each rule asks for what a sound record of that length shows with a probability of 1e-3 at most, and for a pattern that vibration does
not make: jumps from one end of the range to the other, a value that holds while all others move, a sample that stands alone.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np
from scipy.special import pdtrc

from modalscope.model.checks import Array, RealArray
from modalscope.model.robust import NORMAL
from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding
from modalscope.preprocess.lone_checks import Lone

__all__ = ["frozen", "spikes", "wrapped"]

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
