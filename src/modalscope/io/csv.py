"""Read and write CSV files in the library's own layout.

Any other table is read by `modalscope.io.text`, by evidence. The first line that is not a comment names the columns; the first column
is the abscissa. Labels carry their unit in brackets. Comments `# name: value` before it hold what has no column (quantity,
sampling_rate, kind, first_sample).

| first column | further columns | it is |
|---|---|---|
| `frequency_hz` | `real 3:+Z / 1:+Z [m/s2 / N]`, `imag 3:+Z / 1:+Z`, for every output and input | a frequency response |
| `time_s` | `out 3:+Z [m/s2]`, `in 1:+Z [N]` | records |
| `time_s` | `3:+Z / 1:+Z [m/s2 / N]`, for every output and input | an impulse response |
| `mode` | what `ModalModel.columns` gives, then `real 3:+Z`, `imag 3:+Z` of the shapes | modes |

Tables of responses and records also say how many rows they have: `# rows: 300`. Another number of rows, or samples that do not follow at
the rate of the header, is refused.

Columns are separated by comma, semicolon or tab, whichever the header has. Numbers are written with every digit. Coherence,
variance, geometry and direct terms have no column: .npz, .h5 and .uff keep them. Participation, reasons and notes of modes have none: .json
keeps them.
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

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, ModalModel, Signals
from modalscope.data.mode_fields import COLUMNS, DEGREES, DERIVED
from modalscope.data.response import Response
from modalscope.io import text
from modalscope.io.arrays import joined
from modalscope.io.atomic import MARK
from modalscope.io.columns.axis import sampling_of
from modalscope.io.columns.words import is_unit
from modalscope.io.contents import Contents, DataObject, Finding, Options, needs, unreadable
from modalscope.io.limits import Room, room
from modalscope.io.options import TEXT
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.poles import poles_from

_PAIR = re.compile(
    r"^(?:(?P<part>real|imag)\s+)?(?P<out>[^/\[\]]+?)\s*/\s*(?P<in>[^/\[\]]+?)\s*(?:\[(?P<unit>.*?)(?: / (?P<unit_in>.*))?\])?$"
)
_SIDE = re.compile(r"^(?P<side>out|in)\s+(?P<dof>.+?)\s*(?:\[(?P<unit>.*)\])?$")
#: Columns by which a table of modes is known.
_OF_MODES = {"frequency_hz", "damping_ratio"}
#: Columns of words in a table of modes.
_OF_WORDS = ("kind", "grade", "reason")
#: What stands in a header without ambiguity.
_PLAIN = re.compile(r"[\w :+.²³µ-]*|\w+/\w+²?")
#: Steps that a time may lie beside its place: one row less is a whole step.
_MAX_SHIFT = 0.5
#: Labels examined to recognize a table of this layout.
_MAX_LABELS = 1000
#: Characters of a label, at most; of a cell in a message.
_MAX_CHARACTERS, _CHARACTERS_SHOWN = 400, 20


class _Table(NamedTuple):
    notes: dict[str, str]
    header: list[str]
    numbers: RealArray


#: Largest number of a mode that is looked for, and missing ones that are named at most.
_MAX_NUMBER, _NAMED = 10_000, 8


class _Line:
    """Stands for a file: `csv.writer(_Line()).writerow(row)` returns the line."""

    def write(self, line: str) -> str:
        return line


def read(path: Path, options: Options) -> Contents:
    """Read a response or a record: in the layout above, or as anybody writes it."""
    if set(TEXT) & set(options) or not _is_own(path):
        return text.read(path, options)
    table = _table(path, room(path.name, path.stat().st_size))
    _check_rows(path, table)
    given: dict[str, Any] = {name: table.notes[name] for name in ("quantity", "kind") if name in table.notes}
    first, labels, values = table.header[0].strip().lower(), table.header[1:], table.numbers[:, 1:]
    sides = [_SIDE.match(label) if len(label) <= _MAX_CHARACTERS else None for label in labels]
    if set(table.header) >= _OF_MODES:
        thing: DataObject = _modes(path, table)
    elif first == "frequency_hz":
        if "sampling_rate" in table.notes:
            given["sampling_rate"] = _number(path, table, "sampling_rate")
        columns, channels = _matrix(path, labels, {"real", "imag"})
        both = joined(values[:, columns["real"]], values[:, columns["imag"]])
        thing = FrequencyResponse(values=both, frequencies=table.numbers[:, 0], **channels, **given)
    elif first == "time_s" and sides and all(sides):
        thing = _records(path, table, [side for side in sides if side], values)
    elif first == "time_s":
        if "first_sample" in table.notes:
            start = _number(path, table, "first_sample")
            given["first_sample"] = int(start) if start.is_integer() else start
        columns, channels = _matrix(path, labels, {""})
        fields = {"kind": "dirac", "sampling_rate": _rate(path, table), **given}
        thing = ImpulseResponse(values=values[:, columns[""]], **channels, **fields)
        _check_times(path, table, float(thing.times[0]) if "written by" in table.notes else None)
    else:
        fault = f"its first column is {table.header[0][:_CHARACTERS_SHOWN]!r}"
        remedy = "Name it frequency_hz or time_s, and the others as the module modalscope.io.csv says."
        raise unreadable(path.name, fault, remedy)
    findings = tuple(Finding(part="column", what=name) for name in table.header)
    return Contents(thing=thing, findings=findings, notes=_edited(table))


def _edited(table: _Table) -> tuple[str, ...]:
    """Say that modes were taken out, by their numbers."""
    if table.header[0] != "mode":
        return ()
    numbers = table.numbers[np.isfinite(table.numbers[:, 0]), 0]
    gone = np.setdiff1d(np.arange(1, min(numbers.max(initial=0), _MAX_NUMBER) + 1), numbers)
    which = ", ".join(f"{k:g}" for k in gone[:_NAMED]) + (" ..." if gone.size > _NAMED else "")
    return (f"edited since it was written: without mode {which}",) if gone.size else ()


def _check_rows(path: Path, table: _Table) -> None:
    """Raise unless a table has as many rows as its header says."""
    if "rows" in table.notes and len(table.numbers) != _number(path, table, "rows"):
        fault = f"it has {len(table.numbers)}"
        remedy = "Restore them or copy it again; if it was cut on purpose, take the comment `# rows` out."
        raise needs(path.name, f"{table.notes['rows'][:_CHARACTERS_SHOWN]} rows, as its header says", fault, remedy)


def _check_times(path: Path, table: _Table, start: float | None) -> None:
    """Raise unless the samples follow at the rate of the header, to half a step, from a time on where one is given."""
    if "sampling_rate" not in table.notes:
        return
    rate, times = _number(path, table, "sampling_rate"), table.numbers[:, 0]
    expected = (times[0] if start is None else start) + np.arange(times.size) / rate
    odd = np.flatnonzero(~(np.abs(times - expected) * rate < _MAX_SHIFT))
    if odd.size:
        k = int(odd[0])
        fault = f"row {k + 1} under the header lies at {times[k]:.9g} s instead of {expected[k]:.9g} s"
        remedy = "Restore the missing rows, or copy it again; columns='time=1' reads it as any other table."
        raise needs(path.name, f"samples at {rate:g} Hz", fault, remedy)


def _is_own(path: Path) -> bool:
    """Whether a table has the layout above: by its first column and what the others are called."""
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as file:
        head = next((line for line in file if not line.startswith("#") and not line.isspace()), "")
    if not head:
        raise _empty(path)
    cells = [cell.strip() for cell in head.split(max(",;\t", key=head.count))]
    if cells[0] not in ("frequency_hz", "time_s"):
        return set(cells) >= _OF_MODES
    for label in (cell[:_MAX_CHARACTERS].strip('"') for cell in cells[1:_MAX_LABELS]):
        pair = _PAIR.match(label)
        if _SIDE.match(label) or (pair and (pair["part"] or pair["in"] == "1" or not is_unit(pair["in"]))):
            return True
    return len(cells) < 2


def _empty(path: Path) -> DataError:
    return unreadable(f"{path.name} as CSV", "it has no header and rows", "Write a header and a row a sample.")


def _table(path: Path, space: Room) -> _Table:
    """Return comments, header and numbers, row by row: a cell of text takes thirty times its characters in the file."""
    notes: dict[str, str] = {}
    try:
        with path.open(encoding="utf-8-sig", newline=None) as file:
            rows = _rows(file, notes, space)
            first, second = next(rows, ""), next(rows, "")
            if not second:
                raise _empty(path)
            delimiter = max(",;\t", key=first.count)
            space.parts("columns", first.count(delimiter) + 1)
            reader = csv.reader(chain([first, second], rows), delimiter=delimiter, strict=True)
            header = [name.strip() for name in next(reader)]
            words = [k for k, name in enumerate(header) if name in _OF_WORDS] if set(header) >= _OF_MODES else []
            body = ([cell for k, cell in enumerate(row) if k not in words] for row in reader)
            header = [name for k, name in enumerate(header) if k not in words]
            return _Table(notes, header, _cells(path, body, len(header), space))
    except UnicodeDecodeError:
        remedy = "Save it as UTF-8, or give it the suffix of what it is."
        raise unreadable(f"{path.name} as CSV", "it is not text in UTF-8", remedy) from None
    except csv.Error as error:
        fault = f"a quotation mark is left open, or misplaced ({error})"
        raise unreadable(f"{path.name} as CSV", fault, "Close it, or take it out.") from None


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
            fault = f"row {k + 1} under the header is {[cell[:_CHARACTERS_SHOWN] for cell in row[:6]]}"
            raise needs(path.name, f"{width} numbers in every row", fault, "Correct that row; decimals take a point.")
        space.take("its numbers", 8 * width)
        numbers.extend(values)
    return np.frombuffer(numbers).reshape(-1, width)


def _number(path: Path, table: _Table, name: str) -> float:
    try:
        return float(table.notes[name])
    except ValueError:
        fault = f"it is {table.notes[name][:_CHARACTERS_SHOWN]!r}"
        raise DataError(f"{name} in {path.name} needs a number", fault, "Correct the comment.") from None


def _rate(path: Path, table: _Table) -> float:
    if "sampling_rate" in table.notes:
        return _number(path, table, "sampling_rate")
    try:
        return sampling_of(table.numbers[:, 0]).rate
    except DataError as error:
        remedy = "Resample the record, or give `# sampling_rate: ...` in a comment."
        raise needs(path.name, "evenly sampled, increasing times", error.found, remedy) from None


def _matrix(path: Path, labels: list[str], parts: set[str]) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns of each part as (outputs, inputs), and labels and units of the channels."""
    at: dict[tuple[str, str, str], int] = {}
    units: dict[str, dict[str, str]] = {"out": {}, "in": {}}
    for column, label in enumerate(labels):
        match = _PAIR.match(label) if len(label) <= _MAX_CHARACTERS else None
        key = (match["part"] or "", match["out"], match["in"]) if match else None
        if match is None or key is None or key[0] not in parts or key in at:
            need = f"columns such as {'real ' if 'real' in parts else ''}3:+Z / 1:+Z, each once"
            raise needs(path.name, need, f"there is {label[:_MAX_CHARACTERS]!r}", "Rename that column.")
        at[key] = column
        units["out"][match["out"]] = match["unit"] or ""
        units["in"][match["in"]] = match["unit_in"] or ""
    outputs, inputs = list(units["out"]), list(units["in"])
    if len(at) != len(parts) * len(outputs) * len(inputs) or not at:
        pairs = product(sorted(parts), outputs, inputs)
        missing = islice((f"{p} {o} / {i}".strip() for p, o, i in pairs if (p, o, i) not in at), 5)
        fault = f"missing: {', '.join(missing) or 'all'}"
        raise needs(path.name, "a column for every output and input", fault, "Add them, or leave out that channel.")
    columns = {part: np.array([[at[part, o, i] for i in inputs] for o in outputs]) for part in parts}
    both = (tuple(units["out"].values()), tuple(units["in"].values()))
    return columns, {"output_dofs": tuple(outputs), "input_dofs": tuple(inputs), "units": both}


