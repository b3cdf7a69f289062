"""Read accelerograms of strong-motion archives: CSMIP volumes (.v1, .v2), COSMOS (.v1c, .v2c, .cosmos) and USGS (.smc).

A channel is a text header and blocks of samples in fixed columns. In CSMIP and COSMOS files a line announces every block with its count,
quantity, unit and often the step and the columns:
`1138 POINTS OF ACCEL DATA EQUALLY SPACED AT .020 SEC. (UNITS: CM/SEC/SEC)` (CSMIP, Shakal and Huang 1985), or
`12725 acceleration pts, approx 63 secs, units=cm/s^2,Format=(8F10.5)` (COSMOS Strong-Motion Data Format 1.20, 2001). SMC files have 11
lines of text, 48 integers (8I10), 50 reals (5E15.7), comments and samples (8E10.4) (USGS, NSMP, 2000). Only accelerations are
taken: the archive integrated velocity and displacement from them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modalscope.data import DataError
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.contents import Contents, Options, needs, unreadable
from modalscope.io.limits import Room, room
from modalscope.io.text.dialect import encoding_of, lines_of
from modalscope.numerics.checks import RealArray

Lines = Sequence[str]

_REAL = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?"
#: The line above a block of samples, in both writings.
_BLOCK = re.compile(
    r"^\s*(?P<count>\d+)\s+(?:points of (?:[a-z]+ )?(?P<csmip>accel|veloc|displ)\w* data equally spaced"
    r"|(?P<cosmos>accel|veloc|displ)\w*\s+pts)",
    re.IGNORECASE,
)
_STEP = re.compile(rf"equally spaced at\s*({_REAL})\s*sec", re.IGNORECASE)
_LENGTH = re.compile(rf"approx\s*({_REAL})\s*secs", re.IGNORECASE)
_UNIT = re.compile(r"(?:units\s*[:=]\s*|sec[.,]?\s*,?\s*in\s+)([a-z/^*0-9]+)", re.IGNORECASE)
_FORMAT = re.compile(r"\(\s*\d*\s*[FEIGfeig]\s*(\d+)", re.IGNORECASE)
_REALS = re.compile(r"^\s*(\d+)\s+real-header values follow", re.IGNORECASE)
_CHANNEL = re.compile(
    r"(?:\bsta )?\bchan?\s*:?\s*(?P<number>\d+)\s*:?\s*(?P<direction>up|down|vert\w*|[-+]?\d+\s*deg\w*|[ns]\d*[ew]?\b|[ew]\b)?",
    re.IGNORECASE,
)
_AT_STATION = re.compile(r"\bsta\s+cha?n\s*:?\s*(\d+)", re.IGNORECASE)
_LOCATION = re.compile(r"\blocation\s*:\s*(.*?)\s*$", re.IGNORECASE)
_END = re.compile(r"end[ -]of[ -]data", re.IGNORECASE)
#: What volumes 1 of digitized film and volumes 3 hold instead of a record.
_NO_RECORD = {
    r"units of uncor\w* accel\w* are sec and g": "pairs of time and acceleration at uneven times, as digitized from film",
    r"response and fourier amplitude spectra": "response and Fourier spectra, which are no record",
}
#: Columns of a block whose line does not say them: 8F10.3 (CSMIP).
_COLUMNS = 10
#: Real headers of COSMOS that may hold the step, from 1, and the parts of a second that writers give it in.
_PLACES_OF_STEP, _UNITS_OF_STEP = (62, 34), (1e-3, 1.0)


@dataclass(frozen=True, slots=True)
class _Channel:
    """One component of a station: its place, direction and acceleration."""

    number: int
    direction: str
    location: str
    unit: str
    step: float
    values: RealArray
    omitted: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Number, location and direction, as one label."""
        words = (str(self.number), self.location.replace(":", ","), self.direction)
        return " ".join(word for word in words if word)


