"""The table of findings: every fault of measured data with its text and its remedy; checks of dead and of identical channels."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from string import Formatter
from typing import Any

import numpy as np

from modalscope.data.notes import Finding
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.setups import Setups
from modalscope.data.shown import figures
from modalscope.data.sizes import constant_channels
from modalscope.numerics.checks import Array, RealArray

#: One side of the data: "output" or "input", its channels as columns (N, c), and their labels.
Side = tuple[str, Array, tuple[str, ...]]

_EXCLUDE = "Check cable and sensor, or leave it out: --exclude {channels[0]!r}."
_AS_RUNS = "Give the parts before and after as runs: merge([...])."
_ALIGNED = "Identification shifts these outputs back (its --delays {given}; to keep the delays: --delays none)."

#: Reason and remedy of every kind of finding; rows of one kind differ in what follows the colon.
ROWS = {
    "overload": ("hit {number}: {reason}", "estimate_frf excludes it."),
    "double hit": (
        "hit {number}: {reason}",
        "It is used, as its force is recorded; hits={others} leaves it out."),
    "clipped": (
        "{count} samples at its largest or smallest value{where}",
        "Measure again with a wider range, or leave these runs or this channel out."),
    "dead": ("it never changes", _EXCLUDE),
    "dead: force": ("it never changes", "Taken as no force. Check cable and sensor if it was to be one."),
    "noisy: coherence": (
        "{percent:.0f} % of its power is predicted by {source}, {usual:.0f} % is the median of the channels",
        _EXCLUDE),
    "noisy: unexplained": (
        "{percent:.0f} % of its power is predicted by no other sample of any channel, {usual:.2g} % is the median of the channels",
        _EXCLUDE),
    "duplicate": (
        "{channels[1]} is {factor:.6g} times {channels[0]}, to rounding",
        "Leave one out if it was recorded twice; a symmetric structure without noise does it, too."),
    "swapped: run": ("exchanged in run {run}", "Exchange them in that run, or leave the run out."),
    "swapped: driving point": (
        "driving-point response has resonances of both signs",
        "Check which channel was at the force, the directions, and the quantity."),
    "swapped: reciprocity": (
        "reciprocal only if the two outputs are exchanged",
        "Exchange the labels of these two outputs."),
    "polarity: run": ("opposite sign in run {run}", "Change its sign in that run, or leave the run out."),
    "polarity: driving point": (
        "driving-point response has the wrong sign: force or sensor reversed",
        "Change the sign of {channels[0]} or of its force; or correct the quantity, {quantity}."),
    "polarity: reciprocity": (
        "opposite sign of the reciprocal response: {pairs}",
        "Change its sign, or that of its force."),
    "polarity: one of several": (
        "opposite sign of the reciprocal response: {pairs}",
        "Compare these sensors, and change the sign of one or of its force."),
    "leakage": (
        "{percent:.0f} % of its largest vibration remains at the end of the {what}",
        "{longer}, or give exponential=0.01, which is corrected for in the damping. "
        "Free decays after hits (route decays) and lines of whole records (route records) have no leakage."),
    "low coherence": (
        "coherence {explained:.2f} at its resonances",
        "Look for overloaded hits, noise, short segments, or forces that were not measured (then leave out those that were)."),
    "reciprocity": (
        "reciprocal responses differ by {percent:.0f} %",
        "Check labels, directions and calibration of these points; nonlinear structures do it, too."),
    "wrong quantity": (
        "given as {given}, looks like {better}: {why}",
        'Give quantity="{better}" if that was measured.'),
    "short record: decay": (
        "{seconds:.4g} s are {count:.1f} decay times of the resonance at {frequency:.4g} Hz (damping near {damping:.2g} %)",
        "Measure {needed:.4g} s or more: damping scatters by some {scatter:.0f} %."),
    "few lines": (
        "the forces have power at {where} Hz alone: modes elsewhere act on the start of a run only",
        "Drive with noise, a sweep or hits."),
    "short record: lines": (
        "the resonances at {where} Hz are narrower than {resolved:.1f} lines of {step:.3g} Hz",
        "Measure longer, use longer segments, or an exponential window for hits."),
    "overflow": (
        "{count} jumps from one end of its range to the other: the converter overflowed",
        "Measure again with a wider range, or leave the channel out."),
    "frozen": ("constant over {stretches}, with motion before and after", _AS_RUNS),
    "gap": ("all channels constant over {stretches}, with motion before and after", _AS_RUNS),
    "spikes": (
        "{count} samples far outside all others (spikes), at {times}",
        "Look for a loose contact; replace these samples by the mean of their neighbours, or leave the channel out."),
    "transposed": (
        "{count} channels of {samples} samples",
        "Exchange rows and columns: samples come first, outputs=y.T."),
    "conjugated": (
        "phases rise along the resonances: energy arrives before the impulse",
        "Take the complex conjugates (time convention exp(-j w t)): --conjugate."),
    "no phase: magnitudes": ("all values are real: magnitudes without phase", "Give magnitude times exp(j phase)."),
    "no phase: decibels": (
        "values look like decibels without phase",
        "Give complex values, 10^(dB / 20) exp(j phase)."),
    "lone lines": (
        "{count} outlying lines in every pair, at {where} Hz",
        "Look for mains or an edited line; leave these lines out: response.at_lines(...)."),
    "exchanged": (
        "the output {outputs} precedes the input {inputs}: force and response exchanged",
        "Exchange them: the force belongs to the inputs, columns='in=...,out=...'."),
    "delay: all": ("all outputs are delayed by {samples} samples, {seconds:.4g} s, after the forces", _ALIGNED),
    "delay: one": (
        "delayed by {samples} samples ({seconds:.4g} s) against the forces; the other outputs are not",
        _ALIGNED),
    "delay: phase": (
        "{size:.4g} s, {samples:.3g} samples, {side} than most other outputs",
        "Look for another filter or recorder; shift it with --delays {given}, or leave it out: --exclude {channels[0]!r}."),
    "delay: part": (
        "{size:.4g} s, {samples:.3g} samples, {side} than most other outputs",
        "Look for another filter or recorder; shift it by {seconds:.4g} s, or leave it out: --exclude {channels[0]!r}."),
    "missing samples": (
        "some {lost} samples are missing in all channels at {count} times: {where}",
        "Look for lost blocks or a clock that jumped. " + _AS_RUNS),
    "no complex values: parts": (
        "imaginary parts are phases in {unit} (within +-{limit:.6g}, {jumps} jumps from end to end), real parts {kind}",
        "Give {magnitude} exp(j {angle})."),
    "no complex values: turned": (
        "{percent:.0f} % of the phases are near +-{limit:.0f} degrees, that is 180 with degrees taken for radians",
        "Give magnitude exp(j radians(phase))."),
    "no complex values: rough": (
        "phases jump from line to line, magnitudes do not: degrees taken for radians",
        "Give magnitude exp(j radians(phase))."),
    "no complex values: levels": (
        "magnitudes lie between {low:.3g} and {high:.3g} and are small at resonances: levels in dB",
        "Give 10^(dB / 20) exp(j phase)."),
    "places": (
        "runs {runs} look like {count} drive points",
        "Give every place a file, or its own label: input_dofs."),
    "changed: channel": (
        "the other channels predict {first:.0f} % of its power in the first half of the record, {second:.0f} % in the second",
        "Look for a broken cable or a sensor that fell off; use one half, or leave the channel out: --exclude {channels[0]!r}."),
    "changed: all": (
        "each half is predicted {factor:.2g} times less well by the other than by itself",
        "Look for two tests in one file, or sensors that were moved. " + _AS_RUNS),
    "clock": (
        "its clock is {rate:.0f} millionths too {side} against most other channels",
        "Record all channels with one clock, or resample this one; shorter parts of the record suffer less."),
    "repeated": (
        "{second} repeats {first}, sample by sample",
        "Leave one of both out: it adds nothing, and deviations become too small."),
    "drift": (
        "{percent:.0f} % of its power lies below {limit:.3g} Hz, {usual:.2g} % is the median of the channels",
        "Look for temperature or an unsettled sensor, and choose a band above: band=(f1, f2)."),
    "event": (
        "{share:.0f} % of the power lies between {start:.4g} and {stop:.4g} s: averages are worth {worth:.3g} s of steady vibration",
        "Cut the event out. " + _AS_RUNS + " Or identify it alone, a free decay{release}, by the role decay (such as columns "
        "time=1,decay=2-), or ImpulseResponse(..., kind='free decay')."),
}  # fmt: skip

#: All kinds of findings.
KINDS = tuple(dict.fromkeys(name.partition(":")[0] for name in ROWS))

#: Channels that are copied together, and samples at a time: eight numbers are a line of the cache, and so many lines stay in it.
_CHANNELS_AT_A_TIME, _SAMPLES_AT_A_TIME = 8, 1024

#: Minimum samples of a run that is thinned out.
_MAX_THINNED = 1 << 14

#: Maximum difference of a channel from a multiple of its duplicate, as a part of it.
_DUPLICATE = 1e-6


class _Texts(Formatter):
    """Write numbers of `.3g` without an exponent, as all texts do."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return a number or text in its form."""
        return figures(value, int(format_spec[1:-1])) if format_spec.endswith("g") else format(value, format_spec)


