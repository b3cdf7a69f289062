"""Define a table of columns with names, units and rate, as all readers of tables return it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from modalscope.numerics.checks import Array


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Column:
    """One column of a table.

    `number`: its place in the file, from 1. `name`, `unit`: as they stand in the head; empty where there is none. `values` (N,): numbers,
    0 and 1 of booleans, or one text or none where it holds text.
    `stamps`: whether the values were dates and times, now seconds from the first.
    """

    number: int
    name: str = ""
    unit: str = ""
    values: Array
    stamps: bool = False

    def __post_init__(self) -> None:
        if self.values.dtype == bool:
            object.__setattr__(self, "values", self.values.astype(np.uint8))

    @property
    def label(self) -> str:
        """The name, or one made of its place."""
        return self.name or f"col{self.number}"

    @property
    def textual(self) -> bool:
        """Whether it holds text."""
        return self.values.dtype.kind not in "biufc"

    def __str__(self) -> str:
        named = f"column {self.number}" + (f", {self.name!r}" if self.name else "")
        return f"{named} [{self.unit}]" if self.unit else named


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Table:
    """Columns of equal length, their sampling rate, and notes.

    `rate`: samples per second. `rate_from`: where the rate stands: `header line 3`. `lines`: the first frequency and
    the step, Hz, where a header says them. `complex_values`: whether a header says that values are complex. `notes`: what was found, in
    words. `layout`: the evidence on the layout: part, and what it is. `roles`: what the file itself says of its columns. `first_row`: the
    row of the file that is the first here, from 1 below the head. `begins`: when its clock was at zero, s since 1970, where the file says.
    `quantity`: of its outputs, where the file says it besides their units.
    """

    where: str
    columns: tuple[Column, ...]
    rate: float | None = None
    rate_from: str = ""
    lines: tuple[float, float] | None = None
    complex_values: bool = False
    notes: tuple[str, ...] = ()
    layout: tuple[tuple[str, str], ...] = ()
    roles: Mapping[int, str] = field(default_factory=dict)
    first_row: int = 1
    begins: float = 0.0
    quantity: str | None = None

    @property
    def rows(self) -> int:
        """Rows under the head."""
        return max((len(column.values) for column in self.columns if not column.textual), default=0)


def span(numbers: list[int]) -> str:
    """Return places as `--columns` takes them.

    Examples
    --------
    >>> span([2, 3, 4, 7]), span([5])
    ('2-4,7', '5')
    """
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return ",".join(f"{part[0]}-{part[-1]}" if len(part) > 1 else f"{part[0]}" for part in parts)


def as_word(text: str) -> str:
    """Return a name as it stands on a command line.

    Examples
    --------
    >>> as_word("Time"), as_word("Acc A")
    ('Time', '"Acc A"')
    """
    return text if text.replace("_", "a").isalnum() else f'"{text}"'
