"""Regress records on their past for an observer, and choose its order and rank by cross-validation.

Dependent outputs, inputs without power in part of the band and high orders make regressors nearly dependent, and an observer fitted to
noise need not be stable. Only the first `rank` singular directions of the regressors are used. Rank and order are those that predict best
the parts of the records to which they were not fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.orthonormal import factor_of_gram, gram_of, triangle_of

#: Singular values of the regressors below this part of the largest are rounding (some hundred times that of double precision); the
#: minimum-norm solution excludes their directions.
RANK = 1e-13

#: Least singular value of regressors over the largest of which the eigenvalues of the Gram matrix tell the directions: its square is known
#: to 2e-6, eps over its part of the largest, enough to compare ranks.
_MIN_SINGULAR_VALUE = 1e-5

#: Root mean square of residuals, relative to that of the outputs, below which a fit is exact to rounding.
_EXACT_RESIDUAL = 1e-11

#: Number of parts of each run; each part is predicted from the others (cross-validation).
_PARTS = 4

#: Maximum number of ranks that are tried, evenly on a logarithmic scale: a step of 11 % for 600 regressors.
_MAX_RANKS = 60

#: Relative remainder of every column at which one Gram matrix gives the triangular factor, which is then known to 1e-16 over its square.
_MIN_REMAINDER = 1e-3

#: Maximum number of rows of the regression that are factored at a time, which bounds the memory.
_MAX_ROWS = 4096

#: The largest order that is tried by default is 60, or that of 600 regressors, (outputs + inputs) times order, if this is lower, but at
#: least 10. The numbers bound the time.
_MAX_ORDER, _MAX_REGRESSORS, _MIN_MAX_ORDER = 60, 600, 10

#: Orders up to this one are all tried; after it each is larger than the one before by about a quarter, 4.5 orders for a factor e.
_CONSECUTIVE_ORDERS, _ORDERS_PER_E_FOLD = 12, 4.5


class Regression(NamedTuple):
    """Triangular factors of [u(k), u(k-1), y(k-1), ..., u(k-p), y(k-p), y(k)].

    The regressors of an order come before those of the next, so that its factor is a leading block.

    `whole`: over all times k. `parts`: over each part. `others`: over all but each part. `outputs`, `inputs`: numbers of channels.
    `rows`: number of times, of all runs.
    """

    whole: RealArray
    parts: list[RealArray]
    others: list[RealArray]
    outputs: int
    inputs: int
    rows: int

    def unknowns(self, order: int) -> int:
        """Return the number of coefficients of an output at an order."""
        return self.inputs + order * (self.inputs + self.outputs)

    def mean_log_share(self, errors: RealArray) -> RealArray:
        """Return the mean over the outputs of log(errors / power), (...), for sums of squared errors (..., l).

        Errors below rounding count as rounding, so that the logarithm of an exact fit is finite.
        """
        power = np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        relative = np.maximum(errors / np.where(power > 0, power, 1.0), _EXACT_RESIDUAL**2)
        return np.asarray(np.mean(np.log(relative), axis=-1))

    def fit(self, unknowns: int, rank: int | None = None) -> tuple[RealArray, int, RealArray]:
        """Return the minimum-norm solution (unknowns, l) in the first `rank` directions, the rank, and the residuals' Gram matrix (l, l).

        By default all directions above rounding are used.
        """
        R, Y = self.whole[:, :unknowns], self.whole[:, -self.outputs :]
        coefficients, Vt = _directions(R, Y)
        used = len(coefficients) if rank is None else min(rank, len(coefficients))
        solution = Vt[:used].T @ coefficients[:used]
        residual = Y - R @ solution
        return solution, used, residual.T @ residual

    def is_exact(self, unknowns: int) -> bool:
        """Return whether the first regressors fit the outputs to rounding with more equations than directions, as they never fit noise."""
        limit = _EXACT_RESIDUAL**2 * np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        least = np.sum(self.whole[unknowns:, -self.outputs :] ** 2, axis=0)  # residual of the unrestricted fit
        if not limit.any() or np.any(least > limit):
            return False
        _, rank, residual = self.fit(unknowns)
        return rank < self.rows and bool(np.all(np.diag(residual) <= limit))

    def errors(self, unknowns: int, ranks: IntArray) -> RealArray:
        """Return the sums of squared errors (ranks, l) of predicting each part from the others, for increasing ranks."""
        errors = np.zeros((ranks.size, self.outputs))
        for part, R in zip(self.parts, self.others, strict=True):
            coefficients, Vt = _quick_directions(R[:, :unknowns], R[:, -self.outputs :])
            rows = part[:unknowns]  # those below depend on no regressor
            rotated = rows[:, :unknowns] @ Vt.T
            errors += np.sum(part[unknowns:, -self.outputs :] ** 2, axis=0)
            ends = [0, *np.minimum(ranks, len(coefficients)).tolist()]
            # what the directions from one rank to the next predict
            steps = np.empty((ranks.size, len(rows), self.outputs))
            for step, (start, end) in zip(steps, pairwise(ends), strict=True):
                np.matmul(rotated[:, start:end], coefficients[start:end], out=step)
            residuals = np.cumsum(steps, axis=0, out=steps)
            residuals -= rows[:, -self.outputs :]
            errors += np.einsum("rkl,rkl->rl", residuals, residuals)
        return errors

    def cross_validated(self, unknowns: int) -> tuple[int, float]:
        """Return the rank that predicts the parts best, each from the others, and the mean logarithm of its errors' share of the power."""
        ranks = np.unique(np.geomspace(1, unknowns, _MAX_RANKS).astype(int))
        criterion = self.mean_log_share(self.errors(unknowns, ranks))
        best = int(np.argmin(criterion))
        return int(ranks[best]), float(criterion[best])


