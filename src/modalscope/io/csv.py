"""CSV in the layout that is written here: responses and records, in and (`csv_writer`) out; tables of modes out.

Any other table is read by `modalscope.io.text`, by evidence. The first line that is not a comment names the columns; the first column
is the abscissa. Labels carry their unit in brackets. Comments `# name: value` before it hold what has no column (quantity,
sampling_rate, kind, first_sample).

| first column | further columns | it is |
|---|---|---|
| `frequency_hz` | `real 3:+Z / 1:+Z [m/s2 / N]`, `imag 3:+Z / 1:+Z`, for every output and input | a frequency response |
| `time_s` | `out 3:+Z [m/s2]`, `in 1:+Z [N]` | records |
| `time_s` | `3:+Z / 1:+Z [m/s2 / N]`, for every output and input | an impulse response |

Columns are parted by comma, semicolon or tab, whichever the header has. Numbers are written with every digit. Coherence,
variance, geometry and direct terms have no column: .npz, .h5 and .uff keep them.
"""

from __future__ import annotations

import csv
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice, product
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from modalscope.io import text
from modalscope.io.arrays import joined
from modalscope.io.columns.words import is_unit
from modalscope.io.contents import Contents, Finding, Options, Thing
from modalscope.io.limits import Room, room
from modalscope.model import DataError, FrequencyResponse, ImpulseResponse, Signals
from modalscope.model.checks import Array, RealArray

__all__ = ["read"]

_PAIR = re.compile(
    r"^(?:(?P<part>real|imag)\s+)?(?P<out>[^/\[\]]+?)\s*/\s*(?P<in>[^/\[\]]+?)\s*(?:\[(?P<unit>.*?)(?: / (?P<unit_in>.*))?\])?$"
)
_SIDE = re.compile(r"^(?P<side>out|in)\s+(?P<dof>.+?)\s*(?:\[(?P<unit>.*)\])?$")

#: Time steps may differ by this part of a step: printed times have few digits.
_EVEN = 1e-2
#: Labels by which a table is told.
_HEADS = 1000
#: Characters of a label, at most; of a cell in a message.
_LONGEST, _SHOWN = 400, 20


class _Table(NamedTuple):
    notes: dict[str, str]
    header: list[str]
    numbers: RealArray


def read(path: Path, options: Options) -> Contents:
    """Read a response or a record: in the layout above, or as anybody writes it."""
    if set(text.TEXT_OPTIONS) & set(options) or not _is_own(path):
        return text.read(path, options)
    table = _table(path, room(path.name, path.stat().st_size))
    given = {name: table.notes[name] for name in ("quantity", "kind") if name in table.notes}
    first, labels = table.header[0].strip().lower(), table.header[1:]
    abscissa, values = table.numbers[:, 0], table.numbers[:, 1:]
    if first == "frequency_hz":
        rate = {"sampling_rate": _number(path, table, "sampling_rate")} if "sampling_rate" in table.notes else {}
        thing: Thing = _frequency_response(path, labels, abscissa, values, given | rate)
    elif first == "time_s" and labels and all(_side(label) for label in labels):
        thing = _records(path, table, labels, values)
    elif first == "time_s":
        start = {"first_sample": _whole(_number(path, table, "first_sample"))} if "first_sample" in table.notes else {}
        outputs, inputs, columns, units = _matrix(path, labels, {""})
        fields: dict[str, Any] = {"kind": "dirac"} | given | start
        thing = ImpulseResponse(
            values=values[:, columns[""]],
            sampling_rate=_rate(path, table),
            units=units,
            **_dofs(outputs, inputs),
            **fields,
        )
    else:
        found = f"its first column is {table.header[0][:_SHOWN]!r}"
        raise DataError(
            f"reading {path.name} was asked",
            found,
            "Name it frequency_hz or time_s, and the others as the module modalscope.io.csv says.",
        )
    return Contents(thing=thing, findings=tuple(Finding(part="column", what=name) for name in table.header))


