"""Regress records on their past for an observer, and choose its order and rank by cross-validation.

Dependent outputs, inputs without power in part of the band and long pasts make regressors nearly dependent, and an observer fitted to noise
need not be stable. The first `rank` singular directions of the regressors are kept; rank and order are those that predict best the parts of
the records to which they were not fitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import IntArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.sums import TriangleSum

#: Directions of the regressors below this part of the largest are rounding; the minimum-norm solution excludes them.
RANK = 1e-13

#: Residuals below this part of the outputs are rounding.
_EXACT_RESIDUAL = 1e-11

#: Parts of each run; every one is predicted from the others (cross-validation).
_PARTS = 4

#: Ranks that are tried, about evenly on a logarithmic scale.
_TRIED_RANKS = 60

#: Rows of the regression that are factored at a time.
_MAX_ROWS = 4096

#: Largest order tried by default, regressors up to which orders are tried, and the order that is tried in any case.
_MAX_ORDER, _MAX_REGRESSORS, _MIN_MAX_ORDER = 60, 600, 10

#: Orders up to this one are all tried, longer ones in steps of about a quarter.
_CONSECUTIVE_ORDERS = 12


class Regression(NamedTuple):
    """Triangular factors of [u(k), u(k-1), y(k-1), ..., u(k-p), y(k-p), y(k)]: over all times k, over each part, and over all others.

    The regressors of an order come before those of the next, so that its factor is a leading block.
    """

    whole: RealArray
    parts: list[RealArray]
    others: list[RealArray]
    outputs: int
    inputs: int
    rows: int

    def unknowns(self, order: int) -> int:
        """Return the coefficients of an output at an order."""
        return self.inputs + order * (self.inputs + self.outputs)

    def share(self, errors: RealArray) -> RealArray:
        """Return the mean over the outputs of log(errors / power), errors (..., l) being sums of squares, no smaller than rounding."""
        power = np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        relative = np.maximum(errors / np.where(power > 0, power, 1.0), _EXACT_RESIDUAL**2)
        return np.asarray(np.mean(np.log(relative), axis=-1))

    def fit(self, unknowns: int, rank: int | None = None) -> tuple[RealArray, int, RealArray]:
        """Return the minimum-norm solution (unknowns, l) in the first `rank` directions, the rank, and the residuals' Gram matrix (l, l).

        By default all directions above rounding are taken.
        """
        R, Y = self.whole[:, :unknowns], self.whole[:, -self.outputs :]
        steps, Vt = _directions(R, Y)
        kept = len(steps) if rank is None else min(rank, len(steps))
        solution = Vt[:kept].T @ steps[:kept]
        residual = Y - R @ solution
        return solution, kept, residual.T @ residual

    def is_exact(self, unknowns: int) -> bool:
        """Return whether the first regressors fit the outputs to rounding, with more equations than directions: noise never does."""
        limit = _EXACT_RESIDUAL**2 * np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        least = np.sum(self.whole[unknowns:, -self.outputs :] ** 2, axis=0)  # residual of the unrestricted fit
        if not limit.any() or np.any(least > limit):
            return False
        _, rank, residual = self.fit(unknowns)
        return rank < self.rows and bool(np.all(np.diag(residual) <= limit))

    def errors(self, unknowns: int, ranks: IntArray) -> RealArray:
        """Return the sums of squared errors (ranks, l) of predicting each part from the others."""
        errors = np.zeros((ranks.size, self.outputs))
        for part, R in zip(self.parts, self.others, strict=True):
            steps, Vt = _directions(R[:, :unknowns], R[:, -self.outputs :])
            rotated, residual, last = part[:, :unknowns] @ Vt.T, np.array(part[:, -self.outputs :]), 0
            for i, rank in enumerate(np.minimum(ranks, len(steps))):
                residual -= rotated[:, last:rank] @ steps[last:rank]
                errors[i] += np.sum(residual**2, axis=0)
                last = rank
        return errors

    def cross_validated(self, unknowns: int) -> tuple[int, float]:
        """Return the rank that predicts the parts best, each from the others, and the mean log share of the errors in the power."""
        ranks = np.unique(np.geomspace(1, unknowns, _TRIED_RANKS).astype(int))
        criterion = self.share(self.errors(unknowns, ranks))
        best = int(np.argmin(criterion))
        return int(ranks[best]), float(criterion[best])


def _directions(R: RealArray, Y: RealArray) -> tuple[RealArray, RealArray]:
    """Return d^-1 U'Y and V' of R = U d V', without the directions that are rounding."""
    U, d, Vt = sla.svd(R[: R.shape[1]], full_matrices=False, check_finite=False)
    above = int(np.count_nonzero(d > RANK * d[0]))
    return (U[:, :above].T @ Y[: R.shape[1]]) / d[:above, None], Vt[:above]