def _directions(R: RealArray, Y: RealArray) -> tuple[RealArray, RealArray]:
    """Return d^-1 U'Y and V' of R = U d V', without the directions that are rounding; R is triangular, rows below the square are zero."""
    U, d, Vt = sla.svd(R[: R.shape[1]], full_matrices=False, check_finite=False)
    rank = int(np.count_nonzero(d > RANK * d[0]))
    return (U[:, :rank].T @ Y[: R.shape[1]]) / d[:rank, None], Vt[:rank]


def _quick_directions(R: RealArray, Y: RealArray) -> tuple[RealArray, RealArray]:
    """Return what `_directions` does, from the eigenvectors of R'R in half the time where the weakest direction allows that."""
    square = R[: R.shape[1]]
    pivots = np.abs(np.diag(square))  # the least singular value is no larger than any of them
    if len(square) < R.shape[1] or not pivots.min() > _MIN_SINGULAR_VALUE * pivots.max():
        return _directions(R, Y)
    squares, vectors = np.linalg.eigh(square.T @ square)
    if not squares[0] > _MIN_SINGULAR_VALUE**2 * squares[-1]:
        return _directions(R, Y)
    V = np.ascontiguousarray(vectors[:, ::-1])
    return (V.T @ (square.T @ Y[: R.shape[1]])) / squares[::-1, None], V.T


def regression(outputs: RealArray, inputs: RealArray, order: int) -> Regression:
    """Return the regression of outputs (R, N, l) on inputs (R, N, m) and on the `order` past samples of both, of R runs."""
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    columns = (m + l) * (order + 1)
    rows = [
        partial(_rows, outputs, inputs, order, int(times[0]), int(times[-1]) + 1) if times.size else list
        for times in np.array_split(np.arange(order, samples), _PARTS)
    ]
    grams = [gram_of(part(), columns) for part in rows]
    parts = [_triangle(gram, columns, part) for gram, part in zip(grams, rows, strict=True)]

    def joined(some: list[int]) -> RealArray:
        return _triangle(np.sum([grams[k] for k in some], axis=0), columns, lambda: (parts[k] for k in some))

    others = [joined([k for k in range(_PARTS) if k != left_out]) for left_out in range(_PARTS)]
    return Regression(joined(list(range(_PARTS))), parts, others, l, m, runs * (samples - order))


def _triangle(gram: RealArray, columns: int, rows: Callable[[], Iterable[RealArray]]) -> RealArray:
    """Return the triangular factor of rows from their Gram matrix, its upper triangle, or from themselves where that is not accurate."""
    R = factor_of_gram(gram, least=_MIN_REMAINDER)
    return triangle_of(lambda: iter(rows()), columns, _MIN_REMAINDER) if R is None else R


