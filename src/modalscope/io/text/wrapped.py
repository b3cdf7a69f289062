"""Accelerograms as archives of strong motion write them: one channel whose samples run on over the lines, below a head that counts them.

The head says `NPTS= 4000, DT= .0100 SEC`, or in older files `4000 0.0100 NPTS, DT`, and often `TIME SERIES IN UNITS OF G`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.io.columns import Column, Table
from modalscope.io.limits import Room
from modalscope.model import DataError

__all__ = ["WrappedHead", "head_of", "wrapped_table"]

Line = tuple[int, str]

#: Lines among which the head is looked for.
_LINES = 12
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"
_COUNT = re.compile(r"\bNPTS\s*=\s*(\d{1,9})", re.IGNORECASE)
_STEP = re.compile(rf"\bDT\s*=\s*({_NUMBER})", re.IGNORECASE)
_OLD = re.compile(rf"^\s*(\d{{1,9}})\s+({_NUMBER})\s+NPTS\s*,\s*DT\b", re.IGNORECASE)
_SERIES = re.compile(
    r"\b(acceleration|velocity|displacement)\b.*\bUNITS?\s+(?:OF|=)\s*([A-Za-z/^*0-9]+)", re.IGNORECASE
)
#: The line below a head holds numbers alone.
_BARE = re.compile(r"[-+.\dEeDd\s]*\d[-+.\dEeDd\s]*\Z")
#: Units in the capitals of these files.
_UNITS = {
    "g": "g",
    "m/s/s": "m/s^2",
    "cm/s": "cm/s",
    "cm/sec": "cm/s",
    "cm": "cm",
    "cm/s/s": "cm/s^2",
    "cm/s^2": "cm/s^2",
    "gal": "cm/s^2",
}
#: Bytes that the samples take while they are texts.
_CELL = 70


@dataclass(frozen=True, kw_only=True, slots=True)
class WrappedHead:
    """The head of such a file: where it ends, how many samples follow, their step in s, and what they are of in which unit."""

    lines: int
    count: int
    step: float
    series: str = ""
    unit: str = ""


def head_of(first: Sequence[str]) -> WrappedHead | None:
    """Return the head of an accelerogram; None of any other text.

    Parameters
    ----------
    first : sequence of str
        The first lines of a text.

    Examples
    --------
    >>> head_of(["ACCELERATION TIME SERIES IN UNITS OF G", "NPTS=  4000, DT=   .0100 SEC", ".1 .2 .3"])
    WrappedHead(lines=2, count=4000, step=0.01, series='acceleration', unit='g')
    """
    for k, line in enumerate(first[:_LINES]):
        count, step, old = _COUNT.search(line), _STEP.search(line), _OLD.search(line)
        told = (count[1], step[1]) if count and step else (old[1], old[2]) if old else None
        if told is None or _number(told[1]) <= 0 or not _BARE.match(" ".join(first[k + 1 : k + 2])):
            continue
        said = _SERIES.search(" ".join(first[: k + 1]))
        series, unit = (said[1].lower(), said[2]) if said else ("", "")
        known = _UNITS.get(unit.lower(), unit)
        return WrappedHead(lines=k + 1, count=int(told[0]), step=_number(told[1]), series=series, unit=known)
    return None


def _number(text: str) -> float:
    return float(text.replace("D", "E").replace("d", "e"))


def wrapped_table(where: str, head: WrappedHead, body: Iterable[Line], space: Room) -> Table:
    """Return the samples below a head as a table of one column.

    Parameters
    ----------
    where : str
        The file, for messages.
    head : WrappedHead
    body : iterable of (int, str)
        The lines below it.
    space : Room

    Raises
    ------
    DataError
        Another number of samples than the head says, or something that is no number.
    """
    space.take("its samples", _CELL * head.count)
    values: list[float] = []
    for number, line in body:
        found = re.findall(_NUMBER, line)
        if "".join(found) != "".join(line.split()):
            raise DataError(
                f"reading {where} needs nothing but numbers below its head",
                f"line {number} holds {line.strip()[:20]!r}",
                "Correct that line.",
            )
        values += map(_number, found)
        if len(values) > head.count:
            break
    if len(values) != head.count:
        held = f"more than {head.count}" if len(values) > head.count else f"{len(values)}"
        raise DataError(
            f"reading {where} needs the {head.count} samples that its head counts (NPTS)",
            f"{held} stand below it",
            "Copy the file again, or correct the number.",
        )
    column = Column(number=1, name=head.series, unit=head.unit, values=np.array(values))
    return Table(
        where=where,
        columns=(column,),
        rate=round(1 / head.step, 9),
        rate_from="DT in its head",
        layout=(("head", f"{head.lines} lines, {head.count} samples run on over the lines below"),),
    )
