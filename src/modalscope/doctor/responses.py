"""Examination of responses: what their channels, coherence, signs, slopes and resolution say."""

from __future__ import annotations

import numpy as np
import scipy

from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse
from modalscope.data.window import line_step
from modalscope.doctor.findings import Finding, dead_channels, identical_channels, sides_of
from modalscope.doctor.polarity import check_polarity, check_slope, level
from modalscope.numerics.checks import Array, RealArray

__all__ = ["bandwidths", "examine_response", "no_phase", "odd_phases"]


# --------------------------------------------------------------------------------------------------------- line checks
# Faults of frequency responses line by line: lines that stand alone, phases that run backwards, phases that are no phases.

#: A line that stands alone is so many times larger than what the lines beside it give there, or smaller, in every pair, and the square of
#: that where there are fewer than three pairs: two narrow modes side by side look like it in one pair, hardly in all ...
_ALONE, _PAIRS = 2.0, 3

#: ... and so many times further away from that than so many lines on either side usually are.
_UNUSUAL, _AROUND = 6.0, 10

#: The sum of products of neighbouring lines exceeds what noise makes of it by so many deviations (one of 700 sets of noise alone).
_SURE = 3.0

#: Less than this part of the energy in imaginary parts is none.
_REAL = 1e-12


def conjugated(response: FrequencyResponse) -> list[Finding]:
    """Find responses whose phase rises along the resonances: the conjugate of a causal response, by exp(-j w t).

    sum conj(H_k) H_(k+1) has the angle -dw t, with t the mean time at which the energy of h arrives, sum t |h|^2 / sum |h|^2: later
    than the impulse in every structure. So that one resonance does not decide alone, products p count as p / sqrt |p|; of noise
    alone the imaginary part of their sum has the variance sum |p| / 2.
    """
    if response.lines < 8:
        return []
    H = response.values
    gap = np.diff(response.frequencies)
    even = gap < 1.5 * np.median(gap)  # across a gap the angle means nothing
    products = (np.conj(H[:-1]) * H[1:])[even]
    size = np.abs(products)
    total = float(np.sum(products.imag / np.sqrt(np.maximum(size, np.finfo(float).tiny))))
    if total <= _SURE * float(np.sqrt(np.sum(size) / 2)):
        return []
    return [
        Finding(
            "conjugated",
            response.output_dofs,
            "phases rise along the resonances: energy would arrive before the impulse",
            "Take the complex conjugate of the values, or change the sign of the phases; for the time convention exp(-j w t).",
        )
    ]


def no_phase(response: FrequencyResponse) -> list[Finding]:
    """Find responses without imaginary parts: magnitudes, or levels in decibels where negative values are among them."""
    H = response.values
    if response.lines < 3 or np.sum(H.imag**2) > _REAL * np.sum(np.abs(H) ** 2):
        return []
    decibels = bool(np.any(H.real < 0)) and float(np.ptp(H.real)) > 10
    what = (
        "values look like decibels without a phase" if decibels else "all values are real: magnitudes without a phase"
    )
    change = "Give complex values" + (", 10^(dB / 20) exp(j phase)." if decibels else ", magnitude times exp(j phase).")
    return [Finding("no phase", response.output_dofs, what, change)]


def lone_lines(response: FrequencyResponse) -> list[Finding]:
    """Find lines that stand alone in every pair: mains, an overload, a line that was edited. See `stands_alone`."""
    if response.lines < 2 * _AROUND:
        return []
    found = stands_alone(response.values.reshape(response.lines, -1))
    if not found.size:
        return []
    where = ", ".join(f"{response.frequencies[k]:.6g}" for k in found[:5]) + (", ..." if found.size > 5 else "")
    return [
        Finding(
            "lone lines",
            response.output_dofs,
            f"{found.size} lines stand far out of their neighbours in every pair, at {where} Hz",
            "Look for mains or an edited line; leave these lines out: response.at_lines(...).",
            tuple(float(f) for f in response.frequencies[found]),
        )
    ]


def stands_alone(H: Array) -> Array:
    """Return the lines that differ in all channels from what two lines on either side of them give, whether a resonance is there or not.

    One mode beside a level is H_c(x) = (a_c + b_c x) / (1 + g x), with x in lines and g the same in all channels, however narrow it is. The
    lines at x = -2, -1, 1, 2 determine g, by least squares over all channels, and a_c, which line 0 should be. So does a cubic, H_c(0) =
    (-H_c(-2) + 4 H_c(-1) + 4 H_c(1) - H_c(2)) / 6. Both must be away by a factor, to the same side, and further than noise puts them, in
    every channel where they stand out of the noise: near an antiresonance a factor is one of noise. A line that is found spoils what is
    expected of its neighbours: what it should be takes its place, and all are looked at again.

    Parameters
    ----------
    H : array of complex, (F, c)
    """
    H, found = H.copy(), np.zeros(len(H), dtype=bool)
    while True:
        size, mode = _sizes(H)
        # a line spoils what is expected of those beside it
        top = [k for k in np.flatnonzero(size) if size[k] == size[max(k - 2, 0) : k + 3].max() and not found[k + 2]]
        if not top:
            return np.flatnonzero(found)
        found[np.array(top) + 2] = True
        H[np.array(top) + 2] = mode[top]


