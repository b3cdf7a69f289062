"""Sensitivity of the poles of a matrix fraction to the response and to white noise, by sums over few points of the arc of the lines.

With X_o the weighted lines of output o times powers of z, P the projection on the complement of the numerators and r_o = P X_o A the
residual of the equation,

    dA = -M_in^-1 sum_o [X_o' P dX_o A + dX_o' r_o].

The second term is as large as the first: without it standard deviations are 15 to 60 % wrong at 40 dB. The scale of an output is taken as
given. The gradient of a pole on a line is a = sum_q H_oq* K_qi + B_oi and its mirror image b = sum_q H_oq K_iq + B~_oi, with polynomials

    K_qi = r_q(1/z) c_i(z) + c_q(1/z) r_i(z),   B_oi = n_o(1/z) c_i(z) + e_o(1/z) r_i(z),   B~_oi = n_o(z) c_i(1/z) + e_o(z) r_i(1/z),

r the row, c = A times the column, n and e their numerators. E|dp|^2 = sum V (|a|^2 + |b|^2) and E dp^2 = 2 sum V a b, in which only 1, H
and H* H are rough on the lines: see `modalscope.identification.fast.few_points`. No array of lines times outputs times poles is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.identification.fast.few_points import Arc, arc_of, moments_on, nodes_needed, weights_at
from modalscope.identification.fast.normal_equations import NormalEquations
from modalscope.identification.matrices.influence import LineInfluence, Lines, Moments, Outer
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, freeze
from modalscope.numerics.functions.poles import powers_of
from modalscope.numerics.functions.polynomials import both_sums
from modalscope.numerics.operators import times_real


class Weights(NamedTuple):
    """Sums over the lines as weights at s points of the arc, times the variance of output o and input i.

    `plain` (s, l, m): of 1. `linear` (s, l, m, m): of H_oq, by q and i. `squared` (s, m, m, m): of sum_o H_oq* H_op, by q, p and i.
    """

    plain: RealArray
    linear: ComplexArray
    squared: ComplexArray


@dataclass(frozen=True, eq=False)
class LineSums:
    """Moments of what is rough on the lines of a matrix fraction: 1, H and H* H, with the weights of the lines."""

    matrix: NormalEquations

    @cached_property
    def arc(self) -> Arc:
        """That the lines lie on."""
        return arc_of(self.matrix.angles)

    def nodes(self, degree: int) -> int:
        """Return how many points serve polynomials of a degree: products of two of K and B have twice that."""
        return nodes_needed(self.arc, 2 * degree)

    @cached_property
    def _lines(self) -> tuple[RealArray, ComplexArray, ComplexArray]:
        """Return 1 (F, 1), H (F, l, m) and H_oq* H_op (F, l, m, m), the second power of the gradient's weights on them."""
        matrix = self.matrix
        w = np.full(matrix.angles.size, 0.25) if matrix.weights is None else matrix.weights**4 / 4
        H = matrix.response.values / matrix.output_scale[:, None]
        weighted = w[:, None, None] * H
        return w[:, None], weighted, np.einsum("foq,fop->foqp", H.conj(), weighted)

    def _moments(self, *values: Array) -> tuple[Array, ...]:
        """Return moments of values of the lines, (F, ...) -> (count, ...) each."""
        real = np.concatenate([_real(part) for part in values], axis=1)
        moments = moments_on(self.arc, self.matrix.angles, real, self.nodes(self.matrix.degree))
        parts = np.split(moments, np.cumsum([_real(part[:1]).size for part in values])[:-1], axis=1)
        return tuple(_like(part, of) for part, of in zip(parts, values, strict=True))

    @cached_property
    def _common(self) -> tuple[Array, ...]:
        return self._moments(*self._lines)

    def weights(self, variance: RealArray, count: int) -> Weights:
        """Return the weights of `count` points under noise of a variance, (l, m) or (F, l, m), outputs as they were measured."""
        scaled = variance / self.matrix.output_scale[:, None] ** 2
        if variance.ndim == 3:
            return self._by_lines(variance, scaled, count)
        one, H, squared = (found[:count] for found in self._common)
        total = np.tensordot(squared, scaled, axes=(1, 0))
        linear = np.asarray(_at(H)[..., None] * scaled[:, None, :], dtype=complex)
        return Weights(_at(one)[:, :, None] * scaled, linear, _at(total))

    def _by_lines(self, variance: RealArray, own: RealArray, count: int) -> Weights:
        """Return the weights under noise that differs from line to line: moments of that noise, which all degrees share."""
        kept = self._kept[0] if self._kept else None
        if kept is None or kept.variance is not variance:
            one, H, squared = self._lines
            total = np.einsum("foqp,foi->fqpi", squared, own)
            kept = _Kept(variance, self._moments(one[:, :, None] * own, H[..., None] * own[:, :, None, :], total))
            self._kept[:] = [kept]
        one, H, squared = (_at(found[:count]) for found in kept.moments)
        return Weights(one, H, squared)

    @cached_property
    def _kept(self) -> list[_Kept]:
        return []


