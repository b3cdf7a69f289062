"""Define what a reader returns, the data object and an account of every part of the file, and what it raises."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from modalscope.data import (
    DataError,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Note,
    Signals,
    StabilizationDiagram,
    StateSpace,
    StoredResponse,
    StoredSignals,
)
from modalscope.data.shown import summary_of
from modalscope.numerics.errors import as_read

ArrayData: TypeAlias = FrequencyResponse | ImpulseResponse | Signals | ModalModel | Geometry | StateSpace
DataObject: TypeAlias = ArrayData | StoredSignals | StoredResponse | StabilizationDiagram
Options: TypeAlias = Mapping[str, Any]
#: Parts of one kind that are listed one by one; more are one line. Also the reasons for parts left that a note gives.
_MAX_LISTED = 4
#: Number of the last character of Unicode.
_LAST_CHARACTER = 0x10FFFF
#: What readers and the packages under them raise on damaged files. TypeError and AttributeError are faults of a program, MemoryError one
#: of the machine: nobody is told to export a file again for them.
DAMAGED = (
    *(ValueError, KeyError, IndexError, OSError, EOFError, RuntimeError, SystemError),
    *(ArithmeticError, AssertionError, SyntaxError, struct.error, zlib.error, zipfile.BadZipFile, tokenize.TokenError),
)


def unreadable(where: str, fault: str, remedy: str = "Export or copy it again.") -> DataError:
    """Return the error of a file that is not read."""
    return DataError(f"reading {where}:", fault, remedy)


def needs(where: str, need: str, fault: str, remedy: str) -> DataError:
    """Return the error of a file that lacks what reading needs."""
    return DataError(f"reading {where} needs {need}", fault, remedy)


class SeveralTests(DataError):
    """Raised for a file that holds several tests where none was chosen; `names` are theirs."""

    names: tuple[str, ...] = ()


def several_tests(where: str, what: str, names: Sequence[str]) -> SeveralTests:
    """Return the error of a file whose tables, called `what`, are tests of their own."""
    remedy = "Name one: " + " or ".join(f'--test "{name}"' for name in names[:3])
    error = SeveralTests(f"reading {where}:", f"several of its {what} hold tables: {', '.join(names[:12])}", remedy)
    error.names = tuple(names)
    return error


@contextmanager
def damage_as_error(
    where: str, remedy: str = "Export or copy it again.", kinds: tuple[type[BaseException], ...] = DAMAGED
) -> Iterator[None]:
    """Turn what damaged files make a reader raise into a `DataError` that names the file."""
    try:
        yield
    except (DataError, PermissionError, FileNotFoundError, MemoryError):
        raise
    except kinds as error:
        words = f"{type(error).__name__}: {str(error)[:100]}"
        raise unreadable(where, f"it is damaged or of another kind ({words})", remedy) from error


def check_characters(name: str, array: Any) -> None:
    """Raise ValueError where text in a file has numbers that are no characters: Python ends in a SystemError when it meets them."""
    if array.dtype.kind == "U" and array.dtype.itemsize:
        plain = np.ascontiguousarray(array).reshape(-1)
        codes = plain.astype(array.dtype.newbyteorder("="), copy=False).view(np.uint32)
        if codes.size and codes.max() > _LAST_CHARACTER:
            raise ValueError(f"{name} has numbers that are no characters")


@dataclass(frozen=True, kw_only=True, slots=True)
class Finding:
    """One part of a file: what it is, and whether it was taken.

    Parameters
    ----------
    part : str
        Where it stands: `set 5`, or the name of an array.
    what : str
        What it holds, in words.
    kind : str
        What sort of thing that is, when there may be many of a sort: `frequency response`.
    taken : bool
        Whether `read` returns it.
    reason : str
        Why it was ignored; empty when it was taken.
    """

    part: str
    what: str
    kind: str = ""
    taken: bool = True
    reason: str = ""

    def __str__(self) -> str:
        left = "" if self.taken else f" - left: {self.reason}"
        return f"{self.part}: {self.kind} {self.what}".replace(":  ", ": ") + left


@dataclass(frozen=True, kw_only=True, slots=True)
class Contents:
    """The data object that a file gives, what was found in it, what is missing and what else to know.

    Parameters
    ----------
    thing : data object
        What `read` returns.
    found : tuple of Finding
        Every part, taken or left and why.
    missing : tuple of str
        What would be needed to take more.
    notes : tuple of str
    margin : float
        Of a table, by how much a record over time is likelier than responses over frequency, in log likelihood; may be negative.
    begins : float
        Of a record, the time of its first sample by the clock of its file, s.
    """

    thing: DataObject
    found: tuple[Finding, ...] = ()
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    margin: float = 0.0
    begins: float = 0.0


@dataclass(frozen=True, slots=True)
class Format:
    """One row of the table of formats.

    `name`: the format in words. `reader`: `reader(path, options) -> Contents`. `writer`: `writer(path, thing, options)`. `read_options`,
    `write_options`: keyword options of its own. `folder`: whether it is a folder of files.
    """

    name: str
    reader: Callable[[Path, Options], Contents]
    writer: Callable[[Path, Any, Options], None] | None = None
    read_options: tuple[str, ...] = ()
    write_options: tuple[str, ...] = ()
    folder: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class Survey(Contents):
    """What a file holds, in words: every part, taken or left and why, and what is missing; with all that `Contents` has.

    Parameters
    ----------
    path : Path
    format : str
        The format in words.
    """

    path: Path
    format: str

    @property
    def result(self) -> str:
        """What `read` returns, in words."""
        return summary_of(self.thing)

    @property
    def left(self) -> tuple[Finding, ...]:
        """The parts that were not taken."""
        return tuple(finding for finding in self.found if not finding.taken)

    @property
    def told(self) -> tuple[Note, ...]:
        """What of the file was not read, what is missing and what else to know, as one note; none where all was read."""
        reasons = Counter(finding.reason for finding in self.left).most_common()
        texts = [f"{count} of {len(self.found)} parts not used: {reason}" for reason, count in reasons[:_MAX_LISTED]]
        texts += ["other parts not used"] if len(reasons) > _MAX_LISTED else []
        texts += [f"missing: {text}" for text in self.missing]
        texts += self.notes
        numbers = {"parts": len(self.found), "left": len(self.left), "begins": self.begins}
        return (Note("file", numbers, f"{self.path.name}: {'; '.join(texts)}"),) if texts else ()

    def __str__(self) -> str:
        lines = [f"{self.path.name}: {self.format}", f"read gives {self.result}"]
        lines += [f"  {line}" for line in _grouped(self.found)]
        lines += [f"missing: {text}" for text in self.missing]
        lines += [f"note: {text}" for text in self.notes]
        return as_read("\n".join(lines))


def _grouped(findings: tuple[Finding, ...]) -> list[str]:
    """Return a line a finding; runs of more than four parts of one kind that are read are one line."""
    lines = []
    for (taken, kind), group in groupby(findings, key=lambda finding: (finding.taken, finding.kind)):
        parts = list(group)
        if taken and kind and len(parts) > _MAX_LISTED:
            first, last = parts[0], parts[-1]
            lines.append(f"{first.part} to {last.part}: {len(parts)} x {kind}, {first.what} to {last.what}")
        else:
            lines += map(str, parts)
    return lines


def chosen(where: str, what: str, names: Iterable[str], tables: Sequence[str], options: Options) -> str:
    """Return the name of the table to read, of several in one file.

    `what`: what its tables are called: "sheets". `names`: of all of them. `tables`: of those that hold tables. `options`: `sheet`.

    Raises `DataError`: no table of the name asked for, or several tables and no name.
    """
    names, asked = list(names), options.get("sheet")
    if asked is not None:
        if str(asked) not in names:
            fault = f"its {what} are {', '.join(names[:12])}"
            raise DataError(f"--test {str(asked)[:60]!r} of {where}:", fault, "Name one of them.")
        return str(asked)
    if len(tables) > 1:
        raise several_tests(where, what, tables)
    if not names:
        raise unreadable(where, f"it has no {what}")
    return tables[0] if tables else names[0]


def is_frame(thing: object) -> bool:
    """Whether an object is one of pandas or xarray that `from_frame` takes."""
    kind = type(thing)
    names = ("DataFrame", "Series", "Dataset", "DataArray")
    return kind.__module__.partition(".")[0] in ("pandas", "xarray") and kind.__name__ in names
