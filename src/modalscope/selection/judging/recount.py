"""Compute likelihood ratios of modes with the error covariance that the residual shows, channel by channel.

Refinement divides every channel by one level over all lines. Errors proportional to the response are small where the response is, so
that a mode is more significant there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.fft as sfft
from scipy.linalg.lapack import dpotrf, dtrtri
from scipy.special import ndtri

from modalscope.data.indicators import mac
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping, overlap
from modalscope.numerics.statistics import MANY_NUMBERS, few_channels
from modalscope.selection.judging.selection_problem import MAX_DAMPING_OF_RESONANCES, SelectionProblem
from modalscope.selection.likelihood.descent import Descent
from modalscope.selection.likelihood.line_levels import parts_of_level
from modalscope.selection.likelihood.matched import apart, explained_by_channel, grid_of, near, residues_by_channel
from modalscope.selection.likelihood.whitening import LEVEL_LINES, free_bound, lag_factor, smoothed

# ----------------------------------------------------------------------------------------------------- coloured errors
# Errors of lines: additive noise plus errors proportional to the response, each with its level and correlation over lines.
#
#     C = D (q A q + s K s) D
#
# of a channel: D its deviations, s^2 the part of the variance that belongs to the response, q^2 = 1 - s^2 that of even noise, A and K what
# either has in common some lines apart. Noise is often white; errors of calibration, leakage or
# nonlinearity are smooth and large where the response is, so that each has its own correlation.

#: Maximum lag of a correlation. It ends where the mean of this many lags ahead is below this many standard deviations.
_MAX_LAGS, _END_DEVIATIONS, _END_LAGS = 200, 2.0, 8

#: Variance of a product of two different errors, relative to that of the square of one and to the prior variance of a correlation.
_VARIANCE_OF_PRODUCT = 0.5


@dataclass(frozen=True, eq=False, slots=True)
class ColouredErrors:
    """The errors of all channels.

    `variance` (F, q, p): of a complex value. `share` (F, q, p): the part of it that belongs to the response. `even`, `own` (k,):
    correlations of the two parts, of values so many lines apart, from one on; zero beyond.
    """

    variance: RealArray
    share: RealArray
    even: RealArray
    own: RealArray

    def common(self, lines: Array) -> RealArray:
        """Return the correlations of errors around lines, all channels together, (n, k).

        `lines` (n,).
        """
        share = self.share.mean(axis=(1, 2))[lines, None]
        longest = max(len(self.even), len(self.own))
        even, own = (np.pad(each, (0, longest - len(each))) for each in (self.even, self.own))
        return np.asarray((1 - share) * even + share * own)

    def on(self, lines: slice) -> ColouredErrors:
        """Return the errors of some lines."""
        return replace(self, variance=self.variance[lines], share=self.share[lines])

    def combined(self, shapes: ComplexArray, participation: ComplexArray) -> ColouredErrors:
        """Return the errors of sums of channels, those of each channel by itself.

        `shapes` (q, a), `participation` (p, b): columns of what rows and columns are multiplied by.
        """
        parts = (self.variance * self.share, self.variance * (1 - self.share))
        both = [abs(shapes.T) ** 2 @ part @ abs(participation) ** 2 for part in parts]
        variance = both[0] + both[1]
        return replace(self, variance=variance, share=both[0] / variance)

    def covariances(self, channels: IntArray, rows: ComplexArray) -> RealArray:
        """Return Re of conj x' D^-1 (q A q + s K s) D^-1 y for pairs x, y of rows (c, k, 2, F), (c, k, 2, 2).

        `channels`: which c, counted over inputs first. `rows` (c, k, 2, F).
        """
        s2, variance = (each.reshape(len(each), -1)[:, channels].T for each in (self.share, self.variance))
        parts = ((self.even, 1 - s2), (self.own, s2))
        even, own = (_form(each, rows, np.sqrt(part / variance)) for each, part in parts)
        return even + own


def errors_of(left: RealArray, data: RealArray, even: RealArray, unknown: int) -> ColouredErrors:
    """Estimate the errors from the residual of a fit.

    Of every channel a + b |H|^2, the likeliest for squares of complex normal numbers, times what all channels together are of that around
    a line. With u what is left, divided by its deviations, E Re u_k u*_k+i = q_k q_k+i A_i + s_k s_k+i K_i over all lines and channels: two
    unknowns per lag, as likely as any before they are seen (their variance is one, that of a product a half).

    `left`, `data` (2 F, q, p): what a fit leaves, and the whole response, real parts above imaginary ones.
    `even` (F,): squares of what is even noise, up to a factor.
    `unknown`: real unknowns per channel.
    """
    rows, *shape = left.shape
    left = left.reshape(rows, -1)
    variance, share = _levels(left, data.reshape(rows, -1), even)
    A, K = _correlations(left, variance, share)
    variance *= rows / max(rows - unknown, 1)
    return ColouredErrors(variance.reshape(-1, *shape), share.reshape(-1, *shape), A, K)


def _levels(left: RealArray, data: RealArray, even: RealArray) -> tuple[RealArray, RealArray]:
    """Return the variance of errors of channels (F, c), and the share of the response's own in it."""
    (variance, share), excess = np.empty((2, len(even), left.shape[1])), np.zeros(len(even))
    for few in few_channels(*variance.shape):
        squares = (each**2 for each in (left[:, few], data[:, few] - left[:, few]))
        power, size = (real + imag for real, imag in (np.split(each, 2) for each in squares))
        noise, own = parts_of_level(power, even, size)
        variance[:, few] = noise + own
        share[:, few] = own / variance[:, few]
        excess += np.sum(power / variance[:, few], axis=1)
    variance *= smoothed(excess / left.shape[1], LEVEL_LINES)[:, None]
    return variance, share


