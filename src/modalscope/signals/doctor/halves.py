"""Hold the parts of a record against each other: what a channel follows from all others, and when, must not change.

With h the response of channel i to the others o in one half of the record, the part of its power that is not predicted in the other half,

    sum (S_ii - 2 Re h* S_io + h* S_oo h) / sum S_ii,

is about what h of that half itself leaves, wherever the loads were and however strong: ratios of channels at resonances are those of mode
shapes. A cable that breaks leaves one channel unpredicted, another structure all of them. A clock that is fast turns the spectra between
channels by the angle w D from one stretch to the next.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.numerics.checks import BoolArray, ComplexArray, RealArray
from modalscope.signals.doctor.findings import finding, thinned
from modalscope.signals.preprocess.correlation import spanning_outputs
from modalscope.signals.preprocess.spectra import Segments, cross_spectra, fast_length

#: Maximum number of outputs that predict the others; minimum independent averages a channel of these; minimum and maximum samples of a
#: segment.
_MAX_PREDICTORS, _AVERAGES, _MIN_SEGMENT, _MAX_SEGMENT = 6, 8, 32, 4096

#: A cable broke where at most the first part of a channel's power is predicted in one half, and at least the second in the other. Parts of
#: two unrelated records are below .02.
_MAX_BROKEN, _MIN_WHOLE = 0.05, 0.3

#: Two halves are of two tests where the error of either half's prediction is in the median over the channels larger by this factor in the
#: other. Under loads that change it reaches 2.3 (six parts of an ambient record of a building); two structures have 3.8 and more.
_TWO_TESTS = 3.0

#: Added to the spectra of the predictors, as a part of their mean.
_LOADING = 1e-9

#: Stretches of a run that clocks are compared in, most of them, their maximum number of samples, and the most lines and runs.
_STRETCHES, _MAX_STRETCHES, _MAX_STRETCH, _LINES, _MAX_RUNS = 48, 96, 2048, 64, 4

#: Most lines, evenly over all, on which the reference is chosen.
_REFERENCE_LINES = 128

#: Rates of clocks that are tried, and the one of equal clocks.
_RATES = np.linspace(-1e-3, 1e-3, 201)
_STILL = 100

#: Minimum gain: of incoherent lines the mean |sum|^2 / K scatters about one by .13, and is larger by .7 at the best of all rates.
_MIN_GAIN = 1.5

#: Samples whose products with waves are summed at a time: they stay in the cache.
_SAMPLES_AT_A_TIME = 1024

#: Samples at the start of parts by which they are compared first.
_FEW_SAMPLES = 64

#: Periods in the record below which power is drift; its least part of a channel's power, and the largest of the median channel's.
_DRIFT_PERIODS, _MIN_DRIFT, _MAX_USUAL_DRIFT = 10, 0.5, 0.1


def changes(signals: Signals, kind: str) -> list[Finding]:
    """Find what changes from one part of a record to another: a cable that breaks, another structure, clocks, one half repeated."""
    found = repeated(signals)
    if found or kind not in ("random", "ambient"):
        return found
    found = clocks(signals)
    if not found and (halves := _halves(signals)) is not None:
        found = _broken(signals, halves) or _two_tests(signals, halves)
    return found + drifting(signals)


def repeated(signals: Signals) -> list[Finding]:
    """Find runs, or halves of a run, that are the same sample by sample."""
    outputs, _ = signals.by_run()
    parts = list(outputs)
    names = [f"run {r + 1}" for r in range(len(parts))]
    if len(parts) == 1:
        count = signals.samples // 2
        parts, names = [outputs[0, :count], outputs[0, -count:]], ["its first half", "its second half"]
    alike: dict[bytes, list[int]] = {}  # a few samples tell most parts from each other
    for k, part in enumerate(parts):
        before = alike.setdefault(np.ascontiguousarray(part[:_FEW_SAMPLES]).tobytes(), [])
        same = [j for j in before if np.array_equal(parts[j], part)]
        if same and np.any(part != part[0]):
            return [finding("repeated", *signals.output_dofs, second=names[k], first=names[same[0]])]
        before.append(k)
    return []


class Halves(NamedTuple):
    """Parts of the power of every channel that all others do not predict, (2 halves, c): by the response of that half, of the other."""

    own: RealArray
    other: RealArray


def _channels(signals: Signals, samples: slice) -> RealArray:
    """Return some samples of outputs and inputs side by side, (R, n, c)."""
    outputs, inputs = signals.by_run()
    part = outputs[:, samples]
    return part if inputs is None else np.concatenate([part, inputs[:, samples]], axis=2)


def _halves(signals: Signals) -> Halves | None:
    """Return what is not predicted in the halves of a record; None where it is too short, or a channel is at rest in one."""
    outputs, half = len(signals.output_dofs), signals.samples // 2
    channels = outputs + len(signals.input_dofs)
    predictors = [*spanning_outputs(thinned(signals), _MAX_PREDICTORS), *range(outputs, channels)]
    length = fast_length(min(half * signals.runs // (_AVERAGES * (len(predictors) + 1)), half, _MAX_SEGMENT))
    if channels < 2 or length < _MIN_SEGMENT:
        return None
    spectra, effective = [], 1.0
    for samples in (slice(half), slice(half, 2 * half)):
        part = _channels(signals, samples)
        found = cross_spectra(part, part[:, :, predictors], 1.0, Segments.of(half, length), centred=True)
        spectra.append(_Spectra(found.outputs[1:], found.cross[1:], found.inputs[1:]))
        effective = found.effective
    if not all(np.all(S.power.sum(axis=0) > 0) for S in spectra):
        return None
    own, other = np.ones((2, channels)), np.ones((2, channels))
    every = list(range(len(predictors)))
    alike = [i for i in range(channels) if i not in predictors]  # predicted by all, by one factorization
    each = [([i], [k for k, j in enumerate(predictors) if j != i]) for i in predictors]
    for i, o in [(alike, every), *each]:
        if not o or not i:
            continue
        responses = [_response(S, i, o) for S in spectra]
        for k, S in enumerate(spectra):
            # what chance predicts, and what the errors of a response add in the other half
            own[k, i] = _unpredicted(S, i, o, responses[k]) * effective / (effective - len(o))
            other[k, i] = _unpredicted(S, i, o, responses[1 - k]) * effective / (effective + len(o))
    return Halves(own, other)


class _Spectra(NamedTuple):
    """Powers of all channels (F, c), their cross spectra with the predictors (F, c, o), and those of the predictors (F, o, o)."""

    power: RealArray
    cross: ComplexArray
    predictors: ComplexArray


def _response(S: _Spectra, channels: list[int], others: list[int]) -> ComplexArray:
    """Return the responses h (F, c, o) of channels to some predictors, S_io S_oo^-1."""
    A = S.predictors[:, others][:, :, others]
    load = _LOADING * np.einsum("fii->f", A).real / len(others)
    A = A + load[:, None, None] * np.eye(len(others))
    cross = S.cross[:, channels][:, :, others]
    return np.asarray(np.linalg.solve(A.transpose(0, 2, 1), cross.transpose(0, 2, 1)).transpose(0, 2, 1))


def _unpredicted(S: _Spectra, channels: list[int], others: list[int], h: ComplexArray) -> RealArray:
    """Return the part of the power of channels that responses to some predictors leave, (c,)."""
    cross = np.sum(h.conj() * S.cross[:, channels][:, :, others], axis=2).real
    predicted = np.sum((h @ S.predictors[:, others][:, :, others]) * h.conj(), axis=2).real
    power = S.power[:, channels]
    return np.asarray(np.sum(power - 2 * cross + predicted, axis=0) / np.sum(power, axis=0))


def _broken(signals: Signals, halves: Halves) -> list[Finding]:
    """Find channels that all others predict in one half of a record, and not at all in the other."""
    parts = 1 - halves.own
    low, high = parts.min(axis=0), parts.max(axis=0)
    broken = (low < _MAX_BROKEN) & (high > _MIN_WHOLE)
    dofs = (*signals.output_dofs, *signals.input_dofs)
    return [
        finding("changed: channel", dofs[i], first=100 * max(parts[0, i], 0.0), second=100 * max(parts[1, i], 0.0))
        for i in np.flatnonzero(broken)
    ]


def _two_tests(signals: Signals, halves: Halves) -> list[Finding]:
    """Find records whose halves do not predict each other."""
    factor = float(np.min(np.median(halves.other / np.maximum(halves.own, np.finfo(float).tiny), axis=1)))
    return [finding("changed: all", *signals.output_dofs, factor=factor)] if factor > _TWO_TESTS else []


def clocks(signals: Signals) -> list[Finding]:
    """Find channels whose delay against most others grows over the record: recorders with clocks of their own.

    u_k are the spectra between a channel and the reference in stretch k over their magnitudes. Where the delay grows at a rate r,
    u_k exp(j w r k L) has the same phase in all stretches of L samples: r maximizes the mean over lines of
    |sum_k u_k exp(j w r k L) / K|^2.
    """
    dofs = (*signals.output_dofs, *signals.input_dofs)
    rate, gain, agrees = _rates(signals)
    drifts = (gain > _MIN_GAIN) & agrees & (rate != 0)
    if 2 * np.sum(drifts) > len(dofs):  # the reference is one of the few
        drifts, rate = ~drifts, rate - np.median(rate[drifts])
    return [
        finding("clock", dofs[i], rate=1e6 * abs(rate[i]), side="slow" if rate[i] > 0 else "fast")
        for i in np.flatnonzero(drifts)
    ]


def _rates(signals: Signals) -> tuple[RealArray, RealArray, BoolArray]:
    """Return the rate of every channel's delay (c,), the gain by it, and whether both halves of the record gain."""
    length = fast_length(min(signals.samples // _STRETCHES, _MAX_STRETCH))
    runs = min(signals.runs, _MAX_RUNS)
    channels = len(signals.output_dofs) + len(signals.input_dofs)
    if channels < 2 or length < _MIN_SEGMENT:
        return np.zeros(channels), np.zeros(channels), np.zeros(channels, dtype=bool)
    count = min(signals.samples // length, _MAX_STRETCHES)
    starts = length * np.round(np.linspace(0, signals.samples // length - 1, count)).astype(int)
    window = np.hanning(length)[:, None]
    X = np.empty((channels, runs, count, (length - 1) // 2), dtype=complex)  # a channel after the other
    for k, s in enumerate(starts):
        part = _channels(signals, slice(s, s + length))[:runs]
        X[:, :, k] = fft.rfft(part * window, axis=1)[:, 1 : 1 + X.shape[3]].transpose(2, 0, 1)
    for own in X:
        own /= np.sqrt(np.maximum(np.mean(np.abs(own) ** 2, axis=(0, 1)), np.finfo(float).tiny))
    reference = _most_coherent(X)
    rate, gain, agrees = np.zeros(channels), np.zeros(channels), np.zeros(channels, dtype=bool)
    for i in range(channels):
        u = X[i] * X[reference].conj()
        u /= np.maximum(np.abs(u), np.finfo(float).tiny)
        # lines on which the phase is steady from stretch to stretch, at any rate
        steady = np.abs(np.sum(u[:, 1:] * u[:, :-1].conj(), axis=(0, 1)))
        lines = np.sort(np.argsort(steady, kind="stable")[-_LINES:])
        w = 2 * np.pi * (lines + 1) / length
        z = np.exp(1j * w[:, None] * starts * (_RATES[_STILL + 1] - _RATES[_STILL]))
        of_lines, middle = u[:, :, lines].transpose(2, 0, 1), count // 2
        sums = [_at_all_rates(of_lines[:, :, part], z[:, part]) for part in (slice(middle), slice(middle, None))]
        whole, first, second = (
            np.mean(np.abs(total) ** 2, axis=(0, 1)) / stretches
            for total, stretches in ((sums[0] + sums[1], count), (sums[0], middle), (sums[1], count - middle))
        )
        best = int(np.argmax(whole))
        rate[i], gain[i] = _RATES[best], whole[best] - whole[_STILL]
        agrees[i] = min(first[best] - first[_STILL], second[best] - second[_STILL]) > 0
    return rate, gain, agrees


def _at_all_rates(u: ComplexArray, z: ComplexArray) -> ComplexArray:
    """Return sum_k u_k z_k^q of spectra u (F, R, K) at all rates q, those below zero, zero and above, (F, R, 2 Q + 1).

    `z` (F, K), of absolute value one: z^-q is the conjugate of z^q, which is z^i z^(10 j) with i = 1 ... 10.
    """
    lines, _, count = u.shape
    first = np.cumprod(np.broadcast_to(z[:, :, None], (lines, count, 10)), axis=2)
    tens = np.ones((lines, _STILL // 10, count), dtype=complex)
    np.cumprod(np.broadcast_to(first[:, None, :, -1], tens[:, 1:].shape), axis=1, out=tens[:, 1:])
    sides = np.concatenate([u, u.conj()], axis=1)[:, :, None] * tens[:, None]  # (F, 2 R, Q / 10, K)
    sums = (sides.reshape(lines, -1, count) @ first).reshape(lines, -1, _STILL)
    above, mirrored = np.split(sums, 2, axis=1)
    return np.concatenate([mirrored[:, :, ::-1].conj(), u.sum(axis=2, keepdims=True), above], axis=2)


def _most_coherent(X: ComplexArray) -> int:
    """Return the channel whose spectra with all others, averaged over runs and stretches, are largest in sum over the lines.

    `X` (c, R, K, F).
    """
    X = X[..., :: -(-X.shape[3] // _REFERENCE_LINES)]
    total, count = np.zeros(len(X)), X.shape[3]
    for first in range(0, count, _LINES):
        of_lines = np.ascontiguousarray(
            X[..., first : first + _LINES].reshape(len(X), -1, min(_LINES, count - first)).transpose(2, 0, 1)
        )
        total += np.abs(of_lines.conj() @ of_lines.swapaxes(1, 2)).sum(axis=(0, 1))
    return int(np.argmax(total))


def drifting(signals: Signals) -> list[Finding]:
    """Find outputs with most of their power in drift, while the others have little."""
    outputs, _ = signals.by_run()
    share = _drift_of(outputs)
    usual = float(np.median(share))
    if usual > _MAX_USUAL_DRIFT or outputs.shape[2] < 2:
        return []
    limit = _DRIFT_PERIODS / signals.duration
    return [
        finding("drift", dof, percent=100 * part, limit=limit, usual=100 * usual)
        for dof, part in zip(signals.output_dofs, share, strict=True)
        if part > _MIN_DRIFT
    ]


def _drift_of(runs: RealArray) -> RealArray:
    """Return the part of the power of channels (R, N, l) that lies below ten periods in the record.

    The few lines of the transform are products with their waves, and the power of all of them follows from the samples (Parseval).
    """
    samples, l = runs.shape[1:]
    w = 2 * np.pi / samples * np.arange(1, _DRIFT_PERIODS + 1)
    phase = np.outer(w, np.arange(_SAMPLES_AT_A_TIME))
    waves = np.concatenate([np.cos(phase), -np.sin(phase)])
    low, power = np.zeros(l), np.zeros(l)
    for run in runs:
        mean, lines = run.mean(axis=0), np.zeros((_DRIFT_PERIODS, l), dtype=complex)
        for start in range(0, samples, _SAMPLES_AT_A_TIME):
            y = run[start : start + _SAMPLES_AT_A_TIME] - mean
            real, imaginary = np.split(waves[:, : len(y)] @ y, 2)
            lines += np.exp(-1j * w * start)[:, None] * (real + 1j * imaginary)
            power += np.einsum("nl,nl->l", y, y)
        low += np.sum(lines.real**2 + lines.imag**2, axis=0)
    return np.asarray(low / np.maximum(samples / 2 * power, np.finfo(float).tiny))
