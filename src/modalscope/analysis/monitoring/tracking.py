"""Join the modes of many records into tracks: a state of each that drifts, and one likelihood for frequency, damping and shape.

Three passes: forward, where tracks are born; backward, and forward again with what is expected from both sides. After each the scatter,
the drift and the presence of every track are estimated from what it holds, as stated deviations may be wrong.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import expit

from modalscope.analysis.monitoring.history import History, modes_of, part_of
from modalscope.analysis.monitoring.likelihood import (
    SPOILT,
    Expected,
    Found,
    Nothing,
    chance,
    gains,
    noise_of,
    shape_misfit,
    some,
)
from modalscope.analysis.monitoring.tracks import Tracks, chosen
from modalscope.data.sameness import log_ratios
from modalscope.data.shown import figures
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import assign

#: Innovations beyond this many deviations move a track no further: 95 % efficient with normal errors (P. J. Huber, 1964).
_CLIP = 1.345

#: Innovation of two records in turn, in deviations, that is a jump: by chance once in half a million records.
_JUMP = 3.0

#: Records that the shape and the damping of a track are averaged over: what turns slowly is followed.
_MEMORY = 50

#: Odds at which a track counts as a mode, and against which one that was never seen again is dropped.
_SURE = np.log(1000.0)

#: Records between the two differences that tell drift from scatter, and modes that a track needs to tell its own.
_LAG, _OWN = 8, 20

#: Stated deviations are contradicted where the scatter is further from them than this factor, and further than chance.
_CONTRADICTED = 1.25

#: Records that make a track.
_LEAST = 3

#: MAC of two tracks of one frequency from which they are one mode: half way between alike and at a right angle.
_ALIKE = 0.5

#: Deviation that a relative frequency can have at most, however long nothing was seen: that of a good model of finite elements, too.
_FAR = 0.05

#: MAD of a normal distribution -> its deviation.
_MAD = 1.4826


@named(history=History)
def track(history: History) -> Tracks:
    """Join the modes of many records into tracks.

    Parameters
    ----------
    history : History
        Of two records at least.

    Returns
    -------
    Tracks

    Raises
    ------
    DataError
        Fewer than two records, or fewer than two modes.

    Examples
    --------
    >>> import modalscope as ms
    >>> draw, hours = np.random.default_rng(0), np.arange(200)
    >>> f = np.array([1.0, 1.6]) * (1 + 0.001 * draw.standard_normal((200, 2)))
    >>> history = ms.monitoring.History(times=3600 * hours, record=np.repeat(hours, 2), frequencies=f.ravel())
    >>> found = ms.monitoring.track(history)
    >>> len(found), bool(np.array_equal(found.frequencies, f))
    (2, True)
    """
    if len(history) < 2 or history.frequencies.size < 2:
        have = f"there are {len(history)} records with {history.frequencies.size} modes"
        raise DataError("tracks of modes:", have, "Give more records.")
    follower = _Follower(history)
    follower.search()
    while True:
        follower.merge()
        count = len(follower.hits)
        back = follower.follow(range(len(history) - 1, -1, -1))
        follower.merge()
        if len(follower.hits) == count:
            return follower.result(follower.follow(range(len(history)), back))


def followed(tracks: Tracks, sound: BoolArray) -> Tracks:
    """Return the tracks as the modes of some records make them, followed from there: no later record changes them, and none is given up.

    Parameters
    ----------
    tracks : Tracks
    sound : array of bool, (R,)
        Records of the sound structure.
    """
    history = tracks.history
    own = sound[history.record]
    reference, follower = _Follower(part_of(history, sound)), _Follower(history)
    reference.take_up(tracks.track[own], tracks.double[own])
    back = reference.follow(range(len(reference.history) - 1, -1, -1))
    reference.learn()
    reference.follow(range(len(reference.history)), back)
    reference.learn()
    follower.of_mode[own], follower.double[own] = reference.of_mode, reference.double
    for name in ("expected", "drift", "hits", "score", "nothing", "usual"):
        setattr(follower, name, getattr(reference, name))
    middle, first = np.nanmedian(tracks.frequencies[sound], axis=0), int(np.flatnonzero(sound)[0])
    told = follower.follow(range(first, len(history)))
    told[:, :first] = follower.follow(range(first - 1, -1, -1))[:, :first] if first else 0
    track = follower.of_mode
    return replace(
        tracks,
        track=track,
        double=follower.double,
        mode_probability=np.where(track >= 0, 1.0, 0.0),
        levels=np.exp(told[0]),
        scatter=np.sqrt(follower.expected.noise) * middle,
        believed=follower.expected.believed,
        called=tuple(f"{k + 1}: {f:.4g} Hz" for k, f in enumerate(middle)),
    )


def went(tracks: Tracks, t: int, first: int, end: int) -> float:
    """Return where the mode of a track may be in the records from `first` to before `end`, Hz: what is of no track, and like it.

    NaN where fewer than half of them have such a mode.
    """
    history = tracks.history
    free = np.flatnonzero((tracks.track < 0) & (history.record >= first) & (history.record < end))
    own = np.flatnonzero((tracks.track == t) & ~tracks.double & (history.record < first))
    if not free.size or not own.size:
        return np.nan
    alike = free[log_ratios(modes_of(history, own[-1:]), modes_of(history, free), room=6 * _FAR)[0] > 0]
    if 2 * np.unique(history.record[alike]).size < end - first:
        return np.nan
    return float(np.median(history.frequencies[alike]))


class _Follower:
    """The tracks under way: what is expected of each, and the mode of each in every record."""

    def __init__(self, history: History) -> None:
        self.history, self.seconds = history, history.seconds
        level = np.log(history.frequencies)
        with np.errstate(invalid="ignore", divide="ignore"):
            damping = np.where(history.damping_ratios > 0, np.log(history.damping_ratios), np.nan)
            noise = (history.frequencies_std / history.frequencies) ** 2
        known = np.isfinite(history.shapes)
        shape = np.where(known, history.shapes, 0)
        shape = shape / np.maximum(np.linalg.norm(shape, axis=1, keepdims=True), 1e-300)
        self.modes = Found(
            level, np.where(noise > 0, noise, np.nan), damping, shape, known & (shape != 0).any(axis=1)[:, None]
        )
        self.starts = np.searchsorted(history.record, np.arange(len(history) + 1))
        reach = [max(float(np.ptp(x[np.isfinite(x)])), 0.1) if np.isfinite(x).any() else 1.0 for x in (level, damping)]
        self.nothing = Nothing(1.0, *reach)
        self.spacing = max(float(np.median(np.diff(self.seconds))), 1e-3)
        self.usual = self._usual()
        none, no_shape = np.zeros(0), np.zeros((0, shape.shape[1]), complex)
        self.expected = Expected(*(none,) * 5, no_shape, none, no_shape, none, none, np.zeros(0, bool))
        self.drift, self.hits, self.score, self.outlying = none, none, none, none
        self.of_mode, self.double = np.full(level.size, -1), np.zeros(level.size, bool)
        self.probability = np.zeros(level.size)

    def at(self, k: int) -> Found:
        """Return the modes of a record."""
        return some(self.modes, slice(self.starts[k], self.starts[k + 1]))

    def _usual(self) -> tuple[float, float, float]:
        """Return the variances of level, damping and one component of a shape, by the modes of neighbouring records that are most alike."""
        count, pairs = len(self.history), []
        for k in np.unique(np.linspace(0, count - 2, min(count - 1, 400)).astype(int)):
            a, b = self.at(k), self.at(k + 1)
            if not len(a) or not len(b):
                continue
            misfit, free = shape_misfit(a.shape, b)
            away = np.abs(b.level - a.level[:, None])
            cost = misfit + 10 * away
            i, j = np.arange(len(a)), cost.argmin(axis=1)
            mutual = (cost.argmin(axis=0)[j] == i) & (away[i, j] < 0.1)
            part = misfit[i, j] / np.maximum(2 * free[i, j], 1)
            pairs += list(zip(away[i, j][mutual], np.abs(b.damping[j] - a.damping)[mutual], part[mutual], strict=True))
        if not pairs:
            return 1e-4, 0.25, 0.01
        f, z, u = np.array(pairs).T
        z = z[np.isfinite(z)]
        middle = float((_MAD * np.median(z)) ** 2 / 2) if z.size else 0.25
        # computed data may not scatter at all
        return max(float((_MAD * np.median(f)) ** 2 / 2), 1e-10), max(middle, 1e-4), max(float(np.median(u)), 1e-8)

    def _bear(self, new: Found) -> None:
        """Begin a track with each of some modes."""
        f, z, u = self.usual
        e, ones = self.expected, np.ones(len(new))
        e.level, e.variance = np.append(e.level, new.level), np.append(e.variance, f * ones)
        e.noise, e.shape_variance = np.append(e.noise, f * ones), np.append(e.shape_variance, 2 * u * ones)
        e.damping, e.damping_variance = np.append(e.damping, new.damping), np.append(e.damping_variance, 2 * z * ones)
        e.shape, e.seen = np.vstack([e.shape, new.shape]), np.append(e.seen, ones * 2 / 3)
        e.turn, e.turn_variance = np.vstack([e.turn, 0 * new.shape]), np.append(e.turn_variance, 2 * u * ones)
        # until it has a past, a track may drift from one record to the next as far as it scatters
        self.drift = np.append(self.drift, f / self.spacing * ones)
        e.believed = np.append(e.believed, ones < 0)
        self.hits = np.append(self.hits, ones)
        self.outlying = np.append(self.outlying, np.inf * ones)
        # one birth is expected in the whole history
        self.score = np.append(self.score, -np.log(len(self.history)) * ones)

    def take_up(self, of_mode: IntArray, double: BoolArray) -> None:
        """Begin with tracks whose modes are known, each of one mode at least."""
        counts = np.bincount(of_mode[(of_mode >= 0) & ~double])
        self._bear(
            some(self.modes, np.array([np.flatnonzero((of_mode == t) & ~double)[0] for t in range(counts.size)]))
        )
        self.of_mode, self.double, self.hits = of_mode.copy(), double.copy(), counts.astype(float)
        self.learn()

    def search(self) -> None:
        """Follow modes forward; one that no track explains begins a new one, which is dropped when it is not seen again."""
        birth, visits, nothing = -np.log(len(self.history)), self.hits.copy(), 0.0
        for k in range(len(self.history)):
            self._drift(k, max(k - 1, 0))
            active = np.flatnonzero(self.score > birth - _SURE)
            gain, new = self._assign(k, active, some(self.expected, active))
            mine = self.of_mode[self.starts[k] : self.starts[k + 1]]
            mine = np.where(self.double[self.starts[k] : self.starts[k + 1]], -1, mine)
            seen = np.isin(active, mine)
            self.score[active] += np.log1p(-self.expected.seen[active])
            for place in np.flatnonzero(seen):
                had = gain[place, np.flatnonzero(mine == active[place])[0]]
                self.score[active[place]] += had - np.log1p(-self.expected.seen[active[place]])
            self.hits[active] += seen
            visits[active] += 1
            self.expected.seen[active] = (self.hits[active] + 1) / (visits[active] + 2)
            self.of_mode[self.starts[k] + new] = self.hits.size + np.arange(new.size)
            self._bear(some(self.at(k), new))
            visits = np.append(visits, np.ones(new.size))
            nothing += (new.size - nothing) / min(k + 1, 200)
            self.nothing = replace(self.nothing, number=max(nothing, 1 / (k + 10)))

    def follow(self, records: range, other: RealArray | None = None) -> RealArray:
        """Follow the tracks through the records in their order, or from the end; return level and variance expected, (2, R, T).

        `other`: what is expected from the other side; then the answer is what all records say, with the probabilities.
        """
        expected, before = self.expected, records[0]
        self._begin_at(before)
        told, every = np.zeros((2, len(self.history), expected.level.size)), np.arange(expected.level.size)
        self.outlying = np.full(every.size, np.inf)
        for k in records:
            self._drift(k, before)
            before, here = k, slice(self.starts[k], self.starts[k + 1])
            self.of_mode[here], self.double[here] = -1, False
            if other is None:
                told[:, k] = expected.level, expected.variance
                self._assign(k, every, expected)
                continue
            both = _both_sides(expected, other[:, k])
            gain, _ = self._assign(k, every, both)
            self.probability[here] = _chances(gain, self.of_mode[here])
            told[:, k] = both.level, both.variance
        return told

    def _begin_at(self, k: int) -> None:
        """Expect each track where its modes nearest to a record have it, which may be far from it by then."""
        e, record = self.expected, self.history.record
        e.variance[:] = _FAR**2
        for t in range(e.level.size):
            own = np.flatnonzero((self.of_mode == t) & ~self.double)
            if own.size >= _LEAST:
                near = own[np.argsort(np.abs(record[own] - k), kind="stable")[:_LEAST]]
                e.level[t] = np.median(self.modes.level[near])

    def _drift(self, k: int, before: int) -> None:
        """Widen what is expected by the time since another record."""
        gap = abs(self.seconds[k] - self.seconds[before])
        self.expected.variance = np.minimum(self.expected.variance + self.drift * gap, _FAR**2)

    def _assign(self, k: int, active: IntArray, view: Expected) -> tuple[RealArray, IntArray]:
        """Give the modes of a record to tracks, and move these; return the log ratios of all pairs, and the modes of no track.

        `view`: what is expected of the active tracks.
        """
        found, here = self.at(k), self.starts[k]
        every = np.arange(len(found))
        if not active.size or not len(found):
            return np.full((active.size, len(found)), -np.inf), every
        gain, second = gains(view, found, self.nothing)
        rows = np.flatnonzero((gain > 0).any(axis=1))
        i, columns = assign(-np.maximum(gain[rows], 0))
        kept = gain[rows[i], columns] > 0
        rows, columns = rows[i[kept]], columns[kept]
        # a mode beside the one that its track has, as rare as a spoilt one
        second = second + np.log(SPOILT)
        second[np.delete(np.arange(active.size), rows)] = -np.inf
        kept = gain[rows, columns] >= np.where(
            np.arange(active.size)[:, None] == rows, -np.inf, second[:, columns]
        ).max(axis=0)
        rows, columns = rows[kept], columns[kept]
        self.of_mode[here + columns] = active[rows]
        self._update(active[rows], columns, found)
        free = np.delete(every, columns)
        beside = second[:, free].max(axis=0) > 0
        self.of_mode[here + free[beside]] = active[second[:, free[beside]].argmax(axis=0)]
        self.double[here + free[beside]] = True
        return gain, free[~beside]

    def _update(self, rows: IntArray, columns: IntArray, found: Found) -> None:
        """Move tracks by the modes that they were given."""
        e = self.expected
        noise = noise_of(some(e, rows), found.noise[columns])
        S = e.variance[rows] + noise
        weight, reach = e.variance[rows] / S, _CLIP * np.sqrt(S)
        away = found.level[columns] - e.level[rows]
        # twice far off at one place is no outlier, but a jump
        far = np.abs(away) > _JUMP * np.sqrt(S)
        jump = far & (np.abs(found.level[columns] - self.outlying[rows]) < _JUMP * np.sqrt(2 * S))
        self.outlying[rows] = np.where(far, found.level[columns], np.inf)
        e.level[rows] += np.where(jump, away, weight * np.clip(away, -reach, reach))
        e.variance[rows] = np.where(jump, noise, e.variance[rows] * (1 - weight))
        part = 1 / np.minimum(self.hits[rows] + 1, _MEMORY)
        z = found.damping[columns]
        moved = e.damping[rows] + part * (z - e.damping[rows])
        e.damping[rows] = np.where(np.isnan(e.damping[rows]), z, np.where(np.isnan(z), e.damping[rows], moved))
        u, x, known = e.shape[rows], found.shape[columns], found.known[columns]
        phase = np.sum(x.conj() * u, axis=1, keepdims=True)
        # channels that are missing stay as they are, beside what the shape has on the others
        size = np.linalg.norm(np.where(known | (u == 0), u, 0), axis=1, keepdims=True)
        x = np.where(known, x * phase / np.maximum(np.abs(phase), 1e-300) * np.where(size > 0, size, 1), u)
        mixed = (1 - part[:, None]) * u + part[:, None] * x
        e.shape[rows] = mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-300)

    def merge(self) -> None:
        """Keep the tracks that are sure, and let those that never stand in one record and are alike be one."""
        single = ~self.double
        counts = np.array([np.count_nonzero((self.of_mode == t) & single) for t in range(self.score.size)])
        kept = np.flatnonzero((self.score > _SURE) & (counts >= _LEAST))
        self._keep(kept)
        self.learn()
        counts = counts[kept]
        order, gone = np.argsort(-counts, kind="stable"), np.zeros(kept.size, bool)
        for place, small in enumerate(order):
            for large in order[:place]:
                if not gone[large] and self._same(int(large), int(small)):
                    self.of_mode[self.of_mode == small] = large
                    gone[small] = True
                    break
        self._keep(np.flatnonzero(~gone))
        self.learn()

    def _same(self, a: int, b: int) -> bool:
        """Whether two tracks are one mode.

        Their frequencies are nearer than single values scatter, or than half their bandwidth, and their shapes nearer to each other than
        to a right angle, which modes of one frequency have.
        """
        e, record = self.expected, self.history.record
        if e.shape.shape[1] and np.abs(e.shape[a].conj() @ e.shape[b]) ** 2 < _ALIKE:
            return False
        x, y = (np.flatnonzero((self.of_mode == t) & ~self.double) for t in (a, b))
        near = x[np.clip(np.searchsorted(record[x], record[y]), 0, x.size - 1)]
        away = np.abs(self.modes.level[near] - self.modes.level[y])
        span = np.abs(self.seconds[record[near]] - self.seconds[record[y]])
        far = np.sqrt(e.noise[a] + e.noise[b] + self.drift[a] * span)
        if np.count_nonzero(e.shape[a]) > 1:
            far = np.maximum(far, np.exp(np.nan_to_num(e.damping[a], nan=-np.inf)))
        return bool(np.median(away / far) < 1)

    def _keep(self, kept: IntArray) -> None:
        """Keep some tracks, and forget what was assigned to others."""
        number = np.full(self.score.size + 1, -1)
        number[kept] = np.arange(kept.size)
        self.of_mode = number[self.of_mode]
        self.double &= self.of_mode >= 0
        self.expected = some(self.expected, kept)
        self.drift, self.hits, self.score, self.outlying = (
            a[kept] for a in (self.drift, self.hits, self.score, self.outlying)
        )

    def learn(self) -> None:
        """Estimate scatter, drift, presence, damping and shape of every track from its modes, and how many modes are of none."""
        e, history, records = self.expected, self.history, len(self.history)
        f_usual, z_usual, _ = self.usual
        for t in range(e.level.size):
            own = np.flatnonzero((self.of_mode == t) & ~self.double)
            e.seen[t] = (own.size + 1) / (records + 2)
            e.noise[t], self.drift[t] = f_usual, f_usual / self.spacing
            if own.size < _LEAST:
                continue
            x, when = self.modes.level[own], self.seconds[history.record[own]]
            if own.size >= _OWN:
                least, e.noise[t], self.drift[t] = _scatter_and_drift(x, when)
                stated = self.modes.noise[own]
                e.believed[t] = _agrees(least, e.noise[t], stated[np.isfinite(stated)])
            z = self.modes.damping[own]
            z = z[np.isfinite(z)]
            if z.size:
                e.damping[t] = np.median(z)
                e.damping_variance[t] = (
                    max((_MAD * np.median(np.abs(z - e.damping[t]))) ** 2, 1e-4) if z.size >= _OWN else 2 * z_usual
                )
            self._learn_shape(t, own)
        self.nothing = replace(self.nothing, number=max(np.count_nonzero(self.of_mode < 0) / records, 1 / records))

    def _learn_shape(self, t: int, own: IntArray) -> None:
        """Estimate how far the shape of a track scatters, and the direction in which it turns more than that."""
        e, known = self.expected, self.modes.known[own]
        x = self.modes.shape[own]
        middle = _direction(x)
        e.shape[t] = middle
        x = np.where(known, x, (x @ middle.conj())[:, None] * middle)
        x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        off = x - (x @ middle.conj())[:, None] * middle
        free = max(int((middle != 0).sum()) - 1, 1)
        e.turn[t] = _direction(off) if own.size >= _OWN else 0
        turned = np.abs(off @ e.turn[t].conj()) ** 2
        rest = np.sum(np.abs(off) ** 2, axis=1) - turned
        least = max(0.1 * self.usual[2], 1e-8)
        # the mean of squares of a normal component is 1.44 times their median
        e.shape_variance[t] = max(float(np.median(rest)) / max(free - (own.size >= _OWN), 1), least)
        e.turn_variance[t] = (
            max(float(np.mean(turned)), e.shape_variance[t]) if own.size >= _OWN else e.shape_variance[t]
        )

    def result(self, told: RealArray) -> Tracks:
        """Return the tracks by rising frequency, and what must be told of them."""
        self.learn()
        level = np.exp(told[0])
        tracks = Tracks(
            history=self.history,
            track=self.of_mode,
            mode_probability=self.probability,
            double=self.double,
            levels=level,
            scatter=np.sqrt(self.expected.noise) * np.median(level, axis=0),
            believed=self.expected.believed,
        )
        counts = np.isfinite(tracks.frequencies).sum(axis=0)
        order = np.argsort(np.median(level, axis=0), kind="stable")
        tracks = chosen(tracks, order[counts[order] >= _LEAST])
        return replace(tracks, notes=_notes(tracks))


def _both_sides(expected: Expected, other: RealArray) -> Expected:
    """Return what is expected with a second, independent level and variance."""
    level, variance = other
    together = 1 / (1 / expected.variance + 1 / variance)
    return replace(
        expected, level=together * (expected.level / expected.variance + level / variance), variance=together
    )


def _chances(gain: RealArray, of_mode: IntArray) -> RealArray:
    """Return the probability that each mode is of its track; of doubles that it is of this one among all tracks."""
    found, near = np.zeros(of_mode.size), gain > 0
    for j in np.flatnonzero(of_mode >= 0):
        i = int(of_mode[j])
        alone = near[i].sum() <= 1 and near[:, j].sum() <= 1
        found[j] = expit(gain[i, j]) if alone else chance(gain, i, int(j))
    return found


def _scatter_and_drift(x: RealArray, when: RealArray) -> tuple[float, float, float]:
    """Return the variance of single values, its least and its largest, and that of the drift in a second.

    Var(x_i+m - x_i) = 2 noise + drift (t_i+m - t_i), where the drift is a random walk, and is larger where it is smooth; differences of
    second order, 6 noise, hold what is smooth no more, but all that is rough.
    """
    lag = min(_LAG, x.size // 3)
    near, far = ((_MAD * np.median(np.abs(x[m:] - x[:-m]))) ** 2 for m in (1, lag))
    short, long = (float(np.mean(when[m:] - when[:-m])) for m in (1, lag))
    least = max(near - (far - near) / max(long - short, 1e-9) * short, 0.0) / 2
    most = max((_MAD * np.median(np.abs(x[2:] - 2 * x[1:-1] + x[:-2]))) ** 2 / 6, least, 1e-12)
    drift = max(near - 2 * most, 0.01 * most) / max(short, 1e-9)
    return float(least), float(most), float(drift)


def _direction(x: ComplexArray) -> ComplexArray:
    """Return the direction of length one that rows have in common, whatever their phases; 0 where they are nothing."""
    values, vectors = np.linalg.eigh(x.T @ x.conj()) if x.size else (np.zeros(1), np.zeros((x.shape[1], 1)))
    return np.asarray(vectors[:, -1] if values[-1:].sum() > 0 else np.zeros(x.shape[1]), complex)


def _agrees(least: float, most: float, stated: RealArray) -> bool:
    """Whether stated variances are those of the scatter, between its least and its largest, as far as so many values tell."""
    if stated.size < _OWN:
        return False
    # the median of differences has 37 % efficiency
    margin = (_CONTRADICTED * np.exp(2 * np.sqrt(1 / (0.37 * stated.size)))) ** 2
    return bool(least / margin < np.median(stated) < most * margin)


def _notes(tracks: Tracks) -> tuple[str, ...]:
    """Return what must be told beside the table: stated deviations that the scatter contradicts."""
    history, said = tracks.history, list(tracks.history.notes)
    stated = tracks.of(history.frequencies_std)
    for k, name in enumerate(tracks.names):
        known = stated[np.isfinite(stated[:, k]), k]
        if known.size >= _OWN and not tracks.believed[k]:
            ratio = np.median(known) / tracks.scatter[k]
            said.append(f"{name}: stated deviations are {figures(ratio, 2)} times the scatter, which is used")
    return tuple(said)
