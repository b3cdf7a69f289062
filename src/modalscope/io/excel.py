"""Read the sheets of Excel workbooks (.xlsx) as tables."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date, datetime, time
from itertools import islice
from pathlib import Path
from typing import Any

from modalscope.data import DataError
from modalscope.io.columns import COLUMN_OPTIONS
from modalscope.io.contents import Contents, Options, chosen
from modalscope.io.limits import Room, room
from modalscope.io.text import contents_of_lines
from modalscope.io.text.cells import is_value
from modalscope.numerics.extras import optional_package

EXCEL_OPTIONS = (*COLUMN_OPTIONS, "skip", "sheet")

#: What openpyxl and the readers of archives and XML under it raise on damaged workbooks.
_DAMAGED = (
    ValueError,
    KeyError,
    TypeError,
    IndexError,
    AttributeError,
    OSError,
    EOFError,
    SyntaxError,
    RuntimeError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)
#: Rows by which a sheet is taken for a table, and rows of values that it then has.
_ROWS, _VALUES = 200, 3


def read(path: Path, options: Options) -> Contents:
    """Read a sheet of a workbook (options `sheet`, and those of text tables).

    Raises `DataError`: openpyxl is missing, no workbook, several sheets that are tables and no `sheet`, or what tables are refused for.
    """
    space = room(path.name, path.stat().st_size)
    with _opened(path, space) as book:
        name = _sheet(path.name, book, options)
        lines = _lines(book[name], int(options.get("skip") or 0))
        others = [other for other in book.sheetnames if other != name]
        notes = (f"sheet {name!r}; the others were left: {', '.join(others[:6])}",) if others else ()
        return contents_of_lines(path.name, lines, ("\t", "."), space, options, notes)


def rows_of(path: Path) -> list[tuple[int, str]]:
    """Return the rows of the first sheet with their numbers; tabs part their cells."""
    with _opened(path, room(path.name, path.stat().st_size)) as book:
        return list(_lines(book[book.sheetnames[0]], 0))


@contextmanager
def _opened(path: Path, space: Room) -> Iterator[Any]:
    """Give an open workbook; what openpyxl raises on damaged ones becomes a `DataError`."""
    package = optional_package(f"reading {path.suffix}", "openpyxl", "excel")
    try:
        _check_size(path, space)
        book = package.load_workbook(path, read_only=True, data_only=True)
        try:
            yield book
        finally:
            book.close()
    except _DAMAGED as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"reading {path.name} as an Excel workbook was asked",
            f"it is damaged or none ({type(error).__name__})",
            "Save it again as .xlsx, or as text (.csv).",
        ) from None


def _check_size(path: Path, space: Room) -> None:
    """Hold what the workbook unpacks to against the room: a cell becomes an object as its text does."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            space.take("what is packed in it", sum(member.file_size for member in archive.infolist()))


def _sheet(where: str, book: Any, options: Options) -> str:
    """Return the name of the sheet that is meant."""
    names = [str(name) for name in book.sheetnames]
    tables = [name for name in names if hasattr(book[name], "iter_rows") and _is_table(book[name])]
    return chosen(where, "sheets", names, tables, options)


def _is_table(sheet: Any) -> bool:
    rows = (line.split("\t") for _, line in islice(_lines(sheet, 0), _ROWS))
    return sum(any(cell for cell in row) and all(map(is_value, row)) for row in rows) >= _VALUES


def _lines(sheet: Any, skip: int) -> Iterator[tuple[int, str]]:
    """Give number and text of the rows that are not empty; tabs part their cells."""
    for number, row in enumerate(sheet.iter_rows(values_only=True), 1):
        cells = [_text(value) for value in row]
        while cells and not cells[-1]:
            cells.pop()
        if cells and number > skip:
            yield number, "\t".join(cells)


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool | int | float):
        return repr(float(value))
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    return " ".join(str(value).split())
