"""The gradient of continuous poles by the response, for any row of the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.blocks.influence import Influence, Lines, Moments
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.triple import Eigen, Triple
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.realizations.realization import Realization

__all__ = ["PoleInfluence", "influence_on", "influence_on_all", "slope_to_s"]

#: Relative step by which the map to continuous poles is differenced: it is analytic, along the ray of the pole.
_STEP = 1e-6


def slope_to_s(matrix: DataMatrix, values: ComplexArray) -> ComplexArray:
    """Return ds/dx of the map from the plane of a data matrix to rad/s, (k,)."""
    ahead, behind = (matrix.to_s(values * (1 + sign * _STEP)) for sign in (1, -1))
    return np.asarray((ahead - behind) / (2 * _STEP * values))


@dataclass(frozen=True, eq=False, slots=True)
class PoleInfluence:
    """How a response moves continuous poles: ds = slope dx, dx by the gradient.

    Parameters
    ----------
    gradient : Influence
        Of the eigenvalues in the plane of the data matrix.
    slope : array of complex, (k,)
    """

    gradient: Influence
    slope: ComplexArray

    def joint(self, other: PoleInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments of these and as many other poles under one noise, see `Influence.joint`."""
        return self.gradient.joint(other.gradient, variance, fading).scaled(self.slope, other.slope)

    def take(self, index: Array) -> PoleInfluence:
        """Return the influence on some poles."""
        return PoleInfluence(self.gradient.take(index), self.slope[index])

    def of(self, change: Array) -> ComplexArray:
        """Return the first-order changes (d, k) of the poles, rad/s, for changes (d, F or N, l, m) of the response."""
        return np.asarray(self.gradient.of(change) * self.slope)


def influence_on(
    matrix: DataMatrix, realization: Realization, order: int, model: Triple, eigen: Eigen, lines: Lines | None = None
) -> PoleInfluence:
    """Return how the response moves some eigenvalues of a model; see `influence_on_all`."""
    return influence_on_all(matrix, realization, [(order, model, eigen)], lines)


def influence_on_all(
    matrix: DataMatrix, realization: Realization, parts: Sequence[tuple[int, Triple, Eigen]], lines: Lines | None = None
) -> PoleInfluence:
    """Return how the response moves some eigenvalues of a model, or of those of several orders.

    Parameters
    ----------
    matrix : DataMatrix
    realization : Realization
    parts : sequence of (int, Triple, Eigen)
        Orders with their models, cut out of the realization, with inputs and outputs in their own places; of the eigenvalues those that
        are asked.
    lines : Lines, optional
        Those that stand for all; see `DataMatrix.influence`.

    Raises
    ------
    DataError
        The row has no first-order formula.
    """
    factored = [
        (order, Eigen(eigen.values, eigen.left.T, eigen.vectors.T) if model.turned else eigen)
        for order, model, eigen in parts
    ]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = realization.influence(factored, lines)
        values = np.concatenate([eigen.values for _, _, eigen in parts])
        return PoleInfluence(matrix.as_measured(found), slope_to_s(matrix, values))
