"""Tables of benchmarks in docs/validation: what was measured, when and at which commit, beside rows of earlier runs."""

from __future__ import annotations

import datetime
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

__all__ = ["commit_of", "table", "today"]


def commit_of(folder: Path) -> str:
    """Return the short name of the commit that a folder is at, "no checkout" where git knows none."""
    command = ["git", "-C", str(folder), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() or "no checkout"


def today() -> str:
    """Return the date."""
    return str(datetime.datetime.now(datetime.UTC).date())


def table(
    header: Sequence[str], measured: Iterable[str], before: Iterable[str], names: Sequence[tuple[str, ...]]
) -> str:
    """Return a table of rows, in the order of `names`; of what was not measured the row of the page from `before`.

    `names`: the first cells of every row that the table may have.
    """
    lines: dict[tuple[str, ...], str] = {}
    for line in (*before, *measured):
        cells = tuple(cell.strip() for cell in line.split("|")[1:])
        lines |= {name: line for name in names if cells[: len(name)] == name}
    head = [f"| {' | '.join(header)} |", "| --- " * len(header) + "|"]
    return "\n".join([*head, *(lines[name] for name in names if name in lines)])
