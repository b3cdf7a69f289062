"""The observer's regression: fitted to parts of the records, judged on the rest, without the directions that only noise excites.

Outputs that follow from one another, inputs without power in part of the band and long pasts give regressors that hardly differ. What
a least-squares fit finds there is noise, and an observer made of noise need not be stable. Of the regressors' singular directions the
first `rank` are kept; the rank, as the observer's order, is the one that predicts best what it was not fitted to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.sums import TriangleSum
from modalscope.model.checks import IntArray, RealArray

__all__ = ["RANK", "Fit", "Regression", "regression"]

#: Directions of the regressors below this part of the largest carry rounding only; the shortest solution leaves them out.
RANK = 1e-13

#: Residuals below this part of the outputs are rounding: a longer observer would fit nothing more.
_EXACT = 1e-11

#: Parts that each run is cut into; every one is predicted from the others.
_PARTS = 4

#: Ranks that are tried, about evenly on a logarithmic scale.
_RANKS = 60

#: Rows of the regression that are factored at a time.
_AT_ONCE = 4096


class Fit(NamedTuple):
    """Coefficients (unknowns, l), how many directions they come from, and the residuals' sums of squares and products (l, l)."""

    solution: RealArray
    rank: int
    residual: RealArray


class Regression(NamedTuple):
    """Triangular factors of [u(k), u(k-1), y(k-1), ..., u(k-p), y(k-p), y(k)]: over all times k, over each part, and over all others.

    An order's regressors come before those of the next one, so that its own factor is a leading block.
    """

    whole: RealArray
    parts: list[RealArray]
    others: list[RealArray]
    outputs: int
    inputs: int
    rows: int

    def unknowns(self, order: int) -> int:
        """Coefficients of an output at an order.

        Parameters
        ----------
        order : int
        """
        return self.inputs + order * (self.inputs + self.outputs)

    def share(self, errors: RealArray) -> RealArray:
        """Return the mean logarithm over the outputs of the power's share in sums of squares (..., l); rounding counts as one size.

        Parameters
        ----------
        errors : array
        """
        power = np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        return np.asarray(np.mean(np.log(np.maximum(errors / np.where(power > 0, power, 1.0), _EXACT**2)), axis=-1))

    def fit(self, unknowns: int, rank: int | None = None) -> Fit:
        """Return the shortest least-squares solution in the first `rank` directions of the first regressors.

        Parameters
        ----------
        unknowns : int
        rank : int, optional
            All that stand out of rounding by default.
        """
        R, Y = self.whole[:, :unknowns], self.whole[:, -self.outputs :]
        steps, Vt = _directions(R, Y)
        kept = len(steps) if rank is None else min(rank, len(steps))
        solution = Vt[:kept].T @ steps[:kept]
        left = Y - R @ solution
        return Fit(solution, kept, left.T @ left)

    def is_exact(self, unknowns: int) -> bool:
        """Whether the first regressors give the outputs to rounding, with equations to spare: noise never does.

        Parameters
        ----------
        unknowns : int
        """
        limit = _EXACT**2 * np.sum(self.whole[:, -self.outputs :] ** 2, axis=0)
        if not limit.any() or np.any(
            np.sum(self.whole[unknowns:, -self.outputs :] ** 2, axis=0) > limit
        ):  # the least that can be left
            return False
        found = self.fit(unknowns)
        return found.rank < self.rows and bool(np.all(np.diag(found.residual) <= limit))

    def held_out(self, unknowns: int) -> tuple[int, float]:
        """Return the rank that predicts the parts best, each from the others, and the mean logarithm of the errors' share of the power.

        Parameters
        ----------
        unknowns : int
        """
        ranks = np.unique(np.geomspace(1, unknowns, _RANKS).astype(int))
        errors = np.sum([self._errors(k, unknowns, ranks) for k in range(len(self.parts))], axis=0)
        criterion = self.share(errors)
        best = int(np.argmin(criterion))
        return int(ranks[best]), float(criterion[best])

    def _errors(self, k: int, unknowns: int, ranks: IntArray) -> RealArray:
        """Return the sums of squared errors (ranks, l) on part k."""
        R, part = self.others[k], self.parts[k]
        steps, Vt = _directions(R[:, :unknowns], R[:, -self.outputs :])
        turned, left = part[:, :unknowns] @ Vt.T, np.array(part[:, -self.outputs :])
        errors, last = np.empty((ranks.size, self.outputs)), 0
        for i, rank in enumerate(np.minimum(ranks, len(steps))):
            left -= turned[:, last:rank] @ steps[last:rank]
            errors[i], last = np.sum(left**2, axis=0), rank
        return errors


def _directions(R: RealArray, Y: RealArray) -> tuple[RealArray, RealArray]:
    """Return d^-1 U'Y and V' of R = U d V', without what is rounding."""
    U, d, Vt = sla.svd(R[: R.shape[1]], full_matrices=False, check_finite=False)
    above = int(np.count_nonzero(d > RANK * d[0]))
    return (U[:, :above].T @ Y[: R.shape[1]]) / d[:above, None], Vt[:above]


def regression(outputs: RealArray, inputs: RealArray, order: int) -> Regression:
    """Return the regression of outputs (R, N, l) on inputs (R, N, m) and outputs of `order` samples before.

    Parameters
    ----------
    outputs, inputs : array
    order : int
    """
    (runs, samples, l), m = outputs.shape, inputs.shape[2]
    columns = (m + l) * (order + 1)
    times = np.array_split(np.arange(order, samples), _PARTS)
    parts = []
    for chosen in times:
        total = TriangleSum(columns)
        for y, u in zip(outputs, inputs, strict=True):
            for first in range(0, chosen.size, _AT_ONCE):
                total.add(_rows(y, u, chosen[first : first + _AT_ONCE], order))
        parts.append(total.finish())
    others = [_joined(columns, parts[:k] + parts[k + 1 :]) for k in range(_PARTS)]
    return Regression(_joined(columns, [parts[0], others[0]]), parts, others, l, m, runs * (samples - order))


def _joined(columns: int, triangles: list[RealArray]) -> RealArray:
    total = TriangleSum(columns)
    for triangle in triangles:
        total.add(triangle)
    return total.finish()


def _rows(y: RealArray, u: RealArray, times: IntArray, order: int) -> RealArray:
    past = [part[times - i] for i in range(1, order + 1) for part in (u, y)]
    return np.concatenate([u[times], *past, y[times]], axis=1)
