"""Check responses: single lines, phases, complex values, coherence, resolution; signs and slopes are in `polarity`."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from modalscope.data.notes import Finding
from modalscope.data.response import Response, line_step
from modalscope.data.responses import FrequencyResponse
from modalscope.doctor.findings import dead_channels, finding, identical_channels, sides_of
from modalscope.doctor.polarity import check_polarity, check_slope, level
from modalscope.numerics.checks import Array, RealArray

# --------------------------------------------------------------------------------------------------------- line checks
# Faults of frequency responses line by line: isolated lines, phases that rise along resonances, missing phases.

#: An isolated line differs from the value interpolated from its neighbours by this factor in every pair, and by its square where there
#: are fewer than three pairs: two narrow modes side by side do so in one pair, hardly in all ...
_ALONE, _PAIRS = 2.0, 3

#: ... and so many times further than the lines of this neighbourhood, on either side, usually do.
_UNUSUAL, _AROUND = 6.0, 10

#: The sum of products of neighbouring lines exceeds so many standard deviations of noise alone (one of 700 sets of noise does).
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
    return [finding("conjugated", *response.output_dofs)]


def no_phase(response: FrequencyResponse) -> list[Finding]:
    """Find responses without imaginary parts: magnitudes, or levels in decibels where negative values are among them."""
    H = response.values
    if response.lines < 3 or np.sum(H.imag**2) > _REAL * np.sum(np.abs(H) ** 2):
        return []
    decibels = bool(np.any(H.real < 0)) and float(np.ptp(H.real)) > 10
    return [finding(f"no phase: {'decibels' if decibels else 'magnitudes'}", *response.output_dofs)]


def lone_lines(response: FrequencyResponse) -> list[Finding]:
    """Find lines that are isolated in every pair: mains, an overload, an edited line. See `isolated_lines`."""
    if response.lines < 2 * _AROUND:
        return []
    found = isolated_lines(response.values.reshape(response.lines, -1))
    if not found.size:
        return []
    where = ", ".join(f"{response.frequencies[k]:.6g}" for k in found[:5]) + (", ..." if found.size > 5 else "")
    frequencies = response.frequencies[found]
    return [finding("lone lines", *response.output_dofs, at=frequencies, count=found.size, where=where)]


def isolated_lines(H: Array) -> Array:
    """Return the lines of H (F, c) that differ in all channels from the values interpolated from two lines on either side.

    A mode on a constant level is H_c(x) = (a_c + b_c x) / (1 + g x), with x in lines and g common to all channels, however narrow it is.
    The lines at x = -2, -1, 1, 2 determine g, by least squares over all channels, and a_c, the expected value of line 0. So does a cubic,
    H_c(0) = (-H_c(-2) + 4 H_c(-1) + 4 H_c(1) - H_c(2)) / 6. The line must differ from both by a factor, in the same direction, and by
    more than the noise, in every channel where they exceed it: near an antiresonance a factor is one of noise. A line that is found is
    replaced by its expected value, and the search is repeated, as it spoils the values expected of its neighbours.
    """
    H, found = H.copy(), np.zeros(len(H), dtype=bool)
    while True:
        size, mode = _sizes(H)
        # a line spoils the values expected of its neighbours
        top = [k for k in np.flatnonzero(size) if size[k] == size[max(k - 2, 0) : k + 3].max() and not found[k + 2]]
        if not top:
            return np.flatnonzero(found)
        found[np.array(top) + 2] = True
        H[np.array(top) + 2] = mode[top]


def _sizes(H: Array) -> tuple[RealArray, Array]:
    """Return the logarithm of the least factor by which each inner line is isolated, 0 if it is not, and its expected value."""
    mode, cubic = _expected(H)
    here, tiny = H[2:-2], np.finfo(float).tiny
    level, given = np.log(np.maximum(np.abs(here), tiny)), np.maximum(np.abs(np.stack([mode, cubic])), tiny)
    factors = level - np.log(given)
    away = np.abs(here - mode)
    noise = _UNUSUAL * _usual(away)
    significant = given.min(axis=0) > noise
    one_side = np.all((factors > 0) | ~significant, axis=(0, 2)) | np.all((factors < 0) | ~significant, axis=(0, 2))
    least = np.abs(factors).min(axis=0)
    size = np.where(significant, least, np.inf).min(axis=1)
    # noise of one size, and noise as large as the lines are
    far = np.all((away > noise) | ~significant, axis=1) & (
        size > _UNUSUAL * _usual(np.median(least, axis=1, keepdims=True))[:, 0]
    )
    count = significant.sum(axis=1)
    enough = (count >= min(_PAIRS, H.shape[1])) & (size > np.log(_ALONE) * np.where(count >= _PAIRS, 1, 2))
    return np.where(one_side & far & enough, size, 0.0), mode


def _expected(H: Array) -> tuple[Array, Array]:
    """Return the values of the inner lines expected from a mode on a constant level, and from a cubic, (F - 4, c) each."""
    x = np.array([-2.0, -1.0, 1.0, 2.0])
    neighbours = np.stack([H[:-4], H[1:-3], H[3:-1], H[4:]])
    turned = neighbours * x[:, None, None]
    # orthogonal to straight lines in x
    free = np.eye(4) - 1 / 4 - np.outer(x, x) / 10
    own, other = np.tensordot(free, neighbours, 1), np.tensordot(free, turned, 1)
    size = np.maximum(np.sum(np.abs(other) ** 2, axis=(0, 2)), np.finfo(float).tiny)
    g = -np.sum(np.conj(other) * own, axis=(0, 2)) / size
    mode = neighbours.mean(axis=0) + g[:, None] * turned.mean(axis=0)
    return mode, np.tensordot(np.array([-1.0, 4.0, 4.0, -1.0]) / 6, neighbours, 1)


def _usual(x: RealArray) -> RealArray:
    """Return the medians of x (n, c) over the neighbourhood of every row."""
    padded = np.pad(x, ((_AROUND, _AROUND), (0, 0)), mode="reflect")
    wide = np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1, axis=0)
    return np.asarray(np.median(wide, axis=2))


# -------------------------------------------------------------------------------------------------------- phase checks
# Levels and angles in place of complex values: decibels, degrees, magnitude and phase.

#: Fewest lines that are checked.
_LEAST = 16

#: An angle that wraps jumps by nearly a turn, from above this part of its limit to below minus that.
_WRAPS = 0.8

#: Angles in degrees taken for radians put the real axis at 0 and +-233 degrees. At least this part of the phases lies within 8 degrees
#: of the latter, and at most this part within 8 degrees of 180, which no structure does.
_TURNED, _NEAR, _MANY, _FEW = np.radians(np.degrees(180.0) % 360), np.radians(8), 0.25, 0.05

#: From line to line ln |H| and the phase (rad) change by as much: noise changes both alike, and between resonances the phase is constant.
#: Degrees taken for radians change 57 times as much. So many times more is neither noise nor a structure, where phases change by so many
#: radians at all.
_MORE, _JUMP = 8.0, 0.1

#: Levels in dB lie between these, and seldom far from their median; no response has so small a range around its resonances.
_DECIBELS, _RANGE = 200.0, 6.0


def odd_phases(response: FrequencyResponse) -> list[Finding]:
    """Find magnitude and phase in the places of real and imaginary part, degrees taken for radians, and levels in dB with a phase."""
    H = response.values
    if response.lines < _LEAST or not np.any(H.imag):
        return []
    for check in (_parts, _degrees, _levels):
        if found := check(H):
            name, measured = found
            return [finding(f"no complex values: {name}", *response.output_dofs, **measured)]
    return []


def _parts(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Whether imaginary parts are angles: they never leave +-180 or +-pi, and jump from the one to the other."""
    for limit, unit in ((180.0, "degrees"), (np.pi, "radians")):
        x = H.imag / limit
        if np.abs(x).max() > 1 + 1e-6:
            continue
        high, low = x > _WRAPS, x < -_WRAPS
        jumps = int(np.sum((high[:-1] & low[1:]) | (low[:-1] & high[1:])))
        if jumps < 2 or np.abs(x).max() < 0.95:
            continue
        decibels = bool(np.any(H.real < 0))
        return "parts", {
            "limit": limit,
            "jumps": jumps,
            "unit": unit,
            "kind": "levels in dB" if decibels else "magnitudes",
            "magnitude": "10^(dB / 20)" if decibels else "magnitude",
            "angle": "phase" if unit == "radians" else "radians(phase)",
        }
    return None


