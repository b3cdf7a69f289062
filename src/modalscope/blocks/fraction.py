"""Normal equations of the right matrix fraction H(z) = B(z) A(z)^-1: LSCF, known as PolyMAX.

With real coefficients A_0, ..., A_p (m x m) and beta_0, ..., beta_p (one row an output) the error of output o is
sum_j z^j beta_oj - H_o sum_j z^j A_j on the lines. Its normal equations have Toeplitz blocks: each entry depends on the difference of two
powers only and is one value of a Fourier transform over the lines. The numerators are eliminated,

    M = sum_o (T_o - S_o' R^-1 S_o),

and with R = L L' the leading blocks of M for every degree, each with numerators of its own degree, follow from the rows of L^-1 S_o.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike
from scipy import fft
from scipy.special import jv

from modalscope.blocks.factor import Factors
from modalscope.blocks.influence import LineInfluence, Lines, Moments, Outer, all_lines
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.polynomials import both_sums
from modalscope.blocks.triple import Eigen, Misfit, ModalFit, Triple
from modalscope.data.response import Response, output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.data.statespace import StateSpace
from modalscope.functions.poles import powers_of, to_continuous, to_discrete
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, check_count, freeze
from modalscope.numerics.errors import DataError

# ----------------------------------------------------------------------------------------------------- fraction degree
# Where the lines of a band lie on the unit circle, and the degree up to which they tell powers of z apart.

#: A band that starts above this share of its end is shifted to zero, so that its lines fill the half circle.
_SHIFTED_FROM = 0.3

#: The least eigenvalue of a Gram matrix that still has a triangular factor, of one with ones on its diagonal.
_ROUNDING = 1e-13


def half_circle(response: Response) -> tuple[float, float]:
    """Return the frequencies that lie at z = 1 and z = -1, Hz."""
    (low, high), rate = response.span, response.sampling_rate
    if rate is not None:
        return 0.0, rate / 2
    return (0.0 if low < _SHIFTED_FROM * high else low), high


def largest_degree(response: Response) -> int:
    """Return the degree up to which powers of z are told apart by the lines of a band.

    Of p + 1 powers on a circle with a gap from -theta to theta the least eigenvalue of the Gram matrix falls like exp(-c p),
    c = ln(1 + 2 sqrt(a) / (sqrt 2 - sqrt a)), a = 1 - cos theta; it has to stay above rounding.
    """
    (first, last), (low, high) = response.span, half_circle(response)
    gap = np.pi * max(first - low, high - last, 0.0) / (high - low)
    a = np.sqrt(min(1 - np.cos(gap), 2 - 1e-9))
    falls = np.log1p(2 * a / (np.sqrt(2) - a))
    return int(min(np.log(1 / _ROUNDING) / max(falls, 1e-6), 1e6))


# ----------------------------------------------------------------------------------------------------------- arc nodes
# Sums over the lines of an arc of the unit circle, of given weights times trigonometric polynomials, at as few points as these need.
#
# On an arc of half width h a polynomial of degree D in z and 1 / z is a smooth function of the angle, whose Chebyshev coefficients fall off
# beyond D h like Bessel functions: its values at q Chebyshev points, q a little above D h, say all of it. A sum over lines of weights times
# it is a sum over these points of other weights, which follow from the first q moments of the weights, those that serve all degrees.

#: Chebyshev coefficients below this share of the polynomial's size are rounding.
_SMALL = 1e-16

#: Lines whose moments are gathered at a time.
_LINES = 2048


class Arc(NamedTuple):
    """An arc of the unit circle: its middle and half its width, rad."""

    middle: float
    half: float

    def angles(self, count: int) -> RealArray:
        """Return the Chebyshev points, from the upper end down, (count,)."""
        return np.asarray(self.middle + self.half * np.cos(np.pi * (np.arange(count) + 0.5) / count))


def arc_of(angles: RealArray) -> Arc:
    """Return the arc that angles lie on."""
    low, high = float(angles.min()), float(angles.max())
    return Arc((low + high) / 2, (high - low) / 2)


@lru_cache(maxsize=1024)
def nodes_needed(arc: Arc, degree: int) -> int:
    """Return how many Chebyshev points say a polynomial of z and 1 / z of a degree to rounding.

    The coefficients of exp(j D h x) are 2 j^r J_r(D h).

    Source: L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, chapters 3 and 4.

    Examples
    --------
    >>> nodes_needed(Arc(1.0, 1.0), 100)
    153
    """
    reach = degree * arc.half
    orders = np.arange(int(reach), int(2 * reach) + 40)
    return int(orders[np.argmax(np.abs(jv(orders, reach)) < _SMALL)]) + 1


def moments_on(arc: Arc, angles: RealArray, weights: RealArray, count: int) -> RealArray:
    """Return sum_f weights[f] T_r(x_f) of the first Chebyshev polynomials, x from -1 to 1 along the arc: (count, c).

    `angles` (F,). `weights` (F, c).
    """
    total = np.zeros((count, weights.shape[1]))
    turned = np.arccos(np.clip((angles - arc.middle) / (arc.half or 1.0), -1, 1))
    for start in range(0, angles.size, _LINES):
        some = slice(start, start + _LINES)
        total += np.cos(np.arange(count)[:, None] * turned[some]) @ weights[some]
    return total


def weights_at(moments: Array) -> RealArray:
    """Return the weights of as many Chebyshev points as there are moments: every polynomial of lower degree has its sum over the lines.

    Examples
    --------
    >>> arc, angles = Arc(1.0, 0.5), np.linspace(0.5, 1.5, 1000)
    >>> count = nodes_needed(arc, 6)
    >>> few = weights_at(moments_on(arc, angles, np.ones((1000, 1)), count))[:, 0]
    >>> bool(np.isclose(few @ np.cos(6 * arc.angles(count)), np.cos(6 * angles).sum()))
    True
    """
    return np.asarray(fft.dct(moments, type=3, axis=0) / len(moments))


# ------------------------------------------------------------------------------------------------------- fraction sums
# What white noise does to the poles of a matrix fraction, by sums over few points of the arc that its lines lie on.
#
# The gradient of a pole on a line is a = sum_q H_oq* K_qi + B_oi and its mirror image b = sum_q H_oq K_iq + B~_oi, with polynomials
#
#     K_qi = r_q(1/z) c_i(z) + c_q(1/z) r_i(z),   B_oi = n_o(1/z) c_i(z) + e_o(1/z) r_i(z),   B~_oi = n_o(z) c_i(1/z) + e_o(z) r_i(1/z),
#
# r the row, c = A times the column, n and e their numerators. E|dp|^2 = sum V (|a|^2 + |b|^2) and E dp^2 = 2 sum V a b.


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

    matrix: Fraction

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
        found = moments_on(self.arc, self.matrix.angles, real, self.nodes(self.matrix.degree))
        parts = np.split(found, np.cumsum([_real(part[:1]).size for part in values])[:-1], axis=1)
        return tuple(_like(part, of) for part, of in zip(parts, values, strict=True))

    @cached_property
    def _common(self) -> tuple[Array, ...]:
        return self._moments(*self._lines)

    def weights(self, variance: RealArray, count: int) -> Weights:
        """Return the weights of `count` points under noise of a variance, (l, m) or (F, l, m), outputs as they were measured."""
        own = variance / self.matrix.output_scale[:, None] ** 2
        if variance.ndim == 3:
            return self._by_lines(variance, own, count)
        one, H, squared = (found[:count] for found in self._common)
        total = np.tensordot(squared, own, axes=(1, 0))
        linear = np.asarray(_at(H)[..., None] * own[:, None, :], dtype=complex)
        return Weights(_at(one)[:, :, None] * own, linear, _at(total))

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
    matrix, r = influence.matrix, influence.right
    weights = matrix.sums.weights(variance, count)
    degree = influence.rows.shape[1] - 1
    z = powers_of(np.exp(1j * matrix.sums.arc.angles(count)), degree + 1).T
    # real columns: the rows' real parts, their imaginary parts, and A
    columns = np.concatenate([influence.rows.real, influence.rows.imag, influence.denominator.transpose(2, 0, 1)])
    numerator, own = _numerators(matrix, columns, z), np.tensordot(z, columns, axes=(1, 1))
    poles = len(r)
    row = _Both.of(own[:, : 2 * poles])
    A = own[:, 2 * poles :]  # (s, m, m), by column and row; at 1 / z its conjugate
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


def _numerators(matrix: Fraction, columns: RealArray, z: ComplexArray) -> ComplexArray:
    """Return the numerators of real columns (c, p + 1, m) at points, (s, c, l)."""
    count, outputs = columns.shape[1], matrix.outputs
    U, L = matrix.gram_blocks[1][:count], matrix.lower_triangle[:count, :count]
    of_degree = U.reshape(count * outputs, -1)[:, : columns[0].size]  # a view, whatever the degree
    found = (of_degree @ columns.reshape(len(columns), -1).T).reshape(count, outputs, -1)
    explained = found.transpose(0, 2, 1).reshape(count, -1)
    beta = sla.solve_triangular(L, explained, lower=True, trans="T", check_finite=False)
    values = np.empty((len(z), beta.shape[1]), dtype=complex)
    values.real, values.imag = np.ascontiguousarray(z.real) @ beta, np.ascontiguousarray(z.imag) @ beta
    return values.reshape(len(z), -1, outputs)


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
        beside = np.concatenate([weighted, weights.linear], axis=2).reshape(points, outputs, 2 * m * m)
        shape = (points, -1, 2 * m, m)
        self._r, self._n, self._plain = r, n, weights.plain
        at, back = (n.at @ beside.conj()).reshape(shape), (n.back @ beside).reshape(shape)
        self._linear = _Both(at[:, :, m:], back[:, :, m:])  # n at z with H*, at 1 / z with H, by q and i
        self._mixed = _Both(at[:, :, :m], back[:, :, :m])  # n(z) e_j(1/z) and n(1/z) e_j(z), by j and i
        of_e = (e.conj() @ beside).reshape(points, m, 2 * m, m)
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


# -------------------------------------------------------------------------------------------------- fraction influence
# How the response moves the denominators of a matrix fraction, with the share of what the equation leaves.
#
#     dA = -M_in^-1 sum_o [X_o' P dX_o A + dX_o' r_o],
#
# X_o the weighted lines of output o times powers of z, P what the numerators leave, r_o = P X_o A the misfit of the equation. The second
# term is no smaller than the first: without it deviations are 15 to 60 % wrong at 40 dB. The level of an output, by which it is divided,
# is taken as given.
#
# On a line the gradient of a pole is a = sum_q H_oq* K_qi + B_oi, with K and B polynomials in z and 1 / z. White noise asks for
# sums of |a|^2
# and a b, b the mirror image, over the lines, in which only 1, H and H* H are rough: sums over few points of the arc are these (see
# `modalscope.blocks.fraction`), and nothing of lines times outputs times poles is formed.

#: Lines a point of the arc from which few points are faster.
_SAVED = 2

#: Share of its terms below which a sum by few points is rounding.
_REACHED = 1e-7


Pair = tuple[ComplexArray, ComplexArray]


class FractionInfluence(LineInfluence):
    """The gradient of eigenvalues of a matrix fraction.

    `rows` (k, p + 1, m): coefficients of the row by which X is multiplied. `right` (k, m): what A is multiplied by. `lines`: those that
    stand for all where lines are needed.
    """

    def __init__(self, matrix: Fraction, rows: ComplexArray, right: ComplexArray, lines: Lines) -> None:
        freeze(self, matrix=matrix, rows=rows, right=right, lines=lines)

    matrix: Fraction
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
        of_row, row = _projected(self.matrix, self.rows, self.lines.used)
        column = np.einsum("bqi,ki->kbq", self.denominator, self.right, optimize=True)
        misfit, model = _projected(self.matrix, column, self.lines.used)
        return (
            (Outer(of_row[1], model[0]), Outer(misfit[1], row[0])),
            (Outer(of_row[0], model[1]), Outer(misfit[0], row[1])),
        )

    @cached_property
    def denominator(self) -> RealArray:
        """A_0, ..., A_p, (p + 1, m, m)."""
        m, degree = self.matrix.inputs, self.rows.shape[1] - 1
        return np.vstack([np.eye(m), self.matrix.denominator(degree)]).reshape(-1, m, m)

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; those of these poles alone by few points of the arc, where that is less."""
        degree = self.rows.shape[1] - 1
        count = self.matrix.sums.nodes(degree)
        if fading is not None or other is not self or _SAVED * count > self.lines.used.size:
            return super().joint(other, variance, fading)
        found, terms = moments_of_noise(self, variance, count)
        lost = np.flatnonzero(~(found.size > _REACHED * terms))
        if not lost.size:
            return found
        part = self.take(lost)
        again = LineInfluence(part.direct, part.mirrored, part.lines)
        exact = again.joint(again, variance)
        size, square = found.size.copy(), found.square.copy()
        size[lost], square[lost] = np.real(exact.size), exact.square
        return Moments(size, square)

    def take(self, index: Array) -> FractionInfluence:
        """Return the gradients of some poles."""
        return FractionInfluence(self.matrix, self.rows[index], self.right[index], self.lines)


