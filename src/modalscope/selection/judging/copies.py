"""Tell whether poles that overlap are several modes, or one whose frequency differs by row or by column of the test.

A column of a test (a hit, a run) may shift a resonance, and so may a row (a sensor that was moved). On the lines of poles that hang
together two models are compared, residues free in every channel (i, j) of both:

    P_n: y_ij = sum_k<=n r_k,ij g(f; s_k)                      n poles that all channels share
    S_m: y_ij = sum_k<=m r_k,ij g(f; s_k + a_k,i + b_k,j)      m modes, each of which shifts by row, by column, or by both

A further mode of rank one has 2 (q + p) unknowns, shifts have 2 (q + p - 1): both are equally free, so that their misfits decide.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from modalscope.data.shown import percent
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.pole_functions import line_functions
from modalscope.numerics.statistics import assign
from modalscope.selection.judging.recount import UNCERTAINTY_OF_VARIANCE, Recount
from modalscope.selection.likelihood.deviations import blocks_of_lines
from modalscope.selection.likelihood.information import residual_of
from modalscope.selection.likelihood.whitening import chi_squared_bound, lag_factor

#: Lines of a cluster: so many half bandwidths to either side of its poles, and so many at least.
_REACH, _MIN_LINES = 10.0, 40

#: Part of what all poles of a cluster explain beyond m of them that m modes which shift may lack: shifts are not quite Lorentzian. Single
#: ones lack -.05 to .013 of it where they are simulated, up to .02 on a measured beam, pairs .21 and more (70 and 31 clusters).
_MAX_LACKING = 0.05

#: A single mode may scatter by so many times what the median other mode does (chosen on the same clusters).
_MAX_SCATTER = 5.0

#: Shifts about a common pole are taken to scatter by this part of the half bandwidth at least.
_LEAST_SHIFT = 0.02

#: Modes more damped than this, and those narrower than this many lines at half their power, tell nothing of the scatter of a test.
_MAX_DAMPING, _MIN_HALF_BANDWIDTH_LINES = 0.1, 0.5

#: Maximum number of lines far from all poles that are added up: one number tells of them what they tell.
_MAX_LINES_OF_BLOCK = 64

#: Maximum number of rows and of columns of a cluster that are examined, the strongest: others shift as these do.
_MAX_ROWS, _MAX_COLUMNS = 48, 16

#: Steps of a fit at most, those of one that is only a start, its tolerance (variances, and relative), and its Levenberg-Marquardt damping.
_STEPS, _FEW_STEPS, _TOLERANCE, _RELATIVE_TOLERANCE = 25, 10, 0.05, 1e-5
_DAMPING, _MIN_DAMPING, _MAX_DAMPING_OF_STEPS = 1e-3, 1e-6, 1e6

#: Maximum step of a pole in its half bandwidths, and minimum half bandwidth relative to the narrowest of the cluster.
_MAX_STEP, _MIN_WIDTH = 0.5, 0.1

#: Rounds of a fit of low rank, and the chance that errors give a residue of rank one another.
_RANK_ROUNDS, _CHANCE_OF_RANK = 5, 1e-3

#: Singular values of unit columns below this are rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False, slots=True)
class Copies:
    """The mode that each pole belongs to, by default itself, (n,), and what is known of modes with copies.

    `poles` (n,): where each lies, of a mode with copies its pole in the fit of the modes alone. `shifts` (2,): by which part of their
    frequency modes that shift scatter from row to row and from column to column, in the median. `whys` (n,): of copies why they are some,
    in words. `repeated` (n,): which are modes of one pole, as its residue has a rank above one: beside free residues of the others none
    of them explains anything.
    """

    host: IntArray
    poles: ComplexArray
    repeated: Array
    shifts: RealArray
    whys: tuple[str, ...]

    def facts(self, *, turned: bool) -> dict[str, float]:
        """Return the shifts as outputs and inputs have them; `turned`: whether inputs are the rows."""
        by_row, by_column = (float(shift) for shift in self.shifts)
        return {"shift_by_output": by_column if turned else by_row, "shift_by_input": by_row if turned else by_column}


def copies_of(recount: Recount) -> Copies | None:
    """Return which poles are copies of modes that shift; None of one or two channels, and where errors are white and there are none."""
    q, p = recount.left.shape[1:]
    if min(q, p) == 1 and max(q, p) < 3:
        return None
    s = recount.descent.point.poles
    host, poles, whys, shifts, repeated = np.arange(len(s)), s.copy(), [""] * len(s), [], np.zeros(len(s), bool)
    clusters = [_Cluster(recount, which) for which in clusters_of(s)]
    scatters = _scatters(recount, clusters) if clusters else np.zeros((0, 2, 2))
    for k, cluster in enumerate(clusters):
        which = cluster.which
        found = cluster.modes(recount.bar, scatters, k)
        repeated[which] = found.repeated
        if len(found.poles) == len(which):
            continue
        near = np.abs(s[which] - found.poles[:, None]) / -found.poles[:, None].real
        rows, columns = assign(near)
        stands = which[columns[np.argsort(rows, kind="stable")]]
        host[which], host[stands] = stands[np.argmin(near, axis=0)], stands
        poles[stands] = found.poles
        shifts += [found.shifts] if found.shifts.any() else []
        for j in which:
            whys[j] = found.why
    if np.array_equal(host, np.arange(len(s))) and not recount.selection.coloured:
        return None
    return Copies(host, poles, repeated, np.median(shifts, axis=0) if shifts else np.zeros(2), tuple(whys))


def clusters_of(s: ComplexArray) -> list[IntArray]:
    """Return the poles that hang together, where they are several: neighbours lie nearer than twice the narrower half bandwidth."""
    from scipy.sparse.csgraph import connected_components

    near = np.abs(s.imag[:, None] - s.imag) < -2 * np.maximum(s.real[:, None], s.real)
    count, which = connected_components(near)
    each = (np.flatnonzero(which == k) for k in range(count))
    return [cluster for cluster in each if cluster.size > 1]


def _scatters(recount: Recount, clusters: list[_Cluster]) -> RealArray:
    """Return by how much the poles of each mode scatter and how much of it is noise, clusters first and as one each, (modes, 2, 2).

    Relative to the frequency, and in half bandwidths.
    """
    s, (low, high) = recount.descent.point.poles, recount.selection.band
    f, zeta = np.abs(s) / (2 * np.pi), -s.real / np.abs(s)
    told = (zeta < _MAX_DAMPING) & (f > low) & (f < high)
    told &= recount.selection.half_bandwidths_in_lines(s) > _MIN_HALF_BANDWIDTH_LINES
    told[np.concatenate([cluster.which for cluster in clusters])] = False
    alone = [_Cluster(recount, np.array([k])) for k in np.flatnonzero(told)]
    return np.array([cluster.scattered() for cluster in (*clusters, *alone)])


def _usually(scatters: RealArray, k: int, own: RealArray) -> RealArray:
    """Return the scatter beyond noise of the median other mode that would show as much as a mode `k`, (2,); infinite without any.

    A scale on which no other mode would show it counts as none where the other scale has some.

    `scatters`: as in `_scatters`. `own` (2,): what mode `k` would scatter.
    """
    others = np.delete(scatters, k, axis=0)
    beyond, told = _beyond_noise(others), others[:, 1] < own
    unknown = 0.0 if told.any() else np.inf
    return np.array(
        [np.median(each[few]) if few.any() else unknown for each, few in zip(beyond.T, told.T, strict=True)]
    )


def _beyond_noise(scatters: RealArray) -> RealArray:
    """Return the scatter of modes less what noise gives of it, (modes, 2)."""
    return np.asarray(np.sqrt(np.maximum(scatters[:, 0] ** 2 - scatters[:, 1] ** 2, 0)))


@dataclass(frozen=True, eq=False, slots=True)
class _Fit:
    """Modes fitted to a cluster: squared misfit in variances, poles and residues (m, q, p)."""

    misfit: float
    poles: ComplexArray
    residues: ComplexArray

    @property
    def weights(self) -> RealArray:
        """Share of each channel in a mode, (m, q, p)."""
        squares = np.abs(self.residues) ** 2
        return np.asarray(squares / np.maximum(squares.sum(axis=(1, 2), keepdims=True), 1e-300))

    @property
    def means(self) -> ComplexArray:
        """Mean pole of every mode, (m,)."""
        return np.asarray(np.sum(self.weights * self.poles, axis=(1, 2)))

    def scatter(self, mode: int) -> RealArray:
        """Return by which part of its frequency, and by which of its half bandwidths, the poles of a mode scatter, (2,)."""
        mean = self.means[mode]
        apart = np.sqrt(np.sum(self.weights[mode] * np.abs(self.poles[mode] - mean) ** 2))
        return np.array([apart / abs(mean), apart / -mean.real])

    def shifts(self) -> RealArray:
        """Return by which part of its frequency the strongest mode scatters from row to row and from column to column, (2,)."""
        k = int(np.argmax(np.sum(np.abs(self.residues) ** 2, axis=(1, 2))))
        rows, columns = self.weights[k].sum(axis=1), self.weights[k].sum(axis=0)
        # the same columns count in every row: their shares in the channels differ where channels have noise of their own
        by_row, by_column = self.poles[k] @ columns, rows @ self.poles[k]
        apart = (np.sum(w * np.abs(own - w @ own) ** 2) for w, own in ((rows, by_row), (columns, by_column)))
        found = np.sqrt(np.array(list(apart))) / abs(self.means[k])
        return np.where(found > _ROUNDING, found, 0.0)


class _Centred(NamedTuple):
    """Modes that shift about poles (m,) with normal shifts, and the misfit of the data and of the shifts, in variances."""

    poles: ComplexArray
    fit: _Fit
    cost: float


@dataclass(frozen=True, eq=False, slots=True)
class _Modes:
    """The modes of a cluster: poles (m,) that all channels share, `shifts` (2,), and what they explain while they shift, see `Copies`.

    `repeated`: whether one pole explains all, and they are as many as the rank of its residue.
    """

    poles: ComplexArray
    shifts: RealArray
    explained: float
    repeated: bool = False

    @property
    def why(self) -> str:
        """Why its poles are these modes alone, in words."""
        shift = float(self.shifts.max())
        if not shift:
            return "one pole explains both"
        modes = "one mode that shifts" if len(self.poles) == 1 else f"{len(self.poles)} modes that shift"
        return f"{modes} by {percent(shift, 2)} explain{'s' * (len(self.poles) == 1)} {percent(min(self.explained, 1.0))} of all"


@dataclass(frozen=True, eq=False, slots=True)
class _Point:
    """Residues of poles in every channel (c, m), what they leave of it (c,), information (c, 2 m, 2 m) and slope (c, 2 m) of a step."""

    left: RealArray
    residues: ComplexArray
    information: RealArray = field(default_factory=lambda: np.zeros((0, 0, 0)))
    slope: RealArray = field(default_factory=lambda: np.zeros((0, 0)))


class _Cluster:
    """Poles that hang together on the lines around them, all other poles and terms free in every channel.

    Far from all poles lines are added up: K remain. `data` (c, K): divided by the deviations of lines, without what all else explains.
    `weights`, `free` (c, K), (c, K, t): of the channels, row by row. `factor`: how correlated errors raise the variance of a residue.
    """

    def __init__(self, recount: Recount, which: IntArray) -> None:
        point, fitted = recount.descent.point, recount.descent.fitted
        self.problem, self.which, self.poles = recount.selection.problem, which, point.poles
        self.lines = self._lines()
        own = np.einsum("qn,np->nqp", fitted.linear[:, which], point.sides[which])
        own = own if self.problem.weights is None else own * self.problem.weights
        grid = np.asarray(self.problem.light.grid)[self.lines]
        self.starts, self.sizes = blocks_of_lines(grid, self.poles, _MAX_LINES_OF_BLOCK)
        self.nodes, self.shares = self._nodes(grid)
        precision = 2 / np.add.reduceat(recount.errors.on(self.lines).variance, self.starts, axis=0)
        precision *= self.sizes[:, None, None]
        strength = np.sum(np.abs(own) ** 2, axis=0) * precision.mean(axis=0)
        taken = _strongest(strength.sum(axis=1), _MAX_ROWS)[:, None], _strongest(strength.sum(axis=0), _MAX_COLUMNS)
        own, self.channels = own[:, *taken], (len(taken[0]), len(taken[1]))
        parts = np.stack([own.real, own.imag], axis=1).reshape(2 * len(which), -1)
        left = self._taken(residual_of(point, fitted, taken)).reshape(2 * len(precision), -1)
        rows = self._taken(self.problem.columns(self.poles[which], slopes=False)[0]) @ parts + left
        self.weights = np.tile(np.sqrt(precision[:, *taken]), (2, 1, 1)).reshape(len(rows), -1).T
        beside = np.hstack([self._taken(self.problem.terms), self._functions(self.poles[self._others()])[0]])
        self.free = np.linalg.qr(_unit(self.weights[:, :, None] * beside))[0]
        self.data = self._less_free((self.weights * rows.T)[:, :, None])[:, :, 0]
        middle = np.arange(self.lines.start, self.lines.stop)
        half = recount.selection.half_bandwidths_in_lines(self.poles[which])
        half = np.full(len(middle), max(float(np.median(half)), _MIN_HALF_BANDWIDTH_LINES))
        self.factor = float(np.median(lag_factor(recount.errors.common(middle), half)))

    def _lines(self) -> slice:
        grid = self.problem.light.grid
        assert grid is not None
        f, reach = self.poles[self.which].imag / (2 * np.pi), -_REACH * self.poles[self.which].real.min() / (2 * np.pi)
        low, high = np.searchsorted(grid, [f.min() - reach, f.max() + reach]).tolist()
        low = max(min(low, (low + high - _MIN_LINES) // 2, grid.size - _MIN_LINES), 0)
        return slice(low, min(max(high, low + _MIN_LINES), grid.size))

    def _others(self) -> IntArray:
        """Return the other poles whose resonance lies on the lines."""
        low, high = 2 * np.pi * np.asarray(self.problem.light.grid)[self.lines][[0, -1]]
        w = self.poles.imag
        return np.setdiff1d(np.flatnonzero((w >= low) & (w <= high)), self.which)

    def _taken(self, rows: RealArray) -> RealArray:
        """Return rows of all lines on those of the cluster, (2 K, ...), blocks of them added up."""
        return self._added(self._inside(rows))

    def _inside(self, rows: RealArray) -> RealArray:
        return np.concatenate([half[self.lines] for half in np.split(rows, 2)])

    def _added(self, rows: RealArray) -> RealArray:
        """Return rows of lines (2 L, ...) as those of blocks (2 K, ...): sums over the root of their number, whose errors are as large."""
        root = np.sqrt(self.sizes).reshape(-1, *[1] * (rows.ndim - 1))
        return np.concatenate([np.add.reduceat(half, self.starts, axis=0) / root for half in np.split(rows, 2)])

    def _nodes(self, grid: RealArray) -> tuple[RealArray, RealArray]:
        """Return two places in each block, Hz, and their weights, (2, blocks) each, for sums of cubics over its lines (Gauss)."""

        def added(values: RealArray) -> RealArray:
            return np.asarray(np.add.reduceat(weights * values, self.starts))

        weights = 1 / self.problem.rows[self.lines]  # both parts of a line have the same
        whole = added(np.ones(grid.size))
        middle = added(grid) / whole
        apart = grid - np.repeat(middle, self.sizes)
        second, third = added(apart**2) / whole, added(apart**3) / whole
        skew = third / np.where(second > 0, second, 1)
        width = np.sqrt(skew**2 + 4 * second)
        ends = np.array([skew - width, skew + width]) / 2
        shares = np.where(width > 0, np.array([ends[1], -ends[0]]) / np.where(width > 0, width, 1), 0.5)
        return middle + ends, shares * whole / np.sqrt(self.sizes)

    def _functions(self, poles: ComplexArray) -> tuple[RealArray, RealArray]:
        """Return the functions of poles on the lines and their derivatives, (K, 2 n) each; their part in terms is among what is free."""
        each = line_functions(self.nodes.ravel(), self.problem.light.sampling_rate, poles, slopes=True).T
        both = np.einsum("jrnb,nb->jrb", each.reshape(len(each), 2, *self.nodes.shape), self.shares)
        both = both.reshape(len(each), 2 * len(self.starts)).T
        return both[:, : 2 * len(poles)], both[:, 2 * len(poles) :]

    def _less_free(self, columns: RealArray) -> RealArray:
        """Return columns (c, K, k), in their own place, without what all else explains."""
        columns -= self.free @ (self.free.transpose(0, 2, 1) @ columns)
        return columns

    def scattered(self) -> RealArray:
        """Return the scatter of all poles as one mode that shifts by row or by column, and what noise gives of it, (2, 2)."""
        fit = self.as_one(both=False)
        at, (q, p) = self._at(fit.poles, slopes=True), self.channels
        axis = 1 if np.ptp(fit.poles[0], axis=0).max() >= np.ptp(fit.poles[0], axis=1).max() else 0
        information = at.information.reshape(q, p, 2, 2).sum(axis=axis) / self.factor
        variance = np.trace(np.linalg.pinv(information, hermitian=True), axis1=1, axis2=2)
        noise = np.sqrt(fit.weights[0].sum(axis=axis) @ variance)
        return np.array([fit.scatter(0), noise / np.array([abs(fit.means[0]), -fit.means[0].real])])

    def modes(self, bar: float, scatters: RealArray, place: int = 0) -> _Modes:
        """Return the fewest modes that, each free to shift, explain what all poles of the cluster do.

        J(S_m) <= J(P_n) + bar + 2 q p (n - m - 1) / factor + .05 (J(P_m) - J(P_n)): the third term is what errors may give the poles that
        are left out, the last one what shifts may lack of what further poles explain beyond m. A single mode may not scatter by more than
        five times what the median other mode does, see `_usually`; the misfit of several has the price of their shifts in it, see
        `_centred`: where other modes stay in their places, so do these.

        `scatters`: of all modes of the test, this one at a `place`; see `_scatters`.
        """
        s, (q, p) = self.poles[self.which], self.channels
        one, shared = self.fitted(self._best), self.fitted(s[:, None, None], steps=_FEW_STEPS)
        gained = one.misfit - shared.misfit
        if gained <= bar:  # one frequency in all channels, with a residue of any rank: nothing shifts
            strongest = np.argsort(-self._size(shared), kind="stable")[: self._rank(one)]
            return _Modes(one.means if strongest.size == 1 else s[strongest], np.zeros(2), 1.0, strongest.size > 1)
        begun, found = [int(np.argmax(self._size(shared)))], self.as_one()
        usual = np.maximum(np.median(_beyond_noise(scatters), axis=0), [0, _LEAST_SHIFT])
        centres, fewer, own = found.means, one, found.scatter(0)
        cost = found.misfit if np.any(own <= _MAX_SCATTER * _usually(scatters, place, own)) else np.inf
        for m in range(1, len(s)):
            if m > 1:
                begun, (centres, found, cost) = self._next(begun, usual)
                fewer = self.fitted(s[begun][:, None, None])
            room = bar + 2 * q * p * (len(s) - m - 1) / self.factor + _MAX_LACKING * (fewer.misfit - shared.misfit)
            if cost <= shared.misfit + room:
                return _Modes(centres, found.shifts(), float((one.misfit - found.misfit) / max(gained, 1e-300)))
        return _Modes(s, np.zeros(2), 1.0)

    def _rank(self, one: _Fit) -> int:
        """Return the rank of the residue of one pole: of repeated modes it has one for each.

        What a lower rank lacks, by rows and columns in turn, exceeds what errors give to the 2 (q - m) (p - m) real numbers across it.
        """
        (q, p), R = self.channels, one.residues[0]
        own = self._of_channels(self._functions(one.poles[:, :1, :1].ravel())[0], (1, 1, 1))
        weight = np.sum(own**2, axis=(1, 2)).reshape(q, p) / 2 / self.factor
        for m in range(1, min(q, p)):
            V: Array = np.linalg.svd(R, full_matrices=False)[2][:m].T
            for _ in range(_RANK_ROUNDS):
                U = np.linalg.solve(*_normal(V, weight, R))[..., 0]
                V = np.linalg.solve(*_normal(U, weight.T, R.T))[..., 0]
            lacking = float(np.sum(weight * np.abs(R - U @ V.T) ** 2))
            if lacking <= UNCERTAINTY_OF_VARIANCE * chi_squared_bound(2 * (q - m) * (p - m), -np.log(_CHANCE_OF_RANK)):
                return m
        return int(min(q, p))

    def as_one(self, *, both: bool = True) -> _Fit:
        """Return the likeliest single mode for all poles: one that shifts by row, by column, or by `both`.

        By both it starts from the better of the others and from its mean.
        """
        candidates, misfits = self._candidates
        steps = _FEW_STEPS if len(self.which) == 1 else _STEPS
        rows, columns = (candidates[np.argmin(misfits.sum(axis=axis), axis=0)] for axis in (2, 1))
        starts = {"row": rows[None, :, None], "column": columns[None, None, :]}
        ways = [way for way, count in zip(starts, self.channels, strict=True) if count > 1]
        found = [self.fitted(starts[way], way, steps=steps) for way in ways]
        best = min(found, key=lambda fit: fit.misfit)
        if both and len(ways) == 2:
            found += [self.fitted(start, "both", steps=steps) for start in (best.poles, best.means[:, None, None])]
        return min(found, key=lambda fit: fit.misfit)

    @cached_property
    def _candidates(self) -> tuple[ComplexArray, RealArray]:
        """Poles and means of two (k,), and what each leaves of every channel as the only one, (k, q, p)."""
        s = self.poles[self.which]
        poles = np.concatenate([s, [(a + b) / 2 for a, b in combinations(s, 2)]])
        left = [self._at(each[None, None, None]).left for each in poles]
        return poles, np.array(left).reshape(-1, *self.channels)

    @property
    def _best(self) -> ComplexArray:
        """The pole that explains most as the only one of all channels, (1, 1, 1)."""
        poles, misfits = self._candidates
        return poles[[np.argmin(misfits.sum(axis=(1, 2)))], None, None]

    @staticmethod
    def _size(fit: _Fit) -> RealArray:
        """Return the energy of every mode of a fit whose poles all channels share, but for a factor, (m,)."""
        return np.asarray(np.sum(np.abs(fit.residues) ** 2, axis=(1, 2)) / -fit.poles[:, 0, 0].real)

    def _next(self, begun: list[int], usual: RealArray) -> tuple[list[int], _Centred]:
        """Return poles with a further one, that with which the shifts of all are likeliest, and modes that shift about these."""
        tries = ([*begun, k] for k in range(len(self.which)) if k not in begun)
        found = ((which, self._centred(self.poles[self.which[which]], usual)) for which in tries)
        return min(found, key=lambda each: each[1].cost)

    def _centred(self, start: ComplexArray, usual: RealArray) -> _Centred:
        """Return modes that shift about poles c (m,): shifts are as likely as normal ones.

        min J(c_k + a_k,i + b_k,j) + sum (|a|^2 + |b|^2) / v_k, v that of the median mode of the test. Poles that all channels share are
        biased by shifts, and means of free shifts by rows that show one mode alone.

        `usual` (2,): scatter relative to the frequency, and in half bandwidths.
        """
        (q, p), m = self.channels, len(start)
        precision = np.repeat(1 / np.maximum(usual[0] * np.abs(start), -usual[1] * start.real) ** 2, 2)
        c, a, b, damping = start[:, None, None], np.zeros((m, q, 1), complex), np.zeros((m, 1, p), complex), _DAMPING
        at = self._at(c + a + b, slopes=True)
        cost = self._cost(at, a, b, precision)
        for _ in range(_STEPS):
            centre, rows, columns = self._centred_step(at, a, b, precision, damping)
            longest = np.max(np.abs(centre + rows + columns) / (-_MAX_STEP * c.real), axis=(1, 2), keepdims=True)
            centre, rows, columns = (each / np.maximum(longest, 1) for each in (centre, rows, columns))
            trial = c + centre, a + rows, b + columns
            if np.all(sum(trial).real < 0):
                there = self._at(sum(trial), slopes=True)
                lower = self._cost(there, *trial[1:], precision)
            else:
                lower = np.inf
            if lower < cost:
                gained, (c, a, b), at, cost = cost - lower, trial, there, lower
                damping = max(damping / 5, _MIN_DAMPING)
                if gained < _RELATIVE_TOLERANCE * cost + _TOLERANCE:
                    break
            elif (damping := damping * 10) > _MAX_DAMPING_OF_STEPS:
                break
        misfit, poles = float(at.left.sum() / self.factor), np.array(np.broadcast_to(c + a + b, (m, q, p)))
        return _Centred(c[:, 0, 0], _Fit(misfit, poles, at.residues.T.reshape(m, q, p)), cost)

    def _cost(self, at: _Point, a: ComplexArray, b: ComplexArray, precision: RealArray) -> float:
        size = np.sum(np.abs(a) ** 2, axis=(1, 2)) + np.sum(np.abs(b) ** 2, axis=(1, 2))
        return float(at.left.sum() / self.factor + size @ precision[::2])

    def _centred_step(
        self, at: _Point, a: ComplexArray, b: ComplexArray, precision: RealArray, damping: float
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return steps of centres (m, 1, 1), and of shifts by row (m, q, 1) and by column (m, 1, p): rows are eliminated."""
        (q, p), n = self.channels, len(precision)
        N, slope = at.information.reshape(q, p, n, n) / self.factor, at.slope.reshape(q, p, n) / self.factor
        prior = np.diag(precision)
        # centres stand before the columns: they shift all channels
        across = np.concatenate([N.sum(axis=1)[:, :, None], N.transpose(0, 2, 1, 3)], axis=2).reshape(q, n, (p + 1) * n)
        right = slope.sum(axis=1) - precision * _real(a[:, :, 0].T)
        rows = _stiff(N.sum(axis=1) + prior, damping)
        by_column, whole = N.sum(axis=0), N.sum(axis=(0, 1))
        S = np.zeros((p + 1, n, p + 1, n))
        S[0, :, 0] = _stiff(whole, damping)
        S[0, :, 1:], S[1:, :, 0] = by_column.transpose(1, 0, 2), by_column
        S[np.arange(1, p + 1), :, np.arange(1, p + 1)] = _stiff(by_column + prior, damping)
        target = np.vstack([slope.sum(axis=(0, 1))[None], slope.sum(axis=0) - precision * _real(b[:, 0].T)])
        by_row, found = _eliminated(rows, across, right, S, target)
        centre, *columns = _complex(found)
        return centre[:, None, None], _complex(by_row).T[:, :, None], np.array(columns).T[:, None, :]

    def fitted(self, start: ComplexArray, way: str = "", *, steps: int = _STEPS) -> _Fit:
        """Return modes fitted from poles on, (m, 1 or q, 1 or p): `way`: what their shifts are free in, "row", "column" or "both".

        Damped Gauss-Newton steps; residues and all else are eliminated.
        """
        q, p = self.channels
        shape = (len(start), q if way in ("row", "both") else 1, p if way in ("column", "both") else 1)
        s = np.array(np.broadcast_to(start, shape))
        damping = _DAMPING
        narrowest = -_MIN_WIDTH * self.poles[self.which].real
        at = self._at(s, slopes=True)
        for _ in range(steps):
            trial = s + _held(self._step(at, way, damping), s, together=way == "both")
            trial = np.minimum(trial.real, -narrowest.min()) + 1j * trial.imag
            there = self._at(trial, slopes=True)
            gained = at.left.sum() - there.left.sum()
            if gained > 0:
                done = gained < _RELATIVE_TOLERANCE * at.left.sum() + _TOLERANCE
                s, at, damping = trial, there, max(damping / 5, _MIN_DAMPING)
                if done:
                    break
            else:
                damping *= 10
                if damping > _MAX_DAMPING_OF_STEPS:
                    break
        whole = (len(s), q, p)
        return _Fit(
            float(at.left.sum()) / self.factor, np.array(np.broadcast_to(s, whole)), at.residues.T.reshape(whole)
        )

    def _at(self, s: ComplexArray, *, slopes: bool = False) -> _Point:
        """Fit residues to poles (m, 1 or q, 1 or p), and with `slopes` prepare a step."""
        own, moved = (self._of_channels(each, s.shape) for each in self._functions(s.ravel()))
        size = np.maximum(np.sqrt(np.einsum("cki,cki->ci", own, own)), 1e-300)
        own /= size[:, None]
        Q, R = np.linalg.qr(own)
        seen = (self.data[:, None] @ Q)[:, 0]
        rest = self.data - (Q @ seen[:, :, None])[:, :, 0]
        c = np.einsum("cij,cj->ci", np.linalg.pinv(R, rcond=_ROUNDING), seen) / size
        residues, left = c[:, ::2] + 1j * c[:, 1::2], np.einsum("ck,ck->c", rest, rest)
        if not slopes:
            return _Point(left, residues)
        first, second, (a, b) = (
            moved[..., ::2],
            moved[..., 1::2],
            (each[:, None] for each in (residues.real, residues.imag)),
        )
        J = np.stack([a * first + b * second, a * second - b * first], axis=3).reshape(moved.shape)
        J -= Q @ (Q.transpose(0, 2, 1) @ J)
        return _Point(left, residues, J.transpose(0, 2, 1) @ J, (rest[:, None] @ J)[:, 0])

    def _of_channels(self, columns: RealArray, shape: tuple[int, ...]) -> RealArray:
        """Return columns (K, 2 m a b) of poles (m, a, b) as those of every channel, (c, K, 2 m), divided and without all else."""
        (q, p), (m, a, b) = self.channels, shape
        each = columns.reshape(len(columns), m, a, b, 2).transpose(2, 3, 0, 1, 4).reshape(a, b, len(columns), 2 * m)
        whole = self.weights.reshape(q, p, -1, 1) * each
        return self._less_free(whole.reshape(q * p, len(columns), 2 * m))

    def _step(self, at: _Point, way: str, damping: float) -> ComplexArray:
        """Return the step of poles (m, 1 or q, 1 or p): shifts by row are eliminated from those by column."""
        (q, p), n = self.channels, at.slope.shape[1]
        N, b = at.information.reshape(q, p, n, n), at.slope.reshape(q, p, n)
        if way == "":
            return _complex(_damped(N.sum(axis=(0, 1)), damping, b.sum(axis=(0, 1))))[:, None, None]
        if way == "row":
            return _complex(_damped(N.sum(axis=1), damping, b.sum(axis=1))).T[:, :, None]
        if way == "column":
            return _complex(_damped(N.sum(axis=0), damping, b.sum(axis=0))).T[:, None, :]
        rows, columns = _stiff(N.sum(axis=1), damping), _stiff(N.sum(axis=0), damping)
        across = N.transpose(0, 2, 1, 3).reshape(q, n, p * n)
        S = np.zeros((p, n, p, n))
        S[np.arange(p), :, np.arange(p)] = columns
        by_row, by_column = _eliminated(rows, across, b.sum(axis=1), S, b.sum(axis=0))
        return _complex(by_row).T[:, :, None] + _complex(by_column).T[:, None, :]


