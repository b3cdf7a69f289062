"""Several runs and roving sensors: parts of one test, put together by their labels."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.model.checks import DataError, check_each, check_kind
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.records import Records
from modalscope.model.setups import Setups
from modalscope.model.signals import Signals
from modalscope.model.sources import source_of
from modalscope.preprocess.correlation import estimate_correlation
from modalscope.preprocess.frf import estimate_frf
from modalscope.preprocess.joined_responses import check_same, joined_frf, merge_frf, merge_pulses
from modalscope.preprocess.setups import correlations, merge_setups

__all__ = ["merge"]

Part = Signals | FrequencyResponse | ImpulseResponse
Test = Records | Setups


@named(inspect.signature(estimate_frf).parameters, inspect.signature(estimate_correlation).parameters)
def merge(parts: Iterable[Part | Test], **options: Any) -> Part | Test:
    """Put the runs of one test together, by the labels of their channels.

    Parameters
    ----------
    parts : sequence of Signals, Records, Setups, FrequencyResponse or ImpulseResponse
        All of one kind.

        - Records of the same channels and length become one record of several runs, which estimates average.
        - Records of the same outputs, but of other lengths or inputs, become `Records`.
        - Records of different outputs under measured forces (roving sensors) become one frequency response: `estimate_frf`
          of each, put together.
        - Records of different outputs without forces (ambient setups) become `Setups`, each of which is filtered to the band
          before they are put together; with options of `estimate_correlation` one correlation at once: every setup is correlated with the
          outputs that all setups share, and the other outputs are carried over to these common references (see `merge_setups`).
        - Responses are put together output by output and input by input; pairs that several parts hold are averaged,
          weighted by their averages.
    **options
        Those of `estimate_frf` or `estimate_correlation`, for records of different outputs.

    Returns
    -------
    Signals, Records, Setups, FrequencyResponse or ImpulseResponse

    Raises
    ------
    DataError
        Parts of different kinds, lines, sampling rates or quantities; no common reference; a pair of output and input that
        no part holds.

    Examples
    --------
    >>> f = np.linspace(1, 2, 5)
    >>> parts = [
    ...     FrequencyResponse(values=np.full((5, 1, 1), 1j * k), frequencies=f, output_dofs=[f"{k}:+Z"]) for k in (1, 2)
    ... ]
    >>> merge(parts).output_dofs
    ('1:+Z', '2:+Z')
    """
    given: list[Part] = []
    for part in check_each("parts to merge", parts, "a list of records or responses"):
        held = {Records: "runs", Setups: "parts"}.get(type(part))
        given += getattr(part, held) if held else [part]
    if not given:
        raise DataError("parts to merge were asked", "the list is empty", "Give at least one record or response.")
    for part in given:
        check_kind("each part to merge", part, (FrequencyResponse, ImpulseResponse, Signals, Records, Setups))
    kinds = {type(part).__name__ for part in given}
    if len(kinds) > 1:
        raise DataError(
            "parts of one kind were asked",
            f"there are {', '.join(sorted(kinds))}",
            "Estimate responses from the records first, or merge each kind by itself.",
        )
    if not isinstance(given[0], Signals) and options:
        raise DataError(
            f"{next(iter(options))} was asked",
            "responses are merged without options",
            "Leave it out, or merge the records.",
        )
    if len(given) == 1:
        return given[0]
    if isinstance(given[0], Signals):
        return _merge_records([part for part in given if isinstance(part, Signals)], options)
    return _merge_responses(given)


def _merge_responses(parts: Sequence[Any]) -> FrequencyResponse | ImpulseResponse:
    if isinstance(parts[0], FrequencyResponse):
        return merge_frf(parts)
    if all(part.kind == "correlation" for part in parts):
        return merge_setups(parts)
    return merge_pulses(parts)


def _merge_records(parts: list[Signals], options: dict[str, Any]) -> Part | Test:
    first = parts[0]
    check_same(parts, "sampling_rate", "sampling rates", "Decimate the faster records.")
    if all(p.output_dofs == first.output_dofs for p in parts):
        alike = all(p.input_dofs == first.input_dofs for p in parts)
        if alike and len({p.samples for p in parts}) == 1:
            return _runs(parts, options)
        if alike or not options:
            _check_stacked(options)
            return Records(runs=tuple(parts))
        parts = list(Records(runs=tuple(parts)).stacked())
    measured = [part.inputs is not None for part in parts]
    if all(measured):
        return joined_frf(parts, **options)
    if any(measured):
        raise DataError(
            "records of one test were asked",
            "some have inputs and others do not",
            "Merge those with inputs and those without each by themselves.",
        )
    setups = Setups(parts=tuple(parts))
    return merge_setups(correlations(setups, **options)) if options else setups


def _runs(parts: list[Signals], options: dict[str, Any]) -> Signals:
    first = parts[0]
    _check_stacked(options)
    check_same(parts, "quantities", "quantities", "Convert the records to one.")
    check_same(parts, "units", "units", "Convert the records to one.")
    records = [part.by_run() for part in parts]
    inputs = [u for _, u in records if u is not None]
    return replace(
        first,
        outputs=np.concatenate([y for y, _ in records]),
        inputs=np.concatenate(inputs) if inputs else None,
        groups=Records(runs=tuple(parts)).groups,
        source_path=source_of(parts),
    ).processed(f"merged from {len(parts)} records, {sum(part.runs for part in parts)} runs in all")


def _check_stacked(options: dict[str, Any]) -> None:
    if options:
        raise DataError(
            f"{next(iter(options))} was asked",
            "records of the same channels are stacked as runs, nothing is estimated",
            "Give it to estimate_frf or estimate_correlation of the result.",
        )
