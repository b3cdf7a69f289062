"""Interpret what a header states beside its table: the rate or the step, the first value and units, whatever signs and language.

A statement is a key and a value, `Sampling Rate(Hz),50`, `dt = 0,5 ms`, `X-Axis delta: 0.25`. Keys are those of `vocabulary`. Units stand
behind the value, or in the key. Of several rates the one counts that a column of times agrees with.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from modalscope.data.units import plain_unit
from modalscope.io.columns.vocabulary import key_meaning, words_of
from modalscope.io.columns.words import factor_to_base, kind_of_unit, split_head
from modalscope.io.contents import needs

#: A number, whose thousands one sign may part, and its unit.
_QUANTITY = re.compile(
    r"\s*\"?(?P<number>[+-]?(?:[1-9]\d{0,2}(?:(?P<sign>[.,'])\d{3})(?:(?P=sign)\d{3})*(?!\d)(?:[.,]\d+)?|\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)"
    r"\s*(?P<unit>[A-Za-z/]*)"
)
_BARE = re.compile(r"[+-]?\d+(?:[.,]\d*)?(?:[eE][+-]?\d+)?\Z")
_WORDS_OF_RATE = {"s/s", "sps", "samples/s", "sa/s", "hz", "1/s", ""}
_MAX_CHARACTERS_OF_KEY = 60
#: What a header calls values that are complex; a unit in brackets.
_COMPLEX = ("complex", "komplex", "frf", "frequency response", "transfer")
_IN_BRACKETS = re.compile(r"^\((?P<unit>[^()]*)\)(?=/|\Z)")
#: Relative difference of a step and a rate that agree.
_AGREEMENT = 1e-2


@dataclass(frozen=True, slots=True)
class Statement:
    """A key and its value, and the line where it stands; -1 where there are no lines."""

    line: int
    key: str
    value: str


@dataclass(slots=True)
class Stated:
    """What a header says.

    `rates`: samples per second, each with its statement. `lines`: first frequency and step, Hz. `axis`: unit, first value and step as they
    stand. `unit`: of what is measured. `complex_values`: whether it says that values are complex. `label`, `reference`: the names of what
    was measured, and of what drove it.
    """

    rates: list[tuple[float, Statement]] = field(default_factory=list)
    lines: tuple[float, float] | None = None
    axis: tuple[str, float, float] | None = None
    unit: str = ""
    complex_values: bool = False
    label: str = ""
    reference: str = ""

    def rate(self, where: str, steps: Sequence[float]) -> tuple[float, Statement] | None:
        """Return the rate with its statement; of several the one that a step (s, or parts of it) agrees with.

        Raises `DataError`: rates that differ, none of which a column of times says.
        """
        taken = [step * turn for step in steps for turn in (1.0, 1e-3, 1e-6, 1e-9)]
        agree = [(r, s) for r, s in self.rates if any(abs(step * r - 1) < _AGREEMENT for step in taken)]
        rates = agree or self.rates
        values = [rate for rate, _ in rates]
        if values and max(values) > 1.001 * min(values):
            said = dict.fromkeys(f"{s.key} {s.value[:_MAX_CHARACTERS_OF_KEY]}" for _, s in rates)
            fault = f"its header says several: {', '.join(map(repr, list(said)[:4]))}"
            raise needs(where, "one sampling rate", fault, "Say it: --sampling-rate HZ")
        return rates[0] if rates else None


def stated_by(statements: Iterable[Statement], decimal: str) -> Stated:
    """Return what statements say.

    `decimal`: the decimal sign of the table.

    Examples
    --------
    >>> said = stated_by([Statement(0, "Sampling rate", "1.024 kHz"), Statement(1, "Operator", "7")], ".")
    >>> said.rates[0][0], stated_by([Statement(0, "dt [ms]", "0,5")], ",").rates[0][0]
    (1024.0, 2000.0)
    """
    found, first, step, axis, axis_unit = Stated(), None, None, "", ""
    for statement in statements:
        meaning = key_meaning(statement.key) if len(statement.key) <= _MAX_CHARACTERS_OF_KEY else ""
        axis, axis_unit = _in_words(found, statement, meaning, (axis, axis_unit))
        if meaning not in ("rate", "step", "frequency step", "first"):
            continue
        number, unit = _quantity(statement, meaning, decimal)
        kind = "frequency" if meaning == "frequency step" else kind_of_unit(unit)
        if number is None or (meaning != "first" and number <= 0):
            continue
        if meaning == "first":
            first = number * (factor_to_base(unit) if kind == "frequency" else 1.0)
        elif meaning == "rate" and (kind == "frequency" or unit.lower() in _WORDS_OF_RATE):
            found.rates += [(each * factor_to_base(unit), statement) for each in (number, *_others(statement))]
        elif meaning != "rate" and kind in ("time", "frequency", ""):
            step, axis = number * factor_to_base(unit), axis or kind
            steps = [each * factor_to_base(unit) for each in (number, *_others(statement)) if each > 0]
            found.rates += [(1 / each, statement) for each in steps] if kind != "frequency" else []
    if step is not None and axis_unit:
        found.axis = (axis_unit, first or 0.0, step)
    if step is not None and axis != "time" and (axis == "frequency" or first is not None):
        found.lines = (first or 0.0, step)
        lines = axis == "frequency" or found.complex_values
        found.rates = [(rate, s) for rate, s in found.rates if not lines or key_meaning(s.key) == "rate"]
    return found


def _in_words(found: Stated, statement: Statement, meaning: str, axis: tuple[str, str]) -> tuple[str, str]:
    """Take up what a statement says in words, unit, form or names; return kind and unit of the axis."""
    text = statement.value.strip().strip('"')
    if meaning == "unit":
        bare = _IN_BRACKETS.sub(r"\g<unit>", text)
        ratio = "/" in found.unit and kind_of_unit(found.unit.rpartition("/")[2]) == "force"
        found.unit = found.unit if ratio else bare
    elif meaning in ("place", "reference") and len(text) <= _MAX_CHARACTERS_OF_KEY:
        found.label, found.reference = (text, found.reference) if meaning == "place" else (found.label, text)
    elif meaning == "form":
        found.complex_values |= text.lower().startswith(_COMPLEX)
    elif meaning == "axis unit" and kind_of_unit(text) in ("frequency", "time"):
        return kind_of_unit(text), text
    return axis


def _others(statement: Statement) -> list[float]:
    """Return the further numbers of a statement, one per channel, that differ from its first."""
    numbers = [float(word.replace(",", ".")) for word in takewhile(_BARE.match, statement.value.split())]
    return [number for number in numbers[1:] if number != numbers[0]]


def _quantity(statement: Statement, meaning: str, decimal: str) -> tuple[float | None, str]:
    """Return number and unit of a statement; None where it has none."""
    name, unit = split_head(statement.key)
    match = _QUANTITY.match(statement.value)
    if match is None:
        return None, ""
    words = words_of(name)
    if not unit and len(words) > 1 and kind_of_unit(words[-1]) in ("time", "frequency") and words[-1] != "min":
        unit = words[-1]
    unit = plain_unit(match["unit"] or unit)
    text = match["number"]
    if meaning == "rate" and factor_to_base(unit) == 1:
        # a thousand samples a second are likelier than one; of kHz and of steps it is not so
        text = _ungrouped(text, match["sign"] or "", decimal)
    try:
        return float(text.replace(",", ".") if "," in text else text), unit
    except ValueError:
        return None, unit


def _ungrouped(text: str, sign: str, decimal: str) -> str:
    """Return a number without what parts its thousands.

    `sign`: what stands before groups of three digits. It parts thousands where it is not the decimal sign of the table, stands twice, or
    another sign follows it.

    Examples
    --------
    >>> _ungrouped("1,024", ",", "."), _ungrouped("1.024", ".", "."), _ungrouped("1,024.5", ",", ",")
    ('1024', '1.024', '1024.5')
    """
    grouped = sign != decimal or text.count(sign) > 1 or bool((set(".,'") - {sign}) & set(text))
    return text.replace(sign, "") if sign and grouped else text


def steps_of(columns: Iterable[np.ndarray]) -> list[float]:
    """Return the usual steps of columns that rise."""
    steps = []
    for values in columns:
        if values.dtype.kind in "biuf" and len(values) > 2:
            with np.errstate(all="ignore"):
                differences = np.diff(values.astype(float))
            differences = differences[np.isfinite(differences)]  # channels may end early
            steps += [step] if differences.size and (step := float(np.median(differences))) > 0 else []
    return steps