def _rows(outputs: RealArray, inputs: RealArray, order: int, start: int, end: int) -> Iterator[RealArray]:
    """Yield the regressors and outputs at the times from start to end of all runs, as many as are factored together."""
    for y, u in zip(outputs, inputs, strict=True):
        for first in range(start, end, _MAX_ROWS):
            last = min(first + _MAX_ROWS, end)
            past = [side[first - i : last - i] for i in range(1, order + 1) for side in (u, y)]
            yield np.concatenate([u[first:last], *past, y[first:last]], axis=1)


class TriedOrders(NamedTuple):
    """The regression, the orders that were tried, the rank of each, and the criterion that the best order minimizes."""

    regression: Regression
    orders: IntArray
    ranks: IntArray
    criterion: RealArray

    def best_first(self) -> Iterator[tuple[int, int]]:
        """Yield order and rank, the best first."""
        for i in np.argsort(self.criterion, kind="stable"):
            yield int(self.orders[i]), int(self.ranks[i])


def tried_orders(outputs: RealArray, inputs: RealArray, given: int | None) -> TriedOrders:
    """Try the orders, or the one that is `given` alone, on outputs (R, N, l) and inputs (R, N, m) of unit scale.

    An order that fits to rounding ends the search; it may have more unknowns than equations, since the rank counts. If none does, the
    orders with more equations than unknowns are compared by cross-validation.

    Raises
    ------
    DataError
        No order fits to rounding, and every order has more unknowns than equations.
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    limit = min(max(_MAX_REGRESSORS // (l + m), _MIN_MAX_ORDER), _MAX_ORDER)
    top = given or max(min(limit, samples // 2), 1)
    max_determined = max((runs * samples - m - l) // (l + m + runs), 0)  # orders with more equations than unknowns
    determined = min(top, max_determined) if given is None or given <= max_determined else 0
    smallest = None  # the regression without the orders that only an exact record determines
    for largest in sorted({determined, top} - {0}):
        if largest >= samples:
            break
        candidate = regression(outputs, inputs, largest)
        orders = _orders_to_try(largest, given)
        for i, p in enumerate(orders):
            if candidate.is_exact(candidate.unknowns(p)):
                return _exact(candidate, orders[: i + 1])
        smallest = smallest or candidate
    if not determined or smallest is None:
        order = given or 1
        asked = f"an observer of order {order} for {l} outputs and {m} inputs:"
        equations = max(runs * (samples - order), 0)
        have = f"it has {m + order * (l + m)} unknowns per output, and the record gives {equations} equations"
        raise DataError(asked, have, "Lower observer_order, or measure longer.")
    orders = _orders_to_try(determined, given)
    ranks, errors = zip(*(smallest.cross_validated(smallest.unknowns(p)) for p in orders), strict=True)
    return TriedOrders(smallest, orders, np.array(ranks), np.array(errors))


def _orders_to_try(largest: int, given: int | None) -> IntArray:
    """Return the orders to try up to the largest one, or the given one alone."""
    if given is not None:
        return np.array([given])
    first = _CONSECUTIVE_ORDERS
    count = max(1, round(_ORDERS_PER_E_FOLD * np.log(max(largest / first, 1))))
    steps = np.geomspace(first, max(largest, first), count + 1)
    orders = np.unique([*range(1, first + 1), *steps.astype(int), largest])
    return np.asarray(orders[orders <= largest])


def _exact(regression: Regression, orders: IntArray) -> TriedOrders:
    """Return the orders up to the first that fits to rounding, with the share of their residuals as the criterion.

    The last order, which fits, comes first and has the least criterion, so that it is the best also among equals.
    """
    _, ranks, residuals = zip(*(regression.fit(regression.unknowns(p)) for p in orders), strict=True)
    criterion = np.array([regression.mean_log_share(np.diag(residual)) for residual in residuals])
    criterion[-1] = criterion.min()
    return TriedOrders(regression, orders[::-1], np.array(ranks)[::-1], criterion[::-1])