def _correlations(left: RealArray, variance: RealArray, share: RealArray) -> tuple[RealArray, RealArray]:
    """Return the correlations of the even part and of the response's own, one line apart, two lines apart, ..., to where each ends."""

    def sums(few: slice) -> RealArray:
        s, q = np.sqrt(share[:, few]), np.sqrt(1 - share[:, few])
        u = lines_of_rows(left[:, few]) / np.sqrt(variance[:, few])
        return np.array([_at_lags(each) for each in (q * u, s * u, q**2, s**2, q * s)])

    even, own, qq, ss, qs = np.sum([sums(few) for few in few_channels(*variance.shape)], axis=0)
    products = np.stack([even, own], axis=1)
    gram = np.stack([np.stack([qq, qs], axis=1), np.stack([qs, ss], axis=1)], axis=1)
    spread = np.linalg.inv(gram + _VARIANCE_OF_PRODUCT * np.eye(2))
    both = np.clip(np.einsum("kij,kj->ki", spread, products), -1, 1)
    known = np.sqrt(_VARIANCE_OF_PRODUCT * np.einsum("kii->ki", spread))
    even, own = (_ended(both[:, i], known[:, i]) for i in range(2))
    return even, own


def _ended(r: RealArray, known: RealArray) -> RealArray:
    """Return correlations up to where the mean of those ahead is no more than their scatter."""
    if len(r) < _END_LAGS:
        return r
    ahead = np.convolve(r, np.ones(_END_LAGS) / _END_LAGS, mode="valid")
    least = _END_DEVIATIONS * known[: len(ahead)] / np.sqrt(_END_LAGS)
    ended = np.flatnonzero(ahead < least)
    return r[: ended[0]] if ended.size else r


def _at_lags(u: Array) -> RealArray:
    """Return sum Re u_k conj u_k+i of columns (F, c) for i = 1, 2, ..."""
    lags = min(_MAX_LAGS, len(u))
    size, whole = sfft.next_fast_len(len(u) + lags), np.iscomplexobj(u)
    parts = (sfft.fft(u.T, size) if whole else sfft.rfft(u.T, size)).view(np.float64)
    power = np.einsum("ck,ck->k", parts, parts).reshape(-1, 2).sum(axis=1)
    back = sfft.ifft(power).real if whole else sfft.irfft(power, size)
    return np.asarray(back[1:lags])


def _form(correlation: RealArray, rows: ComplexArray, factors: RealArray) -> RealArray:
    """Return Re of conj x' T y for pairs of rows (c, k, 2, F) times factors (c, F), T the correlation matrix of lines, (c, k, 2, 2)."""
    count, lags = rows.shape[-1], len(correlation)
    size = sfft.next_fast_len(count + lags) if lags else count
    across = np.zeros((2, *rows.shape[:2], size), dtype=complex)  # each of a pair in one piece
    # real factors of both parts: half the work of complex ones
    pairs, both = np.moveaxis(rows.view(np.float64), 2, 0), np.repeat(factors, 2, axis=-1)[:, None]
    np.multiply(pairs, both, out=across.view(np.float64)[..., : 2 * count])
    level = np.ones(size)
    if lags:
        kernel = np.zeros(size)
        kernel[0], kernel[1 : lags + 1], kernel[size - lags :] = 1, correlation, correlation[::-1]
        across, level = sfft.fft(across, overwrite_x=True), sfft.fft(kernel).real / size
    (x, y), level = across.view(np.float64), np.repeat(level, 2)
    xx, xy, yy = (x * x) @ level, (x * y) @ level, (y * y) @ level
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-1)