def _strongest(strength: RealArray, most: int) -> IntArray:
    """Return which are strongest, `most` of them, in their order."""
    return np.sort(np.argsort(-strength, kind="stable")[:most])


def _stiff(N: RealArray, damping: float) -> RealArray:
    """Return information (..., n, n) with its diagonal raised by Levenberg-Marquardt damping."""
    own = np.einsum("...ii->...i", N)
    least = _ROUNDING * np.maximum(own.sum(axis=-1, keepdims=True), 1e-300)
    return np.asarray(N + (damping * own + least)[..., None] * np.eye(N.shape[-1]))


def _eliminated(
    rows: RealArray, across: RealArray, right: RealArray, S: RealArray, target: RealArray
) -> tuple[RealArray, RealArray]:
    """Solve rows x + across y = right, row by row, and sum across' x + S y = target; return x (q, n) and y, as the target is.

    `rows` (q, n, n), `across` (q, n, k n), `right` (q, n), `S` (k, n, k, n), `target` (k, n).
    """
    by_rows = np.linalg.solve(rows, np.concatenate([across, right[:, :, None]], axis=2))
    left = S.reshape(target.size, -1) - np.einsum("qni,qnj->ij", across, by_rows[:, :, :-1])
    y = np.linalg.lstsq(left, target.ravel() - np.einsum("qni,qn->i", across, by_rows[:, :, -1]), rcond=_ROUNDING)[0]
    return by_rows[:, :, -1] - by_rows[:, :, :-1] @ y, y.reshape(target.shape)