def _sizes(H: Array) -> tuple[RealArray, Array]:
    """Return the logarithm of the least factor by which each inner line stands alone, 0 of others, and what it should be."""
    mode, cubic = _expected(H)
    here, tiny = H[2:-2], np.finfo(float).tiny
    level, given = np.log(np.maximum(np.abs(here), tiny)), np.maximum(np.abs(np.stack([mode, cubic])), tiny)
    factors = level - np.log(given)
    away = np.abs(here - mode)
    noise = _UNUSUAL * _usual(away)
    tells = given.min(axis=0) > noise
    one_side = np.all((factors > 0) | ~tells, axis=(0, 2)) | np.all((factors < 0) | ~tells, axis=(0, 2))
    least = np.abs(factors).min(axis=0)
    size = np.where(tells, least, np.inf).min(axis=1)
    # noise of one size, and noise as large as the lines are
    far = np.all((away > noise) | ~tells, axis=1) & (
        size > _UNUSUAL * _usual(np.median(least, axis=1, keepdims=True))[:, 0]
    )
    count = tells.sum(axis=1)
    enough = (count >= min(_PAIRS, H.shape[1])) & (size > np.log(_ALONE) * np.where(count >= _PAIRS, 1, 2))
    return np.where(one_side & far & enough, size, 0.0), mode


def _expected(H: Array) -> tuple[Array, Array]:
    """Return what each line should be by one mode beside a level, and by a cubic, (F - 4, c) each."""
    x = np.array([-2.0, -1.0, 1.0, 2.0])
    beside = np.stack([H[:-4], H[1:-3], H[3:-1], H[4:]])
    turned = beside * x[:, None, None]
    # orthogonal to straight lines in x
    free = np.eye(4) - 1 / 4 - np.outer(x, x) / 10
    own, other = np.tensordot(free, beside, 1), np.tensordot(free, turned, 1)
    size = np.maximum(np.sum(np.abs(other) ** 2, axis=(0, 2)), np.finfo(float).tiny)
    g = -np.sum(np.conj(other) * own, axis=(0, 2)) / size
    mode = beside.mean(axis=0) + g[:, None] * turned.mean(axis=0)
    return mode, np.tensordot(np.array([-1.0, 4.0, 4.0, -1.0]) / 6, beside, 1)


def _usual(x: RealArray) -> RealArray:
    """Return the medians of x (n, c) over the neighbourhood of every row."""
    padded = np.pad(x, ((_AROUND, _AROUND), (0, 0)), mode="reflect")
    wide = np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1, axis=0)
    return np.asarray(np.median(wide, axis=2))


# -------------------------------------------------------------------------------------------------------- phase checks
# Levels and angles given where complex values belong: decibels, degrees, magnitude beside phase.

#: Fewer lines say too little.
_LEAST = 16

#: An angle that wraps jumps by nearly a turn, from above this part of its limit to below minus that.
_WRAPS = 0.8

#: Angles in degrees taken for radians: the real axis comes out at 0 and +-233 degrees. So many lines lie within 8 degrees of the one, and
#: so few within 8 of 180, where no structure has them so.
_TURNED, _NEAR, _MANY, _FEW = np.radians(np.degrees(180.0) % 360), np.radians(8), 0.25, 0.05

#: From line to line ln |H| and the phase (rad) change by as much: noise moves both alike, and between resonances the phase rests.
#: Degrees that were taken for radians change 57 times as much. So many times more is neither noise nor a structure, where phases move
#: by so many radians at all.
_MORE, _JUMP = 8.0, 0.1

#: Levels in dB lie between these, and seldom far from their median; no response has so small a range around its resonances.
_DECIBELS, _RANGE = 200.0, 6.0


def odd_phases(response: FrequencyResponse) -> list[Finding]:
    """Find magnitude and phase in the places of real and imaginary part, degrees taken for radians, and levels in dB with a phase."""
    H = response.values
    if response.lines < _LEAST or not np.any(H.imag):
        return []
    found = _parts(H) or _degrees(H) or _levels(H)
    return [] if not found else [Finding("no complex values", response.output_dofs, *found)]


def _parts(H: Array) -> tuple[str, str] | None:
    """Whether imaginary parts are angles: they never leave +-180 or +-pi, and jump from the one to the other."""
    for limit, unit in ((180.0, "degrees"), (np.pi, "radians")):
        x = H.imag / limit
        if np.abs(x).max() > 1 + 1e-6:
            continue
        high, low = x > _WRAPS, x < -_WRAPS
        jumps = int(np.sum((high[:-1] & low[1:]) | (low[:-1] & high[1:])))
        if jumps < 2 or np.abs(x).max() < 0.95:
            continue
        level = bool(np.any(H.real < 0))
        angle = "phase" if unit == "radians" else "radians(phase)"
        return (
            f"imaginary parts lie within +-{limit:.6g} and jump {jumps} times from end to end: they are phases in {unit}"
            + (", and real parts levels in dB" if level else ", and real parts magnitudes"),
            f"Give {'10^(dB / 20)' if level else 'magnitude'} exp(j {angle}).",
        )
    return None