def _modes(path: Path, table: _Table) -> ModalModel:
    """Return the modes of a table: what no column of this layout is named after is an indicator."""
    columns = dict(zip(table.header, table.numbers.T, strict=True))
    outputs = [name.removeprefix("real ") for name in table.header if name.startswith("real ")]
    parts = [[columns.pop(f"{part} {dof}", None) for dof in outputs] for part in ("real", "imag")]
    missing = [dof for dof, imag in zip(outputs, parts[1], strict=True) if imag is None]
    f, zeta = columns.pop("frequency_hz"), columns.pop("damping_ratio")
    if missing or len(columns) + 2 + 2 * len(outputs) != len(table.header) or not np.all((f >= 0) & (abs(zeta) <= 1)):
        fault = f"imag {missing[0]} is missing" if missing else "a name stands twice, or a value is none of a mode"
        need = "each column once, real and imaginary parts of shapes, frequencies from 0 on and damping ratios within 1"
        raise needs(path.name, need, fault, "Correct that column.")
    for name in ("mode", *DERIVED):
        columns.pop(name, None)
    fields = {name: columns.pop(column) for column, name in COLUMNS.items() if column in columns}
    degrees = [columns.pop(name, np.full(f.size, np.nan)) for name in DEGREES] if set(DEGREES) & set(columns) else None
    return ModalModel(
        poles=np.array([poles_from(*pair) for pair in zip(f, zeta, strict=True)]),
        shapes=joined(*(np.reshape(part, (len(outputs), f.size)) for part in parts)),
        degrees=None if degrees is None else np.stack(degrees, axis=1),
        indicators=columns,
        output_dofs=tuple(outputs),
        scaling="as in the file",
        **fields,
    )


