"""Plan how records are averaged: cut into segments or hits, under windows, on all lines or on those of a zoom.

A zoom computes the spectrum of a narrow band at fine resolution, by the chirp-z transform. It is not that of SciPy, which does not reduce
phases in integers: its error is 1e-10 for 16 000 samples, 1e-8 for two million.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import scipy
from scipy import fft

from modalscope.data.records import Signals
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count, check_positive
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import check_fits
from modalscope.signals.preprocess.impacts import (
    Hit,
    between_hits,
    cut_hits,
    exponential_decay,
    find_hits,
    room_of,
    whole_series,
)
from modalscope.signals.preprocess.spectra import Segments, Transform, check_window, cross_spectra

#: Minimum prominence of a peak of the averaged spectrum, dB.
_PROMINENCE_DB = 10.0

#: Default segments of random records: this many in a run, and down to the second number (seven averages) where a resonance is narrow.
_SEGMENTS_A_RUN, _MIN_SEGMENTS = 8, 4

#: Samples of the shortest segment with enough lines to measure the width of a resonance.
_MIN_SEGMENT = 256


@dataclass(kw_only=True, slots=True)
class Plan:
    """How the records are averaged: outputs and inputs as they are cut, segments and windows, transform."""

    outputs: RealArray
    inputs: RealArray
    segments: Segments
    sampling_rate: float
    added_damping: float = 0.0
    notes: list[str] = field(default_factory=list)
    transform: Transform | None = None


def narrowest_peak(frequencies: RealArray, power: RealArray) -> float | None:
    """Return the width in Hz at half power of the narrowest peak of a power spectrum on equally spaced lines; None without a peak.

    A resonance is three times as wide at a tenth of its power, where the scatter of few averages does not cut its top off.
    """
    level = 10 * np.log10(np.maximum(power, np.finfo(float).tiny))
    peaks, _ = scipy.signal.find_peaks(level, prominence=_PROMINENCE_DB)
    if not peaks.size:
        return None
    widths = scipy.signal.peak_widths(power, peaks, rel_height=0.9)[0] / 3
    return float(widths.min() * (frequencies[1] - frequencies[0]))


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
    least, most = (max(2, min(total // parts, signals.samples)) for parts in (_SEGMENTS_A_RUN, _MIN_SEGMENTS))
    if most == least or most < _MIN_SEGMENT:
        return least
    level = np.sqrt(np.mean(outputs**2, axis=(0, 1)))
    segments = Segments.of(signals.samples, most)
    spectra = cross_spectra(outputs / np.where(level > 0, level, 1.0), None, signals.sampling_rate, segments)
    width = narrowest_peak(spectra.frequencies, spectra.output_powers.sum(axis=1))
    return least if width is None else int(np.clip(8 * signals.sampling_rate / width, least, most))


def plan_hits(
    signals: Signals,
    segment: int | None,
    hits: str | Iterable[int],
    before: int,
    window: str | None,
    *,
    as_told: bool = True,
) -> Plan:
    """Cut the chosen hits out of the record, one segment each.

    `as_told`: whether the force is what its sensor tells between hits, too; else it is zero there where that explains more of the outputs.
    """
    if len(signals.input_dofs) != 1:
        change = "Select the runs of each hammer point, select(inputs=...), and merge their responses."
        raise DataError("hammer hits:", f"the record has {len(signals.input_dofs)} inputs instead of one", change)
    if check_window(window) != "none":
        change = "Give exponential=0.01, and force_window in seconds."
        raise DataError(f"window={window!r} for hits:", "it suppresses the hit itself", change)
    outputs, inputs = without_offset(signals, "impact")
    all_hits = find_hits(inputs[:, :, 0])
    room = room_of(all_hits, signals.samples, before)
    used, note = _chosen(whole_series(all_hits, room) if segment is None else all_hits, hits)
    y, u = cut_hits(outputs, inputs, used, room, segment=segment, before=before)
    w = np.ones(y.shape[1])
    notes = [note, f"{y.shape[1]} samples from {before} ahead of the hit", "median removed"]
    plan = Plan(outputs=y, inputs=u, segments=Segments([0], w, w), sampling_rate=signals.sampling_rate, notes=notes)
    if not as_told and len(u) > 1:
        silent = np.where(between_hits(inputs[:, :, 0], all_hits)[:, :, None], 0.0, inputs)
        alone = cut_hits(outputs, silent, used, room, segment=segment, before=before)[1]
        if _unexplained(y, alone) < _unexplained(y, u):
            plan.inputs = alone
            notes.append("force zero between hits")
    return plan


def _unexplained(y: RealArray, u: RealArray) -> float:
    """Return the part of outputs (hits, n, l) that one response to the force (hits, n, 1) of all hits leaves, the mean over outputs."""
    Y, U = (np.fft.rfft(x, axis=1) for x in (y, u))
    H = np.sum(Y * U.conj(), axis=0) / np.maximum(np.sum(np.abs(U) ** 2, axis=0), np.finfo(float).tiny)
    left, power = (np.sum(np.abs(x) ** 2, axis=(0, 1)) for x in (Y - H * U, Y))
    return float(np.mean(left / np.maximum(power, np.finfo(float).tiny)))


def _chosen(all_hits: list[Hit], asked: str | Iterable[int]) -> tuple[list[Hit], str]:
    """Return the chosen hits, and the note on them and the others."""
    if isinstance(asked, str):
        check_choice("hits", asked, ("good", "all"))
        used = [hit for hit in all_hits if asked == "all" or not hit.unfit]
    else:
        numbers = set(asked)
        if unknown := sorted(numbers - {hit.number for hit in all_hits}):
            have, change = f"the record has hits 1 to {len(all_hits)}", "Number them from 1 over all runs."
            raise DataError(f"hit {unknown[0]}:", have, change)
        used = [hit for hit in all_hits if hit.number in numbers]
    excluded = ", ".join(f"{hit.number}, {hit.reason or 'not chosen'}" for hit in all_hits if hit not in used)
    note = f"hits {', '.join(str(hit.number) for hit in used)}"
    return used, f"{note} (left out: {excluded})" if excluded else note


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
        added = f"which adds {plan.added_damping:.4g} 1/s to every pole"
        plan.notes.append(f"exponential window to {exponential:g}, {added}")
    plan.segments = plan.segments._replace(output_window=y, input_window=u)


def zoom_plan(plan: Plan, band: tuple[float, float], count: int | None) -> None:
    """Replace the lines of the plan by those of a band."""
    lines, rate = zoom_lines(band, plan.segments.length, plan.sampling_rate, count), plan.sampling_rate
    plan.notes.append(f"zoom into {band[0]:g}-{band[1]:g} Hz by chirp-z")
    plan.transform = Transform(lines, lambda x: chirp_z(x, lines, rate))


def zoom_lines(band: tuple[float, float], length: int, sampling_rate: float, lines: int | None) -> RealArray:
    """Return the lines of a band: those of the transform of `length` samples, or `lines` equally spaced ones, ends included.

    Raises DataError for a band outside 0 to half the sampling rate, or with fewer than two lines.
    """
    low, high = float(band[0]), float(band[1])
    if not 0 <= low < high <= sampling_rate / 2:
        have = f"the record contains 0 to {sampling_rate / 2:g} Hz"
        raise DataError(f"a zoom into {low:g} to {high:g} Hz:", have, "Give the lower end first, within these.")
    if lines is not None:
        count = check_count("zoom_lines", lines, least=2)
        # spectra of a channel at least, and what the chirp makes of them
        check_fits(f"a zoom on {count} lines", 64.0 * count, "Give fewer lines.")
        return np.linspace(low, high, count)
    step = sampling_rate / length
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    if last <= first:
        have = f"segments of {length} samples give lines {step:g} Hz apart, fewer than two inside"
        change = "Lengthen segment, widen the band, or give zoom_lines."
        raise DataError(f"a zoom into {low:g} to {high:g} Hz:", have, change)
    return np.asarray(np.arange(first, last + 1) * step, dtype=float)


def chirp_z(samples: Array, frequencies: RealArray, sampling_rate: float) -> ComplexArray:
    """Return X(f) = sum_k x(k) exp(-j 2 pi f k / fs) on equally spaced lines, along axis 1 of (p, N, channels).

    Bluestein's convolution: with n k = (n^2 + k^2 - (n - k)^2) / 2 the sum over k is a convolution with a chirp, which
    costs three fast transforms for any lines. On lines of the record's transform the phase of the chirp is reduced to one turn in
    integers, so that long records lose no digits.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal((1, 1000, 1))
    >>> zoomed = chirp_z(x, np.arange(100, 120) * 1.0, 1000.0)
    >>> bool(np.allclose(zoomed, np.fft.rfft(x, axis=1)[:, 100:120]))
    True
    """
    N, count = samples.shape[1], frequencies.size
    step = (frequencies[-1] - frequencies[0]) / (count - 1) / sampling_rate if count > 1 else 0.0
    k = np.arange(max(N, count))
    chirp = np.exp(-2j * np.pi * _turns(k * k, step / 2, 2 * N))
    start = np.exp(-2j * np.pi * _turns(k[:N], frequencies[0] / sampling_rate, N))
    length = fft.next_fast_len(N + count - 1)
    kernel = np.zeros(length, dtype=complex)
    kernel[:count] = np.conj(chirp[:count])
    kernel[length - N + 1 :] = np.conj(chirp[1:N][::-1])
    weighted = fft.fft(samples * (start * chirp[:N])[:, None], n=length, axis=1)
    product = fft.ifft(weighted * fft.fft(kernel)[:, None], axis=1)[:, :count]
    return np.asarray(product * chirp[:count, None])


def _turns(whole: Array, part: float, grid: int) -> RealArray:
    """Return whole * part modulo 1, in integers when `part` is a multiple of 1 / grid to rounding."""
    multiple = round(part * grid)
    if abs(part * grid - multiple) < 1e-9:
        return np.asarray(whole % grid * (multiple % grid) % grid / grid)
    return np.asarray(np.mod(whole * part, 1.0))
