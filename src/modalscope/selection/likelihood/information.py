"""Compute gradient and information of the likelihood, whole and by rows of the data, from the complex columns of a point.

The derivative of channel o by the real and the imaginary part of an unknown a is Re(c_oa W_a) and Re(j c_oa W_a), where W_a is its
column projected out of the span of the modes; sums over channels then need only the products W'W, W^H W and c'c, c^H c.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.fft as sfft

from modalscope.data.response import Response, window_over_lines
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.selection.likelihood.likelihood import Fitted, Point, Side, WhitenedResponse


def normal(point: Point, fitted: Fitted) -> tuple[RealArray, RealArray]:
    """Return the information J'J (2 n p, 2 n p) and J'r (2 n p,), real and imaginary part of every unknown side by side."""
    coefficients, p = _coefficients(point, fitted), point.sides.shape[1]
    information, slopes = np.zeros((2 * p * len(point.poles),) * 2), np.zeros(p * len(point.poles), dtype=complex)
    for side in fitted.sides:
        c, V = coefficients[side.channels], _free(point, side).view(np.float64)  # real and imaginary parts side by side
        slope = V.T @ fitted.left[:, side.channels]
        slopes += np.einsum("oa,ao->a", c, slope[::2] + 1j * slope[1::2])
        information += _over_channels(V.T @ V, c)
    return information, _interleaved(slopes)


def covariance_of_scores(point: Point, fitted: Fitted, noise: RealArray) -> RealArray:
    """Return the covariance of J'e (2 n p, 2 n p), e of the covariance `noise` (4 n, 4 n) of compressed rows, alike in all channels."""
    V = _free(point, fitted.only).view(np.float64)
    coloured = (noise @ V.reshape(len(noise), -1)).reshape(V.shape)
    return _over_channels(V.T @ coloured, _coefficients(point, fitted))


def _over_channels(G: RealArray, c: ComplexArray) -> RealArray:
    """Return sum_o of products of Re(c_oa W_a) and Re(j c_oa W_a) from those of real and imaginary parts of W, side by side."""
    RR, RI, II = G[::2, ::2], G[::2, 1::2], G[1::2, 1::2]
    H = (RR + II + 1j * (RI - RI.T)) * (c.conj().T @ c)
    S = (RR - II + 1j * (RI + RI.T)) * (c.T @ c)
    J = np.empty((2 * len(H), 2 * len(H)))
    J[::2, ::2], J[1::2, 1::2] = (H + S).real / 2, (H - S).real / 2
    J[::2, 1::2], J[1::2, ::2] = -(H + S).imag / 2, (H - S).imag / 2
    return J


def scores(point: Point, fitted: Fitted) -> RealArray:
    """Return J'r of every channel, (l, m, 2 n p): at the optimum they sum to zero."""
    c, (_, q, p) = _coefficients(point, fitted), point.data.shape
    each = np.empty((q, p, c.shape[1]), dtype=complex)
    for side in fitted.sides:
        W, left = _split(_free(point, side), p), _split(fitted.left[:, side.channels], p)
        each[side.channels] = np.einsum("kia,kio->oia", W, left, optimize=True) * c[side.channels, None]
    return _interleaved(each.transpose(1, 0, 2) if point.problem.turned else each)


def residual(point: Point, fitted: Fitted) -> RealArray:
    """Return the whitened residual on all rows, (K, q, p)."""
    found = None
    for rows, left in residuals(point, fitted):
        if isinstance(rows, slice):  # all
            return left
        found = np.empty((len(point.problem.rows), *left.shape[1:])) if found is None else found
        found[rows] = left
    assert found is not None
    return found


def residual_of(point: Point, fitted: Fitted, channels: tuple[IntArray, IntArray]) -> RealArray:
    """Return the whitened residual of a response on all rows and some channels, (K, a, b).

    `channels`: rows (a, 1) and columns (b,) of them.
    """
    assert isinstance(point.problem, WhitenedResponse)
    explained = _explained(point, fitted).reshape(-1, *point.data.shape[1:])[:, *channels]
    rows = point.span @ explained.reshape(len(explained), -1)
    return np.asarray(point.problem.data[:, *channels] - rows.reshape(-1, *explained.shape[1:]))