# -------------------------------------------------------------------------------------------------------- channel fits
# Least squares with free residues in every channel, each line with its own weight, and what correlated errors leave open of them.
#
# With columns X of a channel, its covariance C = D T D of errors, D their deviations and T what they have in common: residues
# a = (X' D^-2 X)^-1 X' D^-2 y have the covariance B = M^-1 X' D^-1 T D^-1 X M^-1 / 2 with M = X' D^-2 X.
#
# Channels differ by their weights alone, so that the M of all of them are one product of weights with products of columns, line by line.

#: Maximum count of numbers in the stored matrices M of all channels, and in the columns of channels computed at a time.
_MAX_STORED_NUMBERS, _BLOCK_NUMBERS = 1 << 23, 1 << 18

#: Minimum pivot of unit columns for an inverse by Cholesky; below it the pseudo-inverse is used.
_MIN_PIVOT = 1e-5

#: Squares of columns below this fraction of the largest are rounding.
_ROUNDING_OF_SQUARES = float(np.finfo(float).eps) ** 2


class ChannelFits:
    """Fits of poles and terms to all channels.

    `terms` (K, t). `functions` (K, 2 n): of poles. `data` (K, q, p).
    """

    def __init__(self, terms: RealArray, functions: RealArray, data: RealArray, errors: ColouredErrors) -> None:
        self._columns, self._first = np.vstack([terms.T, functions.T]), terms.shape[1]
        self._data, self._errors = data.reshape(len(data), -1), errors
        self._weights = 1 / errors.variance.reshape(-1, self._data.shape[1])
        self._known: tuple[RealArray, RealArray] | None = None

    def residues(
        self, which: Array, without: Array | None = None, beside: RealArray | None = None, told: int | None = None
    ) -> tuple[RealArray, RealArray]:
        """Return residues a (c, k, 2) of modes in all channels, and their covariances B (c, k, 2, 2).

        `which` (k,): modes. `without`: lines that do not count. `beside` (K, 2 b): more columns in pairs, which count as modes behind
        those that there are. `told`: how many of the modes, from the first on, have a covariance; by default all.
        """
        columns = self._columns if beside is None else np.vstack([self._columns, beside.T])
        own = (self._first + 2 * np.asarray(which)[:, None] + [0, 1]).ravel()
        told = len(which) if told is None else told
        channels, weights = self._data.shape[1], self._weights
        if without is not None:
            weights = weights.copy()
            weights[without] = 0
        a, B = np.empty((channels, len(which), 2)), np.empty((channels, told, 2, 2))
        parts = _side_by_side(columns)
        for few in few_channels(max(columns.shape[1], len(columns) ** 2), channels, MANY_NUMBERS):
            # rows are those of a symmetric matrix
            back = self._inverses(few, without, beside)[:, own]
            weighted = np.tile(weights[:, few], (2, 1)) * self._data[:, few]
            a[few] = np.einsum("cik,kc->ci", back, columns @ weighted).reshape(-1, len(which), 2)
            for some in few_channels(columns.shape[1] * max(2 * told, 1), len(back), _BLOCK_NUMBERS):
                rows = (back[some, : 2 * told].reshape(-1, len(columns)) @ parts).view(np.complex128)
                rows = rows.reshape(-1, told, 2, len(weights))
                if without is not None:
                    rows[..., without] = 0
                B[few][some] = self._errors.covariances(np.arange(channels)[few][some], rows) / 2
        return a, B

    def _inverses(self, some: slice, without: Array | None, beside: RealArray | None) -> RealArray:
        """Return M^-1 of channels; with more columns from those without, by Schur's complement."""
        M, known = self._normals(some)
        weights = self._weights[:, some]
        if without is not None:
            left_out = self._columns[:, np.append(without, without + len(weights))]
            return _inverses(M - _products(left_out, left_out, weights[without]))
        if beside is None:
            return known
        more = beside.T
        across = _products(self._columns, more, weights)
        explained = known @ across
        own = _inverses(_products(more, more, weights) - across.transpose(0, 2, 1) @ explained)
        shared = explained @ own
        upper = np.concatenate([known + shared @ explained.transpose(0, 2, 1), -shared], axis=2)
        return np.concatenate([upper, np.concatenate([-shared.transpose(0, 2, 1), own], axis=2)], axis=1)

    def _normals(self, some: slice) -> tuple[RealArray, RealArray]:
        """Return M and M^-1 of channels, those of all held while they are few numbers."""
        whole = self._data.shape[1] * len(self._columns) ** 2 <= _MAX_STORED_NUMBERS
        if not whole or self._known is None:
            M = _products(self._columns, self._columns, self._weights if whole else self._weights[:, some])
            found = M, _inverses(M)
            if not whole:
                return found
            self._known = found
        return self._known[0][some], self._known[1][some]


