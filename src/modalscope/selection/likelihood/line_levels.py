"""Estimate how large the errors of lines are: noise of a known course, and errors that are a part of the response.

Calibration, leakage and shifts leave errors that grow with the response: one per cent of a strong mode is large beside a weak one.
"""

from __future__ import annotations

import numpy as np

from modalscope.data.response import Response, fading
from modalscope.data.responses import FrequencyResponse
from modalscope.numerics.checks import RealArray
from modalscope.numerics.statistics import few_channels, telling
from modalscope.selection.likelihood.whitening import LEVEL_LINES, share_of_lines, smoothed
from modalscope.signals.preprocess.line_noise import rising_noise

#: Steps at most, rise of the log likelihood at which they end, and the longest in the logarithm.
_STEPS, _LEAST_RISE, _LONGEST = 30, 1e-3, 2.0

#: Least information of a step relative to that of its lines, and of a part: one that is not there tells nothing.
_ROUNDING, _LEAST_PART = 1e-9, 1e-12


def told_rows(response: Response) -> RealArray | None:
    """Return the deviations of rows, (K,), that data tell before any model; None where they are even.

    They are those of samples under an exponential window, and of lines of responses whose noise rises towards 0 Hz.
    """
    if not isinstance(response, FrequencyResponse) or response.of_correlations or response.added_damping:
        return fading(response)
    values = response.values.reshape(response.count, -1)
    variance = rising_noise(response.frequencies, values[:, telling(values.shape[1])])
    return None if variance is None else np.tile(np.sqrt(variance / np.exp(np.mean(np.log(variance)))), 2)


def parts_of_level(power: RealArray, even: RealArray, size: RealArray) -> tuple[RealArray, RealArray]:
    """Return a even and b size of every channel, power ~ S = a even + b size: a, b >= 0 with the largest -sum (log S + power / S).

    That is the likelihood of squares of normal numbers. Steps of scoring in log a and log b are taken where they raise it, elsewhere
    a *= sqrt(sum even power / S^2 / sum even / S), and b alike, which never lower it.

    `power` (F, c): squares of the residual. `even` (F,): of what is even noise. `size` (F, c): of the response.

    Source of the latter: C. Févotte and J. Idier, Neural Computation 23, 2011.
    """
    noise, own = np.empty(power.shape), np.empty(power.shape)
    for few in few_channels(*power.shape):
        parts = _likeliest(np.ascontiguousarray(power[:, few].T), even, np.ascontiguousarray(size[:, few].T))
        noise[:, few], own[:, few] = (part.T for part in parts)
    return noise, own


def rows_of_lines(
    left: RealArray, data: RealArray, count: int, kept: RealArray | None = None, *, smooth: bool = False
) -> RealArray:
    """Return the deviation of every row relative to the others, (K,): the mean over channels of each channel's a + b |H|^2.

    `left`, `data` (K, l, m): what a model leaves, and the data; H is the difference, the response without its noise. `count`: lines. `kept`
    (K,): the part of white noise that the model leaves on every row; all by default.
    `smooth`: whether what all channels together are of that around a line counts, too.
    """
    flat, whole = (each.reshape(2, count, -1)[..., telling(left[0].size)] for each in (left, data))
    here = share_of_lines(kept, count)
    level, total = np.zeros((2, count))
    for few in few_channels(count, flat.shape[2]):
        power, size = _squares(flat[..., few]) / here, _squares(whole[..., few] - flat[..., few])
        power /= np.maximum(power.mean(axis=1), 1e-300)[:, None]
        noise, own = _likeliest(power, np.ones(count), size)
        level += np.sum(noise + own, axis=0)
        total += np.sum(power, axis=0)
    if smooth:
        level = level * smoothed(total / level, LEVEL_LINES)
    return np.asarray(np.tile(np.sqrt(level / np.exp(np.mean(np.log(level)))), 2))


def _squares(parts: RealArray) -> RealArray:
    """Return the squares of complex values by their real and imaginary parts (2, F, c), (c, F)."""
    return np.ascontiguousarray(np.einsum("rfc,rfc->fc", parts, parts).T)


def _likeliest(power: RealArray, even: RealArray, size: RealArray) -> tuple[RealArray, RealArray]:
    """Return both parts of few channels, (c, F) each: a channel lies in one piece."""
    unit = np.maximum(power.mean(axis=1), 1e-300)[:, None]  # a channel of zeros has no size
    size = size / np.maximum(size.mean(axis=1), 1e-300)[:, None]
    P, e, s = power / unit, even / even.mean(), size
    parts = np.array([np.median(P / np.maximum(each, 1e-300), axis=1) for each in (e, s)])
    parts = np.clip(parts, _LEAST_PART, 1 / _LEAST_PART)
    found, going = np.empty(parts.shape), np.arange(len(P))
    S, ratio, reached = _under(parts, P, e, s)
    for _ in range(_STEPS):
        quick, slow = _factors(ratio, s / S * parts[1][:, None])
        before, tried = reached, parts * quick
        S, ratio, reached = _under(tried, P, e, s)
        falls = ~(reached >= before)
        parts = np.where(falls, parts * slow, tried)
        if falls.any():
            S[falls], ratio[falls], reached[falls] = _under(parts[:, falls], P[falls], e, s[falls])
        found[:, going] = parts
        rises = reached - before >= _LEAST_RISE
        if not rises.any():
            break
        if not rises.all():  # each channel ends by itself
            going, parts = going[rises], parts[:, rises]
            P, s, S, ratio, reached = (each[rises] for each in (P, s, S, ratio, reached))
    return unit * found[0][:, None] * e, unit * found[1][:, None] * size


def _under(parts: RealArray, P: RealArray, e: RealArray, s: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return levels S of parts (2, c), squares over them, (c, F) each, and the log likelihood by channel; parts of nothing have none."""
    S = parts[1][:, None] * s
    S += parts[0][:, None] * e
    np.maximum(S, 1e-300, out=S)
    ratio = P / S
    return S, ratio, -(np.log(S).sum(axis=1) + ratio.sum(axis=1))


def _factors(ratio: RealArray, own: RealArray) -> tuple[RealArray, RealArray]:
    """Return by which factors scoring changes both parts, and by which steps do that lower nothing, (2, c) each.

    `ratio` (c, F): squares over the level. `own` (c, F): share of the part that is the response's.
    """
    lines, total, squares = own.shape[1], own.sum(axis=1), np.vecdot(own, own)
    second = np.vecdot(own, ratio) - total
    slope, sums = np.array([ratio.sum(axis=1) - lines - second, second]), np.array([lines - total, total])
    a, b, ab = lines - 2 * total + squares + _ROUNDING * lines, squares + _ROUNDING * lines, total - squares
    step = np.array([b * slope[0] - ab * slope[1], a * slope[1] - ab * slope[0]]) / (a * b - ab**2)
    slow = np.sqrt(np.maximum(1 + slope / np.maximum(sums, 1e-300), _LEAST_PART))
    return np.exp(np.clip(step, -_LONGEST, _LONGEST)), slow