def _is_own(path: Path) -> bool:
    """Whether a table has the layout above: by its first column and what the others are called."""
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as file:
        head = next((line for line in file if not line.startswith("#") and not line.isspace()), "")
    if not head:
        raise _empty(path)
    cells = [cell.strip() for cell in head.split(max(",;\t", key=head.count))]
    if cells[0] not in ("frequency_hz", "time_s"):
        return {"frequency_hz", "damping_ratio"} <= set(cells)
    for label in (cell[:_LONGEST].strip('"') for cell in cells[1:_HEADS]):
        pair = _PAIR.match(label)
        if _SIDE.match(label) or (pair and (pair["part"] or pair["in"] == "1" or not is_unit(pair["in"]))):
            return True
    return len(cells) < 2


def _empty(path: Path) -> DataError:
    return DataError(
        f"reading {path.name} as CSV was asked",
        "it has no header and rows",
        "Write a header and one row a line or sample.",
    )


def _table(path: Path, space: Room) -> _Table:
    """Return comments, header and numbers, row by row: a cell of text takes thirty times its characters in the file."""
    notes: dict[str, str] = {}
    try:
        with path.open(encoding="utf-8-sig", newline=None) as file:
            rows = _rows(file, notes, space)
            first = next(rows, "")
            second = next(rows, "")
            if not second:
                raise _empty(path)
            delimiter = max(",;\t", key=first.count)
            space.parts("columns", first.count(delimiter) + 1)
            reader = csv.reader(chain([first, second], rows), delimiter=delimiter, strict=True)
            header = [name.strip() for name in next(reader)]
            if {"frequency_hz", "damping_ratio"} <= set(header):
                raise DataError(
                    f"reading {path.name} was asked",
                    "it is a table of modes, which is only written",
                    "Read modes from .json, .npz, .h5 or .uff.",
                )
            return _Table(notes, header, _cells(path, reader, len(header), space))
    except UnicodeDecodeError:
        raise DataError(
            f"reading {path.name} as CSV was asked",
            "it is not text in UTF-8",
            "Save it as UTF-8, or give it the suffix of what it is.",
        ) from None
    except csv.Error as error:
        raise DataError(
            f"reading {path.name} as CSV was asked",
            f"a quotation mark is left open, or stands where none may ({error})",
            "Close it, or take it out.",
        ) from None


def _rows(file: TextIO, notes: dict[str, str], space: Room) -> Iterator[str]:
    """Yield the lines that are neither blank nor comments; what comments say is kept in the notes."""
    for line in file:
        if not line.startswith("#"):
            if not line.isspace():
                yield line
            continue
        name, colon, value = line.lstrip("# ").partition(":")
        if colon:
            notes[name.strip()] = value.strip()
            space.parts("comments", len(notes))


def _cells(path: Path, body: Iterable[Sequence[str]], width: int, space: Room) -> RealArray:
    """Return the rows under the header as numbers."""
    numbers = array("d")
    for k, row in enumerate(body):
        try:
            values = [float(cell) for cell in row]
        except ValueError:
            values = []
        if len(values) != width:
            raise DataError(
                f"reading {path.name} needs {width} numbers in every row",
                f"row {k + 1} under the header is {[cell[:_SHOWN] for cell in row[:6]]}",
                "Correct that row; decimals take a point.",
            )
        space.take("its numbers", 8 * width)
        numbers.extend(values)
    return np.frombuffer(numbers).reshape(-1, width)


def _number(path: Path, table: _Table, name: str) -> float:
    try:
        return float(table.notes[name])
    except ValueError:
        raise DataError(
            f"{name} in {path.name} needs a number", f"it is {table.notes[name][:_SHOWN]!r}", "Correct the comment."
        ) from None


def _whole(value: float) -> float:
    return int(value) if value.is_integer() else value


