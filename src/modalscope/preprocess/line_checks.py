"""Faults of frequency responses line by line: lines that stand alone, phases that run backwards, phases that are no phases."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.preprocess.findings import Finding

__all__ = ["conjugated", "lone_lines", "no_phase"]

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
