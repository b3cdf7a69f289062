"""Find where a text table begins, its names and units, and the facts in the lines above it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from modalscope.data import DataError
from modalscope.data.units import plain_unit
from modalscope.io.columns.lines import part_of
from modalscope.io.columns.table import Column
from modalscope.io.columns.words import factor_to_base, is_unit, is_weak, kind_of_unit, role_by_words, split_head
from modalscope.io.contents import needs
from modalscope.io.text.cells import Dialect, is_missing, is_number, number_of, split
from modalscope.io.text.dialect import DELIMITERS, value_rows

#: So many rows of values in a row are the body; fewer where the file ends before.
_MIN_ROWS_OF_BODY = 3
_MAX_CHARACTERS_OF_KEY, _MAX_CHARACTERS = 60, 400
#: Signs may follow each other: `Sample rate:,4096` is a key and the cell behind it.
_FACT = re.compile(
    r"\s*\"?(?P<key>[^:=;,\t\"]{1,60}?)\"?\s*(?:[:=;,\t][\s:=;,\t\"]*|\s{2,})(?P<value>[^\s:=;,\t\"].*)\Z"
)
_LOOSE_FACT = re.compile(r"\s*(?P<key>[A-Za-z][^\d:=]{0,59}?)\s+(?P<value>[+-]?\d.*)\Z")
#: Without a way back: a line may be long.
_NAME_AND_UNIT = re.compile(r"\S++(?:\s*+[\[(][^\[\]()]*+[\])])?")
#: A number, whose thousands one sign may part, and its unit.
_QUANTITY = re.compile(
    r"\s*\"?(?P<number>[+-]?(?:[1-9]\d{0,2}(?:(?P<sign>[.,'])\d{3})(?:(?P=sign)\d{3})*(?!\d)(?:[.,]\d+)?|\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)"
    r"\s*(?P<unit>[A-Za-z/]*)"
)
_RATE = re.compile(
    r"(?:sampl?\w*|scan|acquisition|acq\.?|data|abtast)[\s_]*(?:rate|freq\w*)|\b(?:fs|f_s|rate|sr|abtastrate|abtastfrequenz)\b"
    r"|fr[eé]quence d.[eé]chantillonnage|frecuencia de muestreo|samples? per sec\w*|samples/s",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"\bdt\b|delta[\s_]*[tx]|sampl?\w*[\s_]*(?:interval|period|time)|(?:time|x)[\s_]*(?:increment|step|interval|resolution)"
    r"|abtastintervall|delta time",
    re.IGNORECASE,
)
#: How clocks are written, in a row of units.
_CLOCK = re.compile(r"h{1,2}:m{2}(?::s{1,2}(?:[.,:][0fsm]+)?)?\Z", re.IGNORECASE)
_WORDS_OF_RATE = {"s/s", "sps", "samples/s", "sa/s", "hz", "1/s", ""}
#: What stands before the names of columns, or their units, in a column of its own.
_ROW_NAMES = {
    *["channel", "channels", "name", "names", "unit", "units", "einheit", "kanal", "label", "title", "y-unit"],
    *("channel name", "ch no.", "ch no", "ch name"),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Layout:
    """The parts of a text table.

    `width`: cells in a row. `body`: the first row of values, counted in the lines given. `names`, `units`: one a column, empty where
    there is none. `name_line`, `unit_line`: where they stand, counted likewise; -1 where they do not. `facts`: line, key and value of
    what stands above.
    """

    width: int
    body: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    name_line: int = -1
    unit_line: int = -1
    facts: tuple[tuple[int, str, str], ...] = field(default=())


def layout_of(lines: Sequence[str], dialect: Dialect) -> Layout | None:
    """Return the layout of the first lines of a file; None where no rows of values stand in them.

    `lines`: without signs of comments.

    Examples
    --------
    >>> found = layout_of(["Rate: 100 Hz", "Time,AccA", "s,g", "0,1.5", "0.01,2.5"], Dialect(delimiter=","))
    >>> found.body, found.names, found.units, found.facts
    (3, ('Time', 'AccA'), ('s', 'g'), ((0, 'Rate', '100 Hz'),))
    """
    rows = [split(line, dialect) for line in lines]
    width, of_values = value_rows(rows)
    body = next((k for k in range(len(rows)) if all(of_values[k : k + _MIN_ROWS_OF_BODY])), None)
    if body is None or not width:
        return None
    names, units, name_line, unit_line = _head(lines, rows, body, width, dialect)
    used = {name_line, unit_line}
    facts = tuple(
        (k, *fact)
        for k, line in enumerate(lines[:body])
        if k not in used and (fact := _fact(line[:_MAX_CHARACTERS], dialect)) is not None
    )
    return Layout(
        width=width, body=body, names=names, units=units, name_line=name_line, unit_line=unit_line, facts=facts
    )


def _fact(line: str, dialect: Dialect) -> tuple[str, str] | None:
    """Return the key and the value of a line above a table; None where it has none.

    Cells that the table's own sign parts go first: the first is the key, the others are value and unit.
    """
    cells = [bare for cell in split(line, dialect) if (bare := cell.strip(' "'))] if dialect.delimiter else []
    key = cells[0].rstrip(":= ") if cells else ""
    if len(cells) > 1 and key and len(key) <= _MAX_CHARACTERS_OF_KEY and not _FACT.match(cells[0]):
        return key, " ".join(cells[1:])
    match = _FACT.match(line) or _LOOSE_FACT.match(line)
    return (match["key"].strip(), match["value"].strip()) if match else None


def _head(
    lines: Sequence[str], rows: Sequence[list[str]], body: int, width: int, dialect: Dialect
) -> tuple[tuple[str, ...], tuple[str, ...], int, int]:
    """Return names and units, and the lines where they stand: the nearest above the body that have a cell a column."""
    heads: list[tuple[int, list[str]]] = []
    for k in range(body - 1, max(-1, body - 6), -1):
        cells = _fitted(lines[k], rows[k], width, dialect)
        if cells is not None and _are_numbers_of_channels(cells):
            continue
        if cells is not None:
            heads.append((k, cells))
        elif heads and lines[k].strip():
            break
    unit_line, heading = next(
        ((k, heading) for k, cells in heads if (heading := _units_after(cells)) is not None), (-1, 0)
    )
    named = [(k, cells) for k, cells in heads if k != unit_line and not all(map(is_missing, cells))]
    if not named:
        alone = dict(heads).get(unit_line, [""] * width)
        first = [("", "") if _is_row_name(cell) else split_head(cell) for cell in alone[:heading]]
        names = (*(name for name, _ in first), *[""] * (width - heading))
        return names, (*(unit for _, unit in first), *map(_bare, alone[heading:])), -1, unit_line
    line, cells = named[0]
    if len(named) > 1 and _are_parts(cells) and len(set(named[1][1])) < width:  # a name stands over each of its parts
        cells = [f"{above} {below}".strip() for above, below in zip(named[1][1], cells, strict=True)]
    split_cells = [split_head("" if k == 0 and _is_row_name(cell) else cell) for k, cell in enumerate(cells)]
    units = [unit for _, unit in split_cells]
    if unit_line >= 0:
        below = [split_head(cell)[1] if k < heading else _bare(cell) for k, cell in enumerate(dict(heads)[unit_line])]
        units = [unit_below or unit for unit_below, unit in zip(below, units, strict=True)]
    return tuple(name for name, _ in split_cells), tuple(units), line, unit_line


def _fitted(line: str, cells: list[str], width: int, dialect: Dialect) -> list[str] | None:
    """Return the cells of a line of text when there is one a column, by any way of parting it; None where there is not."""
    ways = [cells] + [split(line, Dialect(delimiter=sign, quoted=dialect.quoted)) for sign in DELIMITERS[:-1]]
    if not dialect.delimiter:
        ways += [re.split(r"\s{2,}|\t", line.strip()), _NAME_AND_UNIT.findall(line)]
    for way in ways:
        fitted = [cell.strip().strip('"').strip() for cell in way]
        if len(fitted) == width + 1 and _is_row_name(fitted[0]):
            fitted = fitted[1:]
        while len(fitted) > width and not fitted[-1]:
            fitted = fitted[:-1]
        if len(fitted) == width - 1 and width > 2 and way is cells and not any(map(is_number, fitted)):
            fitted = ["", *fitted]
        if "=" in fitted:  # a key and its value, parted by blanks as the rows are
            continue
        if len(fitted) == width and (width > 1 or not _FACT.match(line)) and not all(map(is_number, fitted)):
            return fitted
    return None


def _bare(cell: str) -> str:
    """Return the unit in a cell of a row of units."""
    text = cell.strip()
    while len(text) > 1 and text[0] + text[-1] in ("[]", "()", "<>", "{}"):
        text = text[1:-1].strip()
    return "" if is_missing(text) else text


def _units_after(cells: Sequence[str]) -> int | None:
    """Return how many cells stand before the units of a row of units: none, or the name of the axis; None where it is no such row.

    Each is known or in brackets, and one at least is there. Behind the name of an axis (`t,N,g`) there are two, none of which may be a
    letter of a channel; behind what the row is called (`Unit,g,V`) any.
    """
    filled = [cell for cell in cells if _bare(cell)]
    bracketed = [cell for cell in filled if cell[0] + cell[-1] in ("[]", "()")]
    units = [cell for cell in filled if is_unit(_bare(cell)) or cell in bracketed or _CLOCK.match(_bare(cell))]
    if units and len(units) == len(filled) and (len(filled) > 1 or len(cells) == 1 or bracketed):
        return 0
    if not filled or filled[0] != cells[0]:
        return None
    named = _is_row_name(cells[0])
    sure = [cell for cell in filled[1:] if is_unit(_bare(cell)) and (named or not is_weak(_bare(cell)))]
    return 1 if len(sure) > 1 - named and sure == filled[1:] and (named or _names_axis(cells[0])) else None


def _is_row_name(cell: str) -> bool:
    """Whether a cell says what its row holds."""
    return cell.lower().strip(": ") in _ROW_NAMES


def _are_numbers_of_channels(cells: Sequence[str]) -> bool:
    """Whether a row is numbers behind what they are (`Range,2000,1000`), which are no names; channels may be called by numbers."""
    return len(cells) > 2 and not is_number(cells[0]) and not _is_row_name(cells[0]) and all(map(is_number, cells[1:]))


def _names_axis(cell: str) -> bool:
    """Whether a cell is the name of a column of times, frequencies or places."""
    name, unit = split_head(cell)
    return role_by_words(Column(number=1, name=name, unit=unit, values=np.arange(3.0))).role in (
        "time",
        "frequency",
        "index",
    )


def _are_parts(cells: Sequence[str]) -> bool:
    """Whether a row says nothing but real, imaginary, magnitude or phase under names that stand above it."""
    parts = [part_of(cell) for cell in cells if cell and kind_of_unit(cell) != "frequency"]
    return sum(part is not None and part[0] == "" for part in parts) >= max(2, len(parts) - 1)


def rate_of_facts(where: str, facts: Sequence[tuple[int, str, str]], decimal: str) -> tuple[float, int, str] | None:
    """Return the sampling rate that lines above a table say, with the line and its words; None where none does.

    Raises `DataError`: lines that say different rates.

    Examples
    --------
    >>> (
    ...     rate_of_facts("a.csv", [(0, "Sampling rate", "1.024 kHz")], "."),
    ...     rate_of_facts("a.csv", [(3, "dt [ms]", "0,5")], ","),
    ... )
    ((1024.0, 0, 'Sampling rate 1.024 kHz'), (2000.0, 3, 'dt [ms] 0,5'))
    """
    rates: list[tuple[float, int, str]] = []
    for line, key, value in facts:
        name, unit = split_head(key)
        match = _QUANTITY.match(value)
        kind = "rate" if _RATE.search(name) else "step" if _STEP.search(name) else ""
        if match is None or not kind or len(key) > _MAX_CHARACTERS_OF_KEY:
            continue
        unit = plain_unit(match["unit"] or unit)
        scale = factor_to_base(unit)
        text = match["number"]
        if (
            kind == "rate" and scale == 1
        ):  # a thousand samples a second are likelier than one; of kHz and of steps it is not so
            text = _ungrouped(text, match["sign"] or "", decimal)
        number = _number(text, decimal)
        if number is None or number <= 0:
            continue
        if len(set(takewhile(is_number, value.split()))) > 1:
            raise _several_rates(where, [f"{key} {value[:_MAX_CHARACTERS_OF_KEY]}"])
        if kind == "step" and kind_of_unit(unit) in ("time", ""):
            rates.append((1 / (number * scale), line, f"{key} {value[:_MAX_CHARACTERS_OF_KEY]}"))
        elif kind == "rate" and (kind_of_unit(unit) == "frequency" or unit.lower() in _WORDS_OF_RATE):
            rates.append((number * scale, line, f"{key} {value[:_MAX_CHARACTERS_OF_KEY]}"))
    if rates and max(rate for rate, *_ in rates) > 1.001 * min(rate for rate, *_ in rates):
        raise _several_rates(where, [words for _, _, words in rates[:4]])
    return rates[0] if rates else None


def _several_rates(where: str, statements: Sequence[str]) -> DataError:
    fault = f"its header says several: {', '.join(map(repr, statements))}"
    return needs(where, "one sampling rate", fault, "Say it: --sampling-rate HZ")


def _number(text: str, decimal: str) -> float | None:
    """Return a number that may have either sign for its decimals: headers are not always written as the table is."""
    for sign in (decimal, "." if decimal == "," else ","):
        try:
            return number_of(text, Dialect(delimiter="", decimal=sign))
        except ValueError:
            continue
    return None


def _ungrouped(text: str, sign: str, decimal: str) -> str:
    """Return a number without what parts its thousands.

    `sign`: what stands before groups of three digits. It parts thousands where it is not the decimal sign of the table, stands twice, or
    another sign follows it.

    Examples
    --------
    >>> _ungrouped("1,024", ",", "."), _ungrouped("1.024", ".", "."), _ungrouped("1,024.5", ",", ",")
    ('1024', '1.024', '1024.5')
    """
    grouped = sign != decimal or text.count(sign) > 1 or bool((set(".,") - {sign}) & set(text))
    return text.replace(sign, "") if sign and grouped else text
