"""Find and correct delays between channels: outputs delayed after the forces or ahead of them, channels that lag behind the others.

Each sample of delay needs a state of the model, which shows as a spurious mode. Outputs delayed after the forces have impulse responses
that begin with a jump, all after the same lag.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.data.notes import Finding
from modalscope.data.records import Records, Signals
from modalscope.numerics.checks import Array, RealArray
from modalscope.signals.doctor.findings import finding, thinned
from modalscope.signals.preprocess.correlation import spanning_outputs
from modalscope.signals.preprocess.excitation import dead_forces, find_excitation
from modalscope.signals.preprocess.spectra import Segments, cross_spectra, fast_length

#: Maximum number of samples of a run, and of runs, that are examined.
_MAX_SAMPLES, _MAX_RUNS = 1 << 16, 4

#: Maximum number of outputs one of which the others are held against.
_MAX_CANDIDATES = 8

#: Samples of the blocks that a run is cut into to see which side comes first: they are longer than what a correlation needs.
_BLOCK = 1 << 14

#: Segments that impulse responses are averaged over, and their minimum and maximum length.
_SEGMENTS, _MIN_SEGMENT, _MAX_SEGMENT = 12, 128, 2048

#: Minimum power of the forces on a line, as a part of the largest; lower ones are raised to it.
_MIN_FORCE = 1e-3

#: Minimum value at the onset of a response: in standard deviations of its values before lag 0, for one output and for the mean of all,
#: whose chance is level; and as a part of its largest value.
_ONSET_DEVIATIONS, _MEAN_ONSET_DEVIATIONS, _ONSET_LEVEL = 6.0, 3.0, 0.2

#: Minimum ratio of a jump to the values more than two lags before: motion that grows from rest does not jump.
_MIN_JUMP = 4.0

#: Minimum delay in samples of all outputs, and of a single one. Fewer are poles at z = 0, which the identification recognizes; in single
#: outputs motion far from the forces may grow that long.
_MIN_DELAY, _MIN_SINGLE_DELAY = 5, 10

#: Minimum energy of a correlation before lag 0 over that after it that shows an effect before its cause, whatever the spectrum.
_MIN_EARLY_RATIO = 4.0

#: Relative uncertainty of what chance adds to both sides: it is subtracted, and so much more must remain.
_CHANCE_UNCERTAINTY = 1.0

#: Minimum of the largest correlation, in standard deviations of independent records.
_MIN_CORRELATION = 8.0

#: Segments of the spectra between outputs, and their minimum length.
_PAIR_SEGMENTS, _MIN_PAIR_SEGMENT = 16, 64

#: Minimum part of the phases on the real axis without the delay, and maximum of the others relative to that with it.
_MIN_REAL, _MAX_IMAGINARY_RATIO = 0.85, 0.4

#: Minimum spread of the weights over frequencies, as a part of their mean: one mode alone determines no delay.
_MIN_SPREAD = 0.1

#: Half of the steps of the grid of delays in a sample: 1 / 32 of a sample is resolved.
_GRID = 16

#: Minimum angle of a delay at the mean frequency (rad); and maximum relative difference of the delays of two halves of the record, and of
#: the band.
_MIN_ANGLE, _MAX_DISAGREEMENT = 0.1, 0.25


def late(signals: Signals) -> list[Finding]:
    """Find outputs delayed after broadband forces, see `lateness`."""
    common, delays = lateness(signals)
    rate, given = signals.sampling_rate, " ".join(f"{dof}={lag}" for dof, lag in delays.items())
    if common:
        lag = next(iter(delays.values()))
        return [finding("delay: all", *signals.output_dofs, samples=lag, seconds=lag / rate, given=given)]
    return [finding("delay: one", dof, samples=lag, seconds=lag / rate, given=given) for dof, lag in delays.items()]


def lateness(signals: Signals) -> tuple[bool, dict[str, int]]:
    """Return whether all outputs are delayed after broadband forces alike, and the samples of each delayed one.

    The impulse response of acceleration begins with the direct term at lag 0, that of velocity with the shapes at lag 1; that of
    displacement grows from zero and shows no delay. Recorders that started apart, and buffers, shift it.
    """
    outputs, inputs = signals.by_run()
    length = min(signals.samples // (_SEGMENTS // 2 + 1), _MAX_SEGMENT)
    dead = dead_forces(signals)
    if inputs is None or len(dead) == inputs.shape[2] or length < _MIN_SEGMENT:
        return False, {}
    moving = [i for i, dof in enumerate(signals.input_dofs) if dof not in dead]
    y, u = _examined(outputs), _examined(inputs[:, :, moving])
    size = _responses(y, u, length)
    mean = np.sqrt(np.mean((size / np.maximum(size.max(axis=0), 1e-300)) ** 2, axis=1))
    lag = _onset(mean, _MEAN_ONSET_DEVIATIONS)
    if lag >= _MIN_DELAY:
        return True, dict.fromkeys(signals.output_dofs, lag)
    if lag < 0:
        return False, {}
    lags = {dof: _onset(column, _ONSET_DEVIATIONS) for dof, column in zip(signals.output_dofs, size.T, strict=True)}
    return False, {dof: lag for dof, lag in lags.items() if lag >= _MIN_SINGLE_DELAY}


def _examined(x: RealArray) -> RealArray:
    """Return the first samples of the first runs without their means."""
    x = x[:_MAX_RUNS, :_MAX_SAMPLES]
    return np.asarray(x - x.mean(axis=1, keepdims=True))


def _blocks(x: RealArray) -> RealArray:
    """Return runs (R, N, c) cut into equal blocks, (blocks, n, c)."""
    count = max(x.shape[1] // _BLOCK, 1)
    samples = x.shape[1] // count
    return x[:, : count * samples].reshape(-1, samples, x.shape[2])


def _responses(outputs: RealArray, inputs: RealArray, length: int) -> RealArray:
    """Return the size of the impulse response of every output to all forces, (length, l), negative lags last."""
    level = inputs / np.maximum(np.sqrt(np.mean(inputs**2, axis=(0, 1))), 1e-300)
    S = cross_spectra(outputs, level, 1.0, Segments.of(outputs.shape[1], length))
    power = np.einsum("fii->f", S.inputs).real
    regularization = _MIN_FORCE * power.max() * np.eye(S.inputs.shape[1])
    H = np.linalg.solve((S.inputs + regularization).transpose(0, 2, 1), S.cross.transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray(np.linalg.norm(fft.irfft(H, n=length, axis=0), axis=2))


def _onset(size: RealArray, deviations: float) -> int:
    """Return the lag at which a response begins with a jump; -1 where it does not, or does not exceed chance."""
    length = len(size)
    after, chance = size[: length // 4], np.sqrt(np.mean(size[-length // 4 : -length // 16] ** 2))
    above = np.flatnonzero(after > max(deviations * chance, _ONSET_LEVEL * after.max()))
    if not above.size:
        return -1
    first = int(above[0])
    earlier = np.concatenate([size[-8:], after[: max(first - 2, 0)]])
    if after[first : first + 2].max() <= _MIN_JUMP * earlier.max():
        return -1
    begin = np.flatnonzero(after[max(first - 2, 0) : first + 1] > deviations * chance)
    return max(first - 2, 0) + int(begin[0])


def exchanged(signals: Signals) -> list[Finding]:
    """Find outputs that precede the inputs: force and response are exchanged.

    y = h * u with a causal h makes sum_(k > 0) R_yu(k)^2 the larger side, R_yu(k) = mean of y(t + k) u(t).
    """
    outputs, inputs = signals.by_run()
    if inputs is None or signals.samples < 4 * _MIN_PAIR_SEGMENT:
        return []
    y, u = (_blocks(_examined(x)) for x in (outputs, inputs))
    u = np.ascontiguousarray(u.transpose(2, 0, 1))  # (m, blocks, n)
    lags = u.shape[2] // 8
    length = fft.next_fast_len(2 * u.shape[2], real=True)
    U = fft.rfft(u, n=length, axis=2)
    of_forces = np.sum(U.real**2 + U.imag**2, axis=1)
    early: list[tuple[str, str]] = []
    for i, dof in enumerate(signals.output_dofs):  # one at a time: transforms are large
        own = np.ascontiguousarray(y[:, :, i])
        Y = fft.rfft(own, n=length, axis=1)
        of_output = np.sum(Y.real**2 + Y.imag**2, axis=0)
        R = fft.irfft(np.einsum("bf,mbf->mf", Y, np.conj(U)), n=length, axis=1)
        size = np.sqrt(np.sum(own**2) * np.sum(u**2, axis=(1, 2)))
        after, before = (np.einsum("mk,mk->m", side, side) for side in (R[:, 1 : lags + 1], R[:, -lags:]))
        # the correlation of independent records: |y| |u| / sqrt(N), times a factor for their own autocorrelations
        chance = np.maximum(size, 1e-300) * _spread(of_output, of_forces.T, length, own.size)
        floor = lags * chance**2  # what chance adds to either side
        limit = _MIN_EARLY_RATIO * np.maximum(after - floor, 0.0) + _CHANCE_UNCERTAINTY * floor
        largest = np.maximum(R.max(axis=1), -R.min(axis=1))
        reversed_ = (largest > _MIN_CORRELATION * chance) & (before - floor > limit)
        early += [(dof, force) for force in itertools.compress(signals.input_dofs, reversed_)]
    if not early:
        return []
    output_names, input_names = (tuple(dict.fromkeys(pair[side] for pair in early)) for side in (0, 1))
    dofs = dict.fromkeys((*output_names, *input_names))
    return [finding("exchanged", *dofs, outputs=", ".join(output_names), inputs=", ".join(input_names))]


def _spread(of_output: RealArray, of_forces: RealArray, length: int, samples: int) -> RealArray:
    """Return the standard deviation of correlation coefficients of independent records: sqrt(sum_k r_y(k) r_u(k) / N).

    `of_output` (F,), `of_forces` (F, m): power on the lines of `length` samples; their products sum to those of the autocorrelations.
    `samples`: N.
    """
    twice = np.full(len(of_output), 2.0)  # lines below zero
    twice[[0] if length % 2 else [0, -1]] = 1
    power = twice @ of_output * (twice @ of_forces)
    scale = np.maximum(power / length, 1e-300)
    return np.asarray(np.sqrt(np.maximum((twice * of_output) @ of_forces / scale, 1.0) / samples))


def delayed(signals: Signals) -> list[Finding]:
    """Find outputs that are later or earlier than the others: filters, multiplexed converters, recorders that started apart.

    Spectra between outputs of a structure with real modes lie on the real axis, S_ij / |S_ij| = +-1; a delay T turns them by
    exp(-j w T). T maximizes sum c_ij^2 (S_ij / |S_ij|)^2 exp(2 j w T), c the coherence; the square removes the signs.
    """
    outputs, _ = signals.by_run()
    length = min(signals.runs * signals.samples // (_PAIR_SEGMENTS // 2), signals.samples, 4096)
    if outputs.shape[2] < 3 or length < _MIN_PAIR_SEGMENT or len(set(signals.quantities)) > 1:
        return []
    y = outputs[:, :_MAX_SAMPLES]
    length = fast_length(min(length, y.shape[1] // 2))
    candidates = spanning_outputs(thinned(signals), _MAX_CANDIDATES)
    whole = _delays(y, length, candidates)
    delayed = whole.better & (np.abs(whole.delay) * whole.omega >= _MIN_ANGLE)
    if not np.any(delayed):
        return []
    first, second = (_delays(half, length, candidates) for half in (y[:, : y.shape[1] // 2], y[:, y.shape[1] // 2 :]))
    delayed &= np.abs(first.delay - second.delay) <= _MAX_DISAGREEMENT * np.abs(whole.delay)
    findings, lags = [], np.where(delayed, np.rint(whole.delay), 0).astype(int)
    given = " ".join(f"{dof}={lag}" for dof, lag in zip(signals.output_dofs, lags - lags.min(), strict=True) if lag)
    for i in np.flatnonzero(delayed):
        seconds, side = whole.delay[i] / signals.sampling_rate, "later" if whole.delay[i] > 0 else "earlier"
        measured = {"seconds": seconds, "size": abs(seconds), "samples": abs(whole.delay[i]), "side": side}
        # no option for a part of a sample, and none for one that is early after forces: the others would be moved against these
        alone = "delay: phase" if given and (signals.inputs is None or lags.min() >= 0) else "delay: part"
        findings.append(finding(alone, signals.output_dofs[i], given=given, **measured))
    return findings if 2 * len(findings) < len(signals.output_dofs) else []


class _Delays(NamedTuple):
    """Delay of every output against most others in samples, mean angular frequency in rad a sample, and whether it explains the phases."""

    delay: RealArray
    omega: RealArray
    better: Array


def _delays(y: RealArray, length: int, candidates: Sequence[int]) -> _Delays:
    """Return the delays of records (R, N, l) from segments, against the candidate with the largest coherence with the others."""
    references = list(candidates)
    spectra = cross_spectra(y, y[:, :, references], 1.0, Segments.of(y.shape[1], length), centred=True)
    S, power = spectra.cross, np.maximum(spectra.output_powers, 1e-300)

    def coherence(k: int) -> RealArray:  # of one candidate at a time: of all it would take as much as the record
        return np.asarray((S[..., k].real ** 2 + S[..., k].imag ** 2) / (power * power[:, references[k], None]))

    best_candidate = int(np.argmax([coherence(k).sum() for k in range(len(references))]))
    reference = references[best_candidate]
    pair, weight = S[1:, :, best_candidate], coherence(best_candidate)[1:] ** 2
    weight = weight / np.maximum(weight.sum(axis=0), 1e-300)
    omega = 2 * np.pi * np.arange(1, len(S)) / length
    mean = omega @ weight
    spread = np.sqrt(np.maximum(omega**2 @ weight - mean**2, 0)) > _MIN_SPREAD * mean
    squared = (pair / np.maximum(np.abs(pair), 1e-300)) ** 2 * weight
    # scores on a grid of delays by one transform
    count, most = _GRID * length, _GRID * length // 4  # steps of a transform, and those of an eighth of a segment
    best, top, still = np.zeros(y.shape[2]), np.zeros(y.shape[2]), np.zeros(y.shape[2])
    for i, column in enumerate(
        squared.T
    ):  # the grid is fine: of all outputs at once it would take many times the record
        score = fft.irfft(np.concatenate([[0.0], column]), n=count) * (count / 2)
        around = np.concatenate([score[-most:], score[: most + 1]])
        at = int(np.argmax(around))
        best[i], top[i], still[i] = (at - most) / (2 * _GRID), around[at], score[0]
    delay = best - np.median(best)
    corrected = squared * np.exp(2j * omega[:, None] * best)
    low = np.cumsum(weight, axis=0) < 0.5
    # a phase linear in frequency fits both halves of the band; the lag of a damper does not
    linear = np.ones(len(best), dtype=bool)
    for half in (low, ~low):
        residual = np.angle(np.sum(corrected * half, axis=0)) / 2
        mean_of_half = np.sum(omega[:, None] * weight * half, axis=0) / 0.5
        linear &= np.abs(residual) < _MAX_DISAGREEMENT * np.abs(best) * mean_of_half
    explained = (top > _MIN_REAL) & (1 - top < _MAX_IMAGINARY_RATIO * (1 - still)) & spread & linear
    # phases that dampers turn at all outputs are no delay of one
    explained &= float(np.median(np.delete(top, reference))) > _MIN_REAL
    explained[reference] = 2 * explained.sum() > len(explained) - 1
    return _Delays(delay, mean, explained)


def common_delays(records: Records) -> dict[str, int]:
    """Return the samples by which outputs are delayed after random forces, where all runs agree; empty otherwise.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> run = chain5().simulate(inputs="white", samples=4000, sampling_rate=12.0, quantity="acceleration", seed=0)
    >>> late = Signals(outputs=run.outputs[:-20], inputs=run.inputs[20:], sampling_rate=12.0)
    >>> set(common_delays(Records(runs=(late,))).values())
    {20}
    """
    delays: dict[str, int] = {}
    for part in records.stacked():
        of_part = lateness(part)[1]
        random = find_excitation(part) in ("random", "burst")
        if not of_part or (delays and delays != of_part) or not random or exchanged(part):
            return {}
        delays = of_part
    return delays
