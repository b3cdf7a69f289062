"""Check signs: reversed and exchanged channels by driving points and reciprocity, wrong quantities by the slope below the first resonance.

driving point
    A force does work on the structure where it acts: Re(velocity / force) >= 0 at every frequency (and, of samples, on the line
    s = alpha + j w of an exponential window, where a mobility is positive real, too).
reciprocity
    H_ij = H_ji, once the channels reversed at driving points are corrected; a channel of opposite sign to most others is named.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import scipy

from modalscope.data.geometry import parse_dof
from modalscope.data.notes import Finding
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, RealArray
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.signals.doctor.findings import finding

#: Slopes of log |H| over log f below the first resonance, for fixed and for free structures.
_SLOPES = {"displacement": (0.0, -2.0), "velocity": (1.0, -1.0), "acceleration": (2.0, 0.0)}

#: Minimum distance from both slopes of a quantity at which a slope contradicts it, and maximum distance at which it supports another.
_CONTRADICTION, _SUPPORT = 0.7, 0.4

#: Lines and differences are significant when their power is this many times the variance of the estimates.
_SIGNIFICANT_POWER = 4.0

#: Maximum relative difference of reciprocal responses, in measurements, too.
_MAX_DIFFERENCE = 0.5

#: An exchange or a change of sign is accepted when it reduces the difference below this part.
_MAX_CORRECTED = 0.3

#: Minimum size of the mean sign of the work at a driving point that is correct, or reversed, as a whole.
_CLEAR_WORK = 0.9

#: Decay of the exponential window over the samples, in nepers.
_WINDOW_DECAY = 5.0


def check_slope(response: FrequencyResponse) -> list[Finding]:
    """Return a finding when the slope below the first resonance contradicts the quantity and points to another."""
    slope = _low_slope(response)
    if response.quantity is None or slope is None:
        return []
    distance = {q: min(abs(slope - s) for s in slopes) for q, slopes in _SLOPES.items()}
    best = min(distance, key=lambda q: distance[q])
    if distance[response.quantity] < _CONTRADICTION or distance[best] > _SUPPORT:
        return []
    why = f"|H| ~ f^{slope:.1f} below the first resonance"
    return [finding("wrong quantity", *response.output_dofs, given=response.quantity, better=best, why=why)]


def fits_slope(response: Response, quantity: str) -> bool:
    """Return whether the lines below the first resonance show the slope of a quantity."""
    slope = _low_slope(response) if isinstance(response, FrequencyResponse) else None
    return slope is not None and min(abs(slope - s) for s in _SLOPES[quantity]) < _SUPPORT


def level(response: FrequencyResponse) -> RealArray:
    """Return log |H| of all channels together, (F,), each channel scaled to mean square one."""
    power = np.abs(response.values) ** 2
    mean = power.mean(axis=0, keepdims=True)
    scaled = np.divide(power, mean, out=np.zeros_like(power), where=mean > 0)
    return np.asarray(0.5 * np.log(np.maximum(scaled.mean(axis=(1, 2)), np.finfo(float).tiny)))


def _low_slope(response: FrequencyResponse) -> float | None:
    """Return the slope of log |H| over log f from a sixth to half of the first resonance, without the rise of the resonance.

    None with fewer than six lines there, or where H is neither a stiffness nor a mass line: these are real for an even slope and
    imaginary for an odd one, and leakage of a resonance is not.
    """
    f, log_size = response.frequencies, level(response)
    peaks = scipy.signal.find_peaks(log_size, prominence=np.log(5))[0]
    if peaks.size == 0:
        return None
    first = f[peaks[0]]
    low = (f > first / 6) & (f < first / 2) & (f > 0)
    if int(low.sum()) < 6 or f[low][-1] < 1.5 * f[low][0]:
        return None
    x, y = np.log(f[low]), log_size[low] + np.log(1 - (f[low] / first) ** 2)
    if response.variance is not None:
        scatter = response.variance[low].sum(axis=(1, 2)) / np.sum(np.abs(response.values[low]) ** 2, axis=(1, 2))
        if float(scatter.max()) > 0.1:
            return None  # the estimates' own scatter hides the slope
    slope, at = np.polyfit(x, y, 1)
    # noise and suspension modes are no straight line
    straight = float(np.std(y - slope * x - at)) < 0.1
    H = response.values[low]
    on_axis = float(np.sum((H.real if round(slope) % 2 == 0 else H.imag) ** 2)) > 0.9 * float(np.sum(np.abs(H) ** 2))
    return float(slope) if straight and on_axis else None


def check_polarity(response: Response) -> list[Finding]:
    """Return channels that are reversed or exchanged, responses that are not reciprocal, and a quantity that cannot be right.

    Correlations show none of them: a reversed channel changes the sign of its row and its column.
    """
    if isinstance(response, ImpulseResponse) and response.kind == "correlation":
        return []
    pairs = driving_points(response)
    findings, reversed_ = _driving_points(response, pairs)
    signed = [(i, j, -sign if (i, j) in reversed_ else sign) for i, j, sign in pairs]
    return findings + _reciprocity(response, signed)


def driving_points(response: Response | Signals) -> list[tuple[int, int, float]]:
    """Return (output, input, sign) of every driving point; the sign is -1 when the labels point in opposite directions."""
    pairs = []
    for i, a in enumerate(response.output_dofs):
        for j, b in enumerate(response.input_dofs):
            da, db = parse_dof(a), parse_dof(b)
            if a == b:
                pairs.append((i, j, 1.0))
            elif da and db and da.node == db.node and da.direction.strip("+-") == db.direction.strip("+-"):
                pairs.append((i, j, -1.0 if da.direction[0] != db.direction[0] else 1.0))
    return pairs


def _driving_points(
    response: Response, pairs: list[tuple[int, int, float]]
) -> tuple[list[Finding], set[tuple[int, int]]]:
    """Check the work done at driving points; return also the (output, input) that are reversed as a whole."""
    findings: list[Finding] = []
    reversed_: set[tuple[int, int]] = set()
    # an acceleration without the impulse at time zero, which carries the sign
    no_impulse = (
        isinstance(response, ImpulseResponse) and response.kind != "pulse" and response.quantity == "acceleration"
    )
    if response.quantity is None or not pairs or no_impulse:
        return findings, reversed_
    s, H = _transforms(response, pairs)
    for k, (i, j, sign) in enumerate(pairs):
        clear = _clear(response, i, j, s)
        scores = {q: _work(sign * H[clear, k], s[clear], q) for q in QUANTITIES}
        score = scores[response.quantity]
        if score > 0:
            continue
        dof = response.output_dofs[i]
        best = max(scores, key=lambda q: scores[q])
        clearly = best != response.quantity and scores[best] > _CLEAR_WORK and score > -_CLEAR_WORK
        if clearly and fits_slope(response, best):
            why = f"only then the force at {dof} does work"
            findings.append(finding("wrong quantity", dof, given=response.quantity, better=best, why=why))
        elif score < -_CLEAR_WORK:
            reversed_.add((i, j))
            findings.append(finding("polarity: driving point", dof, quantity=response.quantity))
        else:
            findings.append(finding("swapped: driving point", dof))
    return findings, reversed_


def _transforms(response: Response, pairs: list[tuple[int, int, float]]) -> tuple[ComplexArray, ComplexArray]:
    """Return s (F,) and the driving points' transfer functions there, (F, pairs); a zero-order hold acts in the middle of its step."""
    driving = np.stack([response.values[:, i, j] for i, j, _ in pairs], axis=1)
    rate = response.sampling_rate
    if isinstance(response, FrequencyResponse):
        s = np.asarray(2j * np.pi * response.frequencies, dtype=complex)
        return s, driving if rate is None else driving * np.exp(s / (2 * rate))[:, None]
    assert isinstance(response, ImpulseResponse)
    t = (np.arange(response.samples) + response.first_sample) / response.sampling_rate
    t = t + (0.5 / response.sampling_rate if response.kind == "pulse" else 0.0)
    alpha, length = _WINDOW_DECAY / t[-1], 2 * response.samples
    f = np.fft.rfftfreq(length, 1 / response.sampling_rate)
    H = np.fft.rfft(driving * np.exp(-alpha * t)[:, None], n=length, axis=0)
    return alpha + 2j * np.pi * f, H * np.exp(-2j * np.pi * f * t[0])[:, None]


