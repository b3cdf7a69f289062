"""Turn data of any kind into a response, once for all rows: in a band, without excluded channels, exchanged by reciprocity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import singledispatch
from typing import Any, NamedTuple

from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.responses import ImpulseResponse
from modalscope.data.setups import as_test
from modalscope.identification import prepare
from modalscope.identification.options import ROUTES, reciprocity_of
from modalscope.identification.prepare import Measured
from modalscope.numerics.checks import check_band, check_count, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.handed import handed
from modalscope.signals.doctor.reciprocity import by_reciprocity
from modalscope.signals.preprocess.bands import driven_lines
from modalscope.signals.preprocess.conditioning import slower_correlation


def measure(
    data: Any,
    band: Any = None,
    exclude: Any = None,
    route: str | None = None,
    *,
    method: str | None = None,
    domain: str | None = None,
    delays: Mapping[str, int] | None = None,
    reciprocal: bool | None = None,
) -> Measured:
    """Return the response of the data in a band (Hz) without the excluded channels; records become responses here.

    `route`: from records with inputs, see `modalscope.identification.routes`; the automatic one serves `method` and `domain`. `delays`:
    samples by which outputs are late, see `modalscope.signals.doctor.delays`. `reciprocal`: see `modalscope.signals.doctor.reciprocity`.
    """
    checked = None if band is None else check_band(band)
    asked = "auto" if route is None else check_choice("route", route, ROUTES)
    test = as_test(data) if isinstance(data, list | tuple) else data
    rate = getattr(getattr(test, "record", test), "sampling_rate", None)
    if checked is not None and rate is not None and checked[0] >= rate / 2:
        asked_for, have = f"the band {checked[0]:g} to {checked[1]:g} Hz:", f"they are sampled at {rate:g} Hz"
        raise DataError(asked_for, f"{have}: nothing lies above {rate / 2:g} Hz", "Choose a band below.")
    late = None if delays is None else delays_of(delays)
    sides = None if reciprocal is None else reciprocity_of(reciprocal)
    given = Asked(exclude, asked, method, domain, late, sides)
    become: Callable[..., Measured] = of_response if isinstance(test, Response) else handed("of_records")
    measured = become(test, checked, given)
    taken = "correlation" if measured.response.ambient else measured.route
    if asked not in ("auto", taken) or (delays and measured.delays is None):
        what = f"delays={delays!r}" if asked in ("auto", taken) else f"route={asked!r}"
        ways = {"correlation": ("without inputs", "Omit it, or leave the columns of the inputs out.")}
        needed, remedy = ways.get(asked, ("with inputs", "Omit it."))
        raise DataError(f"{what}:", f"the data are {measured.given}, not records {needed}", remedy)
    if reciprocal and not measured.response.exchanged:
        have = f"the data are {measured.given}, not responses to single forces"
        raise DataError("reciprocal=True:", have, "Omit it, or estimate frequency responses: route='frf'.")
    return replace(measured, band=measured.band if checked is None else checked, exclude=exclude)


def delays_of(delays: Any) -> dict[str, int]:
    """Return delays by label as whole numbers."""
    check_kind("delays", delays, Mapping)
    return {str(dof): check_count(f"the delay of {dof}", samples, least=0) for dof, samples in delays.items()}


class Asked(NamedTuple):
    """Channels to leave out, arguments that decide the route from records with inputs, and which side of a response is which."""

    exclude: Any
    route: str
    method: str | None
    domain: str | None
    delays: Mapping[str, int] | None
    reciprocal: bool | None


def of_response(data: Response, band: tuple[float, float] | None, asked: Asked) -> Measured:
    """Return a response in a band, by default where its forces drive it, with inputs and outputs exchanged where that helps."""
    kept = data if asked.exclude is None else data.select(exclude=asked.exclude)
    taken, chosen, notes = _in_band(kept, band)
    found = prepare.of_response(taken, chosen)
    return exchanged(replace(found, given=type(data).__name__, notes=notes), asked)


@singledispatch
def _in_band(
    data: Response, band: tuple[float, float] | None
) -> tuple[Response, tuple[float, float] | None, tuple[Note, ...]]:
    """Return a response, the band to take of it, and notes on that."""
    return (data, *(driven_lines(data) if band is None else (band, ())))


@_in_band.register
def _(
    data: ImpulseResponse, band: tuple[float, float] | None
) -> tuple[Response, tuple[float, float] | None, tuple[Note, ...]]:
    return data if band is None else slower_correlation(data, band[1]), None, ()


def exchanged(measured: Measured, asked: Asked) -> Measured:
    """Return a response to forces, each by itself, with inputs and outputs exchanged where that was asked or helps."""
    response, notes = by_reciprocity(measured.response, asked.reciprocal)
    reciprocal = True if response.exchanged else asked.reciprocal
    return replace(measured, response=response, reciprocal=reciprocal, notes=(*measured.notes, *notes))
