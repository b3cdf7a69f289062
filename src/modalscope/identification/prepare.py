"""Prepare data for a method: records become responses, and options are checked against the row of the table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import singledispatch
from typing import Any, NamedTuple

from modalscope.blocks.combinations import combined
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups, as_test
from modalscope.data.sizes import check_alive, check_size
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.data.whitening import Whitening
from modalscope.identification.method import Method, Problem, Takes
from modalscope.identification.options import ROUTES, AllOptions, delays_of
from modalscope.identification.routes import (
    USUAL,
    Conditioned,
    SeenRecord,
    by_route,
    chosen_route,
    conditioned,
    conditioned_setups,
    one_record,
    seen_record,
    without_delays,
)
from modalscope.identification.sizes import setup_blocks
from modalscope.identification.table import check_form, find_method, options_of
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_band, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.preprocess.conditioning import slower_correlation
from modalscope.preprocess.correlation import estimate_correlation, spanning_outputs
from modalscope.preprocess.setups import joined_setups
from modalscope.preprocess.spectral_peaks import whitening_of

# ------------------------------------------------------------------------------------------------------------ measured


@dataclass(frozen=True, eq=False, slots=True)
class Measured:
    """The response in the band and the records behind it, which all rows share.

    `records`: without inputs, filtered to the band. `driven`: with inputs, without delays. `given`: the kind of data in words. `row`,
    `domain`: defaults for these data. `band`: Hz, as asked or automatic. `route`: from records with inputs. `delays`: samples by output.
    `sizes`: default block sizes that suit the response. `whitening`: of ambient channels.
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
    notes: tuple[Note, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)
    whitening: Whitening | None = None

    @property
    def held(self) -> Signals | None:
        """The records, where they are in memory."""
        return self.records if isinstance(self.records, Signals) else None


# ------------------------------------------------------------------------------------------------------------- prepare