def _clear(response: Response, i: int, j: int, s: ComplexArray) -> BoolArray:
    """Return the lines above 0 Hz on which a response is significant, all where its variance is unknown."""
    inside = s.imag > 0
    if response.variance is None:
        return inside
    clear = inside & (np.abs(response.values[:, i, j]) ** 2 > _SIGNIFICANT_POWER * response.variance[:, i, j])
    return np.asarray(clear if clear.any() else inside)


def _work(H: ComplexArray, s: ComplexArray, quantity: str) -> float:
    """Return the mean sign of cos(phase of velocity / force), -1 to 1, weighted with it and with |H|^2: 1 for a driving point.

    The weight is the measured power of any quantity: |mobility| would raise the noise of displacements far above the resonances
    and that of accelerations below them.
    """
    turn = s ** (1 - QUANTITIES[quantity])
    work = np.abs(H) * (H * turn / np.abs(turn)).real
    size = float(np.abs(work).sum())
    return float(work.sum()) / size if size else 1.0


def _reciprocity(response: Response, pairs: list[tuple[int, int, float]]) -> list[Finding]:
    """Compare H_ij with H_ji where both sides have the same dofs; test a change of sign and exchanged outputs as the cause."""
    H, findings, negative = response.values, [], []
    for (i, a, sa), (j, b, sb) in combinations(pairs, 2):
        if i == j or a == b:
            continue
        H_ij, H_ji = sb * H[:, i, b], sa * H[:, j, a]
        difference = _difference(H_ij, H_ji)
        if difference < _MAX_DIFFERENCE or not _significant(H_ij - H_ji, response, (i, b), (j, a)):
            continue
        if _difference(H_ij, -H_ji) < _MAX_CORRECTED * difference:
            negative.append((i, j))
            continue
        names = (response.output_dofs[i], response.output_dofs[j])
        if _difference(sb * H[:, j, b], sa * H[:, i, a]) < _MAX_CORRECTED * difference:
            findings.append(finding("swapped: reciprocity", *names))
        else:
            findings.append(finding("reciprocity", *names, percent=100 * difference))
    return _reversed_outputs(response, negative) + findings


