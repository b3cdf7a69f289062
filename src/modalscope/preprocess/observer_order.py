"""Which order an observer has, and how many directions of its regressors: the first that is exact, or what predicts best."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from modalscope.model.checks import DataError, IntArray, RealArray, check_count
from modalscope.preprocess.regression import Regression, regression

__all__ = ["Tried", "tried_orders"]

#: Largest order tried by default, and regressors beyond which orders above `_ALWAYS` are left out: their factors take long.
_LONGEST, _REGRESSORS, _ALWAYS = 60, 600, 10

#: Orders up to this one are all tried, longer ones in steps of about a quarter.
_EVERY = 12


class Tried(NamedTuple):
    """Orders that were tried, the rank of each, and the criterion that the best one minimises."""

    regression: Regression
    orders: IntArray
    ranks: IntArray
    criterion: RealArray

    def best_first(self) -> Iterator[tuple[int, int]]:
        """Yield order and rank, the best first."""
        for i in np.argsort(self.criterion, kind="stable"):
            yield int(self.orders[i]), int(self.ranks[i])


def tried_orders(outputs: RealArray, inputs: RealArray, given: int | None, longest: int | None) -> Tried:
    """Try all orders, or the one that is given.

    Parameters
    ----------
    outputs, inputs : array, (R, N, l) and (R, N, m)
        Of about the same size in all channels.
    given, longest : int, optional
        As in `estimate_observer`.

    Raises
    ------
    DataError
        More unknowns than the record can tell, at every order.
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    most = max(_REGRESSORS // (l + m), _ALWAYS) if longest is None else check_count("longest", longest)
    top = given or max(min(most, _LONGEST if longest is None else most, samples // 2), 1)
    enough = max(
        (runs * samples - m - l) // (l + m + runs), 0
    )  # orders that leave an equation to spare for every output
    determined = min(top, enough) if given is None or given <= enough else 0
    noisy = None
    for largest in sorted({determined, top} - {0}):
        if largest >= samples:
            break
        found = regression(outputs, inputs, largest)
        orders = _ladder(largest, given)
        for i, p in enumerate(orders):
            if found.is_exact(found.unknowns(p)):
                return _exact(found, orders[: i + 1])
        noisy = noisy or found
    if not determined or noisy is None:
        raise _too_short(given or 1, l, m, runs * (samples - (given or 1)))
    orders = _ladder(determined, given)
    held_out = [noisy.held_out(noisy.unknowns(p)) for p in orders]
    return Tried(noisy, orders, np.array([rank for rank, _ in held_out]), np.array([error for _, error in held_out]))


def _ladder(largest: int, given: int | None) -> IntArray:
    """Return the orders to try, the largest among them."""
    if given is not None:
        return np.array([given])
    steps = np.geomspace(_EVERY, max(largest, _EVERY), max(1, round(4.5 * np.log(max(largest / _EVERY, 1)))) + 1)
    orders = np.unique([*range(1, _EVERY + 1), *steps.astype(int), largest])
    return np.asarray(orders[orders <= largest])


def _exact(found: Regression, orders: IntArray) -> Tried:
    """Return orders up to the first that fits to rounding, by what they leave."""
    fits = [found.fit(found.unknowns(p)) for p in orders]
    left = np.array([found.share(np.diag(fit.residual)) for fit in fits])
    left[-1] = min(left[-1], left.min())
    return Tried(found, orders[::-1], np.array([fit.rank for fit in fits])[::-1], left[::-1])


def _too_short(order: int, l: int, m: int, rows: int) -> DataError:
    return DataError(
        f"an observer of order {order} for {l} outputs and {m} inputs was asked",
        f"it has {m + order * (l + m)} unknowns an output, and the record gives {max(rows, 0)} equations",
        "Lower observer_order, or measure longer.",
    )
