"""Take out what moves frequencies: regression on temperature, wind and the like, or what tracks have in common where none was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.analysis.monitoring.history import as_times
from modalscope.numerics.checks import Array, BoolArray, RealArray
from modalscope.numerics.errors import DataError

#: Hours over which a structure may follow the air, of which the likelihood chooses.
_LAGS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)

#: Deviations of a frequency by which noise alone goes beyond the range that a reference shows.
_MARGIN = 3.0

#: Part of the records on the rarer side of a knee, and records a regressor, at least.
_KNEE_SHARE, _LEAST = 0.05, 10

#: Weights of residuals beyond this many deviations fall (P. J. Huber, 1964), and rounds of weighting. Nearer limits would take errors of
#: covariates for spoilt records.
_HUBER, _ROUNDS = 3.0, 12

_MAD = 1.4826


def inside_of(times: Array, during: Any) -> BoolArray:
    """Return which records lie between two times, or are chosen one by one; all where nothing is said."""
    if during is None:
        return np.ones(times.size, bool)
    try:
        chosen = np.asarray(during)
    except ValueError:  # ragged
        chosen = np.zeros(0)
    if chosen.dtype == bool and chosen.shape == times.shape:
        inside = chosen
    elif chosen.shape == (2,) and chosen.dtype != bool:
        first, last = as_times("the records to estimate from", during)
        inside = (times >= first) & (times <= last)
    else:
        found = f"they are {str(during)[:60]}"
        raise DataError("records to estimate from:", found, "Give two times, or a bool a record.")
    if not inside.any():
        span = " to ".join(str(t.astype("datetime64[m]")) for t in times[[0, -1]])
        raise DataError("records to estimate from:", "there are none then", f"The records are of {span}.")
    return np.asarray(inside)


def spread(x: RealArray) -> RealArray:
    """Return the deviation of each column, by the median of what is known."""
    return np.asarray(_MAD * np.nanmedian(np.abs(x - np.nanmedian(x, axis=0)), axis=0))


def _lagged(x: RealArray, hours: RealArray, lag: float) -> RealArray:
    """Return what a body feels that follows x with a time constant; where x is not known, it stays."""
    if not lag:
        return x
    felt, now, before = np.full(x.size, np.nan), np.nan, hours[0]
    for k, value in enumerate(x):
        if np.isfinite(value):
            now = value if np.isnan(now) else now + (1 - np.exp(-(hours[k] - before) / lag)) * (value - now)
            felt[k], before = now, hours[k]
    return felt


def _design(
    measured: Mapping[str, RealArray], errors: Mapping[str, float], knee: float, inside: BoolArray
) -> tuple[tuple[str, ...], RealArray, RealArray]:
    """Return names and values (R, p) of the regressors, and the variances of their errors by record (R, p, p) in the records inside."""
    names, columns, noise = ["constant"], [np.ones(inside.size)], [np.zeros(inside.size)]
    pairs: list[tuple[int, int]] = []
    for name, x in measured.items():
        names.append(name)
        columns.append(x)
        noise.append(np.full(x.size, errors[name]))
        below = float(np.mean(x[inside & np.isfinite(x)] < knee)) if np.isfinite(x[inside]).any() else 0.0
        if ("temp" in name.lower() or "pt100" in name.lower()) and _KNEE_SHARE <= below <= 1 - _KNEE_SHARE:
            names.append(f"{name} below {knee:g}")
            columns.append(np.minimum(x - knee, 0))
            noise.append(np.where(x < knee, errors[name], 0.0))
            pairs.append((len(columns) - 2, len(columns) - 1))
    X, diagonal = np.column_stack(columns), np.column_stack(noise)[inside]
    V = np.zeros((len(diagonal), X.shape[1], X.shape[1]))
    V[:, range(X.shape[1]), range(X.shape[1])] = diagonal
    for a, b in pairs:
        V[:, a, b] = V[:, b, a] = diagonal[:, b]
    return tuple(names), X, V


@dataclass
class _Fit:
    beta: Any
    covariance: Any
    deviation: float
    count: int


def _fit(y: RealArray, X: RealArray, V: RealArray) -> _Fit:
    """Solve (X' W X - sum W V) b = X' W y with Huber's weights W; `V`: variances of the errors of X, record by record."""
    known = np.isfinite(y) & np.isfinite(X).all(axis=1)
    if known.sum() < _LEAST * X.shape[1]:
        unknown = np.full(X.shape[1], np.nan)
        return _Fit(unknown, np.full((unknown.size, unknown.size), np.nan), np.nan, 0)
    y, X, V = y[known], X[known], V[known]
    weight = np.ones(y.size)
    for _ in range(_ROUNDS):
        normal = (X * weight[:, None]).T @ X - np.tensordot(weight, V, 1)
        beta = np.linalg.lstsq(normal, X.T @ (weight * y), rcond=1e-10)[0]
        e = y - X @ beta
        scale = max(_MAD * float(np.median(np.abs(e))), 1e-12)
        weight = np.minimum(1, _HUBER * scale / np.maximum(np.abs(e), 1e-300))
    size = np.minimum(np.abs(e), _HUBER * scale) * np.sign(e)
    inverse = np.linalg.pinv(normal, rcond=1e-10)
    return _Fit(beta, inverse * float(np.var(size)) * inflation(size), scale, y.size)


def inflation(e: RealArray) -> float:
    """Return how many fewer values a mean has than it seems, 1 at least: the spectrum at its lowest n^(1/3) lines over the variance.

    P. Daniell, discussion in Supplement to the Journal of the Royal Statistical Society 8, 1946.

    Examples
    --------
    >>> draw = np.random.default_rng(0).standard_normal(4000)
    >>> inflation(draw) < 1.5, 5 < inflation(np.convolve(draw, np.ones(10))) < 15
    (True, True)
    """
    power = np.abs(np.fft.rfft(e - e.mean())) ** 2
    lowest = power[1 : 2 + int(e.size ** (1 / 3))]
    return max(float(lowest.mean() / max(e.size * e.var(), 1e-300)), 1.0)


@dataclass(frozen=True)
class Regression:
    """Names and values (R, p) of the regressors, the fit of each track, what tracks have in common without bounds, and notes."""

    names: tuple[str, ...]
    design: RealArray
    fits: list[_Fit]
    common: RealArray
    notes: tuple[str, ...] = ()


def regression(
    y: RealArray,
    measured: Mapping[str, RealArray],
    errors: Mapping[str, float],
    hours: RealArray,
    knee: float,
    inside: BoolArray,
) -> Regression:
    """Regress relative changes y (R, T) on what was measured, with the lag that explains most.

    `errors`: variances of the covariates. `inside`: records to estimate from.
    """
    best: tuple[float, tuple[str, ...], RealArray, list[_Fit], float] | None = None
    for lag in _LAGS:
        # what follows the air averages errors, too: those of a value by a part p of each are p / (2 - p) of their variance
        part = -np.expm1(-float(np.median(np.diff(hours))) / lag) if lag else 1.0
        felt = {name: _lagged(x, hours, lag) for name, x in measured.items()}
        names, X, V = _design(felt, {name: x * part / (2 - part) for name, x in errors.items()}, knee, inside)
        fits = [_fit(y[inside, t], X[inside], V) for t in range(y.shape[1])]
        loss = sum(fit.count * np.log(fit.deviation) for fit in fits if fit.count)
        if best is None or loss < best[0]:
            best = (loss, names, X, fits, lag)
    if best is None or not any(fit.count for fit in best[3]):
        need = f"no track stands in {_LEAST} records a coefficient where all covariates are known"
        raise DataError("tracks were to be explained", need, "Give more records, or fewer covariates.")
    _, names, X, fits, lag = best
    note = (f"temperature and the like are felt with a lag of {lag:g} h",) if lag else ()
    return Regression(names, X, fits, np.zeros((len(y), 0)), note)


def in_common(y: RealArray, noise: RealArray, inside: BoolArray) -> Regression:
    """Take out the principal components that are larger than noise of single frequencies makes them, as far as they reached inside.

    The largest eigenvalue of a covariance of noise alone, R records of T tracks, is (1 + sqrt(T / R))^2 (Marchenko and Pastur, 1967).
    No component goes further than the records inside took it, and no track has a say beyond its range there: what does is no weather
    that was seen.
    """
    tracks = y.shape[1]
    middle = np.nanmedian(y[inside], axis=0)
    z = (y - middle) / noise
    known = np.isfinite(z)
    count = int(inside.sum())
    most = min(count // _LEAST, tracks) - 1  # components that so many records can tell
    edge = (1 + np.sqrt(tracks / count)) ** 2
    filled, mean, weight = np.where(known, z, 0.0), np.zeros(tracks), np.ones(count)
    for large in range(max(most, 0) + 1):
        loads = np.zeros((0, tracks))
        for _ in range(_ROUNDS):  # what is missing is what the components say; spoilt records lose their weight
            said = mean + _scores(z - mean, known, loads) @ loads
            filled = np.where(known, z, said)
            rest = np.mean((filled - said)[inside] ** 2, axis=1) if len(loads) == large else np.ones(count)
            weight = np.minimum(1, (1 + 3 * np.sqrt(2 / tracks)) / np.maximum(rest, 1e-12)) ** 2
            mean = weight @ filled[inside] / weight.sum()
            off = filled[inside] - mean
            values, vectors = np.linalg.eigh((off * weight[:, None]).T @ off / weight.sum())
            loads = vectors[:, tracks - large :].T
        if values[tracks - large - 1] <= edge:
            break
    usual = np.flatnonzero(inside)[weight > 0.5]
    held = np.where(known[usual], z[usual], 0)
    ends = held.min(axis=0) - _MARGIN, held.max(axis=0) + _MARGIN
    enough = known.sum(axis=1, keepdims=True) > large
    scores = np.where(enough, _scores(np.clip(z, *ends) - mean, known, loads), np.nan)
    bounds = np.nanmin(scores[usual], axis=0) - _MARGIN, np.nanmax(scores[usual], axis=0) + _MARGIN
    X = np.column_stack([np.ones(len(y)), np.clip(scores, *bounds)])
    fits = [_fit(y[inside, t], X[inside], np.zeros((count, X.shape[1], X.shape[1]))) for t in range(tracks)]
    names = ("constant", *(f"component {k + 1}" for k in range(large)))
    note = f"no covariates: {large} principal components are larger than noise, and are taken out as far as they reached in the reference"
    return Regression(names, X, fits, scores, (note,))


def _scores(z: RealArray, known: BoolArray, loads: RealArray) -> RealArray:
    """Return the components (R, p) of records by least squares over the tracks that each has."""
    seen = known.astype(float)
    normal = np.einsum("pt,rt,qt->rpq", loads, seen, loads) + 1e-9 * np.eye(len(loads))
    return np.asarray(np.linalg.solve(normal, (np.where(known, z, 0) @ loads.T)[:, :, None])[:, :, 0])
