"""Poles that contend, where they stand: refined together, and pruned by what each explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.identification.descent import Descent, descend
from modalscope.identification.likelihood import Fitted
from modalscope.judging.arena import Arena
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import frequencies_and_damping

__all__ = ["Optimum", "State", "noise_beneath", "own_variance", "settled", "standing"]

#: No pole so far outside the band (part of its edge) or so much damped is a mode: it makes up for something else.
_OUTSIDE, _DAMPED = 0.1, 0.9


@dataclass(frozen=True, eq=False, slots=True)
class Optimum:
    """Where a descent has come to, and the noise as it is known by then."""

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
    """Where a contest stands: the optimum so far, and what it is held against."""

    arena: Arena

    @property
    def sides(self) -> ComplexArray:
        """Unit vectors of the side that varies, (n, p)."""
        return self.descent.point.sides

    @property
    def gain(self) -> RealArray:
        """What each pole explains, in variances."""
        return self.descent.fitted.gain / self.variance * self.arena.worth(self.poles)

    def without(self, gone: int) -> tuple[ComplexArray, ComplexArray]:
        """Return poles and sides of the others."""
        return np.delete(self.poles, gone), np.delete(self.sides, gone, axis=0)


def settled(arena: Arena, variance: float, poles: ComplexArray, sides: ComplexArray) -> State:
    """Refine jointly, throw out what is no mode, prune at the bar, and again until nothing goes."""
    while True:
        tolerance, most = (1e-5, 8) if arena.brief else (1e-7, 25)
        descent = descend(arena.problem, poles, sides, tolerance=tolerance, most=most)
        state = State(descent, variance if arena.coloured else min(variance, own_variance(arena, descent)), arena)
        fit = np.flatnonzero(_possible(arena, state.poles))
        poles, sides = state.poles[fit], state.sides[fit]
        if len(fit) == len(state.poles):
            kept = standing(descent.fitted, arena.bar * state.variance / arena.worth(poles))
            if len(kept) == len(poles):
                return state
            poles, sides = poles[kept], sides[kept]
        variance = state.variance


def own_variance(arena: Arena, descent: Descent) -> float:
    """Return what the model itself leaves of a row: less than the richer model does where that lacked a mode."""
    q, p = arena.problem.data.shape[1:]
    return descent.cost / max(arena.problem.freedom - 2 * len(descent.point.poles) * int(q + p), 1)


def noise_beneath(state: State) -> RealArray:
    """Return the noise in the channels that each pole rests on, over that by which they were divided, no less than one, (n,).

    Data are divided by an output's and an input's part of the noise. Where that of a channel is no such product the amplitude u* A v of a
    pole, A that of all channels, u and v the directions of its shape and participation, has the variance sum |u_o|^2 |v_i|^2 s_oi, s what
    is left of each channel in variances.
    """
    point, fitted = state.descent.point, state.descent.fitted
    left = point.left_by_channel(fitted)
    by_channel = (left.T if point.problem.turned else left) * left.size / (state.arena.problem.freedom * state.variance)
    u, v = np.abs(fitted.linear) ** 2, np.abs(point.sides) ** 2
    seen = np.einsum("qn,np,qp->n", u, v, by_channel) / np.maximum(u.sum(axis=0) * v.sum(axis=1), 1e-300)
    return np.asarray(np.maximum(seen, 1.0))


def _possible(arena: Arena, poles: ComplexArray) -> Array:
    low, high = arena.band
    f, zeta = frequencies_and_damping(poles)
    return np.asarray((f > low * (1 - _OUTSIDE)) & (f < high * (1 + _OUTSIDE)) & (zeta < _DAMPED))


def standing(fitted: Fitted, least: RealArray) -> Array:
    """Return which modes stay when the weakest goes, one after the other, while it explains less than its `least`, (n,).

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
