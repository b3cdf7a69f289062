"""Check responses: outlying lines, phases, complex values, coherence, resolution; signs and slopes are in `polarity`."""

from __future__ import annotations

from collections.abc import Container
from math import comb
from typing import Any

import numpy as np
import scipy

from modalscope.data.notes import Finding, Note
from modalscope.data.records import Signals
from modalscope.data.response import Response, line_step
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import counted, figures
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import telling
from modalscope.signals.doctor.findings import dead_channels, finding, identical_channels, sides_of
from modalscope.signals.doctor.one_place import white_noise
from modalscope.signals.doctor.polarity import check_polarity, check_slope, driving_points, level

#: Minimum factor between an isolated line and the value interpolated from its neighbours, in every pair; its square where there are fewer
#: than three pairs: two narrow modes next to each other differ as much in one pair, hardly in all.
_MIN_FACTOR, _MIN_PAIRS = 2.0, 3

#: Minimum distance of an isolated line from that value, over the median of so many lines on either side.
_MIN_DISTANCE, _NEIGHBOURS = 6.0, 10

#: Number of pairs that are searched for isolated lines first, where there are more: of those that show in a tenth of many pairs one of a
#: hundred is missed.
_SAMPLE = 84

#: Outputs that are drawn to estimate the response of a record of more, beside driving points and those of low coherence.
_DRAWN_OUTPUTS = 24

#: Maximum bend of the lines on both sides of an isolated one, over the median of its surroundings: a resonance bends them, and mains or an
#: edited line do not. Of 1200 simulated tests with resonances narrower than a line, half of them after a Hann window, 24 % had findings
#: without this limit and .7 % with it, and 177 of 200 spoilt lines are found for 180.
_MAX_BEND = 3.0

#: Lines around an isolated one whose bend counts as usual, without the nearest; and at least so many.
_SURROUNDINGS, _NEAREST, _MIN_SURROUNDINGS = 20, 4, 8

#: Minimum sum of products of neighbouring lines, in standard deviations of noise, and channels that are asked at most. Of 600 random
#: responses of .1 to 3 % damping, 0 to 60 dB, none exceeds it, and 93 % of their conjugates do.
_MIN_PHASE_RISE, _MOST_CHANNELS = 3.0, 16

#: Maximum energy of the imaginary parts of real values, as a part of the whole.
_REAL_ENERGY = 1e-12

#: Minimum number of lines whose complex values are checked.
_MIN_LINES = 16

#: An angle that wraps jumps from above this part of its limit to below minus that.
_WRAP_LEVEL = 0.8

#: Angles in degrees taken for radians put the real axis at 0 and +-233 degrees. At least the first part of the phases lies within 8 degrees
#: of the latter, and at most the second within 8 degrees of 180, which no structure does.
_REAL_AXIS, _PHASE_TOLERANCE = np.radians(np.degrees(180.0) % 360), np.radians(8)
_MIN_AT_REAL_AXIS, _MAX_AT_180 = 0.25, 0.05

#: From line to line ln |H| and the phase (rad) change by as much: noise changes both alike, and between resonances the phase is constant.
#: Degrees taken for radians change 57 times as much. Minimum ratio that neither noise nor a structure has, and minimum change in radians.
_MIN_CHANGE_RATIO, _MIN_PHASE_CHANGE = 8.0, 0.1

#: Levels in dB lie between plus and minus the first number, and within the second factor of their median; no response has so small a range
#: around its resonances.
_MAX_DECIBELS, _MAX_LEVEL_RANGE = 200.0, 6.0

#: Minimum part of an output's power that the inputs explain: short segments alone leave more.
MIN_COHERENCE = 0.6

#: Minimum half-power bandwidth in lines: a vibration then decays to one per cent within one over the line spacing.
_MIN_BANDWIDTH = np.log(100) / np.pi

#: Lines at 0 Hz and above that offsets may reach, and the fall from line to line that is theirs.
_MOST_OFFSET, _OFFSET_FALLS = 8, 30.0


def without_offset(response: FrequencyResponse) -> tuple[FrequencyResponse, tuple[Note, ...]]:
    """Return responses without lines at 0 Hz and just above that hold the offsets of sensors, and what is said.

    Rigid motion falls by 4 from the first line to the second, and by less from then on; what a window spreads of an offset falls faster.
    """
    if response.frequencies[0] != 0 or len(response.frequencies) < _MIN_LINES:
        return response, ()
    size = np.abs(response.values[: _MOST_OFFSET + 1]).sum(axis=(1, 2))
    falls = np.flatnonzero(np.minimum.accumulate(size)[:-1] > _OFFSET_FALLS * size[1:])
    if not falls.size:
        return response, ()
    first = int(falls[-1]) + 1
    times = figures(size[0] / size[first], 2)
    said = f"{counted(first, 'line')} below {response.frequencies[first]:.4g} Hz left out, {times} times the next: offsets of sensors"
    left = response.at_lines(np.arange(len(response.frequencies)) >= first)
    return left, (Note("offset", {"lines": float(first)}, said),)


