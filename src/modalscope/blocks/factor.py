"""Factorizations H = P diag(d) Q': two routes behind one door, and one function that chooses.

The dense thin singular value decomposition serves small matrices. Where structure gives the Gram matrix of the shorter side
cheaply, its eigenvectors give the same factors without the matrix; singular values below about 1e-3 of the largest then
lose digits to the square, and one refinement pass (a product with the leading vectors, an orthogonalization, a small
decomposition) brings them back.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.operators import Operator
from modalscope.blocks.sums import TriangleSum
from modalscope.model.checks import DataError, RealArray, check_choice

__all__ = ["Factors", "RightFactor", "factorize", "left_factor"]

#: Up to this many entries, and while the shorter side stays below `_DENSE_SIDE`, the dense route takes a fraction of a second.
_DENSE_ENTRIES = 250_000
_DENSE_SIDE = 400

#: Extra columns carried through the refinement pass, so that the last wanted direction is as good as the first.
_EXTRA = 20

#: Ratio of singular values below which the Gram route alone loses more digits than noise-free work may.
_PASS_BELOW = 1e-3

#: Condition of all rows up to which their Gram matrix serves a regression: its error, eps times the square, stays below 1e-8.
_GRAM_CONDITION = 1e4

#: Rows that a streamed triangular factorization takes at a time, in multiples of the columns.
_CHUNK = 2


class RightFactor(Protocol):
    """The right factor on the columns that indicators compare, computed when it is first asked for."""

    @property
    def blocks(self) -> RealArray:
        """Rows of Q by input that are compared, (m, rows, k)."""

    @property
    def whole(self) -> RealArray:
        """All rows of Q by input."""


@dataclass(frozen=True, eq=False)
class Factors:
    """H = P diag(d) Q', the leading part, with how it was found.

    Parameters
    ----------
    P : array, (rows, k)
        Orthonormal left vectors.
    d : array, (k,)
        Singular values, decreasing.
    Q : array, (columns, k)
        Orthonormal right vectors.
    spectrum : array
        All singular values that the route gives: the dense one all, the Gram route those it carried.
    rank : int
        Number of singular values above rounding.
    how : str
        The route, in words.
    gram : array, optional
        The Gram matrix that was decomposed in part.
    right : RightFactor, optional
        The right factor on the data's own columns, where Q belongs to a stand-in.
    """

    P: RealArray
    d: RealArray
    Q: RealArray
    spectrum: RealArray
    rank: int
    how: str
    gram: RealArray | None = field(default=None, repr=False)
    right: RightFactor | None = field(default=None, repr=False)

    def transposed(self) -> Factors:
        """Return the factors of H'."""
        return Factors(self.Q, self.d, self.P, self.spectrum, self.rank, self.how, self.gram)

    @cached_property
    def complete_spectrum(self) -> RealArray:
        """All singular values, down to sqrt(eps) of the first where they come from the Gram matrix."""
        if self.gram is None:
            return self.spectrum
        values = sla.eigvalsh(self.gram, check_finite=False)[::-1]
        return np.concatenate([self.spectrum, np.sqrt(np.clip(values[self.spectrum.size :], 0, None))])

    def check_order(self, order: int) -> None:
        """Raise when `order` states cannot be told from rounding."""
        if order > self.rank:
            raise DataError(
                f"order={order} was asked",
                f"the data matrix has rank {self.rank}",
                f"Lower the order to at most {self.rank}, or give more block rows and columns.",
            )


def factorize(matrix: Operator, rank: int | None = None, route: str = "auto") -> Factors:
    """Return the leading `rank` singular triplets of a matrix (all when None), by the cheaper exact enough route.

    Parameters
    ----------
    matrix : Operator
    rank : int, optional
        How many triplets will be used.
    route : {"auto", "dense", "gram"}
        "auto" takes the dense decomposition for small matrices and where there is no structure.

    Raises
    ------
    DataError
        A matrix of zeros, or the Gram route without structure.
    """
    rows, columns = matrix.shape
    if rows < columns:
        return factorize(matrix.transposed(), rank, route).transposed()
    check_choice("factorization", route, ("auto", "dense", "gram"))
    wanted = columns if rank is None else min(rank, columns)
    small = rows * columns <= _DENSE_ENTRIES and columns <= _DENSE_SIDE
    if route == "dense" or (route == "auto" and (small or wanted + _EXTRA >= columns)):
        return _dense(matrix, wanted)
    gram = matrix.gram()
    if gram is not None:
        return _by_gram(matrix, gram, wanted)
    if route == "gram":
        raise DataError(
            "route='gram' was asked",
            "this data matrix has no structure that gives its Gram matrix",
            "Use route='auto'.",
        )
    return _dense(matrix, wanted)