def _side_by_side(columns: RealArray) -> RealArray:
    """Return columns (k, 2 F) with the real and the imaginary part of every line side by side."""
    return np.ascontiguousarray(columns.reshape(len(columns), 2, -1).transpose(0, 2, 1)).reshape(columns.shape)


def _products(left: RealArray, right: RealArray, weights: RealArray) -> RealArray:
    """Return the products of columns (k, K) and (b, K) under weights (F, c) of lines, real parts above imaginary ones, (c, k, b)."""
    lines, same = len(weights), left is right
    found = np.empty((weights.shape[1], len(left), len(right)))
    (x, x_imag), (y, y_imag) = ((each[:, :lines], each[:, lines:]) for each in (left, right))
    for j in range(len(right)):
        first = j if same else 0
        line_by_line = x[first:] * y[j] + x_imag[first:] * y_imag[j]
        found[:, first:, j] = (line_by_line @ weights).T
        if same:
            found[:, j, j:] = found[:, j:, j]
    return found


def _inverses(M: RealArray) -> RealArray:
    """Return the inverses, columns brought to one level first; where they lie near each other's span, of what stands out of rounding.

    Columns that are nothing but rounding are left at zero: one function of a pole on the real axis has no length.
    """
    square = np.einsum("cii->ci", M)
    size = np.sqrt(np.where(square > _ROUNDING_OF_SQUARES * square.max(axis=1, initial=0.0)[:, None], square, np.inf))
    scale = size[:, :, None] * size[:, None, :]
    return np.asarray(np.array([_inverse(each) for each in M / scale]).reshape(M.shape) / scale)


def _inverse(even: RealArray) -> RealArray:
    """Return the inverse of the products of unit columns: by Cholesky factors where no pivot is near rounding."""
    L, failed = dpotrf(even, lower=True)
    if failed or L.diagonal().min() <= _MIN_PIVOT:
        return np.asarray(np.linalg.pinv(even, hermitian=True))
    root = dtrtri(L, lower=True)[0]
    return np.asarray(root.T @ root)


# ------------------------------------------------------------------------------------------------------------- recount

#: Relative uncertainty of the estimated error variances: the threshold is multiplied by it.
UNCERTAINTY_OF_VARIANCE = 1.5

#: Half width of the main lobe of a Hann window, in lines; a sinusoid leaks less than a thirtieth of its amplitude beyond.
_LOBE_LINES = 2.0

#: Minimum half-power bandwidth, in lines, of a mode (an unwindowed sinusoid looks narrower) and of a peak of the residual.
_MIN_BANDWIDTH_LINES, _MIN_PEAK_LINES = 0.25, 1.0

#: Modes wider than this many lines are not tested for being a sinusoid: the lobe is 1.44 lines wide at half its power.
_LOBE_TEST_LINES = 3.0

#: Minimum agreement of the residues outside the lobe with those of all lines, and the false-alarm probability of a sinusoid.
_MIN_AGREEMENT, _CHANCE_OF_AGREEMENT = 0.5, 1e-3

#: Minimum MAC of shapes, or of participations, of a mode and its shoulder.
_MIN_SHOULDER_MAC = 0.5

#: sqrt(15) sqrt(5 / 16): third order of a frequency shift, see `beyond_shifts`.
_THIRD_ORDER_OF_SHIFT = 2.165


def inverse(B: Array) -> Array:
    """Return the inverse of what symmetric matrices (..., n, n) know; of those that have nothing but rounding, zero."""
    level = np.max(np.abs(B), axis=(-2, -1), keepdims=True)
    told = level > np.finfo(float).tiny / np.finfo(float).eps
    safe = np.where(told, level, 1)
    return np.asarray(np.where(told, np.linalg.pinv(np.where(told, B, 0) / safe, hermitian=True) / safe, 0))


