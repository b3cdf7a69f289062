"""Realize models in canonical form: block companion matrices by null space or least squares (Eqs. 42-54, 95-101).

The rows V_0, V_1, ..., V_r of the row factor (V_k = C A^k in the time domain) obey V_r = R [V_0; ...; V_{r-1}], and R is the last block row
of the companion matrix in the basis of the shift. Minimum-norm R = P_r (E P)# uses all columns of the null space and needs none of
them; an arbitrary choice of as many columns as outputs would give extraneous poles anywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg as sla

from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.factor import Factors, factorize
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.matrices.matrix import DataMatrix, RowShift
from modalscope.identification.matrices.triple import Eigen, Triple
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.realization import Realization, Sides
from modalscope.identification.realizations.shift import check_blocks, shift_grams
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.operators import times_real

if TYPE_CHECKING:
    from modalscope.identification.matrices.fraction import Fraction


@dataclass(frozen=True, eq=False)
class ReciprocalTriple(Triple):
    """A controllable companion whose eigenvalues are mu = 1 / z and whose left eigenvectors are [mu^(p-1) w', ..., w']."""

    def eigen(self) -> Eigen:
        """Return the stable roots z and left eigenvectors; right ones are not needed, and zero.

        Unstable roots are what no mode explains (see `denominator`) and do not take part.
        """
        reciprocal, vectors = np.linalg.eig(self.A.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.where(reciprocal == 0, np.inf, 1 / reciprocal)
        stable = np.flatnonzero((np.abs(z) < 1) & (z != 0))
        left = vectors[:, stable].T.astype(complex)
        return Eigen(z[stable], np.zeros_like(left.T), left)


@dataclass(frozen=True, eq=False, kw_only=True)
class FractionCompanion(Realization):
    """Controllable companion form on Gram blocks: the order is the degree of the polynomial.

    The matrix has the roots' inverses mu = 1 / z as eigenvalues, from mu^p w' = - sum_j mu^(p-j) w' A_j, and the rows
    [mu^(p-1) w', ..., w'] as left eigenvectors: their last m entries are the participation w'.
    Shapes and residuals come from least squares over the lines.
    """

    matrix: Fraction

    def triple(self, n: int) -> ReciprocalTriple:
        """Return the companion of degree n."""
        if not 1 <= n <= self.matrix.degree:
            raise DataError(
                f"order={n} of a matrix fraction was asked",
                f"its order is the degree of the polynomials, here 1 to {self.matrix.degree}",
                "Ask for a larger order when the fraction is built.",
            )
        m = self.matrix.inputs
        size = n * m
        A = np.zeros((size, size))
        A[:, :m] = -self.matrix.denominator(n)
        A[: size - m, m:] = np.eye(size - m)
        return ReciprocalTriple(A, None, np.zeros((0, size)), size)

    def sides(self, n: int, eigen: Eigen) -> Sides:
        """Return y z^2 / (y x) and r, the first block of the right eigenvector x: dmu = -y dA r / (y x), z = 1 / mu.

        r spans the null space of I + sum_j z^j A_j; the other blocks follow from the last, x_i = z (x_(i+1) - A_i r).
        """
        m, z = self.matrix.inputs, eigen.values
        A = self.matrix.denominator(n).reshape(n, m, m)
        powers = z[:, None] ** np.arange(1, n + 1)
        polynomial = np.eye(m) + np.einsum("kj,jab->kab", powers, A, optimize=True)
        r = np.linalg.svd(polynomial)[2][:, -1].conj()  # (k, m)
        x = np.empty((z.size, n, m), dtype=complex)
        following = np.zeros((z.size, m), dtype=complex)
        for i in range(n - 1, -1, -1):
            following = z[:, None] * (following - r @ A[i].T)
            x[:, i] = following
        scale = z**2 / np.sum(eigen.left * x.reshape(z.size, -1), axis=1)
        return Sides(scale[:, None] * eigen.left, r.T)

    def pairs(self, sides: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
        """Return both as they are, of one order."""
        return (sides,)


def fraction_companion(matrix: Fraction, factors: Factors) -> FractionCompanion:
    """Return the companion forms of every degree.

    `factors`: of the normal equations: for the singular values, the companion needs the Gram blocks alone.
    """
    return FractionCompanion(factors=factors, matrix=matrix)


def companion_matrix(last: Array, shift: RowShift, degree: int) -> RealArray:
    """Return the block companion matrix whose last block row expresses V_degree = `last` [V_0; ...; V_(degree-1)].

    Plain shifts give zeros, identities and `last` (Eqs. 53a, 54a with the sign of V_r = R V); a polynomial basis gives its
    recurrence, h' (x) I, with h[degree, degree - 1] `last` added to the last block row.
    """
    block = shift.block
    size = block * degree
    if shift.recurrence is None:
        A = np.eye(size, k=block)
        A[size - block :] = last
        return A
    h = shift.recurrence
    combined = np.asarray(np.kron(h[:degree, :degree].T, np.eye(block)))
    combined[size - block :] += h[degree, degree - 1] * last
    return combined


def _input(matrix: DataMatrix) -> RealArray | None:
    """B = [Y(0); ...; Y(r-1)], the first block column of the data matrix, unweighted; None where columns are lines."""
    column = matrix.first_block_column(tall=True)
    if column is None:
        return None
    return matrix.row_shift.split(column)[0]


def _output(matrix: DataMatrix, factors: Factors, block: int, states: Array) -> RealArray:
    """C [T_0 V_0; T_0 V_1; ...] = V_0: by the first block where it holds all outputs, else by regression on all blocks.

    `states` is the row factor of the companion's states with Q' the column factor of both.
    """
    outputs = matrix.outputs
    head = np.asarray(matrix.first_block(np.eye(outputs)))
    if np.linalg.matrix_rank(head) == outputs:
        return np.hstack([np.linalg.pinv(head), np.zeros((outputs, states.shape[0] - block))])
    k = states.shape[1]
    Q = factors.Q if factors.Q.size else matrix.tall().transposed_times(factors.P[:, :k]) / factors.d[:k]
    rows = matrix.first_rows(np.ascontiguousarray(Q[:, :k]))
    return np.asarray(np.linalg.lstsq(states.T, rows.T, rcond=None)[0].T)


def _shift_of_whole_blocks(matrix: DataMatrix) -> RowShift:
    shift = matrix.row_shift
    if not shift.whole:
        raise DataError(
            "a companion form was asked",
            "its block rows are not whole: channels were left out of some",
            "Leave these channels out altogether with select(), or use method='alternate', 'era' or 'least_squares'.",
        )
    return shift


@dataclass(frozen=True, eq=False, kw_only=True)
class NullSpaceCompanion(Realization):
    """Observable canonical form: models with l r poles at any rank n; the l r - n that the truncation does not explain are extraneous.

    `gram` (k, k): (E P)'(E P). `P` (l (r + 1), k): the left factor without weights. `B` (l r, m): the first block column.
    """

    shift: RowShift
    gram: RealArray
    P: RealArray
    B: RealArray | None

    def triple(self, n: int) -> Triple:
        """Return the companion matrix whose last block row is P_r (E P_n)#."""
        self.factors.check_order(n)
        block, r = self.shift.block, self.matrix.block_rows
        if block * r < n:
            raise DataError(
                f"order={n} in canonical form was asked",
                f"{r} block rows of {block} channels carry {block * r} states",
                "Raise block_rows (block_columns in the controllable form).",
            )
        check_blocks(self.gram, n, r)
        before, last = self.P[: block * r, :n], self.P[block * r :, :n]
        R = last @ sla.solve(self.gram[:n, :n], before.T, assume_a="pos", check_finite=False)
        C = _output(self.matrix, self.factors, block, before * self.factors.d[:n])
        span = np.linalg.qr(before)[0] if n < block * r else None
        return Triple(companion_matrix(R, self.shift, r), self.B, C, n, span=span)

    def sides(self, n: int, eigen: Eigen) -> Sides:
        """Return F = y, whose states are the block rows, and v = Q d^-1 (E0 P)# x."""
        before = self.P[: self.shift.block * self.matrix.block_rows, :n]
        inner = sla.solve(self.gram[:n, :n], times_real(eigen.vectors.T, before).T, assume_a="pos", check_finite=False)
        return Sides(eigen.left, np.asarray(inner / self.factors.d[:n, None], dtype=complex))

    def pairs(self, sides: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
        """Return the rows as they are."""
        left = self.matrix.pencil(sides.left, values, tall=True)
        return ((left, self.matrix.right_vectors(self.factors, sides.right)),)

    def reduced(self, how: str) -> Realization:
        """Return models of minimum order; see `modalscope.identification.realizations.companion`."""
        return reduced(self, how)


def null_space_companion(matrix: DataMatrix, factors: Factors) -> NullSpaceCompanion:
    """Observable canonical form: last block row P_r (E P_n)#, which is -[X_0 ... X_(r-1)] of Eqs. 52-54 from all columns, minimum norm.

    `factors`: of the matrix with one block row more, the largest rank.
    """
    shift = _shift_of_whole_blocks(matrix)
    gram, _ = shift_grams(matrix, factors)
    P = shift.unweighted(factors.P)
    return NullSpaceCompanion(factors=factors, matrix=matrix, shift=shift, gram=gram, P=P, B=_input(matrix))


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastSquaresCompanion(Realization):
    """Least-squares companion forms of every degree p, of p blocks.

    `stand_in` (l (r + 1), k): P diag(d) without weights: it differs from the matrix by orthonormal columns only. `B` (l r, m): the first
    block column.
    """

    shift: RowShift
    stand_in: RealArray
    B: RealArray | None

    @cached_property
    def _triangle(self) -> RealArray:
        return np.asarray(sla.qr(self.stand_in.T, mode="r", check_finite=False)[0].T)

    def triple(self, n: int) -> Triple:
        """Return the companion matrix of n / block blocks."""
        block, r = self.shift.block, self.matrix.block_rows
        p, rest = divmod(n, block)
        if rest or not 1 <= p <= r:
            raise DataError(
                f"order={n} of a least-squares companion was asked",
                f"the order must be a multiple of {block}, at most {block * r} with {r} blocks",
                "Choose such an order, or raise block_rows (block_columns in the controllable form).",
            )
        R = self._last_block_row(n)
        C = _output(self.matrix, self.factors, block, self.stand_in[:n])
        B = None if self.B is None else self.B[:n]
        return Triple(companion_matrix(R, self.shift, p), B, C, min(n, self.factors.rank))

    def sides(self, n: int, eigen: Eigen) -> Sides:
        """Return y and (H H')^-1 x."""
        L = self._triangle[:n, :n]
        if L.shape[1] < n:  # more rows than columns: the regression is of minimum norm
            return super().sides(n, eigen)
        half = sla.solve_triangular(L, eigen.vectors, lower=True, check_finite=False)
        return Sides(eigen.left, sla.solve_triangular(L, half, lower=True, trans="T", check_finite=False))

    def pairs(self, sides: Sides, values: ComplexArray) -> tuple[tuple[Any, Any], ...]:
        """Return F = y with v = H' (H H')^-1 x, and what follows from the rest of the regression, changed rows times what they leave.

        With R = H_p H' (H H')^-1 and E = H_p - R H the change is dR = [(dH_p - R dH) H' + E dH'] (H H')^-1.
        """
        (k, n), block = sides.left.shape, self.shift.block
        left, weights = np.zeros((2, k, self.stand_in.shape[0]), dtype=complex)
        left[:, block : n + block] = sides.left
        left[:, :n] -= values[:, None] * sides.left
        weights[:, :n] = sides.right.T
        columns = self._columns(np.vstack([weights, left]))
        return ((left, columns[:, :k]), (weights, columns[:, k:]))

    def _columns(self, left: Array) -> ComplexArray:
        """Return H' X' of the rows without weights, (columns, k)."""
        rows = (left if self.shift.weight is None else left / self.shift.weight).T
        both = self.matrix.tall().transposed_times(np.ascontiguousarray(rows).view(np.float64))
        return np.ascontiguousarray(both.T[::2] + 1j * both.T[1::2]).T  # a vector lies in one piece

    def _last_block_row(self, n: int) -> RealArray:
        """Return L[p, :p] L[:p, :p]^-1; where these blocks have lost rank the minimum-norm one, if they give the next at all."""
        block, L = self.shift.block, self._triangle
        rcond = max(self.stand_in.shape) * np.finfo(float).eps
        factor, target = L[:n, :n], L[n : n + block, :n]
        pivots = np.abs(np.diag(factor))
        if n <= L.shape[1] and pivots.min() > np.sqrt(rcond) * pivots.max():
            return sla.solve_triangular(factor, target.T, lower=True, trans="T", check_finite=False).T
        R = np.linalg.lstsq(factor.T, target.T, rcond=rcond)[0].T
        share = np.linalg.norm(L[n : n + block] - R @ L[:n]) / max(
            np.linalg.norm(L[n : n + block]), np.finfo(float).tiny
        )
        if share > np.sqrt(rcond):
            raise DataError(
                f"a least-squares companion of {n // block} blocks was asked",
                f"they are singular and leave {100 * share:.2g} % of the next one: fewer than the observability index",
                "Raise the order by a block or more.",
            )
        return np.asarray(R)


def least_squares_companion(matrix: DataMatrix, factors: Factors) -> LeastSquaresCompanion:
    """Least-squares form without truncation: the last block row H_p [H_0; ...; H_(p-1)]#, every degree p from one factorization.

    The regression of Eq. 65 without truncation, and with the roles of inputs and outputs exchanged the polyreference complex
    exponential (PRCE; LSCE with one input). The order is the number of states, p times the size of a block. With H = L Q' and L
    lower triangular the degrees are nested: the last block row is L[p, :p] L[:p, :p]^-1, whatever follows. Where L[:p, :p] has
    lost rank (no noise, or more rows than columns) the minimum-norm solution takes its place.

    `factors`: of the matrix with one block row more, complete.
    """
    shift = _shift_of_whole_blocks(matrix)
    stand_in = shift.unweighted(factors.P * factors.d)
    return LeastSquaresCompanion(factors=factors, matrix=matrix, shift=shift, stand_in=stand_in, B=_input(matrix))


#: By projection on the factor's own states, by ERA on the model's Markov parameters, by the sign of time.
REDUCTIONS = ("projection", "markov", "reversed")


@dataclass(frozen=True, eq=False, kw_only=True)
class Reduced(Realization):
    """Models of minimum order from a canonical form.

    `way`: (companion, order) -> model.
    """

    companion: NullSpaceCompanion
    way: Callable[[NullSpaceCompanion, int], Triple]

    def triple(self, n: int) -> Triple:
        """Return the model of n states; by "reversed" of as many as lie outside the circle."""
        return self.way(self.companion, n)


def reduced(companion: NullSpaceCompanion, how: str) -> Reduced:
    """Return models of minimum order from a canonical form.

    `companion`: the canonical form of the null space, of samples. `how`: "projection": (E P)# A~ (E P), which is the alternate method.
    "markov": ERA on C~ A~^k B~, the model's own Markov parameters. "reversed": data that run backward grow, so that a mode's pole becomes
    1 / z outside the unit circle while the minimum-norm extraneous poles stay inside; the invariant subspace of those outside is the
    model. Without noise exact; a mode that does not decay is not told apart.
    """
    ways = {"projection": _projected, "markov": _from_markov, "reversed": _from_reversal}
    way = ways[check_choice("reduction", how, REDUCTIONS)]
    notes = (*companion.notes, f"reduced to minimum order: {how}")
    return Reduced(factors=companion.factors, matrix=companion.matrix, notes=notes, companion=companion, way=way)


def _projected(companion: NullSpaceCompanion, n: int) -> Triple:
    model = companion.triple(n)
    if model.span is None or model.B is None:
        return model
    Z = model.span
    return Triple(Z.T @ model.A @ Z, Z.T @ model.B, model.C @ Z, n)


def _from_markov(companion: NullSpaceCompanion, n: int) -> Triple:
    model = companion.triple(n)
    assert model.B is not None
    sampled = StateSpace(A=model.A, B=model.B, C=model.C, dt=1.0)
    rows, columns = companion.matrix.block_rows, len(companion.factors.Q) // model.B.shape[1]
    markov = hankel(sampled.impulse_response(rows + columns), block_rows=rows, block_columns=columns)
    return balanced(markov, factorize(markov.shifted(0), n)).triple(n)


def reversed_companion(companion: NullSpaceCompanion, n: int) -> RealArray:
    """Return the companion matrix of the same null space with time reversed: V_0 = R [V_r; ...; V_1], minimum norm."""
    companion.factors.check_order(n)
    shift, r = companion.shift, companion.matrix.block_rows
    P = companion.P[:, :n]
    backward = P.reshape(r + 1, shift.block, n)[::-1].reshape(P.shape)
    columns, target = backward[: shift.block * r], backward[shift.block * r :]
    return companion_matrix(target @ np.linalg.pinv(columns), shift, r)


def _from_reversal(companion: NullSpaceCompanion, n: int) -> Triple:
    backward = reversed_companion(companion, n)
    T, Z, k = sla.schur(backward, output="real", sort="ouc")
    if k == 0:
        raise DataError(
            f"order={n}, reduction='reversed' was asked", "no reversed pole grows", "Use reduction='projection'."
        )
    # [I, X] takes the part of a state that lies in the growing subspace along the decaying one
    X = sla.solve_sylvester(T[:k, :k], -T[k:, k:], T[:k, k:])
    matrix, shift = companion.matrix, companion.shift
    column = np.asarray(matrix.first_block_column(tall=True))
    column = shift.unweighted(column).reshape(-1, shift.block, column.shape[1])[:0:-1].reshape(-1, column.shape[1])
    # the state [V_r; ...; V_1] belongs to one sample later than V_0, and the model runs against it
    inverse = np.asarray(np.linalg.inv(T[:k, :k]), dtype=float)
    state = Z[:, :k].T @ column + X @ (Z[:, k:].T @ column)
    head = np.linalg.pinv(np.asarray(matrix.first_block(np.eye(matrix.outputs))))
    return Triple(inverse, state, head @ Z[-shift.block :, :k] @ T[:k, :k], k)