def regression(outputs: RealArray, inputs: RealArray, order: int) -> Regression:
    """Return the regression of outputs (R, N, l) on inputs (R, N, m) and the `order` samples of both before."""
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    columns = (m + l) * (order + 1)
    parts = []
    for times in np.array_split(np.arange(order, samples), _PARTS):
        total = TriangleSum(columns)
        for y, u in zip(outputs, inputs, strict=True):
            for first in range(0, times.size, _MAX_ROWS):
                k = times[first : first + _MAX_ROWS]
                past = [side[k - i] for i in range(1, order + 1) for side in (u, y)]
                total.add(np.concatenate([u[k], *past, y[k]], axis=1))
        parts.append(total.finish())
    others = [_joined(columns, parts[:k] + parts[k + 1 :]) for k in range(_PARTS)]
    return Regression(_joined(columns, [parts[0], others[0]]), parts, others, l, m, runs * (samples - order))


def _joined(columns: int, triangles: list[RealArray]) -> RealArray:
    total = TriangleSum(columns)
    for triangle in triangles:
        total.add(triangle)
    return total.finish()


class TriedOrders(NamedTuple):
    """Orders that were tried, the rank of each, and the criterion that the best order minimizes."""

    regression: Regression
    orders: IntArray
    ranks: IntArray
    criterion: RealArray

    def best_first(self) -> Iterator[tuple[int, int]]:
        """Yield order and rank, the best first."""
        for i in np.argsort(self.criterion, kind="stable"):
            yield int(self.orders[i]), int(self.ranks[i])


def tried_orders(outputs: RealArray, inputs: RealArray, given: int | None, longest: int | None) -> TriedOrders:
    """Try all orders up to `longest`, or the given one, on outputs (R, N, l) and inputs (R, N, m) of unit scale.

    Raises DataError when every order has more unknowns than equations.
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    default = min(max(_MAX_REGRESSORS // (l + m), _MIN_MAX_ORDER), _MAX_ORDER)
    most = default if longest is None else check_count("longest", longest)
    top = given or max(min(most, samples // 2), 1)
    max_determined = max((runs * samples - m - l) // (l + m + runs), 0)  # orders with more equations than unknowns
    determined = min(top, max_determined) if given is None or given <= max_determined else 0
    noisy = None
    for largest in sorted({determined, top} - {0}):
        if largest >= samples:
            break
        candidate = regression(outputs, inputs, largest)
        orders = _ladder(largest, given)
        for i, p in enumerate(orders):
            if candidate.is_exact(candidate.unknowns(p)):
                return _exact(candidate, orders[: i + 1])
        noisy = noisy or candidate
    if not determined or noisy is None:
        order = given or 1
        asked = f"an observer of order {order} for {l} outputs and {m} inputs was asked"
        equations = max(runs * (samples - order), 0)
        have = f"it has {m + order * (l + m)} unknowns an output, and the record gives {equations} equations"
        raise DataError(asked, have, "Lower observer_order, or measure longer.")
    orders = _ladder(determined, given)
    ranks, errors = zip(*(noisy.cross_validated(noisy.unknowns(p)) for p in orders), strict=True)
    return TriedOrders(noisy, orders, np.array(ranks), np.array(errors))


def _ladder(largest: int, given: int | None) -> IntArray:
    """Return the orders to try up to the largest one, or the given one."""
    if given is not None:
        return np.array([given])
    first = _CONSECUTIVE_ORDERS
    steps = np.geomspace(first, max(largest, first), max(1, round(4.5 * np.log(max(largest / first, 1)))) + 1)
    orders = np.unique([*range(1, first + 1), *steps.astype(int), largest])
    return np.asarray(orders[orders <= largest])


def _exact(regression: Regression, orders: IntArray) -> TriedOrders:
    """Return the orders up to the first that fits to rounding, which is the best, by their residuals."""
    _, ranks, residuals = zip(*(regression.fit(regression.unknowns(p)) for p in orders), strict=True)
    criterion = np.array([regression.share(np.diag(residual)) for residual in residuals])
    criterion[-1] = criterion.min()
    return TriedOrders(regression, orders[::-1], np.array(ranks)[::-1], criterion[::-1])
