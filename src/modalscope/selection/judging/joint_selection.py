"""Select poles jointly: refine candidates together, remove those that are not significant, add poles at peaks of the residual.

The gain of a mode is the increase of the squared misfit without it, with the others refitted, in variances of the noise. The threshold is
what noise reaches with a free shape and participation anywhere in the band: `search_bound`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import overlap
from modalscope.selection.judging.recount import Recount, recount_of
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.judging.tracking import collinear
from modalscope.selection.likelihood.covariance import deviations_of_poles, pole_blocks
from modalscope.selection.likelihood.descent import Descent, descend
from modalscope.selection.likelihood.information import inverse, normal, residual
from modalscope.selection.likelihood.likelihood import Fitted, Point, WhitenedResponse, unit_vectors
from modalscope.selection.likelihood.matched import amplitudes, strongest_peaks
from modalscope.selection.likelihood.whitening import LEVEL_LINES, colour, levels_of

# ------------------------------------------------------------------------------------------------- joint refinement and pruning

#: When a descent ends: no step promises more than this part of the squared misfit, or after this number of steps. The gains need few
#: digits while poles are still removed and added; the values that are reported need all. The numbers are choices.
_ROUND = {"tolerance": 1e-7, "most": 25}
_BRIEF_ROUND = {"tolerance": 1e-5, "most": 8}
_TRIAL = {"tolerance": 1e-5, "most": 12}
_FINAL = {"tolerance": 1e-9, "most": 40}


@dataclass(frozen=True, eq=False, slots=True)
class Optimum:
    """The optimum of a descent, and the variance of the noise that was known when it was reached."""

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
    """State of a joint selection: the optimum so far, and the problem."""

    selection: SelectionProblem

    @property
    def sides(self) -> ComplexArray:
        """Unit vectors of the side that varies, (n, p)."""
        return self.descent.point.sides

    @property
    def gain(self) -> RealArray:
        """Gain of each pole, in variances."""
        return self.descent.fitted.gain / self.variance * self.selection.gain_factors(self.poles)

    def without(self, j: int) -> tuple[ComplexArray, ComplexArray]:
        """Return poles and sides of all but pole j."""
        return np.delete(self.poles, j), np.delete(self.sides, j, axis=0)


def converged(selection: SelectionProblem, variance: float, poles: ComplexArray, sides: ComplexArray) -> State:
    """Refine jointly, drop poles that cannot be modes, prune at the threshold, and repeat until nothing changes."""
    while True:
        descent = _refine(selection, poles, sides, _BRIEF_ROUND if selection.brief else _ROUND)
        if not selection.coloured:
            variance = min(variance, variance_of_fit(selection, descent))
        state = State(descent, variance, selection)
        possible = np.flatnonzero(selection.possible(state.poles))
        poles, sides = state.poles[possible], state.sides[possible]
        if len(possible) == len(state.poles):
            kept = pruned(descent.fitted, selection.bar * variance / selection.gain_factors(poles))
            if len(kept) == len(poles):
                return state
            poles, sides = poles[kept], sides[kept]


def _refine(
    selection: SelectionProblem,
    poles: ComplexArray,
    sides: ComplexArray,
    limits: Mapping[str, Any],
    decisive: float | None = None,
) -> Descent:
    """Refine poles jointly; unless the noise is known to be white, poles that cannot be modes are dropped during the descent.

    In white noise they stay, because a pole that leaves the band in one step may come back in the next.

    `limits`: `tolerance` and `most` of `descend`. `decisive`: squared misfit at which the descent ends.
    """
    stays = selection.possible if selection.brief or selection.coloured else None
    return descend(selection.problem, poles, sides, **limits, decisive=decisive, stays=stays)


#: What rounding leaves of a fit to data without noise, relative to them.
_ROUNDING_OF_FIT = 1e-12


def variance_of_fit(selection: SelectionProblem, descent: Descent) -> float:
    """Return the variance of the residual of this model by row; it is below that of the reference model if the reference lacks a mode."""
    q, p = selection.problem.data.shape[1:]
    least = _ROUNDING_OF_FIT**2 * selection.problem.size
    return max(descent.cost, least) / max(selection.problem.freedom - 2 * len(descent.point.poles) * int(q + p), 1)


#: Gains above this multiple of the threshold are beyond what lines around a pole may be louder than others. Of 96 random lists with errors
#: of 3 % of the response, each line by itself, five have a false mode where this is not asked.
_MAX_LOCAL = 4.0


def channel_noise_factors(state: State) -> RealArray:
    """Return the noise variance of the channels that determine each pole, relative to the assumed one; at least one, (n,).

    The data are divided by levels that are known to a factor of two. The variance of the amplitude of a pole is the mean of those of
    the channels of the divided data, s_oi, each by its part in the pole, |u_o|^2 |v_i|^2 with u its shape and v its participation. Of a
    weak pole that of the lines around it counts, too: errors that grow with the response are loud where that of a channel is.
    """
    point, fitted = state.descent.point, state.descent.fitted
    residuals = point.left_by_channel(fitted)
    by_channel = residuals * residuals.size / (state.selection.problem.freedom * state.variance)
    if point.problem.turned:
        by_channel = by_channel.T
    weights = np.ones(by_channel.shape) if point.problem.weights is None else point.problem.weights
    part = np.einsum("qn,np,qp->nqp", np.abs(fitted.linear) ** 2, np.abs(point.sides) ** 2, weights**2)
    part /= np.maximum(part.sum(axis=(1, 2), keepdims=True), 1e-300)
    factors = np.maximum(np.sum(part * by_channel, axis=(1, 2)), 1.0)
    grid, weak = point.problem.light.grid, np.flatnonzero(state.gain < _MAX_LOCAL * state.selection.bar)
    if grid is not None and weak.size:
        squares = residual(point, fitted).reshape(2, grid.size, *by_channel.shape) ** 2
        for j in weak:
            near = np.abs(grid - state.poles[j].imag / (2 * np.pi)).argsort(kind="stable")[:LEVEL_LINES]
            factors[j] = max(factors[j], float(np.sum(part[j] * squares[:, near].mean(axis=(0, 1)))) / state.variance)
    return np.asarray(factors)


def pruned(fitted: Fitted, least: RealArray) -> Array:
    """Return which modes remain when the weakest is removed, one by one, while its gain is below its `least` (n,).

    The squared misfit increases by c_j' S_jj^-1 c_j without mode j, with S the covariance of all coefficients c; the others become
    c - S_.j S_jj^-1 c_j, and their covariance S - S_.j S_jj^-1 S_j.
    """
    sides = [(side.spread, c) for side, c in zip(fitted.sides, fitted.parts, strict=True)]
    kept = np.arange(fitted.linear.shape[1])
    while kept.size:
        pairs = 2 * np.arange(kept.size)[:, None] + [0, 1]
        inverses = [np.linalg.pinv(S[pairs[:, :, None], pairs[:, None, :]], hermitian=True) for S, _ in sides]
        by_mode = [c.reshape(kept.size, 2, c.shape[1]) for _, c in sides]
        gain = sum(np.sum(c * (own @ c), axis=(1, 2)) for own, c in zip(inverses, by_mode, strict=True))
        weakest = int(np.argmin(gain / least[kept]))
        if gain[weakest] >= least[kept[weakest]]:
            break
        block = pairs[weakest]
        rest = np.delete(np.arange(2 * kept.size), block)
        for k, ((S, c), own) in enumerate(zip(sides, inverses, strict=True)):
            carried = S[:, block] @ own[weakest]
            sides[k] = (S - carried @ S[block])[np.ix_(rest, rest)], (c - carried @ c[block])[rest]
        kept = np.delete(kept, weakest)
    return kept


# ------------------------------------------------------------------------------------------------------------- joint selection

#: If white noise is in doubt, each round must reduce the excess of the residual over white noise to this fraction; else it will not become
#: white in a few rounds.
MAX_EXCESS_RATIO = 0.7

#: Or what is left must fall to this part: a strong mode was missing, and what hid behind it shows only now.
_MAX_MISFIT_RATIO = 0.1

#: Distance, in half bandwidths, of each of two poles that replace one in a trial. Where the descent starts is a choice: it moves both.
_SPLIT_HALF_BANDWIDTHS = 0.5

#: Fraction of the threshold at which a pole is tried that was not refined yet, since refinement with the others increases its gain.
_UNREFINED_FRACTION = 0.5

#: Modes with gains below this multiple of the threshold are refitted without, to make sure that the others cannot replace them.
_WEAK_MULTIPLE = 2

#: Maximum number of searches of the residual, of poles added in each, and of peaks in a row that are no modes: choices that bound the
#: time, and the chance that one of many is taken for a mode.
_MAX_ROUNDS, _PEAKS_PER_ROUND, _MAX_IN_VAIN = 8, 6, 18

#: The level of a channel over what poles leave of it, from which the data are divided anew: levels are read to the next power of two.
_MAX_LEVEL_RATIO = 2.0


@dataclass(frozen=True, eq=False, slots=True)
class Outcome(Optimum):
    """The significant poles, as they are in the data: the damping of an exponential window is still in them.

    `gain` (n,): in variances. `frequency_std`, `damping_std` (n,): Hz, ratio, from Fisher information. `noise`: the larger of the
    variances of the noise and of the residual. `recount`: likelihood ratios under coloured errors.
    """

    gain: RealArray
    frequency_std: RealArray
    damping_std: RealArray
    noise: float
    recount: Recount | None = None

    def as_one(self, first: int, others: Array) -> tuple[float, float]:
        """Return the standard deviations of frequency (Hz) and damping ratio of pole `first` that stands for itself and `others`.

        The residues of several poles of one mode may nearly cancel, and each pole by itself is uncertain then. The data determine where
        all of them lie: the deviations are those of the model without `others`.
        """
        point = self.descent.point
        kept = np.setdiff1d(np.arange(len(point.poles)), others)
        # `span` stays that of all poles: it contains the functions of those that remain
        reduced = replace(
            point,
            poles=point.poles[kept],
            sides=point.sides[kept],
            own=point.own[:, kept],
            derived=point.derived[:, kept],
        )
        covariance = self.noise * inverse(normal(reduced, reduced.fitted())[0])
        row = 2 * point.sides.shape[1] * np.flatnonzero(kept == first)
        f, zeta = deviations_of_poles(point.poles[[first]], pole_blocks(covariance, row))
        return float(f[0]), float(zeta[0])


def select_jointly(
    selection: SelectionProblem, poles: ComplexArray, sides: ComplexArray, *, doubted: bool = False
) -> Outcome | None:
    """Return the significant poles among candidates.

    `poles` (n,): rad/s, as they are in the data. `sides` (n, p): participation of the side that varies, divided as the data are.
    `doubted`: whether white noise is in doubt; then the result is None unless each round makes the residual much whiter, and the last one
    white.
    """
    sides = unit_vectors(sides)
    point = selection.problem.at(poles, sides, slopes=False)
    least = _UNREFINED_FRACTION * selection.bar * selection.variance
    kept = pruned(point.fitted(), least / selection.gain_factors(poles))
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
    """Add the strongest peaks of the residual, round by round.

    `excess`: that of the residual over white noise if the noise is in doubt, None if it is white. Return None when it is in doubt and the
    rounds do not make it white.
    """
    examined = state.poles
    for _ in range(_MAX_ROUNDS):
        state = _levelled(state)
        candidates, peaks = _with_peaks(state, examined)
        if not len(peaks):
            break
        before, state = state, converged(state.selection, state.variance, *candidates)
        examined = np.concatenate([examined, peaks, state.poles])
        if excess is not None:
            remainder, lower = _excess(state), state.descent.cost < _MAX_MISFIT_RATIO * before.descent.cost
            if remainder > max(1.0, MAX_EXCESS_RATIO * excess) and not lower:
                return None
            excess = remainder if remainder > 1 else None
        elif len(state.poles) <= len(before.poles):
            break
    return state if excess is None or excess <= 1 else None


def _levelled(state: State) -> State:
    """Return the state under the levels that its poles leave, where the reference model lacked some and left twice as much of a channel."""
    selection, descent = state.selection, state.descent
    problem, (q, p) = selection.problem, selection.problem.channels
    free = max((problem.freedom - 2 * len(state.poles) * (q + p)) / (q * p), 1)
    given = problem.levels.channels * np.sqrt(state.variance)
    left = np.sqrt(descent.point.left_by_channel(descent.fitted) / free) * problem.levels.channels
    if np.all(_MAX_LEVEL_RATIO * left > given):
        return state
    levels = levels_of(np.minimum(left, given), given)
    point = descent.point.releveled(levels)
    variance = float(np.mean((left / levels.channels) ** 2))
    assert isinstance(point.problem, WhitenedResponse)
    return converged(replace(selection, problem=point.problem, variance=variance), variance, point.poles, point.sides)


def _completed_in_coloured_errors(state: State) -> tuple[State, Recount]:
    """Add the peaks of the residual that exceed coloured errors, round by round, if they remain significant in the joint fit.

    Poles added in earlier rounds are tested again in each round: one that is added later may explain what they did. Where no peak is
    a mode, the next strongest follow: the first are often what strong modes leave.
    """
    recount = recount_of(state.selection, state.descent)
    rounds = np.zeros(len(state.poles), dtype=int)  # in which each pole was added; zero for those of the diagram
    k, examined = 0, np.zeros(0, complex)
    while k < _MAX_ROUNDS and len(examined) < _MAX_IN_VAIN:
        k += 1
        poles, sides = recount.peaks(_PEAKS_PER_ROUND, examined)
        if not len(poles):
            break
        examined = np.append(examined, poles)
        candidates = np.append(state.poles, poles), np.vstack([state.sides, sides])
        trial = _with_significant_peaks(state, recount, candidates, np.append(rounds, np.full(len(poles), k)), k)
        if trial is not None:
            examined = examined[: 0 if len(trial[2]) > len(rounds) else None]
            state, recount, rounds = trial
    return state, recount


def _with_significant_peaks(
    state: State, before: Recount, candidates: tuple[ComplexArray, ComplexArray], rounds: IntArray, last: int
) -> tuple[State, Recount, IntArray] | None:
    """Refine poles jointly and remove peaks until all that remain are significant; return None if no peak of the last round remains.

    The peaks of the last round are tested first. Then the weakest of all is removed, one at a time, since another may become significant
    without it. Where none remains the state stands, unless others left with them none of which was significant.

    `before`: of the state. `candidates`: poles (n,) and sides (n, p), those of the state first. `rounds` (n,): in which each was added;
    those of round zero are not tested here. `last`: the last round.
    """
    which = np.arange(len(rounds))
    while np.any(rounds == last):
        descent = _refine(state.selection, *candidates, _BRIEF_ROUND)
        point, rounds, which = descent.point, rounds[descent.kept], which[descent.kept]
        recount, added = recount_of(state.selection, descent), np.flatnonzero(rounds)
        ratio, new = recount.relative_gains(added), rounds[added] == last
        gone = added[new][~significant_peaks(point.poles[added[new]], ratio[new])]
        if not gone.size:
            gone = added[ratio <= min(1.0, ratio.min(initial=np.inf))]
        if not gone.size:
            left = np.setdiff1d(np.arange(len(state.poles)), which)
            better = new.any() or (left.size and np.all(before.relative_gains(left) <= 1))
            return (State(descent, state.variance, state.selection), recount, rounds) if better else None
        kept = np.setdiff1d(np.arange(len(rounds)), gone)
        candidates, rounds, which = (point.poles[kept], point.sides[kept]), rounds[kept], which[kept]
        del descent, point, recount  # before the next take their room
    return None


def _excess(state: State) -> float:
    """Return the excess of the residual over white noise, 1 for white noise; 0 where it is rounding."""
    point = state.descent.point
    if state.descent.cost < _ROUNDING_OF_FIT**2 * point.problem.size:
        return 0.0
    unknowns = point.problem.terms.shape[1] + 2 * len(state.poles)
    errors = residual(point, state.descent.fitted)
    return colour(errors, point.problem.light.count, unknowns, kept=point.kept(), window=state.selection.window).excess


def gains_in_residual(selection: SelectionProblem, outcome: Outcome, poles: Array) -> RealArray:
    """Return the gain of each pole (n,) alone in the residual, in variances, with its best shape and participation."""
    errors = residual(outcome.descent.point, outcome.descent.fitted)
    A = amplitudes(selection.problem.light, errors, selection.problem.rows, poles)
    return np.asarray(np.linalg.norm(A, ord=2, axis=(1, 2)) ** 2 / outcome.variance * selection.gain_factors(poles))


def significant_peaks(poles: ComplexArray, ratio: RealArray) -> Array:
    """Return which new poles remain, (n,): the significant ones, and of several that share a peak the strongest.

    Poles that share a peak divide its gain, so that none may be significant until the others are removed.

    `poles` (n,). `ratio` (n,): as in `Recount.relative_gains`.
    """
    near = overlap(poles, poles)
    rank = np.argsort(np.argsort(ratio, kind="stable"), kind="stable")
    first = np.all(~near | (rank[:, None] >= rank), axis=1)
    return np.asarray((ratio > 1) | (first & (near.sum(axis=1) > 1)))


def _with_peaks(state: State, examined: ComplexArray) -> tuple[tuple[ComplexArray, ComplexArray], ComplexArray]:
    """Return poles and sides with the strongest peaks of the residual added, and the poles of these peaks.

    `examined`: poles near which no peak is taken, those of earlier rounds.
    """
    point, problem = state.descent.point, state.selection.problem
    known = np.concatenate([state.poles, examined])
    errors = residual(point, state.descent.fitted)
    least = _UNREFINED_FRACTION * state.selection.bar * state.variance
    peaks = strongest_peaks(problem.light, errors, problem.rows, known, least, _PEAKS_PER_ROUND)
    poles = np.array([peak.pole for peak in peaks], dtype=complex)
    sides = np.array([peak.participation for peak in peaks], dtype=complex).reshape(-1, point.sides.shape[1])
    return (np.append(state.poles, poles), np.vstack([state.sides, sides])), poles


def _split_where_needed(state: State) -> State:
    """Replace one pole by two, one to either side in frequency, if that lowers the squared misfit by more than noise may.

    If one pole is fitted to two of the same shape, the residual is of second order in their distance and shows no peak.
    """
    least = state.selection.bar * state.variance
    for pole in state.poles[np.argsort(-state.gain, kind="stable")]:
        j = int(np.argmin(np.abs(state.poles - pole)))
        distance, cost = -1j * _SPLIT_HALF_BANDWIDTHS * state.poles[j].real, state.descent.cost
        poles, sides = np.append(state.poles, state.poles[j] - distance), np.vstack([state.sides, state.sides[[j]]])
        poles[j] += distance
        point = state.selection.problem.at(poles, sides, slopes=False)
        if state.gain[j] < state.selection.bar or cost - point.cost(point.fitted()) < _UNREFINED_FRACTION * least:
            continue
        other = _refine(state.selection, poles, sides, _TRIAL, cost - least)
        if other.cost < cost - least:
            state = converged(state.selection, state.variance, other.point.poles, other.point.sides)
            least = state.selection.bar * state.variance
    return state


def _without_redundant(state: State) -> State:
    """Remove weak poles, and the weaker of two that overlap, if the others refined without it fit as well."""
    confirmed: set[complex] = set()
    while True:
        doubtful = [j for j in _doubtful(state) if complex(state.poles[j]) not in confirmed]
        if not doubtful:
            return state
        j = doubtful[0]
        factor = float(state.selection.gain_factors(state.poles[[j]])[0])
        limit = state.descent.cost + state.selection.bar * state.variance / factor
        other = _refine(state.selection, *state.without(j), _TRIAL, limit)
        if other.cost < limit:
            state = converged(state.selection, state.variance, other.point.poles, other.point.sides)
        else:
            confirmed.add(complex(state.poles[j]))


def _above_channel_noise(state: State) -> State:
    """Remove poles that are not significant when the noise of their channels is larger than the noise levels assume."""
    while True:
        above = state.gain >= state.selection.bar * channel_noise_factors(state)
        if np.all(above):
            return state
        state = converged(state.selection, state.variance, state.poles[above], state.sides[above])


def _doubtful(state: State) -> list[int]:
    """Return the weak modes, and the weaker mode of every pair that overlaps, the weakest first.

    In coloured errors two poles with one shape and participation are no such pair: several poles may describe one resonance that shifts.
    """
    w, half, gain = state.poles.imag, -state.poles.real, state.gain
    near = np.abs(w[:, None] - w) < half[:, None] + half
    if state.selection.coloured:
        near &= ~collinear(state.poles, *state.residues)
    weaker = np.any(near & (gain[:, None] < gain), axis=1)
    return [int(j) for j in np.argsort(gain) if weaker[j] or gain[j] < _WEAK_MULTIPLE * state.selection.bar]


def _finished(state: State) -> Outcome:
    """Refine to convergence, and compute the standard deviations of every mode."""
    descent, coloured = state.descent, state.selection.coloured
    if not coloured:
        descent = _refine(state.selection, state.poles, state.sides, _FINAL)
    of_fit = variance_of_fit(state.selection, descent)
    state = replace(state, descent=descent, variance=state.variance if coloured else min(state.variance, of_fit))
    point: Point = descent.point
    n, p = point.sides.shape
    noise = max(state.variance, of_fit)
    covariance = noise * inverse(normal(point, descent.fitted)[0]) if n else np.zeros((0, 0))
    f, zeta = deviations_of_poles(point.poles, pole_blocks(covariance, 2 * p * np.arange(n)))
    return Outcome(descent, state.variance, state.gain, f, zeta, noise)