def finding(name: str, *channels: str, at: Iterable[float] = (), **measured: Any) -> Finding:
    """Return the finding of a row of the table, with what was measured in its texts, and its frequencies `at` (Hz).

    Examples
    --------
    >>> print(finding("dead", "y2"))
    dead: y2: it never changes. Check cable and sensor, or leave it out: exclude=['y2'].
    """
    reason, change = (_Texts().format(text, channels=channels, **measured) for text in ROWS[name])
    return Finding(name.partition(":")[0], channels, reason, change, tuple(map(float, at)))


def sides_of(data: Signals | Records | Setups | Response) -> list[Side]:
    """Return outputs and inputs, if any, as columns (N, c): samples or lines, runs and channels of the other side stacked.

    Examples
    --------
    >>> [
    ...     (side, x.shape)
    ...     for side, x, _ in sides_of(Signals(outputs=np.ones((9, 3)), inputs=np.ones((9, 2)), sampling_rate=1.0))
    ... ]
    [('output', (9, 3)), ('input', (9, 2))]
    """
    if isinstance(data, Records):
        return _sides_of_runs(data)
    if isinstance(data, Setups):
        return [side for part in data.parts for side in sides_of(part)]
    both = (data.outputs, data.inputs) if isinstance(data, Signals) else (data.values.swapaxes(1, 2), data.values)
    named = zip(("output", "input"), both, (data.output_dofs, data.input_dofs), strict=True)
    return [(side, x.reshape(-1, x.shape[-1]), labels) for side, x, labels in named if x is not None and x.shape[-1]]


