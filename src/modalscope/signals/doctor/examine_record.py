"""Examine records before identification: run all checks of one record, and collect the findings."""

from __future__ import annotations

import numpy as np

from modalscope.data.kind_of_test import kind_of_test
from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.signals.doctor.delays import delayed, exchanged, late
from modalscope.signals.doctor.findings import dead_channels, finding, identical_channels, sides_of
from modalscope.signals.doctor.halves import changes
from modalscope.signals.doctor.prediction import NO_PREDICTION, missing_samples, prediction_of
from modalscope.signals.doctor.records import (
    bad_hits,
    clipped,
    events,
    leakage,
    noisy_channels,
    predicted,
    too_short,
    transposed,
)
from modalscope.signals.doctor.responses import MIN_COHERENCE, examine_estimate, outputs_to_estimate
from modalscope.signals.doctor.runs import changed_runs
from modalscope.signals.doctor.samples import frozen, overflows, spikes
from modalscope.signals.preprocess.bands import swept_lines, useful_lines
from modalscope.signals.preprocess.excitation import few_tones, find_excitation, is_sweep
from modalscope.signals.preprocess.frf import estimate_frf


def examine_record(signals: Signals, whole: bool) -> list[Finding]:
    """Return the findings of a record."""
    findings = transposed(signals)
    if findings:  # all other checks take columns for channels
        return findings
    kind = _kind_of(signals)
    moving_channels: dict[str, list[int]] = {}
    for side, columns, labels in sides_of(signals):
        constant = dead_channels(columns, labels, forces=side == "input")
        dead = {f.channels[0] for f in constant}
        moving_channels[side] = [i for i, dof in enumerate(labels) if dof not in dead]
        findings += constant + identical_channels(columns, labels)
    steady = kind in ("random", "ambient")  # hits and sweeps begin at once
    prediction = prediction_of(signals.by_run()[0]) if steady else NO_PREDICTION
    overflowed = overflows(signals, kind, prediction.isolated)
    findings += clipped(signals, kind) + overflowed + frozen(signals)
    findings += spikes(signals, kind, {f.channels[0] for f in overflowed}, prediction.isolated)
    if not all(moving_channels.values()):
        return findings
    every = len(signals.output_dofs) + len(signals.input_dofs) == sum(map(len, moving_channels.values()))
    moving = signals if every else signals.select(**{f"{side}s": chosen for side, chosen in moving_channels.items()})
    if steady and not every:
        prediction = prediction_of(moving.by_run()[0])
    single = events(moving) if kind == "ambient" else []
    altered = changes(moving, "event" if single else kind)
    findings += single + missing_samples(moving, prediction.first) + altered
    reversed_ = exchanged(moving) if kind != "sweep" else []
    findings += reversed_ or delayed(moving) or (late(moving) if kind in ("random", "burst") else [])
    if kind == "impact":
        findings += bad_hits(signals)
    if kind in ("impact", "burst"):
        findings += leakage(moving, kind)
    findings += (short := _short(moving, kind))
    forced = signals.inputs is not None and len(moving_channels["input"]) == len(signals.input_dofs) and not reversed_
    changed = changed_runs(moving) if forced else []
    findings += changed
    # a change between runs lowers the coherence too: one cause, one finding; another place of the force changes all outputs
    explained = {dof for f in (*changed, *altered) for dof in f.channels}
    if any(f.kind == "places" for f in changed):
        explained.update(moving.output_dofs)
    part = predicted(moving) if steady else None
    noisy = [f for f in noisy_channels(moving, part, prediction.unexplained) if f.channels[0] not in explained]
    findings += noisy
    if forced:
        findings += _of_response(moving, kind, part, bool(short), explained | {f.channels[0] for f in noisy}, whole)
    return findings


def _kind_of(signals: Signals) -> str:
    """Return the kind of excitation, "ambient" without forces; a sweep is one though its force was not measured."""
    if signals.inputs is not None:
        return find_excitation(signals)
    kind = kind_of_test(*signals.by_run())
    few = signals.by_run()[0][:, :, :: max(1, len(signals.output_dofs) // 8)]
    swept = kind == "ambient" and any(is_sweep(y - np.median(y)) for run in few for y in run.T)
    return "sweep" if swept else kind


def _short(moving: Signals, kind: str) -> list[Finding]:
    """Return the finding of a record that is short for its resonance, or whose forces are a few lines, which look like one."""
    if tones := few_tones(moving) if kind == "random" else ():
        return [finding("few lines", *moving.input_dofs, where=", ".join(f"{f:.4g}" for f in tones), at=tones)]
    return too_short(moving) if kind in ("random", "ambient") else []


def _of_response(
    signals: Signals, kind: str, part: RealArray | None, short: bool, explained: set[str], whole: bool
) -> list[Finding]:
    """Return what the estimated response shows in addition to the record; low coherence only where nothing else explains it."""
    if signals.runs == 1 and signals.samples < 64 * len(signals.input_dofs):
        return []
    if kind == "random":  # on lines without force a response is noise, and so is its coherence
        by_inputs = np.ones(len(signals.output_dofs)) if part is None else part
        explained = explained | {
            dof for dof, share in zip(signals.output_dofs, by_inputs, strict=True) if share > MIN_COHERENCE
        }
    if short:
        explained = set(signals.output_dofs)
    chosen = range(len(signals.output_dofs)) if whole else outputs_to_estimate(signals, explained)
    if not chosen:
        return []
    try:
        response = estimate_frf(signals.select(outputs=chosen))
    except DataError:  # dependent inputs, or no usable hit: an error where the response is asked for
        return []
    # a zero-order hold delays the force by half a sample, which turns phases in the upper half of the spectrum
    lines = response.frequencies <= signals.sampling_rate / 4
    if kind == "impact":
        lines &= useful_lines(signals, response.frequencies)
    elif kind in ("sweep", "burst"):
        lines &= swept_lines(signals, response.frequencies)
    return [
        f._replace(channels=signals.output_dofs) if f.channels == response.output_dofs else f  # true of all together
        for f in examine_estimate(response.at_lines(lines))
        if f.kind != "low coherence" or f.channels[0] not in explained
    ]
