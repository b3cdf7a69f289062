"""Check signs: turned and exchanged channels by driving points and reciprocity, wrong quantities by the slope below the first resonance.

driving point
    A force does work on the structure where it acts: Re(velocity / force) >= 0 at every frequency (and, of samples, on the line
    s = alpha + j w of an exponential window, where a mobility is positive real, too).
reciprocity
    H_ij = H_ji, once the channels found at driving points are turned; a channel turned against most others is named.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import scipy

from modalscope.data.geometry import parse_dof
from modalscope.data.notes import Finding
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.doctor.findings import finding
from modalscope.functions.poles import QUANTITIES
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, RealArray

# ------------------------------------------------------------------------------------------------------------ quantity

#: Slopes of log |H| over log f below the first resonance, for fixed and for free structures.
_SLOPES = {"displacement": (0.0, -2.0), "velocity": (1.0, -1.0), "acceleration": (2.0, 0.0)}

#: A slope contradicts a quantity when farther than this from both of its own, and points to one when nearer than that.
_FAR, _NEAR = 0.7, 0.4


def check_slope(response: FrequencyResponse) -> list[Finding]:
    """Return a finding when the slope below the first resonance contradicts the quantity and points to another."""
    slope = _low_slope(response)
    if response.quantity is None or slope is None:
        return []
    near = {q: min(abs(slope - s) for s in slopes) for q, slopes in _SLOPES.items()}
    best = min(near, key=lambda q: near[q])
    if near[response.quantity] < _FAR or near[best] > _NEAR:
        return []
    why = f"below the first resonance |H| goes with the power {slope:.1f} of the frequency"
    return [finding("wrong quantity", *response.output_dofs, given=response.quantity, better=best, why=why)]


def fits_slope(response: Response, quantity: str) -> bool:
    """Whether the lines below the first resonance show the slope of a quantity."""
    slope = _low_slope(response) if isinstance(response, FrequencyResponse) else None
    return slope is not None and min(abs(slope - s) for s in _SLOPES[quantity]) < _NEAR


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


# ------------------------------------------------------------------------------------------------------------ polarity

#: Lines and differences are significant when their power is this many times the variance of the estimates.
_CERTAIN = 4.0

#: Reciprocal responses differ by less than this part of their size, in measurements, too.
_RECIPROCAL = 0.5

#: An exchange or a change of sign is accepted when it reduces the difference below this part of what it was.
_REPAIRED = 0.3

#: Mean sign of the work at a driving point from which it is turned, or right, as a whole.
_CLEAR = 0.9

#: Decay of the exponential window over the samples, in nepers.
_WINDOW = 5.0


def check_polarity(response: Response) -> list[Finding]:
    """Return channels that are turned or exchanged, responses that are not reciprocal, and a quantity that cannot be right.

    Correlations show none of them: a turned channel turns its row and its column.
    """
    if isinstance(response, ImpulseResponse) and response.kind == "correlation":
        return []
    pairs = _pairs(response)
    found, turned = _driving_points(response, pairs)
    signed = [(i, j, -sign if (i, j) in turned else sign) for i, j, sign in pairs]
    return found + _reciprocity(response, signed)


def _pairs(response: Response) -> list[tuple[int, int, float]]:
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
    """Check the work done at driving points; return also the (output, input) that are turned as a whole."""
    found: list[Finding] = []
    turned: set[tuple[int, int]] = set()
    if response.quantity is None or not pairs or _lacks_impulse(response):
        return found, turned
    s, H = _transforms(response, pairs)
    for k, (i, j, sign) in enumerate(pairs):
        clear = _clear(response, i, j, s)
        scores = {q: _work(sign * H[clear, k], s[clear], q) for q in QUANTITIES}
        own = scores[response.quantity]
        if own > 0:
            continue
        dof = response.output_dofs[i]
        best = max(scores, key=lambda q: scores[q])
        if best != response.quantity and scores[best] > _CLEAR and own > -_CLEAR and fits_slope(response, best):
            why = f"the force at {dof} does work only then"
            found.append(finding("wrong quantity", dof, given=response.quantity, better=best, why=why))
        elif own < -_CLEAR:
            turned.add((i, j))
            found.append(finding("polarity: driving point", dof, quantity=response.quantity))
        else:
            found.append(finding("swapped: driving point", dof))
    return found, turned


def _lacks_impulse(response: Response) -> bool:
    """Whether the samples are an acceleration without the impulse at time zero, which carries the sign."""
    return isinstance(response, ImpulseResponse) and response.kind != "pulse" and response.quantity == "acceleration"


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
    alpha, length = _WINDOW / t[-1], 2 * response.samples
    f = np.fft.rfftfreq(length, 1 / response.sampling_rate)
    H = np.fft.rfft(driving * np.exp(-alpha * t)[:, None], n=length, axis=0)
    return alpha + 2j * np.pi * f, H * np.exp(-2j * np.pi * f * t[0])[:, None]


def _clear(response: Response, i: int, j: int, s: ComplexArray) -> BoolArray:
    """Return the lines above 0 Hz on which a response is significant, all where its variance is unknown."""
    inside = s.imag > 0
    if response.variance is None:
        return inside
    clear = inside & (np.abs(response.values[:, i, j]) ** 2 > _CERTAIN * response.variance[:, i, j])
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
    H, found, negative = response.values, [], []
    for (i, a, sa), (j, b, sb) in combinations(pairs, 2):
        if i == j or a == b:
            continue
        one, other = sb * H[:, i, b], sa * H[:, j, a]
        off = _difference(one, other)
        if off < _RECIPROCAL or not _certain(one - other, response, (i, b), (j, a)):
            continue
        if _difference(one, -other) < _REPAIRED * off:
            negative.append((i, j))
            continue
        names = (response.output_dofs[i], response.output_dofs[j])
        if _difference(sb * H[:, j, b], sa * H[:, i, a]) < _REPAIRED * off:
            found.append(finding("swapped: reciprocity", *names))
        else:
            found.append(finding("reciprocity", *names, percent=100 * off))
    return _turned(response, negative) + found


def _turned(response: Response, negative: list[tuple[int, int]]) -> list[Finding]:
    """Name the output that is turned against most others, or the several that are so alike."""
    if not negative:
        return []
    times: Array = np.bincount(np.ravel(negative))
    names = tuple(response.output_dofs[i] for i in np.flatnonzero(times == times.max()))
    pairs = ", ".join(f"{response.output_dofs[i]} to {response.output_dofs[j]}" for i, j in negative)
    which = "reciprocity" if len(names) == 1 else "one of several"
    return [finding(f"polarity: {which}", *names, pairs=pairs)]


def _difference(a: Array, b: Array) -> float:
    size = np.linalg.norm(a) + np.linalg.norm(b)
    return float(2 * np.linalg.norm(a - b) / size) if size else 0.0


def _certain(difference: Array, response: Response, *pairs: tuple[int, int]) -> bool:
    """Whether two estimates differ significantly, in the sum over the lines and on most significant lines.

    One or two lines dominate the sum: at a resonance for which the segments are too short the estimates leak, and scatter
    more than their variance. Of equal estimates |difference|^2 over the sum of both variances has the median .7.
    """
    if response.variance is None:
        return True
    scatter = sum((response.variance[:, i, j] for i, j in pairs), np.zeros(response.count))
    power = sum((np.abs(response.values[:, i, j]) ** 2 for i, j in pairs), np.zeros(response.count))
    off, clear = np.abs(difference) ** 2, power > _CERTAIN * scatter
    most = bool(clear.any()) and np.mean(off[clear] > _CERTAIN * scatter[clear]) > 0.5
    return bool(most and off.sum() > _CERTAIN * scatter.sum())
