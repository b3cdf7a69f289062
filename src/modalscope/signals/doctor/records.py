"""Check records: clipped and noisy channels, overloaded and double hits, leakage, short records, events."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import fft

from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.data.shown import percent
from modalscope.numerics.checks import Array, RealArray
from modalscope.signals.doctor.findings import channels_of, finding
from modalscope.signals.preprocess.after_hits import MAX_REMAINING, remaining
from modalscope.signals.preprocess.excitation import EVENT, powers_of_stretches
from modalscope.signals.preprocess.harmonics import MIN_DAMPING, find_lines
from modalscope.signals.preprocess.impacts import Hit, clipped_samples, find_hits
from modalscope.signals.preprocess.spectra import Segments, cross_spectra, fast_length

#: Maximum part of the power of a noisy channel that the inputs predict; and its minimum distance from the median of the channels.
_MAX_PREDICTED, _MIN_BELOW_MEDIAN = 0.5, 0.25

#: The same part when only the other outputs predict: they do not show the response of a damped mass to its own force.
_MAX_PREDICTED_BY_OUTPUTS = 0.08

#: The force of a hit was cut when its outputs are this much larger than the other hits predict from it, and by so many standard
#: deviations of the other hits.
_MIN_CUT, _CUT_DEVIATIONS = 0.01, 20.0

#: Minimum part of a noisy channel that no other sample explains, and its ratio to the median. Noise of half the amplitude of a channel has
#: a fifth of its power. In the structures of the study, parts due to forces on a channel's own mass differ by a factor of three.
_MIN_UNEXPLAINED, _UNEXPLAINED_RATIO = 0.15, 5.0

#: A harmonic and its leakage under a window lie within this part of its frequency.
_HARMONIC_WIDTH = 0.01

#: A random record shorter than this many times 1 / (zeta omega) determines the damping poorly.
_TIME_CONSTANTS = 4.0

#: Fewer periods in a record than this are drift: a resonance of 2 % has then decayed once.
_MIN_PERIODS = 10.0

#: Samples of a run by which the channel of the strongest resonance is chosen: every second, third ... one of a longer run.
_PEAKEDNESS_SAMPLES = 1 << 13

#: A stretch belongs to an event where its power exceeds the median of all by this factor.
_EVENT_POWER = 4.0


def clipped(signals: Signals, kind: str) -> list[Finding]:
    """Find channels clipped at their extremes; the force of a hammer is checked hit by hit instead."""
    findings = []
    for dof, records in channels_of(signals, inputs=kind != "impact"):
        counts = [clipped_samples(run) for run in records]
        if any(counts):
            runs = [str(r + 1) for r, count in enumerate(counts) if count]
            where = f" in run {', '.join(runs)}" if signals.runs > 1 else ""
            findings.append(finding("clipped", dof, count=sum(counts), where=where))
    return findings


def transposed(signals: Signals) -> list[Finding]:
    """Find records of more channels than samples: rows taken for columns."""
    count = len(signals.output_dofs) + len(signals.input_dofs)
    if count <= signals.samples:
        return []
    return [finding("transposed", signals.output_dofs[0], count=count, samples=signals.samples)]


def bad_hits(signals: Signals) -> list[Finding]:
    """Find overloaded and double hits."""
    _, inputs = signals.by_run()
    assert inputs is not None
    if inputs.shape[2] != 1:
        return []
    hits = _cut_hits(signals, find_hits(inputs[:, :, 0]))
    findings = []
    for hit in (hit for hit in hits if hit.reason):
        others = [h.number for h in hits if h.number != hit.number and not h.unfit]
        measured: dict[str, Any] = {"number": hit.number, "others": others}
        measured["reason"] = hit.reason.removeprefix("overloaded: ").removeprefix("double hit: ")  # as the kind says
        findings.append(finding("overload" if hit.unfit else "double hit", *signals.input_dofs, **measured))
    return findings


def _cut_hits(signals: Signals, hits: list[Hit]) -> list[Hit]:
    """Mark the hit whose outputs are larger than the other hits predict from its force.

    s_k = sum Re(conj(G_k) Y_k) / sum |G_k|^2 is one, with Y_k the outputs' spectra in the run of hit k, and G_k the response of the
    other runs times its force. Runs of one hit each, four at least; a hit at another place, or a slanted one, has s_k > 1 too.
    """
    outputs, inputs = signals.by_run()
    assert inputs is not None
    if len(hits) < 4 or [hit.run for hit in hits] != list(range(signals.runs)) or any(hit.reason for hit in hits):
        return hits
    Y = fft.rfft(outputs - np.median(outputs, axis=1, keepdims=True), axis=1)
    U = fft.rfft(inputs - np.median(inputs, axis=1, keepdims=True), axis=1)
    cross, power = Y * np.conj(U), np.abs(U) ** 2
    size = np.empty(len(hits))
    for k in range(len(hits)):
        G = (cross.sum(axis=0) - cross[k]) / np.maximum(power.sum(axis=0) - power[k], np.finfo(float).tiny) * U[k]
        size[k] = np.sum(np.conj(G) * Y[k]).real / max(float(np.sum(np.abs(G) ** 2)), np.finfo(float).tiny)
    k = int(np.argmax(size))
    others = np.delete(size, k)
    more = float(size[k] / others.mean() - 1)
    # hit k is in the mean from which the others are predicted, alike for all
    if more < max(_MIN_CUT, _CUT_DEVIATIONS * float(np.std(others, ddof=1))):
        return hits
    reason = f"outputs {percent(more, 2)} larger relative to its force than in the other hits: force clipped, or another place"
    return [hit._replace(reason=reason, unfit=True) if hit is hits[k] else hit for hit in hits]


def leakage(signals: Signals, kind: str) -> list[Finding]:
    """Find outputs that still vibrate at the end of what is transformed as a whole: runs, or hits as they are cut."""
    parts, samples = remaining(signals, kind)
    cut = kind == "impact" and samples < signals.samples
    what, longer = ("hit", "Wait longer for the next hit") if cut else ("run", "Measure longer runs")
    return [
        finding("leakage", dof, percent=100 * part, what=what, longer=longer)
        for dof, part in zip(signals.output_dofs, parts, strict=True)
        if part > MAX_REMAINING
    ]


def noisy_channels(signals: Signals, part: RealArray | None, noise: RealArray) -> list[Finding]:
    """Compare how much of every output's power follows from the inputs, or from the other outputs when nothing was driven: `predicted`.

    `noise` (l,): the part that no other sample explains, which counts when nothing was driven.
    """
    outputs, inputs = signals.by_run()
    l = outputs.shape[2]
    if l < 3 or part is None:
        return []
    limit = _MAX_PREDICTED_BY_OUTPUTS if inputs is None else _MAX_PREDICTED
    usual = float(np.median(part))
    source = "the other outputs" if inputs is None else "the inputs"
    findings = {
        dof: finding("noisy: coherence", dof, percent=100 * share, source=source, usual=100 * usual)
        for dof, share in zip(signals.output_dofs, part, strict=True)
        if share < limit and share < usual - _MIN_BELOW_MEDIAN
    }
    noise = noise if inputs is None else np.zeros(l)
    usual = float(np.median(noise))
    for dof, share in zip(signals.output_dofs, noise, strict=True):
        if share > max(_MIN_UNEXPLAINED, _UNEXPLAINED_RATIO * usual):
            findings.setdefault(dof, finding("noisy: unexplained", dof, percent=100 * share, usual=100 * usual))
    return list(findings.values())


def predicted(signals: Signals) -> RealArray | None:
    """Return the part of every output's power that follows from the inputs, or from the other outputs without any; None if too short."""
    (outputs, inputs), rate = signals.by_run(), signals.sampling_rate
    runs, samples, l = outputs.shape
    others = l - 1 if inputs is None else inputs.shape[2]
    averages = 8 if inputs is None else 4  # few inputs need few averages, and short segments leak
    length = fast_length(min(samples, runs * samples // (averages * (others + 1))))
    if length < 32 or (inputs is None and l < 3):
        return None
    spectra = cross_spectra(outputs, inputs, rate, Segments.of(samples, length), whole=inputs is None, centred=True)
    if inputs is None:
        explained = _from_others(spectra.outputs)
    else:
        rows = spectra.cross @ np.linalg.pinv(spectra.inputs, rcond=1e-12, hermitian=True)  # inputs may be alike
        explained = np.sum(rows * np.conj(spectra.cross), axis=2).real
    part = explained.sum(axis=0) / spectra.output_powers.sum(axis=0)
    # without the coherence of independent channels from a finite number of averages
    return np.asarray(1 - (1 - part) * spectra.effective / (spectra.effective - others))


def _from_others(S: Array) -> RealArray:
    """Return the power of every output that all others explain, (F, l): S_ii - 1 / (S^-1)_ii."""
    root = np.sqrt(np.maximum(np.einsum("fii->fi", S).real, np.finfo(float).tiny))
    scaled = S / (root[:, :, None] * root[:, None, :])
    # identical channels explain each other fully: the small term keeps the inverse finite
    inverse = np.linalg.inv(scaled + 1e-12 * np.eye(S.shape[1]))
    rest = 1 / np.maximum(np.einsum("fii->fi", inverse).real, 1.0)
    return np.asarray((1 - rest) * root**2)


def too_short(signals: Signals) -> list[Finding]:
    """Find a record too short for the decay of its strongest resonance, estimated from its correlation; harmonics are excluded."""
    outputs, _ = signals.by_run()
    i = int(np.argmax(_peakedness(outputs[:, :: max(signals.samples // _PEAKEDNESS_SAMPLES, 1)])))
    y = outputs[:, :, i] - outputs[:, :, i].mean(axis=1, keepdims=True)
    length = fft.next_fast_len(2 * signals.samples, real=True)
    power = np.mean(np.abs(fft.rfft(y, n=length, axis=1)) ** 2, axis=0)
    lines = fft.rfftfreq(length, 1 / signals.sampling_rate)
    slowest = _slowest(signals, power, lines)
    if slowest is not None:  # only here, as it takes longer than all the rest
        for line in find_lines(signals.select(outputs=[i])):
            power[np.abs(lines - line.frequency) < _HARMONIC_WIDTH * line.frequency] = 0
        slowest = _slowest(signals, power, lines)
    # what is narrower than any resonance is a machine, however its strength wanders
    if slowest is None or 2 * np.pi * slowest[0] * slowest[1] > 1 / MIN_DAMPING:
        return []
    f0, constant = slowest
    seconds = signals.runs * signals.duration
    damping, count = 100 / (2 * np.pi * f0 * constant), seconds / constant
    measured: dict[str, Any] = {"seconds": seconds, "count": count, "frequency": f0, "damping": damping}
    measured |= {"scatter": 100 / np.sqrt(count), "needed": 100 * constant}
    return [finding("short record: decay", signals.output_dofs[i], at=(f0,), **measured)]


def _peakedness(runs: RealArray) -> RealArray:
    """Return the mean squares of channels (R, N, l) over the median ones."""
    squares = (runs - runs.mean(axis=1, keepdims=True)) ** 2
    return np.asarray(squares.mean(axis=(0, 1)) / np.maximum(np.median(squares, axis=(0, 1)), np.finfo(float).tiny))


def _slowest(signals: Signals, power: RealArray, lines: RealArray) -> tuple[float, float] | None:
    """Return frequency (Hz) and decay time (s) of the strongest resonance where the record is short for it."""
    smooth = np.convolve(power, np.ones(17) / 17)[8:-8]
    first = int(np.searchsorted(lines, _MIN_PERIODS / signals.duration))
    if first >= smooth.size:  # a record of a few samples
        return None
    top = first + int(np.argmax(smooth[first:]))
    f0 = float(lines[top])
    if top == first or smooth[top] < 20 * float(np.median(smooth)):  # at the first line: drift
        return None
    constant = _decay_time(signals, power, lines, f0)
    return (f0, constant) if signals.runs * signals.duration < _TIME_CONSTANTS * constant else None


def _decay_time(signals: Signals, power: RealArray, lines: RealArray, f0: float) -> float:
    """Return the time in s in which the correlation of the resonance at f0 Hz falls by e, from the power on lines."""
    # a Gaussian band around the peak, wide against any light damping, isolates the correlation of that resonance
    band = np.exp(-0.5 * ((lines - f0) / (0.05 * f0 + 4 / signals.duration)) ** 2)
    spectrum = np.zeros(fft.next_fast_len(2 * signals.samples, real=True), dtype=complex)
    spectrum[: lines.size] = power * band
    envelope = np.abs(fft.ifft(spectrum))[: signals.samples // 2]
    # half an e-fold: further down the correlation of a short record is scatter
    below = np.flatnonzero(envelope < envelope[0] * np.exp(-0.5))
    return 2 * float(below[0] if below.size else envelope.size) / signals.sampling_rate


def events(signals: Signals) -> list[Finding]:
    """Find an earthquake, a blow or a passage that dominates a record without inputs, of one run (see `powers_of_stretches`)."""
    outputs, inputs = signals.by_run()
    if inputs is not None or len(outputs) != 1:
        return []
    powers = powers_of_stretches(outputs[0])
    variation = float(np.var(powers))
    if variation <= EVENT:
        return []
    largest = int(np.argmax(powers))
    quiet = np.flatnonzero(powers <= _EVENT_POWER * np.median(powers))
    first = int(np.max(quiet[quiet < largest], initial=-1)) + 1
    last = int(np.min(quiet[quiet > largest], initial=len(powers)))
    size = signals.samples // len(powers)
    seconds, row = size / signals.sampling_rate, size * largest + 1
    worth = signals.samples / signals.sampling_rate / (1 + variation)
    release = f" from its release on (--rows {row}-)" if largest else ""
    share = 100 * float(powers[first:last].sum() / powers.sum())
    measured: dict[str, Any] = {"share": share, "worth": worth, "release": release}
    return [finding("event", *signals.output_dofs, start=first * seconds, stop=last * seconds, **measured)]
