"""What each column of a table is: by what `--columns` says, by its unit, and by the words of its name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from modalscope.io.columns.table import Column
from modalscope.io.columns.words import kind_of_unit, words_of
from modalscope.model import DataError

__all__ = ["ROLES", "Role", "ignored_columns", "may_be_base", "named_columns", "role_by_words", "spoken_roles"]

#: What `--columns` may call a column.
ROLES = ("time", "frequency", "in", "out", "decay", "real", "imag", "mag", "phase", "coh", "ignore")

_TIME = {
    "time",
    "times",
    "zeit",
    "temps",
    "tiempo",
    "tempo",
    "tid",
    "tijd",
    "elapsed",
    "timestamp",
    "timestamps",
    "datetime",
    "seconds",
}
_CLOCK = {"date", "datum", "fecha", "clock", "uhrzeit"}
_FREQUENCY = {
    "frequency",
    "frequencies",
    "freq",
    "freqs",
    "frequenz",
    "fréquence",
    "frequence",
    "frecuencia",
    "frequenza",
    "hz",
}
_INDEX = {
    "index",
    "idx",
    "sample",
    "samples",
    "no",
    "nr",
    "row",
    "line",
    "point",
    "count",
    "counter",
    "scan",
    "#",
    "id",
    "record",
}
_FORCE = {
    "force", "forces", "hammer", "shaker", "input", "inputs", "exc", "excit", "excitation", "exciter", "kraft", "hammerkraft", "impact",
    "load", "loadcell", "stinger", "fuerza", "forza", "actuator", "drive",
}  # fmt: skip
#: Whole names; a capital F is a force.
_ALONE = {
    "t": "time", "T": "time", "X_Value": "time", "x_value": "time", "f": "frequency", "F": "in", "n": "index", "N": "index", "k": "index",
    "i": "index",
}  # fmt: skip
#: What may carry the motion of a base: an input, or one output of a structure that only listens; it is asked, not guessed.
_BASE = {"ground", "base", "table", "shaketable", "basement", "foundation", "freefield", "support", "boden", "suelo"}
_SENSORS = {"acc", "accel", "acceleration", "vel", "disp", "response", "output", "out"}
#: Quantities that are no vibration, whatever their unit.
_OTHERS = {
    "temperature",
    "temp",
    "temperatur",
    "humidity",
    "tacho",
    "rpm",
    "speed",
    "trigger",
    "voltage",
    "battery",
    "comment",
    "remark",
}

#: Names that stand for a whole range in `--columns`.
_RANGE = re.compile(r"(\d+)-(\d*)\Z")


@dataclass(frozen=True, kw_only=True, slots=True)
class Role:
    """What a column is, and why.

    Parameters
    ----------
    role : str
        One of `ROLES`, "index", or "" where nothing speaks for any.
    reason : str
        In words.
    """

    role: str = ""
    reason: str = ""


def may_be_base(column: Column) -> bool:
    """Whether a name is one that the motion of a base goes by.

    Parameters
    ----------
    column : Column
    """
    return not _BASE.isdisjoint(words_of(column.name))


def role_by_words(column: Column) -> Role:
    """Return what unit and name say about a column.

    The unit goes first: a column of N is a force, whatever it is called. A name is only asked where the unit is silent.
    """
    if column.textual:
        return Role(role="ignore", reason="it holds text")
    words, unit = words_of(column.name), kind_of_unit(column.unit)
    whole = column.name.strip()
    if column.stamps or unit == "time":
        return Role(role="time", reason="it holds dates and times" if column.stamps else "its unit is a time")
    if unit == "frequency" and column.unit.strip() != "1/s":
        return Role(role="frequency", reason=f"its unit is {column.unit}")
    if unit == "force":
        return Role(role="in", reason=f"its unit is that of a force, {column.unit}")
    if unit == "no vibration" or (not unit and set(words) & _OTHERS and not set(words) & _SENSORS):
        return Role(role="ignore", reason=f"{column.unit or words[0]} is no vibration")
    if unit in ("acceleration", "velocity", "displacement", "strain", "pressure", "angle"):
        return Role(role="out", reason=f"its unit is that of {'an' if unit[0] in 'a' else 'a'} {unit}, {column.unit}")
    return _by_name(whole, words)


def _by_name(whole: str, words: Sequence[str]) -> Role:
    held = set(words)
    if whole in _ALONE:
        return Role(role=_ALONE[whole], reason=f"its name is {whole!r}")
    said = f"its name says {next((word for word in words), whole)!r}"
    for role, known in (("time", _TIME | _CLOCK), ("frequency", _FREQUENCY)):
        if words and held & known and not held & (_FORCE | _SENSORS):
            return Role(role=role, reason=f"its name says {next(word for word in words if word in known)!r}")
    if held & _FORCE or (len(words) > 1 and words[0] == "in"):
        return Role(role="in", reason=f"its name says {next((w for w in words if w in _FORCE), 'in')!r}")
    if held & _SENSORS:
        return Role(role="out", reason=f"its name says {next(word for word in words if word in _SENSORS)!r}")
    if held and (held <= _INDEX | set("0123456789")) and held & _INDEX:
        return Role(role="index", reason=said)
    return Role()


def named_columns(columns: Sequence[Column], items: Iterable[str], option: str) -> list[Column]:
    """Return the columns that items name: numbers from 1, ranges `3-9` and `3-`, or names.

    Raises
    ------
    DataError
        A column that is not there.
    """
    found: list[Column] = []
    by_number = {column.number: column for column in columns}
    last = max(by_number, default=0)
    for item in items:
        text = str(item).strip()
        alike = [column for column in columns if text in (column.name, column.label)] or [
            column for column in columns if column.label.lower() == text.lower()
        ]
        ranged = _RANGE.match(text)
        if alike:
            found += alike
        elif ranged and int(ranged[1]) <= int(ranged[2] or last):
            numbers = range(int(ranged[1]), min(int(ranged[2] or last), last) + 1)
            if int(ranged[1]) not in by_number or int(ranged[2] or last) > last:
                raise _absent(columns, text, option)
            found += [by_number[number] for number in numbers if number in by_number]
        elif text.isdecimal() and int(text[:9]) in by_number:
            found.append(by_number[int(text[:9])])
        else:
            raise _absent(columns, text, option)
    return found


def ignored_columns(columns: Sequence[Column], asked: object) -> list[Column]:
    """Return the columns that the option `ignore` names: one or several, by number or name.

    Parameters
    ----------
    columns : sequence of Column
    asked : str, int or iterable of these, optional
    """
    items = asked if isinstance(asked, Iterable) and not isinstance(asked, str) else () if asked is None else (asked,)
    return named_columns(columns, map(str, items), "ignore")


def _absent(columns: Sequence[Column], text: str, option: str) -> DataError:
    there = ", ".join(f"{column.number} {column.name}".strip() for column in columns[:12])
    return DataError(
        f"column {text[:60]!r} of --{option} was asked",
        f"the columns are {there}{' ...' if len(columns) > 12 else ''}",
        "Name columns by their number from 1, by a range such as 3-9, or by their name.",
    )


def spoken_roles(columns: Sequence[Column], text: str) -> dict[int, str]:
    """Return the role of each column that `--columns` names, by its number.

    Parameters
    ----------
    columns : sequence of Column
    text : str
        Such as `time=1,in=2,out=3-9`; a part without a role belongs to the one before.

    Raises
    ------
    DataError
        A role or column that is not there, a column named twice.

    Examples
    --------
    >>> import numpy as np
    >>> columns = [Column(number=k, name=name, values=np.zeros(2)) for k, name in enumerate(("t", "F", "a", "b"), 1)]
    >>> spoken_roles(columns, "time=1,in=F,out=3-")
    {1: 'time', 2: 'in', 3: 'out', 4: 'out'}
    """
    roles: dict[int, str] = {}
    role = ""
    for part in str(text).split(","):
        head, sign, rest = part.partition("=")
        if sign and head.strip().lower() in ROLES:
            role, part = head.strip().lower(), rest
        if not role or not part.strip():
            raise DataError(
                f"--columns {text!r} was asked",
                f"{part.strip()[:60]!r} is not of the form ROLE=COLUMNS",
                f'Write for instance --columns "time=1,in=2,out=3-9"; the roles are {", ".join(ROLES)}.',
            )
        for column in named_columns(columns, [part], "columns"):
            if roles.get(column.number, role) != role:
                raise DataError(
                    f"--columns {text!r} was asked", f"{column} has two roles there", "Give each column one role."
                )
            roles[column.number] = role
    return roles
