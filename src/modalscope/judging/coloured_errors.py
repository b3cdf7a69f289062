"""Errors of lines that are even noise and, by their own part, error of the response: how large each is, and how far each reaches.

    C = D (q A q + s K s) D

of a channel: D its deviations, s^2 the part of the variance that belongs to the response, q^2 = 1 - s^2 that of even noise, A and K what
either has in common some lines apart. Noise is large where the response is small, and often white; an error of calibration, of leakage or
of nonlinearity is large where the response is, and smooth. One correlation for both would hide modes under errors that are not there,
and find some where errors are smooth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft as sfft

from modalscope.identification.richer import parts_of_level
from modalscope.identification.whitening import smoothed
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["ColouredErrors", "errors_of"]

#: Lines over which the level of all channels together may depart from that of the rule for one.
_LEVELLED = 41

#: Lags of a correlation at most, and the deviations below which the mean of so many ahead has ended.
_LAGS, _ENDED, _AHEAD = 200, 2.0, 8

#: Variance of a product of two unlike errors, relative to that of either and of a correlation before it is known.
_PRODUCT = 0.5


@dataclass(frozen=True, eq=False, slots=True)
class ColouredErrors:
    """The errors of all channels.

    Parameters
    ----------
    variance : array, (F, q, p)
        Of a complex value.
    share : array, (F, q, p)
        The part of it that belongs to the response.
    even, own : array, (k,), (n,)
        Correlations of the two parts, of values so many lines apart, from one on; zero beyond.
    """

    variance: RealArray
    share: RealArray
    even: RealArray
    own: RealArray

    def common(self, lines: Array) -> RealArray:
        """Return the correlations of errors around lines, all channels together, (n, k).

        Parameters
        ----------
        lines : array of int, (n,)
        """
        share = self.share.mean(axis=(1, 2))[lines, None]
        longest = max(len(self.even), len(self.own))
        even, own = (np.pad(each, (0, longest - len(each))) for each in (self.even, self.own))
        return np.asarray((1 - share) * even + share * own)

    def covariances(self, channels: slice, rows: ComplexArray) -> RealArray:
        """Return Re of conj x' D^-1 (q A q + s K s) D^-1 y for pairs x, y of rows (c, k, 2, F), (c, k, 2, 2).

        Parameters
        ----------
        channels : slice
            Which c, counted over inputs first.
        rows : array of complex, (c, k, 2, F)
        """
        s2, variance = (each.reshape(len(each), -1)[:, channels].T for each in (self.share, self.variance))
        parts = ((self.even, 1 - s2), (self.own, s2))
        even, own = (_form(each, rows, np.sqrt(part / variance)) for each, part in parts)
        return even + own


def errors_of(left: ComplexArray, data: ComplexArray, even: RealArray, unknown: int) -> ColouredErrors:
    """Return the errors as a fit shows them by what it leaves.

    Of every channel a + b |H|^2, the likeliest for squares of complex normal numbers, times what all channels together are of that around
    a line. With u what is left, divided by its deviations, E Re u_k u*_k+i = q_k q_k+i A_i + s_k s_k+i K_i over all lines and channels: two
    unknowns a lag, as likely as any before they are seen (their variance is one, that of a product a half).

    Parameters
    ----------
    left, data : array of complex, (F, q, p)
        What a fit leaves, and the whole response.
    even : array, (F,)
        Squares of what is even noise, up to a factor.
    unknown : int
        Real unknowns a channel.
    """
    power, size = np.abs(left) ** 2, np.abs(data - left) ** 2
    noise, own = parts_of_level(power.reshape(len(left), -1), even, size.reshape(len(left), -1))
    variance = (noise + own).reshape(power.shape)
    share = own.reshape(power.shape) / variance
    variance *= smoothed(np.mean(power / variance, axis=(1, 2)), _LEVELLED)[:, None, None]
    A, K = _correlations((left / np.sqrt(variance)).reshape(len(left), -1), share.reshape(len(left), -1))
    rows = 2 * len(left)
    return ColouredErrors(variance * (rows / max(rows - unknown, 1)), share, A, K)


def _correlations(u: ComplexArray, share: RealArray) -> tuple[RealArray, RealArray]:
    """Return the correlations of the even part and of the response's own, one line apart, two lines apart, ..., to where each ends."""
    s, q = np.sqrt(share), np.sqrt(1 - share)
    products = np.stack([_at_lags(q * u), _at_lags(s * u)], axis=1)
    qq, ss, qs = _at_lags(q**2), _at_lags(s**2), _at_lags(q * s)
    gram = np.stack([np.stack([qq, qs], axis=1), np.stack([qs, ss], axis=1)], axis=1)
    spread = np.linalg.inv(gram + _PRODUCT * np.eye(2))
    both = np.clip(np.einsum("kij,kj->ki", spread, products), -1, 1)
    known = np.sqrt(_PRODUCT * np.einsum("kii->ki", spread))
    even, own = (_ended(both[:, i], known[:, i]) for i in range(2))
    return even, own


def _ended(r: RealArray, known: RealArray) -> RealArray:
    """Return correlations up to where the mean of those ahead is no more than their scatter."""
    if len(r) < _AHEAD:
        return r
    ahead = np.convolve(r, np.ones(_AHEAD) / _AHEAD, mode="valid")
    least = _ENDED * known[: len(ahead)] / np.sqrt(_AHEAD)
    ended = np.flatnonzero(ahead < least)
    return r[: ended[0]] if ended.size else r


def _at_lags(u: Array) -> RealArray:
    """Return sum Re u_k conj u_k+i of columns (F, c) for i = 1, 2, ..."""
    lags = min(_LAGS, len(u))
    size = sfft.next_fast_len(len(u) + lags)
    spectra = sfft.fft(u.T, size) if np.iscomplexobj(u) else sfft.rfft(u.T, size)
    parts = spectra.view(np.float64)
    power = np.einsum("ck,ck->k", parts, parts).reshape(-1, 2).sum(axis=1)
    back = sfft.ifft(power).real if np.iscomplexobj(u) else sfft.irfft(power, size)
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
