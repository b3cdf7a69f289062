"""Build records or frequency responses from a table, with an account of every column."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, Signals
from modalscope.io.columns.axis import check_numbers, with_rows
from modalscope.io.columns.blanks import with_least_lost
from modalscope.io.columns.lines import WORDS_OF_PARTS, frequency_response, part_of
from modalscope.io.columns.reading import NEAR, Reading, readings
from modalscope.io.columns.records import begin_of, free_decay, nothing_measured, records
from modalscope.io.columns.table import Column, Table, as_word
from modalscope.io.columns.vocabulary import meanings_of
from modalscope.io.columns.weights import even_step, likeliest_force
from modalscope.io.columns.words import ignored_columns, named_columns, roles_of_option, short_unit
from modalscope.io.contents import Contents, Finding, Options, needs

#: Why a column is what `--columns` says.
_REASON_OF_OPTION = "said by --columns"


def contents_from_table(table: Table, options: Options) -> Contents:
    """Make the data object that a table holds.

    `options`: `columns` ("time=1,in=2,out=3-9"), `ignore` (numbers or names), `rows` ("1101-4000"), `units` (number or name -> unit),
    `sampling_rate`, `content` ("record" or "response": what other files of the test are; empty where they do not say it).

    Raises `DataError`: nothing to take, a time column that is not even or of another rate, an axis that is not known: the message names
    the option that says what was meant.
    """
    table = with_rows(_real_where_real(table), options.get("rows"))
    table = _with_units(table, options.get("units"), options.get("content") is not None)
    ignored = {column.number for column in ignored_columns(table.columns, options.get("ignore"))}
    columns = [column for column in table.columns if column.number not in ignored]
    option_roles = roles_of_option(columns, options["columns"]) if options.get("columns") else {}
    rate = options.get("sampling_rate") or table.rate
    found = readings(table, columns, option_roles, rate)
    margin = 0.0 if option_roles else _margin(found)
    if options.get("content"):
        found = readings(table, columns, option_roles, rate, options["content"])
    if not option_roles and not options.get("content"):
        _refuse_near(table, found, _works(table, columns, options))
    contents = _read(table, columns, found, option_roles, options)
    weighed = [] if option_roles else [Finding(part="reading", what=_compared(found))]
    return replace(contents, found=(*contents.found, *weighed), margin=margin)


def _margin(found: Sequence[Reading]) -> float:
    """Return by how much the best record is likelier than the best responses, in log likelihood."""
    best = {content: max(r.score for r in found if r.content == content) for content in ("record", "response")}
    return float(best["record"] - best["response"])


def _compared(found: Sequence[Reading]) -> str:
    """Return which reading was likelier, in words."""
    words = {"record": "a record over time", "response": "responses over frequency"}
    content = found[0].content
    other = "response" if content == "record" else "record"
    return f"{words[content]} rather than {words[other]}"


def _read(
    table: Table, columns: Sequence[Column], found: Sequence[Reading], option_roles: Mapping[int, str], options: Options
) -> Contents:
    """Return what the first of some readings makes of a table."""
    reading = found[0]
    axis, kind, roles = reading.axis, reading.kind, reading.roles
    omitted = {c.number: "ignore names it" for c in table.columns if c not in columns}
    omitted |= {c.number: reading.reasons.get(c.number, "") for c in columns if roles[c.number] in ("ignore", "index")}
    others = [c for c in columns if c is not axis and c.number not in omitted]
    _check_axis(table, axis, kind)
    measured = [c for c in others if roles[c.number] != "time"]
    table, blank = with_least_lost(table, axis, measured, reading.option, named=bool(option_roles))
    omitted |= blank
    kept = {column.number: column for column in table.columns}
    axis, others = axis and kept[axis.number], [kept[c.number] for c in others if c.number not in blank]
    check_numbers(table, [column for column in others if roles[column.number] != "time"])
    if not others:
        raise nothing_measured(table, axis, kind, options)
    thing: FrequencyResponse | ImpulseResponse | Signals
    notes = _notes(found, option_roles, table)
    if kind == "frequency":
        lines = _lines(table) if axis is None else axis
        works = _works(table, columns, options)
        thing, notes_of_data, unused = frequency_response(table, lines, others, roles, option_roles, works)
    else:
        record, notes_of_data, unused = records(table, axis, others, roles, options)
        free = replace(reading, roles={number: role for number, role in roles.items() if role != "in"})
        thing = free_decay(record, table.where, free.option) if "decay" in option_roles.values() else record
    findings = [Finding(part=part, what=what) for part, what in table.layout]
    findings += [_finding(column, reading, omitted | unused) for column in table.columns]
    said = tuple(dict.fromkeys([*table.notes, *notes, *notes_of_data]))
    begins = begin_of(axis) if axis is not None and kind == "time" else 0.0
    return Contents(thing=thing, found=tuple(findings), notes=said, begins=table.begins + begins)


def _works(table: Table, columns: Sequence[Column], options: Options) -> Callable[[str], bool]:
    """Return whether words of `--columns` read a table, or lead to the question of its rate or of a unit; messages name no others."""

    def works(words: str) -> bool:
        if options.get("columns"):
            return True
        option_roles = roles_of_option(columns, words)
        try:
            found = readings(table, columns, option_roles, options.get("sampling_rate") or table.rate)
            _read(table, columns, found, option_roles, {**options, "columns": words})
        except DataError as error:
            return "--sampling-rate HZ" in error.change or "--units" in error.change
        return True

    return works


def _lines(table: Table) -> Column:
    """Return the frequencies that a header says by the first and the step.

    Raises `DataError`: none are said.
    """
    if table.lines is None:
        fault = "no column is of frequencies, and no header says their first and their step"
        raise needs(table.where, "frequencies of its responses", fault, "Export the frequencies in a column with them.")
    first, step = table.lines
    return Column(number=0, name="frequency", unit="Hz", values=first + step * np.arange(table.rows))


def _real_where_real(table: Table) -> Table:
    """Return a table whose complex columns without an imaginary part are real, as arrays of one kind of number have them."""
    bare = [c for c in table.columns if np.iscomplexobj(c.values) and not c.values.imag.any()]
    if not bare or len(bare) == sum(np.iscomplexobj(c.values) for c in table.columns):
        return table
    return replace(table, columns=tuple(replace(c, values=c.values.real) if c in bare else c for c in table.columns))


def _with_units(table: Table, units: Any, several: bool) -> Table:
    """Return a table with the units that the option names, all written short.

    Names of channels, which come of several columns, are for later; so are, `several`, those that other files of the test have.
    """
    stems = {stem for c in table.columns for stem in (part_of(c.name) or (c.name,))[0].split("/")[:1]}
    known = {str(c.number) for c in table.columns} | {name for c in table.columns for name in (c.name, c.label)}
    units_by_number = {
        column.number: str(unit)
        for name, unit in (units.items() if isinstance(units, Mapping) else ())
        if name not in ("outputs", "inputs") and (name in known or not (several or name in stems))
        for column in named_columns(table.columns, [str(name)], "units")
    }
    columns = (replace(c, unit=short_unit(units_by_number.get(c.number, c.unit))) for c in table.columns)
    return replace(table, columns=tuple(columns))


def _refuse_near(table: Table, found: Sequence[Reading], works: Callable[[str], bool]) -> None:
    """Ask which of two readings is meant where a record and responses are nearly as likely."""
    best = found[0]
    second = next((r for r in found if r.content != best.content), None)
    if second is None or best.score - second.score > NEAR or best.axis is None or second.axis is not best.axis:
        return
    both = {reading.content: reading for reading in (best, second)}
    axis = best.axis
    step = even_step(np.asarray(axis.values))
    fault = f"{axis} is evenly spaced by {step:.6g} from {axis.values[0]:g}, which may be time or frequency"
    rest = [c.number for c in table.columns if c.number in best.roles and c is not axis and not c.textual]
    pairs = ",".join(f"real={a},imag={b}" for a, b in zip(rest[::2], rest[1::2], strict=False))
    lines = both["response"].option if "imag=" in both["response"].option else f"frequency={axis.number},{pairs}"
    ways = [*_record_options(table, both["record"]), *([lines] if pairs else [])]
    ways = [f'--columns "{words}"' for words in ways if works(words)]
    if ways:
        remedy = f"Say which: {', or '.join(ways)}."
        raise needs(table.where, "a column of time or frequency by its name or unit", fault, remedy)


def _record_options(table: Table, reading: Reading) -> list[str]:
    """Return the words of `--columns` for a record; where no column is a force by name and others follow one, also with that."""
    outputs = [column for column in table.columns if reading.roles.get(column.number) == "out"]
    if "in" in reading.roles.values() or len(outputs) < 2:
        return [reading.option]
    force, followed = likeliest_force(outputs)
    driven = replace(reading, roles={**reading.roles, force.number: "in"})
    return [driven.option, reading.option] if followed else [reading.option]


def _notes(found: Sequence[Reading], option_roles: Mapping[int, str], table: Table) -> list[str]:
    """Return what was concluded from values alone, and the option that says otherwise."""
    reading = found[0]
    axis, roles, notes = reading.axis, reading.roles, []
    reason = reading.reasons.get(axis.number, "") if axis is not None else ""
    if axis is not None and axis.number not in option_roles and reason.startswith("it rises"):
        real = not any(np.iscomplexobj(c.values) for c in table.columns)  # complex values are no record
        other = next((r.option for r in found if r.axis is axis and r.kind != reading.kind and real), "")
        other = f' (else: --columns "{other}")' if "out=" in other or "imag=" in other or "phase=" in other else ""
        unit = "s" if reading.kind == "time" else "Hz"
        notes.append(f"{axis} {reason[3:]}: taken as {reading.kind} in {unit}{other}")
    if axis is None and reading.content == "response" and table.lines is not None:
        notes.append(f"frequencies start at {table.lines[0]:g} Hz with a step of {table.lines[1]:g} Hz, by the header")
    for column in table.columns:
        role, why = roles.get(column.number), reading.reasons.get(column.number, "")
        if column.number in option_roles or column.textual or not why.startswith("it "):
            continue
        if role == "index" and why == "it counts rows":
            notes.append(f"{column} ignored: it counts rows")
        elif role in ("ignore", "in"):
            done = "ignored" if role == "ignore" else "taken as a force"
            note = f"{column} {done}: {why}"
            if reading.content == "record":
                other = "in" if "drive" in dict(meanings_of(column.name)) and role == "ignore" else "out"
                otherwise = replace(reading, roles={**roles, column.number: other}).option
                note += f' (else: --columns "{otherwise}")'
            notes.append(note)
    return notes


def _check_axis(table: Table, axis: Column | None, kind: str) -> None:
    if axis is not None and (axis.textual or np.iscomplexobj(axis.values)):
        fault = f"{axis} holds {'text' if axis.textual else 'complex values'}"
        raise needs(table.where, f"real numbers as {kind}", fault, f"Leave it out: --ignore {as_word(axis.label)}")


def _finding(column: Column, reading: Reading, omitted: Mapping[int, str]) -> Finding:
    part, name = f"column {column.number}", f"{column.label} [{column.unit}]" if column.unit else column.label
    if column.number in omitted:
        return Finding(part=part, what=name, taken=False, reason=omitted[column.number] or "nothing says what it is")
    role, reason = reading.roles.get(column.number, ""), reading.reasons.get(column.number, "")
    words = [WORDS_OF_PARTS[role]] if role in WORDS_OF_PARTS and reason != _REASON_OF_OPTION else []
    why = f" ({', '.join([*words, *([reason] if reason and not words else [])])})" if reason or words else ""
    is_axis = reading.axis is not None and column.number == reading.axis.number
    return Finding(part=part, what=f"{name}: {reading.kind}{why}" if is_axis else f"{name}{why}")