def _projected(matrix: Fraction, c: ComplexArray, lines: IntArray) -> tuple[Pair, Pair]:
    """Return what P leaves of X c, weighted and halved (k, F, l), and sum_j c_j z^j (k, F, m), each at z and at 1 / z."""
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


# ------------------------------------------------------------------------------------------------------------ fraction


def trigonometric_sums(values: ComplexArray, angles: RealArray, lags: int) -> RealArray:
    """Return t[k] = Re sum_f values[f] exp(j k angle_f) for k = -lags ... lags, (2 lags + 1, ...).

    By one Fourier transform when the angles are consecutive multiples of a fraction of the circle, else by the sum itself.

    `values` (F, ...). `angles` (F,).
    """
    step = (angles[-1] - angles[0]) / max(angles.size - 1, 1)
    length, first = (2 * np.pi / step, angles[0] / step) if step > 0 else (0.5, 0.5)
    whole, start = round(length), round(first)
    even = np.allclose(angles, angles[0] + step * np.arange(angles.size), rtol=0, atol=1e-9 * step * angles.size)
    flat = values.reshape(angles.size, -1)
    if even and abs(length - whole) < 1e-6 and abs(first - start) < 1e-6 and whole >= 2 * lags + 1:
        padded = np.zeros((whole, flat.shape[1]), dtype=complex)
        padded[start : start + angles.size] = flat
        t = (np.fft.ifft(padded, axis=0).real * whole)[np.r_[whole - lags : whole, : lags + 1]]
    else:
        t = (np.exp(1j * np.outer(np.arange(-lags, lags + 1), angles)) @ flat).real
    return np.asarray(t.reshape(2 * lags + 1, *values.shape[1:]))


