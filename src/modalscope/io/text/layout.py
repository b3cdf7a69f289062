"""Find where a text table begins, its names and units, and the statements in the lines above it.

Each row above the body is weighed by its cells, not by its place: names are words, known ones most of all, units are known or in brackets,
numbers behind a word are about columns (ranges, offsets, sensitivities), serial numbers and words that repeat name nothing. What is left
are statements, keys and values.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from modalscope.data.units import unbracketed
from modalscope.io.columns.facts import Statement
from modalscope.io.columns.lines import part_of
from modalscope.io.columns.vocabulary import key_meaning, meanings_of
from modalscope.io.columns.weights import role_by_words
from modalscope.io.columns.words import AMBIGUOUS_UNITS, is_unit, kind_of_unit, split_head
from modalscope.io.text.cells import Dialect, is_missing, is_number, is_stamp, is_value, split
from modalscope.io.text.dialect import DELIMITERS, value_rows

#: So many rows of values in a row are the body; fewer where the file ends before.
_MIN_ROWS_OF_BODY = 3
#: Rows above the body among which names and units are looked for.
_MAX_ROWS_OF_HEAD = 16
_MAX_CHARACTERS_OF_KEY, _MAX_CHARACTERS = 60, 400
#: Signs may follow each other: `Sample rate:,4096` is a key and the cell behind it.
_FACT = re.compile(
    r"\s*\"?(?P<key>[^\s:=;,\"][^:=;,\t\"]{0,59}?)\"?\s*(?:[:=;,\t][\s:=;,\t\"]*|\s{2,})(?P<value>[^\s:=;,\t\"].*)\Z"
)
_LOOSE_FACT = re.compile(r"\s*(?P<key>[A-Za-z][^\d:=]{0,59}?)\s+(?P<value>[+-]?\d.*)\Z")
#: Further statements of one line: `Config: data_rate = 2000.0 Hz, filter = 488 Hz`.
_FURTHER = re.compile(r"(?P<key>[A-Za-z][\w .\-]{0,40}?)\s*[=:]\s*(?P<value>[+-]?\d[^,;\t]*)")
#: A statement by its sign.
_STATED = re.compile(r"\s*[^\s:=][^:=]{0,59}(?:=|:\s)\s*\S")
#: Without a way back: a line may be long.
_NAME_AND_UNIT = re.compile(r"\S++(?:\s*+[\[(][^\[\]()]*+[\])])?")
#: How clocks are written, in a row of units.
_CLOCK = re.compile(r"h{1,2}:m{2}(?::s{1,2}(?:[.,:][0fsm]+)?)?\Z", re.IGNORECASE)
#: A number and a word behind it, which may be its unit.
_MEASURED = re.compile(r"[+-]?\d[\d.,]*\s+\S")
#: A line of a list of columns: the number of one, its name and maybe its unit.
_LISTED = re.compile(
    r"\s*(?:col(?:umn)?s?|spalte|colonne|columna|coluna|ch(?:annel)?|kanal|signal)?[\s.#]*(?P<number>\d{1,4})\s*[\s:=;,)\-]\s*(?P<rest>\D.*)\Z",
    re.IGNORECASE,
)
#: Letters before a number, as serial numbers are.
_SERIAL = re.compile(r"[A-Z]{1,4}[ -]?\d{3,}\Z")
#: Meanings of keys whose values may be numbers that state nothing: heads of columns are written so, too.
_NO_NUMBERS = ("", "unit", "channel", "place", "reference", "form")
#: Where cells begin and end in a line.
Places: TypeAlias = Sequence[tuple[int, int]]


@dataclass(frozen=True, kw_only=True, slots=True)
class Layout:
    """The parts of a text table.

    `width`: cells in a row. `body`: the first row of values, counted in the lines given. `names`, `units`: one per column, empty where
    there is none. `name_line`, `unit_line`: where they stand, counted likewise; -1 where they do not. `facts`: what stands above.
    """

    width: int
    body: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    name_line: int = -1
    unit_line: int = -1
    facts: tuple[Statement, ...] = field(default=())


def layout_of(lines: Sequence[str], dialect: Dialect) -> Layout | None:
    """Return the layout of the first lines of a file; None where no rows of values stand in them.

    `lines`: without signs of comments.

    Examples
    --------
    >>> found = layout_of(["Rate: 100 Hz", "Time,AccA", "s,g", "0,1.5", "0.01,2.5"], Dialect(delimiter=","))
    >>> found.body, found.names, found.units, found.facts[0].value
    (3, ('Time', 'AccA'), ('s', 'g'), '100 Hz')
    """
    rows = [split(line, dialect) for line in lines]
    width, of_values = value_rows(rows)
    body = next((k for k in range(len(rows)) if all(of_values[k : k + _MIN_ROWS_OF_BODY])), None)
    if body is None or not width:
        return None
    listed = _listed(lines[:body], width)
    names, units, name_line, unit_line = listed or _head(lines, rows, body, width, dialect)
    used = {name_line, unit_line, *(range(name_line, name_line + width) if listed else ())}
    above = [(k, line[:_MAX_CHARACTERS]) for k, line in enumerate(lines[:body]) if k not in used]
    facts = tuple(Statement(k, *fact) for k, line in above for fact in statements_of(line, dialect))
    at = {"width": width, "body": body, "name_line": name_line, "unit_line": unit_line}
    return Layout(names=names, units=units, facts=facts, **at)


def _listed(above: Sequence[str], width: int) -> tuple[tuple[str, ...], tuple[str, ...], int, int] | None:
    r"""Return names, units and the lines of a list of columns above a table, a line a column; None where there is none.

    Examples
    --------
    >>> _listed(["No\tName\tUnit", "1\tFrequency\trad/s", "2\tFRF 3: Real\tm/s2/N"], 2)
    (('Frequency', 'FRF 3: Real'), ('rad/s', 'm/s2/N'), 1, -1)
    """
    found = [_LISTED.match(line.strip("\r\n")[:_MAX_CHARACTERS]) for line in above]
    numbers = [int(match["number"]) if match else -1 for match in found]
    for first in (1, 0):
        wanted = list(range(first, first + width))
        k = next((k for k in range(len(found) - width + 1) if numbers[k : k + width] == wanted), None)
        if k is not None and width > 1:
            rests = [match["rest"].strip() for match in found[k : k + width] if match]
            cells = [re.split(r"\t|;|\s{2,}|,(?=\s*\S)", rest) for rest in rests]
            heads = [_name_and_unit([cell.strip(' "') for cell in row]) for row in cells]
            return tuple(name for name, _ in heads), tuple(unit for _, unit in heads), k, -1
    return None


def _name_and_unit(cells: Sequence[str]) -> tuple[str, str]:
    """Return name and unit of the cells of one channel: the unit stands behind the name, or in it."""
    name, unit = split_head(cells[0])
    return name, unit or next((_bare(cell) for cell in cells[1:] if is_unit(_bare(cell))), "")


def statements_of(line: str, dialect: Dialect) -> list[tuple[str, str]]:
    """Return the keys and values of a line above a table.

    Cells that the table's own sign parts go first: the first is the key, the others are value and unit.

    Examples
    --------
    >>> statements_of("Config: data_rate = 2000.0 Hz, filter = 488 Hz", Dialect(delimiter=","))[1]
    ('data_rate', '2000.0 Hz')
    """
    cells = [bare for cell in split(line, dialect) if (bare := cell.strip(' "'))] if dialect.delimiter else []
    key = cells[0].rstrip(":= ") if cells else ""
    if len(cells) > 1 and key and len(key) <= _MAX_CHARACTERS_OF_KEY and not _FACT.match(cells[0]):
        return [(key, " ".join(cells[1:]))]
    match = _FACT.match(line) or _LOOSE_FACT.match(line)
    if match is None:
        return []
    found = [(match["key"].strip(), match["value"].strip())]
    further = _FURTHER.findall(match["value"]) if not is_number(match["value"][:1]) else []
    return [*found, *((key.strip(), value.strip()) for key, value in further)]


def _head(
    lines: Sequence[str], rows: Sequence[list[str]], body: int, width: int, dialect: Dialect
) -> tuple[tuple[str, ...], tuple[str, ...], int, int]:
    """Return names and units, and the lines where they stand: of the rows above the body that have a cell a column, the likeliest."""
    heads: list[tuple[int, list[str]]] = []
    full = next((k for k in range(body, len(rows)) if len(rows[k]) == width), body)
    above = range(max(0, body - _MAX_ROWS_OF_HEAD), body)
    places = [] if dialect.delimiter else _columns_of_blanks(lines, rows, [full, *above], width)
    for k in reversed(above):
        if _is_statement(lines[k], rows[k], dialect):
            continue
        cells = _fitted(lines[k], rows[k], width, dialect, places, rows[full])
        if cells is not None and not all(map(is_missing, cells)):
            heads.append((k, cells))
    units_at = [(k, heading) for k, cells in heads if (heading := _units_after(cells)) is not None]
    unit_line, heading = units_at[0] if units_at else (-1, 0)
    below = dict(heads).get(unit_line, [""] * width)
    named = [(k, cells) for k, cells in heads if k != unit_line and _units_after(cells) is None]
    line, cells = max(named, key=lambda pair: name_score(pair[1]) - 0.5 * (body - pair[0]), default=(-1, [""] * width))
    if line >= 0 and name_score(cells) <= 0:
        line, cells = -1, [""] * width
    if line < 0:
        first = [("", "") if _is_row_name(cell) else split_head(cell) for cell in below[:heading]]
        names = (*(name for name, _ in first), *[""] * (width - heading))
        return names, (*(unit for _, unit in first), *map(_bare, below[heading:])), -1, unit_line
    over = next((other for k, other in named if k < line and len(set(other)) < width), None)
    if over is not None and _are_parts(cells):  # a name stands over each of its parts; a blank carries it on
        cells = [f"{one} {below_it}".strip() for one, below_it in zip(_carried(over), cells, strict=True)]
    split_cells = [split_head("" if k == 0 and _is_row_name(cell) else cell) for k, cell in enumerate(cells)]
    units = [unit for _, unit in split_cells]
    if unit_line >= 0:
        own = [split_head(cell)[1] for cell in below[:heading]]
        own += ["" if _is_row_name(cell) else _bare(cell) for cell in below[heading:]]
        units = [unit if is_unit(unit) else below_it or unit for below_it, unit in zip(own, units, strict=True)]
    return tuple(name for name, _ in split_cells), tuple(units), line, unit_line


def name_score(cells: Sequence[str]) -> float:
    """Return how much speaks for a row of names: words, known ones twice, units in brackets; cells that repeat and numbers speak against.

    Examples
    --------
    >>> name_score(["Time", "Acc 1", "Acc 2"]) > name_score(["", "SN4711", "SN4712"]) > name_score(["TS", "Smp", "Smp"])
    True
    """
    filled = [cell for cell in cells if not is_missing(cell)]
    counts = Counter(filled)
    called = bool(cells) and _is_row_name(cells[0])
    score = 2.0 * called - sum(map(is_missing, cells[1:])) - 5.0 * (2 * len(filled) < len(cells))
    pair = len(filled) == 2 < len(cells) and filled == list(cells[:2])  # a key and its value
    score -= 5.0 * (pair and not _name_columns(filled))
    for cell in filled:
        name, unit = split_head(cell)
        known = bool(meanings_of(name) or part_of(name))
        score += 1.0 + 2.0 * known + 2.0 * bool(unit)
        score -= 2.5 * (counts[cell] > 1 and not known) + 3.0 * (is_value(cell) and not called)
        score -= 3.0 * bool(_MEASURED.match(cell) and is_unit(cell.split()[1]))
        score -= 0.5 * bool(_SERIAL.match(cell)) + 2.0 * (len(cell) > _MAX_CHARACTERS_OF_KEY)
    return score / float(np.sqrt(max(1, len(cells))))


def _carried(cells: Sequence[str]) -> list[str]:
    """Return cells with blanks replaced by what stands before them."""
    carried: list[str] = []
    for cell in cells:
        carried.append(cell or (carried[-1] if carried else ""))
    return carried


def _columns_of_blanks(lines: Sequence[str], rows: Sequence[list[str]], of: Sequence[int], width: int) -> list[Places]:
    """Return where the cells of rows stand that blanks part, of each row that has all and is no statement."""
    whole = [lines[k] for k in of if len(rows[k]) == width and not _STATED.match(lines[k])]
    return [[match.span() for match in re.finditer(r"\S+", line)] for line in reversed(whole)]


def _two_stamps(first: Sequence[str]) -> int | None:
    """Return the place of a date with a time of day behind it, where further cells stand beside."""
    pairs = pairwise(first)
    return next((k for k, pair in enumerate(pairs) if len(first) > 2 and all(map(is_stamp, pair))), None)


def _with_one_more(cells: list[str], first: Sequence[str], parted: bool) -> list[str]:
    """Return cells that are one too few, with the blank one where the first row of the body says: a time behind a date, an empty end.

    Units of all columns but dates and times are two too few.
    """
    at = _two_stamps(first)
    if at is not None:
        two = len(cells) == len(first) - 2
        return [*cells[:at], "", "", *cells[at:]] if two else [*cells[: at + 1], "", *cells[at + 1 :]]
    if not parted:
        return cells
    return [*cells, ""] if not first[-1] or _names_axis(cells[0]) else ["", *cells]


def _fitted(
    line: str, cells: list[str], width: int, dialect: Dialect, places: Sequence[Places], first: Sequence[str]
) -> list[str] | None:
    """Return the cells of a line of text when there is one per column, by any way of parting it; None where there is not.

    `places`: where the cells of other rows stand, that blanks part. `first`: the cells of the first row of the body.
    """
    ways = [cells] + [split(line, Dialect(delimiter=sign, quoted=dialect.quoted)) for sign in DELIMITERS[:-1]]
    if not dialect.delimiter:
        ways += [re.split(r"\s{2,}|\t", line.strip()), _NAME_AND_UNIT.findall(line)]
        ways += [_by_place(line, where) for where in places if 0 < len(cells) < width and not _STATED.match(line)]
    if len(cells) == 2 * width and all(map(is_unit, map(_bare, cells[1::2]))):
        ways += [[f"{name} [{_bare(unit)}]" for name, unit in zip(cells[::2], cells[1::2], strict=True)]]
    longer: list[str] | None = None
    for way in ways:
        fitted = [cell.strip().strip('"').strip() for cell in way]
        if len(fitted) == width + 1 and (not fitted[0] or _is_row_name(fitted[0])):
            fitted = fitted[1:]
        over = fitted[width:]  # names of columns that have no cells below, such as comments
        idle = all(not cell or role_by_words(cell) == "ignore" for cell in over)
        if over and way is cells and (idle or _names_axis(fitted[0])):
            longer = fitted[:width]
        short = 2 if _two_stamps(first) is not None and all(map(is_unit, map(_bare, fitted))) else 1
        if len(fitted) == width - short and _name_columns(fitted) and way is cells:
            fitted = _with_one_more(fitted, first, bool(dialect.delimiter))
        if "=" in fitted:  # a key and its value, parted by blanks as the rows are
            continue
        if len(fitted) == width and (width > 1 or not _FACT.match(line)) and not all(map(is_number, fitted)):
            return fitted
    return longer


def _name_columns(cells: Sequence[str]) -> bool:
    """Whether cells name columns, no numbers among them; a key and its value are two cells, of which one at most is known."""
    known = sum(bool(meanings_of(cell) or part_of(cell) or is_unit(_bare(cell))) for cell in cells)
    several = len(cells) > 2 or known == len(cells) == 2
    return several and not any(is_number(c) or _STATED.match(c) for c in cells)


def _by_place(line: str, places: Places) -> list[str]:
    """Return the words of a line by the columns that they stand over; nothing where one stands over none or two over one."""
    cells = [""] * len(places)
    for match in re.finditer(r"\S+", line):
        over = [k for k, (start, end) in enumerate(places) if match.start() < end and match.end() > start]
        if len(over) != 1 or cells[over[0]]:
            return []
        cells[over[0]] = match[0]
    return cells


def _bare(cell: str) -> str:
    """Return the unit in a cell of a row of units."""
    text = unbracketed(cell)
    return "" if is_missing(text) else text


def _units_after(cells: Sequence[str]) -> int | None:
    """Return how many cells stand before the units of a row of units: none, or the name of the axis; None where it is no such row.

    Each is known or in brackets, and one at least is there. Behind the name of an axis (`t,N,g`) there are two, none of which may be a
    letter of a channel; behind what the row is called (`Unit,g,V`) any.
    """
    filled = [cell for cell in cells if _bare(cell)]
    bracketed = [cell for cell in filled if len(cells) > 1 and cell[0] + cell[-1] in ("[]", "()")]
    units = [cell for cell in filled if is_unit(_bare(cell)) or cell in bracketed or _CLOCK.match(_bare(cell))]
    if (
        units
        and len(units) == len(filled)
        and (len(filled) > 1 or is_unit(_bare(filled[0])) or filled[0] not in bracketed)
        and (len(filled) > 1 or len(cells) == 1 or bracketed or filled[0] not in AMBIGUOUS_UNITS)
    ):
        return 0
    plain = (cell for cell in units if _bare(cell) not in AMBIGUOUS_UNITS)
    strong = [cell for cell in plain if kind_of_unit(_bare(cell)) not in ("", "none")]
    named = any(meanings_of(cell) for cell in filled if cell not in units)
    if strong and len(filled) > 1 and 2 * len(units) > len(filled) and not named:
        return 0  # of some the unit is not known
    if not filled or filled[0] != cells[0]:
        return None
    named = _is_row_name(cells[0])
    sure = [cell for cell in filled[1:] if is_unit(_bare(cell)) and (named or _bare(cell) not in AMBIGUOUS_UNITS)]
    return 1 if len(sure) > 1 - named and sure == filled[1:] and (named or _names_axis(cells[0])) else None


def _is_row_name(cell: str) -> bool:
    """Whether a cell says what its row holds: `Unit`, `CH No.`, `Channel name`."""
    return len(cell) <= _MAX_CHARACTERS_OF_KEY and key_meaning(cell) in ("unit", "channel")


def _is_statement(line: str, cells: Sequence[str], dialect: Dialect) -> bool:
    """Whether a line is a key that is known and its number, or a key by its colon and one value."""
    if cells and cells[0].endswith(":") and sum(not is_missing(cell) for cell in cells[1:]) == 1:
        return True
    stated = statements_of(line[:_MAX_CHARACTERS], dialect)[:1]
    known = (value for key, value in stated if key_meaning(key) not in _NO_NUMBERS)
    return any(is_number(value.split()[0]) for value in known)


def _names_axis(cell: str) -> bool:
    """Whether a cell is the name of a column of times, frequencies or places."""
    return role_by_words(*split_head(cell)) in ("time", "frequency", "index")


def _are_parts(cells: Sequence[str]) -> bool:
    """Whether a row says nothing but real, imaginary, magnitude or phase under names that stand above it."""
    parts = [part_of(cell) for cell in cells if cell and kind_of_unit(cell) != "frequency"]
    return sum(part is not None and part[0] == "" for part in parts) >= max(2, len(parts) - 1)