def conjugated(response: FrequencyResponse) -> list[Finding]:
    """Find responses whose phase rises along the resonances: the conjugate of a causal response, by exp(-j w t).

    sum conj(H_k) H_(k+1) has the angle -dw t, with t the mean time at which the energy of h arrives, sum t |h|^2 / sum |h|^2: later
    than the impulse in every structure. So that one resonance does not decide alone, products p count as p / sqrt |p|; the imaginary
    part of each has at most the variance of the noise of a line, and |p| / 2 where it is noise alone.
    """
    if response.lines < 8:
        return []
    H = response.values.reshape(1, response.lines, -1)
    H = H[:, :, :: -(-H.shape[2] // _MOST_CHANNELS)]
    gap = np.diff(response.frequencies)
    even = gap < 1.5 * np.median(gap)  # across a gap the angle means nothing
    noise, H = white_noise(H)[0], H[0]
    products = (np.conj(H[:-1]) * H[1:])[even]
    size, of_noise = np.abs(products), np.maximum(noise[:-1], noise[1:])[even]
    total = float(np.sum(products.imag / np.sqrt(np.maximum(size, np.finfo(float).tiny))))
    if total <= _MIN_PHASE_RISE * float(np.sqrt(np.sum(np.minimum(size / 2, of_noise)))):
        return []
    return [finding("conjugated", *response.output_dofs)]


def no_phase(response: FrequencyResponse) -> list[Finding]:
    """Find responses without imaginary parts: magnitudes, or levels in decibels where negative values are among them."""
    H = response.values
    if response.lines < 3 or np.sum(H.imag**2) > _REAL_ENERGY * np.sum(np.abs(H) ** 2):
        return []
    decibels = bool(np.any(H.real < 0)) and float(np.ptp(H.real)) > 10
    return [finding(f"no phase: {'decibels' if decibels else 'magnitudes'}", *response.output_dofs)]


def lone_lines(response: FrequencyResponse, *, whole: bool = False) -> list[Finding]:
    """Find lines that are isolated in every pair: mains, an overload, an edited line. See `isolated_lines`.

    Of many pairs `_SAMPLE` drawn ones are searched first, and all if these show a line, or with `whole`.
    """
    H = response.values.reshape(response.lines, -1)
    if response.lines < 2 * _NEIGHBOURS:
        return []
    if not whole and H.shape[1] > _SAMPLE:
        drawn = np.sort(np.random.default_rng(0).choice(H.shape[1], _SAMPLE, replace=False))
        if not isolated_lines(H[:, drawn]).size:
            return []
    at = response.frequencies[isolated_lines(H)]
    if not at.size:
        return []
    where = ", ".join(f"{f:.6g}" for f in at[:5]) + (", ..." if at.size > 5 else "")
    return [finding("lone lines", *response.output_dofs, at=at, count=at.size, where=where)]


def sampled(data: Any) -> tuple[Note, ...]:
    """Return a note where a check looks at a sample of the data, with the chance that it misses a fault.

    Of s drawn pairs or outputs of n fewer than q are among the k that show a fault with the probability of the hypergeometric distribution.
    Outlying lines are searched in pairs of a response, q = 3; the slope that contradicts a quantity in outputs of a record, q = 1.
    """
    outputs, inputs = len(data.output_dofs), len(getattr(data, "input_dofs", ()))
    if isinstance(data, FrequencyResponse):
        name, drawn, of, least = "pairs", _SAMPLE, outputs * inputs, _MIN_PAIRS
        what = "Outlying lines were searched in {0} of {1} pairs of output and input: one that exceeds the noise in a tenth of the pairs"
    else:
        name, drawn, of, least = "outputs", _DRAWN_OUTPUTS, outputs, 1
        what = "The quantity was checked in the responses of {0} of {1} outputs: one that is wrong in a tenth of the outputs"
    checked = inputs and (name == "pairs" or not (isinstance(data, Response) or data.quantity is None))
    if of <= drawn or not checked:
        return ()
    k = of // 10
    missed = sum(comb(k, i) * comb(of - k, drawn - i) for i in range(least)) / comb(of, drawn)
    text = f"{what.format(drawn, of)} is missed with probability {missed:.2g}. `modalscope info --whole` searches all"
    return (Note("data sampled", {name: drawn, "of": of, "missed": missed}, text),)


def isolated_lines(H: Array) -> Array:
    """Return the lines of H (F, c) that differ in all channels from the values interpolated from two lines on either side.

    A mode on a constant level is H_c(x) = (a_c + b_c x) / (1 + g x), with x in lines and g common to all channels, however narrow it is.
    The lines at x = -2, -1, 1, 2 determine g, by least squares over all channels, and a_c, the expected value of line 0. So does a cubic,
    H_c(0) = (-H_c(-2) + 4 H_c(-1) + 4 H_c(1) - H_c(2)) / 6. The line must differ from both by a factor, in the same direction, and by
    more than the noise, in every channel where they exceed it: near an antiresonance a factor is one of noise. An isolated line is
    replaced by its expected value, and the search is repeated, as it spoils the values expected of its neighbours.
    """
    H, isolated = H.copy(), np.zeros(len(H), dtype=bool)
    while True:
        size, mode = _sizes(H)
        # a line spoils the values expected of its neighbours
        top = [k for k in np.flatnonzero(size) if size[k] == size[max(k - 2, 0) : k + 3].max() and not isolated[k + 2]]
        if not top:
            return _without_resonances(H, np.flatnonzero(isolated))
        isolated[np.array(top) + 2] = True
        H[np.array(top) + 2] = mode[top]


def _without_resonances(H: Array, isolated: Array) -> Array:
    """Return the isolated lines whose neighbours are no bent flank of a resonance; H (F, c) with expected values in their places."""
    bend = _bends(H)
    spoilt = np.min(np.abs(np.arange(len(H))[:, None] - isolated), axis=1, initial=len(H)) < _NEAREST
    kept = []
    for k in isolated:
        around = np.arange(max(k - _SURROUNDINGS, 0), min(k + _SURROUNDINGS + 1, len(H)))
        usual = bend[around[(np.abs(around - k) > _NEAREST) & ~spoilt[around] & np.isfinite(bend[around])]]
        if len(usual) >= _MIN_SURROUNDINGS and bend[k] <= _MAX_BEND * np.median(usual):
            kept.append(k)
    return np.array(kept, dtype=int)


def _bends(H: Array) -> RealArray:
    """Return how far both neighbours of each line lie from a cubic, or one mode on a level, by the lines 2 and 3 away; NaN at the ends.

    The better of both counts, over all channels.
    """
    size = np.sqrt(np.mean(np.abs(H) ** 2, axis=0))
    level = H / np.where(size > 0, size, 1)
    count, bend = len(H) - 6, np.full(len(H), np.nan)
    if count < 1:
        return bend
    x, at = np.array([-3.0, -2.0, 2.0, 3.0]), np.array([-1.0, 1.0])
    around = np.stack([level[3 + int(k) : 3 + int(k) + count] for k in x])
    neighbours = np.stack([level[3 + int(k) : 3 + int(k) + count] for k in at])
    cubic = np.vander(at, 4) @ np.linalg.inv(np.vander(x, 4))
    g, mean, slope = _one_mode(around, x)
    mode = (mean + at[:, None, None] * slope) / (1 + at[:, None, None] * g[:, None])
    missed = [np.sum(np.abs(neighbours - y) ** 2, axis=(0, 2)) for y in (np.tensordot(cubic, around, 1), mode)]
    bend[3:-3] = np.sqrt(np.min(missed, axis=0))
    return bend


def _one_mode(values: Array, x: RealArray) -> tuple[Array, Array, Array]:
    """Return g (n,), a and b (n, c) of the mode on a constant level, (a + b x) / (1 + g x), that four values (4, n, c) determine at x."""
    times_x = values * x[:, None, None]
    # H (1 + g x) = a + b x: without the part that is straight in x, H + g x H = 0
    projector = np.eye(4) - 1 / 4 - np.outer(x, x) / float(x @ x)
    constant, slope = np.tensordot(projector, values, 1), np.tensordot(projector, times_x, 1)
    size = np.maximum(np.sum(np.abs(slope) ** 2, axis=(0, 2)), np.finfo(float).tiny)
    g = -np.sum(np.conj(slope) * constant, axis=(0, 2)) / size
    straight = values + g[:, None] * times_x
    return g, straight.mean(axis=0), np.tensordot(x / float(x @ x), straight, 1)


def _sizes(H: Array) -> tuple[RealArray, Array]:
    """Return the logarithm of the least factor by which each inner line is isolated, 0 if it is not, and its expected value."""
    mode, cubic = _expected(H)
    here, tiny = H[2:-2], np.finfo(float).tiny
    level, given = np.log(np.maximum(np.abs(here), tiny)), np.maximum(np.abs(np.stack([mode, cubic])), tiny)
    factors = level - np.log(given)
    distance = np.abs(here - mode)
    noise = _MIN_DISTANCE * _local_medians(distance)
    significant = given.min(axis=0) > noise
    one_side = np.all((factors > 0) | ~significant, axis=(0, 2)) | np.all((factors < 0) | ~significant, axis=(0, 2))
    least = np.abs(factors).min(axis=0)
    size = np.where(significant, least, np.inf).min(axis=1)
    # noise of one size, and noise as large as the lines are
    usual = _local_medians(np.median(least, axis=1, keepdims=True))[:, 0]
    unusual = np.all((distance > noise) | ~significant, axis=1) & (size > _MIN_DISTANCE * usual)
    count = significant.sum(axis=1)
    enough = (count >= min(_MIN_PAIRS, H.shape[1])) & (size > np.log(_MIN_FACTOR) * np.where(count >= _MIN_PAIRS, 1, 2))
    return np.where(one_side & unusual & enough, size, 0.0), mode


def _expected(H: Array) -> tuple[Array, Array]:
    """Return the values of the inner lines expected from a mode on a constant level, and from a cubic, (F - 4, c) each."""
    neighbours = np.stack([H[:-4], H[1:-3], H[3:-1], H[4:]])
    _, mode, _ = _one_mode(neighbours, np.array([-2.0, -1.0, 1.0, 2.0]))
    return mode, np.tensordot(np.array([-1.0, 4.0, 4.0, -1.0]) / 6, neighbours, 1)


def _local_medians(x: RealArray) -> RealArray:
    """Return the medians of x (n, c) over the neighbourhood of every row."""
    padded = np.pad(x, ((_NEIGHBOURS, _NEIGHBOURS), (0, 0)), mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1, axis=0)
    return np.asarray(np.median(windows, axis=2))


def no_complex_values(response: FrequencyResponse) -> list[Finding]:
    """Find magnitude and phase in the places of real and imaginary part, degrees taken for radians, and levels in dB with a phase."""
    H = response.values
    if response.lines < _MIN_LINES or not np.any(H.imag):
        return []
    for check in (_parts, _degrees, _rough, _levels):
        if fault := check(H):
            name, measured = fault
            return [finding(f"no complex values: {name}", *response.output_dofs, **measured)]
    return []


def _parts(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Return measures of imaginary parts that are angles: they never leave +-180 or +-pi, and jump from the one to the other."""
    for limit, unit in ((180.0, "degrees"), (np.pi, "radians")):
        x = H.imag / limit
        if np.abs(x).max() > 1 + 1e-6:
            continue
        high, low = x > _WRAP_LEVEL, x < -_WRAP_LEVEL
        jumps = int(np.sum((high[:-1] & low[1:]) | (low[:-1] & high[1:])))
        if jumps < 2 or np.abs(x).max() < 0.95:
            continue
        decibels = bool(np.any(H.real < 0))
        kind, magnitude = ("levels in dB", "10^(dB / 20)") if decibels else ("magnitudes", "magnitude")
        angle = "phase" if unit == "radians" else "radians(phase)"
        numbers = {"limit": limit, "jumps": jumps}
        return "parts", {**numbers, "unit": unit, "kind": kind, "magnitude": magnitude, "angle": angle}
    return None


def _degrees(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Return measures of phases that cluster where degrees taken for radians put the real axis."""
    phase = np.abs(np.angle(H))[H != 0]
    limit = 2 * np.pi - _REAL_AXIS
    share, at_180 = (float(np.mean(np.abs(phase - angle) < _PHASE_TOLERANCE)) for angle in (limit, np.pi))
    turned = share > _MIN_AT_REAL_AXIS and at_180 < _MAX_AT_180
    return ("turned", {"percent": 100 * share, "limit": np.degrees(limit)}) if turned else None


def _rough(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Return that phases change from line to line many times as much as the logarithms of magnitudes, in the median of all, or None.

    Of many channels some tell it.
    """
    H, tiny = H.reshape(len(H), -1)[:, telling(H[0].size)], np.finfo(float).tiny
    log_change = float(np.median(np.abs(np.diff(np.log(np.maximum(np.abs(H), tiny)), axis=0))))
    steps = np.conj(H[:-1])
    steps *= H[1:]
    steps /= np.maximum(np.abs(steps), tiny)
    steps *= np.conj(steps.sum(axis=0))  # a delay turns all lines of a pair alike
    change = np.median(np.abs(np.angle(steps)))
    return ("rough", {}) if change > max(_MIN_PHASE_CHANGE, _MIN_CHANGE_RATIO * log_change) else None


def _levels(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Return measures of magnitudes that are levels: of the size of dB, of little range, and small where the phase falls, at resonances."""
    size = np.abs(H)
    middle = float(np.median(size))
    if not (2 < middle < _MAX_DECIBELS and size.max() < min(_MAX_DECIBELS, _MAX_LEVEL_RANGE * middle)):
        return None
    fall = -np.angle(H[1:] * np.conj(H[:-1]))
    local = (size[1:] + size[:-1]) / 2
    mean, weighted = float(np.mean(fall)), float(np.sum(fall * local**2) / max(float(np.sum(local**2)), 1e-300))
    if mean <= 0 or weighted >= mean:
        return None
    return "levels", {"low": size.min(), "high": size.max()}


def examine_response(response: Response, *, whole: bool = False) -> list[Finding]:
    """Return the findings on a response; coherence, slopes and resolution are those of lines. `whole`: outlying lines in all pairs."""
    # columns are as large as the data: they are not kept from one check to the next
    findings = [f for _, columns, labels in sides_of(response) for f in dead_channels(columns, labels)]
    findings += identical_channels(*sides_of(response)[0][1:]) + check_polarity(response)
    if isinstance(response, FrequencyResponse):
        unusable = no_complex_values(response) or no_phase(response)
        if unusable:  # the other checks need complex values
            return findings + unusable
        for check in (conjugated, _coherence, check_slope, _resolution):
            findings += check(response)
        findings += lone_lines(response, whole=whole)
    return findings


def outputs_to_estimate(signals: Signals, explained: Container[str]) -> list[int]:
    """Return the outputs whose responses are estimated: driving points, those of low coherence unless it is explained, and drawn ones.

    The drawn ones show the slope below the first resonance, where the quantity is known: one that contradicts it does so in most outputs.
    """
    outputs = signals.output_dofs
    needed = {i for i, dof in enumerate(outputs) if dof not in explained} | {i for i, _, _ in driving_points(signals)}
    rest = [i for i in range(len(outputs)) if i not in needed] if signals.quantity is not None else []
    drawn = np.random.default_rng(0).choice(rest, min(_DRAWN_OUTPUTS, len(rest)), replace=False)
    return sorted({*needed, *drawn.tolist()})


def examine_estimate(response: FrequencyResponse) -> list[Finding]:
    """Return what a response estimated from a record shows beyond the record itself: signs, coherence and slope."""
    usable = not (no_complex_values(response) or no_phase(response))
    return check_polarity(response) + (_coherence(response) + check_slope(response) if usable else [])


def _coherence(response: FrequencyResponse) -> list[Finding]:
    if response.coherence is None:
        return []
    c = response.coherence if response.coherence.ndim == 2 else response.coherence.min(axis=2)
    power = np.sum(np.abs(response.values) ** 2, axis=2)
    total = power.sum(axis=0)
    explained = np.divide(np.sum(c * power, axis=0), total, out=np.ones(len(total)), where=total > 0)
    pairs = zip(response.output_dofs, explained.tolist(), strict=True)
    return [finding("low coherence", dof, explained=part) for dof, part in pairs if part < MIN_COHERENCE]


def bandwidths(response: FrequencyResponse) -> tuple[Array, RealArray]:
    """Return the lines of the peaks of all channels together, and their half-power bandwidths in Hz."""
    log_size = level(response)
    peaks = scipy.signal.find_peaks(log_size, prominence=np.log(5))[0]
    # half power is log sqrt(2) below the top
    widths = scipy.signal.peak_widths(np.exp(2 * log_size), peaks, rel_height=0.5)[0]
    step = np.gradient(response.frequencies) if response.lines > 1 else np.ones(1)
    return peaks, np.asarray(widths * step[peaks])


def _resolution(response: FrequencyResponse) -> list[Finding]:
    """Find resonances narrower than the lines resolve, in estimates only: exact responses have no averages."""
    if response.averages is None and response.coherence is None:
        return []
    peaks, widths = bandwidths(response)
    if response.lines < 3 or peaks.size == 0:
        return []
    step = line_step(response)
    at = response.frequencies[peaks[widths < _MIN_BANDWIDTH * step]]
    if not at.size:
        return []
    where = ", ".join(f"{f:.4g}" for f in at[:5])
    measured = {"where": where, "resolved": _MIN_BANDWIDTH, "step": step}
    return [finding("short record: lines", *response.output_dofs, at=at, **measured)]