def fraction(
    response: FrequencyResponse, *, degree: int, weights: ArrayLike | None = None, equal_outputs: bool = True
) -> Fraction:
    """Prepare the normal equations of all degrees up to `degree`.

    `response`: lines of any band. `degree`: largest degree p of the polynomials; a model of degree p has p m poles. `weights` (F,):
    weights of the lines. `equal_outputs`: divide every output by its root mean square over the band.

    Raises `DataError`: fewer lines than unknowns: 2 F l must be at least (p + 1) l + p m.

    Notes
    -----
    Guillaume et al., A poly-reference implementation of the least-squares complex frequency-domain estimator, IMAC XXI (2003);
    Peeters et al., The PolyMAX frequency-domain method, Shock and Vibration 11 (2004). The lines lie at z = exp(j w T), which is
    exact for sampled systems only: for a structure's own responses the fraction is an approximation that improves with its
    degree.
    """
    lines, outputs, inputs = response.values.shape
    p = check_count("degree", degree)
    unknowns = (p + 1) * outputs + p * inputs
    if 2 * lines * outputs < unknowns:
        raise DataError(
            f"a matrix fraction of degree {p} needs 2 x lines x outputs >= (p + 1) x outputs + p x inputs = {unknowns}",
            f"{lines} lines and {outputs} outputs give {2 * lines * outputs}",
            "Widen the band or lower the degree.",
        )
    low, high = half_circle(response)
    level = output_scale(response) if equal_outputs else np.ones(outputs)
    return Fraction(
        response=response,
        degree=p,
        base=low,
        interval=1 / (2 * (high - low)),
        weights=None if weights is None else np.asarray(weights, dtype=float),
        output_scale=level,
    )


