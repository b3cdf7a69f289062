"""Find hammer hits in a record, check them for overloads and double hits, and cut them out."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.special import pdtrc

from modalscope.data.kind_of_test import NOISE_DEVIATIONS, PULSE_DEVIATIONS
from modalscope.data.shown import counted
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, BoolArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import NORMAL

#: Minimum height of a pulse relative to the highest peak.
_TRIGGER_LEVEL = 0.03

#: Minimum height of a second pulse relative to the first: of a double hit, and of what may be another hit.
_DOUBLE_HIT_HEIGHT, _NEW_HIT_HEIGHT = 0.1, 0.5

#: Minimum pause between hits relative to the longest one: in general, and before a pulse that is high enough for a hit.
_MIN_PAUSE, _MIN_PAUSE_OF_HIGH = 1 / 4, 1 / 20

#: Minimum distance of a hit from the one before it, relative to its length.
_MIN_DISTANCE = 1 / 4

#: Maximum peak of a hit over the median of all.
_MAX_PEAK_RATIO = 5.0

#: Minimum number of equal samples at the peak of an overloaded hit.
_MIN_PLATEAU = 3

#: Minimum number of samples at the limit of a converter: in all, and over that at the level before it.
_MIN_CLIPPED, _MIN_CLIPPED_RATIO = 3, 3

#: Steps of a converter below the last level from which its count is expected, and the probability of a larger one.
_CONVERTER_STEPS, _FALSE_ALARM = 10, 1e-4


class Hit(NamedTuple):
    """One hit of a record; an unfit one was recorded wrongly, a double one only has less force on some lines."""

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

    The window adds it to the decay of every mode. Give it to `FrequencyResponse(added_damping=...)`, so that poles identified from
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
        have = f"its end is {end!r}, its duration {duration!r} s"
        raise DataError("an exponential window:", have, "Give end between 0 and 1, and a positive duration.")
    return float(-np.log(end) / duration)


def clipped_samples(x: Array) -> int:
    """Return the number of clipped samples of x (N,): at its largest or smallest value, reached three times or more.

    Outer levels of a signal that is not clipped are rarer than inner ones. The count of the last level must have a probability of 1e-4 at
    most for independent values on the steps of a converter, given the mean of the steps before (Poisson's law). The level of a channel at
    rest is no limit.
    """
    if max(int(np.count_nonzero(x == x.max())), int(np.count_nonzero(x == x.min()))) < _MIN_CLIPPED:
        return 0  # without sorting the samples
    levels, counts = np.unique(x, return_counts=True)
    if levels.size < 3:
        return 0
    rest = float(np.median(x))
    upward = ((levels, counts, rest), (-levels[::-1], counts[::-1], -rest))
    return sum(int(c[-1]) for v, c, r in upward if v[-1] != r and _is_limit(v, c))


def _is_limit(levels: Array, counts: Array) -> bool:
    """Return whether the last of rising levels has more samples than expected from the steps before it."""
    last, before = int(counts[-1]), int(counts[-3:-1].max())
    if last < _MIN_CLIPPED or last < _MIN_CLIPPED_RATIO * before:
        return False
    step = float(np.min(np.diff(levels)))  # of the converter; levels without samples count, too
    near = levels > levels[-1] - (_CONVERTER_STEPS + 0.5) * step
    expected = float(counts[near][:-1].sum()) / _CONVERTER_STEPS
    return float(pdtrc(last - 1, max(expected, 1 / _CONVERTER_STEPS**2))) < _FALSE_ALARM


def _pulses(force: RealArray, peak: float) -> list[tuple[int, int]]:
    """Return (start, stop) of all stretches above the trigger level; short dips below it do not separate them."""
    rest = np.median(force)
    size = np.abs(force - rest)
    noise = NORMAL * float(np.median(size))  # the deviation of Gaussian noise, untouched by a few pulses
    above = np.flatnonzero(size > max(_TRIGGER_LEVEL * peak, PULSE_DEVIATIONS * noise))
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
        high = height[pulse] >= _NEW_HIT_HEIGHT * height[groups[-1][0]]
        if pause >= (_MIN_PAUSE_OF_HIGH if high else _MIN_PAUSE) * longest:
            groups.append([pulse])
        else:
            groups[-1].append(pulse)
    return groups


def find_hits(forces: RealArray) -> list[Hit]:
    """Return all hits in forces (R, N) of one hammer, with their faults.

    Overloaded: at least three equal samples at the peak, or a peak five times the median of three hits or more. Double: a
    second pulse of a tenth of the first or more before the next hit.
    """
    hits: list[Hit] = []
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
            reason, unfit = "", int(np.sum(force[start:stop] == peak)) >= _MIN_PLATEAU
            if unfit:
                reason = f"overloaded: the force stays at {peak:.4g} for several samples"
            elif later and max(later) >= _DOUBLE_HIT_HEIGHT * abs(peak):
                second = group[1 + int(np.argmax(later))][0] - start
                reason = f"double hit: a second pulse of {100 * max(later) / abs(peak):.0f} %, {second} samples later"
            hits.append(Hit(len(hits) + 1, run, start, stop, peak, reason, unfit))
    usual = float(np.median([abs(hit.peak) for hit in hits])) if len(hits) > 2 else np.inf
    for i, hit in enumerate(hits):
        if not hit.unfit and abs(hit.peak) > _MAX_PEAK_RATIO * usual:
            reason = f"overloaded: peak {hit.peak:.4g}, median of the hits {usual:.4g}"
            hits[i] = hit._replace(reason=reason, unfit=True)
    return hits


def between_hits(forces: RealArray, hits: list[Hit], least: float = 0.0) -> BoolArray:
    """Return where forces (R, N) of one hammer are nothing but noise, (R, N): farther from all that stands out of it than a pulse is long.

    What is smaller than `least` of the largest force counts as noise, too.

    Noise of the sensor there would count as force on all lines, as in H1 = S_yu / S_uu: noise of a hundredth of the peak, all along 4096
    samples, has a twentieth of the energy of a pulse of ten.
    """
    size = np.abs(forces - np.median(forces, axis=1, keepdims=True))
    noise = NOISE_DEVIATIONS * NORMAL * np.median(size, axis=1, keepdims=True)
    loud = size > np.maximum(noise, least * size.max(initial=0.0))
    reach = max((hit.stop - hit.start for hit in hits), default=0)
    return np.asarray(~binary_dilation(loud, np.ones((1, 2 * reach + 1), dtype=bool)))


def room_of(hits: list[Hit], samples: int, before: int) -> dict[int, int]:
    """Return the samples of every hit, by its number, from `before` ahead of it to the next hit or the end of its run."""
    starts = {hit.number: max(hit.start - before, 0) for hit in hits}
    ends = {a.number: starts[b.number] for a, b in itertools.pairwise(hits) if a.run == b.run}
    return {number: ends.get(number, samples) - start for number, start in starts.items()}


def whole_series(hits: list[Hit], room: dict[int, int]) -> list[Hit]:
    """Mark hits that would shorten all others as unfit: those close to the end of the record, and those soon after another.

    The others are the k hits with at least n samples each that have the largest k n; of equal ones the series of more hits. They begin at
    least a quarter of n after the hit before them.
    """
    since = {b.number: b.start - a.start for a, b in itertools.pairwise(hits) if a.run == b.run}
    good = [hit for hit in hits if not hit.unfit]

    def kept(length: int) -> list[Hit]:
        return [h for h in good if room[h.number] >= length and since.get(h.number, length) >= _MIN_DISTANCE * length]

    lengths = sorted({room[hit.number] for hit in good})
    best = max(lengths, key=lambda n: n * len(kept(n)), default=0)
    usable, series = kept(best), list(hits)
    for i, hit in enumerate(hits):
        if not hit.unfit and hit not in usable:
            length = room[hit.number]
            reason = "soon after the hit before it" if length >= best else f"{length} samples long, {best} are needed"
            series[i] = hit._replace(reason=reason, unfit=True)
    return series


def cut_hits(
    outputs: RealArray, inputs: RealArray, hits: list[Hit], room: dict[int, int], *, segment: int | None, before: int
) -> tuple[RealArray, RealArray]:
    """Return outputs (hits, n, l) and inputs (hits, n, m), each hit from `before` samples ahead of its trigger.

    n is the segment, by default the least `room` of the hits. Raises DataError without hits or room, and for a segment that reaches into
    the next hit or beyond the run.
    """
    if not hits:
        change = 'Give hits="all" to use the others, or another excitation.'
        raise DataError("frequency responses of hammer hits:", "the record has no usable hit", change)
    starts = [max(hit.start - before, 0) for hit in hits]
    least = min(hits, key=lambda hit: room[hit.number]).number
    length = room[least] if segment is None else check_count("segment", segment, least=2)
    if length > room[least]:
        asked = f"segment={length} for every hit:"
        have = f"hit {least} is followed by only {room[least]} samples before the next hit, or the end of the record"
        raise DataError(asked, have, f"Lower segment to at most {room[least]}, or leave that hit out.")
    if length < 2:
        have = f"before={before} leaves {counted(length, 'sample')}"
        raise DataError(f"hit {least}:", have, "Lower before, or leave it out.")
    y, u = (np.stack([x[h.run, s : s + length] for h, s in zip(hits, starts, strict=True)]) for x in (outputs, inputs))
    return y, u
