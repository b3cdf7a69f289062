"""What every realization is: models of all orders, cut from arrays that were computed once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from modalscope.blocks.factor import Factors
from modalscope.blocks.triple import Triple
from modalscope.model.checks import DataError

__all__ = ["Realization"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Realization(ABC):
    """All orders of one method on one data matrix.

    Parameters
    ----------
    factors : Factors
        Of the matrix that the method factors, or of a stand-in with the same singular values.
    notes : tuple of str
        What was chosen, in words.
    """

    factors: Factors
    notes: tuple[str, ...] = ()

    @abstractmethod
    def triple(self, n: int) -> Triple:
        """Return the model of order n.

        Raises
        ------
        DataError
            An order beyond the rank, or one that the method cannot have.
        """

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
