"""Tell a change of the structure: control charts on what weather leaves of the frequencies, with a stated rate of false alarms.

The tracks are those of the reference, followed from there, so that no damage is too large for them. Three things are held against what the
reference had: what weather leaves of the frequencies, what tracks have in common where no weather was measured, and how long a mode
is not found. The limit of a chart is that at which simulated years without a change give as many alarms as stated. They have the spectra of
the reference, and the errors of the coefficients of the weather, at the weather of the records that are judged. A short reference has a
provisional test instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter
from scipy.special import betaincinv, chdtri, stdtrit

from modalscope.analysis.monitoring.tracking import followed, went
from modalscope.analysis.monitoring.tracks import Explained, Tracks, explain
from modalscope.analysis.monitoring.weather import inflation, inside_of
from modalscope.data.shown import Shown, percent, summary_of
from modalscope.numerics.arguments import POSITIVE, at_least, named
from modalscope.numerics.checks import BoolArray, IntArray, RealArray
from modalscope.numerics.errors import DataError

#: A record counts as one of this probability at most: a single one, however spoilt, is no change.
_USUAL = 0.99

#: Simulated years that a limit is counted in, and the most values that they may have.
_YEARS, _MOST = 60.0, 40_000_000

#: Records of a reference: those of a chart and those of a provisional test, at least; and the part of them that a track must have.
_LEAST, _FEW, _SHARE = 100, 20, 0.5

#: Part of the false alarms that modes make which are not found.
_OF_LOSS = 0.1

#: Gaps of one record that a track is taken to have had before it was seen: what a track without gaps tells of their length.
_GAPS = 10.0

_YEAR = 365.25 * 24.0

#: Shifts beyond so many deviations are told.
_CLEAR = 3.0


def _when(seconds: float, unit: str) -> str:
    """Return seconds since 1970 as an ISO text, cut at a unit of numpy."""
    return str(np.datetime64(round(1000 * seconds), "ms").astype(f"datetime64[{unit}]"))


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """An alarm.

    Parameters
    ----------
    time : float
        When the chart went beyond its limit, seconds since 1970 (UTC), as the times of the records were given.
    change : float
        When the change began, most likely.
    interval : (float, float)
        Within which it began, with 95 % probability.
    statistic : float
        The chart at its highest, in limits.
    shifts, shifts_std : mapping of track to float
        Relative change of each frequency, and its standard deviation.
    lost : mapping of track to float
        Tracks whose mode is not found, and the frequency where it may be, Hz; NaN where nothing is like it.
    """

    time: float
    change: float
    interval: tuple[float, float]
    statistic: float
    shifts: Mapping[str, float]
    shifts_std: Mapping[str, float]
    lost: Mapping[str, float] = field(default_factory=dict)

    @property
    def tracks(self) -> tuple[str, ...]:
        """The tracks whose frequencies changed by more than three deviations, the clearest first."""
        clear = {
            name: abs(shift) / self.shifts_std[name] for name, shift in self.shifts.items() if self.shifts_std[name] > 0
        }
        return tuple(sorted((name for name, z in clear.items() if z > _CLEAR), key=lambda name: -clear[name]))

    @property
    def text(self) -> str:
        """The alarm in words."""
        return str(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the alarm as JSON has it: times as ISO texts, the changes of the tracks that changed."""
        changed = {name: {"relative_change": self.shifts[name], "std": self.shifts_std[name]} for name in self.tracks}
        when = [_when(t, "s") for t in (self.time, self.change, *self.interval)]
        return {
            "alarm": when[0],
            "change": when[1],
            "interval": when[2:],
            "statistic": self.statistic,
            "tracks": changed,
            "lost": {name: {"may_be_at": None if np.isnan(f) else f} for name, f in self.lost.items()},
        }

    def __str__(self) -> str:
        when = [_when(t, "m").replace("T", " ") for t in (self.time, self.change, *self.interval)]
        changes = [
            f"{name} {100 * self.shifts[name]:+.3g} +- {percent(self.shifts_std[name], 2)}" for name in self.tracks
        ]
        for name, f in self.lost.items():
            changes.append(f"{name} is not found" + ("" if np.isnan(f) else f", it may be at {f:.4g} Hz"))
        told = ", ".join(changes) or "no single track is clear"
        return f"alarm at {when[0]}: change at {when[1]} ({when[2]} to {when[3]}): {told}"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Alarms(Shown):
    """A control chart and its alarms.

    Parameters
    ----------
    explained : Explained
        What weather leaves.
    chart : str
        "ewma": exponentially weighted averages; "step": the provisional test of a short reference.
    statistic : array, (R,)
        The chart, in limits: distance of the averaged residuals from zero, or how long a mode was not found, the larger; 1 is the limit.
    alarms : tuple of Alarm
    false_per_year : float
        The rate that the limit is set for.
    notes : tuple of str
    """

    explained: Explained
    chart: str
    statistic: RealArray
    alarms: tuple[Alarm, ...]
    false_per_year: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of alarms."""
        return len(self.alarms)

    def table(self) -> str:
        """Return the alarms, one per line, and the notes."""
        return "\n".join([*(map(str, self.alarms) if self.alarms else ["no alarm"]), *self.notes])


@summary_of.register
def _(found: Alarms) -> str:
    return f"{len(found)} alarms of {found.chart} at {found.false_per_year:g} false ones a year"


@named(
    tracks=Tracks, covariates=Mapping, deviations=Mapping, false_per_year=POSITIVE, memory=POSITIVE, seed=at_least(0)
)
def alarms(
    tracks: Tracks,
    *,
    false_per_year: float = 1.0,
    reference: Any = None,
    covariates: Mapping[str, ArrayLike] | None = None,
    deviations: Mapping[str, float] | None = None,
    memory: float = 24.0,
    seed: int = 0,
) -> Alarms:
    """Tell changes of frequencies that weather does not explain, with a stated rate of false alarms.

    Tracks are made of the reference alone, and followed wherever their modes go. One that is not found in so many records that chance would
    not do it is an alarm, too. Tracks that stand in fewer than half of the records of the reference are left out. Damping is not used.
    With 20 to 99 records in the reference, a step of each track is tested by Student's t instead of a chart, which is provisional.

    Parameters
    ----------
    tracks : Tracks
    false_per_year : float
        Alarms a year without any change.
    reference : (first, last) times or array of bool (R,), optional
        Records of the sound structure, 20 at least, 100 for a chart; by default the first half of the time.
    covariates, deviations : mapping, optional
        As of `explain`.
    memory : float
        Hours that the average reaches back.
    seed : int
        Of the simulated years.

    Returns
    -------
    Alarms

    Raises
    ------
    DataError
        Too few records or tracks in the reference.

    Examples
    --------
    >>> import modalscope as ms
    >>> draw, hours = np.random.default_rng(0), np.arange(400)
    >>> f = np.where(hours < 300, 1, 0.999) * (1 + 5e-4 * draw.standard_normal(400))
    >>> history = ms.monitoring.History(times=3600 * hours, record=hours, frequencies=f)
    >>> found = ms.monitoring.alarms(ms.monitoring.track(history), covariates={"none": 0 * hours})
    >>> len(found), abs(found.alarms[0].change / 3600 - 300) < 10
    (1, True)
    """
    times = tracks.history.times
    notes: list[str] = []
    if reference is None:
        reference = (times[0], times[0] + (times[-1] - times[0]) / 2)
        notes.append(
            f"the first half of the time, up to {str(reference[1].astype('datetime64[m]')).replace('T', ' ')}, is taken for sound"
        )
    inside = inside_of(times, reference)
    seen = np.isfinite(tracks.frequencies[inside]).mean(axis=0)
    left = [name for name, share in zip(tracks.names, seen, strict=True) if share < _SHARE]
    if (count := int(inside.sum())) < _FEW or len(left) == len(tracks):
        have = f"{count} are given, with {len(tracks) - len(left)} tracks found in half of them"
        raise DataError(f"alarms need {_FEW} records of the sound structure", have, f"Give {_FEW} records, or more.")
    if left:
        notes.append(f"in fewer than half of the records of the reference, left out: {', '.join(left)}")
    found = explain(followed(tracks.pick(seen >= _SHARE), inside), covariates, deviations=deviations, during=inside)
    hours = tracks.history.seconds / 3600
    judged = ~inside if (~inside).any() else inside
    z = found.residual / np.maximum(found.residual_std, 1e-9)
    rate = false_per_year * (1 - _OF_LOSS)
    if count < _LEAST:
        notes.append(
            f"provisional: the reference has {count} records, and a chart needs {_LEAST}: a step of each track is tested by Student's t"
        )
        value = _stepped(z, inside, judged, found.design.shape[1], rate * _years(hours[judged]))
    else:
        value = _charted(found, z, judged, memory, rate, seed)
    missing, most = _missing(found, judged, hours, false_per_year * _OF_LOSS)
    value = np.fmax(value, (missing / most).max(axis=1))
    value = np.where(judged | inside, value, 0)
    over = judged & (value > 1)
    starts = np.flatnonzero(_events(over[None], hours, 2 * memory)[0])
    # an alarm ends with its last record beyond the limit
    ends = [int(np.flatnonzero(over[:stop])[-1]) + 1 for stop in (*starts[1:], over.size)] if starts.size else []
    first = [int(np.flatnonzero(~judged[:k])[-1]) + 1 if (~judged[:k]).any() else 0 for k in starts]
    first = [max(a, b) for a, b in zip(first, [0, *ends[:-1]], strict=True)] if starts.size else []
    lost = missing > most
    each = [_alarm(found, z, value, lost, missing, *where) for where in zip(first, map(int, starts), ends, strict=True)]
    return Alarms(
        explained=found,
        chart="step" if count < _LEAST else "ewma",
        statistic=value,
        alarms=tuple(each),
        false_per_year=false_per_year,
        notes=(*notes, *found.notes),
    )


def _charted(found: Explained, z: RealArray, judged: BoolArray, memory: float, rate: float, seed: int) -> RealArray:
    """Return the chart of residuals, and that of what tracks have in common, in limits that share the rate, the larger (R,)."""
    inside, hours, draw = found.reference, found.tracks.times / 3600, np.random.default_rng(seed)
    common = found.common - np.nanmean(found.common[inside], axis=0)
    groups = [(z, True)] + [(common / np.nanstd(common[inside], axis=0), False)] * (common.shape[1] > 0)
    values = []
    for x, residual in groups:
        build = _Chart(memory).of(_bounded(x[inside]))
        limit = _limit(build, found if residual else None, x[inside], judged, hours, rate / len(groups), draw)
        values.append(build.run(_bounded(x)[None], hours)[0] / limit)
    return np.asarray(np.max(values, axis=0))


def _years(hours: RealArray) -> float:
    """Return how long records last, years, as dense as most of them are."""
    step = max(float(np.median(np.diff(hours))) if hours.size > 1 else 1.0, 1e-6)
    return float(min(hours[-1] - hours[0] + step, step * hours.size * 2)) / _YEAR


def _missing(found: Explained, judged: BoolArray, hours: RealArray, rate: float) -> tuple[IntArray, RealArray]:
    """Return for how many records each track has not been found (R, T), and for how many it may not be (T,).

    Gaps of the reference have the lengths of a Markov chain; their number and the upper end of the probability that one goes on (95 %)
    say how many records are passed at the rate, a year. Twice the longest gap of the reference is allowed in any case.
    """
    seen = np.isfinite(found.tracks.frequencies)
    run = np.zeros(seen.shape, int)
    for k in range(len(seen)):
        run[k] = np.where(seen[k], 0, (run[k - 1] if k else 0) + 1)
    sound = run[found.reference]
    gaps, missed = np.count_nonzero(sound == 1, axis=0), np.count_nonzero(sound > 0, axis=0)
    goes_on = betaincinv(1 + np.maximum(missed - gaps, 0), _GAPS + gaps, 0.95)
    begin = (gaps + 1) / len(sound) * np.count_nonzero(judged) / _years(hours[judged])  # gaps a year
    least = 1 + np.log(np.maximum(begin * seen.shape[1] / rate, 1)) / -np.log(goes_on)
    return run, np.ceil(np.maximum(least, 2 * sound.max(axis=0)))


def _stepped(z: RealArray, inside: BoolArray, judged: BoolArray, coefficients: int, chance: float) -> RealArray:
    """Return the largest t of a step of any track that ends at each record, over what chance gives in all records together, (R,).

    The means of the last 4, 8, 16, ... records are held against the reference. A record counts as far as the limit, so that no single one
    makes an alarm.
    """
    found = np.zeros(len(z))
    sizes = 2 ** np.arange(2, max(int(np.log2(max(judged.sum(), 4))), 2) + 1)
    tests = max(judged.sum() * sizes.size * z.shape[1], 1)
    for x in z.T:
        sound, here = x[inside & np.isfinite(x)], np.flatnonzero(judged & np.isfinite(x))
        if sound.size < 2 * _GAPS:
            continue
        more = inflation(sound)
        degrees = max(sound.size / more - coefficients, 1.0)
        deviation = max(float(np.sqrt(np.sum(np.clip(sound, -3, 3) ** 2) / (sound.size - coefficients))), 1e-12)
        limit = float(stdtrit(degrees, 1 - min(chance, 0.5) / (2 * tests)))
        size = np.clip(x[here] / deviation, -limit, limit)
        total = np.concatenate([[0.0], np.cumsum(size)])
        for m in sizes[sizes <= here.size]:
            t = np.abs(total[m:] - total[:-m]) / m / np.sqrt(more * (1 / m + 1 / sound.size))
            found[here[m - 1 :]] = np.maximum(found[here[m - 1 :]], t / limit)
    return found


def _bounded(z: RealArray) -> RealArray:
    """Return residuals in deviations (..., T) of records whose length is bounded by that of 99 % of normal ones."""
    size = np.sqrt(np.nansum(z**2, axis=-1, keepdims=True))
    usual = np.sqrt(chdtri(np.maximum(np.isfinite(z).sum(axis=-1, keepdims=True), 1), 1 - _USUAL))
    return np.asarray(z * np.minimum(1, usual / np.maximum(size, 1e-300)))


@dataclass(frozen=True)
class _Chart:
    """A chart: what it makes of residuals in deviations, each path by itself."""

    memory: float
    root: RealArray = field(default_factory=lambda: np.eye(1))

    def of(self, z: RealArray) -> _Chart:
        """Return the chart for residuals with the covariance of those of a reference."""
        filled = np.where(np.isfinite(z), z, 0)
        together = np.isfinite(z).T.astype(float) @ np.isfinite(z)
        covariance = filled.T @ filled / np.maximum(together, 1)
        # shrunk towards its diagonal as far as so few records leave it uncertain
        part = len(covariance) / (len(covariance) + len(z))
        covariance = (1 - part) * covariance + part * np.diag(np.diag(covariance))
        values, vectors = np.linalg.eigh(covariance)
        # what was taken out leaves a direction without residuals, which is not to count more than others
        return replace(self, root=vectors / np.sqrt(np.maximum(values, 0.5 * np.median(values))))

    def run(self, z: RealArray, hours: RealArray) -> RealArray:
        """Return the chart of paths of residuals (S, R, T), (S, R); where a track was not seen it stays as it was."""
        steps = np.diff(hours, prepend=hours[0] - max(float(np.median(np.diff(hours))), 1e-6))
        state, found = np.zeros((len(z), z.shape[2])), np.zeros(z.shape[:2])
        for k, step in enumerate(steps):
            x = z[:, k]
            known = np.isfinite(x)
            state = state + np.where(known, (1 - np.exp(-step / self.memory)) * (np.where(known, x, 0) - state), 0)
            found[:, k] = np.linalg.norm(state @ self.root, axis=1)
        return found


def _limit(
    chart: _Chart,
    found: Explained | None,
    z: RealArray,
    judged: BoolArray,
    hours: RealArray,
    rate: float,
    draw: np.random.Generator,
) -> float:
    """Return the limit that simulated paths of the judged records without a change pass at the rate, a year.

    `found`: whose coefficients have errors, where residuals are judged.
    """
    when = hours[judged]
    step, years = max(float(np.median(np.diff(when))) if when.size > 1 else 1.0, 1e-6), _years(when)
    size = int(when.size * z.shape[1])
    paths = int(np.clip(np.ceil(_YEARS / years), 8, max(_MOST // size, 8)))
    simulated = _spectra_again(chart, z, step, paths, when.size, draw)
    if found is not None:
        together = np.corrcoef(np.where(np.isfinite(z), z, 0).T) if z.shape[1] > 1 else np.ones((1, 1))
        root = np.linalg.cholesky(together + 1e-6 * np.eye(len(together)))
        scale, design = np.maximum(found.residual_std, 1e-9), found.design[judged]
        values, vectors = np.linalg.eigh(found.covariance)
        spread = vectors * np.sqrt(np.maximum(values, 0))[:, None]
        for path in simulated:
            # twice: the errors of the coefficients are in the records that are judged, and are missing in those of the reference
            errors = np.sqrt(2) * root @ draw.standard_normal(found.coefficients.shape)
            path += design @ np.einsum("tij,tj->ti", spread, errors).T / scale
    value = chart.run(_bounded(simulated), when)
    low, high = 0.0, float(value.max())
    for _ in range(30):
        middle = (low + high) / 2
        many = _events(value > middle, when, 2 * chart.memory).sum() / (paths * years) > rate
        low, high = (middle, high) if many else (low, middle)
    return max(high, 1e-9)


def _spectra_again(
    chart: _Chart, z: RealArray, step: float, paths: int, records: int, draw: np.random.Generator
) -> RealArray:
    """Return normal errors with the spectra of the reference, and those between tracks (S, R, T): what an average makes of any errors.

    Each line is that of the reference with another phase, the same for all tracks, so that a daily swing stays as large (D. Prichard and
    J. Theiler, "Generating surrogate data for time series with several simultaneously measured variables", 1994). The variance of
    averages is known from few of them: so uncertain is the size of each path.
    """
    x = _bounded(z)
    x = np.where(np.isfinite(x), x, 0) / np.sqrt(np.isfinite(x).mean(axis=0))
    spectrum = np.fft.rfft(x - x.mean(axis=0), axis=0)
    kept = np.exp(-step / chart.memory)
    averages = lfilter([1 - kept], [1, -kept], x, axis=0)
    degrees = len(z) / np.array([inflation(column**2) for column in averages.T])
    pieces = []
    for _ in range(-(-records // len(z))):
        turned = spectrum * np.exp(2j * np.pi * draw.random((paths, len(spectrum), 1)))
        pieces.append(np.fft.irfft(turned, len(z), axis=1))
    sizes = np.sqrt(degrees / draw.chisquare(degrees, (paths, 1, degrees.size)))
    return np.asarray(np.concatenate(pieces, axis=1)[:, :records] * sizes)


def _events(over: BoolArray, hours: RealArray, gap: float) -> BoolArray:
    """Return where an alarm begins: beyond the limit, and not within the hours before.

    Examples
    --------
    >>> _events(np.array([[True, True, False, True, False, False, True]]), np.arange(7.0), 2.5).astype(int)
    array([[1, 0, 0, 0, 0, 0, 1]])
    """
    last = np.maximum.accumulate(np.where(over, hours, -np.inf), axis=1)
    before = np.column_stack([np.full(len(over), -np.inf), last[:, :-1]])
    return np.asarray(over & (hours - before > gap))


def _alarm(
    found: Explained,
    z: RealArray,
    statistic: RealArray,
    lost: BoolArray,
    missing: IntArray,
    first: int,
    k: int,
    end: int,
) -> Alarm:
    """Return the alarm at record k with the time of its change: the step of all means that is most likely, or when a mode was lost.

    `first`: the earliest record of the change. `end`: past the last record of the alarm.
    """
    times = found.tracks.times
    x = _bounded(z[first:end])
    known = np.isfinite(x)
    filled = np.where(known, x, 0)
    reference = _bounded(z[found.reference])
    after, count = filled[::-1].cumsum(axis=0)[::-1], known[::-1].cumsum(axis=0)[::-1]
    fewer = np.array([inflation(column[np.isfinite(column)]) for column in reference.T])
    gain = (after**2 / np.maximum(count, 1) / fewer).sum(axis=1) / 2
    weight = np.exp(gain - gain.max())
    share = np.cumsum(weight) / weight.sum()
    at = int(gain[: k + 1 - first].argmax())
    low, high = (int(np.searchsorted(share, level)) for level in (0.025, 0.975))
    # shifts by the median, which spoilt records do not move: pi / 2 times the variance of a mean
    there = np.isfinite(z[first + at : end]).sum(axis=0)
    seen = np.flatnonzero(there)
    shift = np.nanmedian(found.residual[first + at : end, seen], axis=0)
    std = found.residual_std[seen] * np.sqrt(np.pi / 2 * fewer[seen] / there[seen])
    names = [found.tracks.names[t] for t in seen]
    change, interval = first + at, (first + low, first + min(high, len(x) - 1))
    if lost[k].any():  # not found since the record after it was last seen
        change = min(change, k + 1 - int(missing[k][lost[k]].max()))
        interval = (min(interval[0], max(change - 1, 0)), max(interval[1], change))
    gone = np.flatnonzero(lost[k:end].any(axis=0))
    return Alarm(
        time=float(times[k]),
        change=float(times[change]),
        interval=(float(times[interval[0]]), float(times[interval[1]])),
        statistic=float(statistic[k:end].max()),
        shifts=dict(zip(names, map(float, shift), strict=True)),
        shifts_std=dict(zip(names, map(float, std), strict=True)),
        lost={found.tracks.names[t]: went(found.tracks, int(t), change, end) for t in gone},
    )
