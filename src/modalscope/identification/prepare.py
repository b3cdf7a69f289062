"""Prepare a response for a method: take its band, and check options against its row; records become responses before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.sizes import check_alive, check_size
from modalscope.data.stored import StoredSignals
from modalscope.data.whitening import Whitening
from modalscope.identification.method import Method, Problem, Takes
from modalscope.identification.options import AllOptions, Options
from modalscope.identification.table import find_method, rows_with
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_band
from modalscope.numerics.errors import DataError, check_choice, check_option_names
from modalscope.numerics.handed import handed, replaceable


@dataclass(frozen=True, eq=False, slots=True)
class Measured:
    """The response in the band and the records behind it, which all rows share.

    `records`: without inputs, filtered to the band. `driven`: with inputs, without delays. `given`: the kind of data in words. `row`,
    `domain`: defaults for these data. `band`: Hz, as asked or automatic. `route`: from records with inputs. `delays`: samples by output.
    `reciprocal`: whether inputs and outputs were exchanged; None where nobody asked and they were not.
    `sizes`: default block sizes of the response. `whitening`: of ambient channels.
    """

    response: Response
    records: Signals | StoredSignals | None
    given: str
    row: str
    domain: str
    band: tuple[float, float] | None = None
    exclude: Any = None
    route: str | None = None
    driven: Records | None = None
    delays: Mapping[str, int] | None = None
    reciprocal: bool | None = None
    notes: tuple[Note, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)
    whitening: Whitening | None = None

    @property
    def held(self) -> Signals | None:
        """The records, where they are in memory."""
        return self.records if isinstance(self.records, Signals) else None


@named(AllOptions.__annotations__)
def prepare(data: Any, method: str | None = None, domain: str | None = None, **options: Any) -> Problem:
    """Pose data as the problem of one row of the table of methods.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse, Signals, Records or a list of records
    method, domain : str, optional
        A cell of the table of methods, see `identify`; by default what suits the data.
    **options
        Band, channels, block sizes and the rest, as in `identify`.

    Returns
    -------
    Problem
        With `method` (the row), `response` (as the row takes it, in the band) and `options`; `factor` takes it.

    Raises
    ------
    DataError
        A channel of zeros, a band without lines, an unknown method, domain or option, data that the method cannot take.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> problem = prepare(chain5().impulse_response(200), method="era")
    >>> problem.method.name, problem.response.values.shape
    ('era', (200, 4, 2))
    """
    band, exclude = options.pop("band", None), options.pop("exclude", None)
    asked = {name: options.pop(name, None) for name in ("route", "delays", "reciprocal")}
    measured = measure(data, band, exclude, method=method, domain=domain, **asked)
    name = measured.row if method is None else method
    return pose(measured, find_method(name, domain, measured.domain, measured.route), options)


@replaceable("measure")
def measure(data: Any, band: Any = None, exclude: Any = None, route: str | None = None, **asked: Any) -> Measured:
    """Return the response of the data in a band (Hz) without the excluded channels.

    What records become, and what else is done to responses, is in `modalscope.identification.measure`.
    """
    return of_response(data, None if band is None else check_band(band), exclude)


#: Default row and domain by the origin of a response and whether its input was held; impulse responses "era", time.
_USUAL = {("lines", False): ("alternate", "s"), ("lines", True): ("alternate", "z")}


def of_response(data: Response, band: tuple[float, float] | None, exclude: Any = None) -> Measured:
    """Return a response in a band, with the row and the domain that suit it."""
    data = data if exclude is None else data.select(exclude=exclude)
    check_size(data)
    row, domain = _USUAL.get((data.origin, data.held_input), ("era", "time"))
    return Measured(data.in_band(band), None, type(data).__name__, row, domain, band, exclude)


def pose(measured: Measured, row: Method, options: Mapping[str, Any]) -> Problem:
    """Return the problem of one row on a measured response.

    `options`: without band and excluded channels, which are applied already.
    """
    response = measured.response
    check_suits(row, measured)
    _check_form(row, options.get("form"))
    names = {f.name for f in fields(row.options_type)}
    # beside a size that is given, or fixed by the row, the other one follows from it
    given = {*row.fixed, *(name for name, value in options.items() if value is not None)}
    sizes = {} if given & set(measured.sizes) else {name: n for name, n in measured.sizes.items() if name in names}
    shared = {name: getattr(measured, name) for name in ("band", "exclude", "route", "delays", "reciprocal")}
    chosen = _options_of(row, {**shared, **options, **sizes})
    converted, note = _CONVERTED[row.takes](response) if row.takes in _CONVERTED else (response, "")
    # a correlation keeps all lines: its rate suits the band, and lines all around the circle determine powers of z
    if note and measured.band is not None and not response.ambient:
        converted = converted.in_band(measured.band)
    check_alive(converted)
    return Problem(
        method=row,
        response=converted,
        measured=response,
        records=measured.records,
        driven=measured.driven,
        whitening=None if measured.whitening is None else handed("whitening_of_row")(measured, row, chosen),
        options=chosen,
        notes=(
            *measured.notes,
            *([Note("transformed", {}, note)] if note else []),
            *(_unfiltered(measured, row, converted)),
        ),
    )


def _unfiltered(measured: Measured, row: Method, response: Response) -> tuple[Note, ...]:
    """Return a note where a band does not change the data of a row: measured samples are not filtered."""
    if measured.band is None or measured.records is not None or response is not measured.response or not row.of_samples:
        return ()
    low, high = measured.band
    inside = f"the diagram those of {low:g} to {high:g} Hz"
    text = f"Samples are not filtered: the model has all modes, {inside}"
    if any("low-pass filtered" in step for step in response.processing):
        text = f"Samples are only low-pass filtered: the model has modes below the band, too, {inside}"
    return (Note("not filtered", {"lowest": low, "highest": high}, text),)


def _options_of(row: Method, given: Mapping[str, Any]) -> Options:
    """Return the options of a row; others are refused with the rows that have them. None stands for an option that is not given."""
    chosen = {name: value for name, value in given.items() if value is not None}
    for name, value in row.fixed.items():
        if chosen.get(name, value) != value:
            raise DataError(
                f"{row} fixes {name}={value!r}",
                f"{name}={chosen[name]!r} was given",
                "Omit the option, or choose another method.",
            )
    asked = {**row.fixed, **chosen}
    check_option_names(str(row), asked, AllOptions.__annotations__)
    for name in asked:
        if name not in {f.name for f in fields(row.options_type)}:
            raise DataError(
                f"option {name!r} of method {row}:",
                row.options_type.why_not,
                f"Omit it, or choose one of the methods that have it: {', '.join(dict.fromkeys(rows_with(name)))}.",
            )
    return row.options_type(**asked)


def _check_form(row: Method, form: str | None) -> None:
    """Raise `DataError` for a form that a row does not have."""
    if form is None:
        return
    check_choice("form", form, ("observable", "controllable", "smaller"))
    allowed = (*row.forms, "smaller") if len(row.forms) > 1 else row.forms
    if form not in allowed:
        raise DataError(
            f"form={form!r} of method {row.name!r} in domain {row.domain!r}:",
            f"it has only {' and '.join(allowed)}: its columns are not B, AB, ...",
            f"Use form={allowed[0]!r}, or a method in the time domain.",
        )


@replaceable("check_suits")
def check_suits(row: Method, measured: Measured) -> None:
    """Raise `DataError` where the data do not suit a row; what the rows of the report do not take, their data matrices refuse."""


#: Conversion of a response for the rows that do not accept any.
_CONVERTED: dict[Takes, Any] = {
    Takes.SAMPLES: lambda response: response.as_samples(),
    Takes.LINES: lambda response: response.as_lines(),
    Takes.CONTINUOUS: lambda response: response.as_lines(),
    Takes.PAST: lambda response: response.as_samples(),
}
