"""How records are cut and weighted before they are averaged: runs, hits, windows, zoom."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from modalscope.model.checks import Array, DataError, RealArray, check_choice, check_positive
from modalscope.model.signals import Signals
from modalscope.preprocess.impacts import Hit, cut_hits, exponential_decay, find_hits, room_of, whole_series
from modalscope.preprocess.resolution import narrowest_peak
from modalscope.preprocess.spectra import (
    Segments,
    Transform,
    check_window,
    cross_spectra,
    segment_starts,
    window_samples,
)
from modalscope.preprocess.zoom import chirp_z, heterodyne, zoom_lines

__all__ = ["Plan", "plan_hits", "plan_runs", "put_zoom", "shape_windows", "without_offset"]

#: Random records are cut into segments of this part of a run (more runs, longer segments), which overlap by half.
_SEGMENTS_A_RUN = 8

#: ... and where a resonance is narrow of this part: seven averages are left.
_FEWEST_SEGMENTS = 4

#: Shorter segments have too few lines to see a width on.
_LEAST = 256


@dataclass(kw_only=True, slots=True)
class Plan:
    """How the records are averaged, filled in step by step."""

    outputs: Array  # complex after a zoom by decimation
    inputs: Array
    segments: Segments
    sampling_rate: float
    added_damping: float = 0.0
    notes: list[str] = field(default_factory=list)
    transform: Transform | None = None


def without_offset(signals: Signals, kind: str) -> tuple[RealArray, RealArray]:
    """Return outputs (R, N, l) and inputs (R, N, m) without the mean of every run, or the median of pulses and bursts."""
    outputs, inputs = signals.by_run()
    assert inputs is not None
    # a pulse has a mean of its own; what a sensor shows at rest is the median
    offset = np.median if kind in ("impact", "burst") else np.mean
    return (
        np.asarray(outputs - offset(outputs, axis=1, keepdims=True)),
        np.asarray(inputs - offset(inputs, axis=1, keepdims=True)),
    )


def plan_runs(signals: Signals, kind: str, segment: int | None, overlap: float | None, window: str | None) -> Plan:
    """Cut runs into segments under a window; random forces get a Hann window and half overlap unless told otherwise."""
    outputs, inputs = without_offset(signals, kind)
    random = kind == "random"
    name = check_window(("hann" if random else "none") if window is None else window)
    if segment is None:
        segment = _for_the_narrowest(signals, outputs) if random else signals.samples
    share = (0.5 if random and name != "none" else 0.0) if overlap is None else overlap
    starts = segment_starts(signals.samples, segment, share)
    w = window_samples(name, segment)
    notes = [
        f"segments of {segment} samples",
        "no window" if name == "none" else f"{name} window, {100 * share:g} % overlap",
        "median removed" if kind == "burst" else "mean removed",
    ]
    return Plan(
        outputs=outputs,
        inputs=inputs,
        segments=Segments(starts, w, w),
        sampling_rate=signals.sampling_rate,
        notes=notes,
    )


def _for_the_narrowest(signals: Signals, outputs: RealArray) -> int:
    """Return an eighth of all samples, or up to a quarter where the narrowest resonance wants segments of eight over its width."""
    total = signals.samples * signals.runs
    least, most = (max(2, min(total // parts, signals.samples)) for parts in (_SEGMENTS_A_RUN, _FEWEST_SEGMENTS))
    if most == least or most < _LEAST:
        return least
    level = np.sqrt(np.mean(outputs**2, axis=(0, 1)))
    w = window_samples("hann", most)
    segments = Segments(segment_starts(signals.samples, most, 0.5), w, w)
    spectra = cross_spectra(outputs / np.where(level > 0, level, 1.0), None, signals.sampling_rate, segments)
    width = narrowest_peak(spectra.frequencies, spectra.output_powers.sum(axis=1))
    return least if width is None else int(np.clip(8 * signals.sampling_rate / width, least, most))


def plan_hits(
    signals: Signals, segment: int | None, hits: str | Iterable[int], before: int, window: str | None
) -> Plan:
    """Cut the usable hits out of the record, one segment each."""
    if len(signals.input_dofs) != 1:
        raise DataError(
            "hammer hits were asked",
            f"the record has {len(signals.input_dofs)} inputs, and a hit has one",
            "Estimate each hammer point from its own runs, select(inputs=...), and merge the responses.",
        )
    if check_window(window) != "none":
        raise DataError(
            f"window={window!r} for hits was asked",
            "it would suppress the hit itself",
            "Give exponential=0.01, and force_window in seconds.",
        )
    outputs, inputs = without_offset(signals, "impact")
    found = find_hits(inputs[:, :, 0])
    room = room_of(found, signals.samples, before)
    used, note = _chosen(whole_series(found, room) if segment is None else found, hits)
    y, u = cut_hits(outputs, inputs, used, room, segment=segment, before=before)
    w = np.ones(y.shape[1])
    notes = [note, f"{y.shape[1]} samples from {before} ahead of the hit", "median removed"]
    return Plan(outputs=y, inputs=u, segments=Segments([0], w, w), sampling_rate=signals.sampling_rate, notes=notes)


def _chosen(found: list[Hit], hits: str | Iterable[int]) -> tuple[list[Hit], str]:
    if isinstance(hits, str):
        check_choice("hits", hits, ("good", "all"))
        used = [hit for hit in found if hits == "all" or not hit.unfit]
    else:
        numbers = set(hits)
        unknown = sorted(numbers - {hit.number for hit in found})
        if unknown:
            raise DataError(
                f"hit {unknown[0]} was asked",
                f"the record has hits 1 to {len(found)}",
                "Number them from 1 over all runs.",
            )
        used = [hit for hit in found if hit.number in numbers]
    left = [hit for hit in found if hit not in used]
    note = f"hits {', '.join(str(hit.number) for hit in used)}"
    if left:
        note += " (left out: " + ", ".join(f"{hit.number}, {hit.reason or 'not chosen'}" for hit in left) + ")"
    return used, note


def shape_windows(plan: Plan, force_window: float | None, exponential: float | None, before: int) -> None:
    """Put force and exponential windows on the plan, and the damping that the latter adds."""
    length, rate = plan.segments.length, plan.sampling_rate
    y, u = plan.segments.output_window, plan.segments.input_window
    if force_window is not None:
        kept = before + round(check_positive("force_window", force_window) * rate)
        u = np.where(np.arange(length) < kept, u, 0.0)
        plan.notes.append(f"force window of {force_window:g} s")
    if exponential is not None:
        plan.added_damping = exponential_decay(exponential, length / rate)
        decay = np.exp(-plan.added_damping * np.arange(length) / rate)
        y, u = y * decay, u * decay
        plan.notes.append(
            f"exponential window to {exponential:g}, which adds {plan.added_damping:.4g} 1/s to every pole"
        )
    plan.segments = plan.segments._replace(output_window=y, input_window=u)


def put_zoom(plan: Plan, band: tuple[float, float], count: int | None, by: str) -> None:
    """Replace the plan's lines by those of a band; a zoom by decimation replaces its records, too."""
    length, rate = plan.segments.length, plan.sampling_rate
    lines = zoom_lines(band, length, rate, count)
    plan.notes.append(f"zoom into {band[0]:g}-{band[1]:g} Hz by {by}")
    if by == "chirp-z":
        plan.transform = Transform(lines, lambda x: chirp_z(x, lines, rate))
        return
    if count is not None:
        raise DataError(
            "zoom_lines with a zoom by decimation was asked",
            "its lines are those of the segment",
            'Give zoom_by="chirp-z", or a longer segment.',
        )
    shifted = heterodyne(plan.outputs, plan.inputs, rate, lines, length)
    q = shifted.factor
    plan.transform = shifted.transform(length // q, lines)
    plan.outputs, plan.inputs, plan.sampling_rate = shifted.outputs, shifted.inputs, shifted.sampling_rate
    plan.segments = Segments(
        [start // q for start in plan.segments.starts],
        plan.segments.output_window[::q],
        plan.segments.input_window[::q],
    )