def _sides_of_runs(records: Records) -> list[Side]:
    """Return the sides of stacked runs; an input that a run does not have is zero in it."""
    outputs = np.concatenate([run.outputs for run in records.runs])
    inputs = np.zeros((len(outputs), len(records.input_dofs)))
    starts = np.cumsum([0, *records.samples])
    for r, run in enumerate(records.runs):
        if run.inputs is not None:
            inputs[starts[r] : starts[r + 1], list(records.inputs_of(r))] = run.inputs
    sides: list[Side] = [("output", outputs, records.output_dofs), ("input", inputs, records.input_dofs)]
    return [side for side in sides if side[1].shape[1]]


def channels_of(signals: Signals, *, inputs: bool = True) -> Iterator[tuple[str, list[RealArray]]]:
    """Yield every channel with its label, run by run, those of the inputs last: copies, whose samples lie side by side."""
    outputs, forces = signals.by_run()
    sides = [(outputs, signals.output_dofs)]
    if forces is not None and inputs:
        sides.append((forces, signals.input_dofs))
    for runs, labels in sides:
        for first in range(0, len(labels), _CHANNELS_AT_A_TIME):
            together = [_side_by_side(run[:, first : first + _CHANNELS_AT_A_TIME]) for run in runs]
            for i, dof in enumerate(labels[first : first + _CHANNELS_AT_A_TIME]):
                yield dof, [rows[i] for rows in together]