def residuals(point: Point, fitted: Fitted) -> Iterator[tuple[slice | IntArray, RealArray]]:
    """Yield some rows and the whitened residual there, (rows, q, p)."""
    coefficients = _explained(point, fitted)
    for rows, explained, data in point.spanned(coefficients, max(_NUMBERS_AT_A_TIME // coefficients.shape[1], 1)):
        left = explained.reshape(data.shape)
        yield rows, np.subtract(data, left, out=left)


def _explained(point: Point, fitted: Fitted) -> RealArray:
    """Return what modes explain of all channels on the compressed rows, (4 n, q p)."""
    count, q, p = point.data.shape
    return (point.data - _split(fitted.left, p).transpose(0, 2, 1)).reshape(count, q * p)


def information_of_channels(point: Point, fitted: Fitted, variance: float, *, alike: bool) -> RealArray:
    """Return J'V J (2 n p, 2 n p), V the variance of each channel's noise by what is left of it, or `alike`; `variance` in the mean."""
    c, (q, p) = _coefficients(point, fitted), point.data.shape[1:]
    left = np.ones((q, p)) if alike else point.beyond + np.sum(fitted.left.reshape(-1, p, q) ** 2, axis=0).T
    size = np.sqrt(variance * left / max(float(left.mean()), 1e-300))
    found = np.zeros((2 * c.shape[1],) * 2)
    for side in fitted.sides:
        V = _split(_free(point, side).view(np.float64), p)
        for i, of_input in enumerate(V.swapaxes(0, 1)):
            found += _over_channels(of_input.T @ of_input, (size[:, i, None] * c)[side.channels])
    return found


#: Numbers that are computed at a time: 4 MB.
_NUMBERS_AT_A_TIME = 1 << 19


class OnRows(NamedTuple):
    """Some rows of the data at a point.

    `rows` (k,): which. `W` (k, p, n p): columns W_a of all unknowns, complex, see above. `kept` (k, p, r): what modes explain. `left`
    (k, q, p): whitened residual.
    """

    rows: slice | IntArray
    W: ComplexArray
    kept: RealArray
    left: RealArray


def on_rows(point: Point, fitted: Fitted, *, together: bool = False) -> Iterator[OnRows]:
    """Yield both parts of some lines at a time, or all rows of a response `together`."""
    W, p = _free(point, fitted.only), point.data.shape[2]
    parts = [each.reshape(len(W) // p, -1) for each in (W.view(np.float64), fitted.only.kept)]
    ends = np.cumsum([each.shape[1] for each in parts])
    coefficients = np.hstack([*parts, _explained(point, fitted)])
    lines = None if together else max(_NUMBERS_AT_A_TIME // coefficients.shape[1], 1)
    for rows, found, data in point.spanned(coefficients, lines):
        W_rows, kept, explained = (np.ascontiguousarray(each) for each in np.split(found, ends, axis=1))
        explained = explained.reshape(data.shape)
        yield OnRows(
            rows,
            W_rows.view(np.complex128).reshape(len(data), p, -1),
            kept.reshape(len(data), p, -1),
            np.subtract(data, explained, out=explained),
        )


def influence_on_poles(W: Sequence[RealArray], linear: ComplexArray, steps: RealArray) -> RealArray:
    """Return u = J x, the influence of the data on numbers g'theta, x = J'J^-1 g: the change of each is sum u e, (b, q, p, K).

    `W`: of every mode (a, p, K), its columns of `on_rows`, real and imaginary part of every unknown one after the other, or what is linear
    in them: real parts of their transforms. `linear` (q, n): c. `steps` (b, n a): x.
    """
    (q, n), (a, p, K), b = linear.shape, W[0].shape, len(steps)
    x = (steps[:, ::2] + 1j * steps[:, 1::2]).reshape(b, n, -1)
    # Re and -Im of sum_a W_a x_a of every mode, from the parts of W; then Re of their products with c
    of_real, of_imag = (np.stack([each.real, -each.imag], axis=2) for each in (x, 1j * x))
    weights = np.stack([of_real, of_imag], axis=-1).reshape(b, n, 2, a)
    moved = np.empty((b, n, 2, p * K))
    for j, own in enumerate(W):
        moved[:, j] = (weights[:, j].reshape(-1, a) @ own.reshape(a, -1)).reshape(b, 2, -1)
    c = np.stack([linear.real, linear.imag], axis=-1).reshape(q, -1)
    return np.asarray(c @ moved.reshape(b, 2 * n, -1)).reshape(b, q, p, K)


def by_channel(point: Point, fitted: Fitted, steps: RealArray) -> tuple[RealArray, RealArray]:
    """Return of numbers g'theta the squares of the influence of each channel, and what its residual adds to them, (b, l, m) each.

    `steps` (b, 2 n p): x = J'J^-1 g.
    """
    W, (n, p) = _free(point, fitted.only), point.sides.shape
    columns = W.view(np.float64).reshape(-1, p, n, 2 * p)
    own = [np.ascontiguousarray(columns[:, :, j].transpose(2, 1, 0)) for j in range(n)]
    left, q = _split(fitted.left, p).transpose(2, 1, 0), len(fitted.linear)
    power, pull = np.empty((2, len(steps), q, p))
    step = max(_NUMBERS_AT_A_TIME // (len(steps) * len(W)), 1)
    for few in (slice(k, k + step) for k in range(0, q, step)):
        u = influence_on_poles(own, fitted.linear[few], steps)
        power[:, few] = np.einsum("bqpk,bqpk->bqp", u, u)
        pull[:, few] = np.einsum("bqpk,qpk->bqp", u, left[few])
    return (power.swapaxes(1, 2), pull.swapaxes(1, 2)) if point.problem.turned else (power, pull)


def scores_of_lines(
    W: tuple[ComplexArray, ComplexArray], point: Point, fitted: Fitted, e: ComplexArray
) -> ComplexArray:
    """Return J^H e of every line, (F, 2 n p): real parts are the scores; those of steady noise are independent and circular.

    `W`: real and imaginary part of the columns of unknowns, each as lines, (F, p, n p). `e` (F, q, p): residual.
    """
    c, (P, Q) = _coefficients(point, fitted), (part.conj() for part in W)
    by_real, by_imag = (np.einsum("foi,oa->fia", e, part, optimize=True) for part in (c.real, c.imag))
    each = np.stack([P * by_real - Q * by_imag, -P * by_imag - Q * by_real], axis=-1).sum(axis=1)
    return np.asarray(each.reshape(len(e), -1))


def leverage(
    terms: RealArray, linear: ComplexArray, W: ComplexArray, kept: RealArray, inverse: RealArray, parts: int = 1
) -> RealArray:
    """Return how far each number of the data draws its fit towards itself, (K, q, p): the diagonal of the projection on terms, c and J.

    `terms` (K, t): of the problem. `linear` (q, n): c. `W`, `kept`: of `OnRows`. `inverse`: of J'J. `parts`: 2 returns the mean of the
    first and the second half of the rows, the real and the imaginary parts of lines.
    """
    (q, n), count, p = linear.shape, len(W) // parts, W.shape[1]
    alike = np.sum(terms**2, axis=1)[:, None] + np.einsum("kir,kir->ki", kept, kept)
    found = np.empty((count, q, p))
    found[:] = alike.reshape(parts, count, 1, p).mean(axis=0)
    rows = W.reshape(parts, count, p, n, -1)
    step = max(_NUMBERS_AT_A_TIME // (2 * parts * W[0].size), 1)
    for start in range(0, count, step):
        own = rows[:, start : start + step]
        h = _leverage_on_modes(own.reshape(-1, *own.shape[3:]), linear, inverse, parts) / parts
        found[start : start + step] += h.reshape(-1, p, q).swapaxes(1, 2)
    return found


def _leverage_on_modes(W: ComplexArray, linear: ComplexArray, inverse: RealArray, parts: int) -> RealArray:
    """Return J J'J^-1 J' of every channel on rows (K, n, p), summed over as many parts of the rows, (K / parts, q).

    J is linear in c, so that this is c'M c with M (2 n, 2 n) of each row, by real and imaginary part of c: once for all channels.
    """
    (q, n), K = linear.shape, len(W)
    real, imag = (np.ascontiguousarray(each.transpose(1, 2, 0)) for each in (W.real, W.imag))
    # J by the real and the imaginary part of c, and by both parts of every unknown
    G = np.stack([np.stack([real, -imag], axis=2), np.stack([-imag, -real], axis=2)]).reshape(2, n, -1, K)
    a, c, h = G.shape[2], (linear.real, linear.imag), np.zeros((q, K // parts))
    C = inverse.reshape(n, a, n, a)
    for j in range(n):
        once = np.where(np.arange(n - j) > 0, 2.0, 1.0)  # M is symmetric
        for own, by in zip(c, G[:, j], strict=True):
            half = (C[j, :, j:].reshape(a, -1).T @ by).reshape(n - j, a, K)
            for other, rows in zip(c, G[:, j:], strict=True):
                M = np.einsum("lak,lak->lk", half, rows).reshape(n - j, parts, -1).sum(axis=1)
                h += (own[:, j, None] * other[:, j:] * once) @ M
    return h.T


#: Eigenvalues of products of columns of length one below this part of the largest are rounding.
ROUNDING_OF_PRODUCTS = 1e-12

#: An unknown belongs to a direction that has at least this share of its square.
_MIN_SHARE_OF_DIRECTION = 0.01

#: Variance of unknowns that the data do not determine, relative to that of each taken alone: infinite beside any other, yet finite, so
#: that products with it are no NaN.
_UNDETERMINED = float(np.finfo(float).eps) ** -2


def inverse(information: RealArray, undetermined: float = _UNDETERMINED) -> RealArray:
    """Return the inverse, columns brought to one level first.

    A direction below the rounding of the products, about which the data say nothing, gives the variance `undetermined` to the unknowns
    that it consists of, and nothing to others. With zero these keep what is known of them: products with columns need no more.
    """
    scale = np.sqrt(np.diag(information))
    scale[scale < 1e-150] = 1  # a column of nothing
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    known = values > ROUNDING_OF_PRODUCTS * values.max(initial=0.0)
    found = (vectors[:, known] / values[known]) @ vectors[:, known].T
    lost = np.any(vectors[:, ~known] ** 2 >= _MIN_SHARE_OF_DIRECTION, axis=1)
    found[lost, lost] = undetermined or found[lost, lost]
    return np.asarray(found / np.outer(scale, scale))


#: A column of which less than this part is left beside what modes explain is rounding.
_ROUNDING_OF_COLUMNS = 1e-10


def _free(point: Point, side: Side) -> ComplexArray:
    """Return the columns of the unknowns without what modes explain.

    Those that are nothing but rounding, of an input that is zero or the sum of others, are zero: of length one they would lead anywhere.
    """
    W = np.ascontiguousarray(side.weighted(point.directions()))
    V = W.view(np.float64)  # real columns with real columns: half the work
    before = np.einsum("ka,ka->a", V, V)
    V -= side.kept @ (side.kept.T @ V)
    V[:, np.einsum("ka,ka->a", V, V) <= _ROUNDING_OF_COLUMNS**2 * before] = 0
    return W


def _coefficients(point: Point, fitted: Fitted) -> ComplexArray:
    """C of the mode of every unknown, (q, n p)."""
    return np.repeat(fitted.linear, point.sides.shape[1], axis=1)


def _split(columns: Array, p: int) -> Array:
    return columns.reshape(-1, p, columns.shape[1])


def _interleaved(values: ComplexArray) -> RealArray:
    """Derivatives by real and imaginary parts, Re v and Re(j v) = -Im v, side by side on the last axis."""
    return np.stack([values.real, -values.imag], axis=-1).reshape(*values.shape[:-1], -1)


# -------------------------------------------------------------------------------------------------------- under window
# Noise under an exponential window: its correlation over lines, its covariance of the unknowns, and the degrees of freedom of a fit.
#
# With T the correlation of noise on lines, T_fg = 1 / (1 + j pi (f - g) / a) at lines f, g and the rate a of the window, noise
# e = e_r + j e_i is circular, and compressed rows Q'(e_r, e_i) have the covariance C = Re Z^H T Z with Z = Q_r + j Q_i.


@dataclass(frozen=True, eq=False, slots=True)
class WindowNoise:
    """Effect of noise of variance one on a fit.

    `covariance` (2 n p, 2 n p): of the unknowns, J'J^-1 J'C J J'J^-1. `free`: expected squared misfit.
    """

    covariance: RealArray
    free: float


def window_noise(point: Point, fitted: Fitted, response: Response) -> WindowNoise | None:
    """Return the effect of noise under an exponential window on a fit to lines; None without a window or for samples."""
    window, grid = window_over_lines(response), response.grid
    if window <= 0 or grid is None:
        return None
    problem, (q, p) = point.problem, point.data.shape[1:]
    noise = _of_rows(point.span, grid, window)
    back = inverse(normal(point, fitted)[0])
    scores = covariance_of_scores(point, fitted, noise)
    kept = fitted.only.kept.reshape(len(noise), -1)
    linear = float(np.vdot(kept, noise @ kept))
    fixed = float(np.trace(_of_rows(problem.terms, grid, window)))
    taken = q * p * fixed + q * linear + float(np.vdot(back, scores))
    return WindowNoise(np.asarray(back @ scores @ back), problem.count - taken)


def _of_rows(Q: RealArray, grid: RealArray, window: float) -> RealArray:
    """Return the covariance C of Q'(e_r, e_i)."""
    real, imag = np.split(Q, 2)
    Z = real + 1j * imag
    return np.asarray((Z.conj().T @ correlated(Z, grid, window)).real)


def correlated(columns: ComplexArray, grid: RealArray, window: float) -> ComplexArray:
    """Return T times columns (F, k).

    `columns` (F, k). `grid` (F,): hz, evenly spaced but for gaps. `window`: the rate a over the distance of lines.
    """
    place = np.rint((grid - grid[0]) / np.median(np.diff(grid))).astype(int)
    longest = int(place[-1])
    size = sfft.next_fast_len(2 * longest + 1)
    lags = 1 / (1 + 1j * np.pi * np.arange(longest + 1) / window)
    kernel, spread = np.zeros(size, dtype=complex), np.zeros((size, columns.shape[1]), dtype=complex)
    kernel[: longest + 1], kernel[size - longest :] = lags, lags[:0:-1].conj()
    spread[place] = columns
    together = sfft.ifft(sfft.fft(spread, axis=0) * sfft.fft(kernel)[:, None], axis=0)
    return np.asarray(together[place])
