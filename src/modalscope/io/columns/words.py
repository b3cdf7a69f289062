"""Words of the field in the heads of columns: names, units, and what they say about a column.

Units and names are compared after `plain_unit` and `words_of`, so that `m/s²`, `m/s^2` and `[m / s2]` are one unit.
"""

from __future__ import annotations

import re
from functools import cache

from modalscope.model.units import FACTORS, plain_unit

__all__ = ["UNITS", "factor_to_base", "is_unit", "kind_of_unit", "plain_unit", "split_head", "words_of"]

#: What units measure. Letters keep their case: s is a second and S is none.
UNITS: dict[str, tuple[str, ...]] = {
    "time": ("s", "sec", "secs", "second", "seconds", "ms", "msec", "us", "usec", "ns", "min", "h", "hr"),
    "frequency": ("Hz", "hz", "HZ", "kHz", "cps", "rad/s", "rad/sec", "1/s"),
    **{kind: tuple(units) for kind, (_, units) in FACTORS.items() if kind != "moment"},
    "force": (*FACTORS["force"][1], *FACTORS["moment"][1]),
    "level": ("dB", "db", "DB"),
    "no vibration": ("degC", "C", "K", "degF", "F", "%", "%RH", "rpm", "RPM", "U/min", "1/min", "A", "mA", "W", "kW", "ppm", "lx"),
    "none": ("-", "1", "none", "n/a", "counts", "count", "LSB", "EU"),
}  # fmt: skip

#: So many of the base unit (s, Hz, rad) is one of these.
_FACTORS = {
    "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "usec": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "hr": 3600.0, "kHz": 1e3,
    "rad/s": 0.15915494309189535, "rad/sec": 0.15915494309189535, **FACTORS["angle"][1],
}  # fmt: skip

_KIND = {unit: kind for kind, units in UNITS.items() for unit in units}

#: Units that are as often a number or letter of a channel, outside of square brackets.
_WEAK = {"1", "-", "A", "C", "F", "G", "K", "W"}

#: Characters of a head that are looked at: nobody writes longer ones.
LONGEST = 400

_BRACKETED = re.compile(r"^(?P<name>.*?)\s*[\[<{](?P<unit>[^\[\]<>{}]*)[\]>}]\s*(?P<rest>\S*)$")
_ROUND = re.compile(r"^(?P<name>.*\S)\s*\((?P<unit>[^()]*(?:\([^()]*\)[^()]*)*)\)\s*$")
_SLASH = re.compile(r"^(?P<name>.*\S)(?:\s+(?:/|in|,)\s*|,\s+)(?P<unit>\S+)$")
#: DIN 1313 without blanks, `F/N` or `a_1/(m/s^2)`; the names of pairs (`3Z/1Z`) have no unit behind the stroke.
_STROKE = re.compile(r"^(?P<name>[^\s/]+)/(?:\((?P<round>[^()]+)\)|(?P<plain>[^()]+))$")
_PART_OF = re.compile(r"^(?P<part>re|im|real|imag|abs|arg|mag|phase)\{(?P<name>[^{}]*)\}", re.IGNORECASE)
_UNDERSCORE = re.compile(r"^(?P<name>.*[A-Za-z0-9])_(?P<unit>s|ms|us|hz|Hz|kHz|N|kN|g|deg|rad|mm|um)$")
_WORD = re.compile(r"[A-ZÀ-Þ]?[a-zà-ÿ]+|[A-ZÀ-Þ]+(?![a-zà-ÿ])|\d+|#")


@cache
def kind_of_unit(unit: str) -> str:
    """Return what a unit measures; nothing where it is not known, and for an empty one.

    Examples
    --------
    >>> kind_of_unit("m/s^2"), kind_of_unit("lbf"), kind_of_unit("furlong")
    ('acceleration', 'force', '')
    """
    return _KIND.get(plain_unit(unit), "")


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known, or a ratio of such."""
    plain = plain_unit(text)
    if plain in _KIND:
        return True
    above, slash, below = plain.rpartition("/")
    return bool(slash) and kind_of_unit(above) != "" and kind_of_unit(below) != ""


def factor_to_base(unit: str) -> float:
    """Return how many s, Hz or rad one of a unit is; 1 where it is none of these.

    Examples
    --------
    >>> factor_to_base("ms"), factor_to_base("kHz"), factor_to_base("")
    (0.001, 1000.0, 1.0)
    """
    return _FACTORS.get(plain_unit(unit), 1.0)


def split_head(head: str) -> tuple[str, str]:
    """Return name and unit of a head such as `AccA [m/s^2]`, `Force (N)`, `Time / s`, `F/N` or `freq_hz`.

    In round brackets, behind a slash, a comma or `in` a text is a unit only where it is known as one.

    Examples
    --------
    >>> (
    ...     split_head("AccA [m/s^2]"),
    ...     split_head("Force (N)"),
    ...     split_head("H (1)"),
    ...     split_head("Zeit / s"),
    ...     split_head("time_s"),
    ...     split_head("a_1/(m/s^2)"),
    ...     split_head("3Z/1Z"),
    ... )
    (('AccA', 'm/s^2'), ('Force', 'N'), ('H (1)', ''), ('Zeit', 's'), ('time', 's'), ('a_1', 'm/s^2'), ('3Z/1Z', ''))
    """
    text = _PART_OF.sub(r"\g<part>(\g<name>)", head.strip()[:LONGEST].strip("\"'").strip())
    found = _STROKE.match(text)
    if found:
        unit = (found["round"] or found["plain"]).strip()
        whole = plain_unit(text) in _KIND or (found["name"] not in _WEAK and is_unit(text))  # m/s is no column `m` in s
        return (found["name"], unit) if is_unit(unit) and unit not in _WEAK and not whole else (text, "")
    found = _BRACKETED.match(text)
    if found and found["name"]:
        return " ".join(f"{found['name']} {found['rest']}".split()), found["unit"].strip()
    for pattern in (_ROUND, _SLASH, _UNDERSCORE):
        found = pattern.match(text)
        if found and is_unit(found["unit"]) and found["unit"] not in _WEAK:
            return found["name"].strip(), found["unit"].strip()
    return text, ""


def words_of(name: str) -> list[str]:
    """Return the words of a name in small letters, also those that capitals part.

    Examples
    --------
    >>> words_of("InputForce_1"), words_of("AccA"), words_of("x-value")
    (['input', 'force', '1'], ['acc', 'a'], ['x', 'value'])
    """
    return [word.lower() for word in _WORD.findall(name[:LONGEST])]
