"""What modes explain of data whose errors are coloured, counted again channel by channel with the covariance that the errors show.

The likelihood that poles are refined by divides every channel by one level over the lines. Errors that are a part of the response are
small where a channel's response is, so that a mode tells more of itself there than that count says.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtri

from modalscope.identification.descent import Descent
from modalscope.identification.matched import amplitudes_by_channel, apart, grid_of
from modalscope.identification.whitening import free_bound, lag_factor
from modalscope.judging.arena import Arena
from modalscope.judging.channel_fits import ChannelFits
from modalscope.judging.coloured_errors import ColouredErrors, errors_of
from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import frequencies_and_damping, overlap

__all__ = ["Recount", "inverse", "recount_of"]

#: Errors of channels are no better known than to this factor, in variances: so many bars a mode has to pass.
_SURE = 1.5

#: A coherent line under Hann's window lies within so many lines of its frequency, and leaks less than a thirtieth beyond.
_LOBE = 2.0

#: What is narrower than this part of a line at half its power is none: a line leaks like that where no window was. Peaks are a line wide.
_NARROWEST, _PEAK = 0.25, 1.0

#: The lobe is 1.44 lines wide at half its power; what is twice as wide and more lies beyond it.
_WIDE = 3.0

#: What the lines beyond the lobe say of a mode is that by this part at least; chance has one case of a thousand.
_AGREED, _CHANCE = 0.5, 1e-3

#: Shapes of less than this MAC are not those of one resonance that shifts.
_UNLIKE = 0.5

#: sqrt(15) sqrt(5 / 16): the third order of a shift, see `beyond_shifts`.
_THIRD = 2.165

#: With more damping than this a peak of what is left may stand for modes outside the band.
_DAMPED = 0.1


def inverse(B: Array) -> Array:
    """Return the inverse of what symmetric matrices (..., n, n) know; of those that have nothing but rounding, zero."""
    level = np.max(np.abs(B), axis=(-2, -1), keepdims=True)
    told = level > np.finfo(float).tiny / np.finfo(float).eps
    safe = np.where(told, level, 1)
    return np.asarray(np.where(told, np.linalg.pinv(np.where(told, B, 0) / safe, hermitian=True) / safe, 0))


@dataclass(frozen=True, eq=False)
class Recount:
    """The errors of all channels at the end of a contest.

    Parameters
    ----------
    arena : Arena
    descent : Descent
    left : array, (K, q, p)
        What the poles with free residues leave.
    errors : ColouredErrors
    """

    arena: Arena
    descent: Descent
    left: RealArray
    errors: ColouredErrors

    @property
    def bar(self) -> float:
        """What errors may explain with free residues, in variances, with what is not known of them."""
        return _SURE * free_bound(self.left[0].size, len(self.left))

    @cached_property
    def fits(self) -> ChannelFits:
        """Fits of the poles with free residues in every channel."""
        problem = self.arena.problem
        functions = problem.columns(self.descent.point.poles, slopes=False)[0]
        return ChannelFits(problem.terms, functions, problem.data, self.errors)

    def gains(self, which: Array) -> RealArray:
        """Return what modes explain beside the others, in variances, (k,): the sum of a_j' B_jj^-1 a_j over channels.

        Parameters
        ----------
        which : array of int, (k,)
            Modes.
        """
        a, B = self.fits.residues(which)
        return np.asarray(np.einsum("cki,ckij,ckj->k", a, np.linalg.pinv(B, hermitian=True), a))

    def lasting(self, which: Array) -> Array:
        """Return which modes are as wide as they are said to be, (k,): what a coherent line is not.

        Such a line lies within the lobe of a window. Of a resonance the lines beyond the lobe tell the same residues: with these, r, and
        their covariance B, and a of all lines, sum a' B^-1 r is normal with the variance sum a' B^-1 a, and that is its mean for a
        resonance, where it is zero for a line.

        Parameters
        ----------
        which : array of int, (k,)
        """
        poles = self.descent.point.poles[which]
        half, lines = self.arena.half_in_lines(poles), self.arena.problem.light.grid
        assert lines is not None
        at = np.interp(poles.imag / (2 * np.pi), lines, np.arange(lines.size))
        told = 2 * half >= _NARROWEST
        for k in np.flatnonzero(told & (2 * half < _WIDE)):
            lobe = np.flatnonzero(np.abs(np.arange(lines.size) - at[k]) <= _LOBE)
            a, (r, B) = self.fits.residues(which[[k]])[0], self.fits.residues(which[[k]], without=lobe)
            towards = (np.linalg.pinv(B[:, 0], hermitian=True) @ a[:, 0, :, None])[..., 0]
            agreed, whole = float(np.sum(towards * r[:, 0])), float(np.sum(towards * a[:, 0]))
            told[k] = agreed >= _AGREED * whole and agreed**2 > _SURE * ndtri(_CHANCE) ** 2 * whole
        return told

    def hosts(self, which: Array) -> Array:
        """Return the stronger modes that each may be a shoulder of, (k, n): they overlap, and have one shape or one participation.

        A resonance that shifts from input to input makes shoulders of its own shape, one that shifts from output to output such of its own
        participation.

        Parameters
        ----------
        which : array of int, (k,)
        """
        s, size = self.descent.point.poles, self.descent.fitted.gain
        shapes, participation = self.arena.problem.scaled_back(self.descent.point, self.descent.fitted)
        near = overlap(s[which], s)
        stronger = size[None, :] > size[which, None]
        alike = np.maximum(mac(shapes), mac(participation.T))[which] > _UNLIKE
        return np.asarray(near & stronger & alike)

    def beyond_shifts(self, one: int, hosts: Array) -> float:
        """Return what a mode explains that stronger ones do not when they shift by other amounts in every channel, in deviations.

        What a shift e of a pole s leaves is r e g' + r e^2 g'' / 2 + ... with g = 1 / (x - s): the first two are free in every channel. The
        third is (e / h)^3 sqrt(5 / 16) of the mode, h its half bandwidth, and e^3 of normal e scatters by sqrt(15) e^3: that is taken off.

        Parameters
        ----------
        one : int
        hosts : array of int, (b,)
        """
        problem, poles = self.arena.problem, self.descent.point.poles[hosts]
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
        return float(np.sqrt(strength[0]) - np.sum(_THIRD * apart**3 * np.sqrt(strength[1:])))

    def standing(self, which: Array) -> RealArray:
        """Return the gains of modes, in deviations and relative to what errors may explain, (k,): above one they stand out.

        Zero for those outside the band, coherent lines and such that are damped like what lies outside; a shoulder has what shifts leave.

        Parameters
        ----------
        which : array of int, (k,)
        """
        poles, (low, high) = self.descent.point.poles[which], self.arena.band
        f, zeta = frequencies_and_damping(poles)
        may = np.flatnonzero((f >= low) & (f <= high) & (zeta < _DAMPED))
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

    def peaks(self, most: int) -> tuple[ComplexArray, ComplexArray]:
        """Return the poles (k,) that may stand out of what is left, the strongest first, and their sides (k, p).

        What overlaps with others shows little of itself before they are refined beside it: a quarter of the bar is enough here.

        Parameters
        ----------
        most : int
        """
        problem, known = self.arena.problem, self.descent.point.poles
        grid = grid_of(problem.light)
        grid = grid[(-grid.real < _DAMPED * np.abs(grid)) & (2 * self.arena.half_in_lines(grid) >= _PEAK)]
        grid = grid[~np.any(np.abs(grid[:, None] - known) < -known.real, axis=1)]
        residues, each = amplitudes_by_channel(problem.light, self.left, 2 / self.errors.variance, problem.rows, grid)
        lines = problem.light.grid
        assert lines is not None
        near = np.searchsorted(lines, grid.imag / (2 * np.pi)).clip(max=lines.size - 1)
        gain = each.sum(axis=(1, 2)) / lag_factor(self.errors.common(near), self.arena.half_in_lines(grid))
        first = apart(grid, gain, self.bar / 4, most)
        sides = [np.linalg.svd(residues[k])[2][0] for k in first]
        return grid[first], np.array(sides, dtype=complex).reshape(-1, self.left.shape[2])


def recount_of(arena: Arena, descent: Descent) -> Recount:
    """Return the errors as what the poles of a descent leave, with free residues, shows them.

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
    whole = _complex(problem.data if arena.whole is None else arena.whole)
    even = _complex(1 / problem.rows[:, None]).real[:, 0] ** 2
    return Recount(arena, descent, left, errors_of(_complex(left), whole, even, columns.shape[1]))


def _complex(rows: RealArray) -> ComplexArray:
    """Return lines of real and imaginary parts, one half after the other."""
    real, imag = np.split(rows, 2)
    return np.asarray(real + 1j * imag)
