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

Tables of responses and records also say how many rows they have: `# rows: 300`. Another number of rows, a line that is no row, or samples
that do not follow at the rate of the header, are refused.

Columns are separated by comma, semicolon or tab, whichever the header has. Numbers are written with every digit. Coherence,
variance, geometry and direct terms have no column: .npz, .h5 and .uff keep them. Participation, reasons and notes of modes have none: .json
keeps them.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, ModalModel, Signals
from modalscope.data.mode_fields import COLUMNS, DEGREES, DERIVED
from modalscope.data.response import Response
from modalscope.io import text
from modalscope.io.arrays import joined
from modalscope.io.atomic import MARK
from modalscope.io.columns import Column, Table
from modalscope.io.columns.lines import matrix_of
from modalscope.io.columns.records import sampling_rate
from modalscope.io.columns.vocabulary import MAX_CHARACTERS
from modalscope.io.columns.words import is_unit
from modalscope.io.contents import Contents, DataObject, Finding, Options, needs, unreadable
from modalscope.io.limits import room
from modalscope.io.options import TEXT
from modalscope.io.text.body import CHARACTERS_SHOWN, read_body
from modalscope.io.text.cells import Dialect, split
from modalscope.io.text.dialect import encoding_of, lines_of
from modalscope.numerics.checks import Array
from modalscope.numerics.functions.poles import poles_from

_PAIR = re.compile(
    r"^(?:(?P<part>real|imag)\s+)?(?P<out>[^/\[\]]+?)\s*/\s*(?P<in>[^/\[\]]+?)\s*(?:\[(?P<unit>.*?)(?: / (?P<unit_in>.*))?\])?$"
)
_SIDE = re.compile(r"^(?P<side>out|in)\s+(?P<dof>.+?)\s*(?:\[(?P<unit>.*)\])?$")
#: Columns by which a table of modes is known.
_OF_MODES = {"frequency_hz", "damping_ratio"}
#: Columns of words in a table of modes.
_OF_WORDS = ("kind", "grade", "reason", "type", "remark")
#: What stands in a header without ambiguity.
_PLAIN = re.compile(r"[\w :+.²³µ-]*|\w+/\w+²?")
#: Steps that the first time may lie beside its place: one row less is a whole step.
_MAX_SHIFT = 0.5
#: Labels examined to recognize a table of this layout.
_MAX_LABELS = 1000


class _Table(NamedTuple):
    """What a table of this layout holds: what comments say, the names of its columns, and their values."""

    where: str
    notes: dict[str, str]
    header: list[str]
    columns: list[Array]


#: Largest number of a mode that is looked for, and missing ones that are named at most.
_MAX_NUMBER, _NAMED = 10_000, 8


def read(path: Path, options: Options) -> Contents:
    """Read a response or a record: in the layout above, or as anybody writes it."""
    table = None if set(TEXT) & set(options) else _own_table(path)
    if table is None:
        return text.read(path, options)
    if set(table.header) >= _OF_MODES:
        thing: DataObject = _modes(table)
    elif table.header[0] == "frequency_hz":
        thing = _frequency_response(table)
    elif len(table.header) > 1 and all(map(_SIDE.match, table.header[1:])):
        thing = _records(table)
    else:
        thing = _impulse_response(table)
    findings = tuple(Finding(part="column", what=name) for name in table.header)
    return Contents(thing=thing, found=findings, notes=_edited(table))


def _own_table(path: Path) -> _Table | None:
    """Return the table of a file in the layout above, every row of it; None where its first line is of any other.

    Raises `DataError`: lines that are no rows, or another number of rows than its header says.
    """
    with path.open("rb") as file:
        if not file.readline(MAX_CHARACTERS).strip():
            return None
    space, notes, head, encoding = room(path.name, path.stat().st_size), dict[str, str](), "", encoding_of(path)
    lines = lines_of(path, encoding, 0, space)
    for _, head in lines:
        if not head.startswith("#"):
            break
        name, colon, value = head.lstrip("# ").partition(":")
        notes |= {name.strip(): value.strip()} if colon else {}
        space.parts("comments", len(notes))
    delimiter = max(",;\t", key=head.count)
    if not _is_own([cell.strip().strip('"') for cell in head.split(delimiter)]):
        return None
    if encoding == "cp1252":
        remedy = "Save it as UTF-8, or give it the suffix of what it is."
        raise unreadable(f"{path.name} as CSV", "it is not text in UTF-8", remedy)
    space.parts("columns", head.count(delimiter) + 1)
    header = split(head, Dialect(delimiter=delimiter, quoted=True))
    words = _OF_WORDS if set(header) >= _OF_MODES else ()
    kinds = ["text" if name in words else "number" for name in header]
    dialect = Dialect(delimiter=delimiter, quoted=bool(words) or '"' in head)
    arrays, left = read_body(path.name, lines, kinds, dialect, len(header), space, whole=True)
    if left or not arrays:
        fault = left[0] if left else "it has no rows"
        raise needs(path.name, f"{len(header)} numbers in every row", fault, "Correct them, or copy it again.")
    columns = [(name, array) for name, array in zip(header, arrays, strict=True) if name not in words]
    table = _Table(path.name, notes, [name for name, _ in columns], [array for _, array in columns])
    if _number(table, "rows") not in (None, len(arrays[0])):
        remedy = "Restore them or copy it again; if it was cut on purpose, take the comment `# rows` out."
        stated = f"{notes['rows'][:CHARACTERS_SHOWN]} rows, as its header says"
        raise needs(path.name, stated, f"it has {len(arrays[0])}", remedy)
    return table