def _reversed_outputs(response: Response, negative: list[tuple[int, int]]) -> list[Finding]:
    """Name the output of opposite sign to most others, or the several of which that is true alike."""
    if not negative:
        return []
    times: Array = np.bincount(np.ravel(negative))
    names = tuple(response.output_dofs[i] for i in np.flatnonzero(times == times.max()))
    pairs = ", ".join(f"{response.output_dofs[i]} to {response.output_dofs[j]}" for i, j in negative)
    return [finding(f"polarity: {'reciprocity' if len(names) == 1 else 'one of several'}", *names, pairs=pairs)]


def _difference(a: Array, b: Array) -> float:
    size = np.linalg.norm(a) + np.linalg.norm(b)
    return float(2 * np.linalg.norm(a - b) / size) if size else 0.0


def _significant(difference: Array, response: Response, *pairs: tuple[int, int]) -> bool:
    """Return whether two estimates differ significantly, in the sum over the lines and on most significant lines.

    The sum alone is dominated by one or two lines: at a resonance for which the segments are too short the estimates leak, and scatter
    more than their variance. Of equal estimates |difference|^2 over the sum of both variances has the median .7.
    """
    if response.variance is None:
        return True
    scatter = sum((response.variance[:, i, j] for i, j in pairs), np.zeros(response.count))
    power = sum((np.abs(response.values[:, i, j]) ** 2 for i, j in pairs), np.zeros(response.count))
    squares, clear = np.abs(difference) ** 2, power > _SIGNIFICANT_POWER * scatter
    most = bool(clear.any()) and np.mean(squares[clear] > _SIGNIFICANT_POWER * scatter[clear]) > 0.5
    return bool(most and squares.sum() > _SIGNIFICANT_POWER * scatter.sum())
