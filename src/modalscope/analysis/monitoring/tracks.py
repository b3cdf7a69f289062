"""Hold tracks: the modes of many records joined, as arrays by record and track, and explain what moves them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.analysis.monitoring.history import History
from modalscope.analysis.monitoring.weather import Regression, in_common, inside_of, regression, spread
from modalscope.data.shown import Shown, figures, summary_of, text_table
from modalscope.numerics.arguments import NUMBER, named
from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray, check_shape, real_array
from modalscope.numerics.errors import DataError, optional_package

#: Probability below which an assignment counts as in doubt.
DOUBT = 0.9


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Tracks(Shown):
    """Modes of many records, joined into tracks.

    Parameters
    ----------
    history : History
        The modes.
    track : array of int, (n,)
        The track of each mode, by rising frequency; -1 for modes of none.
    mode_probability : array, (n,)
        That each mode is of its track, among all alternatives; 0 for modes of none.
    double : array of bool, (n,)
        Modes that stand a second time in their record: like the track, which another mode of the record has.
    levels : array, (R, T)
        Frequencies as they drift, Hz, smoothed from both sides.
    scatter : array, (T,)
        Standard deviation of single frequencies around the level, Hz.
    believed : array of bool, (T,)
        Whether the stated deviations agree with the scatter.
    notes : tuple of str
    called : tuple of str, (T,)
        Names; by default number and middle frequency.
    """

    history: History
    track: IntArray
    mode_probability: RealArray
    double: BoolArray
    levels: RealArray
    scatter: RealArray
    believed: BoolArray
    notes: tuple[str, ...] = ()
    called: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of tracks."""
        return int(self.levels.shape[1])

    @property
    def times(self) -> RealArray:
        """When the records began, seconds since 1970 (UTC), (R,)."""
        return self.history.seconds

    @property
    def frequencies(self) -> RealArray:
        """Frequencies, Hz, (R, T); NaN where a track was not seen."""
        return self.of(self.history.frequencies)

    @property
    def frequencies_std(self) -> RealArray:
        """Standard deviations of the frequencies, Hz, (R, T): as stated where the scatter agrees, else the scatter."""
        stated = self.of(self.history.frequencies_std)
        return np.where(
            self.believed & np.isfinite(stated), stated, np.where(np.isfinite(self.frequencies), self.scatter, np.nan)
        )

    @property
    def damping_ratios(self) -> RealArray:
        """Damping ratios, (R, T)."""
        return self.of(self.history.damping_ratios)

    @property
    def shapes(self) -> ComplexArray:
        """Shapes, (R, T, l), of the channels `history.output_dofs`; NaN where a track or a channel was not seen."""
        found = np.full((len(self.history), len(self), self.history.shapes.shape[1]), np.nan + 0j)
        kept = (self.track >= 0) & ~self.double
        found[self.history.record[kept], self.track[kept]] = self.history.shapes[kept]
        return found

    @property
    def probability(self) -> RealArray:
        """That the mode of each record is of its track, (R, T); NaN where a track was not seen."""
        return self.of(self.mode_probability)

    @property
    def names(self) -> tuple[str, ...]:
        """What the tracks are called, by default by number and middle frequency."""
        if self.called:
            return self.called
        middle = np.nanmedian(self.frequencies, axis=0) if len(self) else np.zeros(0)
        return tuple(f"{k + 1}: {f:.4g} Hz" for k, f in enumerate(middle))

    def of(self, values: RealArray) -> RealArray:
        """Return values of the modes by record and track, (R, T); NaN where a track was not seen.

        Parameters
        ----------
        values : array, (n,)
        """
        each = np.asarray(values)
        check_shape("values", each, "one per mode", self.track.shape)
        found = np.full((len(self.history), len(self)), np.nan)
        kept = (self.track >= 0) & ~self.double
        found[self.history.record[kept], self.track[kept]] = each[kept]
        return found

    def pick(self, which: BoolArray) -> Tracks:
        """Return some of the tracks.

        Parameters
        ----------
        which : array of bool, (T,)
        """
        kept = np.asarray(which)
        if kept.shape != (len(self),) or kept.dtype != bool:
            have = f"it is of shape {kept.shape}, {kept.dtype}"
            raise DataError(
                f"`which` needs True or False for each of {len(self)} tracks", have, "Give a condition on all tracks."
            )
        return chosen(self, np.flatnonzero(kept))

    def explained(self, covariates: Mapping[str, ArrayLike] | None = None, **options: Any) -> Explained:
        """Return what moves the frequencies, and what is left; see `explain`.

        Parameters
        ----------
        covariates : mapping of name to array (R,), optional
            Values at the times of the records.
        **options
            `deviations`, `knee`, `during`.
        """
        return explain(self, covariates, **options)

    def rows(self) -> list[list[str]]:
        """Return the cells of `table`, its head first."""
        rows = [["track", "f [Hz]", "scatter [Hz]", "seen [%]", "first", "last", "doubles", "uncertain"]]
        seen = np.isfinite(self.frequencies)
        for k in range(len(self)):
            own, when = self.track == k, self.history.times[seen[:, k]].astype("datetime64[m]")
            doubt = np.count_nonzero(own & ~self.double & (self.mode_probability < DOUBT))
            numbers = (
                f"{np.nanmedian(self.frequencies[:, k]):.4f}",
                figures(self.scatter[k], 2),
                f"{100 * seen[:, k].mean():.0f}",
            )
            ends = (str(when[[0, -1]][i]).replace("T", " ") for i in (0, 1))
            rows.append([str(k + 1), *numbers, *ends, str(np.count_nonzero(own & self.double)), str(doubt)])
        return rows

    def table(self) -> str:
        """Return a row per track: frequency, scatter, how often it was seen, first and last record, doubles, doubts."""
        return "\n".join([text_table(self.rows()), *self.notes])

    def to_pandas(self) -> Any:
        """Return a DataFrame of frequencies, a row per record, a column per track, and of what else was measured.

        Raises
        ------
        DataError
            pandas is missing.
        """
        pandas = optional_package("a table of tracks", "pandas", "pandas")
        columns = dict(zip(self.names, self.frequencies.T, strict=True)) | dict(self.history.covariates)
        return pandas.DataFrame(columns, index=pandas.Index(self.history.times, name="time"))

    def to_xarray(self) -> Any:
        """Return a Dataset of frequencies, their deviations, levels and damping ratios over time and track.

        Raises
        ------
        DataError
            xarray is missing.
        """
        xarray = optional_package("a data set of tracks", "xarray", "netcdf")
        fields = ("frequencies", "frequencies_std", "levels", "damping_ratios")
        values = {name: (("time", "track"), getattr(self, name)) for name in fields}
        more = {name: (("time",), x) for name, x in self.history.covariates.items()}
        return xarray.Dataset({**values, **more}, coords={"time": self.history.times, "track": list(self.names)})


