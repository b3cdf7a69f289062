"""Select poles jointly: refine candidates together, remove those without evidence, add what the residual shows.

The gain of a mode is the rise of the squared misfit without it, the others refitted, in variances of the noise. Its threshold counts
the free shape and participation and the search over frequency: `search_bound`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.functions.poles import overlap
from modalscope.judging.recount import Recount, recount_of
from modalscope.judging.selection_problem import SelectionProblem
from modalscope.judging.tracking import collinear
from modalscope.likelihood.covariance import deviations_of_poles, pole_blocks
from modalscope.likelihood.descent import Descent, descend, inverse, normal, residual
from modalscope.likelihood.likelihood import Fitted, Point, unit_vectors
from modalscope.likelihood.matched import amplitudes, strongest_peaks
from modalscope.likelihood.whitening import colour
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray

# ---------------------------------------------------------------------------------------------------------- candidates
# Candidates are refined together and pruned by what each explains.


@dataclass(frozen=True, eq=False, slots=True)
class Optimum:
    """The optimum of a descent, and the variance of the noise by then."""

    descent: Descent
    variance: float

    @property
    def poles(self) -> ComplexArray:
        """rad/s."""
        return self.descent.point.poles

    @property
    def residues(self) -> tuple[ComplexArray, ComplexArray]:
        """Shapes (l, n) and participation (n, m)."""
        return self.descent.point.problem.scaled_back(self.descent.point, self.descent.fitted)


@dataclass(frozen=True, eq=False, slots=True)
class State(Optimum):
    """The state of a joint selection: the optimum so far, and the problem."""

    selection: SelectionProblem

    @property
    def sides(self) -> ComplexArray:
        """Unit vectors of the side that varies, (n, p)."""
        return self.descent.point.sides

    @property
    def gain(self) -> RealArray:
        """What each pole explains, in variances."""
        return self.descent.fitted.gain / self.variance * self.selection.gain_factors(self.poles)

    def without(self, gone: int) -> tuple[ComplexArray, ComplexArray]:
        """Return poles and sides of the others."""
        return np.delete(self.poles, gone), np.delete(self.sides, gone, axis=0)


def converged(selection: SelectionProblem, variance: float, poles: ComplexArray, sides: ComplexArray) -> State:
    """Refine jointly, drop poles that cannot be modes, prune at the threshold, and repeat until nothing changes."""
    while True:
        tolerance, most = (1e-5, 8) if selection.brief else (1e-7, 25)
        descent = _descended(selection, poles, sides, tolerance=tolerance, most=most)
        state = State(
            descent, variance if selection.coloured else min(variance, variance_of_fit(selection, descent)), selection
        )
        fit = np.flatnonzero(selection.possible(state.poles))
        poles, sides = state.poles[fit], state.sides[fit]
        if len(fit) == len(state.poles):
            kept = pruned(descent.fitted, selection.bar * state.variance / selection.gain_factors(poles))
            if len(kept) == len(poles):
                return state
            poles, sides = poles[kept], sides[kept]
        variance = state.variance


def _descended(
    selection: SelectionProblem,
    poles: ComplexArray,
    sides: ComplexArray,
    *,
    tolerance: float,
    most: int,
    decisive: float | None = None,
) -> Descent:
    """Refine poles jointly; where white noise is in doubt, those that cannot be modes are dropped on the way.

    Of white data a pole that leaves the band in one step comes back in another.
    """
    stays = selection.possible if selection.brief or selection.coloured else None
    return descend(selection.problem, poles, sides, tolerance=tolerance, most=most, decisive=decisive, stays=stays)


def variance_of_fit(selection: SelectionProblem, descent: Descent) -> float:
    """Return the variance of the model's own residual, by row: below the reference model's where that lacked a mode."""
    q, p = selection.problem.data.shape[1:]
    return descent.cost / max(selection.problem.freedom - 2 * len(descent.point.poles) * int(q + p), 1)


def channel_noise_factors(state: State) -> RealArray:
    """Return the noise variance of the channels that determine each pole, relative to the product of levels; at least one, (n,).

    Data are divided by an output's and an input's part of the noise. Where that of a channel is no such product the amplitude u* A v of a
    pole, A that of all channels, u and v the directions of its shape and participation, has the variance sum |u_o|^2 |v_i|^2 s_oi, s the
    residual of each channel in variances.
    """
    point, fitted = state.descent.point, state.descent.fitted
    left = point.left_by_channel(fitted)
    by_channel = (
        (left.T if point.problem.turned else left) * left.size / (state.selection.problem.freedom * state.variance)
    )
    u, v = np.abs(fitted.linear) ** 2, np.abs(point.sides) ** 2
    seen = np.einsum("qn,np,qp->n", u, v, by_channel) / np.maximum(u.sum(axis=0) * v.sum(axis=1), 1e-300)
    return np.asarray(np.maximum(seen, 1.0))


def pruned(fitted: Fitted, least: RealArray) -> Array:
    """Return which modes stay when the weakest is removed, one by one, while it explains less than its `least` (n,).

    The rise of the squared misfit without mode j is c_j' S_jj^-1 c_j, with S the covariance of all coefficients c; without it
    they are c - S_.j S_jj^-1 c_j, and their covariance is S - S_.j S_jj^-1 S_j.
    """
    S = fitted.spread
    c = np.stack([fitted.linear.real.T, fitted.linear.imag.T], axis=1).reshape(len(S), len(fitted.linear))
    kept = np.arange(len(S) // 2)
    while kept.size:
        pairs = 2 * np.arange(kept.size)[:, None] + [0, 1]
        own = np.linalg.pinv(S[pairs[:, :, None], pairs[:, None, :]], hermitian=True)
        each = c.reshape(kept.size, 2, c.shape[1])
        gain = np.sum(each * (own @ each), axis=(1, 2))
        weakest = int(np.argmin(gain / least[kept]))
        if gain[weakest] >= least[kept[weakest]]:
            break
        block = pairs[weakest]
        carried = S[:, block] @ own[weakest]
        rest = np.delete(np.arange(len(S)), block)
        c, S = (c - carried @ c[block])[rest], (S - carried @ S[block])[np.ix_(rest, rest)]
        kept = np.delete(kept, weakest)
    return kept


# ------------------------------------------------------------------------------------------------------------- joint selection

#: Where white noise is in doubt, each round must reduce the excess over white noise to this fraction. Above this number of values peaks
#: are tested for it before the joint refinement.
_MAX_EXCESS_RATIO, _MANY_VALUES = 0.7, 20_000

#: Two poles replace one at this distance to either side, in half bandwidths.
_SPLIT_HALF_BANDWIDTHS = 0.5

#: Maximum number of searches of the residual, and of poles added in each.
_MAX_ROUNDS, _PEAKS_PER_ROUND = 8, 6


@dataclass(frozen=True, eq=False, slots=True)
class Outcome(Optimum):
    """The significant poles, as they are in the data.

    `gain` (n,): in variances. `frequency_std`, `damping_std` (n,): Hz, ratio, from Fisher information. `noise`: the larger variance, of
    the noise or of the residual. `recount`: likelihood ratios under coloured errors.
    """

    gain: RealArray
    frequency_std: RealArray
    damping_std: RealArray
    noise: float
    recount: Recount | None = None

    def as_one(self, first: int, others: Array) -> tuple[float, float]:
        """Return the standard deviations of frequency (Hz) and damping ratio of a pole that stands for a cluster.

        The residues of a cluster may nearly cancel: the data determine only where all of it lies.
        """
        point = self.descent.point
        kept = np.setdiff1d(np.arange(len(point.poles)), others)
        # the functions that remain lie in the span of all
        less = replace(
            point,
            poles=point.poles[kept],
            sides=point.sides[kept],
            own=point.own[:, kept],
            derived=point.derived[:, kept],
        )
        covariance = self.noise * inverse(normal(less, less.fitted())[0])
        at = 2 * point.sides.shape[1] * np.flatnonzero(kept == first)
        f, zeta = deviations_of_poles(point.poles[[first]], pole_blocks(covariance, at))
        return float(f[0]), float(zeta[0])


def select_jointly(
    selection: SelectionProblem, poles: ComplexArray, sides: ComplexArray, *, doubted: bool = False
) -> Outcome | None:
    """Return the significant poles among candidates.

    `poles` (n,): rad/s, as they are in the data. `sides` (n, p): participation of the side that varies, divided as the data are.
    `doubted`: white noise is in doubt: return None when the residual does not become white, or much whiter round by round.
    """
    sides = unit_vectors(sides)
    point = selection.problem.at(poles, sides, slopes=False)
    kept = pruned(point.fitted(), selection.bar / 2 * selection.variance / selection.gain_factors(poles))
    state = converged(selection, selection.variance, poles[kept], sides[kept])
    if not selection.coloured:
        completed = _completed(state, _excess(state) if doubted else None)
        if completed is None:
            return None
        state = _split_where_needed(completed)
    state = _without_redundant(state)
    if not selection.coloured:
        state = _above_channel_noise(state)
    if not (selection.coloured and selection.recounted):
        return _finished(state)
    state, recount = _completed_in_coloured_errors(state)
    return replace(_finished(state), recount=recount)


def _completed(state: State, excess: float | None) -> State | None:
    """Add the strongest peaks of the residual, round by round; return None where it must become white and does not."""
    tried = state.poles
    for _ in range(_MAX_ROUNDS):
        more, named = _with_peaks(state, tried)
        if not len(named):
            break
        large = state.selection.problem.freedom > _MANY_VALUES
        if excess is not None and large and _excess(state, named) > max(1.0, _MAX_EXCESS_RATIO * excess):
            return None
        before = len(state.poles)
        state = converged(state.selection, state.variance, *more)
        tried = np.concatenate([tried, named, state.poles])
        if excess is not None:
            left = _excess(state)
            if left > max(1.0, _MAX_EXCESS_RATIO * excess):
                return None
            excess = left if left > 1 else None
        if len(state.poles) <= before:
            break
    return state if excess is None or excess <= 1 else None


def _completed_in_coloured_errors(state: State) -> tuple[State, Recount]:
    """Add peaks that exceed coloured errors, round by round, where they stay significant in the joint fit.

    Peaks of earlier rounds are judged again with those of each round: what one explained may be that of a later one.
    """
    recount = recount_of(state.selection, state.descent)
    rounds = np.zeros(len(state.poles), dtype=int)  # in which each pole was added, zero for those of the diagram
    for this in range(1, _MAX_ROUNDS + 1):
        poles, sides = recount.peaks(_PEAKS_PER_ROUND)
        candidates = np.append(state.poles, poles), np.vstack([state.sides, sides])
        trial = _with_significant_peaks(state, candidates, np.append(rounds, np.full(len(poles), this)), this)
        if trial is None:
            break
        state, recount, rounds = trial
    return state, recount


def _with_significant_peaks(
    state: State, candidates: tuple[ComplexArray, ComplexArray], rounds: IntArray, last: int
) -> tuple[State, Recount, IntArray] | None:
    """Refine poles jointly and remove peaks until all that remain are significant; return None where none of the last round is.

    Peaks of the last round are judged first, then the weakest of earlier ones, one at a time: it may be significant without another.

    `candidates`: poles (n,) and sides (n, p). `rounds` (n,): in which each was added; those of round zero are judged elsewhere.
    `last`: the last round.
    """
    while np.any(rounds == last):
        descent = _descended(state.selection, *candidates, tolerance=1e-5, most=8)
        point, rounds = descent.point, rounds[descent.kept]
        recount, added = recount_of(state.selection, descent), np.flatnonzero(rounds)
        ratio, new = recount.relative_gains(added), rounds[added] == last
        gone = added[new][~significant_peaks(point.poles[added[new]], ratio[new])]
        if not gone.size:
            gone = added[ratio <= min(1.0, ratio.min(initial=np.inf))]
        if not gone.size:
            return State(descent, state.variance, state.selection), recount, rounds
        kept = np.setdiff1d(np.arange(len(rounds)), gone)
        candidates, rounds = (point.poles[kept], point.sides[kept]), rounds[kept]
    return None


def _excess(state: State, more: ComplexArray | tuple[()] = ()) -> float:
    """Return the excess of the residual over white noise (white up to 1), after projecting out further poles."""
    point = state.descent.point
    left = residual(point, state.descent.fitted)
    if len(more):
        Q = np.linalg.qr(point.problem.columns(np.asarray(more), slopes=False)[0])[0]
        flat = left.reshape(len(left), -1)
        left = (flat - Q @ (Q.T @ flat)).reshape(left.shape)
    unknown = point.problem.terms.shape[1] + 2 * (len(state.poles) + len(more))
    return colour(left, point.problem.light.count, unknown, window=state.selection.window).excess


def gains_in_residual(selection: SelectionProblem, found: Outcome, poles: Array) -> RealArray:
    """Return what each pole (n,) alone explains of the residual, in variances, with its best shape and participation."""
    left = residual(found.descent.point, found.descent.fitted)
    A = amplitudes(selection.problem.light, left, selection.problem.rows, poles)
    return np.asarray(np.linalg.norm(A, ord=2, axis=(1, 2)) ** 2 / found.variance * selection.gain_factors(poles))


def significant_peaks(poles: ComplexArray, ratio: RealArray) -> Array:
    """Return which new poles stay, (n,): the significant ones, and of others that share a peak the strongest.

    `poles` (n,). `ratio` (n,): as in `Recount.relative_gains`.
    """
    near = overlap(poles, poles)
    rank = np.argsort(np.argsort(ratio))
    first = np.all(~near | (rank[:, None] >= rank), axis=1)
    return np.asarray((ratio > 1) | (first & (near.sum(axis=1) > 1)))


def _with_peaks(state: State, tried: ComplexArray) -> tuple[tuple[ComplexArray, ComplexArray], ComplexArray]:
    """Return poles and sides with the strongest peaks of the residual, and these alone."""
    point, problem = state.descent.point, state.selection.problem
    known = np.concatenate([state.poles, tried])
    left = residual(point, state.descent.fitted)
    least = state.selection.bar / 2 * state.variance
    peaks = strongest_peaks(problem.light, left, problem.rows, known, least, _PEAKS_PER_ROUND)
    named = np.array([peak.pole for peak in peaks], dtype=complex)
    sides = np.array([peak.participation for peak in peaks], dtype=complex).reshape(-1, point.sides.shape[1])
    return (np.append(state.poles, named), np.vstack([state.sides, sides])), named


def _split_where_needed(state: State) -> State:
    """Replace one pole by two where that lowers the misfit by more than noise may.

    The residual of one pole fitted to two of the same shape is of second order in their distance and shows no peak.
    """
    for pole in state.poles[np.argsort(-state.gain)]:
        j = int(np.argmin(np.abs(state.poles - pole)))
        least = state.selection.bar * state.variance
        poles, sides = _two_for(state, j)
        point = state.selection.problem.at(poles, sides, slopes=False)
        if state.gain[j] < state.selection.bar or state.descent.cost - point.cost(point.fitted()) < least / 2:
            continue
        aim = state.descent.cost - least
        other = _descended(state.selection, poles, sides, tolerance=1e-5, most=12, decisive=aim)
        if other.cost < aim:
            state = converged(state.selection, state.variance, other.point.poles, other.point.sides)
    return state


def _two_for(state: State, j: int) -> tuple[ComplexArray, ComplexArray]:
    """Return poles and sides with two, `_SPLIT_HALF_BANDWIDTHS` of a half bandwidth to either side, for pole j."""
    apart = -1j * _SPLIT_HALF_BANDWIDTHS * state.poles[j].real
    poles = np.append(state.poles, state.poles[j] - apart)
    poles[j] += apart
    return poles, np.vstack([state.sides, state.sides[[j]]])


def _without_redundant(state: State) -> State:
    """Remove weak poles, and the weaker of two that overlap, where the others refined without it fit as well."""
    cleared: set[complex] = set()
    while True:
        doubtful = [j for j in _doubtful(state) if complex(state.poles[j]) not in cleared]
        if not doubtful:
            return state
        j = doubtful[0]
        least = state.descent.cost + state.selection.bar * state.variance / float(
            state.selection.gain_factors(state.poles[[j]])[0]
        )
        other = _descended(state.selection, *state.without(j), tolerance=1e-5, most=12, decisive=least)
        if other.cost < least:
            state = converged(state.selection, state.variance, other.point.poles, other.point.sides)
        else:
            cleared.add(complex(state.poles[j]))


def _above_channel_noise(state: State) -> State:
    """Remove poles that are noise by the variance of the channels they rest on, where that exceeds the product of levels."""
    while True:
        above = state.gain >= state.selection.bar * channel_noise_factors(state)
        if np.all(above):
            return state
        state = converged(state.selection, state.variance, state.poles[above], state.sides[above])


def _doubtful(state: State) -> list[int]:
    """Return the weak modes and the weaker one of every pair that overlaps, the weakest first; parts of one mode excepted."""
    w, half, gain = state.poles.imag, -state.poles.real, state.gain
    near = np.abs(w[:, None] - w) < half[:, None] + half
    if state.selection.coloured:
        near &= ~collinear(state.poles, *state.residues)
    weaker = np.any(near & (gain[:, None] < gain), axis=1)
    return [int(j) for j in np.argsort(gain) if weaker[j] or gain[j] < 2 * state.selection.bar]


def _finished(state: State) -> Outcome:
    """Refine to convergence and compute the standard deviations of every mode."""
    descent, coloured = state.descent, state.selection.coloured
    if not coloured:
        descent = _descended(state.selection, state.poles, state.sides, tolerance=1e-9, most=40)
    own = variance_of_fit(state.selection, descent)
    state = replace(state, descent=descent, variance=state.variance if coloured else min(state.variance, own))
    point: Point = descent.point
    n, p = point.sides.shape
    noise = max(state.variance, own)
    covariance = noise * inverse(normal(point, descent.fitted)[0]) if n else np.zeros((0, 0))
    f, zeta = deviations_of_poles(point.poles, pole_blocks(covariance, 2 * p * np.arange(n)))
    return Outcome(descent, state.variance, state.gain, f, zeta, noise)