def read(path: Path, options: Options) -> Contents:
    """Read a CSMIP or COSMOS file of one channel or several.

    Raises
    ------
    DataError
        Spectra or film digitized at uneven times, another number of samples than announced, channels of other rates, no step.
    """
    lines, space = _text(path)
    for pattern, what in _NO_RECORD.items():
        if any(re.search(pattern, line, re.IGNORECASE) for line in lines):
            fault = f"it holds {what}"
            raise DataError(f"a record from {path.name}:", fault, "Give the corrected accelerogram (.v2).")
    channels = [channel for part in _parts(lines) for channel in _channels(path.name, part, space)]
    if not channels:
        fault = "no line announces a block of acceleration (... points of accel data, or ... acceleration pts)"
        remedy = "Give a file of CSMIP or COSMOS format, or a table (.txt)."
        raise unreadable(f"{path.name} as an accelerogram", fault, remedy)
    return _contents(path.name, channels, options)


def read_smc(path: Path, options: Options) -> Contents:
    """Read an SMC file of the USGS.

    Raises
    ------
    DataError
        A file of spectra, headers that are no numbers, another number of samples than the header says, no rate.
    """
    lines, space = _text(path)
    kind = " ".join(lines[:1]).strip().lower()
    if "spectr" in kind:
        fault = f"it holds {kind}, which are no record"
        raise DataError(f"a record from {path.name}:", fault, "Give the accelerogram.")
    integers = _exactly(path.name, lines[11:17], 10, 48, space)
    reals = _exactly(path.name, lines[17:27], 15, 50, space)
    unknown = integers[0]
    comments, count, rate = int(integers[15]), int(integers[16]), float(reals[1])
    if not (0 < rate < 1e6 and count > 0 and comments >= 0):
        fault = f"its header says {count} samples at {rate:g} Hz"
        raise unreadable(f"{path.name} as an SMC file", fault, "Copy the file again, or export it as a table (.txt).")
    values = _exactly(path.name, lines[27 + comments :], 10, count, space)
    vertical, horizontal = integers[12], integers[13]
    direction = "up" if vertical == 0 else "down" if vertical == 180 else ""
    direction = direction or (f"{horizontal:.0f}°" if horizontal != unknown else "")
    keys = [line.partition(":") for line in lines[1:11]]
    named = (value for word in ("location", "station") for key, _, value in keys if key.lower().startswith(word))
    located = next((place for place in named if place.strip()), "")
    channel = _Channel(1, direction, located.strip().lower(), "cm/s^2", 1 / rate, values)
    return _contents(path.name, [channel], options)


def _text(path: Path) -> tuple[list[str], Room]:
    space = room(path.name, path.stat().st_size)
    return [line.rstrip("\r\n") for _, line in lines_of(path, encoding_of(path), 0, space)], space


def _parts(lines: Lines) -> Iterator[Lines]:
    """Return the lines of each channel: files hold them one below the other."""
    first = 0
    for k, line in enumerate(lines):
        if _END.search(line):
            yield lines[first : k + 1]
            first = k + 1
    yield lines[first:]


def _channels(where: str, lines: Lines, space: Room) -> Iterator[_Channel]:
    """Return the acceleration that the lines of one channel hold; nothing where they hold another quantity alone."""
    blocks = [(k, match) for k, line in enumerate(lines) if (match := _BLOCK.match(line))]
    quantities = [(match["csmip"] or match["cosmos"]).lower() for _, match in blocks]
    if "accel" not in quantities:
        return
    start, announced = blocks[quantities.index("accel")]
    line, head = lines[start], lines[:start]
    width = int(match[1]) if (match := _FORMAT.search(line)) else _COLUMNS
    values = _exactly(where, lines[start + 1 :], width, int(announced["count"]), space)
    unit = match[1].lower().replace("sec", "s") if (match := _UNIT.search(line)) else ""
    named = next((match for text in head if (match := _CHANNEL.search(text))), None)
    station = next((match for text in head if (match := _AT_STATION.search(text))), None)
    located = next((match[1] for text in head if (match := _LOCATION.search(text))), "")
    direction = " ".join((named["direction"] or "").lower().split()) if named else ""
    yield _Channel(
        number=int(station[1] if station else named["number"] if named else 1),
        direction=re.sub(r"\s*deg\w*", "°", direction),
        location=" ".join(located.lower().split()),
        unit=re.sub(r"/s/s$|/s2$", "/s^2", unit),
        step=_step(where, line, head, values.size),
        values=values,
        omitted=tuple(name for name in ("veloc", "displ") if name in quantities),
    )