def _damped(N: RealArray, damping: float, slope: RealArray) -> RealArray:
    return np.asarray(np.linalg.solve(_stiff(N, damping), slope[..., None])[..., 0])


def _complex(steps: RealArray) -> ComplexArray:
    """Return real and imaginary parts side by side, (..., 2 m), as complex numbers (..., m)."""
    return np.asarray(steps[..., ::2] + 1j * steps[..., 1::2])


def _real(steps: ComplexArray) -> RealArray:
    """Return complex numbers (..., m) as real and imaginary parts side by side, (..., 2 m)."""
    return np.stack([steps.real, steps.imag], axis=-1).reshape(*steps.shape[:-1], -1)


def _held(step: ComplexArray, s: ComplexArray, *, together: bool) -> ComplexArray:
    """Return steps of poles (m, a, b), none beyond half a half bandwidth; shifts that add up are shortened `together`."""
    longest = np.abs(step) / (-_MAX_STEP * s.real)
    longest = np.max(longest, axis=(1, 2), keepdims=True) if together else longest
    return np.asarray(step / np.maximum(longest, 1))


def _normal(V: Array, weight: RealArray, R: Array) -> tuple[ComplexArray, ComplexArray]:
    """Return matrices and right sides (q, m, m), (q, m, 1) of weighted least squares of R (q, p) = U V', row by row."""
    weighted = V.conj() * weight[:, :, None]
    N = weighted.transpose(0, 2, 1) @ V
    level = np.einsum("qii->q", N).real[:, None, None] * _ROUNDING + np.finfo(float).tiny
    return N + level * np.eye(V.shape[1]), np.einsum("qpm,qp->qm", weighted, R)[..., None]


def _unit(columns: RealArray) -> RealArray:
    """Return columns (c, K, t) of length one; those that are zero stay so."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    return np.asarray(columns / np.where(size > 0, size, 1))