def _degrees(H: Array) -> tuple[str, str] | None:
    """Whether phases cluster where degrees that were taken for radians put the real axis."""
    phase = np.angle(H[np.abs(H) > 0])
    if not phase.size:
        return None
    turned = np.abs(np.abs(phase) - (2 * np.pi - _TURNED)) < _NEAR
    change = "Give magnitude exp(j radians(phase))."
    if np.mean(turned) > _MANY and np.mean(np.abs(np.abs(phase) - np.pi) < _NEAR) < _FEW:
        where = (
            f"near +-{np.degrees(2 * np.pi - _TURNED):.0f} degrees, where 180 lies when degrees are taken for radians"
        )
        return f"{100 * np.mean(turned):.0f} % of the phases are {where}", change
    return (
        ("phases jump from line to line where magnitudes are smooth: degrees were taken for radians", change)
        if _rough(H)
        else None
    )


def _rough(H: Array) -> bool:
    """Whether phases change from line to line many times as much as the logarithms of magnitudes do, in the median of all."""
    size = np.maximum(np.abs(H), np.finfo(float).tiny)
    steps = np.conj(H[:-1]) * H[1:]
    steps = steps / np.maximum(np.abs(steps), np.finfo(float).tiny)
    # a delay turns all of a pair alike
    left = np.median(np.abs(np.angle(steps * np.conj(steps.sum(axis=0)))))
    return bool(left > max(_JUMP, _MORE * float(np.median(np.abs(np.diff(np.log(size), axis=0))))))


def _levels(H: Array) -> tuple[str, str] | None:
    """Whether magnitudes are levels: of the size of dB, of little range, and small where the phase falls, at the resonances."""
    size = np.abs(H)
    middle = float(np.median(size))
    if not (2 < middle < _DECIBELS and size.max() < min(_DECIBELS, _RANGE * middle)):
        return None
    fall = -np.angle(H[1:] * np.conj(H[:-1]))
    local = (size[1:] + size[:-1]) / 2
    weighted, plain = _mean(fall, local**2), _mean(fall, np.ones_like(local))
    if plain <= 0 or weighted >= plain:
        return None
    return (
        f"magnitudes lie between {size.min():.3g} and {size.max():.3g} and are small where the phase falls: they are levels in dB",
        "Give 10^(dB / 20) exp(j phase).",
    )


def _mean(x: RealArray, weight: RealArray) -> float:
    return float(np.sum(x * weight) / max(float(np.sum(weight)), 1e-300))


# ----------------------------------------------------------------------------------------------------- response checks

#: Less than this part of an output's power explained by the inputs is little: short segments alone leave more.
_COHERENT = 0.6

#: A decay to one per cent within the record of one line spacing: half-power bandwidth of this many lines.
_RESOLVED = np.log(100) / np.pi


def examine_response(response: Response) -> list[Finding]:
    """Return what is wrong, or may be, with responses; coherence, slopes and resolution are those of lines."""
    found = [finding for _, flat, labels in sides_of(response) for finding in dead_channels(flat, labels)]
    _, flat, labels = sides_of(response)[0]
    found += identical_channels(flat, labels)
    found += check_polarity(response)
    if isinstance(response, FrequencyResponse):
        unlike = odd_phases(response) or no_phase(response)
        if unlike:  # the others would speak of what are no complex values
            return found + unlike
        found += conjugated(response)
        found += _coherence(response) + check_slope(response) + _resolution(response) + lone_lines(response)
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


def bandwidths(response: FrequencyResponse) -> tuple[Array, RealArray]:
    """Return the lines of the peaks of all channels together, and their half-power bandwidths in Hz."""
    log_size = level(response)
    peaks = scipy.signal.find_peaks(log_size, prominence=np.log(5))[0]
    # half power is log sqrt(2) below the top
    widths = scipy.signal.peak_widths(np.exp(2 * log_size), peaks, rel_height=0.5)[0]
    step = np.gradient(response.frequencies) if response.lines > 1 else np.ones(1)
    return peaks, np.asarray(widths * step[peaks])


def _resolution(response: FrequencyResponse) -> list[Finding]:
    """Look for resonances narrower than the lines resolve; only in estimates, which exact responses are not."""
    if response.averages is None and response.coherence is None:
        return []
    peaks, widths = bandwidths(response)
    if response.lines < 3 or peaks.size == 0:
        return []
    step = line_step(response)
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
            tuple(float(f) for f in response.frequencies[peaks[narrow]]),
        )
    ]
