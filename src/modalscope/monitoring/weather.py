"""Take out what moves frequencies: regression on temperature, wind and the like, or what tracks have in common where none was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.shown import Shown, summary_of, text_table
from modalscope.monitoring.history import as_times
from modalscope.monitoring.tracks import Tracks
from modalscope.numerics.arguments import NUMBER, named
from modalscope.numerics.checks import BoolArray, RealArray, check_shape, real_array
from modalscope.numerics.errors import DataError

#: Hours over which a structure may follow the air, of which the likelihood chooses.
_LAGS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)

#: Part of the records on the rarer side of a knee, and records a regressor, at least.
_KNEE_SHARE, _LEAST = 0.05, 10

#: Weights of residuals beyond this many deviations fall (P. J. Huber, 1964), and rounds of weighting. Nearer limits would take errors of
#: covariates for spoilt records.
_HUBER, _ROUNDS = 3.0, 12

_MAD = 1.4826


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Explained(Shown):
    """What moves the frequencies of tracks, and what is left.

    Parameters
    ----------
    tracks : Tracks
    regressors : tuple of str
        The constant first.
    design : array, (R, p)
        Their values; NaN where one was not measured.
    coefficients, coefficients_std : array, (T, p)
        Relative change of each frequency by a unit of each regressor.
    covariance : array, (T, p, p)
        Of the coefficients.
    residual : array, (R, T)
        Relative change of each frequency that is not explained; NaN where it is not known.
    residual_std : array, (T,)
        Standard deviation of single residuals.
    share : array, (T,)
        Part of the variance that is explained.
    reference : array of bool, (R,)
        Records that it was estimated from.
    notes : tuple of str
    """

    tracks: Tracks
    regressors: tuple[str, ...]
    design: RealArray
    coefficients: RealArray
    coefficients_std: RealArray
    covariance: RealArray
    residual: RealArray
    residual_std: RealArray
    share: RealArray
    reference: BoolArray
    notes: tuple[str, ...] = ()

    def table(self) -> str:
        """Return a row a track: coefficients with deviations, part explained, scatter before and after."""
        rows = [["track", *self.regressors[1:], "explained [%]", "before [%]", "after [%]"]]
        before = _spread(_relative(self.tracks)[self.reference])
        for k, name in enumerate(self.tracks.names):
            pairs = zip(self.coefficients[k, 1:], self.coefficients_std[k, 1:], strict=True)
            numbers = (f"{100 * self.share[k]:.1f}", f"{100 * before[k]:.3f}", f"{100 * self.residual_std[k]:.3f}")
            rows.append([name, *(f"{1e6 * c:.0f} +- {1e6 * s:.0f} ppm" for c, s in pairs), *numbers])
        return "\n".join([text_table(rows), *self.notes])


@summary_of.register
def _(found: Explained) -> str:
    shares = ", ".join(f"{100 * share:.0f} %" for share in found.share[:8])
    return f"{len(found.tracks)} tracks explained by {', '.join(found.regressors[1:]) or 'nothing'}: {shares}"


@named(tracks=Tracks, covariates=Mapping, deviations=Mapping, knee=NUMBER)
def explain(
    tracks: Tracks,
    covariates: Mapping[str, ArrayLike] | None = None,
    *,
    deviations: Mapping[str, float] | None = None,
    knee: float = 0.0,
    during: Any = None,
) -> Explained:
    """Regress the frequencies of tracks on what was measured beside them, or take out what they have in common.

    y = b_0 + b x + b' min(x - knee, 0) + e, with the lag of x (heat: x' = (air - x) / lag) that explains most, and weights that spoilt
    records lose. The errors of x are taken out of its squares. The deviations of b count the autocorrelation of the residuals.

    Parameters
    ----------
    tracks : Tracks
    covariates : mapping of name to array (R,), optional
        By default those of the history. Where there are none, the principal components that are larger than noise can make them.
    deviations : mapping of name to number, optional
        Standard deviations of the errors of covariates.
    knee : float
        A temperature at which slopes change (ice): of covariates whose name has "temp" or "pt100" in it, where both sides were measured.
    during : (first, last) times or array of bool (R,), optional
        Records to estimate from; all by default.

    Returns
    -------
    Explained

    Raises
    ------
    DataError
        No tracks, covariates of another size, or fewer than ten records a regressor.

    Examples
    --------
    >>> import modalscope as ms
    >>> draw, hours = np.random.default_rng(0), np.arange(400)
    >>> air = 10 + 8 * np.sin(hours / 60)
    >>> f = 1 - 2e-4 * air + 1e-4 * draw.standard_normal(400)
    >>> history = ms.monitoring.History(times=3600 * hours, record=hours, frequencies=f, covariates={"air": air})
    >>> found = ms.monitoring.explain(ms.monitoring.track(history))
    >>> found.regressors, bool(abs(1e4 * found.coefficients[0, 1] + 2) < 0.02)
    (('constant', 'air'), True)
    """
    if not len(tracks):
        raise DataError("tracks were to be explained", "there are none", "Give a history with more records.")
    inside = inside_of(tracks, during)
    given = dict(tracks.history.covariates if covariates is None else covariates)
    count = len(tracks.history)
    measured = {name: real_array(name, x, "(records,)", 1, finite=False) for name, x in given.items()}
    for name, x in measured.items():
        check_shape(name, x, "one value a record", (count,))
    y = _relative(tracks)
    if not measured:
        return _in_common(tracks, y, inside)
    errors = {name: float((deviations or {}).get(name, 0.0)) ** 2 for name in measured}
    hours = tracks.history.seconds / 3600
    best: tuple[float, tuple[str, ...], RealArray, list[Any], float] | None = None
    for lag in _LAGS:
        # what follows the air averages errors, too: those of a value by a part p of each are p / (2 - p) of their variance
        part = -np.expm1(-float(np.median(np.diff(hours))) / lag) if lag else 1.0
        felt = {name: _lagged(x, hours, lag) for name, x in measured.items()}
        names, X, V = _design(felt, {name: x * part / (2 - part) for name, x in errors.items()}, knee, inside)
        fits = [_fit(y[inside, t], X[inside], V) for t in range(len(tracks))]
        loss = sum(fit.count * np.log(fit.deviation) for fit in fits if fit.count)
        if best is None or loss < best[0]:
            best = (loss, names, X, fits, lag)
    if best is None or not any(fit.count for fit in best[3]):
        need = f"no track stands in {_LEAST} records a coefficient where all covariates are known"
        raise DataError("tracks were to be explained", need, "Give more records, or fewer covariates.")
    _, names, X, fits, lag = best
    notes = (f"temperature and the like are felt with a lag of {lag:g} h",) if lag else ()
    return _explained(tracks, y, names, X, fits, inside, notes)


def inside_of(tracks: Tracks, during: Any) -> BoolArray:
    """Return which records lie between two times, or are chosen one by one; all where nothing is said."""
    times = tracks.history.times
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
        raise DataError("records to estimate from were asked", found, "Give two times, or a bool a record.")
    if not inside.any():
        span = " to ".join(str(t.astype("datetime64[m]")) for t in times[[0, -1]])
        raise DataError("records to estimate from were asked", "there are none then", f"The records are of {span}.")
    return np.asarray(inside)


def _relative(tracks: Tracks) -> RealArray:
    """Return relative changes of frequencies, (R, T), from the middle of each track."""
    f = tracks.frequencies
    return np.asarray(f / np.nanmedian(f, axis=0) - 1)


def _spread(x: RealArray) -> RealArray:
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


def _explained(
    tracks: Tracks,
    y: RealArray,
    names: tuple[str, ...],
    X: RealArray,
    fits: list[Any],
    inside: BoolArray,
    notes: tuple[str, ...],
) -> Explained:
    beta = np.array([fit.beta for fit in fits])
    residual = y - X @ beta.T
    covariance = np.array([fit.covariance for fit in fits])
    after = np.array([fit.deviation for fit in fits])
    few = [name for name, fit in zip(tracks.names, fits, strict=True) if not fit.count]
    if few:
        notes = (*notes, f"seen in too few records to be explained: {', '.join(few)}")
    share = 1 - (after / np.maximum(_spread(y[inside]), 1e-300)) ** 2
    return Explained(
        tracks=tracks,
        regressors=names,
        design=X,
        coefficients=beta,
        coefficients_std=np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0)),
        covariance=covariance,
        residual=residual,
        residual_std=after,
        share=np.clip(share, 0, 1),
        reference=inside,
        notes=notes,
    )


def _in_common(tracks: Tracks, y: RealArray, inside: BoolArray) -> Explained:
    """Take out the principal components that are larger than noise of single frequencies makes them.

    The largest eigenvalue of a covariance of noise alone, R records of T tracks, is (1 + sqrt(T / R))^2 (Marchenko and Pastur, 1967).
    """
    noise = np.maximum(tracks.scatter / np.nanmedian(tracks.frequencies, axis=0), 1e-12)
    middle = np.nanmedian(y[inside], axis=0)
    z = (y - middle) / noise
    known = np.isfinite(z)
    count = int(inside.sum())
    if count < _LEAST * (len(tracks) + 1):
        fault = f"there are {count} records of {len(tracks)} tracks"
        raise DataError("what tracks have in common was asked", fault, f"Give {_LEAST} records a track, or covariates.")
    edge = (1 + np.sqrt(len(tracks) / count)) ** 2
    filled, mean = np.where(known, z, 0.0), np.zeros(len(tracks))
    for large in range(len(tracks)):
        loads = np.zeros((0, len(tracks)))
        for _ in range(_ROUNDS):  # what is missing is what the components say; spoilt records lose their weight
            said = mean + _scores(z - mean, known, loads) @ loads
            filled = np.where(known, z, said)
            rest = np.mean((filled - said)[inside] ** 2, axis=1) if len(loads) == large else np.ones(count)
            weight = np.minimum(1, (1 + 3 * np.sqrt(2 / len(tracks))) / np.maximum(rest, 1e-12)) ** 2
            mean = weight @ filled[inside] / weight.sum()
            off = filled[inside] - mean
            values, vectors = np.linalg.eigh((off * weight[:, None]).T @ off / weight.sum())
            loads = vectors[:, len(tracks) - large :].T
        if values[len(tracks) - large - 1] <= edge:
            break
    scores = _scores(z - mean, known, loads)
    X = np.column_stack([np.ones(len(y)), np.where(known.sum(axis=1, keepdims=True) > large, scores, np.nan)])
    fits = [_fit(y[inside, t], X[inside], np.zeros((count, X.shape[1], X.shape[1]))) for t in range(len(tracks))]
    names = ("constant", *(f"component {k + 1}" for k in range(large)))
    note = f"no covariates: {large} principal components are larger than noise, and are taken out"
    return _explained(tracks, y, names, X, fits, inside, (note,))


def _scores(z: RealArray, known: BoolArray, loads: RealArray) -> RealArray:
    """Return the components (R, p) of records by least squares over the tracks that each has."""
    seen = known.astype(float)
    normal = np.einsum("pt,rt,qt->rpq", loads, seen, loads) + 1e-9 * np.eye(len(loads))
    return np.asarray(np.linalg.solve(normal, (np.where(known, z, 0) @ loads.T)[:, :, None])[:, :, 0])
