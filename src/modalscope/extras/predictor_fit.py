"""Realize models by weighted null-space fitting: a long autoregression with inputs, reduced with the weight of its own errors.

y(t) = D u(t) + sum_(k < p) C F^k [B - K D, K] [u; y](t - 1 - k) + e(t),        F = A - K C

The least-squares estimate H_k of the coefficients has the errors S (x) (R'R)^-1, S of e and R the triangular factor of the regressors. The
model of order n is the one whose coefficients are nearest to it in this metric. Its null space, T(F, C) H = 0 with the inverse of
T cov T' as the weight, has the same minimum (each is the dual of the other); here no canonical form has to suit the structure. Where p
outlasts the predictor it is that of the prediction error.

Sources: J. He, S. J. Qin, H. Hjalmarsson, arXiv:2411.00506 and arXiv:2510.02529; M. Galrinho, C. R. Rojas, H. Hjalmarsson, "Parametric
identification using weighted null-space fitting", IEEE Trans. Autom. Control 64 (2019).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.identification.matrices.driven import DrivenProjection
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import Realization, Triple
from modalscope.identification.realizations.shift import Shift, shift
from modalscope.numerics.checks import ComplexArray, RealArray

#: The autoregression is this many times as long as the information criterion says: its bias must fall faster than its scatter (Galrinho
#: et al., assumption 4).
_LONGER = 2

#: Errors below this part of the outputs are rounding, and those that keep the sums regular: nothing can be weighted by them.
_EXACT = 1e-5

#: Least-squares steps, and the part of the misfit that ends them; times a step is damped ten times more until it lowers the misfit.
_STEPS, _SETTLED, _DAMPINGS = 10, 1e-6, 8

#: Rows of an observability matrix that the first states of the predictor are fitted to.
_MAX_ROWS = 600

#: Eigenvalues of a first predictor lie within this radius.
_MAX_RADIUS = 0.999


class Autoregression(NamedTuple):
    """Coefficients (p (m + l), l) of an autoregression, the triangle of their regressors, and W with W'W the inverse covariance of e.

    `length`: p. `channels`: m + l; inputs first. `short`: whether the criterion
    asks for more than the record allows. `exact`: whether e is rounding. Constants and the direct term are eliminated. Channels are level.
    """

    coefficients: RealArray
    triangle: RealArray
    weight: RealArray
    length: int
    channels: int
    short: bool
    exact: bool

    def misfit(self, coefficients: RealArray) -> RealArray:
        """Return the residual of coefficients, white and of variance one, (p (m + l), l)."""
        return np.asarray(self.triangle @ (self.coefficients - coefficients) @ self.weight.T)


def autoregression(matrix: DrivenProjection) -> Autoregression:
    """Return the autoregression of records, as long as Akaike's criterion asks for, twice, within the past of the projection."""
    R, rows, first, outputs, channels = matrix.predictor_triangle()
    longest = (R.shape[1] - first - outputs) // channels
    counts = first + channels * np.arange(1, longest + 1)
    errors = (R[count:, -outputs:] for count in counts)
    criterion = [
        rows * np.linalg.slogdet(E.T @ E / rows)[1] + 2 * outputs * n for E, n in zip(errors, counts, strict=True)
    ]
    asked = _LONGER * (1 + int(np.argmin(criterion)))
    length = min(asked, longest)
    last = first + channels * length
    E = R[last:, -outputs:]
    weight = np.linalg.inv(np.linalg.cholesky(E.T @ E / rows))
    triangle = R[first:last, first:last]
    coefficients = sla.solve_triangular(triangle, R[first:last, -outputs:], check_finite=False)
    return Autoregression(
        coefficients,
        triangle,
        weight,
        length,
        channels,
        asked > longest,
        bool(np.abs(E).max() < _EXACT * np.sqrt(rows)),
    )


class _Predictor(NamedTuple):
    """Eigenvalues (k,), shapes (l, k) and participation (k, m + l) of a predictor, one of each pair; `times` (k,): 2 of pairs."""

    values: ComplexArray
    shapes: ComplexArray
    sides: ComplexArray
    times: RealArray

    def coefficients(self, length: int) -> RealArray:
        """Return C F^k [B - K D, K], (p (m + l), l)."""
        powers = self.values ** np.arange(length)[:, None]
        H = np.einsum("on,kn,nc->kco", self.shapes * self.times, powers, self.sides).real
        return np.asarray(H.reshape(-1, len(self.shapes)))

    def slopes(self, length: int) -> RealArray:
        """Return the derivatives of the coefficients by the unknowns in the order of `moved`, (p (m + l), l, unknowns)."""
        k = np.arange(length)[:, None]
        powers, falls = self.values**k, k * self.values ** np.maximum(k - 1, 0)
        l, channels = len(self.shapes), self.sides.shape[1]
        by_value = np.einsum("on,kn,nc->kcon", self.shapes * self.times, falls, self.sides)[..., None]
        by_shape = np.einsum("op,kn,nc->kconp", np.eye(l), powers * self.times, self.sides)
        by_side = np.einsum("on,kn,cd->kcond", self.shapes * self.times, powers, np.eye(channels))
        each = np.concatenate([by_value, by_shape, by_side], axis=-1)[..., self._free]
        both = np.stack([each.real, -each.imag], axis=-1).reshape(length * channels, l, -1)
        return np.asarray(both[..., self._real])

    def moved(self, step: RealArray) -> _Predictor:
        """Return the predictor a step further."""
        l, whole = len(self.shapes), np.zeros(2 * np.count_nonzero(self._free))
        whole[self._real] = step
        every = np.zeros(self._free.shape, complex)
        every[self._free] = whole[::2] + 1j * whole[1::2]
        return self._replace(
            values=self.values + every[:, 0],
            shapes=self.shapes + every[:, 1 : 1 + l].T,
            sides=self.sides + every[:, 1 + l :],
        )

    @property
    def _free(self) -> RealArray:
        """Which of value, shape and participation of each are free: the largest participation sets the scale, (k, 1 + l + m + l)."""
        free = np.ones((len(self.values), 1 + len(self.shapes) + self.sides.shape[1]), bool)
        free[np.arange(len(free)), 1 + len(self.shapes) + np.abs(self.sides).argmax(axis=1)] = False
        return free

    @property
    def _real(self) -> RealArray:
        """Which real and imaginary parts of the free ones are unknown: of real eigenvalues the real one."""
        pairs = np.repeat(self.times == 2, self._free.sum(axis=1))
        return np.column_stack([np.ones_like(pairs), pairs]).ravel()

    def system(self) -> tuple[RealArray, RealArray]:
        """Return A = F + K C and C in real coordinates; columns of the participation are inputs, then outputs."""
        l, blocks = len(self.shapes), []
        for value, two in zip(self.values, self.times == 2, strict=True):
            a, b = value.real, value.imag
            blocks.append(np.array([[a, b], [-b, a]]) if two else np.array([[a]]))
        both = np.column_stack([np.ones(len(self.values), bool), self.times == 2]).ravel()
        # x_1 = 2 Re b, x_2 = -2 Im b of a pair, read by Re c and Im c
        C = np.stack([self.shapes.real, self.shapes.imag], axis=-1).reshape(l, -1)[:, both]
        sides = self.sides * self.times[:, None]
        K = np.stack([sides.real, -sides.imag], axis=1).reshape(-1, self.sides.shape[1])[both, -l:]
        return np.asarray(sla.block_diag(*blocks) + K @ C), C


