"""From data of any kind to the problem that a row of the table solves: records become responses once, for all rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import singledispatch
from typing import Any

import numpy as np

from modalscope.identification.method import Method, Problem, Takes
from modalscope.identification.options import AllOptions, Options
from modalscope.identification.table import find_method, methods
from modalscope.model.checks import DataError, check_band, check_choice, check_kind, check_size
from modalscope.model.errors import check_option_names
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.notes import Note
from modalscope.model.response import Response
from modalscope.model.signals import Signals

__all__ = ["Data", "Measured", "measure", "pose", "prepare"]

Data = Signals | Response


@dataclass(frozen=True, eq=False, slots=True)
class Measured:
    """What all rows share: the response in the band, the records behind correlations, and what was done.

    Parameters
    ----------
    response : Response
    records : Signals, optional
        Records without inputs, filtered to the band.
    given : str
        What it was made of, in words.
    row : str
        The row that is taken when none is asked.
    band : (float, float), optional
        As asked, Hz.
    exclude : object
        Channels left out, as asked.
    notes : tuple of Note
    """

    response: Response
    records: Signals | None
    given: str
    row: str
    band: tuple[float, float] | None = None
    exclude: Any = None
    notes: tuple[Note, ...] = ()


def prepare(data: Any, method: str | None = None, domain: str | None = None, **options: Any) -> Problem:
    """Return the problem of one row of the table on the data.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
    method, domain : str, optional
        A row, or a name from the literature, and a column; by default what suits the data.
    **options
        Those of `identify`.

    Raises
    ------
    DataError
        A channel of zeros, a band without lines, an unknown method, domain or option, a method that cannot take the data.
    """
    measured = measure(data, options.pop("band", None), options.pop("exclude", None))
    name = measured.row if method is None else method
    return pose(measured, find_method(name, domain, _usual_domain(measured.response)), options)


def measure(data: Any, band: Any = None, exclude: Any = None) -> Measured:
    """Return the response of the data in a band, without the channels that are excluded; records are turned into responses here.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
    band : (float, float), optional
        Hz.
    exclude : labels, optional
    """
    checked = None if band is None else check_band(band)
    found = _measured(data if exclude is None or not hasattr(data, "select") else data.select(exclude=exclude), checked)
    return replace(found, band=checked, exclude=exclude)


@singledispatch
def _measured(data: Any, band: tuple[float, float] | None) -> Measured:
    check_kind("data", data, (FrequencyResponse, ImpulseResponse, Signals))
    raise AssertionError("one of these has no way to a response")


@_measured.register
def _(data: Response, band: tuple[float, float] | None) -> Measured:
    check_size("responses", np.swapaxes(data.values, 1, 2), data.output_dofs)
    return Measured(data.in_band(band), None, type(data).__name__, _USUAL.get(data.origin, "era"))


@_measured.register
def _(data: Signals, band: tuple[float, float] | None) -> Measured:
    from modalscope.preprocess import estimate_correlation, estimate_frf, filter_band

    check_size("records", data.outputs, data.output_dofs)
    if data.inputs is not None:
        check_size("records", data.inputs, data.input_dofs)
        note = Note("estimated", {}, "frequency responses were estimated from the records (H1)")
        return Measured(estimate_frf(data).in_band(band), None, "records with inputs", _USUAL["lines"], notes=(note,))
    records = data if band is None else filter_band(data, *band)
    note = Note("estimated", {}, "correlations with all channels as references were estimated from the records")
    return Measured(estimate_correlation(records), records, "records without inputs", "alternate", notes=(note,))


#: The row that is taken when none is asked, by where the response came from; impulse responses "era".
_USUAL = {"lines": "alternate"}


def pose(measured: Measured, row: Method, options: Mapping[str, Any]) -> Problem:
    """Return the problem of one row on what was measured.

    Parameters
    ----------
    measured : Measured
    row : Method
    options : mapping
        Without band and excluded channels, which were applied.
    """
    response = measured.response
    refusal = row.refusal(response, measured.records is not None)
    if refusal:
        raise DataError(
            f"method {row.name!r} in domain {row.domain!r} was asked",
            f"{refusal.reason}: this is {measured.given}",
            refusal.change,
        )
    _check_form(row, options.get("form"))
    chosen = _options_of(row, {"band": measured.band, "exclude": measured.exclude, **options})
    converted, note = _HAND_OVER[row.takes](response)
    if note and measured.band is not None:
        converted = converted.in_band(measured.band)
    _check_channels(converted)
    return Problem(
        method=row,
        response=converted,
        measured=response,
        records=measured.records,
        options=chosen,
        notes=(*measured.notes, *([Note("transformed", {}, note)] if note else [])),
    )


#: What each kind of row is given.
_HAND_OVER: dict[Takes, Any] = {
    Takes.SAMPLES: lambda response: response.as_samples(),
    Takes.LINES: lambda response: response.as_lines(),
    Takes.CONTINUOUS: lambda response: response.as_lines(),
    Takes.RESPONSE: lambda response: (response, ""),
    Takes.PAST: lambda response: response.as_samples(),
}


def _usual_domain(response: Response) -> str:
    if response.origin != "lines":
        return "time"
    return "z" if response.held_input else "s"


def _options_of(row: Method, given: Mapping[str, Any]) -> Options:
    """Return the row's own options; what it has no use for is refused, with the rows that have it."""
    own = {f.name for f in fields(row.options_type)}
    asked = {name: value for name, value in {**row.fixed, **given}.items() if value is not None}
    check_option_names(str(row), asked, AllOptions.__annotations__)
    for name in asked:
        if name not in own:
            having = dict.fromkeys(str(m) for m in methods() if name in {f.name for f in fields(m.options_type)})
            raise DataError(
                f"option {name!r} was asked of method {row}",
                row.options_type.why_not,
                f"Leave it out, or choose one of the methods that have it: {', '.join(having)}.",
            )
    return row.options_type(**asked)


def _check_form(row: Method, form: str | None) -> None:
    if form is None:
        return
    check_choice("form", form, ("observable", "controllable", "smaller"))
    allowed = (*row.forms, "smaller") if len(row.forms) > 1 else row.forms
    if form not in allowed:
        raise DataError(
            f"form={form!r} of method {row.name!r} in domain {row.domain!r} was asked",
            f"it has only {' and '.join(allowed)}: its columns are lines or times, in which the state matrix does not appear as B, AB, ...",
            f"Use form={allowed[0]!r}, or a method in the time domain.",
        )


def _check_channels(response: Response) -> None:
    """Raise on a channel of zeros: nothing can be read off it, and it hides a wrong cable or a wrong column."""
    for side, axes, labels in (("output", (0, 2), response.output_dofs), ("input", (0, 1), response.input_dofs)):
        dead = [labels[i] for i in np.flatnonzero(~np.any(response.values, axis=axes))]
        if dead:
            raise DataError(
                f"data with a response in every {side} were asked",
                f"{side} {', '.join(dead)} is zero throughout",
                f"Leave it out: exclude={dead!r}, or --exclude {' '.join(dead)}.",
            )
