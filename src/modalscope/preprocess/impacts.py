"""Find hammer hits in a record, check them for overloads and double hits, and cut them out."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.special import pdtrc

from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import NORMAL

#: A pulse exceeds this part of the highest peak, and this many standard deviations of the noise.
_TRIGGER, _ABOVE_NOISE = 0.03, 15.0

#: A second pulse of this part of the first is a double hit; of this part it may be another hit.
_SECOND, _EQUAL = 0.1, 0.5

#: Pauses of this part of the longest one separate hits; shorter ones, of this part, do before a pulse that is large enough to be a hit.
_PAUSE, _QUICK = 1 / 4, 1 / 20

#: A hit is free of the one before it when this part of its length has passed since.
_SINCE = 1 / 4

#: A hit this many times stronger than the median of all is not one of the same series.
_OUTLIER = 5.0

#: Equal consecutive samples at the peak of a hit that are no chance.
_PLATEAU = 3

#: The limit of a converter is reached this often at least, and this many times as often as the level before it.
_OFTEN, _MORE = 3, 3

#: Steps of a converter below the last level from which its count is expected, and the probability of a larger one.
_STEPS, _BY_CHANCE = 10, 1e-4

#: An impact puts this part of its energy into this part of the record.
_ENERGY, _PART = 0.95, 0.05


class Hit(NamedTuple):
    """One hit of a record: an unfit one was recorded wrongly, a double one only puts less force into some lines."""

    number: int  # from 1 over all runs
    run: int  # from 0
    start: int  # the first sample above the trigger
    stop: int  # the one after the first pulse
    peak: float  # largest force of the first pulse, with its sign
    reason: str = ""  # its fault in words
    unfit: bool = False


@named()
def exponential_decay(end: float, duration: float) -> float:
    """Return the decay rate in 1/s of an exponential window that falls from 1 to `end` in `duration` seconds.

    The window adds it to the decay of every mode. `FrequencyResponse(added_damping=...)` takes it, so that poles identified from
    windowed responses, of other programs too, are shifted back.

    Parameters
    ----------
    end : float
        What the window falls to, above 0 and at most 1.
    duration : float
        Seconds from 1 to `end`.

    Raises
    ------
    DataError
        An end outside (0, 1], a duration that is not above zero.

    Examples
    --------
    >>> round(exponential_decay(0.01, 2.0), 4)
    2.3026
    """
    if not (0 < end <= 1 and duration > 0):
        raise DataError(
            "an exponential window from 1 to a smaller value was asked",
            f"its end is {end!r}, its duration {duration!r} s",
            "Give end between 0 and 1, such as 0.01, and a duration in seconds.",
        )
    return float(-np.log(end) / duration)


def is_impact(force: Array) -> bool:
    """Whether a force (N,) has nearly all of its energy in a few samples: 95 % in 5 %."""
    energy = np.sort(np.square(force - np.median(force)))[::-1]
    count = max(1, int(_PART * energy.size))
    total = float(energy.sum())
    return total > 0 and float(energy[:count].sum()) > _ENERGY * total


def clipped_samples(x: Array) -> int:
    """Return the number of clipped samples of x (N,): at its largest or smallest value, reached three times or more.

    Outer levels of a signal that is not clipped are rarer than inner ones. The count of the last level must have a probability of 1e-4 at
    most for independent values on the steps of a converter, given the mean of the steps before (Poisson's law). The level of a channel at
    rest is no limit.
    """
    levels, counts = np.unique(x, return_counts=True)
    if levels.size < 3:
        return 0
    rest = float(np.median(x))
    upward = ((levels, counts, rest), (-levels[::-1], counts[::-1], -rest))
    return sum(int(c[-1]) for v, c, r in upward if v[-1] != r and _is_limit(v, c))


def _is_limit(levels: Array, counts: Array) -> bool:
    """Return whether the last of rising levels has more samples than expected from the steps before it."""
    last, before = int(counts[-1]), int(counts[-3:-1].max())
    if last < _OFTEN or last < _MORE * before:
        return False
    step = float(np.min(np.diff(levels)))  # of the converter; levels without samples count, too
    near = levels > levels[-1] - (_STEPS + 0.5) * step
    expected = float(counts[near][:-1].sum()) / _STEPS
    return float(pdtrc(last - 1, max(expected, 1 / _STEPS**2))) < _BY_CHANCE


def _pulses(force: RealArray, peak: float) -> list[tuple[int, int]]:
    """Return (start, stop) of all stretches above the trigger level; short dips below it do not separate them."""
    rest = np.median(force)
    size = np.abs(force - rest)
    noise = NORMAL * float(np.median(size))  # the deviation of Gaussian noise, untouched by a few pulses
    above = np.flatnonzero(size > max(_TRIGGER * peak, _ABOVE_NOISE * noise))
    stretches = np.split(above, np.flatnonzero(np.diff(above) > 3) + 1)
    return [(int(stretch[0]), int(stretch[-1]) + 1) for stretch in stretches if stretch.size]


def _grouped(pulses: list[tuple[int, int]], force: RealArray) -> list[list[tuple[int, int]]]:
    """Group pulses into hits: a pulse starts a new hit when the pause before it is a quarter of the longest pause or more.

    After shorter pauses, of a twentieth at least, it does so with half the height of the hit before: a bounce is weaker.
    """
    pauses = [b[0] - a[1] for a, b in itertools.pairwise(pulses)]
    longest = max([*pauses, force.size - pulses[-1][1]])
    height = {pulse: float(np.abs(force[slice(*pulse)]).max()) for pulse in pulses}
    groups = [[pulses[0]]]
    for pulse, pause in zip(pulses[1:], pauses, strict=True):
        equal = height[pulse] >= _EQUAL * height[groups[-1][0]]
        if pause >= (_QUICK if equal else _PAUSE) * longest:
            groups.append([pulse])
        else:
            groups[-1].append(pulse)
    return groups


def find_hits(forces: RealArray) -> list[Hit]:
    """Return all hits in forces (R, N) of one hammer, with their faults.

    Overloaded: at least three equal samples at the peak, or a peak five times the median of three hits or more. Double: a
    second pulse of a tenth of the first or more before the next hit.
    """
    found: list[Hit] = []
    typical = float(np.median(np.abs(forces - np.median(forces, axis=1, keepdims=True)).max(axis=1)))
    for run, force in enumerate(forces):
        force = force - np.median(force)
        pulses = _pulses(force, typical)
        if not pulses:
            continue
        for group in _grouped(pulses, force):
            start, stop = group[0]
            place = start + int(np.argmax(np.abs(force[start:stop])))
            peak = float(force[place])
            later = [float(np.abs(force[a:b]).max()) for a, b in group[1:]]
            reason, unfit = "", False
            if int(np.sum(force[start:stop] == peak)) >= _PLATEAU:
                reason = f"overloaded: the force stays at {peak:.4g} for several samples"
                unfit = True
            elif later and max(later) >= _SECOND * abs(peak):
                second = group[1 + int(np.argmax(later))][0] - start
                reason = f"double hit: a second pulse of {100 * max(later) / abs(peak):.0f} %, {second} samples later"
            found.append(Hit(len(found) + 1, run, start, stop, peak, reason, unfit))
    if len(found) < 3:
        return found
    usual = float(np.median([abs(hit.peak) for hit in found]))
    reason = f"overloaded: a peak of {{:.4g}} where the others have {usual:.4g}"
    return [
        hit._replace(reason=reason.format(hit.peak), unfit=True)
        if not hit.unfit and abs(hit.peak) > _OUTLIER * usual
        else hit
        for hit in found
    ]


def room_of(hits: list[Hit], samples: int, before: int) -> dict[int, int]:
    """Return the samples of every hit, by its number, from `before` ahead of it to the next hit or the end of its run."""
    starts = {hit.number: max(hit.start - before, 0) for hit in hits}
    ends = {a.number: starts[b.number] for a, b in itertools.pairwise(hits) if a.run == b.run}
    return {number: ends.get(number, samples) - start for number, start in starts.items()}


def whole_series(hits: list[Hit], room: dict[int, int]) -> list[Hit]:
    """Mark hits that would shorten all others: the last before the record ends, and those soon after another.

    The rest are the k hits with at least n samples each that have the largest k n; of equal ones the series of more hits. They begin at
    least a quarter of n after the hit before them.
    """
    since = {b.number: b.start - a.start for a, b in itertools.pairwise(hits) if a.run == b.run}
    good = [hit for hit in hits if not hit.unfit]

    def kept(length: int) -> list[Hit]:
        return [h for h in good if room[h.number] >= length and since.get(h.number, length) >= _SINCE * length]

    lengths = sorted({room[hit.number] for hit in good})
    best = max(lengths, key=lambda n: n * len(kept(n)), default=0)
    usable = kept(best)
    soon = "soon after the hit before it"
    reasons = {
        n: soon if length >= best else f"{length} samples long, where {best} are cut" for n, length in room.items()
    }
    return [h if h in usable or h.unfit else h._replace(reason=reasons[h.number], unfit=True) for h in hits]


def cut_hits(
    outputs: RealArray, inputs: RealArray, hits: list[Hit], room: dict[int, int], *, segment: int | None, before: int
) -> tuple[RealArray, RealArray]:
    """Return outputs (hits, n, l) and inputs (hits, n, m), each hit from `before` samples ahead of its trigger.

    n is the segment, by default the least `room` of the hits. Raises DataError without hits, and for a segment that reaches into the next
    hit or beyond the run.
    """
    if not hits:
        raise DataError(
            "frequency responses of hammer hits were asked",
            "no usable hit is in the record",
            'Give hits="all" to use the others, or another excitation.',
        )
    starts = [max(hit.start - before, 0) for hit in hits]
    least = min(hits, key=lambda hit: room[hit.number]).number
    length = room[least] if segment is None else check_count("segment", segment, least=2)
    if length > room[least]:
        raise DataError(
            f"segments of {length} samples for every hit were asked",
            f"hit {least} has {room[least]} before the next one or the end",
            f"Lower segment to at most {room[least]}, or leave that hit out.",
        )
    y, u = (np.stack([x[h.run, s : s + length] for h, s in zip(hits, starts, strict=True)]) for x in (outputs, inputs))
    return y, u
