"""Examination of frequency responses: coherence, reciprocity, polarity, quantity, resolution."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import scipy

from modalscope.model.channels import QUANTITIES
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.labels import parse_dof
from modalscope.preprocess.findings import Finding, dead_channels, identical_channels

__all__ = ["bandwidths", "examine_response"]

#: Less than this part of an output's power explained by the inputs is little: short segments alone leave more.
_COHERENT = 0.6

#: Differences are believed when their power is this many times what the estimates' own variance makes of it.
_CERTAIN = 4.0

#: Reciprocal responses differ by less than this part of their size, in measurements, too.
_RECIPROCAL = 0.5

#: A repair (a swap, a change of sign) is believed when it takes the difference below this part of what it was.
_REPAIRED = 0.3

#: Slopes of log |H| over log f below the first resonance, for fixed and for free structures.
_SLOPES = {"displacement": (0.0, -2.0), "velocity": (1.0, -1.0), "acceleration": (2.0, 0.0)}

#: A slope contradicts a quantity when farther than this from both of its own, and points to one when nearer than that.
_FAR, _NEAR = 0.7, 0.4

#: A decay to one per cent within the record of one line spacing: half-power bandwidth of this many lines.
_RESOLVED = np.log(100) / np.pi


def examine_response(response: FrequencyResponse) -> list[Finding]:
    """Return what is wrong, or may be, with frequency responses."""
    flat = response.values.transpose(0, 2, 1).reshape(-1, len(response.output_dofs))
    found = dead_channels(flat, response.output_dofs) if np.any(flat) else []
    alike = identical_channels(np.concatenate([flat.real, flat.imag]), response.output_dofs)
    found += alike
    found += _coherence(response)
    found += _reciprocity(response)
    found += _passivity(response)
    found += _slope(response)
    found += _resolution(response)
    return found


def _coherence(response: FrequencyResponse) -> list[Finding]:
    if response.coherence is None:
        return []
    c = response.coherence if response.coherence.ndim == 2 else response.coherence.min(axis=2)
    power = np.sum(np.abs(response.values) ** 2, axis=2)
    found = []
    for i, dof in enumerate(response.output_dofs):
        total = float(power[:, i].sum())
        explained = float(c[:, i] @ power[:, i]) / total if total > 0 else 1.0
        if explained < _COHERENT:
            found.append(
                Finding(
                    "low coherence",
                    (dof,),
                    f"{explained:.2f} around its resonances: so much of its power follows from the inputs",
                    "Look for overloaded hits, forces that were not measured, noise, or too short segments.",
                )
            )
    return found


def _pairs(response: FrequencyResponse) -> list[tuple[int, int, float]]:
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


def _difference(a: Array, b: Array) -> float:
    size = np.linalg.norm(a) + np.linalg.norm(b)
    return float(2 * np.linalg.norm(a - b) / size) if size else 0.0


def _certain(difference: Array, response: FrequencyResponse, *pairs: tuple[int, int]) -> bool:
    """Whether a difference of estimates is larger than their scatter."""
    if response.variance is None:
        return True
    scatter = sum(float(response.variance[:, i, j].sum()) for i, j in pairs)
    return float(np.sum(np.abs(difference) ** 2)) > _CERTAIN * scatter


def _reciprocity(response: FrequencyResponse) -> list[Finding]:
    """Compare H_ij with H_ji where both sides have the same dofs; try a change of sign and swapped outputs as the reason."""
    H, found = response.values, []
    for (i, a, sa), (j, b, sb) in combinations(_pairs(response), 2):
        if i == j or a == b:
            continue
        one, other = sb * H[:, i, b], sa * H[:, j, a]
        off = _difference(one, other)
        if off < _RECIPROCAL or not _certain(one - other, response, (i, b), (j, a)):
            continue
        names = (response.output_dofs[i], response.output_dofs[j])
        if _difference(one, -other) < _REPAIRED * off:
            reason, kind = f"{names[0]} to {names[1]} is the negative of the way back", "polarity"
            change = "Turn the sign of one of these sensors (or of its force), after comparing it with the others."
        elif _difference(sb * H[:, j, b], sa * H[:, i, a]) < _REPAIRED * off:
            reason, kind = (
                "the responses between them are the same both ways only when the two outputs are exchanged",
                "swapped",
            )
            change = "Exchange the labels of these two outputs."
        else:
            reason, kind = (
                f"the responses between them differ by {100 * off:.0f} % from one way to the other",
                "reciprocity",
            )
            change = "Check labels, directions and calibration of these points; a structure that changes with level does it, too."
        found.append(Finding(kind, names, reason, change))
    return found


def _passivity(response: FrequencyResponse) -> list[Finding]:
    """Check Re(H as velocity) >= 0 at driving points: a force does work on the structure, at every frequency."""
    if response.quantity is None:
        return []
    f, found = response.frequencies, []
    for i, j, sign in _pairs(response):
        scores = {q: _work(sign * response.values[:, i, j], f, q) for q in QUANTITIES}
        own = scores[response.quantity]
        if own > 0:
            continue
        dof = response.output_dofs[i]
        best = max(scores, key=lambda q: scores[q])
        slope = _low_slope(response)
        fits = slope is not None and min(abs(slope - s) for s in _SLOPES[best]) < _NEAR
        if best != response.quantity and scores[best] > 0.9 and fits and own > -0.9:
            found.append(_quantity_finding(response.quantity, best, (dof,), f"the force at {dof} does work only then"))
        elif own < -0.9:
            found.append(
                Finding(
                    "polarity",
                    (dof,),
                    "the force takes energy out of the structure at its own point",
                    f"Turn the sign of {dof} or of its force; or correct the quantity, {response.quantity}.",
                )
            )
        else:
            found.append(
                Finding(
                    "swapped",
                    (dof,),
                    "its response to its own force has resonances of both signs, which a driving point cannot have",
                    "Check which channel was at the force, the directions, and the quantity.",
                )
            )
    return found


def _work(H: ComplexArray, f: RealArray, quantity: str) -> float:
    """Return the mean sign of Re(velocity / force), -1 to 1, weighted with its size and the response's: 1 for a driving point.

    Resonances decide: between them a delay of half a sample is enough to turn the sign.
    """
    inside = f > 0
    mobility = H[inside] * (2j * np.pi * f[inside]) ** (1 - QUANTITIES[quantity])
    work = mobility.real * np.abs(mobility)
    size = float(np.abs(work).sum())
    return float(work.sum()) / size if size else 1.0


def _level(response: FrequencyResponse) -> RealArray:
    """Return log |H| of all channels together, (F,), each channel scaled to its own mean square."""
    power = np.abs(response.values) ** 2
    mean = power.mean(axis=0, keepdims=True)
    scaled = np.divide(power, mean, out=np.zeros_like(power), where=mean > 0)
    return np.asarray(0.5 * np.log(np.maximum(scaled.mean(axis=(1, 2)), np.finfo(float).tiny)))


def _low_slope(response: FrequencyResponse) -> float | None:
    """Return the slope of log |H| over log f from a sixth to half of the first resonance, of what a spring or a mass alone does.

    None with fewer than six lines there, or where H is neither: a static response is real for an even slope, imaginary for
    an odd one, and what leaks from a resonance is not.
    """
    f, level = response.frequencies, _level(response)
    peaks = scipy.signal.find_peaks(level, prominence=np.log(5))[0]
    if peaks.size == 0:
        return None
    first = f[peaks[0]]
    low = (f > first / 6) & (f < first / 2) & (f > 0)
    if int(low.sum()) < 6 or f[low][-1] < 1.5 * f[low][0]:
        return None
    x, y = np.log(f[low]), level[low] + np.log(1 - (f[low] / first) ** 2)  # without the resonance's own rise
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


def _slope(response: FrequencyResponse) -> list[Finding]:
    slope = _low_slope(response)
    if response.quantity is None or slope is None:
        return []
    near = {q: min(abs(slope - s) for s in slopes) for q, slopes in _SLOPES.items()}
    best = min(near, key=lambda q: near[q])
    if near[response.quantity] < _FAR or near[best] > _NEAR:
        return []
    why = f"below the first resonance |H| goes with the power {slope:.1f} of the frequency"
    return [_quantity_finding(response.quantity, best, response.output_dofs, why)]


def _quantity_finding(given: str, better: str, dofs: tuple[str, ...], why: str) -> Finding:
    return Finding(
        "wrong quantity",
        dofs,
        f"called {given}, they look like {better}: {why}",
        f'Give quantity="{better}" if that is what was measured.',
    )


def bandwidths(response: FrequencyResponse) -> tuple[Array, RealArray]:
    """Return the lines of the peaks of all channels together, and their half-power bandwidths in Hz."""
    level = _level(response)
    peaks = scipy.signal.find_peaks(level, prominence=np.log(5))[0]
    # half power is log sqrt(2) below the top
    widths = scipy.signal.peak_widths(np.exp(2 * level), peaks, rel_height=0.5)[0]
    step = np.gradient(response.frequencies) if response.lines > 1 else np.ones(1)
    return peaks, np.asarray(widths * step[peaks])


def _resolution(response: FrequencyResponse) -> list[Finding]:
    """Look for resonances narrower than the lines resolve; only in estimates, which exact responses are not."""
    if response.averages is None and response.coherence is None:
        return []
    peaks, widths = bandwidths(response)
    if response.lines < 3 or peaks.size == 0:
        return []
    step = float(np.median(np.diff(response.frequencies)))
    narrow = widths < _RESOLVED * step
    if not np.any(narrow):
        return []
    where = ", ".join(f"{response.frequencies[k]:.4g}" for k in peaks[narrow][:5])
    return [
        Finding(
            "short record",
            response.output_dofs,
            f"the resonances at {where} Hz are narrower than {_RESOLVED:.1f} lines of {step:.3g} Hz: within one over the line "
            "spacing their vibration does not decay to one per cent",
            "Measure longer, use longer segments, or an exponential window for hits.",
        )
    ]
