"""Eigenvalues and vectors of all leading blocks of one matrix: each from those of the block before, where that is exact enough.

The models of balanced projection and of the shift of one factor are, in suitable coordinates, leading blocks of that of the largest
order. A diagram of every order then needs no eigenproblem from the start at each: the block of order n + 1 is an arrowhead in the
eigenvectors of that of order n (`modalscope.realizations.nested`), and its vectors are sums of theirs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.blocks.triple import Eigen
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.operators import real_times, times_real

__all__ = ["Arrow", "Known", "NestedEigen", "Paired", "roots"]


# ------------------------------------------------------------------------------------------------------------ bordered
# Eigenvalues of a matrix with one row and one column more, from those of the matrix: roots of a secular equation.
#
# In the coordinates of the eigenvectors of A the larger matrix [[A, b], [c', d]] is an arrowhead, [[Lambda, b], [c', d]], and its
# eigenvalues are the roots of f(x) = x - d - sum_i w_i / (x - lambda_i), w_i = b_i c_i (G. H. Golub, Some modified matrix eigenvalue
# problems, SIAM Review 15, 1973). All of them are found together, by Aberth's iteration on f(x) prod (x - lambda_i), each as a
# distance from
# the eigenvalue that it starts at, so that a root that hardly moves keeps all its digits.

_EPS = float(np.finfo(float).eps)

#: Rounds after which roots that do not settle, multiple ones, are left to others.
_ROUNDS = 20

#: Relative step after which a root stands: convergence is of third order, so that what is left is rounding.
_STANDS = 1e-12

#: First steps that a pair must be off the real axis to stay a pair.
_NEAR = 4.0

#: Share of the distance to the next eigenvalue that a first step may take.
_FIRST = 0.5

#: Angles (rad) by which starts on the real axis are turned off it, in turns: two roots there may leave it as a pair.
_TURNED = (0.3, 0.5, 0.7)

#: Imaginary part, relative to the modulus, below which a root that started on the real axis is on it.
_REAL = 1e-12


class Paired(NamedTuple):
    """Numbers that come in conjugate pairs: those above the axis, and real ones.

    Attributes
    ----------
    upper : array of complex, (u,)
    real : array, (r,)
    """

    upper: ComplexArray
    real: RealArray

    @property
    def all(self) -> ComplexArray:
        """Those above the axis, their conjugates, and real ones, (2 u + r,)."""
        return np.concatenate([self.upper, self.upper.conj(), self.real])


class Arrow(NamedTuple):
    """An arrowhead matrix [[diag(values), b], [c', d]].

    Attributes
    ----------
    values, b, c : Paired
    d : float
    """

    values: Paired
    b: Paired
    c: Paired
    d: float


class Roots(NamedTuple):
    """Eigenvalues of an arrowhead.

    Attributes
    ----------
    values : Paired
    inverse : array of complex, (k, n)
        1 / (root - eigenvalue of the smaller matrix), of the roots above the axis and the real ones; infinite is nowhere.
    """

    values: Paired
    inverse: ComplexArray


def roots(arrow: Arrow) -> Roots | None:
    """Return the eigenvalues of an arrowhead matrix; None where they do not settle or do not come in pairs."""
    lam, w = arrow.values.all, arrow.b.all * arrow.c.all
    with np.errstate(all="ignore"):
        order, u = _far_first(lam, w, arrow)
        found = _Iteration(lam[order], w[order], arrow.d, u)
        if not found.settled():
            return None
        return found.paired(lam)


def _far_first(lam: ComplexArray, w: ComplexArray, arrow: Arrow) -> tuple[Array, int]:
    """Return the order in which pairs that stay off the axis come first, and how many they are: of others both are followed."""
    u = arrow.values.upper.size
    inverse = lam[:u, None] - lam
    inverse[np.arange(u), np.arange(u)] = np.inf
    step = w[:u] / (lam[:u] - arrow.d - np.reciprocal(inverse) @ w)
    far = lam[:u].imag > _NEAR * np.abs(step)
    off, near = np.flatnonzero(far), np.flatnonzero(~far)
    return np.concatenate([off, off + u, near, near + u, np.arange(2 * u, lam.size)]), off.size


class _Iteration:
    """Roots on their way, each as a distance from the eigenvalue that it starts at: of u pairs one, and all others."""

    def __init__(self, lam: ComplexArray, w: ComplexArray, d: float, u: int) -> None:
        self.w, self.d, self.u = w, d, u
        self.own = np.r_[0:u, 2 * u : lam.size]
        self.origin = np.append(lam[self.own], d)
        self.base = self.origin[:, None] - lam
        self.w_own = np.append(w[self.own], 0)
        self.delta = self._start()

    def _start(self) -> ComplexArray:
        """Return the first step of every root: that of perturbation, within reach, and of those near the real axis off it."""
        k, origin = self.own.size, self.origin[:-1]
        inverse = self.base[:k].copy()
        inverse[np.arange(k), self.own] = np.inf
        np.reciprocal(inverse, out=inverse)
        step, far = self.w_own[:k] / (origin - self.d - inverse @ self.w), np.max(np.abs(inverse), axis=1, initial=0.0)
        gap = _FIRST / np.where(far > 0, far, 1 / (np.abs(origin - self.d) + _EPS))
        size = np.abs(step)
        step = np.where(size <= gap, step, gap * np.where(size > 0, step / size, 1))
        step = np.append(np.where(np.isfinite(step), step, gap), np.median(gap) / 4 if k else 0)
        step[self.u :] *= np.exp(1j * np.resize(_TURNED, step.size - self.u))
        return np.asarray(step)

    def settled(self) -> bool:
        """Move all roots until they stand; the own pole of each is multiplied out, so that nothing is divided by its distance."""
        moving = np.arange(self.delta.size)
        for _ in range(_ROUNDS):
            step, x = self._step(moving)
            if not np.all(np.isfinite(step)):
                return False
            self.delta[moving] -= step
            moving = moving[np.abs(step) > _STANDS * np.abs(x)]
            if not moving.size:
                return True
        return False

    def _step(self, moving: Array) -> tuple[ComplexArray, ComplexArray]:
        """Return the steps of some roots, and where they are: Newton's on f (x - lambda_own), and what all other roots and poles add."""
        delta, last = self.delta[moving], self.own.size
        x = self.origin[moving] + delta
        rows = np.flatnonzero(moving < last)
        inverse = self.base[moving]
        inverse += delta[:, None]
        inverse[rows, self.own[moving[rows]]] = np.inf
        np.reciprocal(inverse, out=inverse)
        g = x - self.d - inverse @ self.w
        scale, is_own = np.where(moving < last, delta, 1), moving < last
        f = scale * g - self.w_own[moving]
        slope = np.where(is_own, g, 0) + scale * (1 + (inverse * inverse) @ self.w)
        return f / (slope + f * (inverse.sum(axis=1) - self._repulsion(x, moving))), x

    def _repulsion(self, x: ComplexArray, moving: Array) -> ComplexArray:
        """Return the sum of 1 / (x - y) over all other roots y."""
        every = self.origin + self.delta
        others = x[:, None] - np.concatenate([every, every[: self.u].conj()])
        others[np.arange(x.size), moving] = np.inf
        return np.asarray(np.reciprocal(others, out=others).sum(axis=1))

    def paired(self, lam: ComplexArray) -> Roots | None:
        """Return the roots as pairs and real ones, with their distances turned over, for eigenvalues in any order."""
        x = self.origin + self.delta
        off = np.arange(x.size) < self.u
        real = ~off & (np.abs(x.imag) <= _REAL * np.abs(x))
        above, on = np.flatnonzero(off | ~real & (x.imag > 0)), np.flatnonzero(real)
        if 2 * above.size + on.size != self.own.size + self.u + 1 or np.any(x[above].imag <= 0):
            return None
        chosen = np.concatenate([above, on])
        self.delta[on] = x[on].real - self.origin[on]
        away = self.origin[chosen, None] - lam
        away += self.delta[chosen, None]
        return Roots(Paired(x[above], x[on].real), np.reciprocal(away, out=away))


# -------------------------------------------------------------------------------------------------------------- nested

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

    `matrix` (N, N): m. `states`, `back` (N, N): t, upper triangular, and its inverse; of none both are I.
    """

    def __init__(self, matrix: RealArray, states: RealArray | None = None, back: RealArray | None = None) -> None:
        self.matrix, self.states, self.back = np.ascontiguousarray(matrix), states, back
        self._last: tuple[int, Known | None] = (0, None)

    def eigen(self, n: int) -> Eigen | None:
        """Return all eigenvalues and vectors of the model of order n; None where they are left to others."""
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