def _degrees(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Whether phases cluster where degrees that were taken for radians put the real axis, or jump from line to line."""
    phase = np.angle(H[np.abs(H) > 0])
    if not phase.size:
        return None
    limit = 2 * np.pi - _TURNED
    share = float(np.mean(np.abs(np.abs(phase) - limit) < _NEAR))
    if share > _MANY and np.mean(np.abs(np.abs(phase) - np.pi) < _NEAR) < _FEW:
        return "turned", {"percent": 100 * share, "limit": np.degrees(limit)}
    return ("rough", {}) if _rough(H) else None


def _rough(H: Array) -> bool:
    """Whether phases change from line to line many times as much as the logarithms of magnitudes do, in the median of all."""
    size = np.maximum(np.abs(H), np.finfo(float).tiny)
    steps = np.conj(H[:-1]) * H[1:]
    steps = steps / np.maximum(np.abs(steps), np.finfo(float).tiny)
    # a delay turns all lines of a pair alike
    change = np.median(np.abs(np.angle(steps * np.conj(steps.sum(axis=0)))))
    return bool(change > max(_JUMP, _MORE * float(np.median(np.abs(np.diff(np.log(size), axis=0))))))


def _levels(H: Array) -> tuple[str, dict[str, Any]] | None:
    """Whether magnitudes are levels: of the size of dB, of little range, and small where the phase falls, at the resonances."""
    size = np.abs(H)
    middle = float(np.median(size))
    if not (2 < middle < _DECIBELS and size.max() < min(_DECIBELS, _RANGE * middle)):
        return None
    fall = -np.angle(H[1:] * np.conj(H[:-1]))
    local = (size[1:] + size[:-1]) / 2
    mean, weighted = float(np.mean(fall)), float(np.sum(fall * local**2) / max(float(np.sum(local**2)), 1e-300))
    if mean <= 0 or weighted >= mean:
        return None
    return "levels", {"low": size.min(), "high": size.max()}


# ----------------------------------------------------------------------------------------------------- response checks

#: Less than this part of an output's power explained by the inputs is little: short segments alone leave more.
_COHERENT = 0.6

#: A decay to one per cent within the record of one line spacing: half-power bandwidth of this many lines.
_RESOLVED = np.log(100) / np.pi


def examine_response(response: Response) -> list[Finding]:
    """Return the findings on a response; coherence, slopes and resolution are those of lines."""
    sides = sides_of(response)
    found = [each for _, columns, labels in sides for each in dead_channels(columns, labels)]
    _, columns, labels = sides[0]
    found += identical_channels(columns, labels) + check_polarity(response)
    if isinstance(response, FrequencyResponse):
        no_values = odd_phases(response) or no_phase(response)
        if no_values:  # the other checks need complex values
            return found + no_values
        found += (
            conjugated(response)
            + _coherence(response)
            + check_slope(response)
            + _resolution(response)
            + lone_lines(response)
        )
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
            found.append(finding("low coherence", dof, explained=explained))
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
    """Find resonances narrower than the lines resolve, in estimates only: exact responses have no averages."""
    if response.averages is None and response.coherence is None:
        return []
    peaks, widths = bandwidths(response)
    if response.lines < 3 or peaks.size == 0:
        return []
    step = line_step(response)
    narrow = widths < _RESOLVED * step
    if not np.any(narrow):
        return []
    at = response.frequencies[peaks[narrow]]
    where = ", ".join(f"{f:.4g}" for f in at[:5])
    return [finding("short record: lines", *response.output_dofs, at=at, where=where, resolved=_RESOLVED, step=step)]
