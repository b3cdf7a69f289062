"""What every realization is: models of all orders, cut from arrays that were computed once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

from modalscope.blocks.factor import Factors
from modalscope.blocks.influence import Influence, Lines
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.triple import Eigen, Triple
from modalscope.model.checks import ComplexArray, DataError

__all__ = ["Realization", "Sides"]


class Sides(NamedTuple):
    """One row and one column of the data matrix for each of k poles, as its `influence` takes them."""

    left: ComplexArray
    right: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Realization(ABC):
    """All orders of one method on one data matrix.

    Parameters
    ----------
    factors : Factors
        Of the matrix that the method factors, or of a stand-in with the same singular values.
    matrix : DataMatrix
        That was factored.
    notes : tuple of str
        What was chosen, in words.
    """

    factors: Factors
    matrix: DataMatrix
    notes: tuple[str, ...] = ()

    @abstractmethod
    def triple(self, n: int) -> Triple:
        """Return the model of order n.

        Raises
        ------
        DataError
            An order beyond the rank, or one that the method cannot have.
        """

    def in_turn(self) -> Realization:
        """Return the same models for every order in turn: where they are nested, eigenvalues of one follow from those of the one before."""
        return self

    def sides(self, n: int, eigen: Eigen) -> tuple[Sides, ...]:
        """Return L and v with dx_j = L_j dH v_j for eigenvalues of the model of order n; several pairs stand for their sum.

        Parameters
        ----------
        n : int
        eigen : Eigen
            Of the model of the matrix that was factored.

        Raises
        ------
        DataError
            The first-order change of its poles is not known.
        """
        raise DataError(
            "the influence of the data on these poles was asked",
            "it is not known for this way of reading them off",
            "Leave the reduction out, or use method='alternate'.",
        )

    def influence(self, n: int, eigen: Eigen, lines: Lines | None = None) -> Influence:
        """Return the gradient of eigenvalues of order n by the response as it was factored.

        Parameters
        ----------
        n : int
        eigen : Eigen
        lines : Lines, optional
            Those that stand for all; see `DataMatrix.influence`.
        """
        found = [self.matrix.influence(side.left, side.right, lines) for side in self.sides(n, eigen)]
        total = found[0]
        for more in found[1:]:
            total = total.joined(more)
        return total

    def reduced(self, how: str) -> Realization:
        """Return the models at minimum order, by one of the ways of `modalscope.realizations.reduction`.

        Raises
        ------
        DataError
            There is nothing to reduce.
        """
        raise DataError(
            f"reduction={how!r} was asked",
            "only the canonical form of the null space, in the time domain, has extraneous poles to be rid of",
            "Leave it out, or use method='polyreference', domain='time'.",
        )
