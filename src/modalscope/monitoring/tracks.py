"""Hold tracks: the modes of many records joined, with the probability of each, as arrays by record and track."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.data.shown import Shown, summary_of, text_table
from modalscope.monitoring.history import History
from modalscope.numerics.checks import BoolArray, IntArray, RealArray, check_shape
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
    probability : array, (n,)
        That the mode is of its track, among all alternatives; 0 for modes of none.
    double : array of bool, (n,)
        Modes that stand a second time in their record: like the track, which another mode of the record has.
    levels : array, (R, T)
        Frequencies as they drift, Hz, smoothed from both sides.
    scatter : array, (T,)
        Standard deviation of single frequencies around the level, Hz.
    believed : array of bool, (T,)
        Whether the stated deviations agree with the scatter.
    notes : tuple of str
    """

    history: History
    track: IntArray
    probability: RealArray
    double: BoolArray
    levels: RealArray
    scatter: RealArray
    believed: BoolArray
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of tracks."""
        return int(self.levels.shape[1])

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
    def names(self) -> tuple[str, ...]:
        """The tracks by number and middle frequency."""
        middle = np.nanmedian(self.frequencies, axis=0) if len(self) else np.zeros(0)
        return tuple(f"{k + 1}: {f:.4g} Hz" for k, f in enumerate(middle))

    def of(self, values: RealArray) -> RealArray:
        """Return values of the modes by record and track, (R, T); NaN where a track was not seen.

        Parameters
        ----------
        values : array, (n,)
        """
        each = np.asarray(values)
        check_shape("values", each, "one a mode", self.track.shape)
        found = np.full((len(self.history), len(self)), np.nan)
        kept = (self.track >= 0) & ~self.double
        found[self.history.record[kept], self.track[kept]] = each[kept]
        return found

    def strong(self, share: float = 0.5) -> Tracks:
        """Return the tracks that are seen in at least this share of the records.

        Parameters
        ----------
        share : float
        """
        return self.pick(np.isfinite(self.frequencies).mean(axis=0) >= share)

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
                f"which needs one bool for each of {len(self)} tracks", have, "Give a condition on all tracks."
            )
        return chosen(self, np.flatnonzero(kept))

    def table(self) -> str:
        """Return a row a track: frequency, scatter, how often it was seen, first and last record, doubles, doubts."""
        rows = [["track", "f [Hz]", "scatter [Hz]", "seen [%]", "first", "last", "doubles", "in doubt"]]
        seen = np.isfinite(self.frequencies)
        for k in range(len(self)):
            own, when = self.track == k, self.history.times[seen[:, k]].astype("datetime64[m]")
            doubt = np.count_nonzero(own & ~self.double & (self.probability < DOUBT))
            numbers = (
                f"{np.nanmedian(self.frequencies[:, k]):.4f}",
                f"{self.scatter[k]:.2g}",
                f"{100 * seen[:, k].mean():.0f}",
            )
            ends = (str(when[[0, -1]][i]).replace("T", " ") for i in (0, 1))
            rows.append([str(k + 1), *numbers, *ends, str(np.count_nonzero(own & self.double)), str(doubt)])
        return "\n".join([text_table(rows), *self.notes])

    def to_pandas(self) -> Any:
        """Return a DataFrame of frequencies, a row a record, a column a track, and of what else was measured.

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
        probability=np.where(track >= 0, tracks.probability, 0.0),
        double=tracks.double & (track >= 0),
        levels=tracks.levels[:, kept],
        scatter=tracks.scatter[kept],
        believed=tracks.believed[kept],
    )