def _records(path: Path, table: _Table, labels: list[re.Match[str]], values: Array) -> Signals:
    columns = {side: [k for k, label in enumerate(labels) if label["side"] == side] for side in ("out", "in")}
    dofs = {side: tuple(labels[k]["dof"] for k in places) for side, places in columns.items()}
    units = {side: tuple(labels[k]["unit"] or "" for k in places) for side, places in columns.items()}
    quantities = table.notes.get("quantities")
    _check_times(path, table, None)
    named: Any = None if quantities is None else [text.strip() or None for text in quantities.split(",")]
    return Signals(
        outputs=values[:, columns["out"]],
        inputs=values[:, columns["in"]] if columns["in"] else None,
        sampling_rate=_rate(path, table),
        quantities=named,
        output_dofs=dofs["out"],
        input_dofs=dofs["in"],
        units=(units["out"], units["in"]),
    )


def write(path: Path, thing: DataObject, options: Options) -> None:
    """Write a response, a record of one run or a table of modes.

    Raises `DataError`: a direct term, several runs, or labels that a header of columns does not give back.
    """
    if isinstance(thing, ModalModel):
        _put(path, None, *_modes_table(thing))
        return
    if isinstance(thing, FrequencyResponse):
        notes, table = _notes(thing, "quantity", "sampling_rate"), _frequency_table(thing)
    elif isinstance(thing, ImpulseResponse):
        notes, table = _notes(thing, "quantity", "sampling_rate", "kind", "first_sample"), _impulse_table(thing)
    elif isinstance(thing, Signals):
        notes, table = _notes(thing, "sampling_rate"), _record_table(thing)
        if any(thing.quantities):
            notes["quantities"] = ", ".join(quantity or "" for quantity in thing.quantities)
    else:
        fault = "there is no such table"
        raise DataError(f"writing {type(thing).__name__} as .csv was asked", fault, "Use .npz, .h5 or .uff.")
    _check_header(path, thing, table[0])
    _put(path, notes, *table)


