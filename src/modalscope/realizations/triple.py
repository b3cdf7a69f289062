"""What every realization returns: models of all orders cut from one factorization."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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
    span : array, (N, rank), optional
        Orthonormal basis of the states that the truncated factor holds, of a canonical form.
    turned : bool
        Whether that is a space of left eigenvectors: inputs and outputs have changed places.
    """

    A: RealArray
    B: RealArray | None
    C: RealArray
    rank: int
    span: RealArray | None = None
    turned: bool = False

    def dual(self) -> Triple:
        """Return (A', C', B'): the model of the transposed response."""
        assert self.B is not None
        return Triple(self.A.T, self.C.T, self.B.T, self.rank, self.span, not self.turned)

    def held(self, vectors: Array, rows: Array) -> RealArray | None:
        """Return the share of each mode's vector, 0 to 1, that the truncated factor holds; None where there is nothing to tell.

        Of a canonical form without noise: 1 for the modes, less for the extraneous poles. In noise it tells them apart better than
        the amplitude in the first block column, which the noise of that column drives as well.

        Parameters
        ----------
        vectors : array of complex, (N, k)
            Eigenvectors of A.
        rows : array of complex, (k, N)
            The matching rows of their inverse.
        """
        if self.span is None:
            return None
        X = np.asarray(rows).T if self.turned else np.asarray(vectors)
        return np.asarray(np.linalg.norm(self.span.T @ X, axis=0) / np.linalg.norm(X, axis=0))


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
    notes: tuple[str, ...] = ()


def inverse_vectors(vectors: Array) -> ComplexArray:
    """Return X^-1 of eigenvectors as columns; the pseudo-inverse where they have nearly lost independence (defective poles)."""
    X = np.asarray(vectors, dtype=np.complex128)
    try:
        inverse = np.asarray(np.linalg.inv(X), dtype=complex)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(X), dtype=complex)
    if np.linalg.norm(X, 1) * np.linalg.norm(inverse, 1) < _DEFECTIVE:
        return inverse
    return np.asarray(np.linalg.pinv(X), dtype=complex)
