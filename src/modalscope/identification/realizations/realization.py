"""Base class of realizations: models of all orders, cut from arrays that are computed once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.influence import Influence, Lines
from modalscope.identification.matrices.matrix import DataMatrix
from modalscope.identification.matrices.triple import Eigen, Triple, padded
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import times_real


class Sides(NamedTuple):
    """One row (k, a) and one column (b, k) of the data matrix for each of k poles, by coefficients in bases that serve all orders."""

    left: ComplexArray
    right: ComplexArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Realization(ABC):
    """All orders of one method on one data matrix.

    `factors`: of the matrix that the method factors, or of a stand-in with the same singular values. `matrix`: that was factored.
    `notes`: what was chosen, in words.
    """

    factors: Factors
    matrix: DataMatrix
    notes: tuple[str, ...] = ()

    #: Whether `left_basis` has the rows that E0 selects of the matrix with one block row more.
    left_of_tall: ClassVar[bool] = False

    @abstractmethod
    def triple(self, n: int) -> Triple:
        """Return the model of order n.

        Raises `DataError`: an order beyond the rank, or one that the method cannot have.
        """

    def sides(self, n: int, eigen: Eigen) -> Sides:
        """Return what `pairs` takes of eigenvalues of the model of order n: small arrays, of which those of several orders go together.

        `eigen`: of the model of the matrix that was factored.

        Raises `DataError`: the first-order change of its poles is not known.
        """
        raise DataError(
            "standard deviations were asked", "a reduction has none", "Leave it out, or use method='alternate'."
        )

    def pairs(self, sides: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
        """Return L and v with dx_j = L_j dH v_j, as `DataMatrix.influence` takes them; several pairs stand for their sum.

        `values` (k,): the eigenvalues.
        """
        rows = times_real(sides.left, self.left_basis[:, : sides.left.shape[1]].T)
        left = self.matrix.pencil(rows, values, tall=self.left_of_tall)
        return ((left, self.matrix.right_vectors(self.factors, sides.right)),)

    @property
    def left_basis(self) -> RealArray:
        """The basis of the left coefficients, (rows, k)."""
        return self.factors.P

    def influence(self, parts: Sequence[tuple[int, Eigen]], lines: Lines | None = None) -> Influence:
        """Return the gradient of eigenvalues of one order, or of several, by the response as it was factored.

        `parts`: orders with eigenvalues of their models. `lines`: those that stand for all; see `DataMatrix.influence`.
        """
        by_order = [self.sides(n, eigen) for n, eigen in parts]
        sides = (
            by_order[0]
            if len(by_order) == 1
            else Sides(padded([s.left for s in by_order]), padded([s.right.T for s in by_order]).T)
        )
        pairs = self.pairs(sides, np.concatenate([eigen.values for _, eigen in parts]))
        total, *others = (self.matrix.influence(left, right, lines) for left, right in pairs)
        for more in others:
            total = total.joined(more)
        return total

    def reduced(self, how: str) -> Realization:
        """Return the models at minimum order, by one of the ways of `modalscope.identification.realizations.companion`.

        Raises `DataError`: there is nothing to reduce.
        """
        raise DataError(
            f"reduction={how!r} was asked",
            "only the canonical form of the null space, in the time domain, has extraneous poles to be rid of",
            "Leave it out, or use method='polyreference', domain='time'.",
        )