class _Kept(NamedTuple):
    """Noise that differs from line to line, and its moments, stored at once: threads find both or neither."""

    variance: RealArray
    moments: tuple[Array, ...]


def _real(values: Array) -> RealArray:
    """Return numbers of any kind and shape as real columns, (n, ...) -> (n, c)."""
    return np.ascontiguousarray(values).view(float).reshape(len(values), -1)


def _like(columns: RealArray, of: Array) -> Array:
    """Return real columns as numbers of the kind and shape of others."""
    return np.ascontiguousarray(columns).view(of.dtype).reshape(len(columns), *of.shape[1:])


def _at(moments: Array) -> Array:
    """Return the weights of as many points as there are moments, (s, ...) of the same kind."""
    return _like(weights_at(_real(moments)), moments)


def moments_of_noise(influence: FractionInfluence, variance: RealArray, count: int) -> tuple[Moments, RealArray]:
    """Return the moments of poles, and the size of the terms that E|dp|^2 is the sum of.

    `variance` (l, m). `count`: points.
    """
    matrix, r = influence.sums.matrix, influence.right
    weights = influence.sums.weights(variance, count)
    degree = influence.rows.shape[1] - 1
    z = powers_of(np.exp(1j * influence.sums.arc.angles(count)), degree + 1).T
    # real columns: the rows' real parts, their imaginary parts, and A
    columns = np.concatenate([influence.rows.real, influence.rows.imag, influence.denominator.transpose(2, 0, 1)])
    numerator, denominator = _numerators(matrix, columns, z), np.tensordot(z, columns, axes=(1, 1))
    poles = len(r)
    row = _Both.of(denominator[:, : 2 * poles])
    A = denominator[:, 2 * poles :]  # (s, m, m), by column and row; at 1 / z its conjugate
    column = _Both(*(np.einsum("sji,kj->ski", part, r) for part in (A, A.conj())))
    numerators = _Products(_Both.of(numerator[:, : 2 * poles]), numerator[:, 2 * poles :], r, weights)
    K = row.back[..., :, None] * column.at[..., None, :] + column.back[..., :, None] * row.at[..., None, :]
    size, square = _of_data(K, weights)
    cross, mixed = numerators.with_data(K, row, column)
    last, both = numerators.alone(row, column)
    return Moments(size + cross + last, 2 * (square + mixed + both)), size + np.abs(cross) + np.abs(last)


class _Both(NamedTuple):
    """Values of polynomials at z and at 1 / z, (s, k, ...)."""

    at: ComplexArray
    back: ComplexArray

    @staticmethod
    def of(values: ComplexArray) -> _Both:
        """Return those of complex coefficients from the values of their real and of their imaginary parts at z."""
        real, imaginary = np.split(values, 2, axis=1)
        return _Both(real + 1j * imaginary, real.conj() + 1j * imaginary.conj())


def _numerators(matrix: NormalEquations, columns: RealArray, z: ComplexArray) -> ComplexArray:
    """Return the numerators of real columns (c, p + 1, m) at points, (s, c, l)."""
    count, outputs = columns.shape[1], matrix.outputs
    U, L = matrix.gram_blocks[1][:count], matrix.lower_triangle[:count, :count]
    of_degree = U.reshape(count * outputs, -1)[:, : columns[0].size]  # a view, whatever the degree
    numerators = (of_degree @ columns.reshape(len(columns), -1).T).reshape(count, outputs, -1)
    explained = numerators.transpose(0, 2, 1).reshape(count, -1)
    beta = sla.solve_triangular(L, explained, lower=True, trans="T", check_finite=False)
    return times_real(z, beta).reshape(len(z), -1, outputs)


