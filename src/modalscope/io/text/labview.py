"""Read LabVIEW measurement files (.lvm, also saved as .txt): header, segments, and the comment column that rows may lack.

The layout is National Instruments' "Specification for the LabVIEW Measurement File (.lvm)": keys and values above
`***End_of_Header***`, then segments, each with a header of one value per channel, a line of names and its rows. X values stand in no
column, in one, or before every channel; segments whose X values go on are one record, others are runs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.columns.axis import same_rate
from modalscope.io.columns.facts import Stated, Statement, stated_by, steps_of
from modalscope.io.contents import Contents, Options, needs, unreadable
from modalscope.io.limits import Room
from modalscope.io.members import stacked_runs
from modalscope.io.text.dialect import Line
from modalscope.numerics.checks import RealArray

_FIRST_LINE, _END_OF_HEADER = "labview measurement", "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
_SEPARATORS = {"tab": "\t", "comma": ","}
#: Rows that become numbers at a time.
_ROWS_OF_PIECE = 20_000


@dataclass(slots=True)
class _Segment:
    """A header, the names of its columns and its rows as pieces of numbers."""

    head: dict[str, list[str]]
    names: list[str] = field(default_factory=list)
    pieces: list[RealArray] = field(default_factory=list)
    waiting: list[str] = field(default_factory=list)

    @property
    def channels(self) -> int:
        cells = self.head.get("Channels", [""])[0]
        return int(cells) if cells.isdecimal() else 0

    def column(self, key: str, k: int) -> str:
        """Return what a line of the header says of channel k; where X values stand before every channel blanks stand between."""
        cells = [cell.strip() for cell in self.head.get(key, [])]
        filled = [cell for cell in cells if cell]
        cells = filled if len(filled) == self.channels else cells
        return cells[k] if k < len(cells) else ""


def is_labview(first: Sequence[str]) -> bool:
    r"""Whether the first lines of a text are those of a LabVIEW measurement file.

    Examples
    --------
    >>> is_labview(["LabVIEW Measurement\t", "Writer_Version\t2"]), is_labview(["Time,Force"])
    (True, False)
    """
    return bool(first) and first[0].strip("\ufeff \t,;\r\n").lower() == _FIRST_LINE


def labview_contents(where: str, lines: Iterable[Line], space: Room, options: Options) -> Contents:
    """Return the record, or the runs, that a LabVIEW measurement file holds.

    Raises `DataError`: no rows, rows that are no numbers, or what tables are refused for.
    """
    head, segments = _segments(where, lines, space)
    tables = [_table(where, head, segment) for segment in segments if segment.pieces]
    if not tables:
        fault = "it holds no rows of numbers"
        raise unreadable(f"{where} as a LabVIEW measurement file", fault, "Save the measurement again.")
    contents = [contents_from_table(table, options) for table in _joined(tables)]
    if len(contents) == 1:
        return contents[0]
    thing = stacked_runs(where, [record.thing for record in contents])
    return replace(contents[0], thing=thing, notes=(*contents[0].notes, f"{len(contents)} segments are as many runs"))


def _segments(where: str, lines: Iterable[Line], space: Room) -> tuple[Mapping[str, list[str]], list[_Segment]]:
    """Return the header of the file and its segments."""
    rows = iter(lines)
    head = dict(_header(rows, None))
    separator = _SEPARATORS.get(head.get("Separator", ["Tab"])[0].strip().lower(), "\t")
    decimal = head.get("Decimal_Separator", ["."])[0].strip() or "."
    segments: list[_Segment] = []
    special = False
    for number, line in rows:
        text = line.rstrip("\r\n")
        if text.startswith(_SPECIAL):
            special = text.startswith(_SPECIAL[0])
        elif special or not text.strip(" \t,"):
            continue
        elif text.partition(separator)[0] == "Channels":
            segments.append(_Segment(dict(_header(chain([(number, line)], rows), separator))))
            segments[-1].names = [name.strip() for name in next(rows, (0, ""))[1].rstrip("\r\n").split(separator)]
        elif segments:
            segments[-1].waiting.append(text.replace(decimal, "."))
            if len(segments[-1].waiting) >= _ROWS_OF_PIECE:
                _flush(where, number, segments[-1], separator, space)
    for segment in segments:
        _flush(where, 0, segment, separator, space)
    return head, segments


def _header(rows: Iterator[Line], separator: str | None) -> Iterator[tuple[str, list[str]]]:
    """Yield keys and their values up to the end of a header; without a separator, that of the first line's own."""
    for _, line in rows:
        text = line.rstrip("\r\n")
        if text.startswith(_END_OF_HEADER):
            return
        sign = separator or ("\t" if "\t" in text else ",")
        key, *values = text.split(sign)
        if key.strip():
            yield key.strip(), values


