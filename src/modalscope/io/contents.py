"""Define what a reader returns: the data object and an account of every part of the file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

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

Plain: TypeAlias = FrequencyResponse | ImpulseResponse | Signals | ModalModel | Geometry | StateSpace
Thing: TypeAlias = Plain | StoredSignals | StoredResponse | StabilizationDiagram
Options: TypeAlias = Mapping[str, Any]


#: More parts of one sort than this are told in one line.
_TOGETHER = 4


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
        Why it was left; empty when it was taken.
    """

    part: str
    what: str
    kind: str = ""
    taken: bool = True
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.part}: {self.kind} {self.what}".replace(":  ", ": ") + (
            "" if self.taken else f" - left: {self.reason}"
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Contents:
    """The data object that a file gives, what was found in it, what is missing and what else to know."""

    thing: Thing
    findings: tuple[Finding, ...] = ()
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Format:
    """One row of the table of formats.

    `name`: the format in words. `reader`: `reader(path, options) -> Contents`. `writer`: `writer(path, thing, options)`. `read_options`,
    `write_options`: keyword options of its own. `folder`: whether it is a folder of files.
    """

    name: str
    reader: Callable[[Path, Options], Contents] | None
    writer: Callable[[Path, Any, Options], None] | None
    read_options: tuple[str, ...] = ()
    write_options: tuple[str, ...] = ()
    folder: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class Survey:
    """What a file holds, in words: every part, taken or left and why, and what is missing.

    Parameters
    ----------
    path : Path
    format : str
        The format in words.
    result : str
        What `read` returns, in words.
    thing : data object
        What `read` returns.
    found : tuple of Finding
    missing : tuple of str
        What would be needed to take more.
    notes : tuple of str
    """

    path: Path
    format: str
    result: str
    thing: Thing
    found: tuple[Finding, ...]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def left(self) -> tuple[Finding, ...]:
        """The parts that were not taken."""
        return tuple(finding for finding in self.found if not finding.taken)

    @property
    def told(self) -> tuple[Note, ...]:
        """What of the file was left and is missing, and what to know of it, as one note; none where all was taken."""
        reasons = Counter(finding.reason for finding in self.left).most_common()
        said = [f"{count} of {len(self.found)} parts left: {reason}" for reason, count in reasons[:_TOGETHER]]
        said += ["other parts left"] if len(reasons) > _TOGETHER else []
        said += [f"missing: {text}" for text in self.missing]
        said += self.notes
        numbers = {"parts": len(self.found), "left": len(self.left)}
        return (Note("file", numbers, f"{self.path.name}: {'; '.join(said)}"),) if said else ()

    def __str__(self) -> str:
        lines = [f"{self.path.name}: {self.format}", f"read gives {self.result}"]
        lines += [f"  {line}" for line in _grouped(self.found)]
        lines += [f"missing: {text}" for text in self.missing]
        lines += [f"note: {text}" for text in self.notes]
        return "\n".join(lines)


def _grouped(found: tuple[Finding, ...]) -> list[str]:
    """Return a line a finding; runs of taken parts of one kind are told together."""
    lines = []
    for (taken, kind), group in groupby(found, key=lambda finding: (finding.taken, finding.kind)):
        parts = list(group)
        if taken and kind and len(parts) > _TOGETHER:
            lines.append(
                f"{parts[0].part} to {parts[-1].part}: {len(parts)} x {kind}, {parts[0].what} to {parts[-1].what}"
            )
        else:
            lines += [str(finding) for finding in parts]
    return lines


# -------------------------------------------------------------------------------------------------------------- choice
# Which of several tables in a file is meant: sheets of a workbook, groups of a recorder's file.

T = TypeVar("T")


def chosen(
    where: str, what: str, there: Mapping[str, T] | Sequence[str], tables: Sequence[str], options: Options
) -> str:
    """Return the name of the table that is meant.

    `what`: what its tables are called: "sheets". `there`: all names. `tables`: those that hold tables. `options`: `sheet`.

    Raises `DataError`: no table of the name that was asked for, or several and none was: the message names the option that says which.
    """
    asked = options.get("sheet")
    if asked is not None:
        if str(asked) not in there:
            raise DataError(
                f"--sheet {str(asked)[:60]!r} of {where} was asked",
                f"its {what} are {', '.join(list(there)[:12])}",
                "Name one of them.",
            )
        return str(asked)
    if len(tables) > 1:
        raise DataError(
            f"reading {where} was asked",
            f"several of its {what} hold tables: {', '.join(tables[:12])}",
            "Name one: " + " or ".join(f'--sheet "{name}"' for name in tables[:3]),
        )
    if not there:
        raise DataError(f"reading {where} was asked", f"it has no {what}", "Export it again.")
    return tables[0] if tables else next(iter(there))