def _check_header(path: Path, thing: Signals | Response, header: Sequence[str]) -> None:
    """Raise when the header does not give the labels and units back, which may hold its separators."""
    _put(path, {}, header, [[k] * len(header) for k in (1, 2)])
    try:
        again: Any = read(path, {}).thing
        restored = (again.output_dofs, again.input_dofs, again.units) == (
            thing.output_dofs,
            thing.input_dofs,
            thing.units,
        )
    except DataError:
        restored = False
    if not restored:
        labels = (*thing.output_dofs, *thing.input_dofs, *thing.units[0], *thing.units[1])
        odd = [repr(label) for label in dict.fromkeys(labels) if not _PLAIN.fullmatch(label)]
        asked = f"writing the labels and units {', '.join(odd or map(repr, labels))} as .csv was asked"
        raise DataError(asked, "its header of columns would not give them back", "Rename them, or use .npz or .h5.")


def _put(path: Path, notes: dict[str, str] | None, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    writer: Any = csv.writer(_Line(), lineterminator="\n")
    with path.open("w", encoding="utf-8", newline="") as file:
        if notes is not None:
            whole = {"written by": MARK, **notes, "rows": len(rows)}
            file.writelines(f"# {name}: {value}\n" for name, value in whole.items())
        file.writelines(map(writer.writerow, chain([header], rows)))


def _notes(thing: Any, *names: str) -> dict[str, str]:
    return {name: str(value) for name in names if (value := getattr(thing, name)) is not None}


def _pair(thing: Any, i: int, j: int) -> str:
    units = (thing.units[0][i], thing.units[1][j])
    return f"{thing.output_dofs[i]} / {thing.input_dofs[j]}" + (f" [{units[0]} / {units[1]}]" if any(units) else "")


def _impulse_table(response: ImpulseResponse) -> tuple[list[str], list[list[float]]]:
    if response.feedthrough is not None:
        fault = "its direct term has no column there"
        raise DataError("writing an impulse response as .csv was asked", fault, "Use .npz, .h5 or .uff.")
    _, outputs, inputs = response.values.shape
    header = ["time_s", *(_pair(response, i, j) for i in range(outputs) for j in range(inputs))]
    return header, np.column_stack([response.times, response.values.reshape(response.samples, -1)]).tolist()


def _frequency_table(frf: FrequencyResponse) -> tuple[list[str], list[list[float]]]:
    pairs = [_pair(frf, i, j) for i in range(frf.values.shape[1]) for j in range(frf.values.shape[2])]
    values = frf.values.reshape(len(frf.frequencies), -1)
    both = np.stack([values.real, values.imag], axis=2).reshape(values.shape[0], -1)
    header = ["frequency_hz", *(f"{part} {pair}" for pair in pairs for part in ("real", "imag"))]
    return header, np.column_stack([frf.frequencies, both]).tolist()


def _record_table(record: Signals) -> tuple[list[str], list[list[float]]]:
    if record.runs > 1:
        fault = f"there are {record.runs} runs, and a table holds one"
        raise DataError("writing records as .csv was asked", fault, "Use .npz or .h5, or write each run alone.")
    outputs, inputs = record.by_run()
    sides = [("out", label, unit) for label, unit in zip(record.output_dofs, record.units[0], strict=True)]
    sides += [("in", label, unit) for label, unit in zip(record.input_dofs, record.units[1], strict=True)]
    header = ["time_s", *(f"{side} {label}" + (f" [{unit}]" if unit else "") for side, label, unit in sides)]
    columns = [np.arange(record.samples) / record.sampling_rate, outputs[0]] + ([] if inputs is None else [inputs[0]])
    return header, np.column_stack(columns).tolist()


def _modes_table(modes: ModalModel) -> tuple[list[str], list[list[Any]]]:
    columns: dict[str, Sequence[Any]] = {"mode": list(range(1, len(modes) + 1))}
    columns |= {name: np.asarray(values).tolist() for name, values in modes.columns().items()}
    for label, row in zip(modes.output_dofs, modes.shapes, strict=True):
        columns |= {f"real {label}": row.real.tolist(), f"imag {label}": row.imag.tolist()}
    return list(columns), [list(row) for row in zip(*columns.values(), strict=True)]
