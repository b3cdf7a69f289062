"""Interpret the heads of columns, names and units, and the columns that options name.

Units and names are compared after `plain_unit` and `words_of`, so that `m/s²`, `m/s^2` and `[m / s2]` are one unit.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache

from modalscope.data import DataError
from modalscope.data.geometry import label_of, parse_dof
from modalscope.data.units import FACTORS, plain_unit
from modalscope.io.columns.table import Column
from modalscope.io.columns.vocabulary import MAX_CHARACTERS, meanings_of, parted, words_of

#: Turns or cycles a minute: of the axis frequencies, of a channel no vibration.
UNITS_OF_TURNS = ("rpm", "RPM", "U/min", "1/min", "cpm", "CPM")
#: What units measure. Letters keep their case: s is a second and S is none.
UNITS: dict[str, tuple[str, ...]] = {
    "time": ("s", "sec", "secs", "second", "seconds", "ms", "msec", "us", "usec", "ns", "min", "h", "hr"),
    "frequency": ("Hz", "hz", "HZ", "kHz", "cps", "rad/s", "rad/sec", "1/s"),
    **{kind: tuple(units) for kind, (_, units) in FACTORS.items() if kind != "moment"},
    "force": (*FACTORS["force"][1], *FACTORS["moment"][1]),
    "level": ("dB", "db", "DB"),
    "mass": ("kg",),
    "no vibration": ("degC", "C", "K", "degF", "F", "%", "%RH", *UNITS_OF_TURNS, "A", "mA", "W", "kW", "ppm", "lx"),
    "none": ("-", "1", "none", "n/a", "counts", "count", "LSB", "EU"),
}  # fmt: skip
#: Units by how many of the base unit (s, Hz, rad) they are.
_FACTORS_TO_BASE = {
    "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "usec": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "hr": 3600.0, "kHz": 1e3,
    "rad/s": 0.15915494309189535, "rad/sec": 0.15915494309189535, **dict.fromkeys(UNITS_OF_TURNS, 1 / 60), **FACTORS["angle"][1],
}  # fmt: skip

_KIND_OF_UNIT = {unit: kind for kind, units in UNITS.items() for unit in units}
#: Units written out or in capitals: in small letters, without the sign of several, and how they are written short.
_WRITTEN_OUT = {
    "newton": "N", "kilonewton": "kN", "lb": "lbf", "lbf": "lbf", "pound": "lbf", "poundforce": "lbf", "poundsforce": "lbf", "kip": "kip",
    "dyne": "dyn", "kilogramforce": "kgf", "kilopond": "kp", "g": "g", "volt": "V", "millivolt": "mV", "pascal": "Pa",
    "kilopascal": "kPa", "psi": "psi", "meter": "m", "metre": "m", "millimeter": "mm", "millimetre": "mm", "micrometer": "um",
    "micrometre": "um", "micron": "um", "feet": "ft", "sec": "s", "second": "s", "millisecond": "ms", "microsecond": "us",
    "nanosecond": "ns", "minute": "min", "hour": "h", "hertz": "Hz", "kilohertz": "kHz", "radian": "rad", "degree": "deg",
}  # fmt: skip
#: The word that a name of times ends with, and the unit that it says.
_ENDS_OF_TIMES = {
    "millis": "ms", "millisecond": "ms", "milliseconds": "ms", "msec": "ms", "micros": "us", "microsecond": "us", "microseconds": "us",
    "usec": "us", "nanos": "ns", "nanosecond": "ns", "nanoseconds": "ns", "nsec": "ns",
}  # fmt: skip
#: Units that may as well be a number or letter of a channel, outside of square brackets.
AMBIGUOUS_UNITS = {"1", "-", "A", "C", "F", "G", "K", "W"}
#: Two numbers in the brackets are places, as in `H[1/1]`.
_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[<{](?!\d+/\d+[\]>}])(?P<unit>[^\[\]<>{}]*)[\]>}]\s*(?P<rest>\S*)$")
#: A head with one pair of brackets, at its end: they hold the unit, whatever strokes there are.
_ENDS_BRACKETED = re.compile(r"^[^\[\]<>{}]+[\[<{][^\[\]<>{}]*[\]>}]$")
_ROUND = re.compile(r"^(?P<name>.*\S)\s*\((?P<unit>[^()]*(?:\([^()]*\)[^()]*)*)\)\s*$")
_SLASH = re.compile(r"^(?P<name>.*\S)(?:\s+(?:/|in|,)\s*|,\s+)(?P<unit>\S+)$")
#: DIN 1313 without blanks, `F/N` or `a_1/(m/s^2)`; the names of pairs (`3Z/1Z`) have no unit behind the stroke. One inside of brackets,
#: as in `ax[m/s2]`, parts nothing.
_STROKE = re.compile(
    r"^(?P<name>(?:[^\s/\[<{(|]|(?<=\S) (?=\S)|\([^()]*\)|\|[^|]*\||[\[<{][^\[\]<>{}]*[\]>}])+)"
    r"/(?:\((?P<round>[^()]*(?:\([^()]*\)[^()]*)*)\)|(?P<plain>[^()]+))$"
)
_PART_OF = re.compile(
    r"^(?P<part>(?:re|im|real|imag|abs|arg|mag|phase)[a-z]*(?: part)?) ?[{\[](?P<name>[^{}\[\]]*)[}\]]", re.IGNORECASE
)
_UNDERSCORE = re.compile(r"^(?P<name>.*[A-Za-z0-9])_(?P<unit>s|ms|us|hz|Hz|kHz|N|kN|g|deg|rad|mm|um)$")
#: Strokes of a unit at most: a ratio of ratios has three.
_MAX_STROKES = 3
#: What `--columns` may call a column.
ROLES = ("time", "frequency", "in", "out", "decay", "real", "imag", "mag", "phase", "coh", "ignore")
#: Names that stand for a whole range in `--columns`.
_RANGE = re.compile(r"(\d+)-(\d*)\Z")


@cache
def kind_of_unit(unit: str) -> str:
    """Return what a unit measures; nothing where it is not known, and for an empty one.

    Examples
    --------
    >>> kind_of_unit("m/s^2"), kind_of_unit("lbf"), kind_of_unit("Newtons"), kind_of_unit("furlong")
    ('acceleration', 'force', 'force', '')
    """
    return _KIND_OF_UNIT.get(plain_unit(short_unit(unit)), "")


@cache
def short_unit(unit: str) -> str:
    """Return a unit that is written out, or in capitals, as it is written short; any other as it stands.

    Examples
    --------
    >>> [short_unit(unit) for unit in ("Newtons", "pounds force", "LBF", "m/s^2/Newtons", "m/s²")]
    ['N', 'lbf', 'lbf', 'm/s^2/N', 'm/s²']
    """
    plain = plain_unit(unit)
    if plain in _KIND_OF_UNIT or unit.count("/") > _MAX_STROKES:
        return unit
    word = plain.lower().replace("-", "").replace("'", "")
    short = _WRITTEN_OUT.get(word) or _WRITTEN_OUT.get(word.removesuffix("s"))
    if short is not None:
        return short
    above, slash, below = unit.strip().rpartition("/")
    return f"{short_unit(above)}/{short_unit(below)}" if slash and kind_of_unit(above) and kind_of_unit(below) else unit


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known, or a ratio of such."""
    above, _, below = plain_unit(text).rpartition("/")
    return bool(kind_of_unit(text) or (kind_of_unit(above) and kind_of_unit(below)))