def _flush(where: str, number: int, segment: _Segment, separator: str, space: Room) -> None:
    """Make numbers of the rows that wait: what stands behind the columns of the channels is a comment."""
    if not segment.waiting:
        return
    width = min(len(segment.names) - (segment.names[-1:] == ["Comment"]), segment.waiting[0].count(separator) + 1)
    first = int(not segment.waiting[0].partition(separator)[0].strip())  # no X values are saved: the cell is empty
    space.take("its rows", 8 * width * len(segment.waiting))
    try:
        if any(separator * 2 in row or not row.rpartition(separator)[2].strip() for row in segment.waiting):
            values = np.array([_filled(row.split(separator)[first:width], width - first) for row in segment.waiting])
        else:
            values = np.loadtxt(
                segment.waiting, delimiter=separator, usecols=range(first, width), comments=None, ndmin=2
            )
    except (ValueError, IndexError) as error:
        fault = f"among the {len(segment.waiting)} rows before line {number or 'the end'}: {str(error)[:100]}"
        remedy = "Correct that row, or save the measurement again."
        raise needs(where, f"{width - first} numbers in every row", fault, remedy) from None
    segment.pieces.append(values)
    segment.waiting.clear()


def _filled(cells: Sequence[str], width: int) -> list[float]:
    """Return the numbers of cells; NaN for blank ones and those that are not there: channels may have fewer samples."""
    return [float(cell) if cell.strip() else float("nan") for cell in (*cells, *[""] * (width - len(cells)))]


def _table(where: str, head: Mapping[str, list[str]], segment: _Segment) -> Table:
    """Return a segment as columns: the X values of the first channel, and all channels."""
    values = np.concatenate(segment.pieces)
    count, width = segment.channels or max(1, values.shape[1] - 1), values.shape[1]
    multi = head.get("X_Columns", ["One"])[0].strip().lower() == "multi" and width >= 2 * count
    places = range(1, 2 * count, 2) if multi else range(width - min(count, width), width)
    names = [name for name in segment.names if name not in ("X_Value", "Comment", "")]
    columns = []
    if places[0] > 0:
        dimension = segment.column("X_Dimension", 0) or "Time"
        unit = segment.column("X_Unit_Label", 0) or ("Hz" if dimension.lower().startswith("freq") else "s")
        columns.append(Column(number=1, name="X_Value", unit=unit, values=values[:, 0]))
    above = len(columns)
    for k, place in enumerate(places):
        name, unit = names[k] if k < len(names) else "", segment.column("Y_Unit_Label", k)
        if not np.isnan(values[:, place]).all():
            columns.append(Column(number=above + k + 1, name=name, unit=unit, values=values[:, place]))
    steps = " ".join(segment.column("Delta_X", k) for k in range(count))
    decimal = head.get("Decimal_Separator", ["."])[0].strip() or "."
    said = stated_by([Statement(-1, "Delta_X", steps)], decimal) if places[0] == 0 else Stated()
    stated = said.rate(where, steps_of(column.values for column in columns))
    rate = None if stated is None else stated[0]
    begun = " ".join(segment.column(key, 0)[:19] for key in ("Date", "Time"))
    layout = (("segment", f"{len(values)} rows, {count} channels{f', begun {begun}' if begun.strip() else ''}"),)
    notes = () if rate is None else tuple(_other_steps(segment, names, decimal, rate))
    origin = "Delta_X in its header"
    return Table(where=where, columns=tuple(columns), rate=rate, rate_from=origin, layout=layout, notes=notes)


def _other_steps(segment: _Segment, names: Sequence[str], decimal: str, rate: float) -> Iterator[str]:
    """Yield a note for each other rate that channels have by their steps; a step of 1 is that of values without times."""
    others: dict[float, list[str]] = {}
    for k, name in enumerate(names):
        for other, _ in stated_by([Statement(-1, "Delta_X", segment.column("Delta_X", k))], decimal).rates:
            if other != 1 and not same_rate(other, rate):
                others.setdefault(other, []).append(name)
    for other, channels in others.items():
        which = channels[0] + (f" and {len(channels) - 1} more" if len(channels) > 1 else "")
        said = f"{which}: {other:.6g} Hz by Delta_X, but all channels are taken at {rate:.6g} Hz"
        yield f"{said}. To analyse these, read the file with sampling_rate={other:.6g}"


def _joined(tables: Sequence[Table]) -> list[Table]:
    """Return segments of the same channels whose X values go on as one table."""
    joined = [tables[0]]
    for table in tables[1:]:
        last = joined[-1]
        if _goes_on(last, table):
            both = zip(last.columns, table.columns, strict=True)
            columns = tuple(replace(a, values=np.concatenate([a.values, b.values])) for a, b in both)
            joined[-1] = replace(last, columns=columns)
        else:
            joined.append(table)
    return joined


def _goes_on(last: Table, table: Table) -> bool:
    """Whether the X values of a segment follow those of the one before by one step."""
    if last.rate is not None or [c.label for c in last.columns] != [c.label for c in table.columns]:
        return False
    before, after = last.columns[0].values, table.columns[0].values
    step = (before[-1] - before[0]) / max(1, len(before) - 1)
    return bool(abs(after[0] - before[-1] - step) < 0.5 * step)
