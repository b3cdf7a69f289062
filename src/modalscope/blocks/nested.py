"""Eigenvalues and vectors of all leading blocks of one matrix: each from those of the block before, where that is exact enough.

The models of balanced projection and of the shift of one factor are, in suitable coordinates, leading blocks of that of the largest
order. A diagram of every order then needs no eigenproblem from the start at each: the block of order n + 1 is an arrowhead in the
eigenvectors of that of order n (`modalscope.blocks.bordered`), and its vectors are sums of theirs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.blocks.bordered import Arrow, Paired, roots
from modalscope.blocks.real_products import real_times, times_real
from modalscope.blocks.triple import Eigen
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["Known", "NestedEigen"]

#: Largest share by which V W x and V Lambda W x may miss x and A x: as LAPACK's vectors do whose condition is some thousands.
_MISSED = 1e-12

#: Orders that start anew, so that the vectors of an order are the same whichever were asked before.
_ANEW = 50


class Known(NamedTuple):
    """Eigenvalues of a real matrix with their vectors, one of each pair: those above the axis before real ones.

    Attributes
    ----------
    values : Paired
    vectors : array of complex, (n, k)
        Of length one.
    left : array of complex, (k, n)
        Rows of the inverse of all vectors.
    """

    values: Paired
    vectors: ComplexArray
    left: ComplexArray


class NestedEigen:
    """Eigenvalues and vectors of models of all orders whose A are T M T^-1 with leading blocks of M and of a triangular T.

    Parameters
    ----------
    matrix : array, (N, N)
        M.
    states, back : array, (N, N), optional
        T, upper triangular, and its inverse; of none both are I.
    """

    def __init__(self, matrix: RealArray, states: RealArray | None = None, back: RealArray | None = None) -> None:
        self.matrix, self.states, self.back = np.ascontiguousarray(matrix), states, back
        self._last: tuple[int, Known | None] = (0, None)

    def eigen(self, n: int) -> Eigen | None:
        """Return all eigenvalues and vectors of the model of order n; None where they are left to others.

        Parameters
        ----------
        n : int
        """
        known = self.known(n)
        if known is None:
            return None
        vectors, left, u = known.vectors, known.left, known.values.upper.size
        if self.states is not None and self.back is not None:
            vectors, left = real_times(self.states[:n, :n], vectors), times_real(left, self.back[:n, :n])
            vectors, left = _scaled(vectors, left, np.ones(len(left)))
        return Eigen(
            known.values.all,
            np.concatenate([vectors[:, :u], vectors[:, :u].conj(), vectors[:, u:]], axis=1),
            np.concatenate([left[:u], left[:u].conj(), left[u:]]),
        )

    def known(self, n: int) -> Known | None:
        """Return eigenvalues and vectors of the leading block of M of order n, one of each pair."""
        start = n - (n - 1) % _ANEW
        order, known = self._last
        if not start <= order <= n:
            order, known = start, _directly(self.matrix[:start, :start])
        with np.errstate(all="ignore"):  # what is beyond numbers is not sound
            for k in range(order + 1, n + 1):
                block = self.matrix[:k, :k]
                known = (None if known is None else _grown(block, known)) or _directly(block)
        self._last = n, known
        return known


def _directly(A: RealArray) -> Known | None:
    """Return eigenvalues and vectors by LAPACK; None where the vectors are nearly dependent."""
    values, vectors = np.linalg.eig(A)
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    kept = np.concatenate([np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)])
    u = np.count_nonzero(values.imag > 0)
    paired = Paired(values[kept[:u]].astype(complex), values[kept[u:]].real)
    return _sound(A, Known(paired, vectors[:, kept].astype(complex), left[kept].astype(complex)))


def _grown(A: RealArray, known: Known) -> Known | None:
    """Return eigenvalues and vectors of a matrix from those of its leading block without the last row and column.

    (Lambda - x) p + b = 0 gives the root's vector [V p; 1], p_i = b_i / (x - lambda_i), and in the same way the left one [q W, 1],
    q_i = c_i / (x - lambda_i); their product is 1 + sum p_i q_i.
    """
    u, n = known.values.upper.size, len(A) - 1
    b, c = _times_vector(known.left, A[:n, n]), _times_vector(known.vectors.T, A[n, :n])
    pairs = Paired(b[:u], b[u:].real), Paired(c[:u], c[u:].real)
    found = roots(Arrow(known.values, *pairs, float(A[n, n])))
    if found is None:
        return None
    p, q = pairs[0].all * found.inverse, pairs[1].all * found.inverse
    vectors = np.vstack([real_times(_parts(known.vectors.T, u).T, _folded(p, u).T), np.ones((1, len(p)))])
    left = np.hstack([times_real(_folded(q, u), _parts(known.left, u)), np.ones((len(q), 1))])
    vectors, left = _scaled(vectors, left, 1 + np.einsum("ij,ij->i", p, q))
    above = found.values.upper.size
    vectors[:, above:].imag, left[above:].imag = 0, 0
    return _sound(A, Known(found.values, vectors, left))


def _times_vector(rows: ComplexArray, x: RealArray) -> ComplexArray:
    """Return rows @ x of complex rows and a real vector."""
    return np.asarray(rows @ x.astype(complex))


def _parts(rows: ComplexArray, u: int) -> RealArray:
    """Return the real parts of pairs, their imaginary parts, and real rows: a real basis, (2 u + r, n)."""
    return np.concatenate([rows[:u].real, rows[:u].imag, rows[u:].real])


def _folded(weights: ComplexArray, u: int) -> ComplexArray:
    """Return weights (k, 2 u + r) of rows, conjugates and real ones as those of parts: a v + b v* = (a + b) Re v + j (a - b) Im v."""
    first, second = weights[:, :u], weights[:, u : 2 * u]
    return np.concatenate([first + second, 1j * (first - second), weights[:, 2 * u :]], axis=1)


def _scaled(vectors: ComplexArray, left: ComplexArray, product: Array) -> tuple[ComplexArray, ComplexArray]:
    """Return vectors of length one whose largest component is real, as LAPACK gives them, and the rows that go with them."""
    squares = vectors.real**2 + vectors.imag**2
    top = vectors[np.argmax(squares, axis=0), np.arange(len(left))]
    scale = top.conj() / (np.abs(top) * np.sqrt(squares.sum(axis=0)))
    return vectors * scale, left / (product * scale)[:, None]


def _sound(A: RealArray, known: Known) -> Known | None:
    """Return vectors of which V W = I and V Lambda W = A hold, tried on one vector without structure; None of others."""
    n, u = len(A), known.values.upper.size
    x = np.cos(np.arange(1.0, n + 1) ** 2)
    weights = _times_vector(known.left, x)
    values = np.concatenate([known.values.upper, known.values.real])
    both = np.stack([weights, values * weights], axis=1)
    both[:u] *= 2  # a pair gives twice the real part
    missed = (known.vectors @ both).real - np.stack([x, A @ x], axis=1)
    size = np.linalg.norm(x)
    limit = _MISSED * size * np.array([1.0, np.linalg.norm(A)])
    return known if np.all(np.linalg.norm(missed, axis=0) <= limit) else None
