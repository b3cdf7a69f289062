"""Define notes, what a result has to say, and findings, what is wrong with data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, NamedTuple, Self

import numpy as np

from modalscope.data.shown import percent
from modalscope.numerics.checks import check_count, check_each, check_kind, check_number, freeze
from modalscope.numerics.errors import DataError, as_read

#: The kind of a note that is nothing but its text.
REMARK = "remark"


@dataclass(frozen=True, slots=True)
class Note:
    """One thing that must be told; programs read `kind` and `numbers`, people read the text.

    Parameters
    ----------
    kind : str
        What sort of thing it is, in one word, such as "left out".
    numbers : mapping of name to number
        The numbers of the text; NaN where one is not known.
    text : str
        One sentence, whose remedies may name options of the terminal. `str(note)` has the arguments of Python in their place.

    Raises
    ------
    DataError
        A kind or a text that is no text, or a number that is none.

    Examples
    --------
    >>> note = Note("orders left out", {"lowest": 62, "rank": 60}, "orders from 62 on left out: the data have rank 60")
    >>> print(note, note.numbers["rank"])
    orders from 62 on left out: the data have rank 60 60.0
    """

    kind: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    text: str = ""

    def __post_init__(self) -> None:
        for name, text in (("kind", self.kind), ("text", self.text)):
            check_kind(f"{name} of a note", text, str)
        check_kind("numbers of a note", self.numbers, Mapping)
        numbers = {str(name): _or_unknown(f"{name} of a note", value) for name, value in self.numbers.items()}
        freeze(self, numbers=numbers)

    def __str__(self) -> str:
        return as_read(self.text)

    def __repr__(self) -> str:
        return f"Note({self.kind!r}, {dict(self.numbers)!r}, {str(self)!r})"

    def __hash__(self) -> int:
        return hash((self.kind, self.text, tuple(sorted(self.numbers.items()))))

    def to_dict(self) -> dict[str, Any]:
        """Return kind, numbers and text as the JSON module writes them; null for a number that is not finite."""
        numbers = {name: value if np.isfinite(value) else None for name, value in self.numbers.items()}
        return {"kind": self.kind, "numbers": numbers, "text": self.text}

    @classmethod
    def from_dict(cls, entries: Mapping[str, Any]) -> Note:
        """Take back what `to_dict` gave.

        Parameters
        ----------
        entries : mapping
            With "text", and "kind" and "numbers" where they are known.

        Raises
        ------
        DataError
            No text, or entries of the wrong type.
        """
        check_kind("a note", entries, Mapping)
        if "text" not in entries:
            raise DataError("a note needs a text", f"it has {', '.join(entries) or 'nothing'}", 'Give "text".')
        kind, numbers = entries.get("kind", REMARK), entries.get("numbers") or {}
        return cls(kind, numbers, entries["text"])


def notes_of(values: Iterable[Note | str | Mapping[str, Any]] | Note | str) -> tuple[Note, ...]:
    """Return notes as a tuple; plain text becomes a note of the kind "remark", entries of a file the note they were.

    Examples
    --------
    >>> [note.kind for note in notes_of(["one pole left out", Note("band", {}, "2 to 5 Hz")])]
    ['remark', 'band']
    """
    each = [values] if isinstance(values, str | Note) else check_each("notes", values, "notes or texts")
    return tuple(_note(value) for value in each)


def _note(value: Any) -> Note:
    if isinstance(value, Mapping):
        return Note.from_dict(value)
    check_kind("each of the notes", value, (Note, str))
    return value if isinstance(value, Note) else Note(REMARK, {}, value)


class Finding(NamedTuple):
    """One fault, or possible fault, of data.

    Attributes
    ----------
    kind : str
        One of `KINDS` of `modalscope.signals.doctor.findings`.
    channels : tuple of str
        Labels of the channels concerned.
    reason : str
        What was found.
    change : str
        What to do about it.
    frequencies : tuple of float
        Hz: the lines or resonances concerned, where it concerns single ones.
    """

    kind: str
    channels: tuple[str, ...]
    reason: str
    change: str
    frequencies: tuple[float, ...] = ()

    def beside(self, bands: Sequence[tuple[float, float]]) -> Finding:
        """Return the same finding; its reason says so where it concerns no line of the bands.

        Parameters
        ----------
        bands : sequence of (float, float)
            Hz.
        """
        inside = any(low <= f <= high for f in self.frequencies for low, high in bands)
        if not bands or not self.frequencies or inside:
            return self
        words = ", ".join(f"{low:g} to {high:g} Hz" for low, high in bands)
        return self._replace(reason=f"{self.reason} (no line of the band {words} is concerned)")

    def __str__(self) -> str:
        return as_read(f"{self.kind}: {', '.join(self.channels)}: {self.reason}. {self.change}")


class _Row:
    """Data that are one entry of a list in a JSON file: the frequency is told as `frequency_hz`."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal; what is not known (NaN) is."""
        return type(other) is type(self) and isinstance(other, _Row) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(tuple(self.to_dict().values()))

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as the JSON module writes them; null for what is not known."""
        row = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        known = {name: None if isinstance(v, float) and not np.isfinite(v) else v for name, v in row.items()}
        return {"frequency_hz": known.pop("frequency"), **known}

    @classmethod
    def from_dict(cls, entries: Mapping[str, Any]) -> Self:
        """Take back what `to_dict` gave; entries of later versions are ignored."""
        check_kind("an entry of the file", entries, Mapping)
        named = {"frequency" if name == "frequency_hz" else name: value for name, value in entries.items()}
        known = {each.name: named[each.name] for each in fields(cls) if each.name in named}  # type: ignore[arg-type]
        lacking = [each.name for each in fields(cls) if each.default is MISSING and each.name not in known]  # type: ignore[arg-type]
        if lacking:
            have = f"its entries are {', '.join(entries)}"
            raise DataError(f"a {cls.__name__} needs {', '.join(lacking)}:", have, "Write the file again.")
        return cls(**known)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
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
        return f"{self.frequency:.4g} Hz, {percent(self.damping_ratio)}: {self.reason}"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
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
        return np.nan  # one object, so that notes of the same content stay equal
    return value if isinstance(value, float) and np.isinf(value) else check_number(name, value)


def rows_of(name: str, kind: Any, values: Any) -> tuple[Any, ...]:
    """Return objects of a kind as a tuple; what its `to_dict` gave becomes one again. `name`: of the field, for the error."""
    each = check_each(name, values, f"a list of {kind.__name__}")
    for value in each:
        check_kind(f"each of {name}", value, (kind, Mapping))
    return tuple(value if isinstance(value, kind) else kind.from_dict(value) for value in each)