def _of_data(K: ComplexArray, weights: Weights) -> tuple[RealArray, ComplexArray]:
    """Return sum_s of |H* K|^2 + |H K'|^2 and of (H* K) (H K')."""
    by_rows = np.einsum("sqpi,skpi->skqi", weights.squared, K.conj())
    by_columns = np.einsum("sqpi,skip->skqi", weights.squared, K)  # K' in place of K
    size = np.einsum("skqi,skqi->k", by_rows, K) + np.einsum("skqi,skiq->k", by_columns, K.conj())
    return size.real, np.asarray(np.einsum("skqi,skqi->k", by_columns, K))


class _Products:
    """Sums over the outputs of products of numerators, n of the rows, e of the columns of A, with each other and with the data.

    `n`: (s, k, l). `e` (s, m, l): at z; at 1 / z the conjugates. `r` (k, m): what A is multiplied by.
    """

    def __init__(self, n: _Both, e: ComplexArray, r: ComplexArray, weights: Weights) -> None:
        points, m, outputs = e.shape
        weighted = e.transpose(0, 2, 1)[..., None] * weights.plain[:, :, None, :]  # by o, j, i
        stacked = np.concatenate([weighted, weights.linear], axis=2).reshape(points, outputs, 2 * m * m)
        shape = (points, -1, 2 * m, m)
        self._r, self._n, self._plain = r, n, weights.plain
        at, back = (n.at @ stacked.conj()).reshape(shape), (n.back @ stacked).reshape(shape)
        self._linear = _Both(at[:, :, m:], back[:, :, m:])  # n at z with H*, at 1 / z with H, by q and i
        self._mixed = _Both(at[:, :, :m], back[:, :, :m])  # n(z) e_j(1/z) and n(1/z) e_j(z), by j and i
        of_e = (e.conj() @ stacked).reshape(points, m, 2 * m, m)
        self._of_e, self._with_e = of_e[:, :, :m], of_e[:, :, m:]  # e_j(1/z) e_h(z), by j, h and i; e_j(1/z) with H

    def with_data(self, K: ComplexArray, row: _Both, column: _Both) -> tuple[RealArray, ComplexArray]:
        """Return sum_s of 2 Re (H* K) B* + 2 Re (H K') B~* and of (H* K) B~ + (H K') B."""
        own, turned = (np.einsum("kj,sjqi->skqi", self._r, part) for part in (self._with_e, self._with_e.conj()))
        B = self._linear.back * column.at[..., None, :] + own * row.at[..., None, :]
        mirrored = self._linear.at * column.back[..., None, :] + turned * row.back[..., None, :]
        size = np.einsum("skqi,skqi->k", K.conj(), B) + np.einsum("skiq,skqi->k", K.conj(), mirrored)
        return 2 * size.real, np.einsum("skqi,skqi->k", K, mirrored) + np.einsum("skiq,skqi->k", K, B)

    def alone(self, row: _Both, column: _Both) -> tuple[RealArray, ComplexArray]:
        """Return sum_s of |B|^2 + |B~|^2 and of B B~."""
        r, n, of_e = self._r, self._n, self._of_e
        above, below, across = (product @ self._plain for product in (_squares(n.at), _squares(n.back), n.at * n.back))
        with_e, with_back = np.einsum("kh,sjhi->skji", r, of_e), np.einsum("kj,sjhi->skhi", r, of_e)
        at, pair, back = _led(r.conj(), with_e).real, _led(r, with_e), _led(r.conj(), with_back).real
        with_at, with_back = (_led(r, part) for part in (self._mixed.back, self._mixed.at))
        against = [_led(r.conj(), part) for part in (self._mixed.back, self._mixed.at)]
        size = (
            below * _squares(column.at)
            + back * _squares(row.at)
            + above * _squares(column.back)
            + at * _squares(row.back)
        )
        size += 2 * (against[0] * column.at * row.at.conj() + against[1] * column.back * row.back.conj()).real
        square = across * column.at * column.back + pair * row.at * row.back
        square += with_at * column.at * row.back + with_back * row.at * column.back
        return size.sum(axis=(0, 2)), square.sum(axis=(0, 2))


def _led(r: ComplexArray, values: ComplexArray) -> ComplexArray:
    """Return sum_j r_kj values_skji, (s, k, i)."""
    return np.asarray(np.einsum("kj,skji->ski", r, values))


