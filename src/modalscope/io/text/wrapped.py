"""Read accelerograms with samples that continue over the lines (PEER .at2, .vt2, .dt2).

The head says `NPTS= 4000, DT= .0100 SEC`, or in older files `4000 0.0100 NPTS, DT`, and often `TIME SERIES IN UNITS OF G`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, takewhile
from math import isfinite

import numpy as np

from modalscope.data import Signals
from modalscope.data.shown import counted
from modalscope.data.units import in_si
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options, needs
from modalscope.io.limits import Room

Line = tuple[int, str]

#: Lines in which the head is searched.
_LINES_OF_HEAD = 12
#: Nothing of a number is given back: lines without end would be tried from each of their digits on.
_NUMBER = r"[-+]?(?>\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"
_COUNT = re.compile(r"\bNPTS\s*=\s*(\d{1,9})", re.IGNORECASE)
_STEP = re.compile(rf"\bDT\s*=\s*({_NUMBER})", re.IGNORECASE)
_OLD = re.compile(rf"^\s*(\d{{1,9}})\s+({_NUMBER})\s+NPTS\s*,\s*DT\b", re.IGNORECASE)
_SERIES = re.compile(
    r"\b(acceleration|velocity|displacement)\b.*\bUNITS?\s+(?:OF|=)\s*([A-Za-z/^*0-9]+)", re.IGNORECASE
)
#: The line below a head holds numbers alone.
_BARE = re.compile(r"(?=\D*\d)[-+.\dEeDd\s]*+\Z")
#: How squares of seconds are written.
_SQUARED = re.compile(r"/s(?:/s|(?:\*\*|\^)?2)\Z")
#: Bytes of a sample as text, and of a line without its text.
_BYTES_OF_SAMPLE, _BYTES_OF_LINE = 70, 60
#: Rows by which a column is known to rise, at least; distance of times from their grid in steps, at most.
_MIN_ROWS, _MAX_OFF_GRID = 3, 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class WrappedHead:
    """The head of such a file.

    `first`, `lines`: the line that counts the samples, from 0, and how many lines the head has. `count`: of the samples that follow.
    `step`: s; None where the head says none that can be. `said`: what stands for the step. `series`, `unit`: what they are of, and in
    which unit.
    """

    first: int
    lines: int
    count: int
    step: float | None = None
    said: str = ""
    series: str = ""
    unit: str = ""


def head_of(first: Sequence[str]) -> WrappedHead | None:
    """Return the head of an accelerogram; None of any other text.

    `first`: the first lines of a text.

    Examples
    --------
    >>> head = head_of(["ACCELERATION TIME SERIES IN UNITS OF CM/SEC/SEC", "NPTS=  4000, DT=   .0100 SEC", ".1 .2 .3"])
    >>> head.lines, head.count, head.step, head.series, head.unit
    (2, 4000, 0.01, 'acceleration', 'cm/s^2')
    """
    for k, line in enumerate(first[:_LINES_OF_HEAD]):
        count, old = _COUNT.search(line), _OLD.search(line)
        if not (count or old):
            continue
        steps = {
            place: match
            for place in (k, k + 1, k - 1)
            if 0 <= place < len(first) and (match := _STEP.search(first[place]))
        }
        end = k + 2 if k + 1 in steps else k + 1
        if not _BARE.match(" ".join(first[end : end + 1])):
            continue
        step = old[2] if old else next((match[1] for match in steps.values()), "")
        series_match = _SERIES.search(" ".join(first[:end]))
        series, unit = (series_match[1].lower(), _plain(series_match[2])) if series_match else ("", "")
        number = int(old[1] if old else count[1] if count else 0)
        return WrappedHead(first=k, lines=end, count=number, step=_step(step), said=step, series=series, unit=unit)
    return None


def _step(text: str) -> float | None:
    """Return a step in s; None where it is none: zero, or beyond what numbers hold."""
    step = _number(text) if text else 0.0
    return step if step > 0 and isfinite(step) and isfinite(1 / step) else None


def _plain(unit: str) -> str:
    """Return a unit in the capitals of these files as others write it, where that is known.

    Examples
    --------
    >>> [_plain(unit) for unit in ("CM/SEC/SEC", "CM/S**2", "G", "MM/SEC", "FURLONG")]
    ['cm/s^2', 'cm/s^2', 'g', 'mm/s', 'FURLONG']
    """
    small = _SQUARED.sub("/s^2", unit.lower().replace("sec", "s"))
    return small if in_si(small) is not None else unit


def _number(text: str) -> float:
    return float(text.replace("D", "E").replace("d", "e"))


def _numbers(line: str) -> list[str] | None:
    """Return the numbers of a line, which may follow each other without a blank; None where anything else stands there."""
    numbers = re.findall(_NUMBER, line)
    return numbers if "".join(numbers) == "".join(line.split()) else None


def gathered(head: WrappedHead, lines: Iterable[Line], least: int, space: Room) -> list[Line]:
    """Return the lines below a head, one more than it counts samples: as many as tell what they are.

    `lines`: those below it. `least`: lines that are wanted in any case.
    """
    gathered_lines = []
    for line in islice(lines, max(head.count + 1, least)):
        space.take("its lines", _BYTES_OF_LINE + len(line[1]))
        gathered_lines.append(line)
    return gathered_lines


def runs_on(head: WrappedHead, body: Sequence[Line], rate: float | None) -> bool:
    """Whether samples run on over the lines below a head; else they are the rows of a table.

    They are rows where each has as many numbers, more than one, and either the first column counts the time, or there are as many
    rows as the head counts samples, or each row has so many.

    `body`: the lines below it. `rate`: samples per second, where they were given.
    """
    rows = list(takewhile(bool, (_numbers(line) for _, line in body)))
    widths = {len(row) for row in rows if row}
    if len(widths) != 1 or widths == {1}:
        return True
    if len(rows) == head.count or (len(rows) > 1 and widths == {head.count}):
        return False
    step = 1 / rate if rate else head.step
    if step is None or len(rows) < _MIN_ROWS:
        return True
    times = np.array([_number(row[0]) for row in rows if row])
    return not bool(np.all(np.abs(times - times[0] - step * np.arange(times.size)) <= _MAX_OFF_GRID * step))


def wrapped_contents(where: str, head: WrappedHead, body: Iterable[Line], space: Room, options: Options) -> Contents:
    """Return the samples below a head as a record of one channel.

    `body`: the lines below it.

    Raises `DataError`: another number of samples than the head says, no step, or something that is no number.
    """
    values = _values(where, head, body, space)
    if head.step is None and options.get("sampling_rate") is None:
        step = f"says DT= {head.said}, which is no step" if head.said else "says no step (DT)"
        fault = f"the head that counts {head.count} samples (NPTS) {step}"
        raise needs(where, "a sampling rate", fault, "Give it in samples per second: --sampling-rate HZ")
    table = Table(
        where=where,
        columns=(Column(number=1, name=head.series, unit=head.unit, values=np.array(values)),),
        rate=None if head.step is None else float(f"{1 / head.step:.12g}"),
        rate_from="DT in its head",
        layout=(("head", f"{counted(head.lines, 'line')}, {head.count} samples run on over the lines below"),),
    )
    contents = contents_from_table(table, options)
    if isinstance(contents.thing, Signals) and contents.thing.quantities == (None,) and head.series:
        return replace(contents, thing=replace(contents.thing, quantities=(head.series,)))
    return contents


def _values(where: str, head: WrappedHead, body: Iterable[Line], space: Room) -> list[float]:
    """Return the samples, as many as the head counts."""
    values: list[float] = []
    above = lines = 0
    for number, line in body:
        numbers = _numbers(line)
        if numbers is None:
            fault = f"line {number} holds {line.strip()[:20]!r}"
            raise needs(where, "nothing but numbers below its head", fault, "Correct that line.")
        space.take("its samples", _BYTES_OF_SAMPLE * len(numbers))
        values += map(_number, numbers)
        above, lines = above if lines else number - 1, lines + 1
    if len(values) != head.count or not values:
        need, fault = (
            f"the {head.count} samples of its head (NPTS)",
            f"{len(values)} stand in the {lines} lines below it",
        )
        table = f"if they are rows of a table, leave the head out: --skip {above}"
        raise needs(where, need, fault, f"Correct the number, or copy the file again; {table}")
    return values