Data = Signals | Records | Setups | Response


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
    ('era', (200, 5, 5))
    """
    band, exclude = options.pop("band", None), options.pop("exclude", None)
    route, delays = options.pop("route", None), options.pop("delays", None)
    measured = measure(data, band, exclude, route, method=method, domain=domain, delays=delays)
    name = measured.row if method is None else method
    return pose(measured, find_method(name, domain, measured.domain, measured.route), options)


def measure(
    data: Any,
    band: Any = None,
    exclude: Any = None,
    route: str | None = None,
    *,
    method: str | None = None,
    domain: str | None = None,
    delays: Mapping[str, int] | None = None,
) -> Measured:
    """Return the response of the data in a band (Hz) without the excluded channels; records are turned into responses here.

    `route`: from records with inputs, see `modalscope.identification.routes`; an automatic one serves `method` and `domain`. `delays`:
    samples by which outputs come late, see `modalscope.doctor.delays`.
    """
    checked = None if band is None else check_band(band)
    asked = "auto" if route is None else check_choice("route", route, ROUTES)
    test = as_test(data) if isinstance(data, list | tuple) else data
    test = test if exclude is None or not hasattr(test, "select") else test.select(exclude=exclude)
    found = _measured(test, checked, _Asked(asked, method, domain, None if delays is None else delays_of(delays)))
    if asked not in ("auto", found.route) or (delays and found.route is None):
        what = f"delays={delays!r}" if asked in ("auto", found.route) else f"route={asked!r}"
        raise DataError(f"{what} was asked", f"the data are {found.given}, not records with inputs", "Leave it out.")
    return replace(found, band=found.band if checked is None else checked, exclude=exclude)


class _Asked(NamedTuple):
    """What decides the way from records with inputs."""

    route: str
    method: str | None
    domain: str | None
    delays: Mapping[str, int] | None


@singledispatch
def _measured(data: Any, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    check_kind(
        "data", data, (FrequencyResponse, ImpulseResponse, Signals, StoredSignals, StoredResponse, Records, Setups)
    )
    raise AssertionError("one of these has no way to a response")


@_measured.register
def _(data: Response, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    check_size(data)
    return Measured(data.in_band(band), None, type(data).__name__, *_usual(data))


@_measured.register
def _(data: ImpulseResponse, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    check_size(data)
    slower = data if band is None else slower_correlation(data, band[1])
    return Measured(slower, None, type(data).__name__, *_usual(data))


def _usual(data: Response) -> tuple[str, str]:
    """Return the row and the domain by default."""
    return _USUAL.get((data.origin, data.held_input), ("era", "time"))


@_measured.register
def _(data: Signals, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    return _measured(as_records(data), band, asked)


@_measured.register
def _(data: Records, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    check_size(data)
    if data.input_dofs:
        route = chosen_route(data, asked.method, asked.domain, asked.route)
        taken, delays, notes = without_delays(data, asked.delays)
        way, (row, domain) = by_route(taken, route, band), USUAL[route]
        notes = (*notes, *way.notes)
        found = Measured(way.response, None, "records with inputs", row, domain, way.band, route=route, notes=notes)
        return replace(found, driven=taken, delays=delays)
    return _measured(seen_record(one_record(data, "correlations")), band, asked)


@_measured.register
def _(data: StoredSignals, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    return _measured(seen_record(data), band, asked)


@_measured.register
def _(data: SeenRecord, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    taken, seen = conditioned(data, band), data.excerpt
    if not isinstance(data.record, StoredSignals):
        return _ambient(taken, seen, "records without inputs")
    text = f"band and noise were judged on {seen.duration:.4g} s from the middle of {data.record.duration:.4g} s"
    excerpt = (Note("excerpt", {"seconds": seen.duration}, text),) if seen.samples < data.record.samples else ()
    inside = taken.records.settled() if isinstance(taken.records, StoredSignals) else taken.records
    return _ambient(
        taken._replace(records=inside, notes=(*excerpt, *taken.notes)), seen, "a stored record without inputs"
    )


def _ambient(taken: Conditioned, seen: Signals, given: str) -> Measured:
    """Return the correlations of records without inputs, with references chosen before any band, the same for all bands."""
    labels = taken.records.output_dofs
    references = spanning_outputs(seen)
    which = "all channels"
    if len(references) < len(labels):
        which = f"{len(references)} of {len(labels)} channels, which explain most of all others,"
    text = f"correlations with {which} as references were estimated from the records"
    note = Note("estimated", {"references": float(len(references))}, text)
    return Measured(
        estimate_correlation(taken.records, references=references),
        taken.records,
        given,
        "alternate",
        "time",
        band=taken.band,
        notes=(*taken.notes, note),
        whitening=whitening_of(taken.records.excerpt(), references, taken.band),
    )


@_measured.register
def _(data: StoredResponse, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    few, note = combined(data)
    found = _measured(few, band, asked)
    return replace(found, given="stored responses", notes=(note, *found.notes))


@_measured.register
def _(data: Setups, band: tuple[float, float] | None, asked: _Asked) -> Measured:
    check_size(data)
    taken = conditioned_setups(data, band)
    text = f"correlations of {len(data.parts)} setups were carried over to the references {', '.join(data.references)}"
    note = Note("estimated", {"setups": len(data.parts)}, text)
    response = joined_setups(taken.setups)
    return Measured(
        response,
        None,
        "ambient setups",
        "alternate",
        "time",
        band=taken.band,
        notes=(*taken.notes, note),
        sizes=setup_blocks(response, taken.lowest),
    )


#: Row and domain that are taken when none is asked, by where a response came from and whether its input was held; impulse responses
#: "era", time.
_USUAL = {("lines", False): ("alternate", "s"), ("lines", True): ("alternate", "z")}


def pose(measured: Measured, row: Method, options: Mapping[str, Any]) -> Problem:
    """Return the problem of one row on what was measured.

    `options`: without band and excluded channels, which were applied.
    """
    response = measured.response
    refusal = row.refusal(response, measured.held is not None)
    if refusal:
        raise DataError(
            f"method {row.name!r} in domain {row.domain!r} was asked",
            f"{refusal.reason}: this is {measured.given}",
            refusal.change,
        )
    check_form(row, options.get("form"))
    own = {f.name for f in fields(row.options_type)}
    suited = {name: size for name, size in measured.sizes.items() if name in own and options.get(name) is None}
    chosen = options_of(
        row,
        {
            "band": measured.band,
            "exclude": measured.exclude,
            "route": measured.route,
            "delays": measured.delays,
            **options,
            **suited,
        },
    )
    converted, note = _HAND_OVER[row.takes](response)
    # the lines of a correlation stay: its rate suits the band, and powers of z are told apart by lines all around the circle
    if note and measured.band is not None and not response.ambient:
        converted = converted.in_band(measured.band)
    check_alive(converted)
    return Problem(
        method=row,
        response=converted,
        measured=response,
        records=measured.records,
        driven=measured.driven,
        whitening=_of_row(measured, row, chosen),
        options=chosen,
        notes=(*measured.notes, *([Note("transformed", {}, note)] if note else [])),
    )


def _of_row(measured: Measured, row: Method, options: Any) -> Whitening | None:
    """Return the whitening of a row; none where single channels were asked of it, or rows of the record are the references' alone."""
    asked = [*getattr(options, "general", {}).values(), getattr(options, "initial_values", None)]
    whole = len(measured.response.input_dofs) == len(measured.response.output_dofs)
    if any(value is not None for value in asked) or (row.of_past and (not whole or options.references is not None)):
        return None
    return measured.whitening


#: What each kind of row is given.
_HAND_OVER: dict[Takes, Any] = {
    Takes.SAMPLES: lambda response: response.as_samples(),
    Takes.LINES: lambda response: response.as_lines(),
    Takes.CONTINUOUS: lambda response: response.as_lines(),
    Takes.RESPONSE: lambda response: (response, ""),
    Takes.PAST: lambda response: response.as_samples(),
    Takes.RECORDS: lambda response: (response, ""),
    Takes.DRIVEN: lambda response: (response, ""),
}