def _squares(values: ComplexArray) -> RealArray:
    return np.asarray(values.real**2 + values.imag**2)


#: Minimum number of lines per point of the arc for few points to be faster.
_LINES_PER_POINT = 2


#: A sum by few points below this fraction of its terms is rounding.
_MIN_SHARE_OF_TERMS = 1e-7


Pair = tuple[ComplexArray, ComplexArray]


class FractionInfluence(LineInfluence):
    """The gradient of eigenvalues of a matrix fraction.

    `rows` (k, p + 1, m): coefficients of the row by which X is multiplied. `right` (k, m): what A is multiplied by. `lines`: those that
    stand for all where lines are needed.
    """

    def __init__(self, sums: LineSums, rows: ComplexArray, right: ComplexArray, lines: Lines) -> None:
        freeze(self, sums=sums, rows=rows, right=right, lines=lines)

    sums: LineSums
    rows: ComplexArray
    right: ComplexArray

    @property
    def direct(self) -> tuple[Outer, ...]:
        """A on every line."""
        return self._on_lines[0]

    @property
    def mirrored(self) -> tuple[Outer, ...]:
        """B on every line."""
        return self._on_lines[1]

    @cached_property
    def _on_lines(self) -> tuple[tuple[Outer, ...], tuple[Outer, ...]]:
        of_row, row = _projected(self.sums.matrix, self.rows, self.lines.used)
        column = np.einsum("bqi,ki->kbq", self.denominator, self.right, optimize=True)
        misfit, model = _projected(self.sums.matrix, column, self.lines.used)
        return (
            (Outer(of_row[1], model[0]), Outer(misfit[1], row[0])),
            (Outer(of_row[0], model[1]), Outer(misfit[0], row[1])),
        )

    @cached_property
    def denominator(self) -> RealArray:
        """A_0, ..., A_p, (p + 1, m, m)."""
        m, degree = self.sums.matrix.inputs, self.rows.shape[1] - 1
        return np.vstack([np.eye(m), self.sums.matrix.denominator(degree)]).reshape(-1, m, m)

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; those of these poles alone by few points of the arc, where that is less."""
        degree = self.rows.shape[1] - 1
        count = self.sums.nodes(degree)
        if fading is not None or other is not self or _LINES_PER_POINT * count > self.lines.used.size:
            return super().joint(other, variance, fading)
        moments, terms = moments_of_noise(self, variance, count)
        lost = np.flatnonzero(~(moments.size > _MIN_SHARE_OF_TERMS * terms))
        if not lost.size:
            return moments
        part = self.take(lost)
        again = LineInfluence(part.direct, part.mirrored, part.lines)
        exact = again.joint(again, variance)
        size, square = moments.size.copy(), moments.square.copy()
        size[lost], square[lost] = np.real(exact.size), exact.square
        return Moments(size, square)

    def take(self, index: Array) -> FractionInfluence:
        """Return the gradients of some poles."""
        return FractionInfluence(self.sums, self.rows[index], self.right[index], self.lines)


def _projected(matrix: NormalEquations, c: ComplexArray, lines: IntArray) -> tuple[Pair, Pair]:
    """Return P X c, the residual of X c, weighted and halved (k, F, l), and sum_j c_j z^j (k, F, m), each at z and at 1 / z."""
    count = c.shape[1]
    z = np.exp(1j * np.outer(matrix.angles[lines], np.arange(count)))
    U, L = matrix.gram_blocks[1][:count, :, :count], matrix.lower_triangle[:count, :count]
    explained = np.einsum("aobi,kbi->aok", U, c, optimize=True)
    beta = sla.solve_triangular(L, explained.reshape(count, -1), lower=True, trans="T", check_finite=False)
    at, mirrored = both_sums(z, c)
    numerators = both_sums(z, beta.reshape(explained.shape).transpose(2, 0, 1))
    H = (matrix.response.values[lines] / matrix.output_scale[:, None]).transpose(0, 2, 1)
    w = 0.5 if matrix.weights is None else matrix.weights[lines, None] ** 2 / 2
    above, below = (
        ((values.transpose(1, 0, 2) @ response).transpose(1, 0, 2) + numerator) * w / matrix.output_scale
        for values, response, numerator in ((at, H, numerators[0]), (mirrored, H.conj(), numerators[1]))
    )
    return (above, below), (at, mirrored)