def _first(ar: Autoregression, A: RealArray, C: RealArray) -> _Predictor:
    """Return the predictor of a model with A and C: its gain by least squares on the response of the autoregression."""
    l, n = C.shape
    H = ar.coefficients.reshape(ar.length, ar.channels, l).transpose(0, 2, 1)
    count = max(min(_MAX_ROWS // l, 2 * ar.length), -(-n // l) + 1)
    Y = np.zeros((count, l, ar.channels))
    rows = [C]
    for k in range(count):
        Y[k] = H[k] if k < ar.length else 0
        for i in range(min(k, ar.length)):
            Y[k] += H[i, :, -l:] @ Y[k - 1 - i]
        rows.append(rows[-1] @ A)
    sides = np.linalg.lstsq(np.concatenate(rows[:-1]), Y.reshape(-1, ar.channels), rcond=1e-10)[0]
    values, V = np.linalg.eig(A - sides[:, -l:] @ C)
    values = np.where(np.abs(values) > _MAX_RADIUS, values * _MAX_RADIUS / np.abs(values), values).astype(complex)
    kept, participation = values.imag >= 0, np.linalg.solve(V.astype(complex), sides.astype(complex))
    times = np.where(values[kept].imag > 0, 2.0, 1.0)
    return _Predictor(values[kept], (C @ V)[:, kept].astype(complex), np.asarray(participation[kept]), times)


def fitted(ar: Autoregression, at: _Predictor) -> _Predictor:
    """Return the predictor nearest to the coefficients in the metric of their errors, by damped least-squares steps."""
    left, damping = ar.misfit(at.coefficients(ar.length)), 1e-3
    for _ in range(_STEPS):
        slopes = at.slopes(ar.length)
        turned = np.einsum("ab,bou,po->apu", ar.triangle, slopes, ar.weight, optimize=True)
        Q, T = sla.qr(turned.reshape(left.size, -1), mode="economic", check_finite=False)
        goal, sizes = Q.T @ left.ravel(), np.linalg.norm(T, axis=0)
        before = float(np.sum(left**2))
        for _ in range(_DAMPINGS):
            damped = np.vstack([T, np.sqrt(damping) * np.diag(sizes)])
            step = np.linalg.lstsq(damped, np.concatenate([goal, np.zeros(sizes.size)]), rcond=1e-12)[0]
            tried = at.moved(step)
            found = ar.misfit(tried.coefficients(ar.length))
            if np.abs(tried.values).max() < 1 and np.sum(found**2) < before:
                break
            damping *= 10
        else:
            return at
        at, left, damping = tried, found, damping / 10
        if before - np.sum(left**2) < _SETTLED * before:
            break
    return at


@dataclass(frozen=True, eq=False, kw_only=True)
class PredictorFit(Realization):
    """Weighted null-space fits of all orders, each from the model of the shift of one factor."""

    matrix: DrivenProjection
    start: Shift
    autoregression: Autoregression

    def triple(self, n: int) -> Triple:
        """Return the model of order n."""
        begun, of_outputs = self.start.triple(n), self.matrix.scales[0]
        if self.autoregression.exact:
            return begun
        A, C = fitted(self.autoregression, _first(self.autoregression, begun.A, begun.C / of_outputs[:, None])).system()
        return Triple(A, None, C * of_outputs[:, None], n)


def predictor_fit(matrix: DrivenProjection, factors: Factors) -> PredictorFit:
    """Return the weighted null-space fits of records; `factors`: of their projection, which the first models are cut from."""
    ar = autoregression(matrix)
    note = f"reduced from an autoregression of {ar.length} samples"
    if ar.exact:
        note = "the record is exact to rounding, and errors have no weights: as n4sid"
    elif ar.short:
        note += ", the most that the record allows: a predictor that fades more slowly biases damping; n4sid has no such limit"
    return PredictorFit(factors=factors, matrix=matrix, start=shift(matrix, factors), autoregression=ar, notes=(note,))