def _is_own(cells: list[str]) -> bool:
    """Whether a table has the layout above: by its first column and what the others are called."""
    if cells[0] not in ("frequency_hz", "time_s"):
        return set(cells) >= _OF_MODES
    for label in (cell[:MAX_CHARACTERS].strip() for cell in cells[1:_MAX_LABELS]):
        pair = _PAIR.match(label)
        if _SIDE.match(label) or (pair and (pair["part"] or pair["in"] == "1" or not is_unit(pair["in"]))):
            return True
    return len(cells) < 2


def _edited(table: _Table) -> tuple[str, ...]:
    """Say that modes were taken out, by their numbers."""
    if table.header[0] != "mode":
        return ()
    numbers = table.columns[0][np.isfinite(table.columns[0])]
    gone = np.setdiff1d(np.arange(1, min(numbers.max(initial=0), _MAX_NUMBER) + 1), numbers)
    which = ", ".join(f"{k:g}" for k in gone[:_NAMED]) + (" ..." if gone.size > _NAMED else "")
    return (f"edited since it was written: without mode {which}",) if gone.size else ()


def _number(table: _Table, name: str) -> float | None:
    """Return the number that a comment gives; None where there is no such comment."""
    try:
        return float(table.notes[name]) if name in table.notes else None
    except ValueError:
        fault = f"it is {table.notes[name][:CHARACTERS_SHOWN]!r}"
        raise DataError(f"{name} in {table.where} needs a number", fault, "Correct the comment.") from None


def _rate(table: _Table) -> float:
    """Return the rate that the header says and the times agree with."""
    times, stated = Column(number=1, name="time_s", unit="s", values=table.columns[0]), _number(table, "sampling_rate")
    return sampling_rate(Table(where=table.where, columns=(times,), rate=stated, rate_from="its header"), times, {})[0]


def _said(table: _Table, *names: str) -> dict[str, Any]:
    """Return the fields that comments give in words."""
    return {name: table.notes[name] for name in names if name in table.notes}


def _frequency_response(table: _Table) -> FrequencyResponse:
    fields = _pairs(table, ("real", "imag")) | _said(table, "quantity")
    return FrequencyResponse(frequencies=table.columns[0], sampling_rate=_number(table, "sampling_rate"), **fields)


def _impulse_response(table: _Table) -> ImpulseResponse:
    fields = {"kind": "dirac", **_pairs(table, ("",)), **_said(table, "quantity", "kind")}
    if (start := _number(table, "first_sample")) is not None:
        fields["first_sample"] = int(start) if start.is_integer() else start
    thing, first = ImpulseResponse(sampling_rate=_rate(table), **fields), float(table.columns[0][0])
    late = abs(first - thing.times[0]) * thing.sampling_rate >= _MAX_SHIFT
    if late and {"written by", "sampling_rate"} <= set(table.notes):
        fault = f"row 1 under the header lies at {first:.9g} s"
        raise needs(table.where, f"samples from {thing.times[0]:.9g} s on", fault, "Restore the missing rows.")
    return thing


def _pairs(table: _Table, parts: tuple[str, ...]) -> dict[str, Any]:
    """Return values, labels and units of responses, of which each has a column a part."""
    found: dict[tuple[str, str], dict[str, Array]] = {}
    units: dict[tuple[str, str], tuple[str, str]] = {}
    for label, values in zip(table.header[1:], table.columns[1:], strict=True):
        match = _PAIR.match(label) if len(label) <= MAX_CHARACTERS else None
        pair, part = (match["out"], match["in"]) if match else ("", ""), (match["part"] or "") if match else "none"
        if match is None or part not in parts or part in found.setdefault(pair, {}):
            need = f"columns such as {f'{parts[0]} 3:+Z / 1:+Z'.strip()}, each once"
            raise needs(table.where, need, f"there is {label[:MAX_CHARACTERS]!r}", "Rename that column.")
        found[pair][part] = values
        units[pair] = (match["unit"] or "", match["unit_in"] or "")
    missing = [f"{part} {' / '.join(pair)}".strip() for pair, of in found.items() for part in parts if part not in of]
    if missing or not found:
        fault = f"missing: {', '.join(missing[:5]) or 'all'}"
        raise needs(table.where, "a column for every output and input", fault, "Add them, or leave out that channel.")
    responses = {p: (joined(of["real"], of["imag"]) if len(parts) > 1 else of[""], units[p]) for p, of in found.items()}
    outputs, inputs, units_of, values = matrix_of(table.where, responses)
    return {"values": values, "output_dofs": outputs, "input_dofs": inputs, "units": units_of}


