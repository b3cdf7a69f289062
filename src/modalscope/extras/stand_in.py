"""Make a stand-in of a file that may not be shown: its layout, clocks and kinds, the values of a simulated structure, names P1, P2, ...

Text and sheets are worked on cell by cell, universal files record by record, MATLAB files array by array, so that a file which is not
read, or is read wrongly, has a stand-in, too. What stays: words that the readers know (`io/columns/vocabulary`), letters, whole numbers
of two digits, statements of rates, steps and counts, columns that rise by even steps, the forms of universal files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache, partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError
from modalscope.data.kind_of_test import is_impact
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import summary_of
from modalscope.io import survey
from modalscope.io.atomic import replacing
from modalscope.io.columns.vocabulary import COLUMNS, SENSORS, STATEMENTS, VOLTAGES, folded, key_meaning, meanings_of
from modalscope.io.columns.words import kind_of_unit, split_head
from modalscope.io.limits import room
from modalscope.io.mat import read_mat5
from modalscope.io.recorders import sheets
from modalscope.io.text.cells import Dialect, is_number, is_value, number_of
from modalscope.io.text.dialect import dialect_of, encoding_of, value_rows
from modalscope.io.uff.layout import number, parse
from modalscope.io.uff.scan import FORM, HEADER_LINES, WORDS, Block, scan
from modalscope.numerics.checks import Array
from modalscope.numerics.errors import optional_package

#: What a header states and what columns are called where their numbers stay.
_CLOCKS = {*STATEMENTS, "time", "clock", "frequency", "index"} - {"unit", "reference", "channel", "place"}
#: Words of layouts that name no column.
_FORMAT = (
    "labview measurement writer reader version separator comma tab decimal multi headings columns yes no one pref absolute "
    "relative operator project description end of header start special dimension value title test range offset sep none frf transfer"
)
_KEYS = " ".join(STATEMENTS.values()).split()
_KNOWN = {*" ".join((*COLUMNS.values(), _FORMAT)).split(), *_KEYS, *SENSORS, *VOLTAGES}
_PIECE = re.compile(r"[A-ZÀ-Þ]?[a-zà-ÿ]+|[A-ZÀ-Þ]+(?![a-zà-ÿ])|\d+|[^\W\d_]+|_+")
_STAMP = re.compile(r"\d+([-/.])\w+\1\d+|\d+:\d\d(?::\d\d)?|\d+[.,]\d+")
_REAL = re.compile(r" *[+-]?(?:\d+\.\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
#: Letters of a part of a known key, and digits of a number of a channel.
_PART, _DIGITS = 4, 2
#: Share of a clock's steps that are within half of the usual one; rows that are simulated of a file that is not read.
_EVEN, _ROWS = 0.9, 10_000
#: Sets of universal files: headers, units, functions.
_HEADER, _UNITS, _FUNCTION = 151, 164, 58


@cache
def _is_known(word: str) -> bool:
    plain = folded(word)
    part = len(plain) >= _PART and any(key.startswith(plain) or key.endswith(plain) for key in _KEYS)
    return plain in _KNOWN or part or len(plain) == 1 or kind_of_unit(word) != ""


class Names:
    """Texts without their names: a word that no reader knows is P1, P2, ..., the same one always the same; digits are ones.

    `wide`: words keep their width.
    """

    def __init__(self, wide: bool = False) -> None:
        self._given: dict[str, str] = {}
        self._wide = wide

    def __call__(self, text: str, numbers: bool = False) -> str:
        """Return the text; `numbers`: those that stand alone stay."""
        bare = text if numbers else _STAMP.sub(lambda stamp: re.sub(r"\d", "1", stamp[0]), text)
        return re.sub(r"\w+", lambda token: self._word(token[0], numbers), bare)

    def _word(self, token: str, numbers: bool) -> str:
        plain = token.rstrip("eEdD").isdigit()
        if plain or _is_known(token):
            return token if numbers or len(token) <= _DIGITS or not plain else "1" * len(token)
        said = unknown = ""
        for piece in [*_PIECE.findall(token), ""]:
            known = len(piece) <= _DIGITS and not unknown if piece.isdigit() else piece[:1] in "_" or _is_known(piece)
            if known and unknown:
                said += self._given.setdefault(unknown, f"P{len(self._given) + 1}")
            said, unknown = (said + piece, "") if known else (said, unknown + piece)
        return said.ljust(len(token))[: len(token)] if self._wide else said


def stand_in(source: Path, target: Path, structure: Any) -> tuple[str, str]:
    """Write the stand-in of a file of the same suffix, and return what is read of the file and of its stand-in.

    `structure`: one of `systems`, whose values are written.

    Raises `DataError`: no text, workbook, universal file or MATLAB file up to version 7.2, or a damaged one.
    """
    if not source.is_file():
        raise DataError(f"a stand-in of {source}:", "there is no such file", "Check its name and folder.")
    thing, said = _read(source)
    make = {".xlsx": _workbook, ".mat": _matlab}.get(source.suffix.lower(), _text)
    with replacing(target, (source,)) as temporary:
        make(source, temporary, _simulated(structure, thing))
    return f"the file: {said}", f"its stand-in: {_read(target)[1]}"


def _read(path: Path) -> tuple[Any, str]:
    try:
        thing = survey(path).thing
    except DataError as error:
        return None, f"not read: {error.fault}"
    return thing, summary_of(thing)


def _simulated(structure: Any, thing: Any) -> Array:
    """Return columns for a file of such a thing: a force and the motions under it, or a size and the parts of responses side by side."""
    top, size = structure.modes().frequencies.max(), getattr(thing, "samples", getattr(thing, "count", _ROWS))
    everywhere = {"outputs": range(structure.degrees), "noise": 0.003}
    if isinstance(thing, FrequencyResponse):
        lines = np.linspace(0.01, 0.7, size) * top
        Y = structure.frequency_response(lines, inputs=[0], quantity="acceleration", **everywhere).values
        return np.hstack([abs(Y[:, 0]), np.stack([Y.real, Y.imag], 2).reshape(size, -1)])
    force = np.random.default_rng(0).standard_normal((max(size, 2), 1))
    if getattr(thing, "kind_of_test", "") == "hammer":
        force = 1e-3 * force + (np.arange(len(force)) % (len(force) // 5 + 2) == 1)[:, None]
    return np.hstack([force, structure.simulate(inputs=force, at=[0], sampling_rate=20 * top, **everywhere).outputs])


def _column(values: Array, k: int, head: str, columns: Array) -> Array:
    """Return the k-th simulated column within the ends of given values, which are rounded to half powers of ten; an axis as it is.

    `head`: name and unit of the column.
    """
    if np.iscomplexobj(values):
        return _column(values.real, 2 * k, head, columns) + 1j * _column(values.imag, 2 * k + 1, head, columns)
    name, unit = split_head(head)
    meanings = {*(meaning for meaning, _ in meanings_of(name)), kind_of_unit(unit), key_meaning(name)}
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    usual = float(np.median(steps)) if steps.size > 1 else 0.0
    if meanings & _CLOCKS or not known.size or (usual > 0 and np.mean(abs(steps / usual - 1) < 0.5) >= _EVEN):
        return values
    force = "force" in meanings or (is_impact(known) and is_impact(columns[:, 0]))
    shown = np.resize(columns[:, 0 if force else 1 + k % (columns.shape[1] - 1)], len(values))
    low, high, width = (_half_power(x) for x in (known.min(), known.max(), np.ptp(known)))
    ends = (0.99 * low, 0.99 * high if high > low else 0.99 * low + width)  # a coherence stays below one
    return np.asarray(np.interp(shown, (shown.min(), shown.max()), ends))


def _half_power(value: float) -> float:
    """Return the half power of ten beside a number: its size, and no digit of it."""
    return float(np.sign(value) * 10 ** (np.round(2 * np.log10(abs(value) or 1.0)) / 2))


def _written(value: float, text: str, decimal: str = ".") -> str:
    """Return a number as another one is written: its decimals, exponent and width."""
    mark = next((letter for letter in "eEdD" if letter in text), "")
    digits = len(re.split("[eEdD]", text)[0].partition(decimal)[2].rstrip())
    said = f"{value:.{digits}{'e' if mark else 'f'}}"
    return said.replace("e", mark or "e").replace(".", decimal).rjust(len(text))


def _text(source: Path, target: Path, columns: Array) -> None:
    if source.read_bytes().startswith(b"    -1"):
        return _universal(source, target, columns)
    as_it_is: dict[str, Any] = {"encoding": encoding_of(source), "newline": "", "errors": "replace"}
    with source.open(**as_it_is) as file, target.open("w", **as_it_is) as copy:
        copy.writelines(_lines(file.read().splitlines(keepends=True), Names(), columns))


def _workbook(source: Path, target: Path, columns: Array) -> None:
    book, names = optional_package("a workbook", "openpyxl", "excel").Workbook(), Names()
    book.remove(book.active)
    for title, rows in sheets(source, room(source.name, source.stat().st_size), {})[1].items():
        sheet = book.create_sheet(names(title)[:31])
        for (row, _), line in zip(rows, _lines([line for _, line in rows], names, columns, "\t"), strict=True):
            for column, cell in enumerate(line.split("\t"), 1):
                sheet.cell(row, column, float(cell) if is_number(cell) else cell or None)
    book.save(str(target))


def _lines(lines: Sequence[str], names: Names, columns: Array, delimiter: str | None = None) -> list[str]:
    """Return the lines of a table with the numbers of its rows simulated, and all other words without names."""
    try:
        dialect = dialect_of("", [line.strip("\r\n") for line in lines[:1000]], delimiter)
    except DataError:  # commas that may be either
        dialect = Dialect(delimiter=",")
    sign = re.compile(f"({re.escape(dialect.delimiter)})" if dialect.delimiter else r"(?<=\S)(\s+)(?=\S)")
    rows = [sign.split(line) for line in lines]  # cells, and what stands between them
    cells = [[cell.strip(' "\r\n') for cell in row[::2]] for row in rows]
    width, table = value_rows(cells)
    begin = next((k for k in range(len(rows)) if all(table[k : k + 3])), len(rows))
    filled = [table[k] or (any(row) and all(map(is_value, row))) for k, row in enumerate(cells)]
    body = [k for k in range(begin, len(rows)) if filled[k] and not key_meaning(cells[k][0])]
    for k in sorted({*range(len(rows))} - {*body}):
        clock = any(key_meaning(part) in _CLOCKS for part in re.split("[:=]", cells[k][0]))
        rows[k][::2] = [names(text, clock) for text in rows[k][::2]]
    heads: list[str] = next((row for row in reversed(cells[:begin]) if len(row) >= width), [])
    for n, texts in enumerate(zip_longest(*(cells[k] for k in body), fillvalue="")):
        old = np.array([number_of(text, dialect) if is_number(text) else np.nan for text in texts])
        new = _column(old, n, dict(enumerate(heads)).get(n, ""), columns)
        for k, text, value in zip(body, texts, new.tolist(), strict=True):
            if not is_value(text):
                rows[k][2 * n] = names(rows[k][2 * n])
            elif new is not old and is_number(text):
                rows[k][2 * n] = rows[k][2 * n].replace(text, _written(value, text, dialect.decimal), 1)
    return ["".join(row) for row in rows]


def _matlab(source: Path, target: Path, columns: Array) -> None:
    from scipy.io import loadmat, savemat

    data, names = source.read_bytes(), Names()
    if data.startswith(b"MATLAB 7.3"):
        raise DataError(f"a stand-in of {source.name}:", "it is of MATLAB 7.3", "Save it with -v7.")
    read_mat5(data, room(source.name, len(data)), (), {})  # scipy trusts the sizes that a file states
    found = {name: value for name, value in loadmat(source).items() if not name.startswith("__")}
    savemat(target, {names(name): _array(names, columns, name, value) for name, value in found.items()}, False)


def _array(names: Names, columns: Array, name: str, value: Any) -> Array:
    array = np.asarray(value)
    if array.dtype.names:
        new = np.empty(array.shape, [(names(field), object) for field in array.dtype.names])
        for field in array.dtype.names:
            new[names(field)] = _array(names, columns, field, array[field])
        return new
    if array.dtype == object:
        return np.asarray(np.frompyfunc(partial(_array, names, columns, name), 1, 1)(array))
    if array.dtype.kind not in "biufc":
        return np.array([names(str(text)) for text in array.ravel()]).reshape(array.shape)
    axis = int(np.argmax(array.shape))
    series = np.moveaxis(array, axis, -1)
    flat = series.reshape(-1, series.shape[-1])
    simulated = np.reshape([_column(given, k, name, columns) for k, given in enumerate(flat)], series.shape)
    return np.moveaxis(simulated, -1, axis).astype(array.dtype)


def _universal(source: Path, target: Path, columns: Array) -> None:
    data, names, at = source.read_bytes(), Names(wide=True), 0
    said: list[bytes] = []
    end = b"\r\n" if b"\r\n" in data[:200] else b"\n"
    for k, block in enumerate(scan(source.name, data, room(source.name, len(data)))):
        old = end.join([*block.records, block.payload or b""])
        start = data.index(old, at)
        between = names(data[at:start].decode("latin-1"), True).encode("latin-1")  # maybe comments
        said += [between, old if block.dataset == _UNITS else end.join(_set(block, k, names, columns))]
        at = start + len(old)
    target.write_bytes(b"".join([*said, names(data[at:].decode("latin-1"), True).encode("latin-1")]))


def _set(block: Block, k: int, names: Names, columns: Array) -> Sequence[bytes]:
    """Return the records and the payload of a set: places and forms as they are, names in their columns, simulated numbers."""
    lines, head, kinds = [record.decode("latin-1") for record in block.records], 0, [("value", "f8")]
    if block.dataset == _FUNCTION:
        form, head = parse(FORM, block.records[6], block.name), HEADER_LINES
        parts, size = WORDS[form["ordinate data type"]]
        sizes = (("time", block.abscissa_bytes or 4), ("real", size), ("imag", size))
        kinds = [(name, f"{block.order}f{each}") for name, each in sizes[form["abscissa spacing"] : 1 + parts]]
    values = np.array([number(block.name, "a value", text) for line in lines[head:] for text in _REAL.findall(line)])
    written = values[: values.size // len(kinds) * len(kinds)].view([(name, "f8") for name, _ in kinds])
    table = written if block.payload is None else np.frombuffer(block.payload, kinds).copy()
    for n, (name, _) in enumerate(kinds[-2:] if table.size else ()):
        table[name] = _column(table[name], 2 * k + n, name, columns)
    given = iter(values.tolist())
    for n, line in enumerate(lines):
        said = names(line, block.dataset != _HEADER and (n > 4 or not head))
        lines[n] = said if n < head else _REAL.sub(lambda text: _written(next(given), text[0]), said)
    return [*(line.encode("latin-1") for line in lines), b"" if block.payload is None else table.tobytes()]
