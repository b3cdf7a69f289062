"""Make a stand-in of a file that may not be shown: its layout, clocks and kinds, the values of a simulated structure, names P1, P2, ...

Text and sheets are worked on cell by cell, universal files record by record, MATLAB files array by array, so that a file which is not
read, or is read wrongly, has a stand-in, too. What stays: words that the readers know (`io/columns/vocabulary`), letters, whole numbers
of two digits, statements of rates, steps and counts, columns that rise by even steps, the forms of universal files.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache, partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modalscope.data import DataError, Signals
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
from modalscope.io.uff.layout import parse
from modalscope.io.uff.scan import FORM, HEADER_LINES, Block, scan
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
_STAMP = re.compile(r"\d+([-/.])\w+\1\d+|\d+:\d\d(?::\d\d)?")
_REAL = re.compile(r" *[+-]?(?:\d+\.\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
#: Letters of a part of a known key and digits of a number of a channel; values of an array that is no series.
_PART, _DIGITS, _FEW = 4, 2, 16
#: Share of a clock's steps that are within half of the usual one; peak over deviation of a channel of hits.
_EVEN, _CREST = 0.9, 10.0
#: Ordinates of universal files by their code; the type of coherences.
_ORDINATES, _COHERENCE = {2: "1f4", 4: "1f8", 5: "2f4", 6: "2f8"}, 6
_HEADER, _UNITS, _FUNCTION, _OPENING = 151, 164, 58, re.compile(rb"^ {4}-1[^\n]*\n[^\n]*\n", re.MULTILINE)


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
        if token.isdigit() or _is_known(token):
            return token if numbers or len(token) <= _DIGITS or not token.isdigit() else "1" * len(token)
        said = unknown = ""
        for piece in [*_PIECE.findall(token), ""]:
            known = len(piece) <= _DIGITS and not unknown if piece.isdigit() else piece[:1] in "_" or _is_known(piece)
            if known and unknown:
                said += self._given.setdefault(unknown, f"P{len(self._given) + 1}")
            said, unknown = (said + piece, "") if known else (said, unknown + piece)
        return said.ljust(len(token))[: len(token)] if self._wide else said


class Simulation(NamedTuple):
    """A structure, and what is simulated of it: its responses on "lines", or a record under "noise" or "hits"."""

    structure: Any
    kind: str


def stand_in(source: Path, target: Path, structure: Any) -> tuple[str, str]:
    """Write the stand-in of a file of the same suffix, and return what is read of the file and of its stand-in.

    `structure`: one of `systems`, whose values are written.

    Raises `DataError`: no text, workbook, universal file or MATLAB file up to version 7.2, or a damaged one.
    """
    if not source.is_file():
        raise DataError(f"a stand-in of {source} was asked", "there is no such file", "Check its name and folder.")
    thing, said = _read(source)
    forces = np.ravel(thing.inputs) if isinstance(thing, Signals) and thing.inputs is not None else np.zeros(0)
    kind = "lines" if isinstance(thing, FrequencyResponse) else "hits" if _crest(forces) > _CREST else "noise"
    head = source.read_bytes()[:4096]
    make = _MADE.get(source.suffix.lower(), _text) if not head.lstrip().startswith(b"-1") else _universal
    if make is _text and b"\0\0\0" in head:
        fault = "stand-ins are made of text, .xlsx, .mat and universal files"
        raise DataError(f"a stand-in of {source.name} was asked", fault, "Export it as one of these.")
    with replacing(target, (source,)) as temporary:
        make(source, temporary, Simulation(structure, kind))
    return f"the file: {said}", f"its stand-in: {_read(target)[1]}"


def _read(path: Path) -> tuple[Any, str]:
    try:
        thing = survey(path).thing
    except DataError as error:
        return None, f"not read: {error.fault}"
    return thing, summary_of(thing)


def _crest(values: Array) -> float:
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else np.zeros(0)
    return float(abs(known - np.median(known)).max() / (known.std() or np.inf)) if known.size else 0.0


def _power(value: float) -> float:
    """Return the power of ten beside a number: its size, and no digit of it."""
    return float(np.sign(value) * 10.0 ** np.round(np.log10(abs(value)))) if value else 0.0


@cache
def _simulated(test: Simulation, size: int) -> tuple[Array, Array]:
    """Return a force and the motion under it, or responses."""
    top, first = test.structure.modes().frequencies.max(), [0]
    everywhere = {"outputs": range(test.structure.degrees), "noise": 0.003}
    if test.kind == "lines":
        lines = np.linspace(0.01, 0.7, size) * top
        response = test.structure.frequency_response(lines, inputs=first, quantity="acceleration", **everywhere)
        return np.ones(size), response.values[:, :, 0]
    force = np.random.default_rng(0).standard_normal((max(size, 2), 1))
    if test.kind == "hits":
        force = 1e-3 * force + (np.arange(len(force)) % (len(force) // 5 + 2) == 1)[:, None]
    record = test.structure.simulate(inputs=force, at=first, sampling_rate=20 * top, **everywhere)
    return force[:size, 0], record.outputs[:size]


def _like(columns: Sequence[Array], heads: Iterable[str], test: Simulation, first: int = 0) -> list[Array]:
    """Return simulated columns for those of a table, of their kinds and sizes; axes as they are.

    `heads`: their names and units. `first`: the mass of the chain for the first.
    """
    crests = [_crest(column) for column in columns]
    hits = crests.index(max(crests)) if test.kind == "hits" else -1
    return [
        _column(c, k, head, test, k == hits, first) for k, (c, head) in enumerate(zip(columns, heads, strict=False))
    ]


def _column(values: Array, k: int, head: str, test: Simulation, drives: bool, first: int) -> Any:
    name, unit = split_head(head)
    meanings = {meaning for meaning, _ in meanings_of(name)} | {kind_of_unit(unit)}
    if np.iscomplexobj(values):
        parts = _like([values.real, values.imag], ("real", "imag"), test._replace(kind="lines"), first + k)
        return parts[0] + 1j * parts[1] if values.imag.any() else parts[0] + 0j
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    usual = float(np.median(steps)) if steps.size > 1 else 0.0
    if meanings & _CLOCKS or not known.size or (usual > 0 and np.mean(abs(steps / usual - 1) < 0.5) >= _EVEN):
        return values
    kind, (force, masses) = test.kind, _simulated(test, len(values))
    mass = first + (k // 2 if kind == "lines" else k)  # parts of a response lie side by side
    motion = force if drives or "force" in meanings else masses[:, mass % masses.shape[1]]
    low, high, middle, spread = (float(f(known)) for f in (np.min, np.max, np.mean, np.std))
    turn = 180.0 if high - low > 7 else np.pi
    if kind == "lines" and ("coh" in meanings or 0 <= low < 0.5 < high <= 1):
        return 1 / (1 + 0.1 * np.random.default_rng(k).random(len(values)))
    if kind == "lines" and ("phase" in meanings or (high - low > turn and max(-low, high) < 1.001 * turn)):
        return np.angle(motion) * (turn / np.pi)
    if kind == "lines" and low >= 0:
        return abs(motion) * (_power(middle) / abs(motion).mean())
    if kind == "lines" and ("mag" in meanings or abs(middle) > 2 * spread):
        return 20 * np.log10(abs(motion) / abs(motion).mean()) + np.round(middle, -1)
    imaginary = kind == "lines" and ("imag" in meanings or (k % 2 and "real" not in meanings))
    motion = np.imag(motion) if imaginary else np.real(motion)
    return (_power(middle) if abs(middle) > spread else 0.0) + motion * (_power(spread) / (motion.std() or 1.0))


def _written(value: float, text: str, decimal: str = ".") -> str:
    """Return a number as another one is written: its decimals, exponent and width."""
    mark = next((letter for letter in "eEdD" if letter in text), "")
    mantissa = text.partition(mark)[0] if mark else text
    digits = len(mantissa.rpartition(decimal)[2].rstrip()) if decimal in mantissa else 0
    said = f"{value:.{digits}{'e' if mark else 'f'}}"
    return said.replace("e", mark or "e").replace(".", decimal).rjust(len(text))


def _text(source: Path, target: Path, test: Simulation) -> None:
    as_it_is: dict[str, Any] = {"encoding": encoding_of(source), "newline": "", "errors": "replace"}
    with source.open(**as_it_is) as file, target.open("w", **as_it_is) as copy:
        copy.writelines(_lines(file.read().splitlines(keepends=True), Names(), test))


def _workbook(source: Path, target: Path, test: Simulation) -> None:
    book, names = optional_package("a workbook", "openpyxl", "excel").Workbook(), Names()
    book.remove(book.active)
    for title, rows in sheets(source, room(source.name, source.stat().st_size), {})[1].items():
        sheet = book.create_sheet(names(title)[:31])
        for (number, _), line in zip(rows, _lines([line for _, line in rows], names, test, "\t"), strict=True):
            for column, cell in enumerate(line.split("\t"), 1):
                sheet.cell(number, column, float(cell) if is_number(cell) else cell or None)
    book.save(str(target))


def _lines(lines: Sequence[str], names: Names, test: Simulation, delimiter: str | None = None) -> list[str]:
    """Return the lines of a table with the numbers of its body simulated, and the words of its head without names."""
    try:
        dialect = dialect_of("", [line.strip("\r\n") for line in lines[:1000]], delimiter)
    except DataError:  # commas that may be either
        dialect = Dialect(delimiter=",")
    sign = re.compile(f"({re.escape(dialect.delimiter)})" if dialect.delimiter else r"(?<=\S)(\s+)(?=\S)")
    rows = [sign.split(line) for line in lines]  # cells, and what stands between them
    cells = [[cell.strip(' "\r\n') for cell in row[::2]] for row in rows]
    width, table = value_rows(cells)
    begin = next((k for k in range(len(rows)) if all(table[k : k + 3])), len(rows))
    body = [k for k in range(begin, len(rows)) if table[k] or (any(cells[k]) and all(map(is_value, cells[k])))]
    heads: list[str] = next((row for row in reversed(cells[:begin]) if len(row) >= width), [])
    layout = {str(n) for n in (len(body), len(body) + 1, *range(width + 1))}
    for k in sorted({*range(len(rows))} - {*body}):
        clock = any(key_meaning(part) in _CLOCKS for part in re.split("[:=]", cells[k][0]))
        for n, cell in enumerate(cells[k]):
            text = rows[k][2 * n]
            if cell not in layout and not (clock and is_number(cell)):
                rows[k][2 * n] = re.sub(r"\d", "1", text) if is_value(cell) else names(text, clock)
    for row, its in ((rows[k], cells[k]) for k in body):
        row[::2] = [text if is_value(cell) else names(text) for text, cell in zip(row[::2], its, strict=True)]
    columns = range(max(map(len, cells), default=0))
    places = [[k for k in body if n < len(cells[k]) and is_number(cells[k][n])] for n in columns]
    old = [np.array([number_of(cells[k][n], dialect) for k in there]) for n, there in enumerate(places)]
    new = _like(old, [head for head, _ in zip_longest(heads, old, fillvalue="")], test)
    for n in (n for n in columns if new[n] is not old[n]):
        for k, value in zip(places[n], new[n], strict=True):
            text = cells[k][n]
            rows[k][2 * n] = rows[k][2 * n].replace(text, _written(value, text, dialect.decimal), 1)
    return ["".join(row) for row in rows]


def _matlab(source: Path, target: Path, test: Simulation) -> None:
    from scipy.io import loadmat, savemat

    data, names = source.read_bytes(), Names()
    if data.startswith(b"MATLAB 7.3"):
        raise DataError(f"a stand-in of {source.name} was asked", "it is of MATLAB 7.3", "Save it with -v7.")
    read_mat5(data, room(source.name, len(data)), (), {})  # scipy trusts the sizes that a file states
    found = {name: value for name, value in loadmat(source).items() if not name.startswith("__")}
    savemat(target, {names(name): _array(names, test, name, value) for name, value in found.items()}, False)


def _array(names: Names, test: Simulation, name: str, value: Any) -> Array:
    array = np.asarray(value)
    if array.dtype.names:
        new = np.empty(array.shape, [(names(field), object) for field in array.dtype.names])
        for field in array.dtype.names:
            new[names(field)] = _array(names, test, field, array[field])
        return new
    if array.dtype == object:
        return np.asarray(np.frompyfunc(partial(_array, names, test, name), 1, 1)(array))
    if array.dtype.kind not in "biufc":
        return np.array([names(str(text)) for text in array.ravel()]).reshape(array.shape)
    if array.size < _FEW:
        meanings = {meaning for meaning, _ in meanings_of(name)} | {key_meaning(name)}
        return array if meanings & _CLOCKS else np.ones_like(array)
    series = np.moveaxis(array, int(np.argmax(array.shape)), 0)
    columns = [*series.reshape(len(series), -1).T]
    new = np.stack(_like(columns, [name] * len(columns), test), 1).reshape(series.shape).astype(array.dtype)
    return np.moveaxis(new, 0, int(np.argmax(array.shape)))


def _universal(source: Path, target: Path, test: Simulation) -> None:
    data, names, at = source.read_bytes(), Names(wide=True), 0
    said: list[bytes] = []
    end = b"\r\n" if b"\r\n" in data[:200] else b"\n"
    for k, block in enumerate(scan(source.name, data, room(source.name, len(data)))):
        opening = _OPENING.search(data, data.find(b"-1", at) + 2 if k else 0)
        start = len(data) if opening is None else opening.end()
        lines, payload = _set(block, k, names, test)
        said += [data[at:start], end.join([*lines, b""]), payload]
        at = start + len(end.join([*block.records, b""])) + len(payload)
    target.write_bytes(b"".join([*said, data[at:]]))


def _set(block: Block, k: int, names: Names, test: Simulation) -> tuple[Sequence[bytes], bytes]:
    """Return the records and the payload of a set: places and forms as they are, names in their columns, simulated numbers."""
    if block.dataset == _UNITS:
        return block.records, b""
    lines, head, size, code, x = [record.decode("latin-1") for record in block.records], 0, "1f8", 0, []
    if block.dataset == _FUNCTION:
        form = parse(FORM, block.records[6], block.name)
        head, size, code = HEADER_LINES, _ORDINATES[form["ordinate data type"]], int(lines[5][:5])
        x = [("time", f"{block.order}f{block.abscissa_bytes or 4}")] * (form["abscissa spacing"] == 0)
    what = ["coherence" if code == _COHERENCE else "real", "imag"][: int(size[0])]
    kinds = [*x, *((name, block.order + size[1:]) for name in what)]
    texts = [text for line in lines[head:] for text in _REAL.findall(line)]
    values = np.array([float(text.upper().replace("D", "E")) for text in texts])
    table = np.frombuffer(block.payload or b"", kinds).copy()
    rows = values[: values.size // len(kinds) * len(kinds)].reshape(-1, len(kinds))
    columns = [table[name] for name, _ in kinds] if table.size else [*rows.T]
    simulated = _like(columns, [n for n, _ in kinds], test._replace(kind="lines" if code > 1 else "noise"), k)
    for column, new in zip(columns, simulated, strict=True):
        column[:] = new
    given = iter(values.tolist())
    for n, line in enumerate(lines):
        if n >= head and _REAL.search(line):
            lines[n] = _REAL.sub(lambda text: _written(next(given), text[0]), line)
        elif n != 6 or not head:
            lines[n] = names(line, block.dataset != _HEADER and (n > 4 or not head))
    return [line.encode("latin-1") for line in lines], table.tobytes()


_MADE = {".xlsx": _workbook, ".mat": _matlab}