def bare_unit(unit: str) -> str:
    """Return a unit; nothing for what says that there is none."""
    return "" if kind_of_unit(unit) == "none" else unit


def factor_to_base(unit: str) -> float:
    """Return how many s, Hz or rad one of a unit is; 1 where it is none of these.

    Examples
    --------
    >>> factor_to_base("ms"), factor_to_base("kHz"), factor_to_base("")
    (0.001, 1000.0, 1.0)
    """
    return _FACTORS_TO_BASE.get(plain_unit(short_unit(unit)), 1.0)


def split_head(head: str) -> tuple[str, str]:
    """Return name and unit of a head such as `AccA [m/s^2]`, `Force (N)`, `Time / s`, `F/N`, `freq_hz` or `micros`.

    In round brackets, behind a slash, a comma or `in` a text is a unit only where it is known as one.

    Examples
    --------
    >>> [split_head(head) for head in ("AccA [m/s^2]", "Force (N)", "H (1)", "Zeit / s", "time_s")]
    [('AccA', 'm/s^2'), ('Force', 'N'), ('H (1)', ''), ('Zeit', 's'), ('time', 's')]
    >>> [split_head(head) for head in ("a_1/(m/s^2)", "3Z/1Z", "3Z/1Z[m/s2/N]")]
    [('a_1', 'm/s^2'), ('3Z/1Z', ''), ('3Z/1Z', 'm/s2/N')]
    """
    text = head.strip()[:MAX_CHARACTERS].strip("\"'").strip()
    part = _PART_OF.match(text)
    if part and part["name"] and not is_unit(part["name"]):
        text = f"{part['part']}({part['name']}){text[part.end() :]}"
    match = None if _ENDS_BRACKETED.match(text) else _STROKE.match(text)
    if match:
        unit = (match["round"] or match["plain"]).strip()
        # m/s is no column `m` in s
        whole = plain_unit(text) in _KIND_OF_UNIT or (match["name"] not in AMBIGUOUS_UNITS and is_unit(text))
        if is_unit(unit) and unit not in AMBIGUOUS_UNITS and not whole:
            return match["name"].strip(), unit
    match = None if match else _BRACKETED.match(text)
    if match and match["name"] and not (meanings_of(match["unit"]) and not is_unit(match["unit"])):  # [Re] is a part
        return " ".join(f"{match['name']} {match['rest']}".split()), match["unit"].strip()
    for pattern in (_ROUND, _SLASH, _UNDERSCORE):
        match = pattern.match(text)
        if match and is_unit(match["unit"]) and match["unit"] not in AMBIGUOUS_UNITS:
            return match["name"].strip(), match["unit"].strip()
    return text, _ENDS_OF_TIMES.get((words_of(text) or ("",))[-1], "")


