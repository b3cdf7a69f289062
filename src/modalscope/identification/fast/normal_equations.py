"""Normal equations of the right matrix fraction H(z) = B(z) A(z)^-1: LSCF, known as PolyMAX.

With real coefficients A_0, ..., A_p (m x m) and beta_0, ..., beta_p (one row per output) the error of output o is
sum_j z^j beta_oj - H_o sum_j z^j A_j on the lines. Its normal equations have Toeplitz blocks: each entry depends on the difference of two
powers only and is one value of a Fourier transform over the lines. The numerators are eliminated,

    M = sum_o (T_o - S_o' R^-1 S_o),

and with R = L L' the leading blocks of M for every degree, each with numerators of its own degree, follow from the rows of L^-1 S_o.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError

#: A band that starts above this fraction of its end is shifted to zero, so that its lines fill the half circle.
_MIN_SHIFTED_RATIO = 0.3


#: Minimum eigenvalue of a Gram matrix with unit diagonal for a triangular factor.
_MIN_EIGENVALUE = 1e-13


def half_circle(response: Response) -> tuple[float, float]:
    """Return the frequencies that lie at z = 1 and z = -1, Hz."""
    (low, high), rate = response.span, response.sampling_rate
    if rate is not None:
        return 0.0, rate / 2
    return (0.0 if low < _MIN_SHIFTED_RATIO * high else low), high


def largest_degree(response: Response) -> int:
    """Return the degree up to which powers of z are told apart by the lines of a band.

    Of p + 1 powers on a circle with a gap from -theta to theta the least eigenvalue of the Gram matrix falls like exp(-c p),
    c = ln(1 + 2 sqrt(a) / (sqrt 2 - sqrt a)), a = 1 - cos theta; it has to stay above rounding.
    """
    (first, last), (low, high) = response.span, half_circle(response)
    gap = np.pi * max(first - low, high - last, 0.0) / (high - low)
    a = np.sqrt(min(1 - np.cos(gap), 2 - 1e-9))
    falls = np.log1p(2 * a / (np.sqrt(2) - a))
    return int(min(np.log(1 / _MIN_EIGENVALUE) / max(falls, 1e-6), 1e6))


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


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of a right matrix fraction for all degrees up to the largest.

    `response`: lines. `degree`: the largest, p. `base`: frequency at z = 1, Hz. `interval`: T, seconds. `weights` (F,): of the lines.
    `output_scale` (l,): outputs are divided by it.
    """

    response: FrequencyResponse
    degree: int
    base: float
    interval: float
    weights: RealArray | None
    output_scale: RealArray

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return int(self.response.values.shape[1])

    @property
    def inputs(self) -> int:
        """Size of the matrix polynomial A(z)."""
        return int(self.response.values.shape[2])

    @cached_property
    def angles(self) -> RealArray:
        """Where the lines lie on the unit circle, rad."""
        return np.asarray(2 * np.pi * (self.response.frequencies - self.base) * self.interval)

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
                f"polynomials to degree {self.degree} in z:",
                f"lines from {low:g} to {high:g} Hz cover too little of the unit circle to separate their powers",
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
        grams = []
        for k in range(n):
            rows = U[k].reshape(-1, n * m)
            running -= rows.T @ rows
            grams.append(running[: (k + 1) * m, : (k + 1) * m].copy())
        return tuple(grams)

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
