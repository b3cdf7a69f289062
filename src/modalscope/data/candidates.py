"""Hold what stands beside the modes of a result: rejected candidates, and harmonics of rotating machines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Self, TypeVar

import numpy as np

from modalscope.numerics.checks import check_count, check_each, check_kind, check_number, freeze
from modalscope.numerics.errors import DataError


class _Row:
    """Data that are one entry of a list in a JSON file: the frequency is told as `frequency_hz`."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as the JSON module writes them; null for what is not known."""
        row = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        known = {name: None if isinstance(v, float) and not np.isfinite(v) else v for name, v in row.items()}
        return {"frequency_hz": known.pop("frequency"), **known}

    @classmethod
    def from_dict(cls, entries: Mapping[str, Any]) -> Self:
        """Take back what `to_dict` gave; entries of later versions are left."""
        check_kind("an entry of the file", entries, Mapping)
        named = {"frequency" if name == "frequency_hz" else name: value for name, value in entries.items()}
        known = {each.name: named[each.name] for each in fields(cls) if each.name in named}  # type: ignore[arg-type]
        try:
            return cls(**known)
        except TypeError:  # an entry that has no default
            raise DataError(
                f"an entry of a {cls.__name__} was asked", f"it has only {', '.join(entries)}", "Write the file again."
            ) from None


@dataclass(frozen=True, kw_only=True, slots=True)
class Candidate(_Row):
    """A pole that looked like a mode and was not reported.

    `frequency`: hz. `gain`: by how many standard deviations the data are explained better with it; NaN where that is not known. `reason`:
    why it was left out, in one sentence. `remedy`: what to do to have it reported, or to be rid of it.
    """

    frequency: float
    damping_ratio: float
    gain: float = np.nan
    reason: str = ""
    remedy: str = ""

    def __post_init__(self) -> None:
        check_kind("reason", self.reason, str)
        check_kind("remedy", self.remedy, str)
        freeze(
            self,
            frequency=check_number("frequency", self.frequency),
            damping_ratio=check_number("damping_ratio", self.damping_ratio),
            gain=_or_unknown("gain", self.gain),
        )

    def __str__(self) -> str:
        return f"{self.frequency:.4g} Hz, {100 * self.damping_ratio:.3g} %: {self.reason}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Harmonic(_Row):
    """A line of a turning machine, which is no mode.

    `frequency`: hz. `order`: which multiple of the shaft line it is; None where there is no such line. `level`: its root mean square over
    that of all outputs together. `evidence`: what shows that it is no mode, in words.
    """

    frequency: float
    order: int | None = None
    level: float = np.nan
    evidence: str = ""

    def __post_init__(self) -> None:
        check_kind("evidence", self.evidence, str)
        freeze(
            self,
            frequency=check_number("frequency", self.frequency),
            order=None if self.order is None else check_count("order", self.order),
            level=_or_unknown("level", self.level),
        )

    def __str__(self) -> str:
        which = "" if self.order is None else f", order {self.order} of the shaft line"
        return f"{self.frequency:.4g} Hz{which}: {self.evidence}"


def _or_unknown(name: str, value: Any) -> float:
    """Return a finite number; NaN for None and NaN, and an infinite number as it is."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return np.nan
    return value if isinstance(value, float) and np.isinf(value) else check_number(name, value)


_Kind = TypeVar("_Kind", Candidate, Harmonic)


def _rows_of(name: str, kind: type[_Kind], values: Any) -> tuple[_Kind, ...]:
    each = check_each(name, values, f"a list of {kind.__name__}")
    for value in each:
        check_kind(f"each of {name}", value, (kind, Mapping))
    return tuple(value if isinstance(value, kind) else kind.from_dict(value) for value in each)


def candidates_of(values: Iterable[Candidate | Mapping[str, Any]]) -> tuple[Candidate, ...]:
    """Return candidates as a tuple; what `to_dict` gave becomes one again."""
    return _rows_of("left_out", Candidate, values)


def harmonics_of(values: Iterable[Harmonic | Mapping[str, Any]]) -> tuple[Harmonic, ...]:
    """Return harmonics as a tuple; what `to_dict` gave becomes one again."""
    return _rows_of("harmonics", Harmonic, values)
