"""Read one channel whose samples continue over the lines: accelerograms (PEER .at2, .vt2, .dt2), and exports of seismic networks.

The head says `NPTS= 4000, DT= .0100 SEC`, or in older files `4000 0.0100 NPTS, DT`, and often `TIME SERIES IN UNITS OF G`. Others say
the count and the rate in words (`9599 samples, 40 sps`, `WID2 ... INT 3600 20.0`), or the rate alone (K-NET, with `Scale Factor
2000(gal)/8388608`). Then samples go on where their number is that of the head, or where the columns are one process: equal means and
deviations, and a last line that is shorter, or each first value as near to the last of the line above as neighbours in a line are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice, takewhile
from math import isfinite

import numpy as np

from modalscope.data.shown import counted
from modalscope.data.units import in_si
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.columns.facts import Statement, stated_by
from modalscope.io.columns.vocabulary import key_meaning
from modalscope.io.contents import Contents, Options, needs
from modalscope.io.limits import Room
from modalscope.io.text.cells import Dialect
from modalscope.io.text.dialect import Line
from modalscope.io.text.layout import statements_of

#: Lines in which the head is searched.
_LINES_OF_HEAD = 12
#: The same where it is in words; characters of a line that are examined, and of a name.
_LINES_OF_HEAD_IN_WORDS, _MAX_CHARACTERS, _MAX_LETTERS_OF_NAME = 60, 400, 40
#: Count and rate of GSE2 (`WID2 date time station channel INT count rate`) and in words; counts of a full scale; names of a channel;
#: what no row of names holds; cells of a line without a count, at least.
_GSE = re.compile(r"\bWID[12]\b.*?\bINT\w?\s+(\d{1,9})\s+(\d+(?:\.\d+)?)")
_SAMPLES = re.compile(r"\b(\d{2,9})\s*(?:samples|points|values|data points|pts)\b(?!\s*(?:/|per))", re.IGNORECASE)
_RATE = re.compile(r"\b(\d+(?:\.\d+)?)\s*(?:sps|hz|samples\s*(?:/|per)\s*s(?:ec(?:ond)?)?)\b", re.IGNORECASE)
_SCALE = re.compile(r"\b(\d+(?:\.\d+)?)\s*\(([A-Za-z/^*0-9]+)\)\s*/\s*(\d+(?:\.\d+)?)")
_NAMED = re.compile(r"^\W*TIMESERIES\s+([^\s,]+)", re.IGNORECASE)
_STATED = re.compile(r"[:=]|(?<![A-Za-z\d.])\d[\d.]*\s*[A-Za-z/]*\s*\Z")
_MIN_CELLS = 4
_KEYS_OF_NAME = {"station code", "dir", "channel", "component"}
#: Columns of one process: relative difference of their deviations, and of their means in deviations, at most; and the correlation of
#: neighbours by which a series goes on, at least.
_SAME_SPREAD, _SAME_MEAN, _GOES_ON = 0.25, 0.5, 0.5
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
#: Rows by which columns are one process, at least, and that are examined.
_MIN_ROWS_ALIKE, _MOST_ROWS = 16, 10_000


@dataclass(frozen=True, kw_only=True, slots=True)
class WrappedHead:
    """The head of such a file.

    `first`, `lines`: the line that counts the samples, from 0, and how many lines the head has. `count`: of the samples that follow.
    `step`: s; None where the head says none that can be. `said`: what stands for the step. `series`, `unit`: what they are of, and in
    which unit, `scale` of it. `sure`: whether it is one by its words; else the samples decide, and `count` may be 0: not known.
    """

    first: int
    lines: int
    count: int
    step: float | None = None
    said: str = ""
    series: str = ""
    unit: str = ""
    scale: float = 1.0
    sure: bool = True


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
        near = [place for place in (k, k + 1, k - 1) if 0 <= place < len(first)]
        steps = {place: match for place in near if (match := _STEP.search(first[place]))}
        end = k + 2 if k + 1 in steps else k + 1
        if not _BARE.match(" ".join(first[end : end + 1])):
            continue
        step = old[2] if old else next((match[1] for match in steps.values()), "")
        series_match = _SERIES.search(" ".join(first[:end]))
        series, unit = (series_match[1].lower(), _plain(series_match[2])) if series_match else ("", "")
        number = int(old[1] if old else count[1] if count else 0)
        return WrappedHead(first=k, lines=end, count=number, step=_step(step), said=step, series=series, unit=unit)
    return _in_words(first)


def _in_words(first: Sequence[str]) -> WrappedHead | None:
    """Return the head of a channel that says count and rate in words, and where the rows below have several cells; None of any other."""
    within = range(1, min(len(first) - 1, _LINES_OF_HEAD_IN_WORDS))
    end = next((k for k in within if all(map(_BARE.match, first[k : k + 2]))), 0)
    if not end or len(first[end].split()) < 2:
        return None
    names = len(first[end - 1].split()) > 1 and not _STATED.search(first[end - 1])  # a row of names, and no statement
    head = [line[:_MAX_CHARACTERS] for line in first[:end]]
    facts = [Statement(k, *fact) for k, line in enumerate(head) for fact in statements_of(line, Dialect(delimiter=""))]
    said, text = stated_by(facts, "."), " ".join(head)
    of_gse, count, rate = _GSE.search(text), _SAMPLES.search(text), _RATE.search(text)
    rates = [float(of_gse[2])] if of_gse else [rate for rate, _ in said.rates] or ([float(rate[1])] if rate else [])
    if len(set(rates)) != 1 or not 0 < rates[0] < np.inf:
        return None
    numbers = [int(match[1]) for match in (of_gse, count) if match]
    counts = [fact.value.split()[0] for fact in facts if key_meaning(fact.key) == "count"]
    numbers += [int(each) for each in counts if each.isdecimal()]
    if not numbers and (names or len(first[end].split()) < _MIN_CELLS):
        return None
    scale = _SCALE.search(text)
    full = float(scale[1]) / float(scale[3]) if scale and float(scale[3]) > 0 else 1.0
    named = _NAMED.search(text)
    called = [named[1]] if named else [f.value for f in facts if f.key.lower().strip(". ") in _KEYS_OF_NAME]
    return WrappedHead(
        first=0, lines=end, count=numbers[0] if numbers else 0, step=1 / rates[0], said=f"{rates[0]:g} Hz",
        series=" ".join(name.strip() for name in called)[:_MAX_LETTERS_OF_NAME], unit=scale[2] if scale else said.unit, scale=full,
        sure=False,
    )  # fmt: skip


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
    for line in islice(lines, max(head.count + 1, least) if head.count else None):
        space.take("its lines", _BYTES_OF_LINE + len(line[1]))
        gathered_lines.append(line)
    return gathered_lines


def runs_on(head: WrappedHead, body: Sequence[Line], rate: float | None) -> bool:
    """Whether samples run on over the lines below a head; else they are the rows of a table.

    They are rows where each has as many numbers, more than one, and either the first column counts the time, or there are as many
    rows as the head counts samples, or each row has so many.

    `body`: the lines below it. `rate`: samples per second, where they were given.
    """
    rows = [row for row in takewhile(bool, (_numbers(line) for _, line in body)) if row]
    widths = {len(row) for row in rows}
    if not head.sure:
        total, more = sum(map(len, rows)), any(_numbers(line) for _, line in body[len(rows) :])
        return not more and (total == head.count if head.count else _is_one_process(rows))
    if len(widths) != 1 or widths == {1}:
        return True
    if len(rows) == head.count or (len(rows) > 1 and widths == {head.count}):
        return False
    step = 1 / rate if rate else head.step
    if step is None or len(rows) < _MIN_ROWS:
        return True
    times = np.array([_number(row[0]) for row in rows])
    return not bool(np.all(np.abs(times - times[0] - step * np.arange(times.size)) <= _MAX_OFF_GRID * step))


def _is_one_process(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the columns of rows are stretches of one channel: alike, and cut short at the end, or each row going on from the last."""
    width = len(rows[0])
    whole = np.array([[_number(cell) for cell in row] for row in rows[:_MOST_ROWS] if len(row) == width])
    if len(whole) < _MIN_ROWS_ALIKE or any(len(row) != width for row in rows[:-1]):
        return False
    if not np.isfinite(whole).all():
        return False
    spreads, middle = whole.std(axis=0), float(np.median(whole.std(axis=0)))
    spread = np.abs(spreads - middle).max() < _SAME_SPREAD * middle
    alike = spread and np.ptp(whole.mean(axis=0)) < _SAME_MEAN * middle
    if not alike or len(rows[-1]) < width:
        return bool(alike)
    inside = np.corrcoef(whole[:, :-1].ravel(), whole[:, 1:].ravel())[0, 1]
    across = np.corrcoef(whole[:-1, -1], whole[1:, 0])[0, 1]
    return bool(min(inside, across) > _GOES_ON and across > inside - _SAME_SPREAD)


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
        columns=(Column(number=1, name=head.series, unit=head.unit, values=np.array(values) * head.scale),),
        rate=None if head.step is None else float(f"{1 / head.step:.12g}"),
        rate_from="DT in its head" if head.sure else "its head",
        layout=(("head", f"{counted(head.lines, 'line')}, {len(values)} samples run on over the lines below"),),
        roles={} if head.sure else {1: "out"},
        quantity=(head.sure and head.series) or None,
    )
    return contents_from_table(table, options)


def _values(where: str, head: WrappedHead, body: Iterable[Line], space: Room) -> list[float]:
    """Return the samples, as many as the head counts."""
    values: list[float] = []
    above = lines = 0
    for number, line in body:
        numbers = _numbers(line)
        if numbers is None and not head.sure:
            break
        if numbers is None:
            fault = f"line {number} holds {line.strip()[:20]!r}"
            raise needs(where, "nothing but numbers below its head", fault, "Correct that line.")
        space.take("its samples", _BYTES_OF_SAMPLE * len(numbers))
        values += map(_number, numbers)
        above, lines = above if lines else number - 1, lines + 1
    if head.sure and (len(values) != head.count or not values):
        need = f"the {head.count} samples of its head (NPTS)"
        fault = f"{len(values)} stand in the {lines} lines below it"
        table = f"if they are rows of a table, leave the head out: --skip {above}"
        raise needs(where, need, fault, f"Correct the number, or copy the file again; {table}")
    return values
