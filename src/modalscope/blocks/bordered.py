"""Eigenvalues of a matrix with one row and one column more, from those of the matrix: roots of a secular equation.

In the coordinates of the eigenvectors of A the larger matrix [[A, b], [c', d]] is an arrowhead, [[Lambda, b], [c', d]], and its
eigenvalues are the roots of f(x) = x - d - sum_i w_i / (x - lambda_i), w_i = b_i c_i (G. H. Golub, Some modified matrix eigenvalue
problems, SIAM Review 15, 1973). All of them are found together, by Aberth's iteration on f(x) prod (x - lambda_i), each as a distance from
the eigenvalue that it starts at, so that a root that hardly moves keeps all its digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["Arrow", "Paired", "Roots", "roots"]

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
    """Return the eigenvalues of an arrowhead matrix; None where they do not settle or do not come in pairs.

    Parameters
    ----------
    arrow : Arrow
    """
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
