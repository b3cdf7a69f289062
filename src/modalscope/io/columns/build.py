"""Build records or frequency responses from a table, with an account of every column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals
from modalscope.io.columns.axis import check_numbers, sampling_of, with_rows
from modalscope.io.columns.clock import nearly_even
from modalscope.io.columns.lines import frequency_response, part_of, parts_by_name
from modalscope.io.columns.records import free_decay, nothing_measured, records
from modalscope.io.columns.table import Column, Table, as_word, span
from modalscope.io.columns.words import Role, ignored_columns, named_columns, role_by_words, short_unit, spoken_roles
from modalscope.io.contents import Contents, Finding, Options, needs

#: Options of every format that gives columns.
COLUMN_OPTIONS = ("columns", "ignore", "transpose", "rows", "resample")

#: A first column that rises evenly by less than this (s or Hz) is time: lines are never as close.
_MAX_TIME_STEP = 0.02
#: Why a column is what `--columns` says.
_REASON_OF_OPTION = "--columns says so"
_WORDS_OF_PARTS = {
    "real": "real part",
    "imag": "imaginary part",
    "mag": "magnitude",
    "phase": "phase",
    "coh": "coherence",
}


def contents_from_table(table: Table, options: Options) -> Contents:
    """Make the data object that a table holds.

    `options`: `columns` ("time=1,in=2,out=3-9"), `ignore` (numbers or names), `rows` ("1101-4000"), `units` (number or name -> unit),
    `sampling_rate`.

    Raises `DataError`: nothing to take, a time column that is not even or of another rate, an axis that is not known: the message names
    the option that says what was meant.
    """
    table = _with_units(with_rows(table, options.get("rows")), options.get("units"))
    ignored = ignored_columns(table.columns, options.get("ignore"))
    reasons_left = {column.number: "ignore names it" for column in ignored}
    columns = [column for column in table.columns if column.number not in reasons_left]
    spoken = spoken_roles(columns, options["columns"]) if options.get("columns") else {}
    roles = {column.number: _role(column, spoken, table.roles) for column in columns}
    for column in columns:
        if roles[column.number].role in ("ignore", "index"):
            reasons_left[column.number] = roles[column.number].reason or "it counts rows"
    candidates = [column for column in columns if column.number not in reasons_left]
    axis, kind, notes = _axis(table, candidates, roles, spoken, options)
    reasons_left |= {c.number: roles[c.number].reason for c in candidates if roles[c.number].role == "index"}
    others = [column for column in candidates if column is not axis and column.number not in reasons_left]
    _check_axis(table, axis, kind)
    check_numbers(table, others)
    if not others:
        raise nothing_measured(table, axis, kind, options)
    thing: FrequencyResponse | ImpulseResponse | Signals
    if kind == "frequency" and axis is not None:
        thing, notes_of_data, unused = frequency_response(table, axis, others, spoken)
    else:
        record, notes_of_data, unused = records(table, axis, others, roles, options)
        thing = free_decay(record, table.where) if "decay" in spoken.values() else record
    reasons_left |= unused
    reasons = {number: role.reason for number, role in roles.items()}
    findings = [Finding(part=part, what=what) for part, what in table.layout]
    findings += [_finding(column, kind, axis, reasons_left, reasons) for column in table.columns]
    notes = list(dict.fromkeys([*table.notes, *notes, *notes_of_data]))
    return Contents(thing=thing, findings=tuple(findings), notes=tuple(notes))


def _with_units(table: Table, units: Any) -> Table:
    """Return a table with the units that the option names, all written short."""
    units_by_number = {
        column.number: str(unit)
        for name, unit in (units.items() if isinstance(units, Mapping) else ())
        if name not in ("outputs", "inputs")
        for column in named_columns(table.columns, [str(name)], "units")
    }
    columns = (
        replace(column, unit=short_unit(units_by_number.get(column.number, column.unit))) for column in table.columns
    )
    return replace(table, columns=tuple(columns))


def _role(column: Column, spoken: Mapping[int, str], stated: Mapping[int, str]) -> Role:
    if column.number in spoken:
        return Role(role=spoken[column.number], reason=_REASON_OF_OPTION)
    if {"out", "decay", "real", "mag"} & set(spoken.values()):
        return Role(role="ignore", reason="--columns does not name it")
    if column.number in stated:
        return Role(role=stated[column.number], reason="its array is one by its name")
    return role_by_words(column)


def _axis(
    table: Table, columns: Sequence[Column], roles: dict[int, Role], spoken: Mapping[int, str], options: Options
) -> tuple[Column | None, str, list[str]]:
    """Return the column of times or frequencies, which of both it is, and notes."""
    for kind in ("time", "frequency"):
        named = [column for column in columns if roles[column.number].role == kind]
        if named:
            return named[0], kind, []
    rising = columns[0] if columns and not roles[columns[0].number].role else None
    rate = options.get("sampling_rate") or table.rate
    step = 0.0 if rising is None or len(columns) < 2 or spoken else _even_step(rising)
    if rising is not None and not step and not spoken and rate is None and _is_clock(rising, len(columns)):
        roles[rising.number] = Role(role="time", reason="it rises by nearly even steps")
        note = f"{rising} rises by nearly even steps: taken as time in s (else: --ignore {rising.number})"
        return rising, "time", [note]
    if rising is None or not step:
        return None, "", []
    if step == 1.0 and rate != 1.0 and np.array_equal(rising.values, np.rint(rising.values)):
        roles[rising.number] = Role(role="index", reason="it counts rows")
        return None, "", [f"{rising} counts rows: it was left"]
    rest = [column.number for column in columns[1:]]
    if parts_by_name(columns[1:], spoken):
        roles[rising.number] = Role(role="frequency", reason="it rises evenly with complex values")
        return rising, "frequency", [f"{rising} rises evenly with complex values: taken as frequency in Hz"]
    with_force = any(roles[column.number].role == "in" for column in columns[1:])
    if step < _MAX_TIME_STEP or with_force or (rate is not None and abs(step * rate - 1) < 1e-2):
        roles[rising.number] = Role(role="time", reason="it rises evenly")
        option = f'--columns "frequency={rising.number},..."'
        return rising, "time", [f"{rising} rises evenly by {step:.6g}: taken as time in s (else: {option})"]
    pairs = ",".join(f"real={a},imag={b}" for a, b in zip(rest[::2], rest[1::2], strict=False))
    fault = f"{rising} rises evenly by {step:.6g} from {rising.values[0]:g}, which may be either"
    remedy = f'Say which: --columns "time={rising.number},out={span(rest)}"'
    remedy += f', or --columns "frequency={rising.number},{pairs}".' if pairs else "."
    raise needs(table.where, "a column of time or frequency by its name or unit", fault, remedy)


def _is_clock(column: Column, count: int) -> bool:
    """Whether a first column is of times whose clock is uneven."""
    values = np.asarray(column.values)
    real = not column.textual and not np.iscomplexobj(values) and bool(np.isfinite(values).all())
    return (
        real and count > 1 and nearly_even(values.astype(float)) and float(np.median(np.diff(values))) < _MAX_TIME_STEP
    )


def _even_step(column: Column) -> float:
    """Return the step of a column that rises evenly; 0 of one that does not."""
    values = np.asarray(column.values)
    if column.textual or np.iscomplexobj(values) or values.size < 3 or not np.isfinite(values).all():
        return 0.0
    try:
        return 1 / sampling_of(values.astype(float)).rate
    except DataError:
        return 0.0


def _check_axis(table: Table, axis: Column | None, kind: str) -> None:
    if axis is not None and (axis.textual or np.iscomplexobj(axis.values)):
        fault = f"{axis} holds {'text' if axis.textual else 'complex values'}"
        raise needs(table.where, f"real numbers as {kind}", fault, f"Leave it out: --ignore {as_word(axis.label)}")


def _finding(
    column: Column, kind: str, axis: Column | None, omitted: Mapping[int, str], reasons: Mapping[int, str]
) -> Finding:
    name = f"{column.label} [{column.unit}]" if column.unit else column.label
    if column.number in omitted:
        return Finding(part=f"column {column.number}", what=name, taken=False, reason=omitted[column.number])
    reason = reasons.get(column.number)
    part = part_of(column.name) if kind == "frequency" and reason != _REASON_OF_OPTION else None
    reason = reason if part is None else _WORDS_OF_PARTS[part[1]]
    why = f" ({reason})" if reason else ""
    if axis is not None and column.number == axis.number:
        return Finding(part=f"column {column.number}", what=f"{name}: {kind}{why}")
    return Finding(part=f"column {column.number}", what=f"{name}{why}")
