"""Faults of time between channels: what is called input follows the output, and channels that come later than the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding
from modalscope.preprocess.references import spanning_outputs
from modalscope.preprocess.spectra import Segments, cross_spectra, segment_starts, window_samples

__all__ = ["delayed", "exchanged"]

#: Samples of a run, and runs, that are looked at.
_SAMPLES, _RUNS = 1 << 16, 4

#: A cause comes first: its correlation with what follows has less energy on the wrong side of lag 0 than on the right one, whatever its
#: spectrum. So many times more is no accident.
_BEFORE = 4.0

#: What chance adds to both sides is known to this part: it is taken off, and so much more must be there.
_FLOOR = 1.0

#: Correlations are believed when the largest exceeds this many deviations of what independent records show.
_SURE = 8.0

#: Segments of the spectra between outputs, and the least whose phases say something.
_SEGMENTS, _LEAST = 16, 64

#: With the delay taken out, phases lie on the real axis to this share, and the rest is at most this part of what it was without.
_REAL, _BETTER = 0.85, 0.4

#: Weights must spread over frequencies by this part of their mean: one mode alone says nothing of a delay. Delays are told to 1 / 32
#: of a sample.
_WIDE, _FINE = 0.1, 16

#: A delay of less than this angle at the mean frequency is none, rad; nor one that two halves of the record, or of the band, do not
#: agree about.
_ANGLE, _AGREE = 0.1, 0.25


def exchanged(signals: Signals) -> list[Finding]:
    """Find outputs that come before the inputs: what is called the force is a response, and the other way round.

    y = h * u with a causal h makes sum_(k > 0) R_yu(k)^2 the larger side, R_yu(k) = mean of y(t + k) u(t).
    """
    outputs, inputs = signals.by_run()
    if inputs is None or signals.samples < 4 * _LEAST:
        return []
    y, u = (x[:_RUNS, :_SAMPLES] - x[:_RUNS, :_SAMPLES].mean(axis=1, keepdims=True) for x in (outputs, inputs))
    lags = y.shape[1] // 8
    length = fft.next_fast_len(2 * y.shape[1], real=True)
    Y, U = fft.rfft(y, n=length, axis=1), fft.rfft(u, n=length, axis=1)
    early: list[tuple[str, str]] = []
    for j, force in enumerate(signals.input_dofs):
        R = fft.irfft(np.sum(Y * np.conj(U[:, :, j : j + 1]), axis=0), n=length, axis=0)
        size = np.sqrt(np.sum(y**2, axis=(0, 1)) * np.sum(u[:, :, j] ** 2))
        after, before = (np.sum(side**2, axis=0) for side in (R[1 : lags + 1], R[-lags:]))
        # independent records show products of the size of |y| |u| / sqrt(N), times what their own correlation widens that by
        chance = np.maximum(size, 1e-300) * _spread(Y, U[:, :, j], length, y)
        certain = np.abs(R).max(axis=0) > _SURE * chance
        # what chance adds to either side, and twice its deviation: neighbouring lags share it
        floor = lags * chance**2
        early += [
            (dof, force)
            for i, dof in enumerate(signals.output_dofs)
            if certain[i] and before[i] - floor[i] > _BEFORE * max(after[i] - floor[i], 0.0) + _FLOOR * floor[i]
        ]
    return [] if not early else [_exchange(early)]


def _spread(Y: ComplexArray, U: ComplexArray, length: int, y: RealArray) -> RealArray:
    """Return the deviation of correlation coefficients of independent records with these spectra: sqrt(sum_k r_y(k) r_u(k) / N)."""
    N = y.shape[0] * y.shape[1]
    own = fft.irfft(np.sum(np.abs(Y) ** 2, axis=0), n=length, axis=0)
    other = fft.irfft(np.sum(np.abs(U) ** 2, axis=0), n=length)
    scale = np.maximum(own[0] * other[0], 1e-300)
    return np.asarray(np.sqrt(np.maximum(own.T @ other / scale, 1.0) / N))


def _exchange(early: list[tuple[str, str]]) -> Finding:
    outputs, inputs = (tuple(dict.fromkeys(pair[side] for pair in early)) for side in (0, 1))
    return Finding(
        "exchanged",
        (*outputs, *(dof for dof in inputs if dof not in outputs)),
        f"the output {', '.join(outputs)} comes before the input {', '.join(inputs)}: a cause does not follow its effect",
        "Exchange them: the force belongs to the inputs, columns='in=...,out=...'.",
    )


def delayed(signals: Signals) -> list[Finding]:
    """Find outputs that come later, or earlier, than the others: filters, converters in turn, recorders that started apart.

    Spectra between outputs of a structure with real modes lie on the real axis, S_ij / |S_ij| = +-1; a delay T turns them by
    exp(-j w T). T maximizes sum c_ij^2 (S_ij / |S_ij|)^2 exp(2 j w T), c the coherence: the square does not see the signs.
    """
    outputs, _ = signals.by_run()
    length = min(signals.runs * signals.samples // (_SEGMENTS // 2), signals.samples, 4096)
    if outputs.shape[2] < 3 or length < _LEAST or len(set(signals.quantities)) > 1:
        return []
    y = outputs[:, :_SAMPLES] - outputs[:, :_SAMPLES].mean(axis=1, keepdims=True)
    halves = (y[:, : y.shape[1] // 2], y[:, y.shape[1] // 2 :])
    length = min(length, halves[0].shape[1])
    candidates = spanning_outputs(signals)
    whole, first, second = (_delays(half, length, candidates) for half in (y, *halves))
    found = []
    for i, dof in enumerate(signals.output_dofs):
        apart = abs(first.delay[i] - second.delay[i])
        if not whole.better[i] or apart > _AGREE * abs(whole.delay[i]) or abs(whole.delay[i]) * whole.omega[i] < _ANGLE:
            continue
        seconds, side = whole.delay[i] / signals.sampling_rate, "later" if whole.delay[i] > 0 else "earlier"
        found.append(
            Finding(
                "delay",
                (dof,),
                f"it comes {abs(seconds):.4g} s, {abs(whole.delay[i]):.3g} samples, {side} than most other outputs",
                f"Look for another filter or recorder; shift it back by {seconds:.4g} s, or leave it out: exclude={[dof]!r}.",
            )
        )
    return found if 2 * len(found) < len(signals.output_dofs) else []


class _Delays(NamedTuple):
    """Delay of every output against most others, in samples; mean circular frequency, rad a sample; whether it explains the phases."""

    delay: RealArray
    omega: RealArray
    better: Array


def _delays(y: RealArray, length: int, candidates: Sequence[int]) -> _Delays:
    """Return the delays of records (R, N, l) from segments of a length, against the candidate that most others agree with."""
    w, some = window_samples("hann", length), list(candidates)
    spectra = cross_spectra(y, y[:, :, some], 1.0, Segments(segment_starts(y.shape[1], length, 0.5), w, w))
    S, power = spectra.cross, np.maximum(spectra.output_powers, 1e-300)
    coherence = np.abs(S) ** 2 / (power[:, :, None] * power[:, None, some])
    liked = int(np.argmax(coherence.sum(axis=(0, 1))))
    reference = some[liked]
    pair, weight = S[1:, :, liked], coherence[1:, :, liked] ** 2
    weight = weight / np.maximum(weight.sum(axis=0), 1e-300)
    omega = 2 * np.pi * np.arange(1, len(S)) / length
    mean = omega @ weight
    wide = np.sqrt(np.maximum(omega**2 @ weight - mean**2, 0)) > _WIDE * mean
    squared = (pair / np.maximum(np.abs(pair), 1e-300)) ** 2 * weight
    # scores on a grid of delays, half a sample over _FINE apart: their transform
    count = _FINE * length
    score = fft.ifft(np.concatenate([np.zeros((1, y.shape[2])), squared]), n=count, axis=0).real * count
    shifts = np.arange(count)
    steps = np.where(shifts > count // 2, shifts - count, shifts) / (2 * _FINE)
    best = np.argmax(np.where((np.abs(steps) <= length / 8)[:, None], score, -np.inf), axis=0)
    top = score[best, np.arange(y.shape[2])]
    delay = steps[best] - np.median(steps[best])
    turned = squared * np.exp(2j * omega[:, None] * steps[best])
    low = np.cumsum(weight, axis=0) < 0.5
    # what is linear in frequency is right in both halves of the band; the lag of a damper is not
    straight = np.ones(len(best), dtype=bool)
    for half in (low, ~low):
        left = np.angle(np.sum(turned * half, axis=0)) / 2
        straight &= np.abs(left) < _AGREE * np.abs(steps[best]) * np.sum(omega[:, None] * weight * half, axis=0) / 0.5
    explained = (top > _REAL) & (1 - top < _BETTER * (1 - score[0])) & wide & straight
    # what dampers turn everywhere is no delay of one
    explained &= float(np.median(np.delete(top, reference))) > _REAL
    explained[reference] = 2 * explained.sum() > len(explained) - 1
    return _Delays(delay, mean, explained)
