"""Poles that contend for the data: refined together, pruned by what each explains, completed by what stands out of the residual.

What a mode explains, its gain, is the rise of the squared misfit when it goes and the others are fitted again, in variances of the
noise. The bar it has to pass counts its free shape and participation and the search for the best place: `search_bound`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.identification.descent import Descent, descend
from modalscope.identification.information import inverse, normal, residual
from modalscope.identification.likelihood import Fitted, Point, Whitened
from modalscope.identification.matched import amplitudes, strongest_peaks
from modalscope.identification.whitening import colour
from modalscope.judging.likeness import collinear
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import frequencies_and_damping
from modalscope.uncertainty.covariance import deviations_of_poles, pole_blocks

__all__ = ["Arena", "Outcome", "contest", "gains_beside"]

#: No pole so far outside the band (part of its edge) or so much damped is a mode: it makes up for something else.
_OUTSIDE, _DAMPED = 0.1, 0.9

#: In data that may not be white every round leaves at most this part of what exceeds white noise; of so many values, where a round is
#: dear, that is asked of the peaks before they are refined with the others.
_WHITER, _LARGE = 0.7, 20_000

#: Rounds of looking for what is missing, and poles taken up in each.
_ROUNDS, _PEAKS = 8, 6


@dataclass(frozen=True, eq=False, slots=True)
class Arena:
    """The data, and what a mode has to pass.

    Parameters
    ----------
    problem : Whitened
        Data divided by the noise of rows and channels.
    variance : float
        Of what is left of them by a richer model.
    bar : float
        What noise may explain, in variances.
    band : (float, float)
        Hz.
    brief : bool
        Whether poles are refined roughly.
    coloured : bool
        Whether what is left of the data is more than noise: then nothing is looked for in it, collinear neighbours are not taken for two
        modes of which one may be noise, and the variance stays what it is.
    """

    problem: Whitened
    variance: float
    bar: float
    band: tuple[float, float]
    brief: bool = False
    coloured: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """The poles that stayed, as the data have them.

    Parameters
    ----------
    descent : Descent
    variance : float
        Of the noise.
    gain : array, (n,)
        In variances.
    frequency_std, damping_std : array, (n,)
        Hz, ratio: from the information of the data.
    """

    descent: Descent
    variance: float
    gain: RealArray
    frequency_std: RealArray
    damping_std: RealArray

    @property
    def poles(self) -> ComplexArray:
        """rad/s."""
        return self.descent.point.poles

    @property
    def residues(self) -> tuple[ComplexArray, ComplexArray]:
        """Shapes (l, n) and participation (n, m)."""
        return self.descent.point.problem.scaled_back(self.descent.point, self.descent.fitted)


@dataclass(frozen=True, eq=False, slots=True)
class _State:
    """Where a contest stands: the optimum so far, and the noise as it is known by now."""

    arena: Arena
    descent: Descent
    variance: float

    @property
    def poles(self) -> ComplexArray:
        return self.descent.point.poles

    @property
    def sides(self) -> ComplexArray:
        return self.descent.point.sides

    @property
    def residues(self) -> tuple[ComplexArray, ComplexArray]:
        return self.descent.point.problem.scaled_back(self.descent.point, self.descent.fitted)

    @property
    def gain(self) -> RealArray:
        return self.descent.fitted.gain / self.variance

    def without(self, gone: int) -> tuple[ComplexArray, ComplexArray]:
        return np.delete(self.poles, gone), np.delete(self.sides, gone, axis=0)


def contest(arena: Arena, poles: ComplexArray, sides: ComplexArray, *, doubted: bool = False) -> Outcome | None:
    """Return the poles that hold their own, from candidates on.

    Parameters
    ----------
    arena : Arena
    poles : array of complex, (n,)
        rad/s, as they are in the data.
    sides : array of complex, (n, p)
        Participation of the side that varies, divided as the data are.
    doubted : bool
        Whether it is in doubt that the data are white: None when what is left does not become white, or much whiter round by round.
    """
    size = np.maximum(np.linalg.norm(sides, axis=1, keepdims=True), 1e-300)
    point = arena.problem.at(poles, sides / size, slopes=False)
    kept = _standing(point.fitted(), arena.bar / 2 * arena.variance)
    state = _settled(arena, arena.variance, poles[kept], (sides / size)[kept])
    if not arena.coloured:
        completed = _completed(state, _excess(state) if doubted else None)
        if completed is None:
            return None
        state = completed
    return _judged(_one_or_two(state))


def _completed(state: _State, excess: float | None) -> _State | None:
    """Take up the strongest peaks of the residual, round by round, while they stay; give up where it is to become white and does not."""
    tried = state.poles
    for _ in range(_ROUNDS):
        more, named = _with_peaks(state, tried)
        if not len(named):
            break
        large = state.arena.problem.freedom > _LARGE
        if excess is not None and large and _excess(state, named) > max(1.0, _WHITER * excess):
            return None
        before = len(state.poles)
        state = _settled(state.arena, state.variance, *more)
        tried = np.concatenate([tried, named, state.poles])
        if excess is not None:
            left = _excess(state)
            if left > max(1.0, _WHITER * excess):
                return None
            excess = left if left > 1 else None
        if len(state.poles) <= before:
            break
    return state if excess is None or excess <= 1 else None


def _excess(state: _State, more: ComplexArray | tuple[()] = ()) -> float:
    """Return how far what is left exceeds what white noise may do, white up to 1: also without what more poles can explain of it."""
    point = state.descent.point
    left = residual(point, state.descent.fitted)
    if len(more):
        Q = np.linalg.qr(point.problem.columns(np.asarray(more), slopes=False)[0])[0]
        flat = left.reshape(len(left), -1)
        left = (flat - Q @ (Q.T @ flat)).reshape(left.shape)
    unknown = point.problem.terms.shape[1] + 2 * (len(state.poles) + len(more))
    return colour(left, point.problem.light.count, unknown).excess


def gains_beside(arena: Arena, found: Outcome, poles: Array) -> RealArray:
    """Return what poles (n,) would explain of the residual, in variances, each alone with its best shape and participation."""
    left = residual(found.descent.point, found.descent.fitted)
    A = amplitudes(arena.problem.light, left, arena.problem.rows, poles)
    return np.asarray(np.linalg.norm(A, ord=2, axis=(1, 2)) ** 2 / found.variance)


def _settled(arena: Arena, variance: float, poles: ComplexArray, sides: ComplexArray) -> _State:
    """Refine jointly, throw out what is no mode, prune at the bar, and again until nothing goes."""
    while True:
        tolerance, most = (1e-5, 8) if arena.brief else (1e-7, 25)
        descent = descend(arena.problem, poles, sides, tolerance=tolerance, most=most)
        state = _State(arena, descent, variance if arena.coloured else min(variance, _own_variance(arena, descent)))
        fit = np.flatnonzero(_possible(arena, state.poles))
        poles, sides = state.poles[fit], state.sides[fit]
        if len(fit) == len(state.poles):
            kept = _standing(descent.fitted, arena.bar * state.variance)
            if len(kept) == len(poles):
                return state
            poles, sides = poles[kept], sides[kept]
        variance = state.variance


def _own_variance(arena: Arena, descent: Descent) -> float:
    """Return what the model itself leaves of a row: less than the richer model does where that lacked a mode."""
    q, p = arena.problem.data.shape[1:]
    return descent.cost / max(arena.problem.freedom - 2 * len(descent.point.poles) * int(q + p), 1)


def _possible(arena: Arena, poles: ComplexArray) -> Array:
    low, high = arena.band
    f, zeta = frequencies_and_damping(poles)
    return np.asarray((f > low * (1 - _OUTSIDE)) & (f < high * (1 + _OUTSIDE)) & (zeta < _DAMPED))


def _standing(fitted: Fitted, least: float) -> Array:
    """Return which modes stay when the weakest goes, one after the other, while it explains less than `least`.

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
        weakest = int(np.argmin(gain))
        if gain[weakest] >= least:
            break
        block = pairs[weakest]
        carried = S[:, block] @ own[weakest]
        rest = np.delete(np.arange(len(S)), block)
        c, S = (c - carried @ c[block])[rest], (S - carried @ S[block])[np.ix_(rest, rest)]
        kept = np.delete(kept, weakest)
    return kept


