"""Decide which files a document of an analysis, or a folder of data, may name: both may come from a stranger."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from modalscope.data.analysis import SourceFile
from modalscope.io.contents import unreadable

#: Options of reading that open a file; a test holds that there are no others.
OPENING = ("geometry",)


def lies_in(path: str | Path, folders: Iterable[str | Path]) -> bool:
    """Whether a path lies in one of the folders or below, wherever links lead; not where it is no path at all.

    Examples
    --------
    >>> lies_in("a/../b.csv", ["."]), lies_in("../b.csv", ["."])
    (True, False)
    """
    try:
        place = Path(os.path.realpath(path))
        return any(place.is_relative_to(os.path.realpath(folder)) for folder in folders)
    except (OSError, ValueError):  # a NUL, half a character, more letters than a name may have
        return False


def is_file_in(path: str | Path, folders: Iterable[str | Path]) -> bool:
    """Whether a path is a file in one of the folders or below."""
    try:
        return lies_in(path, folders) and Path(path).is_file()
    except OSError:  # more letters than a name may have
        return False


def named_in(reading: Mapping[str, Any]) -> list[Any]:
    """Return what options of reading name as files."""
    given = [reading[option] for option in OPENING if reading.get(option) is not None]
    return [name for each in given for name in (each if isinstance(each, list | tuple) else [each])]


def confined(files: Sequence[SourceFile], folders: Sequence[Path]) -> tuple[tuple[SourceFile, ...], list[str]]:
    """Return files without the options of reading that name others outside of the folders, and the names of these others."""
    outside: list[str] = []
    found = []
    for file in files:
        wrong = [str(name) for name in named_in(file.reading) if not lies_in(str(name), folders)]
        kept = {name: value for name, value in file.reading.items() if not wrong or name not in OPENING}
        found.append(replace(file, reading=kept))
        outside += wrong
    return tuple(found), list(dict.fromkeys(outside))


def check_links(folder: Path) -> None:
    """Raise `DataError` where a link in a folder of data leads out of it."""
    for parent, folders, names in os.walk(folder):
        for name in (*folders, *names):
            path = Path(parent, name)
            if path.is_symlink() and not lies_in(path, [folder]):
                fault = f"its {path.relative_to(folder).as_posix()[:80]} is a link to a file outside of the folder"
                raise unreadable(folder.name, fault, "Copy what it points to into the folder.")
