"""Descent to the optimum of the likelihood: Levenberg and Marquardt's steps, held among decaying oscillations.

The damping follows the fall of the misfit over what the linear model promised: where that holds but in part it stays as it is, so that
of a curved valley no other step is a trial in vain.

Source: H. B. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05, Technical University of Denmark.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from scipy.linalg.lapack import dpotrf

from modalscope.identification.information import normal
from modalscope.identification.likelihood import Fitted, Point, Whitened
from modalscope.model.checks import ComplexArray, RealArray

__all__ = ["Descent", "descend"]

#: The model of the misfit's fall may be wrong beyond this part of a decay rate, and no step crosses an axis.
_LONGEST = 0.9

#: Data that are explained to this part are explained to rounding.
_ROUNDING = 1e-14

#: No descent goes further than so many times what its steps promise.
_HOPED = 300.0

#: Columns of J of length one that stand so far out of the span of those before them: their products have digits enough.
_WELL_APART = 1e-4

#: Damping at first, at least and at most; what it falls to where the misfit falls as promised, and how it rises, faster every time.
_FIRST, _LEAST, _MOST = 1e-3, 1e-15, 1e10
_LESS, _MORE = 1 / 3, 2.0


@dataclass(frozen=True, eq=False, slots=True)
class Descent:
    """Where a descent ended.

    Parameters
    ----------
    point : Point
    fitted : Fitted
    cost : float
        Squared misfit.
    converged : bool
    why : str
        Why not.
    iterations : int
    """

    point: Point
    fitted: Fitted
    cost: float
    converged: bool
    why: str
    iterations: int


def descend(
    problem: Whitened,
    poles: ComplexArray,
    sides: ComplexArray,
    *,
    tolerance: float = 1e-12,
    most: int = 60,
    decisive: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Descent:
    """Lower the squared misfit from poles (n,) and unit vectors (n, p) on until no step promises more than `tolerance` of it.

    What is promised counts, not what was gained: near the optimum rounding hides the gain.

    Parameters
    ----------
    problem : Whitened
    poles, sides
        Where to start.
    tolerance : float
    most : int
        Iterations.
    decisive : float, optional
        A squared misfit that decides: the descent ends below it, and where no hundreds of steps like the next would lead there.
    progress : callable, optional
        Called with (iterations done, iterations at most).
    """
    point = problem.at(poles, sides)
    fitted = point.fitted()
    cost, size = point.cost(fitted), float(np.vdot(problem.data, problem.data))
    damping = _FIRST
    for iteration in range(most):
        if progress is not None:
            progress(iteration, most)
        step = _Step(*normal(point, fitted))
        decided = decisive is not None and not decisive <= cost <= decisive + _HOPED * step.promised
        if decided or step.promised <= tolerance * cost or cost <= _ROUNDING**2 * size:
            return Descent(point, fitted, cost, True, "", iteration)
        more = _MORE
        while True:
            moved = _held(step.damped(damping), point, problem.light.sampling_rate)
            trial = problem.at(*point.moved(moved))
            found = trial.fitted()
            lower = trial.cost(found)
            if lower < cost:
                damping = max(damping * _lessening(cost - lower, step.fall(moved)), _LEAST)
                point, fitted, cost = trial, found, lower
                break
            damping, more = damping * more, more * _MORE
            if damping > _MOST:
                steep = step.promised > 1e-8 * cost
                return Descent(point, fitted, cost, not steep, "no step lowers the misfit" if steep else "", iteration)
    return Descent(point, fitted, cost, False, f"{most} iterations were not enough", most)


class _Step:
    """Solutions of (J'J + damping D) step = J'r, D the diagonal of J'J.

    By Cholesky's factor for each damping, a twentieth of the time of the eigenvalues; by these, which serve all, where J has columns near
    the span of the others.
    """

    def __init__(self, information: RealArray, slope: RealArray) -> None:
        self.scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        self.whole, self.slope = information / np.outer(self.scale, self.scale), slope / self.scale
        triangle, failed = dpotrf(self.whole, lower=True)
        self.apart = not failed and bool(np.diag(triangle).min(initial=1.0) > _WELL_APART)
        if self.apart:
            there = sla.solve_triangular(triangle, self.slope, lower=True, check_finite=False)
            self.promised = float(there @ there)
            return
        self.values, self.vectors = np.linalg.eigh(self.whole)
        self.along = self.vectors.T @ self.slope
        known = self.values > 1e-12 * max(self.values.max(initial=0.0), 1e-300)
        self.promised = float(np.sum(self.along[known] ** 2 / self.values[known]))

    def damped(self, damping: float) -> ComplexArray:
        if self.apart:
            stiff = self.whole + damping * np.eye(len(self.whole))
            factor = sla.cho_factor(stiff, lower=True, overwrite_a=True, check_finite=False)
            step = sla.cho_solve(factor, self.slope, check_finite=False) / self.scale
        else:
            step = self.vectors @ (self.along / (np.maximum(self.values, 0) + damping)) / self.scale
        return np.asarray(step[::2] + 1j * step[1::2])

    def fall(self, step: ComplexArray) -> float:
        """Return by how much a step lowers the squared misfit of the linear model."""
        h = np.stack([step.real, step.imag], axis=-1).reshape(-1) * self.scale
        return float(2 * h @ self.slope - h @ self.whole @ h)


def _lessening(fall: float, promised: float) -> float:
    """Return the factor of the damping after a step: one where the misfit has fallen by half of what was promised, two by nothing of it."""
    held = min(fall / promised, 1.0) if promised > 0 else 1.0
    return max(_LESS, 1 - (2 * held - 1) ** 3)


def _held(step: ComplexArray, point: Point, rate: float | None) -> ComplexArray:
    """Shorten the steps of poles to what keeps them apart from the axes and below half the sampling rate, and of b to half a radian."""
    step = step.reshape(point.sides.shape).copy()
    poles = point.poles
    room = np.minimum(-poles.real, poles.imag)
    if rate is not None:
        room = np.minimum(room, np.maximum(np.pi * rate - poles.imag, 1e-3 * room))
    step[:, 0] *= np.minimum(1, _LONGEST * room / np.maximum(np.abs(step[:, 0]), 1e-300))
    turned = np.linalg.norm(step[:, 1:], axis=1)
    step[:, 1:] *= np.minimum(1, 0.5 / np.maximum(turned, 1e-300))[:, None]
    return step
