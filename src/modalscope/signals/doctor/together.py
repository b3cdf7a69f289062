"""Bring the files of one test together: what differs is named by file, lines that all have are kept, channels of one event are a record."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.kind_of_test import kind_of_test
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import counted, figures
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.signals.doctor.places import labels_option
from modalscope.signals.preprocess.merging import on_common_lines as common_of

#: Lines of files are one where they differ by less, in steps; part of the lines of a file that all must have.
_SAME_LINE, _MIN_COMMON = 0.01, 0.5
#: Rates of recorders of one event differ by less, relative; seconds beyond which times are dates.
_SAME_CLOCK, _DATES = 1e-3, 1e8
#: Stretches over which coherence is averaged, and the least of channels of one event: of records that have nothing in common it is 1 / 8.
_STRETCHES, _COHERENT = 8, 0.5
#: A start: samples of the record and of the start at least, part of the record at most, and how far beyond the rest it lies.
_MIN_SAMPLES, _MIN_START, _MAX_START, _FAR_BEYOND = 400, 4, 0.01, 3.0
#: Names that a channel has where its file names none.
_NO_NAME = re.compile(r"(?:col|y|ch)\d+\Z", re.IGNORECASE)


def check_units(parts: Sequence[Any], names: Sequence[str]) -> None:
    """Raise where responses or records of one test differ in what they measure; the message names the files, and options that help.

    Raises `DataError`: other quantities, or other units of a channel.
    """
    if any(not isinstance(part, FrequencyResponse) for part in parts):
        return
    said = [(part.quantity, _units_of(part)) for part in parts]
    if len({quantity for quantity, _ in said}) < 2:
        return
    usual = Counter(said).most_common(1)[0][0]
    odd = [(name, units) for name, (quantity, units) in zip(names, said, strict=True) if quantity != usual[0]]
    more = f" and {len(odd) - 4} more" if len(odd) > 4 else ""
    listed = ", ".join(f"{name} ({units or 'no unit'})" for name, units in odd[:4]) + more
    fault = f"{len(parts) - len(odd)} of {len(parts)} files are in {usual[1] or 'no unit'}, others not: {listed}"
    labels = ",".join(f"{dof}=100 mV/g" for name, _ in odd[:2] for dof in parts[names.index(name)].output_dofs[:1])
    quantity = usual[0] or "acceleration"
    remedy = f'Give the sensitivity of these sensors, such as --units "{labels}", or take all as one quantity: --quantity {quantity}'
    raise DataError("files of one test need responses of one quantity", fault, remedy)


def _units_of(part: FrequencyResponse) -> str:
    out, into = part.units[0][0], part.units[1][0]
    return f"{out}/{into}" if out and into else out


def on_common_lines(parts: Sequence[Any], names: Sequence[str]) -> tuple[list[Any], tuple[Note, ...]]:
    """Return responses on the lines that all of them have, and what is said; unchanged where lines are alike, or few are shared."""
    responses = all(isinstance(part, FrequencyResponse) and part.lines > 1 for part in parts)
    if not responses or all(np.array_equal(part.frequencies, parts[0].frequencies) for part in parts):
        return list(parts), ()
    try:
        kept = common_of(parts)
    except DataError:  # no line in common
        return list(parts), ()
    f, count = kept[0].frequencies, kept[0].lines
    near = all(np.max(np.abs(part.frequencies - f)) <= _SAME_LINE * np.min(np.diff(f)) for part in kept)
    if count < max(3, _MIN_COMMON * max(part.lines for part in parts)) or not near:
        return list(parts), ()
    lost = [f"{name} {part.lines - count}" for name, part in zip(names, parts, strict=True) if part.lines > count]
    text = f"Lines differ from file to file: {counted(count, 'line')} that all have are taken (left out: {', '.join(lost[:6])})"
    return [replace(part, frequencies=f) for part in kept], (Note("file", {"lines": float(count)}, text),)


def as_one_event(
    parts: Sequence[Any], names: Sequence[str], begins: Sequence[float], *, runs: bool = False
) -> tuple[list[Any], tuple[Note, ...]]:
    """Return the sensors of one event, one per file, under the names of their files and at the same times; and what is said.

    `begins`: the time of the first sample of each, s. `runs`: whether files are called runs. Where dates say the times, that is how they
    lie; else they must be coherent, over stretches and weighted by power. Free decays are coherent in any case: repeated ones of a sensor
    that is named stay runs. Clocks whose rates differ by more than a thousandth, or records that share less than half, are no event.
    """
    one = all(isinstance(p, Signals) and p.inputs is None and p.runs == len(p.output_dofs) == 1 for p in parts)
    if not one or not 1 < len(parts) == len(set(names)):
        return list(parts), ()
    rates, samples, start = *np.array([(p.sampling_rate, p.samples) for p in parts]).T, np.array(begins)
    usual, shift = float(np.median(rates)), start - start[0]
    first, last = shift.max(), float(np.min(shift + (samples - 1) / rates))
    own = np.ptp(rates) > 0 or np.ptp(shift) * usual > _SAME_LINE
    if np.any(abs(rates / usual - 1) > _SAME_CLOCK) or last - first < _MIN_COMMON * float(np.min(samples / rates)):
        return list(parts), ()
    on = [p.by_run()[0][0] for p in parts]
    if own:
        from scipy.interpolate import CubicSpline  # slow to load, and few tests need it

        own_times = [s + np.arange(len(y)) / rate for s, rate, y in zip(shift, rates, on, strict=True)]
        times = first + np.arange(int((last - first) * usual)) / usual
        on = [np.asarray(CubicSpline(t, y)(times)) for t, y in zip(own_times, on, strict=True)]
    bare = all(_NO_NAME.match(p.output_dofs[0]) for p in parts) or kind_of_test(parts[0].by_run()[0], None) == "ambient"
    if not (own and start.min() > _DATES) and (runs or not bare or not _coherent([y[:, 0] for y in on])):
        one = len({p.output_dofs for p in parts}) == 1
        runs_of = f"taken as its runs{f' at {usual:.6g} Hz' if np.ptp(rates) else ''}"
        said = f"{len(parts)} files of one channel, {runs_of}; if sensors of one event: {labels_option(len(parts), 'output')}"
        return [replace(p, sampling_rate=usual) if one else p for p in parts], (Note("file", {}, said),) * one
    text = f"{len(parts)} files of one channel, taken as sensors of one event and named after their files"
    text += "" if np.ptp(rates) else " (if they are runs: --output-dofs 1)"
    if own:
        ppm = ", ".join(f"{name} {1e6 * (usual / rate - 1):+.0f}" for name, rate in zip(names, rates, strict=True))
        clock = f"{usual:.6g} Hz over the common {last - first:.4g} s, by cubic splines"
        text += f"; resampled to one clock ({clock}); drift in ppm: {ppm}; starts differ by {np.ptp(shift):.4g} s"
    of = [{"outputs": y, "sampling_rate": usual, "output_dofs": (name,)} for y, name in zip(on, names, strict=True)]
    note = Note("file", {"start": float(np.ptp(shift))}, text)
    return [replace(p, **fields) for p, fields in zip(parts, of, strict=True)], (note,)


def from_its_start(record: Signals) -> tuple[Signals, tuple[Note, ...]]:
    """Return a record without the rows in which channels stand still far beyond all that follows, and what is said.

    Recorders give the end of a range until they begin. No motion does: it neither stands still nor leaves for good at once.
    """
    if record.runs != 1 or record.samples < _MIN_SAMPLES:
        return record, ()
    y = record.by_run()[0][0]
    most, begin = int(_MAX_START * len(y)), 0
    still: list[str] = []
    for k, channel in enumerate(y.T):
        change = np.flatnonzero(channel[: most + 1] != channel[0])
        rows = int(change[0]) if change.size else 0
        rest = channel[rows:] - np.median(channel[rows:]) if rows >= _MIN_START else channel
        if rows >= _MIN_START and abs(channel[0] - np.median(channel[rows:])) > _FAR_BEYOND * np.abs(rest).max():
            begin, still = max(begin, rows), [*still, record.output_dofs[k]]
    if not still:
        return record, ()
    u = record.by_run()[1]
    cut = replace(record, outputs=y[begin:], inputs=None if u is None else u[0, begin:])
    names, ms = ", ".join(still[:4]), 1e3 * begin / record.sampling_rate
    said = f"First {begin} samples ({figures(ms)} ms) left out: {names} constant there, far off all later values"
    return cut.processed(f"cut to begin at sample {begin + 1}"), (Note("start", {"samples": float(begin)}, said),)


def _coherent(channels: Sequence[RealArray]) -> bool:
    """Whether channels are coherent with the first: records of one event are, repeated ones of noise are not."""
    size = min(map(len, channels)) // _STRETCHES
    if size < _STRETCHES:
        return False
    window = np.hanning(size)
    X = [np.fft.rfft((c[: size * _STRETCHES].reshape(_STRETCHES, size) - c.mean()) * window, axis=1) for c in channels]
    powers = [np.sum(np.abs(x) ** 2, axis=0) for x in X]

    def coherence(k: int) -> float:
        cross = np.abs(np.sum(X[k] * X[0].conj(), axis=0)) ** 2
        return float(np.sum(cross) / max(float(np.sum(powers[k] * powers[0])), np.finfo(float).tiny))

    return bool(np.median([coherence(k) for k in range(1, len(X))]) > _COHERENT)


def read_alike(read: Callable[[int, str | None], tuple[Any, float]], count: int) -> list[Any]:
    """Return what files of one test hold, read by the evidence of all of them.

    `read`: (number of the file, content) -> what it holds, and by how much it is likelier a record than responses; content is None,
    "record" or "response". A file that is not read by itself, or as something else than its brothers, is read as these are: log
    likelihoods add up.

    Raises `DataError`: a file that is read neither way.
    """
    found: list[Any] = [None] * count
    margins, errors = np.zeros(count), {}
    for k in range(count):
        try:
            found[k], margins[k] = read(k, None)
        except DataError as error:
            errors[k] = error
    total = float(margins.sum())
    content = "record" if total > 0 else "response"
    odd = [k for k in range(count) if k in errors or margins[k] * total < 0]
    if len(odd) == count or total == 0:
        if errors:
            raise next(iter(errors.values()))
        return found
    for k in odd:
        try:
            found[k], _ = read(k, content)
        except DataError:
            if k in errors:
                raise errors[k] from None
    return found