@summary_of.register
def _(tracks: Tracks) -> str:
    shown = ", ".join(name.partition(": ")[2] for name in tracks.names[:8])
    return f"{len(tracks)} tracks of {summary_of(tracks.history)}{f': {shown}' if shown else ''}"


def chosen(tracks: Tracks, kept: IntArray) -> Tracks:
    """Return some of the tracks, in the order given."""
    number = np.full(len(tracks) + 1, -1)
    number[kept] = np.arange(kept.size)
    track = number[tracks.track]
    return replace(
        tracks,
        track=track,
        mode_probability=np.where(track >= 0, tracks.mode_probability, 0.0),
        double=tracks.double & (track >= 0),
        levels=tracks.levels[:, kept],
        scatter=tracks.scatter[kept],
        believed=tracks.believed[kept],
        called=tuple(tracks.called[k] for k in kept) if tracks.called else (),
    )


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
    part_explained : array, (T,)
        Part of the variance that is explained.
    reference : array of bool, (R,)
        Records that it was estimated from.
    common : array, (R, c)
        What tracks have in common, as principal components; in `design` they reach no further than in the reference.
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
    part_explained: RealArray
    reference: BoolArray
    common: RealArray
    notes: tuple[str, ...] = ()

    def rows(self) -> list[list[str]]:
        """Return the cells of `table`, its head first."""
        rows = [["track", *self.regressors[1:], "explained [%]", "before [%]", "after [%]"]]
        before = spread(_relative(self.tracks, self.reference)[self.reference])
        for k, name in enumerate(self.tracks.names):
            pairs = zip(self.coefficients[k, 1:], self.coefficients_std[k, 1:], strict=True)
            numbers = (
                f"{100 * self.part_explained[k]:.1f}",
                f"{100 * before[k]:.3f}",
                f"{100 * self.residual_std[k]:.3f}",
            )
            rows.append([name, *(f"{1e6 * c:.0f} +- {1e6 * s:.0f} ppm" for c, s in pairs), *numbers])
        return rows

    def table(self) -> str:
        """Return a row per track: coefficients with deviations, part explained, scatter before and after."""
        return "\n".join([text_table(self.rows()), *self.notes])


