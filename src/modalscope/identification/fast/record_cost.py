"""Predict operations and memory of records on lines, and refuse what the machine has no memory for."""

from __future__ import annotations

import os
from typing import NamedTuple

from modalscope.data.notes import Note
from modalscope.data.shown import figures
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import in_words

#: Products of two columns per second of a core, with the columns themselves: measured from 1e10 to 1e12 of them.
_PRODUCTS_PER_SECOND = 2.5e10


#: Simultaneous triangular factors in memory, and bytes of all small arrays.
_TRIANGLES, _SMALL_BYTES = 4, 32e6


class RecordCost(NamedTuple):
    """Seconds of one core for the factor, bytes of the transforms and triangles, and (q + 1)(1 + m + l) columns."""

    seconds: float
    bytes: float
    columns: int
    lines: int

    @property
    def note(self) -> Note:
        """The cost in words."""
        seconds = "less than a second" if self.seconds < 1 else f"about {figures(self.seconds, 2)} s"
        text = f"{self.columns} columns on {self.lines} lines: {seconds} of one core and {in_words(self.bytes)} of memory predicted"
        return Note("cost", {"seconds": self.seconds, "bytes": self.bytes}, text)


def record_cost(lines: int, outputs: int, inputs: int, degree: int) -> RecordCost:
    """Return the cost of records on lines: 2 F ((q + 1)(1 + m + l))^2 products, 16 F (l + m) bytes and four triangles of the columns.

    `lines`: f, of all runs. `degree`: q.

    Examples
    --------
    >>> print(record_cost(999_999, 62, 2, 8).note)
    585 columns on 999999 lines: about 27 s of one core and 1.1 GB of memory predicted
    """
    columns = (degree + 1) * (1 + inputs + outputs)
    size = 16.0 * lines * (outputs + inputs) + _TRIANGLES * 8.0 * columns**2 + _SMALL_BYTES
    return RecordCost(2.0 * lines * columns**2 / _PRODUCTS_PER_SECOND, size, columns, lines)


def refuse_beyond_memory(cost: RecordCost) -> None:
    """Raise where records on lines would take more memory than the machine has.

    Raises `DataError`: names both, and what takes less.
    """
    there = _memory()
    if there is not None and cost.bytes > there:
        raise DataError(
            "fitting the records on their lines:",
            f"{cost.columns} columns on {cost.lines} lines need {in_words(cost.bytes)} of memory, the machine has {in_words(there)}",
            "Give a band, lower block_rows, exclude channels, or identify runs one by one.",
        )


def _memory() -> float | None:
    """Return the bytes of memory of the machine; None where it does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
