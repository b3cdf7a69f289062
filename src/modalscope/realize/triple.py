"""What every realization returns: models of all orders cut from one factorization."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from modalscope.blocks.factor import Factors
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["Realization", "Triple", "inverse_vectors"]

#: Condition of eigenvectors beyond which their inverse is rounding.
_DEFECTIVE = 1e13


@dataclass(frozen=True, eq=False)
class Triple:
    """(A, B, C) of one order; B is None where the columns of the data matrix are lines.

    Parameters
    ----------
    A : array, (N, N)
    B : array, (N, m), optional
    C : array, (l, N)
    rank : int
        States kept from the factorization; canonical forms have more (N > rank).
    """

    A: RealArray
    B: RealArray | None
    C: RealArray
    rank: int

    def dual(self) -> Triple:
        """Return (A', C', B'): the model of the transposed response."""
        assert self.B is not None
        return Triple(self.A.T, self.C.T, self.B.T, self.rank)


@dataclass(frozen=True, eq=False)
class Realization:
    """All orders of one method on one data matrix.

    Parameters
    ----------
    factors : Factors
        Of the matrix that the method factors, or of a stand-in with the same singular values.
    triple : callable
        Order -> Triple.
    canonical : bool
        Whether models have more poles than the rank.
    row_power : float
        The states are those of the row factor P d^a and the column factor d^(1-a) Q', a = row_power.
    notes : tuple of str
        What was chosen, in words.
    """

    factors: Factors
    triple: Callable[[int], Triple]
    canonical: bool = False
    row_power: float = 0.5
    notes: tuple[str, ...] = field(default=())


def inverse_vectors(vectors: Array) -> ComplexArray:
    """Return X^-1 of eigenvectors as columns; the pseudo-inverse where they have nearly lost independence (defective poles)."""
    X = np.asarray(vectors, dtype=np.complex128)
    try:
        inverse = np.linalg.inv(X)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(X)
    if np.linalg.norm(X, 1) * np.linalg.norm(inverse, 1) < _DEFECTIVE:
        return inverse
    return np.linalg.pinv(X)