def labels_of(names: Sequence[str]) -> list[str]:
    """Return labels of the names of all channels, which together say whether hyphens before directions are signs."""
    return [label_of(new if parse_dof(old) else old) for old, new in zip(names, parted(names)[0], strict=True)]


def named_columns(columns: Sequence[Column], items: Iterable[str], option: str) -> list[Column]:
    """Return the columns that items name: numbers from 1, ranges `3-9` and `3-`, or names.

    Raises `DataError`: a column that is not there.
    """
    selected: list[Column] = []
    by_number = {column.number: column for column in columns}
    last = max(by_number, default=0)
    for item in items:
        text = str(item).strip()
        alike = [column for column in columns if text in (column.name, column.label)] or [
            column for column in columns if column.label.lower() == text.lower()
        ]
        ranged = _RANGE.match(text)
        if alike:
            selected += alike
        elif ranged and int(ranged[1]) <= int(ranged[2] or last):
            numbers = range(int(ranged[1]), min(int(ranged[2] or last), last) + 1)
            if int(ranged[1]) not in by_number or int(ranged[2] or last) > last:
                raise _absent(columns, text, option)
            selected += [by_number[number] for number in numbers if number in by_number]
        elif text.isdecimal() and int(text[:9]) in by_number:
            selected.append(by_number[int(text[:9])])
        else:
            raise _absent(columns, text, option)
    return selected


def ignored_columns(columns: Sequence[Column], asked: object) -> list[Column]:
    """Return the columns that the option `ignore` names: one or several, by number or name."""
    items = asked if isinstance(asked, Iterable) and not isinstance(asked, str) else () if asked is None else (asked,)
    return named_columns(columns, map(str, items), "ignore")


def _absent(columns: Sequence[Column], text: str, option: str) -> DataError:
    there = ", ".join(f"{column.number} {column.name}".strip() for column in columns[:12])
    fault = f"the columns are {there}{' ...' if len(columns) > 12 else ''}"
    remedy = "Name columns by their number from 1, by a range such as 3-9, or by their name."
    return DataError(f"column {text[:60]!r} of --{option}:", fault, remedy)


def roles_of_option(columns: Sequence[Column], text: str) -> dict[int, str]:
    """Return the role of each column that `--columns` names, by its number.

    `text`: such as `time=1,in=2,out=3-9`; a part without a role belongs to the one before.

    Raises `DataError`: a role or column that is not there, a column named twice.

    Examples
    --------
    >>> import numpy as np
    >>> columns = [Column(number=k, name=name, values=np.zeros(2)) for k, name in enumerate(("t", "F", "a", "b"), 1)]
    >>> roles_of_option(columns, "time=1,in=F,out=3-")
    {1: 'time', 2: 'in', 3: 'out', 4: 'out'}
    """
    roles: dict[int, str] = {}
    role = ""
    for part in str(text).split(","):
        head, sign, rest = part.partition("=")
        if sign and head.strip().lower() in ROLES:
            role, part = head.strip().lower(), rest
        if not role or not part.strip():
            fault = f"{part.strip()[:60]!r} is not of the form ROLE=COLUMNS"
            remedy = f'Write for instance --columns "time=1,in=2,out=3-9"; the roles are {", ".join(ROLES)}.'
            raise DataError(f"--columns {text!r}:", fault, remedy)
        for column in named_columns(columns, [part], "columns"):
            if roles.get(column.number, role) != role:
                fault = f"{column} has two roles there"
                raise DataError(f"--columns {text!r}:", fault, "Give each column one role.")
            roles[column.number] = role
    return roles
