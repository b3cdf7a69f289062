"""Tell whether a record without forces is a free decay: a sum of few damped exponentials from its release on.

A structure that was plucked, struck or let go moves by y(k) = sum_j c_j exp(lambda_j k) alone. Under forces that go on, whether steady or
not, every sample brings something new, and the sum over many decay times explains little. The exponents come from the shift of the left
singular vectors of a Hankel matrix of the record (ERA on a free decay), amplitudes from least squares, and the residual share says
which of both it is. Of 300 random decays 291 are taken for one, of 100 ambient records of 20 to 200 decay times none, of 100 of 3 to 20
decay times 1, of 100 events that rise and fall 1, of 100 with a sudden rise and a coda 5 (`make study WORD=checks`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.numerics.checks import RealArray
from modalscope.numerics.statistics import MANY_NUMBERS, few_channels

#: Largest share of the mean square that the exponentials leave of a free decay.
_MAX_UNEXPLAINED = 0.1

#: A free decay begins where its power first is this part of its largest: random phases let it grow for some periods.
_POWER_AT_RELEASE = 0.1

#: Median power just before a blow, relative to the largest, at most.
_SILENCE = 1e-4

#: Power of the last quarter of a free decay relative to the first at most: a tone that does not decay is none.
_MAX_LASTING = 0.8

#: Largest number of states, and samples that each of their unknowns needs at least.
_MAX_STATES, _SAMPLES_PER_UNKNOWN = 60, 6

#: Minimum samples of a decay, and the maximum that are looked at.
_MIN_SAMPLES, _MAX_SAMPLES = 100, 30_000

#: Power of a line over the median of its range that noise exceeds in one record of a million by chance, 2^-c = 1e-6 / lines, with 1e4 of
#: these; lines of a range, most of which are skirts of resonances and not their peaks; and samples a period that are kept of the highest
#: such line.
_SIGNIFICANT_POWER, _LINES_OF_RANGE, _SAMPLES_PER_PERIOD = 33.0, 500, 3.2

#: Length of the low-pass filter in samples of the slower rate, to either side.
_FILTER_REACH = 10

#: Windows of a record for every sample in one: more determine the exponents no better than a test of the residual needs.
_ROWS_PER_COLUMN = 16

#: Squares of singular values of the exponentials below this part of the largest are of exponentials that depend on each other.
_DEPENDENT = 1e-10

#: Singular values below this part of the largest are rounding.
_RANK_TOLERANCE = 1e-13


class Decay(NamedTuple):
    """A free decay in a record.

    Attributes
    ----------
    samples : array, (N, l)
        From the release on, low-pass filtered, one sample in `step` kept.
    step : int
    first : int
        Sample of the record at the release.
    unexplained : float
        Share of the mean square that exponentials leave.
    """

    samples: RealArray
    step: int
    first: int
    unexplained: float


def decay_of(run: RealArray) -> Decay | None:
    """Return the free decay in a record (N, l), at the rate that its tones need; None where it is no free decay."""
    whole = without_offset(run)
    blow, (y, step) = blow_out_of_silence(whole), slower(whole)
    y = one_in(whole[blow:], step) if blow else y
    release = release_of(y, weighed=blow == 0)
    if release is None and (held := held_until(y)):
        blow = step * (held + (_FILTER_REACH if step > 1 else 0))  # no window of the filter reaches into the hold
        if step > largest_step(len(run) - blow):
            return None
        y = one_in(without_offset(run[blow:]), step)
        release = release_of(y)
    return None if release is None else Decay(y[release[0] :], step, blow + step * release[0], release[1])


def decays_of(runs: RealArray) -> list[Decay] | None:
    """Return the free decays in runs (R, N, l) of one structure, all at one rate; None where a run is none.

    Noise and drift may leave more than a tenth of some runs, while others are decays by themselves. All have the same exponents: side by
    side, as channels of one record, they determine these together, and what is left is of all. That takes runs released alike.
    """
    each = [decay_of(run) for run in runs]
    found = [decay for decay in each if decay is not None]
    if len(found) == len(each):
        return found if all(decay.step == found[0].step for decay in found) else None
    together = decay_of(np.hstack(list(runs))) if found else None
    if together is None:
        return None
    return [together._replace(samples=samples) for samples in np.split(together.samples, len(runs), axis=1)]


def without_offset(y: RealArray) -> RealArray:
    """Return a decay (N, ...) less its offset: its mean under a Hann window from its largest sample on, since a plain one holds tones, too.

    A tone of p periods there leaves 1 / (pi p^3) of its size, in a plain mean 1 / (pi p).

    Examples
    --------
    >>> t = np.arange(2000) / 100
    >>> y = np.exp(-0.02 * t) * np.cos(9 * t)
    >>> bool(abs((without_offset(y + 5) - y).max()) < 1e-4)
    True
    """
    flat, highest = y.reshape(len(y), -1), np.zeros(len(y))
    for few in few_channels(len(y), flat.shape[1], MANY_NUMBERS):
        sizes = np.abs(flat[:, few] - np.median(flat[:, few], axis=0))
        sizes /= np.maximum(sizes.max(axis=0), np.finfo(float).tiny)
        highest = np.maximum(highest, sizes.max(axis=1))
    largest = int(np.argmax(highest))
    end = y[min(largest, len(y) // 2) :]
    taps = np.hanning(len(end) + 2)[1:-1]
    return np.asarray(y - np.tensordot(taps / taps.sum(), end, 1))


def blow_out_of_silence(y: RealArray) -> int:
    """Return the sample at which a record (N, l) is struck out of silence, 0 where it is not.

    Under forces that go on the median power just before the release is a hundredth of the largest and more, in random events and codas as
    in ambient vibration; before a blow it is that of the noise. What follows a blow is a decay whatever its length.
    """
    power = np.zeros(len(y))
    for few in few_channels(len(y), y.shape[1], MANY_NUMBERS):
        squares = y[:, few] ** 2
        power += np.sum(squares / np.maximum(np.mean(squares, axis=0), np.finfo(float).tiny), axis=1)
    first, stretch = int(np.argmax(power >= _POWER_AT_RELEASE * power.max())), max(len(y) // 100, 1)
    before = power[max(first - stretch, 0) : first]
    return first if len(before) == stretch and np.median(before) < _SILENCE * power.max() else 0


def held_until(y: RealArray) -> int:
    """Return the sample at which a structure that is held away from rest is let go, 0 where none is held; y (N, l).

    Displacements and strains of a structure that is pulled aside are as large before the release as after it, so their size does not tell
    it; but they do not move: their steps from sample to sample are the first to rise.

    Examples
    --------
    >>> t = np.arange(-200, 800)
    >>> held_until(np.where(t < 0, 1, np.exp(-0.004 * t) * np.cos(0.7 * t))[:, None])
    201
    >>> held_until((np.exp(-0.004 * t) * np.cos(0.7 * t))[:, None])
    0
    """
    y = y[:_MAX_SAMPLES] - np.median(y[:_MAX_SAMPLES], axis=0)
    sizes, steps = (
        np.sum(x**2 / np.maximum(np.mean(x**2, axis=0), np.finfo(float).tiny), axis=1) for x in (y, np.diff(y, axis=0))
    )
    large, moves = (int(np.argmax(power >= _POWER_AT_RELEASE * power.max())) for power in (sizes, steps))
    return moves + 1 if moves - large >= max(len(y) // 100, 1) else 0


def slower(y: RealArray) -> tuple[RealArray, int]:
    """Return a record (N, l) low-pass filtered, one sample in q kept, at the rate that its highest tone needs; and q.

    Convolved with a filter of finite length, exponentials stay exponentials wherever the filter lies inside the record: the rest is cut
    off, half a filter length at either end.
    """
    tones = np.zeros(len(y) // 2 + 1, dtype=bool)
    for few in few_channels(len(y), y.shape[1], MANY_NUMBERS):
        power = np.abs(np.fft.rfft(y[:, few] - y[:, few].mean(axis=0), axis=0)) ** 2
        ranges = np.array_split(power, max(1, len(power) // _LINES_OF_RANGE))
        tones |= np.concatenate(
            [np.any(part > _SIGNIFICANT_POWER * np.median(part, axis=0), axis=1) for part in ranges]
        )
    highest = (int(np.max(np.flatnonzero(tones), initial=0)) + 1) / len(tones)  # in Nyquist frequencies
    q = min(max(1, int(2 / (_SAMPLES_PER_PERIOD * highest))), largest_step(len(y)))
    return one_in(y, q), q


def largest_step(samples: int) -> int:
    """Return the largest q at which a record so long keeps the samples of a decay."""
    return max(1, samples // (2 * _FILTER_REACH + _MIN_SAMPLES))


def one_in(y: RealArray, q: int) -> RealArray:
    """Return a record (N, ...) low-pass filtered, one sample in q kept, without half a filter length at either end."""
    if q == 1:
        return y
    at = np.arange(-_FILTER_REACH * q, _FILTER_REACH * q + 1)
    taps = np.sinc(0.8 * at / q) * np.hamming(at.size)
    windows = np.lib.stride_tricks.sliding_window_view(y, len(taps), axis=0)[::q]
    return np.ascontiguousarray(windows @ (taps / taps.sum()))


def release_of(y: RealArray, weighed: bool = True) -> tuple[int, float] | None:
    """Return where the free decay in a record (N, l) begins (sample), and the share of its mean square that exponentials leave.

    None where it is no free decay.

    `weighed`: whether a strong beginning counts for no more samples than it has, which leaves fewer exponentials to explain it.

    Examples
    --------
    >>> t = np.arange(2000) / 100
    >>> y = (np.exp(-0.3 * t) * np.sin(9 * t))[:, None] + 0.01 * np.random.default_rng(0).standard_normal((2000, 1))
    >>> release_of(y)[0] < 30, release_of(np.random.default_rng(0).standard_normal((2000, 1))) is None
    (True, True)
    """
    y = y[:_MAX_SAMPLES] - np.median(y[:_MAX_SAMPLES], axis=0)
    level = np.mean(y**2, axis=0)
    if not np.all(level > 0):
        return None
    y = y / np.sqrt(level)  # a channel in a small unit would decide alone
    power = np.sum(y**2, axis=1)
    first = int(np.argmax(power >= _POWER_AT_RELEASE * power.max()))
    decay, power = y[first:], power[first:]
    quarter = len(decay) // 4
    if len(decay) < _MIN_SAMPLES or power[-quarter:].sum() > _MAX_LASTING * power[:quarter].sum():
        return None
    worth = float(power.sum() ** 2 / np.sum(power**2)) if weighed else len(decay)
    states = int(min(_MAX_STATES, worth * y.shape[1] / (_SAMPLES_PER_UNKNOWN * (y.shape[1] + 1))))
    left = unexplained_by_decay(decay, max(states, 2))
    return (first, left) if left < _MAX_UNEXPLAINED else None


def unexplained_by_decay(y: RealArray, states: int) -> float:
    """Return the share of the mean square of a record (N, l) that no sum of so many exponentials explains.

    Examples
    --------
    >>> k = np.arange(300)
    >>> y = np.stack([0.99**k * np.cos(0.3 * k), 0.98**k * np.sin(0.7 * k)], axis=1)
    >>> bool(unexplained_by_decay(y, 4) < 1e-12)
    True
    """
    samples, outputs = y.shape
    block_rows = max(2, min(samples // 3, -(-4 * states // outputs)))
    H = np.lib.stride_tricks.sliding_window_view(y, block_rows + 1, axis=0).transpose(0, 2, 1)
    H = H[:: max(1, len(H) // (_ROWS_PER_COLUMN * (block_rows + 1) * outputs))]
    columns = H.reshape(len(H), -1)
    values, vectors = np.linalg.eigh(columns.T @ columns)
    rank = min(states, block_rows * outputs, int(np.sum(values > _RANK_TOLERANCE * values[-1])))
    U = vectors[:, ::-1][:, :rank]
    poles = np.linalg.eigvals(np.linalg.lstsq(U[:-outputs], U[outputs:], rcond=None)[0]).astype(complex)
    exponents = np.log(np.where(poles == 0, np.finfo(float).tiny, poles))
    exponents = exponents[exponents.imag >= 0]
    exponents.real = np.minimum(exponents.real, 0)  # noise at the end makes poles that grow
    functions = np.exp(np.outer(np.arange(samples), exponents))
    basis = np.hstack([functions.real, functions.imag[:, exponents.imag > 0]])
    basis /= np.linalg.norm(basis, axis=0)
    squares, directions = np.linalg.eigh(basis.T @ basis)  # a tenth of the time of a factorization with pivots
    kept = squares > _DEPENDENT * squares[-1]
    Q = basis @ (directions[:, kept] / np.sqrt(squares[kept]))
    return float(np.sum((y - Q @ (Q.T @ y)) ** 2) / np.sum(y**2))