@dataclass(frozen=True, eq=False)
class Recount:
    """Likelihood ratios under coloured errors, at the end of a joint selection.

    `left` (K, q, p): the residual with free residues.
    """

    selection: SelectionProblem
    descent: Descent
    left: RealArray
    errors: ColouredErrors

    @property
    def bar(self) -> float:
        """What errors may explain with free residues, in variances, including their uncertainty."""
        return UNCERTAINTY_OF_VARIANCE * free_bound(self.left[0].size, len(self.left))

    @cached_property
    def fits(self) -> ChannelFits:
        """Fits of the poles with free residues in every channel."""
        problem = self.selection.problem
        functions = problem.columns(self.descent.point.poles, slopes=False)[0]
        return ChannelFits(problem.terms, functions, problem.data, self.errors)

    def gains(self, which: Array) -> RealArray:
        """Return the likelihood ratios of modes given the others, in variances, (k,): the sum of a_j' B_jj^-1 a_j over channels."""
        a, B = self.fits.residues(which)
        return np.asarray(np.einsum("cki,ckij,ckj->k", a, np.linalg.pinv(B, hermitian=True), a))

    def lasting(self, which: Array) -> Array:
        """Return which modes are resonances, no coherent lines, (k,).

        Such a line lies within the lobe of a window. Of a resonance the lines beyond the lobe tell the same residues: with these, r, and
        their covariance B, and a of all lines, sum a' B^-1 r is normal with the variance sum a' B^-1 a, and that is its mean for a
        resonance, where it is zero for a line.

        `which` (k,).
        """
        poles = self.descent.point.poles[which]
        half, lines = self.selection.half_bandwidths_in_lines(poles), self.selection.problem.light.grid
        assert lines is not None
        at = np.interp(poles.imag / (2 * np.pi), lines, np.arange(lines.size))
        told = 2 * half >= _MIN_BANDWIDTH_LINES
        for k in np.flatnonzero(told & (2 * half < _LOBE_TEST_LINES)):
            lobe = np.flatnonzero(np.abs(np.arange(lines.size) - at[k]) <= _LOBE_LINES)
            a, (r, B) = self.fits.residues(which[[k]])[0], self.fits.residues(which[[k]], without=lobe)
            towards = (np.linalg.pinv(B[:, 0], hermitian=True) @ a[:, 0, :, None])[..., 0]
            agreed, whole = float(np.sum(towards * r[:, 0])), float(np.sum(towards * a[:, 0]))
            told[k] = (
                agreed >= _MIN_AGREEMENT * whole
                and agreed**2 > UNCERTAINTY_OF_VARIANCE * ndtri(_CHANCE_OF_AGREEMENT) ** 2 * whole
            )
        return told

    def hosts(self, which: Array) -> Array:
        """Return the stronger modes that each may be a shoulder of, (k, n): they overlap, with one shape or one participation.

        A resonance that shifts between inputs makes shoulders of its own shape, between outputs of its own participation.
        """
        s, size = self.descent.point.poles, self.descent.fitted.gain
        shapes, participation = self.selection.problem.scaled_back(self.descent.point, self.descent.fitted)
        near = overlap(s[which], s)
        stronger = size[None, :] > size[which, None]
        alike = np.maximum(mac(shapes), mac(participation.T))[which] > _MIN_SHOULDER_MAC
        return np.asarray(near & stronger & alike)

    def beyond_shifts(self, one: int, hosts: Array) -> float:
        """Return the significance of a mode beyond shifts of stronger ones that differ by channel, in standard deviations.

        What a shift e of a pole s leaves is r e g' + r e^2 g'' / 2 + ... with g = 1 / (x - s): the first two are free in every channel. The
        third is (e / h)^3 sqrt(5 / 16) of the mode, h its half bandwidth, and e^3 of normal e scatters by sqrt(15) e^3: that is taken off.

        `hosts` (b,).
        """
        problem, poles = self.selection.problem, self.descent.point.poles[hosts]
        step = -0.05 * poles.real
        first = problem.columns(poles)[1]
        second = (problem.columns(poles + step)[1] - problem.columns(poles - step)[1]) / np.repeat(2 * step, 2)
        count, b = len(self.descent.point.poles), len(hosts)
        which = np.array([one, *hosts, *(count + np.arange(b))])
        a, B = self.fits.residues(which, beside=np.hstack([first, second]), told=b + 1)
        told = inverse(B)
        strength = np.einsum("cki,ckij,ckj->k", a[:, : b + 1], told, a[:, : b + 1])
        level = np.trace(told[:, 1:], axis1=2, axis2=3)
        sizes, shifts = (np.sum(level * np.sum(part**2, axis=2), axis=0) for part in (a[:, 1 : b + 1], a[:, b + 1 :]))
        strength, shifts = np.maximum(strength, 0), np.maximum(shifts, 0)  # sums of squares, but for rounding
        apart = np.sqrt(shifts / np.where(sizes > 0, sizes, np.inf)) / -poles.real
        return float(np.sqrt(strength[0]) - np.sum(_THIRD_ORDER_OF_SHIFT * apart**3 * np.sqrt(strength[1:])))

    def relative_gains(self, which: Array) -> RealArray:
        """Return the significance of modes over what errors may explain, (k,): significant above one.

        Zero outside the band, for coherent lines and heavy damping; shifts of stronger modes are taken off a shoulder.
        """
        poles, (low, high) = self.descent.point.poles[which], self.selection.band
        f, zeta = frequencies_and_damping(poles)
        may = np.flatnonzero((f >= low) & (f <= high) & (zeta < MAX_DAMPING_OF_RESONANCES))
        gains = np.zeros(len(which))
        if may.size:
            gains[may] = np.sqrt(np.maximum(self.gains(which[may]), 0) / self.bar)
        hosts = self.hosts(which)
        for k in np.flatnonzero((gains > 1) & hosts.any(axis=1)):
            beyond = self.beyond_shifts(int(which[k]), np.flatnonzero(hosts[k])) / np.sqrt(self.bar)
            gains[k] = gains[k] if beyond > 1 else 0.0
        out = np.flatnonzero(gains > 1)
        gains[out[~self.lasting(which[out])]] = 0
        return gains

    def peaks(self, most: int, examined: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the strongest peaks of the residual, far from those examined in vain, as poles (k,) and sides (k, p).

        Peaks that overlap modes are small before the joint refinement: a quarter of the threshold is enough, but for those that
        stronger ones hid.
        """
        problem, known = self.selection.problem, self.descent.point.poles
        grid = grid_of(problem.light)
        grid = grid[
            (-grid.real < MAX_DAMPING_OF_RESONANCES * np.abs(grid))
            & (2 * self.selection.half_bandwidths_in_lines(grid) >= _MIN_PEAK_LINES)
        ]
        beside = np.any(np.abs(grid[:, None] - known) < -known.real, axis=1)
        grid = grid[~(beside | np.any(near(grid[:, None], examined), axis=1))]
        given = problem.light, self.left, self.errors.variance, problem.rows
        lines = problem.light.grid
        assert lines is not None
        at = np.searchsorted(lines, grid.imag / (2 * np.pi)).clip(max=lines.size - 1)
        half = self.selection.half_bandwidths_in_lines(grid)
        gain = explained_by_channel(*given, grid) / lag_factor(self.errors.common(at), half)
        first = apart(grid, gain, self.bar / (1 if examined.size else 4), most)
        sides = [np.linalg.svd(residues_by_channel(*given, s), full_matrices=False)[2][0] for s in grid[first]]
        return grid[first], np.array(sides, dtype=complex).reshape(-1, self.left.shape[2])


def recount_of(selection: SelectionProblem, descent: Descent) -> Recount:
    """Estimate coloured errors of lines from the residual of a descent's poles with free residues."""
    problem = selection.problem
    columns = np.hstack([problem.columns(descent.point.poles, slopes=False)[0], problem.terms])
    Q = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
    flat = problem.data.reshape(len(problem.data), -1)
    left = Q @ (Q.T @ flat)
    left = np.subtract(flat, left, out=left).reshape(problem.data.shape)
    whole = problem.data if selection.whole is None else selection.whole
    even = lines_of_rows(1 / problem.rows[:, None]).real[:, 0] ** 2
    return Recount(selection, descent, left, errors_of(left, whole, even, columns.shape[1]))


def lines_of_rows(rows: RealArray) -> ComplexArray:
    """Return lines of real and imaginary parts, one half after the other."""
    real, imag = np.split(rows, 2)
    return np.asarray(real + 1j * imag)
