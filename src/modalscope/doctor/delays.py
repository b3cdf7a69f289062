"""Find and correct delays between channels: outputs that come late after the forces or before them, channels that lag behind the others.

Each sample of delay needs a state of the model, which shows as a spurious mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.data.notes import Finding, Note
from modalscope.data.records import Records, Signals
from modalscope.doctor.findings import finding
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.preprocess.correlation import spanning_outputs
from modalscope.preprocess.excitation import find_excitation
from modalscope.preprocess.spectra import Segments, cross_spectra

# ------------------------------------------------------------------------------------------ outputs late after the forces
# Their impulse responses begin with a jump, and after the same lag.

#: Samples of a run, and runs, that are examined.
_SAMPLES, _RUNS = 1 << 16, 4

#: Segments that impulse responses are averaged over, and their least and greatest length.
_SEGMENTS, _SHORTEST, _LONGEST = 12, 128, 2048

#: Power of the forces on a line below this part of the greatest is raised to it.
_QUIET = 1e-3

#: A response has begun where it exceeds so many standard deviations of its values before lag 0 (of all outputs together chance is level,
#: and fewer are enough), and this part of its greatest value.
_BEGUN, _TOGETHER, _PART = 6.0, 3.0, 0.2

#: It began with a jump where its values more than two lags before are so many times smaller: motion that grows from rest does not jump.
_JUMP = 4.0

#: Fewer samples are poles at z = 0, which the identification recognizes; in single outputs motion far from the forces may grow so long.
_LEAST, _LEAST_ALONE = 5, 10


class Lateness(NamedTuple):
    """Samples by which outputs, all `together` or some, come late after the forces; empty where none does."""

    together: bool
    samples: dict[str, int]


def late(signals: Signals) -> list[Finding]:
    """Find outputs that come late after broadband forces, see `lateness`."""
    found, rate = lateness(signals), signals.sampling_rate
    if found.together:
        lag = next(iter(found.samples.values()))
        return [finding("delay: all", *signals.output_dofs, samples=lag, seconds=lag / rate)]
    return [finding("delay: one", dof, samples=lag, seconds=lag / rate) for dof, lag in found.samples.items()]


def lateness(signals: Signals) -> Lateness:
    """Return by how many samples the responses of outputs to broadband forces begin late.

    The impulse response of acceleration begins with the direct term at lag 0, that of velocity with the shapes at lag 1; that of
    displacement grows from zero and shows no delay. Recorders that started apart, and buffers, shift it.
    """
    outputs, inputs = signals.by_run()
    length = min(signals.samples // (_SEGMENTS // 2 + 1), _LONGEST)
    if inputs is None or length < _SHORTEST:
        return Lateness(False, {})
    y, u = _examined(outputs), _examined(inputs)
    size = _responses(y, u, length)
    together = np.sqrt(np.mean((size / np.maximum(size.max(axis=0), 1e-300)) ** 2, axis=1))
    lag = _onset(together, _TOGETHER)
    if lag >= _LEAST:
        return Lateness(True, dict.fromkeys(signals.output_dofs, lag))
    if lag < 0:
        return Lateness(False, {})
    alone = {dof: _onset(own, _BEGUN) for dof, own in zip(signals.output_dofs, size.T, strict=True)}
    return Lateness(False, {dof: own for dof, own in alone.items() if own >= _LEAST_ALONE})


def _examined(x: RealArray) -> RealArray:
    """Return the first samples of the first runs without their means."""
    x = x[:_RUNS, :_SAMPLES]
    return np.asarray(x - x.mean(axis=1, keepdims=True))


def _responses(outputs: RealArray, inputs: RealArray, length: int) -> RealArray:
    """Return the size of the impulse response of every output to all forces, (length, l), negative lags last."""
    level = inputs / np.maximum(np.sqrt(np.mean(inputs**2, axis=(0, 1))), 1e-300)
    S = cross_spectra(outputs, level, 1.0, Segments.of(outputs.shape[1], length))
    power = np.einsum("fii->f", S.inputs).real
    regularization = _QUIET * power.max() * np.eye(S.inputs.shape[1])
    H = np.linalg.solve((S.inputs + regularization).transpose(0, 2, 1), S.cross.transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray(np.linalg.norm(fft.irfft(H, n=length, axis=0), axis=2))


def _onset(size: RealArray, begun: float) -> int:
    """Return the lag at which a response begins with a jump; -1 where it does not, or does not exceed chance."""
    length = len(size)
    after, chance = size[: length // 4], np.sqrt(np.mean(size[-length // 4 : -length // 16] ** 2))
    above = np.flatnonzero(after > max(begun * chance, _PART * after.max()))
    if not above.size:
        return -1
    first = int(above[0])
    earlier = np.concatenate([size[-8:], after[: max(first - 2, 0)]])
    if after[first : first + 2].max() <= _JUMP * earlier.max():
        return -1
    begun_at = np.flatnonzero(after[max(first - 2, 0) : first + 1] > begun * chance)
    return max(first - 2, 0) + int(begun_at[0])


# --------------------------------------------------------------------------------------------- causality, and delays by phase

#: The correlation of a cause with its effect has less energy on the wrong side of lag 0 than on the right one, whatever its spectrum. A
#: ratio above this is significant.
_BEFORE = 4.0

#: What chance adds to both sides is known to this part: it is subtracted, and so much more must remain.
_FLOOR = 1.0

#: Correlations are used when the largest exceeds this many standard deviations of independent records.
_SURE = 8.0

#: Segments of the spectra between outputs, and their least length.
_CAUSAL_SEGMENTS, _CAUSAL_LEAST = 16, 64

#: Without the delay, phases lie on the real axis to this share, and the rest is at most this part of what it was with it.
_REAL, _BETTER = 0.85, 0.4

#: Weights must spread over frequencies by this part of their mean: one mode alone determines no delay. Delays are resolved to 1 / 32 of
#: a sample.
_WIDE, _FINE = 0.1, 16

#: A delay of less than this angle at the mean frequency (rad) is none; nor one on which the two halves of the record, or of the band,
#: disagree by this part.
_ANGLE, _AGREE = 0.1, 0.25


def exchanged(signals: Signals) -> list[Finding]:
    """Find outputs that come before the inputs: force and response are exchanged.

    y = h * u with a causal h makes sum_(k > 0) R_yu(k)^2 the larger side, R_yu(k) = mean of y(t + k) u(t).
    """
    outputs, inputs = signals.by_run()
    if inputs is None or signals.samples < 4 * _CAUSAL_LEAST:
        return []
    y, u = _examined(outputs), _examined(inputs)
    lags = y.shape[1] // 8
    length = fft.next_fast_len(2 * y.shape[1], real=True)
    Y, U = fft.rfft(y, n=length, axis=1), fft.rfft(u, n=length, axis=1)
    early: list[tuple[str, str]] = []
    for j, force in enumerate(signals.input_dofs):
        R = fft.irfft(np.sum(Y * np.conj(U[:, :, j : j + 1]), axis=0), n=length, axis=0)
        size = np.sqrt(np.sum(y**2, axis=(0, 1)) * np.sum(u[:, :, j] ** 2))
        after, before = (np.sum(side**2, axis=0) for side in (R[1 : lags + 1], R[-lags:]))
        # the correlation of independent records: |y| |u| / sqrt(N), times a factor for their own autocorrelations
        chance = np.maximum(size, 1e-300) * _spread(Y, U[:, :, j], length, y)
        certain = np.abs(R).max(axis=0) > _SURE * chance
        # what chance adds to either side; neighbouring lags are correlated
        floor = lags * chance**2
        early += [
            (dof, force)
            for i, dof in enumerate(signals.output_dofs)
            if certain[i] and before[i] - floor[i] > _BEFORE * max(after[i] - floor[i], 0.0) + _FLOOR * floor[i]
        ]
    if not early:
        return []
    output_names, input_names = (tuple(dict.fromkeys(pair[side] for pair in early)) for side in (0, 1))
    dofs = dict.fromkeys((*output_names, *input_names))
    return [finding("exchanged", *dofs, outputs=", ".join(output_names), inputs=", ".join(input_names))]


def _spread(Y: ComplexArray, U: ComplexArray, length: int, y: RealArray) -> RealArray:
    """Return the standard deviation of correlation coefficients of independent records: sqrt(sum_k r_y(k) r_u(k) / N)."""
    N = y.shape[0] * y.shape[1]
    own = fft.irfft(np.sum(np.abs(Y) ** 2, axis=0), n=length, axis=0)
    other = fft.irfft(np.sum(np.abs(U) ** 2, axis=0), n=length)
    scale = np.maximum(own[0] * other[0], 1e-300)
    return np.asarray(np.sqrt(np.maximum(own.T @ other / scale, 1.0) / N))


def delayed(signals: Signals) -> list[Finding]:
    """Find outputs that come later or earlier than the others: filters, multiplexed converters, recorders that started apart.

    Spectra between outputs of a structure with real modes lie on the real axis, S_ij / |S_ij| = +-1; a delay T turns them by
    exp(-j w T). T maximizes sum c_ij^2 (S_ij / |S_ij|)^2 exp(2 j w T), c the coherence; the square removes the signs.
    """
    outputs, _ = signals.by_run()
    length = min(signals.runs * signals.samples // (_CAUSAL_SEGMENTS // 2), signals.samples, 4096)
    if outputs.shape[2] < 3 or length < _CAUSAL_LEAST or len(set(signals.quantities)) > 1:
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
        measured = {"seconds": seconds, "size": abs(seconds), "samples": abs(whole.delay[i]), "side": side}
        found.append(finding("delay: phase", dof, **measured))
    return found if 2 * len(found) < len(signals.output_dofs) else []


class _Delays(NamedTuple):
    """Delay of every output against most others in samples, mean angular frequency in rad a sample, and whether it explains the phases."""

    delay: RealArray
    omega: RealArray
    better: Array


def _delays(y: RealArray, length: int, candidates: Sequence[int]) -> _Delays:
    """Return the delays of records (R, N, l) from segments, against the candidate with the largest coherence with the others."""
    some = list(candidates)
    spectra = cross_spectra(y, y[:, :, some], 1.0, Segments.of(y.shape[1], length))
    S, power = spectra.cross, np.maximum(spectra.output_powers, 1e-300)
    coherence = np.abs(S) ** 2 / (power[:, :, None] * power[:, None, some])
    best_candidate = int(np.argmax(coherence.sum(axis=(0, 1))))
    reference = some[best_candidate]
    pair, weight = S[1:, :, best_candidate], coherence[1:, :, best_candidate] ** 2
    weight = weight / np.maximum(weight.sum(axis=0), 1e-300)
    omega = 2 * np.pi * np.arange(1, len(S)) / length
    mean = omega @ weight
    wide = np.sqrt(np.maximum(omega**2 @ weight - mean**2, 0)) > _WIDE * mean
    squared = (pair / np.maximum(np.abs(pair), 1e-300)) ** 2 * weight
    # scores on a grid of delays, half a sample over _FINE apart, by one transform
    count = _FINE * length
    score = fft.ifft(np.concatenate([np.zeros((1, y.shape[2])), squared]), n=count, axis=0).real * count
    shifts = np.arange(count)
    steps = np.where(shifts > count // 2, shifts - count, shifts) / (2 * _FINE)
    best = np.argmax(np.where((np.abs(steps) <= length / 8)[:, None], score, -np.inf), axis=0)
    top = score[best, np.arange(y.shape[2])]
    delay = steps[best] - np.median(steps[best])
    turned = squared * np.exp(2j * omega[:, None] * steps[best])
    low = np.cumsum(weight, axis=0) < 0.5
    # a phase linear in frequency fits both halves of the band; the lag of a damper does not
    straight = np.ones(len(best), dtype=bool)
    for half in (low, ~low):
        residual = np.angle(np.sum(turned * half, axis=0)) / 2
        straight &= (
            np.abs(residual) < _AGREE * np.abs(steps[best]) * np.sum(omega[:, None] * weight * half, axis=0) / 0.5
        )
    explained = (top > _REAL) & (1 - top < _BETTER * (1 - score[0])) & wide & straight
    # phases that dampers turn at all outputs are no delay of one
    explained &= float(np.median(np.delete(top, reference))) > _REAL
    explained[reference] = 2 * explained.sum() > len(explained) - 1
    return _Delays(delay, mean, explained)


# ---------------------------------------------------------------------------------------------------------- correction

#: The kind of the note.
DELAYS = "delays taken out"


def seen_delays(records: Records) -> dict[str, int]:
    """Return the samples by which outputs come late after random forces, where all runs agree; empty otherwise.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> run = chain5().simulate(inputs="white", samples=4000, sampling_rate=12.0, quantity="acceleration", seed=0)
    >>> late = Signals(outputs=run.outputs[:-20], inputs=run.inputs[20:], sampling_rate=12.0)
    >>> set(seen_delays(Records(runs=(late,))).values())
    {20}
    """
    found: dict[str, int] | None = None
    for part in records.stacked():
        own = lateness(part).samples
        if not own or found not in (None, own) or find_excitation(part) not in ("random", "burst") or exchanged(part):
            return {}
        found = own
    return found or {}


def aligned(records: Records, delays: Mapping[str, int]) -> tuple[Records, tuple[Note, ...]]:
    """Return records with outputs shifted back against the forces by whole samples, and a note; unchanged where no delay is above zero.

    Raises DataError for an output that is not there, or a run that is no longer than its delay.
    """
    longest, shortest = max(delays.values(), default=0), min(records.samples)
    unknown = [dof for dof in delays if dof not in records.output_dofs]
    if unknown or longest > shortest - 2:
        raise DataError(
            f"delays of {dict(delays)} were asked",
            f"the outputs are {', '.join(records.output_dofs)}, the shortest run has {shortest} samples",
            "Name outputs that are there, and samples that a run has.",
        )
    if not longest:
        return records, ()
    lags = [delays.get(dof, 0) for dof in records.output_dofs]
    moved = replace(records, runs=tuple(_shifted(run, lags, longest) for run in records.runs), groups=records.groups)
    alike = len(set(lags)) == 1
    what = "all outputs" if alike else ", ".join(f"{dof} {own}" for dof, own in delays.items() if own)
    of = f"come {longest} samples" if alike else "samples come"
    text = (
        f"{what} {of} late after the forces, which was taken out, and moves neither poles nor shapes; "
        "delays={} (--delays none) leaves it in"
    )
    return moved, (Note(DELAYS, {"samples": float(longest)}, text),)


def _shifted(run: Signals, lags: list[int], longest: int) -> Signals:
    """Return a run with every output shifted back by its lag, cut to the samples that all channels have."""
    assert run.inputs is not None
    count = run.samples - longest
    outputs = np.column_stack([own[lag : lag + count] for own, lag in zip(run.outputs.T, lags, strict=True)])
    return replace(run, outputs=outputs, inputs=run.inputs[:count])
