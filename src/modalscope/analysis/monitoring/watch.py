"""Store the modes of the new records of a folder, and read tables of what was measured beside them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.analysis.monitoring.collecting import identified, settled as still
from modalscope.analysis.monitoring.entries import CHOICES
from modalscope.analysis.monitoring.history import as_times
from modalscope.analysis.monitoring.store import Store
from modalscope.numerics.arguments import COUNT, between, named
from modalscope.numerics.checks import RealArray, check_path
from modalscope.numerics.errors import DataError, check_option_names
from modalscope.numerics.plugins import READINGS, added

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Collected:
    """What a look at a folder found.

    Parameters
    ----------
    added : int
        Records stored.
    known : int
        Records that were stored before.
    refused : tuple of (str, str)
        Files that cannot be used, each with the reason.
    waiting : tuple of str
        Files that are still being written.
    replaced : tuple of str
        Files whose content changed: the record of the earlier one is stored no more.
    """

    added: int
    known: int
    refused: tuple[tuple[str, str], ...]
    waiting: tuple[str, ...]
    replaced: tuple[str, ...] = ()


@named(store=Store, jobs=COUNT, settled=between(0, 86_400, low_included=True), options=Mapping)
def collect(
    folder: str | Path,
    store: Store,
    *,
    jobs: int = 1,
    settled: float = 60.0,
    options: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Collected:
    """Identify every file of a folder that the store does not know, and store its modes or the reason why there are none.

    A file is known by its content; one that changed replaces its earlier record. Files that do not stand still are being written: they
    are left for the next look.

    Parameters
    ----------
    folder : path
        Its files and those of its folders that have a suffix that `read` knows.
    store : Store
    jobs : int
        Processes that identify; within `working(client)` the workers of its scheduler do.
    settled : float
        Seconds that a file must have stood still; it waits for those that have for less.
    options : mapping, optional
        As of `analyze`.
    progress : callable, optional
        Called with (files done, files in all).

    Returns
    -------
    Collected

    Raises
    ------
    DataError
        No such folder, or a worker that was ended.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> place = Path(mkdtemp())
    >>> with Store(place / "bridge.modes") as store:
    ...     collect(place, store)
    Collected(added=0, known=0, refused=(), waiting=(), replaced=())
    """
    place = check_path(folder)
    check_option_names("analyze", options or {}, CHOICES)
    if not str(folder) or not place.is_dir():  # no name at all is no folder, and not the one that the program works in
        raise DataError(f"records in {str(place)!r}:", "there is no such folder", "Name a folder.")
    files, waiting = still(place, settled)
    new = store.unknown(files)
    added = 0
    refused: list[tuple[str, str]] = []
    for done, entry in enumerate(identified(new, jobs, options or {}), 1):
        if store.put(entry) and entry.refused is None:
            added += 1
        if entry.refused is not None:
            refused.append((entry.name, entry.refused))
        if progress is not None:
            progress(done, len(new))
    replaced = tuple(task.name for task in new if task.replaces)
    return Collected(added, len(files) - len(new), tuple(refused), tuple(waiting), replaced)


@named(statistic=str)
def read_covariates(path: str | Path, *, statistic: str = "mean") -> tuple[Any, dict[str, RealArray]]:
    r"""Read a table of what was measured beside the records: times in the first column, a name in the head of each other one.

    Parameters
    ----------
    path : path
        Text with columns separated by commas or semicolons, times as ISO texts or seconds since 1970; or NetCDF (.nc).
    statistic : str
        The variable of a NetCDF file with the axes (time, channels).

    Returns
    -------
    times : array of datetime64, (k,)
    values : dict of name to array (k,)
        NaN where a cell is empty or no number.

    Raises
    ------
    DataError
        No such file, no head, or times that cannot be read.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> path = Path(mkdtemp()) / "weather.csv"
    >>> _ = path.write_text("time,temperature\n2026-06-01T00:00,11.5\n2026-06-01T01:00,\n")
    >>> read_covariates(path)[1]
    {'temperature': array([11.5,  nan])}
    """
    place = check_path(path)
    if place.suffix.lower() == ".nc":
        weather: tuple[Any, dict[str, RealArray]] = added(READINGS, "weather")(place, statistic)
        return weather
    asked = f"a table of covariates in {place.name}:"
    remedy = "Give a text table: time, then a column for each, with their names in the first line."
    try:
        text = place.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(asked, f"it cannot be read ({error})", remedy) from None
    lines = [line for line in text.splitlines() if line.strip()]
    head = lines[0] if lines else ""
    rows = list(csv.reader(lines, delimiter=";" if head.count(";") > head.count(",") else ","))
    if len(rows) < 2 or len(rows[0]) < 2 or any(len(row) != len(rows[0]) for row in rows):
        raise DataError(asked, "it has no columns, or lines of different length", remedy)
    stamps = [row[0].strip().removesuffix("Z").replace(" ", "T", 1) for row in rows[1:]]
    numbers = [_number(stamp) for stamp in stamps]
    times = as_times(f"the first column of {place.name}", stamps if np.isnan(numbers).any() else numbers)
    columns = zip(*(row[1:] for row in rows[1:]), strict=True)
    return times, {
        name.strip(): np.array([_number(cell) for cell in cells])
        for name, cells in zip(rows[0][1:], columns, strict=True)
    }


def _number(cell: str) -> float:
    try:
        return float(cell.strip().replace(",", "."))
    except ValueError:
        return np.nan
