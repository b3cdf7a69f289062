"""Maximize the likelihood over poles and participation by Levenberg-Marquardt steps.

The damping follows the ratio of actual to predicted reduction of the misfit.

Source: H. B. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05, Technical University of Denmark.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from scipy.linalg.lapack import dpotrf

from modalscope.numerics.checks import Array, BoolArray, ComplexArray, IntArray, RealArray
from modalscope.selection.likelihood.information import ROUNDING_OF_PRODUCTS, normal
from modalscope.selection.likelihood.likelihood import Fitted, Point, Whitened

#: Maximum step of a pole relative to its distance to the axes: beyond it the linear model may be wrong.
_MAX_STEP = 0.9

#: Maximum move of a pole in decay rates: an optimum beyond it is that of another mode.
_MAX_MOVE = 1.0

#: Relative residual at rounding.
_ROUNDING = 1e-14

#: A decisive misfit further away than this many predicted reductions is out of reach.
_MAX_PROMISES = 300.0

#: Minimum pivot of the unit columns of J for normal equations.
_MIN_PIVOT = 1e-4

#: Levenberg-Marquardt damping: initial, least and largest value; least factor after a good step, and first factor after a failed one
#: (Nielsen 1999).
_INITIAL_DAMPING, _MIN_DAMPING, _MAX_DAMPING = 1e-3, 1e-15, 1e10
_MIN_DECREASE, _INCREASE = 1 / 3, 2.0


@dataclass(frozen=True, eq=False, slots=True)
class Descent:
    """The end of a descent.

    `cost`: squared misfit. `why`: why it did not converge. `kept` (n,): which of the poles at the start it ends with.
    """

    point: Point
    fitted: Fitted
    cost: float
    converged: bool
    why: str
    iterations: int
    kept: IntArray


def astray(before: ComplexArray, after: ComplexArray) -> BoolArray:
    """Return which poles moved by more than their decay rate: the optimum that they reached is that of others."""
    return np.asarray(np.abs(after - before) > _MAX_MOVE * np.abs(before.real))


class Astray(Exception):
    """Poles are on their way to the optimum of others. `homes` (k,): where they belong."""

    def __init__(self, homes: ComplexArray) -> None:
        super().__init__(homes)
        self.homes = homes


def descend(problem: Whitened, poles: ComplexArray, sides: ComplexArray, **limits: Any) -> Descent:
    """Lower the squared misfit from poles (n,) and unit vectors (n, p) on; `limits`: see `descend_from`."""
    return descend_from(problem.at(poles, sides), **limits)


def descend_from(
    point: Point,
    *,
    tolerance: float = 1e-12,
    most: int = 60,
    decisive: float | None = None,
    stays: Callable[[ComplexArray], Array] | None = None,
    home: ComplexArray | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Descent:
    """Lower the squared misfit from a point on until no step promises more than `tolerance` of it.

    The predicted reduction counts: near the optimum rounding hides the actual one.

    `most`: iterations. `decisive`: the descent ends below this squared misfit, and
    where it is out of reach. `stays`: returns which of some poles (n,) may remain. It is asked after every step: a pole on its way to the
    real axis or to no width promises long steps for ever, and what it leaves undetermined spoils the covariance of all. The descent
    goes on without it, with the damping of the start. `home` (n,): where the poles belong; `Astray` is raised as soon as
    a pole has left. `progress`: called with (iterations done, iterations at most).
    """
    problem, fitted = point.problem, point.fitted()
    cost, size = point.cost(fitted), problem.size
    damping, kept = _INITIAL_DAMPING, np.arange(len(point.poles))
    for iteration in range(most):
        if progress is not None:
            progress(iteration, most)
        step = _Step(*normal(point, fitted))
        decided = decisive is not None and not decisive <= cost <= decisive + _MAX_PROMISES * step.promised
        if decided or step.promised <= tolerance * cost or cost <= _ROUNDING**2 * size:
            return Descent(point, fitted, cost, True, "", iteration, kept)
        more = _INCREASE
        while True:
            moved = _held(step.damped(damping), point, problem.light.sampling_rate)
            trial = problem.at(*point.moved(moved))
            found = trial.fitted()
            lower = trial.cost(found)
            if lower < cost:
                damping = max(damping * _lessening(cost - lower, step.fall(moved)), _MIN_DAMPING)
                point, fitted, cost = trial, found, lower
                break
            damping, more = damping * more, more * _INCREASE
            if damping > _MAX_DAMPING:
                steep = step.promised > 1e-8 * cost
                why = "no step lowers the misfit" if steep else ""
                return Descent(point, fitted, cost, not steep, why, iteration, kept)
        if home is not None and np.any(away := astray(home, point.poles)):
            raise Astray(home[away])
        remain = None if stays is None else stays(point.poles)
        if remain is not None and not np.all(remain):
            point = problem.at(point.poles[remain], point.sides[remain])
            fitted = point.fitted()
            cost, damping, kept = point.cost(fitted), _INITIAL_DAMPING, kept[remain]
    return Descent(point, fitted, cost, False, f"{most} iterations were not enough", most, kept)


class _Step:
    """Solutions of (J'J + damping D) step = J'r, D the diagonal of J'J.

    By a Cholesky factor for each damping; by eigenvalues where columns of J are nearly dependent.
    """

    def __init__(self, information: RealArray, slope: RealArray) -> None:
        self.scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        self.whole, self.slope = information / np.outer(self.scale, self.scale), slope / self.scale
        triangle, failed = dpotrf(self.whole, lower=True)
        self.apart = not failed and bool(np.diag(triangle).min(initial=1.0) > _MIN_PIVOT)
        if self.apart:
            there = sla.solve_triangular(triangle, self.slope, lower=True, check_finite=False)
            self.promised = float(there @ there)
            return
        self.values, self.vectors = np.linalg.eigh(self.whole)
        self.along = self.vectors.T @ self.slope
        known = self.values > ROUNDING_OF_PRODUCTS * max(self.values.max(initial=0.0), 1e-300)
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
    """Return Nielsen's factor of the damping after a step: one at half the predicted reduction, two at none."""
    held = min(fall / promised, 1.0) if promised > 0 else 1.0
    return max(_MIN_DECREASE, 1 - (2 * held - 1) ** 3)


def _held(step: ComplexArray, point: Point, rate: float | None) -> ComplexArray:
    """Shorten the steps of poles to what keeps them apart from the axes and below half the sampling rate, and of b to half a radian."""
    step = step.reshape(point.sides.shape).copy()
    poles = point.poles
    room = np.minimum(-poles.real, poles.imag)
    if rate is not None:
        room = np.minimum(room, np.maximum(np.pi * rate - poles.imag, 1e-3 * room))
    step[:, 0] *= np.minimum(1, _MAX_STEP * room / np.maximum(np.abs(step[:, 0]), 1e-300))
    turned = np.linalg.norm(step[:, 1:], axis=1)
    step[:, 1:] *= np.minimum(1, 0.5 / np.maximum(turned, 1e-300))[:, None]
    return step
