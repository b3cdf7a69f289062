"""Estimate frequency responses from records: the excitation sets how segments are cut, the estimator where the noise is assumed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray, check_count, check_kind, check_positive
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import one_thread
from modalscope.preprocess.estimators import (
    ESTIMATORS,
    Estimate,
    check_inputs,
    coherence_of,
    noise_powers,
    solve,
    synchronous,
)
from modalscope.preprocess.excitation import driven_records, find_excitation, find_period
from modalscope.preprocess.impacts import Hit, cut_hits, exponential_decay, find_hits, room_of, whole_series
from modalscope.preprocess.local_models import LOCAL, local_models
from modalscope.preprocess.spectra import Segments, Transform, check_window, cross_spectra, silent_lines
from modalscope.preprocess.zoom import ZOOMS, chirp_z, heterodyne, zoom_lines

# ---------------------------------------------------------------------------------------------------------- resolution
# Whether the lines are close enough for the identified modes: averaged segments leak, and leakage increases the damping.

#: Lines in a half bandwidth that a Hann window's leakage needs to stay below a few per cent of the damping.
_LINES = 4.0

#: Prominence of a peak of the averaged spectrum, dB.
_PEAK = 10.0


def leakage_note(data: Any, response: Response, frequencies: Array, damping_ratios: Array) -> Note | None:
    """Return a warning where 1/T is not four times below the half bandwidth zeta f of a mode; None where all are wide enough.

    A window of T seconds widens a resonance by about 1/T, so that averaged segments of records under random forces overestimate the
    damping. Records whose vibration begins and ends within a run do not leak. Frequencies are in Hz.
    """
    if not (isinstance(response, FrequencyResponse) and response.averages and response.lines > 1 and _is_random(data)):
        return None
    spacing = float(np.min(np.diff(response.frequencies)))
    half = np.asarray(damping_ratios) * np.asarray(frequencies)
    narrow = np.flatnonzero((half > 0) & (half < _LINES * spacing))
    if not narrow.size:
        return None
    worst = narrow[np.argmin(half[narrow])]
    f, width = float(frequencies[worst]), float(half[worst])
    text = (
        f"the half bandwidth of {narrow.size} of {half.size} modes is less than four times the {spacing:.3g} Hz between lines "
        f"({width:.3g} Hz at {f:.4g} Hz the narrowest): leakage makes their damping too high. "
        f"Take the records themselves (route='records'), estimator='lrm', or segments of {_LINES / width:.3g} s"
    )
    return Note("leakage", {"modes": narrow.size, "spacing": spacing, "frequency": f, "half_bandwidth": width}, text)


def _is_random(data: Any) -> bool:
    runs = getattr(data, "recordings", ())
    return bool(runs) and all(run.inputs is not None and find_excitation(run) == "random" for run in runs)


def narrowest_peak(frequencies: RealArray, power: RealArray) -> float | None:
    """Return the width in Hz at half power of the narrowest peak of a power spectrum on equally spaced lines; None without a peak.

    A resonance is three times as wide at a tenth of its power, where the scatter of few averages does not cut its top off.
    """
    level = 10 * np.log10(np.maximum(power, np.finfo(float).tiny))
    peaks, _ = scipy.signal.find_peaks(level, prominence=_PEAK)
    if not peaks.size:
        return None
    widths = scipy.signal.peak_widths(power, peaks, rel_height=0.9)[0] / 3
    return float(widths.min() * (frequencies[1] - frequencies[0]))


# --------------------------------------------------------------------------------------------------------------- plans
# How records are cut and weighted before they are averaged: runs, hits, windows, zoom.

#: Random records are cut into segments of this part of a run (more runs, longer segments), which overlap by half.
_SEGMENTS_A_RUN = 8

#: ... and where a resonance is narrow of this part, which gives seven averages.
_FEWEST_SEGMENTS = 4

#: Shorter segments have too few lines to measure a width.
_LEAST = 256


@dataclass(kw_only=True, slots=True)
class Plan:
    """How the records are averaged: outputs and inputs as they are cut, segments and windows, transform."""

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
    # the mean of a pulse is not zero; the level of a sensor at rest is the median
    offset = np.median if kind in ("impact", "burst") else np.mean
    y, u = (np.asarray(x - offset(x, axis=1, keepdims=True)) for x in (outputs, inputs))
    return y, u


def plan_runs(signals: Signals, kind: str, segment: int | None, overlap: float | None, window: str | None) -> Plan:
    """Cut runs into segments under a window; the defaults of random forces are a Hann window and half overlap."""
    outputs, inputs = without_offset(signals, kind)
    random = kind == "random"
    name = check_window(("hann" if random else "none") if window is None else window)
    if segment is None:
        segment = _segment_length(signals, outputs) if random else signals.samples
    share = (0.5 if random and name != "none" else 0.0) if overlap is None else overlap
    notes = [
        f"segments of {segment} samples",
        "no window" if name == "none" else f"{name} window, {100 * share:g} % overlap",
        "median removed" if kind == "burst" else "mean removed",
    ]
    segments = Segments.of(signals.samples, segment, share, name)
    return Plan(outputs=outputs, inputs=inputs, segments=segments, sampling_rate=signals.sampling_rate, notes=notes)


def _segment_length(signals: Signals, outputs: RealArray) -> int:
    """Return an eighth of all samples, or up to a quarter where the narrowest resonance needs segments of eight over its width."""
    total = signals.samples * signals.runs
    least, most = (max(2, min(total // parts, signals.samples)) for parts in (_SEGMENTS_A_RUN, _FEWEST_SEGMENTS))
    if most == least or most < _LEAST:
        return least
    level = np.sqrt(np.mean(outputs**2, axis=(0, 1)))
    segments = Segments.of(signals.samples, most)
    spectra = cross_spectra(outputs / np.where(level > 0, level, 1.0), None, signals.sampling_rate, segments)
    width = narrowest_peak(spectra.frequencies, spectra.output_powers.sum(axis=1))
    return least if width is None else int(np.clip(8 * signals.sampling_rate / width, least, most))


def plan_hits(
    signals: Signals, segment: int | None, hits: str | Iterable[int], before: int, window: str | None
) -> Plan:
    """Cut the chosen hits out of the record, one segment each."""
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
        if unknown := sorted(numbers - {hit.number for hit in found}):
            raise DataError(
                f"hit {unknown[0]} was asked",
                f"the record has hits 1 to {len(found)}",
                "Number them from 1 over all runs.",
            )
        used = [hit for hit in found if hit.number in numbers]
    excluded = [f"{hit.number}, {hit.reason or 'not chosen'}" for hit in found if hit not in used]
    note = f"hits {', '.join(str(hit.number) for hit in used)}"
    if excluded:
        note += f" (left out: {', '.join(excluded)})"
    return used, note


def apply_windows(plan: Plan, force_window: float | None, exponential: float | None, before: int) -> None:
    """Multiply the windows of the plan by force and exponential windows, and set the damping that the latter adds."""
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


def zoom_plan(plan: Plan, band: tuple[float, float], count: int | None, by: str) -> None:
    """Replace the lines of the plan by those of a band; a zoom by decimation also replaces its records."""
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
    starts, y, u = plan.segments
    plan.segments = Segments([start // q for start in starts], y[::q], u[::q])


# ----------------------------------------------------------------------------------------------------------------- frf

#: Mark in `processing` of an estimate with leakage: windows cut through the decays.
LEAKING = "random excitation"


@named()
@one_thread
def estimate_frf(
    signals: Signals,
    *,
    estimator: str = "h1",
    excitation: str = "auto",
    segment: int | None = None,
    overlap: float | None = None,
    window: str | None = None,
    noise: tuple[ArrayLike, ArrayLike] | None = None,
    force_window: float | None = None,
    exponential: float | None = None,
    hits: str | Iterable[int] = "good",
    before: int = 20,
    period: int | None = None,
    settle: int = 1,
    zoom: tuple[float, float] | None = None,
    zoom_lines: int | None = None,
    zoom_by: str = "chirp-z",
    held: bool = False,
    degree: int | None = None,
    half_width: int | None = None,
) -> FrequencyResponse:
    """Frequency responses of all outputs to all inputs, with coherence and variance, from records of any excitation.

    Parameters
    ----------
    signals : Signals
        Outputs and inputs, one run or several; runs are averaged. Their mean is removed (at hits: their median).
    estimator : {"h1", "h2", "hv", "lpm", "lrm"}
        Where the noise is: on the outputs (H1 = S_yu S_uu^-1), on the inputs (H2), or on both (Hv, total least squares).
        Correlated inputs are solved for together. "lpm" and "lrm" fit local polynomials or rational functions to the lines of whole
        runs, without window, average or leakage (`modalscope.preprocess.local_models`); noise is on the outputs.
    excitation : {"auto", "random", "burst", "sweep", "periodic", "impact"}
        Kind of the forces; by default detected, except for periodic ones. Random forces are averaged over overlapping
        segments; runs of bursts and sweeps, which begin and end within the run, are transformed whole; periodic forces are averaged
        over periods; impacts are cut at the hits.
    segment : int, optional
        Samples of a segment. By default an eighth of a run times the number of runs for random forces, and up to a quarter where
        the narrowest resonance needs it; the whole run for bursts and sweeps, up to the next hit for impacts.
    overlap : float, optional
        Part of a segment that the next one shares; for random forces one half with a window, else none.
    window : str, optional
        "hann" (random forces), "flattop", "none" (all others), "hamming", "blackman", "blackmanharris" or "tukey".
    noise : (outputs, inputs), optional
        Relative noise powers for "hv" and "h2", one number or one a channel; only their ratios matter. By default the
        same fraction of every channel's own power.
    force_window : float, optional
        Seconds after a hit's trigger during which the force is kept; zero after that.
    exponential : float, optional
        Value to which an exponential window on outputs and inputs falls at the end of a segment, such as 0.01. Its damping
        is kept as `added_damping`, so that identified poles are shifted back exactly.
    hits : {"good", "all"} or numbers
        Which hits are used: all but overloaded ones, all, or those of these numbers, counted from 1 over all runs.
    before : int
        Samples kept ahead of a hit.
    period : int, optional
        Period of a periodic excitation in samples; detected by default.
    settle : int
        Periods excluded at the start of a run, until the vibration is stationary.
    zoom : (f1, f2), optional
        Band in Hz on which alone the lines are computed.
    zoom_lines : int, optional
        Number of lines of the zoom; by default those of the segment's own transform.
    zoom_by : {"chirp-z", "decimation"}
        How the zoom is done.
    held : bool
        Whether the forces were held between samples (simulations, converters without a filter). The response is then that
        of a sampled system and keeps its sampling rate, for the domain "z".
    degree : int, optional
        Of the polynomials of "lpm" and "lrm"; 2 by default.
    half_width : int, optional
        Lines on either side that they are fitted to.

    Returns
    -------
    FrequencyResponse
        With coherence (ordinary for one input, multiple for several), variance of the complex estimates and the number of
        averages; without the first two when there are no more averages than inputs. Lines on which an input has no power,
        such as 0 Hz of a record whose mean was removed, are excluded. `processing` lists the steps.

    Raises
    ------
    DataError
        No inputs, one without any force, inputs that are multiples of each other, too few averages, options that do not go
        together.

    References
    ----------
    Bendat and Piersol, "Random Data", chapters 7 and 9 (variances); Rocklin, Crowley and Vold, "A comparison of H1, H2 and
    Hv", IMAC 1985.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal((4096, 1))
    >>> record = Signals(outputs=2 * u + 0.1 * rng.standard_normal(u.shape), inputs=u, sampling_rate=100.0)
    >>> frf = estimate_frf(record)
    >>> frf.averages, bool(np.all(np.abs(frf.values - 2) < 0.2))
    (15, True)
    """
    check_kind("estimate_frf", signals, Signals)
    check_choice("estimator", estimator, (*ESTIMATORS, *LOCAL))
    check_choice("zoom_by", zoom_by, ZOOMS)
    _check_forces(signals)
    kind = find_excitation(signals, excitation)
    if estimator in LOCAL:
        averaging = (segment, overlap, window, noise, force_window, exponential, period, zoom)
        averaged = any(option is not None for option in averaging)
        found = _local(signals, estimator, degree, half_width, kind, averaged)
    elif kind == "periodic":
        _check_options(kind, estimator, period, force_window, exponential)
        found = _periodic(signals, period, check_count("settle", settle, least=0), zoom)
    else:
        _check_options(kind, estimator, period, force_window, exponential)
        if kind == "impact":
            plan = plan_hits(signals, segment, hits, check_count("before", before, least=0), window)
        else:
            plan = plan_runs(signals, kind, segment, overlap, window)
        apply_windows(plan, force_window, exponential, before)
        if zoom is not None:
            zoom_plan(plan, zoom, zoom_lines, zoom_by)
        found = _averaged(plan, signals.input_dofs, kind, estimator, noise)
    return FrequencyResponse(
        values=found.estimate.values,
        frequencies=found.frequencies,
        quantity=signals.quantity,
        sampling_rate=signals.sampling_rate if held else None,
        coherence=found.coherence,
        variance=found.estimate.variance,
        averages=found.averages,
        added_damping=found.added_damping,
        **signals.processed(found.note).labelled(),
    )


class _Found(NamedTuple):
    """Estimates on lines (Hz), and what `processing` notes of them."""

    frequencies: RealArray
    estimate: Estimate
    coherence: RealArray | None
    averages: int | None
    note: str
    added_damping: float = 0.0


def _averaged(
    plan: Plan, inputs: tuple[str, ...], kind: str, estimator: str, noise: tuple[ArrayLike, ArrayLike] | None
) -> _Found:
    """Estimate from averaged spectra, without the lines on which an input has no power."""
    spectra = cross_spectra(plan.outputs, plan.inputs, plan.sampling_rate, plan.segments, transform=plan.transform)
    silent = silent_lines(spectra)
    count = int(np.sum(silent))
    if count:
        where = "0 Hz" if count == 1 and silent[0] and spectra.frequencies[0] == 0 else f"{count} lines"
        plan.notes.append(f"{where} left out, without force")
        spectra = spectra.at_lines(~silent)
    check_inputs(spectra, inputs)
    estimate = solve(spectra, estimator, noise_powers(spectra, estimator, noise))
    averages = f"{spectra.averages} average" + ("s" if spectra.averages > 1 else "")
    note = f"{estimator.upper()} of {averages}, {kind} excitation: {'; '.join(plan.notes)}"
    return _Found(spectra.frequencies, estimate, coherence_of(spectra), spectra.averages, note, plan.added_damping)


def _local(
    signals: Signals, estimator: str, degree: int | None, half_width: int | None, kind: str, averaged: bool
) -> _Found:
    """Estimate by local models; DataError where the excitation or an option asks for averages."""
    cut = kind in ("periodic", "impact")
    if cut or averaged:
        raise DataError(
            f"estimator={estimator!r} was asked",
            f"the excitation is {kind}" if cut else "an option of averaged segments was given",
            "Use estimator='h1' for these; local models take whole runs of random forces, sweeps and bursts.",
        )
    found = local_models(signals, estimator, 2 if degree is None else degree, half_width)
    words = {"lpm": "local polynomial", "lrm": "local rational"}[estimator]
    note = f"{words} models on {2 * found.half_width + 1} lines of whole runs, no window, no average"
    return _Found(found.frequencies, Estimate(found.values, found.variance), found.coherence, None, note)


def _check_forces(signals: Signals) -> None:
    inputs = np.concatenate(driven_records(signals, "frequency responses")[1])
    dead = [dof for dof, force in zip(signals.input_dofs, inputs.T, strict=True) if np.all(force == force[0])]
    if dead:
        raise DataError(
            f"frequency responses to {', '.join(signals.input_dofs)} were asked",
            f"{', '.join(dead)} is the same at all samples: there is no force",
            f"Leave it out: select(exclude={dead!r}).",
        )


def _check_options(
    kind: str, estimator: str, period: int | None, force_window: float | None, exponential: float | None
) -> None:
    options = (
        ("period", period, ("periodic",)),
        ("force_window", force_window, ("impact",)),
        ("exponential", exponential, ("impact", "burst", "sweep")),
    )
    wrong = [
        (name, f"excitation={' or '.join(map(repr, kinds))}")
        for name, value, kinds in options
        if value is not None and kind not in kinds
    ]
    if kind == "periodic" and estimator != "h1":
        wrong.append((f"estimator={estimator!r}", "estimator='h1': averaging over periods removes noise on both sides"))
    if wrong:
        name, needed = wrong[0]
        raise DataError(f"{name} was asked", f"the excitation is {kind}", f"Leave it out, or give {needed}.")


def _periodic(signals: Signals, period: int | None, settle: int, zoom: tuple[float, float] | None) -> _Found:
    """Estimate by the synchronous average over periods."""
    if zoom is not None:
        raise DataError(
            "a zoom with periodic excitation was asked",
            "its lines are those of the period, between them there is no force",
            "Leave zoom out, and cut the result with band().",
        )
    outputs, inputs = without_offset(signals, "periodic")
    length = find_period(inputs, period)
    result = synchronous(outputs, inputs, signals.sampling_rate, length, settle, signals.input_dofs)
    note = (
        f"synchronous average of {result.periods} periods of {length} samples in {signals.runs} "
        f"run{'s' if signals.runs > 1 else ''}, no window, mean removed; {result.silent} lines left out, without force"
    )
    averages = result.periods * signals.runs
    return _Found(result.frequencies, result.estimate, result.coherence, averages, note)