def _with_peaks(state: _State, tried: ComplexArray) -> tuple[tuple[ComplexArray, ComplexArray], ComplexArray]:
    """Return poles and sides with the strongest peaks of the residual, and these alone."""
    point, problem = state.descent.point, state.arena.problem
    known = np.concatenate([state.poles, tried])
    left = residual(point, state.descent.fitted)
    least = state.arena.bar / 2 * state.variance
    peaks = strongest_peaks(problem.light, left, problem.rows, known, least, _PEAKS)
    named = np.array([peak.pole for peak in peaks], dtype=complex)
    sides = np.array([peak.participation for peak in peaks], dtype=complex).reshape(-1, point.sides.shape[1])
    return (np.append(state.poles, named), np.vstack([state.sides, sides])), named


def _one_or_two(state: _State) -> _State:
    """Take out what the others make up for when they are refined without it: of two that overlap the weaker, and all that are weak."""
    cleared: set[complex] = set()
    while True:
        doubtful = [j for j in _doubtful(state) if complex(state.poles[j]) not in cleared]
        if not doubtful:
            return state
        j = doubtful[0]
        least = state.descent.cost + state.arena.bar * state.variance
        other = descend(state.arena.problem, *state.without(j), tolerance=1e-5, most=12, decisive=least)
        if other.cost < least:
            state = _settled(state.arena, state.variance, other.point.poles, other.point.sides)
        else:
            cleared.add(complex(state.poles[j]))


def _doubtful(state: _State) -> list[int]:
    """Return the weak modes and the weaker one of every pair that overlaps, the weakest first; parts of a mode are in no doubt."""
    w, half, gain = state.poles.imag, -state.poles.real, state.gain
    near = np.abs(w[:, None] - w) < half[:, None] + half
    if state.arena.coloured:
        near &= ~collinear(state.poles, *state.residues)
    weaker = np.any(near & (gain[:, None] < gain), axis=1)
    return [int(j) for j in np.argsort(gain) if weaker[j] or gain[j] < 2 * state.arena.bar]


def _judged(state: _State) -> Outcome:
    """Refine to the end and give every mode its deviations."""
    descent, coloured = state.descent, state.arena.coloured
    if not coloured:
        descent = descend(state.arena.problem, state.poles, state.sides, tolerance=1e-9, most=40)
    own = _own_variance(state.arena, descent)
    state = replace(state, descent=descent, variance=state.variance if coloured else min(state.variance, own))
    point: Point = descent.point
    n, p = point.sides.shape
    covariance = max(state.variance, own) * inverse(normal(point, descent.fitted)[0]) if n else np.zeros((0, 0))
    f, zeta = deviations_of_poles(point.poles, pole_blocks(covariance, 2 * p * np.arange(n)))
    return Outcome(descent, state.variance, state.gain, f, zeta)