@summary_of.register
def _(found: Explained) -> str:
    shares = ", ".join(f"{100 * share:.0f} %" for share in found.part_explained[:8])
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
        By default those of the history. Where there are none, the principal components that are larger than noise can make them, no
        further than they reached in the records to estimate from.
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
    >>> draw, hours = np.random.default_rng(0), np.arange(200)
    >>> air = 10 + 8 * np.sin(hours / 60)
    >>> f = 1 - 2e-4 * air + 1e-4 * draw.standard_normal(200)
    >>> history = ms.monitoring.History(times=3600 * hours, record=hours, frequencies=f, covariates={"air": air})
    >>> found = ms.monitoring.explain(ms.monitoring.track(history))
    >>> found.regressors, bool(abs(1e4 * found.coefficients[0, 1] + 2) < 0.02)
    (('constant', 'air'), True)
    """
    if not len(tracks):
        raise DataError("tracks were to be explained", "there are none", "Give a history with more records.")
    inside = inside_of(tracks.history.times, during)
    given = dict(tracks.history.covariates if covariates is None else covariates)
    measured = {name: real_array(name, x, "(records,)", 1, finite=False) for name, x in given.items()}
    for name, x in measured.items():
        check_shape(name, x, "one value per record", (len(tracks.history),))
    y = _relative(tracks, inside)
    if not measured:
        noise = np.maximum(tracks.scatter / np.nanmedian(tracks.frequencies, axis=0), 1e-12)
        return _explained(tracks, y, in_common(y, noise, inside), inside)
    errors = {name: float((deviations or {}).get(name, 0.0)) ** 2 for name in measured}
    return _explained(tracks, y, regression(y, measured, errors, tracks.history.seconds / 3600, knee, inside), inside)


def _explained(tracks: Tracks, y: RealArray, found: Regression, inside: BoolArray) -> Explained:
    beta, covariance = (np.array([getattr(fit, name) for fit in found.fits]) for name in ("beta", "covariance"))
    after = np.array([fit.deviation for fit in found.fits])
    few = [name for name, fit in zip(tracks.names, found.fits, strict=True) if not fit.count]
    seldom = (f"seen in too few records to be explained: {', '.join(few)}",) if few else ()
    share = 1 - (after / np.maximum(spread(y[inside]), 1e-300)) ** 2
    return Explained(
        tracks=tracks,
        regressors=found.names,
        design=found.design,
        coefficients=beta,
        coefficients_std=np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0)),
        covariance=covariance,
        residual=y - found.design @ beta.T,
        residual_std=after,
        part_explained=np.clip(share, 0, 1),
        reference=inside,
        common=found.common,
        notes=(*found.notes, *seldom),
    )


def _relative(tracks: Tracks, inside: BoolArray) -> RealArray:
    """Return relative changes of frequencies, (R, T), from the middle of each track in some records, if it stands in any of them."""
    f = tracks.frequencies
    known = np.isfinite(f) & (inside[:, None] | ~np.isfinite(f[inside]).any(axis=0))
    return np.asarray(f / np.nanmedian(np.where(known, f, np.nan), axis=0) - 1)
