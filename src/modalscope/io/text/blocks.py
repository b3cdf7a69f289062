"""Tables below each other in one text, each under its own head: one test where each is a channel, else tests of which one is chosen."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from modalscope.io.columns import Column, Table
from modalscope.io.columns.lines import part_of
from modalscope.io.columns.vocabulary import key_meaning
from modalscope.io.columns.weights import role_by_words
from modalscope.io.contents import Options, chosen, several_tests
from modalscope.io.text.dialect import Line

#: What the first line of a head begins with; lines of a block and of its head, at least; blocks at most.
_KEY = re.compile(r"[#%/!\s\"]*([A-Za-z][A-Za-z _.-]{2,39}?)(?=[\s:=;,\t\"\d]|$)")
_MIN_LINES, _MIN_LINES_OF_HEAD, _MOST_BLOCKS = 8, 2, 1000
_NAMED = re.compile(r"([A-Za-z][A-Za-z _.-]*?)(?:\s*[:=]\s*|[\s;,\t]+)(?=[^:=]*\Z)(\S.*)\Z")
_VALUES = re.compile(r"[\s\"]*[-+.]?\d")


def key_of(first: str) -> str:
    """Return what the first line of a head begins with; nothing where it is none.

    Examples
    --------
    >>> key_of("Measurement 1"), key_of("# Point: 3"), key_of("0.1, 2")
    ('Measurement', 'Point', '')
    """
    match = _KEY.match(first[:200])
    return match[1].strip() if match else ""


def repeats(path: Path, key: str) -> bool:
    """Whether a line of a file beyond its first begins with the key of that one."""
    line = re.compile(rb"[\r\n][#%/!\s\"]*" + re.escape(key.encode()) + rb"(?![A-Za-z])")
    with path.open("rb") as file:
        before = b""
        while chunk := file.read(1 << 20):
            if line.search(before + chunk):
                return True
            before = chunk[-200:]
    return False


def blocks_of(lines: Sequence[Line], key: str) -> list[list[Line]]:
    """Return the tables of a text: each begins with a line of the key, behind rows of values; all lines where they are no tables."""
    starts = [
        k for k, (_, line) in enumerate(lines) if key_of(line) == key and (k == 0 or _VALUES.match(lines[k - 1][1]))
    ]
    parts = [list(lines[a:b]) for a, b in zip(starts, [*starts[1:], len(lines)], strict=True)]
    heads = [next((k for k, (_, line) in enumerate(part) if _VALUES.match(line)), len(part)) for part in parts]
    whole = all(
        len(part) - head >= _MIN_LINES and head >= _MIN_LINES_OF_HEAD for part, head in zip(parts, heads, strict=True)
    )
    heads_differ = len({tuple(line for _, line in part[:head]) for part, head in zip(parts, heads, strict=True)}) > 1
    whole = whole and heads_differ  # a logger that is started again writes its head again
    return parts if 1 < len(parts) <= _MOST_BLOCKS and starts[0] == 0 and whole else [list(lines)]


def names_of(blocks: Sequence[Sequence[Line]]) -> list[str]:
    """Return a name per block: the first line of the heads that differs from block to block, else their numbers."""
    for rows in zip(*([line.strip().strip('#%"! ') for _, line in block[:16]] for block in blocks), strict=False):
        if _VALUES.match(rows[0]):
            break
        if len(set(rows)) == len(rows):
            return [row[:60] for row in rows]
    return [f"block {k + 1}" for k in range(len(blocks))]


def one_table(where: str, tables: Sequence[Table], names: Sequence[str], options: Options) -> Table:
    """Return the table of all blocks where each holds one channel on the same axis, else the one that is asked.

    Raises `SeveralTests`: several tests, and none was asked.
    """
    if options.get("sheet") is not None:
        return tables[names.index(chosen(where, "blocks", names, names, options))]
    axes, held_by = zip(*(_parted(table) for table in tables), strict=True)
    channels = _called(held_by, names)
    first = tables[0]
    alike = all(
        (axis is None) == (axes[0] is None)
        and (axis is None or np.array_equal(axis.values, axes[0].values))
        and (table.rows, table.rate, table.lines) == (first.rows, first.rate, first.lines)
        for axis, table in zip(axes, tables, strict=True)
    )
    labels = [c.label for part in channels for c in part]
    if not alike or len(set(labels)) < len(labels) or any(not 1 <= len(part) <= 2 for part in channels):
        raise several_tests(where, "blocks", names)
    held = [c for c in (axes[0], *(c for part in channels for c in part)) if c is not None]
    columns = tuple(replace(column, number=k) for k, column in enumerate(held, 1))
    note = f"{len(tables)} tables below each other, a channel each: {names[0]} to {names[-1]}"
    return replace(first, columns=columns, notes=(*first.notes, note))


def _called(channels: Sequence[list[Column]], names: Sequence[str]) -> list[list[Column]]:
    """Return channels of equal names under the name of their block, where that is the name of a place or a channel."""
    found = [_NAMED.match(name) for name in names]
    key = found[0][1] if found[0] else ""
    named = [match[2] if match else name for match, name in zip(found, names, strict=True)]
    places = key_meaning(key) in ("place", "channel") or role_by_words(key) == "out"
    if not places or len({tuple(c.name for c in part) for part in channels}) > 1:
        return list(channels)
    called = [[(c, part_of(c.name)) for c in part] for part in channels]
    return [
        [replace(c, name=name if part is None else f"{name} {part[1]}") for c, part in pairs]
        for pairs, name in zip(called, named, strict=True)
    ]


def _parted(table: Table) -> tuple[Column | None, list[Column]]:
    """Return the axis of a table, and its channels."""
    roles = {c.number: role_by_words(c.name, c.unit) for c in table.columns}
    axis = next((c for c in table.columns if roles[c.number] in ("time", "frequency") and not c.textual), None)
    return axis, [c for c in table.columns if c is not axis and not c.textual and roles[c.number] != "index"]