def _rate(path: Path, table: _Table) -> float:
    if "sampling_rate" in table.notes:
        return _number(path, table, "sampling_rate")
    time = table.numbers[:, 0]
    steps = np.diff(time)
    if steps.size == 0 or not np.isfinite(steps).all() or steps.min() <= 0 or np.ptp(steps) > _EVEN * steps.mean():
        raise DataError(
            f"reading {path.name} needs evenly sampled, increasing times",
            f"the steps lie between {steps.min():g} and {steps.max():g} s" if steps.size else "there is one sample",
            "Resample the record, or give `# sampling_rate: ...` in a comment.",
        )
    return float((time.size - 1) / (time[-1] - time[0]))


def _matrix(path: Path, labels: list[str], parts: set[str]) -> tuple[list[str], list[str], dict[str, Array], Any]:
    """Return outputs, inputs, the columns of each part as (outputs, inputs), and units."""
    at: dict[tuple[str, str, str], int] = {}
    units: dict[str, dict[str, str]] = {"out": {}, "in": {}}
    for column, label in enumerate(labels):
        match = _PAIR.match(label) if len(label) <= _LONGEST else None
        key = (match["part"] or "", match["out"], match["in"]) if match else None
        if match is None or key is None or key[0] not in parts or key in at:
            raise DataError(
                f"reading {path.name} needs columns such as {'real ' if 'real' in parts else ''}3:+Z / 1:+Z, each once",
                f"there is {label[:_LONGEST]!r}",
                "Rename that column.",
            )
        at[key] = column
        units["out"][match["out"]] = match["unit"] or ""
        units["in"][match["in"]] = match["unit_in"] or ""
    outputs, inputs = list(units["out"]), list(units["in"])
    if len(at) != len(parts) * len(outputs) * len(inputs) or not at:
        pairs = product(sorted(parts), outputs, inputs)
        missing = islice((f"{p} {o} / {i}".strip() for p, o, i in pairs if (p, o, i) not in at), 5)
        raise DataError(
            f"reading {path.name} needs a column for every output and input",
            f"missing: {', '.join(missing) or 'all'}",
            "Add them, or leave out that channel.",
        )
    columns = {part: np.array([[at[part, o, i] for i in inputs] for o in outputs]) for part in parts}
    return outputs, inputs, columns, (list(units["out"].values()), list(units["in"].values()))


def _frequency_response(
    path: Path, labels: list[str], lines: Array, values: Array, given: dict[str, Any]
) -> FrequencyResponse:
    outputs, inputs, columns, units = _matrix(path, labels, {"real", "imag"})
    both = joined(values[:, columns["real"]], values[:, columns["imag"]])
    return FrequencyResponse(values=both, frequencies=lines, units=units, **_dofs(outputs, inputs), **given)


def _dofs(outputs: list[str], inputs: list[str]) -> dict[str, Any]:
    return {"output_dofs": tuple(outputs), "input_dofs": tuple(inputs)}


def _side(label: str) -> re.Match[str] | None:
    return _SIDE.match(label) if len(label) <= _LONGEST else None


def _records(path: Path, table: _Table, labels: list[str], values: Array) -> Signals:
    sides: dict[str, list[tuple[int, str, str]]] = {"out": [], "in": []}
    for column, label in enumerate(labels):
        match = _side(label)
        if match:
            sides[match["side"]].append((column, match["dof"], match["unit"] or ""))
    out, into = sides["out"], sides["in"]
    quantities = (
        [text.strip() or None for text in table.notes["quantities"].split(",")] if "quantities" in table.notes else None
    )
    return Signals(
        outputs=values[:, [column for column, _, _ in out]],
        inputs=values[:, [column for column, _, _ in into]] if into else None,
        sampling_rate=_rate(path, table),
        quantities=quantities,  # type: ignore[arg-type]
        output_dofs=tuple(dof for _, dof, _ in out),
        input_dofs=tuple(dof for _, dof, _ in into),
        units=(tuple(unit for _, _, unit in out), tuple(unit for _, _, unit in into)),
    )