def _side_by_side(columns: RealArray) -> RealArray:
    """Return columns (N, c) as rows whose samples lie side by side."""
    rows = np.empty(columns.shape[::-1])
    for start in range(0, len(columns), _SAMPLES_AT_A_TIME):
        rows[:, start : start + _SAMPLES_AT_A_TIME] = columns[start : start + _SAMPLES_AT_A_TIME].T
    return rows


def thinned(signals: Signals) -> Signals:
    """Return every second, third ... sample of the outputs of a long record: enough for what they have in common at one time."""
    outputs, _ = signals.by_run()
    few = outputs[:, :: max(signals.samples // _MAX_THINNED, 1)]
    return Signals(outputs=few if len(few) > 1 else few[0], sampling_rate=signals.sampling_rate)


def dead_channels(samples: Array, labels: Sequence[str], *, forces: bool = False) -> list[Finding]:
    """Find channels (N, c) that are constant, but for the rounding of their values; `forces`: of a record, analysed without these."""
    return [finding("dead: force" if forces else "dead", labels[i]) for i in constant_channels(samples)]


def identical_channels(samples: Array, labels: Sequence[str]) -> list[Finding]:
    """Find channels (N, c) that are multiples of an earlier one to 1e-6; constant channels are skipped."""
    x = np.concatenate([samples.real, samples.imag]) if np.iscomplexobj(samples) else np.asarray(samples, dtype=float)
    mean = x.mean(axis=0)
    g = np.random.default_rng(0).standard_normal(len(x))
    power, place = np.zeros(x.shape[1]), np.zeros(x.shape[1])
    for start in range(0, len(x), _SAMPLES_AT_A_TIME):
        y = x[start : start + _SAMPLES_AT_A_TIME] - mean
        power += np.einsum("ni,ni->i", y, y)
        place += g[start : start + _SAMPLES_AT_A_TIME] @ y
    size = np.sqrt(power)
    moving = np.flatnonzero(size > 0)
    place[moving] = np.abs(place[moving]) / (size[moving] * np.linalg.norm(g))

    def unit(i: int) -> RealArray:
        return np.asarray((x[:, i] - mean[i]) / size[i])

    return [
        finding("duplicate", labels[i], labels[j], factor=float(unit(i) @ unit(j)) * size[j] / size[i])
        for i, *copies in _copies(unit, place, moving)
        for j in copies
    ]


def _copies(unit: Callable[[int], RealArray], place: RealArray, moving: Array) -> list[list[int]]:
    """Return groups of columns u of unit length that are multiples of each other to 1e-6, each in ascending order.

    Where u_j -+ u_i is small, |g u_i| and |g u_j|, their places, differ by no more for any row g of unit length: in their order only
    neighbours are compared, not all pairs.
    """
    groups: list[list[int]] = []
    near = deque[list[int]]()
    for j in sorted(moving.tolist(), key=lambda k: float(place[k])):
        while near and place[near[0][0]] < place[j] - 2 * _DUPLICATE:
            near.popleft()
        if group := next((group for group in near if _are_copies(unit(group[0]), unit(j))), None):
            group.append(j)
        else:
            near.append([j])
            groups.append(near[-1])
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _are_copies(u: RealArray, v: RealArray) -> bool:
    """Return whether a column of unit length is a multiple of another; 1 - (u v)^2 would lose half of the digits."""
    return bool(np.linalg.norm(v - (u @ v) * u) < _DUPLICATE)
