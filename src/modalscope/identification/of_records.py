"""What records become: frequency responses, correlations, or records on their lines, in the band where they show modes."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any

from modalscope.data.channels import excluded_labels
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size, check_upright
from modalscope.data.stored import StoredResponse, StoredSignals
from modalscope.identification.fast.combinations import combined
from modalscope.identification.measure import Asked, exchanged, of_response
from modalscope.identification.prepare import Measured
from modalscope.identification.routes import USUAL, by_route, chosen_route, without_delays
from modalscope.identification.sizes import setup_blocks
from modalscope.numerics.checks import check_kind
from modalscope.signals.preprocess.ambient_records import (
    Conditioned,
    SeenRecord,
    conditioned,
    conditioned_setups,
    looked_through,
    seen_record,
)
from modalscope.signals.preprocess.correlation import estimate_correlation, spanning_outputs
from modalscope.signals.preprocess.excitation import still_there, without_dead_forces
from modalscope.signals.preprocess.setups import joined_setups
from modalscope.signals.preprocess.spectral_peaks import whitening_of


def of_records(data: Any, band: tuple[float, float] | None, asked: Asked) -> Measured:
    """Return the response that records, setups or what is stored become, without the excluded channels and dead forces."""
    test, left = _chosen(data, asked.exclude)
    measured = _of_records(test, band, asked)
    return replace(measured, notes=(*left, *measured.notes))


def _chosen(test: Any, exclude: Any) -> tuple[Any, tuple[Note, ...]]:
    """Return data without the excluded channels and without forces that never change, and a note on these."""
    left: tuple[Note, ...] = ()
    if isinstance(test, Signals | Records):
        out = excluded_labels(test.output_dofs, test.input_dofs, exclude)
        test, left = without_dead_forces(test)
        exclude = still_there(out, left) or None
    return test if exclude is None or not hasattr(test, "select") else test.select(exclude=exclude), left


@singledispatch
def _of_records(data: Any, band: tuple[float, float] | None, asked: Asked) -> Measured:
    check_kind(
        "data", data, (FrequencyResponse, ImpulseResponse, Signals, StoredSignals, StoredResponse, Records, Setups)
    )
    raise AssertionError("one of these has no route to a response")


@_of_records.register
def _(test: Signals | Records, band: tuple[float, float] | None, asked: Asked) -> Measured:
    data = as_records(test)
    check_size(data)
    check_upright(data)
    if data.input_dofs:
        route = chosen_route(data, asked.method, asked.domain, asked.route)
        driven, delays, notes = without_delays(data, asked.delays)
        way, (row, domain) = by_route(driven, route, band), USUAL[route]
        measured = Measured(
            way.response,
            None,
            "records with inputs",
            row,
            domain,
            way.band,
            route=route,
            driven=driven,
            delays=delays,
            notes=(*notes, *way.notes),
        )
        alone = route == "frf" and all(len(run.input_dofs) == 1 for run in driven.runs)
        return exchanged(measured, asked) if alone else measured
    return _of_records(looked_through(data, None, asked.delays), band, asked)


@_of_records.register
def _(data: StoredSignals, band: tuple[float, float] | None, asked: Asked) -> Measured:
    return _of_records(seen_record(data), band, asked)


@_of_records.register
def _(data: SeenRecord, band: tuple[float, float] | None, asked: Asked) -> Measured:
    inside, excerpt = conditioned(data, band), data.excerpt
    if not isinstance(data.record, StoredSignals):
        return replace(
            _ambient(inside, excerpt, "records without inputs"), delays=asked.delays
        )  # they are shifted back already
    text = f"band and noise estimated from {excerpt.duration:.4g} s in the middle of {data.record.duration:.4g} s"
    notes = (Note("excerpt", {"seconds": excerpt.duration}, text),) if excerpt.samples < data.record.samples else ()
    records = inside.records.settled() if isinstance(inside.records, StoredSignals) else inside.records
    inside = inside._replace(records=records, notes=(*notes, *inside.notes))
    return _ambient(inside, excerpt, "a stored record without inputs")


def _ambient(inside: Conditioned, excerpt: Signals, given: str) -> Measured:
    """Return the correlations of records without inputs, with references chosen before any band, the same for all bands."""
    references, count = spanning_outputs(excerpt), len(inside.records.output_dofs)
    which = "all channels"
    if len(references) < count:
        which = f"{len(references)} of {count} channels, which explain most of the others,"
    text = f"correlations with {which} as references were estimated from the records"
    note = Note("estimated", {"references": float(len(references))}, text)
    return Measured(
        estimate_correlation(inside.records, references=references),
        inside.records,
        given,
        "alternate",
        "time",
        band=inside.band,
        notes=(*inside.notes, note),
        whitening=whitening_of(inside.records.excerpt(), references, inside.band),
    )


@_of_records.register
def _(data: StoredResponse, band: tuple[float, float] | None, asked: Asked) -> Measured:
    few, note = combined(data)
    measured = of_response(few, band, asked._replace(exclude=None))
    return replace(measured, given="stored responses", notes=(note, *measured.notes))


@_of_records.register
def _(data: Setups, band: tuple[float, float] | None, asked: Asked) -> Measured:
    check_size(data)
    inside = conditioned_setups(data, band)
    text = f"correlations of {len(data.parts)} setups were merged through the references {', '.join(data.references)}"
    note = Note("estimated", {"setups": len(data.parts)}, text)
    response = joined_setups(inside.setups)
    return Measured(
        response,
        None,
        "ambient setups",
        "alternate",
        "time",
        band=inside.band,
        notes=(*inside.notes, note),
        sizes=setup_blocks(response, inside.lowest),
    )