def _modes(table: _Table) -> ModalModel:
    """Return the modes of a table: what no column of this layout is named after is an indicator."""
    columns: dict[str, Any] = dict(zip(table.header, table.columns, strict=True))
    outputs = [name.removeprefix("real ") for name in table.header if name.startswith("real ")]
    parts = [[columns.pop(f"{part} {dof}", None) for dof in outputs] for part in ("real", "imag")]
    missing = [dof for dof, imag in zip(outputs, parts[1], strict=True) if imag is None]
    f, zeta = columns.pop("frequency_hz"), columns.pop("damping_ratio")
    if missing or len(columns) + 2 + 2 * len(outputs) != len(table.header) or not np.all((f >= 0) & (abs(zeta) <= 1)):
        fault = f"imag {missing[0]} is missing" if missing else "a name stands twice, or a value is none of a mode"
        need = "each column once, real and imaginary parts of shapes, frequencies from 0 on and damping ratios within 1"
        raise needs(table.where, need, fault, "Correct that column.")
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


def _records(table: _Table) -> Signals:
    matches = zip(map(_SIDE.match, table.header[1:]), table.columns[1:], strict=True)
    sides = [(match["side"], match["dof"], match["unit"] or "", values) for match, values in matches if match]
    out, into = ([channel for channel in sides if channel[0] == side] for side in ("out", "in"))
    words = table.notes.get("quantities")
    quantities: Any = None if words is None else [word.strip() or None for word in words.split(",")]
    return Signals(
        outputs=np.stack([values for *_, values in out] or [np.zeros(0)], axis=1),
        inputs=np.stack([values for *_, values in into], axis=1) if into else None,
        sampling_rate=_rate(table),
        quantities=quantities,
        output_dofs=tuple(dof for _, dof, _, _ in out),
        input_dofs=tuple(dof for _, dof, _, _ in into),
        units=(tuple(unit for _, _, unit, _ in out), tuple(unit for _, _, unit, _ in into)),
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
        raise DataError(f"writing {type(thing).__name__} as .csv:", "there is no such table", "Use .npz, .h5 or .uff.")
    _check_header(path, thing, table[0])
    _put(path, notes, *table)


def _check_header(path: Path, thing: Signals | Response, header: Sequence[str]) -> None:
    """Raise when the header does not give the labels and units back, which may hold its separators."""
    _put(path, {}, header, [[k] * len(header) for k in (1, 2)])
    try:
        again: Any = read(path, {}).thing
        restored = all(getattr(again, name) == getattr(thing, name) for name in ("output_dofs", "input_dofs", "units"))
    except DataError:
        restored = False
    if not restored:
        labels = (*thing.output_dofs, *thing.input_dofs, *thing.units[0], *thing.units[1])
        odd = [repr(label) for label in dict.fromkeys(labels) if not _PLAIN.fullmatch(label)]
        asked = f"writing the labels and units {', '.join(odd or map(repr, labels))} as .csv:"
        raise DataError(asked, "its header of columns would not give them back", "Rename them, or use .npz or .h5.")


def _put(path: Path, notes: dict[str, str] | None, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        if notes is not None:
            whole = {"written by": MARK, **notes, "rows": len(rows)}
            file.writelines(f"# {name}: {value}\n" for name, value in whole.items())
        csv.writer(file, lineterminator="\n").writerows(chain([header], rows))


def _notes(thing: Any, *names: str) -> dict[str, str]:
    return {name: str(value) for name in names if (value := getattr(thing, name)) is not None}


def _pair(thing: Any, i: int, j: int) -> str:
    units = (thing.units[0][i], thing.units[1][j])
    return f"{thing.output_dofs[i]} / {thing.input_dofs[j]}" + (f" [{units[0]} / {units[1]}]" if any(units) else "")


def _impulse_table(response: ImpulseResponse) -> tuple[list[str], list[list[float]]]:
    if response.feedthrough is not None:
        fault = "its direct term has no column there"
        raise DataError("writing an impulse response as .csv:", fault, "Use .npz, .h5 or .uff.")
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
        raise DataError("writing records as .csv:", fault, "Use .npz or .h5, or write each run alone.")
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
