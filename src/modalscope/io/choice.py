"""Which of several tables in a file is meant: sheets of a workbook, groups of a recorder's file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

from modalscope.io.contents import Options
from modalscope.model import DataError

__all__ = ["chosen"]

T = TypeVar("T")


def chosen(
    where: str, what: str, there: Mapping[str, T] | Sequence[str], tables: Sequence[str], options: Options
) -> str:
    """Return the name of the table that is meant.

    Parameters
    ----------
    where : str
        The file, for messages.
    what : str
        What its tables are called: "sheets".
    there : mapping or sequence of str
        All names.
    tables : sequence of str
        Those that hold tables.
    options : mapping
        `sheet`.

    Raises
    ------
    DataError
        No table of the name that was asked for, or several and none was: the message names the option that says which.
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
