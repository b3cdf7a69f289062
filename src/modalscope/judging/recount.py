"""What modes explain of data whose errors are coloured, counted again channel by channel with the covariance that the errors show.

The likelihood that poles are refined by divides every channel by one level over the lines. Errors that are a part of the response are
small where a channel's response is, so that a mode tells more of itself there than that count says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft as sfft

from modalscope.identification.descent import Descent
from modalscope.identification.matched import amplitudes_by_channel, apart, grid_of
from modalscope.identification.richer import level_of
from modalscope.identification.whitening import free_bound, lag_factor, smoothed
from modalscope.judging.arena import Arena
from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import frequencies_and_damping

__all__ = ["Recount", "recount_of"]

#: Errors of channels are no better known than to this factor, in variances: so many bars a mode has to pass.
_SURE = 2.0

#: A coherent line under Hann's window is 1.44 lines wide at half its power; what is twice as wide is none.
_LOBE = 3.0

#: Shapes of less than this MAC are not those of one resonance that shifts.
_UNLIKE = 0.5

#: With more damping than this a peak of what is left may stand for modes outside the band.
_DAMPED = 0.1

#: Lines over which the level of all channels together may depart from that of the rule for one.
_LEVELLED = 41

#: Lags of the correlation at most, and the deviations below which the mean of so many ahead has ended.
_LAGS, _ENDED, _AHEAD = 200, 2.0, 8


@dataclass(frozen=True, eq=False, slots=True)
class Recount:
    """The errors of all channels at the end of a contest.

    Parameters
    ----------
    arena : Arena
    descent : Descent
    left : array, (K, q, p)
        What the poles with free residues leave.
    variance : array, (F, q, p)
        Of a complex value of that.
    correlation : array, (k,)
        Of values so many lines apart, from one on.
    """

    arena: Arena
    descent: Descent
    left: RealArray
    variance: RealArray
    correlation: RealArray

    @property
    def bar(self) -> float:
        """What errors may explain with free residues, in variances, with what is not known of them."""
        return _SURE * free_bound(self.left[0].size, len(self.left))

    def gains(self, which: Array) -> RealArray:
        """Return what modes explain beside the others, in variances, (k,).

        With weighted least squares and columns X of a channel, covariance C = D T D of its errors, D their deviations and T the
        correlation between lines: residues a = (X' D^-2 X)^-1 X' D^-2 y have the covariance B = M^-1 X' D^-1 T D^-1 X M^-1 / 2, and the
        gain is the sum of a_j' B_jj^-1 a_j over channels.

        Parameters
        ----------
        which : array of int, (k,)
            Modes.
        """
        problem, poles = self.arena.problem, self.descent.point.poles
        X = _complex(np.hstack([problem.columns(poles, slopes=False)[0], problem.terms]))
        y, total = _complex(problem.data), np.zeros(len(which))
        own = (2 * np.asarray(which)[:, None] + [0, 1]).ravel()
        for channel in np.ndindex(*self.left.shape[1:]):
            weight = 1 / np.sqrt(self.variance[:, *channel])
            Z = X * weight[:, None]
            Z /= np.maximum(np.linalg.norm(Z, axis=0), 1e-300)
            back = np.linalg.pinv((Z.conj().T @ Z).real, hermitian=True)[:, own]
            a = back.T @ (Z.conj().T @ (y[:, *channel] * weight)).real
            from_errors = Z @ back
            B = (from_errors.conj().T @ _toeplitz(self.correlation, from_errors)).real / 2
            for k in range(len(which)):
                pair = slice(2 * k, 2 * k + 2)
                total[k] += float(a[pair] @ np.linalg.pinv(B[pair, pair], hermitian=True) @ a[pair])
        return total

    def wide(self, poles: ComplexArray) -> Array:
        """Return which poles span so many lines that neither one error of neighbouring lines nor a coherent line can pass for them, (n,).

        A resonance agrees with itself over sum_i 1 / (1 + (i / 2 h)^2) = 2 pi h lines, errors over 1 + 2 sum_i r_i: twice that is asked.

        Parameters
        ----------
        poles : array of complex, (n,)
        """
        half = self.arena.half_in_lines(poles)
        return np.asarray((2 * half >= _LOBE) & (np.pi * half >= 1 + 2 * self.correlation.sum()))

    def own(self, which: Array) -> Array:
        """Return which modes are no shoulder of a stronger one, (k,).

        A resonance that shifts from input to input makes shoulders of its own shape, one that shifts from output to output such of its own
        participation.

        Parameters
        ----------
        which : array of int, (k,)
        """
        s, size = self.descent.point.poles, self.descent.fitted.gain
        shapes, participation = self.arena.problem.scaled_back(self.descent.point, self.descent.fitted)
        near = np.abs(s.imag[which, None] - s.imag) < -(s.real[which, None] + s.real)
        stronger = size[None, :] > size[which, None]
        alike = np.maximum(mac(shapes), mac(participation.T))[which] > _UNLIKE
        return np.asarray(~np.any(near & stronger & alike, axis=1))

    def standing(self, which: Array) -> RealArray:
        """Return the gains of modes, in deviations and relative to what errors may explain, (k,): above one they stand out.

        Zero for those outside the band, shoulders, narrow ones and such that are damped like what lies outside.

        Parameters
        ----------
        which : array of int, (k,)
        """
        poles, (low, high) = self.descent.point.poles[which], self.arena.band
        f, zeta = frequencies_and_damping(poles)
        may = self.wide(poles) & self.own(which) & (f >= low) & (f <= high) & (zeta < _DAMPED)
        gains = np.zeros(len(which))
        if np.any(may):
            gains[may] = np.sqrt(np.maximum(self.gains(np.asarray(which)[may]), 0) / self.bar)
        return gains

    def peaks(self, most: int) -> tuple[ComplexArray, ComplexArray]:
        """Return the poles (k,) that may stand out of what is left, the strongest first, and their sides (k, p).

        What overlaps with others shows little of itself before they are refined beside it: a quarter of the bar is enough here.

        Parameters
        ----------
        most : int
        """
        problem, known = self.arena.problem, self.descent.point.poles
        grid = grid_of(problem.light)
        grid = grid[(-grid.real < _DAMPED * np.abs(grid)) & self.wide(grid)]
        grid = grid[~np.any(np.abs(grid[:, None] - known) < -known.real, axis=1)]
        weights = np.tile(2 / self.variance, (2, 1, 1))
        residues, each = amplitudes_by_channel(problem.light, self.left, weights, problem.rows, grid)
        gain = each.sum(axis=(1, 2)) / lag_factor(self.correlation, self.arena.half_in_lines(grid))
        first = apart(grid, gain, self.bar / 4, most)
        sides = [np.linalg.svd(residues[k])[2][0] for k in first]
        return grid[first], np.array(sides, dtype=complex).reshape(-1, self.left.shape[2])


def recount_of(arena: Arena, descent: Descent) -> Recount:
    """Return the errors as what the poles of a descent leave shows them.

    Of every channel a + b |H|^2, the likeliest for squares of complex normal numbers, times what all channels together are of that around
    a line. The correlation over lines is one for all channels.

    Parameters
    ----------
    arena : Arena
        Of lines whose errors are coloured.
    descent : Descent
    """
    problem = arena.problem
    columns = np.hstack([problem.columns(descent.point.poles, slopes=False)[0], problem.terms])
    Q = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
    flat = problem.data.reshape(len(problem.data), -1)
    left = (flat - Q @ (Q.T @ flat)).reshape(problem.data.shape)
    e, H = _complex(left), _complex(problem.data if arena.whole is None else arena.whole)
    even = _complex(1 / problem.rows[:, None, None]).real ** 2
    power, size = np.abs(e) ** 2, np.abs(H - e) ** 2
    variance = np.empty(power.shape)
    for channel in np.ndindex(*power.shape[1:]):
        variance[:, *channel] = level_of(power[:, *channel], even[:, 0, 0], size[:, *channel])
    variance *= smoothed(np.mean(power / variance, axis=(1, 2)), _LEVELLED)[:, None, None]
    u = e / np.sqrt(variance)
    r = _correlation(u.reshape(len(u), -1))
    ahead = np.convolve(r, np.ones(_AHEAD) / _AHEAD, mode="valid") if len(r) >= _AHEAD else r
    ended = np.flatnonzero(ahead < _ENDED / np.sqrt(2 * u.size * _AHEAD))
    r = r[: ended[0]] if ended.size else r
    variance *= len(left) / max(len(left) - columns.shape[1], 1)
    return Recount(arena, descent, left, variance, r)


def _correlation(u: ComplexArray) -> RealArray:
    """Return the mean correlation of columns (F, c) with themselves one line on, two lines on, ..."""
    count = len(u)
    power = np.sum(np.abs(sfft.fft(u, 2 * count, axis=0)) ** 2, axis=1)
    sums = sfft.ifft(power).real[: min(_LAGS, count)] / (count - np.arange(min(_LAGS, count)))
    return np.asarray(sums[1:] / max(sums[0], 1e-300))


def _complex(rows: RealArray) -> ComplexArray:
    """Return lines of real and imaginary parts, one half after the other."""
    real, imag = np.split(rows, 2)
    return np.asarray(real + 1j * imag)


def _toeplitz(correlation: RealArray, columns: ComplexArray) -> ComplexArray:
    """Return the correlation matrix of lines times columns (F, k), by transforms of twice the length."""
    count, lags = len(columns), len(correlation)
    if not lags:
        return columns
    size = sfft.next_fast_len(count + lags)
    kernel = np.zeros(size)
    kernel[0], kernel[1 : lags + 1], kernel[size - lags :] = 1, correlation, correlation[::-1]
    product = sfft.fft(kernel)[:, None] * sfft.fft(columns, size, axis=0)
    return np.asarray(sfft.ifft(product, axis=0)[:count])
