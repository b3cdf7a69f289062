"""Find what other installed packages add to the tables of the program, by their entry points."""

from __future__ import annotations

from functools import cache
from typing import Any

from modalscope.numerics.errors import DataError

#: Readers by suffix, without its dot: functions of a path that return data.
FORMATS = "modalscope.formats"
#: Rows of the table of methods by name.
METHODS = "modalscope.methods"
#: What few need of the program itself: readings of data by name, reports and writers of results by suffix, without its dot.
READINGS, REPORTS, WRITINGS = "modalscope.readings", "modalscope.reports", "modalscope.writings"


@cache
def names_added(group: str) -> tuple[str, ...]:
    """Return the names that installed packages add to a table."""
    return tuple(point.name for point in _points(group))


@cache
def added(group: str, name: str) -> Any:
    """Return what an installed package adds to a table under a name.

    Raises
    ------
    DataError
        No package adds it, or the package cannot be loaded.
    """
    point = next((point for point in _points(group) if point.name == name), None)
    if point is None:
        raise DataError(f"{name} of {group}:", "no installed package adds it", "Install modalscope again.")
    try:
        return point.load()
    except Exception as error:  # noqa: BLE001 - the code of others may raise anything
        asked = f"{name} of the installed package {getattr(point.dist, 'name', point.value)}:"
        raise DataError(asked, f"it does not load ({type(error).__name__}: {error})", "Update or remove it.") from None


def _points(group: str) -> Any:
    from importlib.metadata import entry_points  # a tenth of a second: loaded where a name is not our own

    return entry_points(group=group)