def left_factor(matrix: Operator, route: str = "auto") -> Factors:
    """Return all of P and d, Q without columns: what a regression on whole rows needs, with nothing of the columns' size kept.

    From the Gram matrix of the rows where it is known and well conditioned; else by an orthogonal triangularization that takes
    the columns in chunks; small matrices by the dense decomposition.
    """
    rows, columns = matrix.shape
    nothing = np.zeros((columns, 0))
    if route == "dense" or rows * columns <= _DENSE_ENTRIES or rows > columns:
        found = _dense(matrix, min(rows, columns))
        return Factors(found.P, found.d, nothing, found.spectrum, found.rank, found.how)
    gram = matrix.transposed().gram()
    if gram is not None:
        weights, P = sla.eigh(gram, check_finite=False)
        if weights[0] * _GRAM_CONDITION**2 > weights[-1]:
            d = np.sqrt(weights[::-1])
            how = f"structured Gram matrix of the rows of {rows} x {columns}"
            return Factors(np.ascontiguousarray(P[:, ::-1]), d, nothing, d, d.size, how)
    total = TriangleSum(rows)
    for chunk in matrix.transposed().row_chunks(_CHUNK * rows):
        total.add(chunk)
    P, d, _ = sla.svd(total.finish().T, full_matrices=False, check_finite=False)
    how = f"triangular factor of {rows} x {columns}"
    return _finish(P, d, nothing, d, max(rows, columns) * float(np.finfo(float).eps), how)


def _finish(
    P: RealArray,
    d: RealArray,
    Q: RealArray,
    spectrum: RealArray,
    floor: float,
    how: str,
    gram: RealArray | None = None,
) -> Factors:
    if d.size == 0 or d[0] <= 0:
        raise DataError("a data matrix with content was asked", "it is zero", "Give data with a response in them.")
    return Factors(P, d, Q, spectrum, _rank(d, floor), how, gram)


def _rank(d: RealArray, floor: float) -> int:
    """Count singular values above rounding; a drop of a thousand to below 1e-10 of the first is rounding of the data themselves."""
    above = int(np.count_nonzero(d > floor * d[0]))
    drops = np.flatnonzero((d[1:] < 1e-10 * d[0]) & (d[1:] < 1e-3 * d[:-1]))
    return min(above, int(drops[0]) + 1) if drops.size else above


def _dense(matrix: Operator, wanted: int) -> Factors:
    H = matrix.dense()
    try:
        P, d, Qt = sla.svd(H, full_matrices=False, lapack_driver="gesdd", check_finite=False)
    except sla.LinAlgError:  # gesdd rarely fails where the slower gesvd converges
        P, d, Qt = sla.svd(H, full_matrices=False, lapack_driver="gesvd", check_finite=False)
    floor = max(H.shape) * np.finfo(float).eps
    return _finish(
        np.array(P[:, :wanted]),
        d[:wanted],
        np.array(Qt[:wanted].T),
        d,
        floor,
        f"dense singular value decomposition, {H.shape[0]} x {H.shape[1]}",
    )


def _by_gram(matrix: Operator, gram: RealArray, wanted: int) -> Factors:
    columns = gram.shape[0]
    eps = np.finfo(float).eps
    carried = min(wanted + _EXTRA, columns)
    weights, Q = sla.eigh(gram, subset_by_index=(columns - carried, columns - 1), check_finite=False)
    weights, Q = np.clip(weights[::-1], 0, None), Q[:, ::-1]
    d = np.sqrt(weights)
    size = f"{matrix.shape[0]} x {columns}"
    if d[0] > 0 and d[wanted - 1] > _PASS_BELOW * d[0]:
        P = matrix.times(np.ascontiguousarray(Q[:, :wanted])) / d[:wanted]
        how = f"structured Gram matrix of {size}"
        return _finish(P, d[:wanted], Q[:, :wanted], d, columns * eps, how, gram)
    left, _ = np.linalg.qr(matrix.times(np.ascontiguousarray(Q)))
    U, d, Vt = np.linalg.svd(matrix.transposed_times(left).T, full_matrices=False)
    how = f"structured Gram matrix of {size} with a refinement pass"
    # directions below the Gram matrix' resolution are not separated by it: what the pass finds there is not rank
    return _finish(left @ U[:, :wanted], d[:wanted], Vt[:wanted].T, d, max(matrix.shape) * eps, how, gram)