@dataclass(frozen=True, eq=False)
class Fraction(DataMatrix):
    """Normal equations of a right matrix fraction (made by `fraction`)."""

    response: FrequencyResponse
    degree: int
    base: float
    interval: float
    weights: RealArray | None
    output_scale: RealArray

    @property
    def judged(self) -> FrequencyResponse:
        """The lines themselves."""
        return self.response

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return int(self.response.values.shape[1])

    @property
    def block_rows(self) -> int:
        """Largest degree of the polynomials."""
        return self.degree

    @property
    def dt(self) -> float | None:
        """Sampling interval when the system is a sampled one; a structure's own responses give continuous poles."""
        return self.interval if self.response.sampling_rate is not None else None

    @property
    def inputs(self) -> int:
        """Size of the matrix polynomial A(z)."""
        return int(self.response.values.shape[2])

    @cached_property
    def angles(self) -> RealArray:
        """Where the lines lie on the unit circle, rad."""
        return np.asarray(2 * np.pi * (self.response.frequencies - self.base) * self.interval)

    @cached_property
    def sums(self) -> LineSums:
        """What sums over the lines are made of where noise moves the poles."""
        return LineSums(self)

    @cached_property
    def _sums(self) -> tuple[RealArray, RealArray, RealArray]:
        """Return the Toeplitz entries of R (2p+1,), S (2p+1, l, m) and sum_o T_o (2p+1, m, m), lags -p ... p."""
        angles = self.angles
        w = np.ones(angles.size) if self.weights is None else self.weights**2
        H = self.response.values / self.output_scale[:, None]
        together = np.concatenate(
            [
                np.ones((angles.size, 1)),
                -H.reshape(angles.size, -1),
                np.einsum("foa,fob->fab", H.conj(), H, optimize=True).reshape(angles.size, -1),
            ],
            axis=1,
        )
        t = trigonometric_sums(np.asarray(together * w[:, None], dtype=complex), angles, self.degree)
        cut = 1 + self.response.values[0].size
        lags = t.shape[0]
        return t[:, 0], t[:, 1:cut].reshape(lags, *H.shape[1:]), t[:, cut:].reshape(lags, self.inputs, self.inputs)

    @cached_property
    def lower_triangle(self) -> RealArray:
        """L with L L' = R, the Gram matrix of the powers."""
        lag = np.arange(self.degree + 1)
        try:
            return np.linalg.cholesky(self._sums[0][lag[None, :] - lag[:, None] + self.degree])
        except np.linalg.LinAlgError:
            low, high = self.response.span
            raise DataError(
                f"polynomials to degree {self.degree} in z were asked",
                f"lines from {low:g} to {high:g} Hz fill too little of the unit circle to tell their powers apart",
                f"Lower the orders to {self.degree // 2}, take a wider band, or method='alternate', whose polynomials are orthogonal.",
            ) from None

    @cached_property
    def gram_blocks(self) -> tuple[RealArray, RealArray]:
        """Return T (p+1, m, p+1, m) and U = L^-1 S (p+1, l, p+1, m), from which M of degree k is T - sum_(i <= k) U_i' U_i."""
        _, s, t = self._sums
        p, n = self.degree, self.degree + 1
        lag = np.arange(n)[None, :] - np.arange(n)[:, None] + p  # entry (i, j) depends on j - i
        S, T = s[lag], t[lag]  # (n, n, l, m), (n, n, m, m)
        U = sla.solve_triangular(
            self.lower_triangle, S.transpose(0, 2, 1, 3).reshape(n, -1), lower=True, check_finite=False
        )
        return T.transpose(0, 2, 1, 3), U.reshape(n, s.shape[1], n, self.inputs)

    @cached_property
    def gram_matrices(self) -> tuple[RealArray, ...]:
        """Return M of every degree 0 ... p, ((k + 1) m square): the Gram matrix of the data without what numerators explain."""
        T, U = self.gram_blocks
        m, n = self.inputs, self.degree + 1
        running = T.reshape(n * m, n * m).copy()
        found = []
        for k in range(n):
            rows = U[k].reshape(-1, n * m)
            running -= rows.T @ rows
            found.append(running[: (k + 1) * m, : (k + 1) * m].copy())
        return tuple(found)

    def denominator(self, degree: int) -> RealArray:
        """Return A_1, ..., A_p stacked, (p m, m), for A_0 = I: the minimum of the quadratic form of M.

        With the lowest coefficient fixed, what no mode explains goes to roots outside the unit circle: unstable poles,
        identified by their sign.
        """
        return self.solved(degree, -self.gram_matrices[degree][self.inputs :, : self.inputs])

    def solved(self, degree: int, target: Array) -> Array:
        """Return M_in^-1 X of one degree, M without the rows and columns of A_0."""
        inner = self.gram_matrices[degree][self.inputs :, self.inputs :]
        try:
            return np.asarray(sla.cho_solve(sla.cho_factor(inner, check_finite=False), target, check_finite=False))
        except sla.LinAlgError:  # singular to rounding: data without noise, more degrees than modes
            return np.asarray(np.linalg.lstsq(inner, target, rcond=inner.shape[0] * np.finfo(float).eps)[0])

    @property
    def thinned(self) -> bool:
        """No: few points of the arc stand for all lines."""
        return False

    def influence(self, left: Array, right: Array, lines: Lines | None = None) -> FractionInfluence:
        """Return the gradient of left_j dA right_j, A = [A_1; ...; A_p]; left (k, p m), right (m, k)."""
        m, degree = self.inputs, left.shape[1] // self.inputs
        rows = np.concatenate([np.zeros((len(left), m)), -self.solved(degree, left.T).T], axis=1)
        kept = all_lines(self.response.lines) if lines is None else lines
        return FractionInfluence(self, rows.reshape(len(left), degree + 1, m), np.asarray(right.T, dtype=complex), kept)

    @cached_property
    def factors(self) -> Factors:
        """Eigenvectors of M of the largest degree and the roots of its eigenvalues, the singular values of the data behind it."""
        weights, vectors = np.linalg.eigh(self.gram_matrices[-1])
        d, V = np.sqrt(np.clip(weights[::-1], 0, None)), vectors[:, ::-1]
        return Factors(V, d, V, d, d.size, f"normal equations, {d.size} unknowns a column")

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s, of roots of A(z)."""
        z = np.asarray(poles, dtype=complex)
        upper = to_continuous(np.where(z.imag < 0, z.conj(), z), self.interval) + 2j * np.pi * self.base
        return np.where(z.imag < 0, upper.conj(), upper)

    def from_s(self, poles: Array) -> ComplexArray:
        """Roots of A(z) from continuous poles."""
        s = np.asarray(poles, dtype=complex)
        upper = to_discrete(np.where(s.imag < 0, s.conj(), s) - 2j * np.pi * self.base, self.interval)
        return np.where(s.imag < 0, upper.conj(), upper)

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return participation, the last entries of the left eigenvectors; shapes and residuals by least squares over the lines."""
        participation = eigen.left[:, -self.inputs :]
        powers = self.response.outside_powers
        basis = self.response.basis(self.to_s(eigen.values), powers, self.weights)
        found = basis.turned.solved(participation.T)
        shapes, terms = found.side.T, found.terms.transpose(0, 2, 1)
        if self.weights is not None:
            return ModalFit(shapes, participation, terms, powers)
        misfit = self._misfit.of_left(found.left.T)
        return ModalFit(shapes, participation, terms, powers, misfit=misfit, unexplained=found.unexplained.T)

    @cached_property
    def _misfit(self) -> Misfit:
        return Misfit(self.response, self.output_scale)

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Yield data and model with the residuals, which no state has."""
        if fit.powers == (0,):
            yield from super().compared(model, poles, fit)
            return
        basis = self.response.basis(poles, fit.powers)
        yield basis.data, basis.rebuilt(fit.shapes, fit.participation, fit.terms)

    def describe(self) -> str:
        """Say what the normal equations are, in words."""
        f = self.response.frequencies
        kind = "exact for a sampled system" if self.dt is not None else "approximate for a continuous structure"
        moved = f", counted from {self.base:g} Hz" if self.base else ""
        weighted = ", weighted lines" if self.weights is not None else ""
        lines = f"{f.size} lines, {f[0]:g} to {f[-1]:g} Hz{moved}"
        return f"right matrix fraction to degree {self.degree} on {lines}, z = exp(j w T), {kind}{weighted}"
