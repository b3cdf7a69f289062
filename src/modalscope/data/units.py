"""Convert the units of channels to SI.

Units are compared after `plain_unit`, so that `m/s²`, `m/s^2` and `[m / s2]` are one unit. The foot, the pound, the standard acceleration
and what follows from them are exact by definition (NIST Special Publication 811, 2008, appendix B).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple, Protocol, Self, TypeVar, runtime_checkable

import numpy as np

from modalscope.data.channels import Channels
from modalscope.data.notes import Note
from modalscope.data.shown import list_some
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import QUANTITIES

_FOOT, _INCH, _GRAVITY, _POUND = 0.3048, 0.0254, 9.80665, 0.45359237
_POUND_FORCE = _POUND * _GRAVITY

#: What is measured -> its unit in SI, and how many of these one of each unit is.
FACTORS: dict[str, tuple[str, dict[str, float]]] = {
    "acceleration": (
        "m/s2",
        {
            **dict.fromkeys(("m/s2", "m/s/s", "m/sec2", "ms-2", "ms2", "m*s-2"), 1.0),
            **dict.fromkeys(("g", "G", "gn", "g0"), _GRAVITY),
            "mg": 1e-3 * _GRAVITY, "ug": 1e-6 * _GRAVITY, "mm/s2": 1e-3, "cm/s2": 1e-2, "um/s2": 1e-6,
            "gal": 1e-2, "Gal": 1e-2, "mGal": 1e-5, "ft/s2": _FOOT, "in/s2": _INCH,
        },
    ),
    "velocity": (
        "m/s",
        {
            **dict.fromkeys(("m/s", "m/sec", "m*s-1", "ms-1"), 1.0),
            "mm/s": 1e-3, "cm/s": 1e-2, "um/s": 1e-6, "nm/s": 1e-9, "in/s": _INCH, "ips": _INCH, "ft/s": _FOOT, "km/h": 1 / 3.6,
        },
    ),
    "displacement": (
        "m",
        {
            "m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6, "nm": 1e-9, "micron": 1e-6, "in": _INCH, "inch": _INCH, "inches": _INCH,
            "mil": 1e-3 * _INCH, "mils": 1e-3 * _INCH, "ft": _FOOT,
        },
    ),
    "force": (
        "N",
        {
            **dict.fromkeys(("N", "newton", "Newton"), 1.0),
            **dict.fromkeys(("lbf", "lb", "lbs"), _POUND_FORCE),
            **dict.fromkeys(("kgf", "kp"), _GRAVITY),
            "kN": 1e3, "MN": 1e6, "mN": 1e-3, "dyn": 1e-5, "kip": 1e3 * _POUND_FORCE, "ozf": _POUND_FORCE / 16,
        },
    ),
    "moment": ("N*m", {"Nm": 1.0, "N*m": 1.0, "kNm": 1e3, "lbf*in": _POUND_FORCE * _INCH, "lbf*ft": _POUND_FORCE * _FOOT}),
    "strain": (
        "m/m",
        {
            **dict.fromkeys(("m/m", "strain"), 1.0),
            **dict.fromkeys(("um/m", "ustrain", "ue", "microstrain", "uepsilon", "ueps"), 1e-6),
            "mm/m": 1e-3,
        },
    ),
    "pressure": (
        "Pa",
        {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "mPa": 1e-3, "hPa": 1e2, "bar": 1e5, "mbar": 1e2, "psi": _POUND_FORCE / _INCH**2},
    ),
    "angle": (
        "rad",
        {"rad": 1.0, "mrad": 1e-3, "grad": 0.015707963267948967, **dict.fromkeys(("deg", "degree", "degrees"), 0.017453292519943295)},
    ),
    "voltage": ("V", {**dict.fromkeys(("V", "volt", "volts", "Volt", "Volts"), 1.0), "mV": 1e-3, "uV": 1e-6, "kV": 1e3}),
}  # fmt: skip

_UNITS = {unit: (kind, si, factor) for kind, (si, units) in FACTORS.items() for unit, factor in units.items()}

#: Maximum number of characters of a unit that are read.
_MAX_UNIT_LENGTH = 400

#: Signs of one meaning, and (last) signs that say nothing.
_SIGNS = str.maketrans("²³⁻¹µμ·⋅×", "23-1uu***", "^ ")

_BRACKETS = ("[]", "()", "<>", "{}")

#: A sensitivity, such as 100 mV/g: the channel is in mV, of which so many are one g.
_SENSITIVITY = re.compile(r"^(?P<number>\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+)(?P<signal>mV|V|uV|pC)/(?P<unit>.+)$")


class InSi(NamedTuple):
    """What one of a unit is in SI.

    Attributes
    ----------
    factor : float
        So many of the unit in SI.
    unit : str
        In SI.
    kind : str
        What it measures; empty for a ratio.
    """

    factor: float
    unit: str
    kind: str


def unbracketed(text: str) -> str:
    """Return a text without blanks and brackets around all of it.

    Examples
    --------
    >>> unbracketed("[m/s^2]"), unbracketed("((m/s2)/N)"), unbracketed("(m/s2)/(N)")
    ('m/s^2', '(m/s2)/N', '(m/s2)/(N)')
    """
    text = text.strip()
    # what the first opens is not closed before another opens
    while text[:1] + text[-1:] in _BRACKETS and text.find(text[0], 1, -1) <= text.find(text[-1], 1, -1):
        text = text[1:-1].strip()
    return text


def plain_unit(unit: str) -> str:
    """Return a unit without blanks, brackets, signs of powers and capitals of dB.

    Examples
    --------
    >>> plain_unit("m / s²"), plain_unit("[m/s^2]"), plain_unit("(m/s²)/(N)"), plain_unit("°")
    ('m/s2', 'm/s2', 'm/s2/N', 'deg')
    """
    signs = unit.strip()[:_MAX_UNIT_LENGTH].replace("**", "").translate(_SIGNS)
    text = unbracketed(signs.replace("°", "deg").replace("ε", "epsilon"))
    return re.sub(r"\(([^()]*)\)", r"\1", text) if text.count("/") < 3 else text


@cache
def in_si(unit: str) -> InSi | None:
    """Return what one of a unit is in SI: of a known unit, a ratio of two, or a sensitivity; None where it is not known.

    A sensitivity such as `100 mV/g` says that the channel is in mV, and that 100 of them are one g.

    Examples
    --------
    >>> in_si("g"), in_si("100 mV/g").factor, in_si("m/s^2/lbf").unit, in_si("furlong")
    (InSi(factor=9.80665, unit='m/s2', kind='acceleration'), 0.0980665, 'm/s2/N', None)
    """
    plain = plain_unit(unit)
    if plain in _UNITS:
        kind, si, factor = _UNITS[plain]
        return InSi(factor, si, kind)
    given = _SENSITIVITY.match(plain)
    if given and float(given["number"]) > 0:
        measured = in_si(given["unit"])
        return None if measured is None else measured._replace(factor=measured.factor / float(given["number"]))
    above, slash, below = plain.rpartition("/")
    parts = (in_si(above), in_si(below)) if slash else (None, None)
    if parts[0] is None or parts[1] is None:
        return None
    return InSi(parts[0].factor / parts[1].factor, f"{parts[0].unit}/{parts[1].unit}", "")


def sides_of(unit: str) -> tuple[str, str]:
    """Return the units of output and input in that of a response; of what is no known ratio all is the output's.

    Examples
    --------
    >>> sides_of("(m/s^2)/N"), sides_of("g/lbf"), sides_of("mm/s"), sides_of("100 mV/g")
    (('m/s^2', 'N'), ('g', 'lbf'), ('mm/s', ''), ('100 mV/g', ''))
    """
    si = in_si(unit)
    above, _, below = unbracketed(unit).rpartition("/")
    return (unit, "") if si is None or si.kind else (unbracketed(above), unbracketed(below))


Data = TypeVar("Data")

#: Words for no unit.
_NO_UNIT = ("", "-", "1", "none", "n/a")


@runtime_checkable
class InParts(Protocol):
    """A test of several runs or setups, each of which has units of its own."""

    def _mapped(self, each: Callable[[Any], Any]) -> Self: ...


@runtime_checkable
class Scalable(Protocol):
    """Data that multiply their channels by factors, and take the quantity that their units say."""

    def _scaled(self, outputs: RealArray, inputs: RealArray) -> dict[str, Any]: ...

    def _quantity_of(self, kinds: Sequence[str | None]) -> dict[str, Any]: ...


def si_form(data: Data) -> tuple[Data, tuple[Note, ...]]:
    """Return data in SI, and what was converted and what was not; other objects are returned as they are."""
    if isinstance(data, InParts):
        told: dict[Note, None] = {}

        def converted(part: Data) -> Data:
            form, notes = si_form(part)
            told.update(dict.fromkeys(notes))
            return form

        return data._mapped(converted), tuple(told)
    if not (isinstance(data, Scalable) and isinstance(data, Channels)):
        return data, ()
    sides = tuple(_side(units) for units in data.units)
    notes = _notes(data)
    if all(
        f == 1 and new == old
        for side, units in zip(sides, data.units, strict=True)
        for (f, new), old in zip(side, units, strict=True)
    ):
        return data, tuple(note for note in notes if note.kind != "units")
    outputs, inputs = (np.array([factor for factor, _ in side]) for side in sides)
    units = (tuple(unit for _, unit in sides[0]), tuple(unit for _, unit in sides[1]))
    kinds = [motion_of(unit) for unit in data.units[0]]
    changed: Any = replace(data, **data._scaled(outputs, inputs), units=units, **data._quantity_of(kinds))
    return changed.processed(str(notes[0])), notes


def _side(units: Sequence[str]) -> list[tuple[float, str]]:
    """Return factor and unit of every channel of one side; a unit that is written otherwise than in SI is no other unit."""
    found: list[tuple[InSi | None, str]] = [(in_si(unit), unit) for unit in units]
    return [(1.0, unit) if si is None else (si.factor, unit if si.factor == 1 else si.unit) for si, unit in found]


def _notes(data: Channels) -> tuple[Note, ...]:
    turned: dict[str, list[str]] = {}
    unknown: dict[str, list[str]] = {}
    for units, dofs in zip(data.units, (data.output_dofs, data.input_dofs), strict=True):
        for unit, dof in zip(units, dofs, strict=True):
            si = in_si(unit)
            if si is None and unit.strip() not in _NO_UNIT:
                unknown.setdefault(unit, []).append(dof)
            elif si is not None and si.factor != 1:
                turned.setdefault(f"{unit} to {si.unit} (times {si.factor:.7g})", []).append(dof)
    notes = []
    if turned:
        words = "; ".join(f"{list_some(dofs)} from {how}" for how, dofs in turned.items())
        notes.append(Note("units", {}, f"converted to SI: {words}"))
    for unit, channels in unknown.items():
        text = (
            f"the unit {unit} of {list_some(channels)} is not known: values stay in it, and modal masses are not in kg"
        )
        notes.append(Note("units not known", {}, text))
    moved = {dof: kind for dof, unit in zip(data.input_dofs, data.units[1], strict=True) if (kind := motion_of(unit))}
    if moved:
        plain = "dimensionless " * ({motion_of(unit) for unit in data.units[0]} == set(moved.values()))
        inputs = list_some(tuple(moved))
        named = f"Inputs {inputs} are motions" if len(moved) > 1 else f"Input {inputs} is a motion"
        text = f"{named}: responses are {plain}transmissibilities, and their poles those of the structure held at that point"
        notes.append(Note("motion", {"inputs": len(moved)}, text))
    return tuple(notes)


def motion_of(unit: str) -> str | None:
    """Return the quantity of a unit that is that of a motion."""
    si = in_si(unit)
    return si.kind if si is not None and si.kind in QUANTITIES else None


class Convertible:
    """Data whose channels have units."""

    __slots__ = ()

    def in_si(self) -> Self:
        """Return the same data in SI units: g, lbf, inches or a sensitivity such as 100 mV/g are converted; units not known stay."""
        return si_form(self)[0]
