"""Text of a file as lines: in UTF-8 or UTF-16, or else as Windows wrote it in the west; never more than there is room for."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path

from modalscope.io.limits import Room
from modalscope.model import DataError

__all__ = ["encoding_of", "lines_of"]

_HEAD = 1 << 16
#: A line longer than this is none of a table.
_LONGEST = 1 << 25
#: Nor has one so many blank lines.
_BLANK = 10_000_000
_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def encoding_of(path: Path) -> str:
    """Return how the bytes of a text file are to be read, by its first 64 kB.

    Raises
    ------
    DataError
        It is no text.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    for mark, encoding in _MARKS:
        if head.startswith(mark):
            return encoding
    if b"\0" in head:
        raise DataError(
            f"reading {path.name} as a text table was asked",
            "it holds bytes that no text has",
            "Give it the suffix of what it is, or export it as text.",
        )
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines_of(path: Path, encoding: str, skip: int, space: Room) -> Iterator[tuple[int, str]]:
    """Give number, from 1, and text of the lines that are not blank.

    Parameters
    ----------
    path : path
    encoding : str
    skip : int
        Lines to leave at the top.
    space : Room
        What a line may take.
    """
    with path.open(encoding=encoding, errors="replace", newline=None) as file:
        number = blank = 0
        while line := file.readline(_LONGEST):
            number += 1
            if len(line) == _LONGEST:
                space.take(f"line {number}", 100 * len(line))
            if line.isspace():
                blank += 1
                space.parts("blank lines", blank, _BLANK)
            elif number > skip:
                yield number, line
