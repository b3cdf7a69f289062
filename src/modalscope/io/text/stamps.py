"""Dates and times of day as seconds."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import date

import numpy as np

from modalscope.model.checks import RealArray

__all__ = ["is_stamp", "seconds_of"]

_CLOCK = r"(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{1,2})(?:[.,:](?P<part>\d{1,9}))?)?\s?(?P<half>[AaPp][Mm])?"
_ZONE = r"(?:Z|[+-]\d{2}:?\d{2})?"
_FORMS = tuple(
    re.compile(form + r"\Z")
    for form in (
        rf"(?P<y>\d{{4}})[-/.](?P<m>\d{{1,2}})[-/.](?P<d>\d{{1,2}})(?:[T ]+{_CLOCK}{_ZONE})?",
        rf"(?P<d>\d{{1,2}})\.(?P<m>\d{{1,2}})\.(?P<y>\d{{4}})(?:[ T,]+{_CLOCK})?",
        rf"(?P<m>\d{{1,2}})[/-](?P<d>\d{{1,2}})[/-](?P<y>\d{{4}})(?:[ T,]+{_CLOCK})?",
        _CLOCK,
    )
)
_DAY = 86400.0
_LONGEST = 40
#: Digits of a second that stamps have.
_PLACES = 9


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a date, a time of day, or both.

    Examples
    --------
    >>> [
    ...     is_stamp(cell)
    ...     for cell in ("2024-05-01T12:00:00.125Z", "01.05.2024 12:00:00,125", "12:00:00 PM", "1.5", "run 1")
    ... ]
    [True, True, True, False, False]
    """
    return 4 <= len(cell) <= _LONGEST and not cell[-1].isspace() and any(form.match(cell) for form in _FORMS)


def _day_and_seconds(cell: str) -> tuple[int, float]:
    """Return the number of a day, 0 where there is none, and the seconds in it: together they would lose digits."""
    found = next((match for form in _FORMS if (match := form.match(cell))), None)
    if found is None:
        raise ValueError(f"{cell!r} is no date or time")
    part = found.groupdict()
    day = 0
    if part.get("y"):
        month, day_of = int(part["m"]), int(part["d"])
        if month > 12 >= day_of:  # day first, as most of the world writes it
            month, day_of = day_of, month
        day = date(int(part["y"]), month, day_of).toordinal()
    hour = int(part["h"] or 0)
    if part["half"]:
        hour = hour % 12 + (12 if part["half"].lower() == "pm" else 0)
    fraction = float(f"0.{part['part']}") if part["part"] else 0.0
    return day, hour * 3600.0 + int(part["min"] or 0) * 60.0 + int(part["s"] or 0) + fraction


def seconds_of(cells: Iterable[str], more: Iterable[str] | None = None) -> RealArray:
    """Return seconds from the first of dates and times; a column of dates and one of times of day are added.

    Times of day alone go on past midnight.

    Parameters
    ----------
    cells : iterable of str
    more : iterable of str, optional
        The other column.

    Raises
    ------
    ValueError
        A cell that is none.

    Examples
    --------
    >>> seconds_of(["23:59:59.5", "00:00:00.0"]), seconds_of(["2024-05-01 12:00:00", "2024-05-01 12:00:01"])
    (array([0. , 0.5]), array([0., 1.]))
    """
    days, seconds = _columns(cells)
    if more is not None:
        other_days, other_seconds = _columns(more)
        days, seconds = days + other_days, seconds + other_seconds
    elif days.size and not days.any():
        days = np.concatenate([[0], np.cumsum(np.diff(seconds) < -_DAY / 2)])
    return np.round((days - days[:1]) * _DAY + (seconds - seconds[:1]), _PLACES)


def _columns(cells: Iterable[str]) -> tuple[RealArray, RealArray]:
    pairs = np.array([_day_and_seconds(cell) for cell in cells], float).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]