def _step(where: str, line: str, head: Lines, count: int) -> float:
    """Return the step of a block in s: as its line says, or of the real headers the one that fits the length that the line says."""
    if match := _STEP.search(line):
        return float(match[1])
    length = float(match[1]) if (match := _LENGTH.search(line)) else None
    first = next((k for k, text in enumerate(head) if _REALS.match(text)), None)
    if length is not None and first is not None:
        match = _FORMAT.search(head[first])
        reals = _numbers(head[first + 1 :], int(match[1]) if match else 13, 100)
        for place in _PLACES_OF_STEP:
            for part in _UNITS_OF_STEP:
                step = reals[place - 1] * part if place <= len(reals) else 0.0
                if step > 0 and abs(count * step - length) <= 1:  # the length is rounded to seconds
                    return step
    fault = "neither the line above them nor the real headers say one that fits their number"
    raise needs(where, "the step between its samples", fault, "Export the channel as a table with times (.txt).")


def _numbers(lines: Lines, width: int, count: int) -> list[float]:
    """Return up to so many numbers of fixed columns; they end where a column holds something else."""
    numbers: list[float] = []
    for line in lines:
        for k in range(0, len(line.rstrip()), width):
            try:
                numbers.append(float(line[k : k + width].replace("D", "E").replace("d", "e")))
            except ValueError:
                return numbers
            if len(numbers) == count:
                return numbers
    return numbers


def _exactly(where: str, lines: Lines, width: int, count: int, space: Room) -> RealArray:
    """Return so many numbers of fixed columns."""
    space.take("its samples", 8 * count)
    numbers = _numbers(lines, width, count)
    if len(numbers) != count:
        fault = f"{len(numbers)} stand in columns of {width} characters"
        remedy = "Copy the file again: it is cut or was edited."
        raise needs(where, f"the {count} numbers that it announces", fault, remedy)
    return np.array(numbers)


def _contents(where: str, channels: Sequence[_Channel], options: Options) -> Contents:
    """Return the channels as one record, over the samples that all have: a recorder starts them together."""
    steps = {channel.step for channel in channels}
    if len(steps) > 1:
        fault = f"its channels have steps of {', '.join(f'{step:g}' for step in sorted(steps))} s"
        raise unreadable(f"{where} as one record", fault, "Save channels of different steps in separate files.")
    count = min(channel.values.size for channel in channels)
    cut = sum(channel.values.size > count for channel in channels)
    words = {"veloc": "velocity", "displ": "displacement"}
    omitted = sorted({words[name] for channel in channels for name in channel.omitted})
    notes = [f"{' and '.join(omitted)} not read: the archive integrated them from the acceleration"] if omitted else []
    notes += [f"{cut} of {len(channels)} channels were cut to the {count} samples that all have"] if cut else []
    columns = (
        Column(number=k, name=channel.name, unit=channel.unit, values=channel.values[:count])
        for k, channel in enumerate(channels, 1)
    )
    table = Table(
        where=where,
        columns=tuple(columns),
        rate=float(f"{1 / channels[0].step:.12g}"),
        rate_from="the step in its header",
        notes=tuple(notes),
    )
    return contents_from_table(table, options)
