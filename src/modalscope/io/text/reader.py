"""Read text tables (.csv, .txt, .asc, .tsv, .dat) by their content.

What stands in the file decides: which sign parts cells and which is the decimal one (`dialect`), where the body begins, what its columns
are called and in which units (`layout`), and which of them is time, an input or half of a complex value (`columns`). Options say what
the file does not. `modalscope info` shows the evidence.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path

import numpy as np

from modalscope.data import DataError
from modalscope.io.columns import Column, Table, contents_from_table
from modalscope.io.columns.axis import rises, same_rate
from modalscope.io.columns.facts import Stated, Statement, stated_by, steps_of
from modalscope.io.columns.lines import part_of
from modalscope.io.columns.vocabulary import SENSORS, words_of
from modalscope.io.columns.weights import even_step, role_by_words
from modalscope.io.columns.words import ignored_columns, is_unit
from modalscope.io.contents import Contents, Options, unreadable
from modalscope.io.limits import Room, room
from modalscope.io.text.blocks import blocks_of, key_of, names_of, one_table, repeats
from modalscope.io.text.body import kinds_of, read_body
from modalscope.io.text.cells import Dialect, is_value, seconds_of, split, uncommented
from modalscope.io.text.dialect import DELIMITERS, Line, dialect_of, encoding_of, lines_of, words_of_delimiter
from modalscope.io.text.labview import is_labview, labview_contents
from modalscope.io.text.layout import Layout, layout_of
from modalscope.io.text.wrapped import WrappedHead, gathered, head_of, runs_on, wrapped_contents
from modalscope.numerics.checks import Array, check_count, check_positive
from modalscope.numerics.errors import check_choice

#: Lines, and characters of them, from which the layout is determined.
_LINES_EXAMINED, _CHARACTERS_EXAMINED = 1000, 1 << 20
#: Cells of a row at most: channels, or samples where rows are channels.
_MAX_COLUMNS, _MAX_SAMPLES = 20_000, 10_000_000
#: Columns that one statement of a unit is about, at most: a quantity, or the two parts of one.
_MAX_COLUMNS_OF_UNIT = 2
#: Bytes of a row and of a cell as lists.
_BYTES_OF_ROW, _BYTES_OF_CELL = 120, 60

#: A line that stands in quotation marks as a whole, several cells in it.
_QUOTED = re.compile(r'\s*"((?:[^"]|"")*[,;\t|](?:[^"]|"")*)"[,;\s]*\Z')


def read(path: Path, options: Options) -> Contents:
    """Read a text table (options `columns`, `ignore`, `units`, `skip`, `decimal`, `delimiter`, `transpose`, `sampling_rate`).

    Raises `DataError`: no table, or one of which something is not certain: the message names the option that says it.
    """
    space = room(path.name, path.stat().st_size)
    skip = 0 if options.get("skip") is None else check_count("skip", options["skip"], least=0)
    encoding = encoding_of(path)
    notes = ("its text is not UTF-8: read as Windows-1252",) if encoding == "cp1252" else ()
    lines = lines_of(path, encoding, skip, space)
    first = next(lines, (0, ""))
    lines = chain([first] if first[1] else [], lines)
    if (key := key_of(first[1])) and not encoding.startswith("utf-16") and repeats(path, key):
        every = list(lines)
        space.take("its lines", sum(len(line) for _, line in every) + _BYTES_OF_ROW * len(every))
        blocks, lines = blocks_of(every, key), iter(every)
        if len(blocks) > 1 and not options.get("transpose"):
            names = names_of(blocks)
            tables = [_table(path.name, block, iter(()), _signs(options), space, options) for block in blocks]
            table = one_table(path.name, tables, names, options)
            return contents_from_table(replace(table, notes=(*table.notes, *notes)), options)
    return contents_of_lines(path.name, lines, _signs(options), space, options, notes)


def contents_of_lines(
    where: str,
    lines: Iterator[Line],
    signs: tuple[str | None, str | None],
    space: Room,
    options: Options,
    notes: tuple[str, ...] = (),
) -> Contents:
    """Make the data object that the lines of a table hold.

    `lines`: number and text. `signs`: delimiter and decimal sign, where they are known. `notes`: on the file.

    Raises `DataError`: as `read`.
    """
    first = _first(lines, space, _MAX_SAMPLES if options.get("transpose") else _MAX_COLUMNS)
    if len(first) > 1 and all(_QUOTED.match(line) for _, line in first):  # each line is one cell to others
        first, lines = [(k, _unquoted(line)) for k, line in first], ((k, _unquoted(line)) for k, line in lines)
    bare = [_in_place(line) for _, line in first]
    if is_labview(bare):
        return labview_contents(where, chain(first, lines), space, options)
    head = head_of(bare)
    if head is not None:
        rate = options.get("sampling_rate")
        rate = None if rate is None else check_positive("sampling_rate", rate)
        below = gathered(head, chain(islice(first, head.lines, None), lines), len(first), space)
        if runs_on(head, below, rate):
            contents = wrapped_contents(where, head, chain(below, lines), space, options)
            _refuse_cells(where, options, signs[0])
            return replace(contents, notes=(*contents.notes, *notes))
        lines = chain(below[len(first) - head.lines :], lines)
    table = _table(where, first, lines, signs, space, options, head if head is not None and head.sure else None)
    return contents_from_table(replace(table, notes=(*table.notes, *notes)), options)


def _unquoted(line: str) -> str:
    match = _QUOTED.match(line)
    return match[1].replace('""', '"') if match else line


def _in_place(line: str) -> str:
    """Return a line without the sign of a comment before it, its cells where they stood."""
    text, sign = uncommented(line)
    bare = line.strip("\r\n")
    behind = bare.lstrip().lstrip(bare.lstrip()[:1]) if sign else ""
    return " " * (len(bare) - len(behind)) + behind if sign else text


def _refuse_cells(where: str, options: Options, delimiter: str | None) -> None:
    """Raise where options ask for cells or rows of what has none: samples that run on over the lines."""
    meant = {
        "transpose": bool(options.get("transpose")),
        "delimiter": options.get("delimiter") is not None and delimiter != "",
        "decimal": options.get("decimal") == ",",
    }
    given = [name for name, refused in meant.items() if refused]
    if given:
        names = " and ".join(given)
        fault = "it is one channel, its samples separated by blanks and continued over the lines (NPTS)"
        raise DataError(f"{names} of {where}:", fault, f"Leave {names} out.")


def _signs(options: Options) -> tuple[str | None, str | None]:
    delimiter, decimal = options.get("delimiter"), options.get("decimal")
    if decimal is not None:
        check_choice("decimal", decimal, (".", ","))
    names = {"tab": "\t", "\\t": "\t", "space": "", "blank": "", "blanks": "", " ": "", "comma": ",", "semicolon": ";"}
    if delimiter is not None:
        delimiter = names.get(str(delimiter), delimiter)
        if not isinstance(delimiter, str) or len(delimiter) > 1:
            fault = "it is not a single character"
            raise DataError(f"delimiter={delimiter!r}:", fault, 'Give one sign, or "tab" or "space".')
    return delimiter, decimal


def _first(lines: Iterator[Line], space: Room, most: int) -> list[Line]:
    """Return the first lines, from which the layout is determined."""
    first: list[Line] = []
    size = 0
    for line in lines:
        first.append(line)
        size += len(line[1])
        if len(line[1]) > 2 * _MAX_COLUMNS:
            _check_width(line, space, most)
        if len(first) >= _LINES_EXAMINED or (size > _CHARACTERS_EXAMINED and len(first) > 1):
            break
    space.take("its first lines", size)
    return first


def _check_width(line: Line, space: Room, most: int) -> None:
    """Refuse more cells in a row than anybody has, and name the option for rows that are channels."""
    try:
        space.parts(f"cells in line {line[0]}", max(line[1].count(sign) for sign in "\t;,| "), most)
    except DataError as error:
        if most > _MAX_COLUMNS:
            raise
        remedy = f"If every row is a channel, exchange rows and columns: --transpose. {error.change}"
        raise DataError(error.asked, error.found, remedy) from None


def _transposed(lines: Iterator[Line], dialect: Dialect, space: Room) -> tuple[list[str], Dialect]:
    """Return rows and columns exchanged, as lines of tabs."""
    first = next(lines, (0, ""))
    best = max(DELIMITERS, key=lambda sign: len(split(first[1], Dialect(delimiter=sign))))
    dialect = dialect if dialect.delimiter or best == "" else replace(dialect, delimiter=best)
    rows = []
    for _, line in chain([first], lines):
        cells = split(uncommented(line)[0], dialect)
        space.take("its cells", _BYTES_OF_ROW + _BYTES_OF_CELL * len(cells))
        rows.append(cells)
    width = max(map(len, rows), default=0)
    whole = [row for row in rows if len(row) == width]
    above = ["\t".join(row) for row in rows if len(row) != width]  # statements, such as the rate
    turned = [*above, *("\t".join(cells) for cells in zip(*whole, strict=True))]
    return turned, Dialect(delimiter="\t", decimal=dialect.decimal, thousands=dialect.thousands)


def _no_body(where: str, bare: list[str], options: Options) -> DataError:
    skip = options.get("skip")
    for sign in DELIMITERS if not options.get("transpose") else ():
        rows = [split(line, Dialect(delimiter=sign)) for line in bare[:200]]
        named = [row for row in rows if len(row) > 2 and all(map(is_value, row[1:]))]
        if len(named) > 1 and max(map(len, named)) > len(named):
            cells = f"a name and {len(named[0]) - 1} numbers, as if every row were a channel"
            return unreadable(where, f"{len(named)} of its rows are {cells}", "Exchange rows and columns: --transpose")
    skipped = f" below the {skip} skipped" if skip else ""
    fault = f"no rows of numbers begin in the first {len(bare)} lines{skipped} (the first is {bare[0][:40] if bare else ''!r})"
    remedy = "Export the table as text with one row per sample or line; lines above it may be left out: --skip N"
    return unreadable(f"{where} as a table", fault, remedy)


def _table(
    where: str,
    first: list[Line],
    lines: Iterator[Line],
    signs: tuple[str | None, str | None],
    space: Room,
    options: Options,
    head: WrappedHead | None = None,
) -> Table:
    """Return the table of some first lines and those that follow; `head`: what counts its samples, which is no row of names."""
    bare = [_in_place(line) for _, line in first]
    if head is not None:
        bare[head.first : head.lines] = [""] * (head.lines - head.first)
    dialect = dialect_of(where, bare, *signs)
    if options.get("transpose"):
        bare, dialect = _transposed(chain(first, lines), dialect, space)
        first, lines = list(enumerate(bare, 1)), iter(())
    layout = layout_of(bare, dialect)
    if layout is None:
        raise _no_body(where, bare, options)
    if head is not None and head.step is not None and not options.get("transpose"):
        layout = replace(layout, facts=(*layout.facts, Statement(head.first, "DT", head.said)))
    rows = [split(line, dialect) for line in islice(bare, layout.body, layout.body + 200)]
    whole = [row for row in rows if len(row) == layout.width]
    kinds = _but_ignored(kinds_of(whole), layout, options)
    texts = [k for k, kind in enumerate(kinds) if kind == "text" and _repeat([row[k] for row in whole])]
    kinds = ["name" if [k] == texts else kind for k, kind in enumerate(kinds)]
    body, above = chain(islice(first, layout.body, None), lines), [line for _, line in first[: layout.body]]
    arrays, notes = read_body(where, body, kinds, dialect, layout.width, space, above)
    said = stated_by(layout.facts, dialect.decimal)
    columns, column_notes = _columns(layout, kinds, arrays)
    given = options.get("sampling_rate") is not None
    stated = None if given else said.rate(where, steps_of(column.values for column in columns))
    place = "" if stated is None else f"line {first[stated[1].line][0]} ({stated[1].key} {stated[1].value[:60]})"
    table = Table(
        where=where,
        columns=_with_label(_with_unit(_with_axis(columns, said.axis), said.unit), said),
        rate=None if stated is None else stated[0],
        rate_from=place,
        lines=said.lines,
        complex_values=said.complex_values,
        notes=(*notes, *column_notes),
        layout=_evidence(first, dialect, layout, (stated is not None and place) or ""),
    )
    if options.get("columns") is not None or not (texts or any(SENSORS & set(words_of(c.name)) for c in columns)):
        return table
    from modalscope.io.columns.sensors import by_sensor  # few tables name sensors in their rows

    return by_sensor(table)


def _repeat(cells: list[str]) -> bool:
    """Whether cells may name the sensor of their row: none is blank, and all but few repeat."""
    return all(cells) and 3 * len(set(cells)) <= max(3, len(cells))


def _with_axis(columns: tuple[Column, ...], axis: tuple[str, float, float] | None) -> tuple[Column, ...]:
    """Return columns of which the one that goes from the first value on by the step, as the header says, has the unit that it says."""
    if axis is None:
        return columns
    unit, first, step = axis

    def is_axis(c: Column) -> bool:
        bare = not c.unit and not c.textual and same_rate(even_step(c.values), step)
        return bare and bool(abs(c.values[0] - first) < 0.5 * step)

    return tuple(replace(c, unit=unit) if is_axis(c) else c for c in columns)


def _with_unit(columns: tuple[Column, ...], unit: str) -> tuple[Column, ...]:
    """Return columns with the unit that the header says of one quantity, where it says it of no column and one or two have none."""
    bare = [c for c in _measured(columns) if not c.unit]
    said = any(c.unit for c in columns if role_by_words("", c.unit) in ("in", "out"))
    if not is_unit(unit) or said or len(bare) > _MAX_COLUMNS_OF_UNIT:
        return columns
    return tuple(replace(c, unit=unit) if c in bare else c for c in columns)


def _with_label(columns: tuple[Column, ...], said: Stated) -> tuple[Column, ...]:
    """Return columns of which the one without a name, or the two parts of a response, have the name that the header says."""
    bare = [(c, part_of(c.name)) for c in _measured(columns)]
    parts = [part[1] if part else "" for _, part in bare]
    unnamed = not any(c.name if part is None else part[0] for c, part in bare)
    if not said.label or not unnamed or not bare or (len(bare) != 1 + said.complex_values and not all(parts)):
        return columns
    name = f"{said.label}/{said.reference}" if said.reference and "/" not in said.label else said.label
    words = parts if all(parts) else [("real", "imag")[k % 2] for k in range(len(bare))] if len(bare) > 1 else [""]
    called = {c.number: f"{name} {word}".strip() for (c, _), word in zip(bare, words, strict=True)}
    return tuple(replace(c, name=called.get(c.number, c.name)) for c in columns)


def _measured(columns: tuple[Column, ...]) -> list[Column]:
    """Return the columns that are no axis, no counter and no text."""
    named = ("time", "frequency", "index")
    return [c for c in columns if not (c.textual or role_by_words(c.name) in named or rises(c.values))]


def _but_ignored(kinds: list[str], layout: Layout, options: Options) -> list[str]:
    """Return the kinds of columns; those that are ignored may hold anything."""
    heads = [Column(number=k, name=name, values=np.zeros(0)) for k, name in enumerate(layout.names, 1)]
    ignored = {column.number for column in ignored_columns(heads, options.get("ignore"))}
    return ["text" if k in ignored else kind for k, kind in enumerate(kinds, 1)]


def _columns(layout: Layout, kinds: list[str], arrays: list[Array]) -> tuple[tuple[Column, ...], list[str]]:
    """Return the columns; dates and times of day in two columns become one, empty ones without a name are left out."""
    stamps = [k for k, kind in enumerate(kinds) if kind == "stamp"]
    joined = len(stamps) == 2 and any(":" not in str(arrays[k][0]) for k in stamps)
    columns, notes = [], []
    for k, (kind, values) in enumerate(zip(kinds, arrays, strict=True)):
        name, unit = layout.names[k], layout.units[k]
        if kind == "empty" and np.isnan(values).all():
            notes += [f"column {k + 1}{f' ({name})' if name else ''} is empty"] if name or k + 1 < layout.width else []
            continue
        if kind == "stamp":
            if joined and k == stamps[1]:
                continue
            values = seconds_of(map(str, values), map(str, arrays[stamps[1]]) if joined else None)
            columns.append(Column(number=k + 1, name=name, unit="s", values=values, stamps=True))
            notes += [f"columns {stamps[0] + 1} and {stamps[1] + 1} are dates and times of one clock"] if joined else []
            continue
        columns.append(Column(number=k + 1, name=name, unit=unit, values=values))
    return tuple(columns), notes


def _evidence(first: list[Line], dialect: Dialect, layout: Layout, rate: str) -> tuple[tuple[str, str], ...]:
    """Return what was found about the layout, as parts of the file."""
    commas = "commas that are both" if dialect.paired else words_of_delimiter(dialect.delimiter)
    signs = f"decimal {'comma' if dialect.decimal == ',' else 'point'}"
    signs += f", thousands parted by {dialect.thousands!r}" if dialect.thousands else ""
    evidence = [("cells", f"parted by {commas}, {signs}")]
    for line, words in ((layout.name_line, "names of columns"), (layout.unit_line, "their units")):
        if line >= 0:
            evidence.append((f"line {first[line][0]}", words))
    if rate:
        evidence.append((rate.partition(" (")[0], "sampling rate: " + rate.partition(" (")[2].rstrip(")")))
    above = [fact for fact in layout.facts if f"line {first[fact.line][0]}" != rate.partition(" (")[0]]
    evidence += [(f"line {first[fact.line][0]}", f"{fact.key}: {fact.value[:60]}") for fact in above[:3]]
    used = {layout.name_line, layout.unit_line, *(fact.line for fact in layout.facts)}
    unused = [str(first[k][0]) for k in range(layout.body) if k not in used and first[k][1].strip(" \t,;\r\n")]
    if unused:
        evidence.append((f"line{'s' if len(unused) > 1 else ''} {', '.join(unused[:6])}", "above the table, not used"))
    evidence.append((f"line {first[layout.body][0]}", f"first of the rows of {layout.width} cells"))
    return tuple(evidence)
