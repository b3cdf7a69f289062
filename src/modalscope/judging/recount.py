"""What modes explain of data whose errors are coloured, counted again channel by channel with the covariance that the errors show.

The likelihood that poles are refined by divides every channel by one level over the lines. Errors that are a part of the response are
small where a channel's response is, so that a mode tells more of itself there than that count says.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from modalscope.identification.descent import Descent
from modalscope.identification.matched import amplitudes_by_channel, apart, grid_of
from modalscope.identification.whitening import free_bound, lag_factor
from modalscope.judging.arena import Arena
from modalscope.judging.coloured_errors import ColouredErrors, errors_of
from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.poles import frequencies_and_damping

__all__ = ["Recount", "recount_of"]

#: Errors of channels are no better known than to this factor, in variances: so many bars a mode has to pass.
_SURE = 1.5

#: A coherent line under Hann's window lies within so many lines of its frequency, and leaks less than a thirtieth beyond.
_LOBE = 2.0

#: What is narrower than a line at half its power tells no width.
_NARROWEST = 1.0

#: What the lines beyond the lobe say of a mode is that by this part at least; chance has one case of a thousand.
_AGREED, _CHANCE = 0.5, 1e-3

#: Shapes of less than this MAC are not those of one resonance that shifts.
_UNLIKE = 0.5

#: With more damping than this a peak of what is left may stand for modes outside the band.
_DAMPED = 0.1


@dataclass(frozen=True, eq=False, slots=True)
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

    def gains(self, which: Array) -> RealArray:
        """Return what modes explain beside the others, in variances, (k,).

        The sum of a_j' B_jj^-1 a_j over channels, see `_residues`.

        Parameters
        ----------
        which : array of int, (k,)
            Modes.
        """
        total = np.zeros(len(which))
        for a, B in self._residues(which):
            total += [each @ np.linalg.pinv(own, hermitian=True) @ each for each, own in zip(a, B, strict=True)]
        return total

    def _residues(self, which: Array, lines: Array | None = None) -> Iterator[tuple[RealArray, RealArray]]:
        """Return residues (k, 2) and their covariance (k, 2, 2), channel by channel.

        With weighted least squares and columns X of a channel, covariance C = D T D of its errors, D their deviations and T what they have
        in common: residues a = (X' D^-2 X)^-1 X' D^-2 y have the covariance B = M^-1 X' D^-1 T D^-1 X M^-1 / 2.

        Parameters
        ----------
        which : array of int, (k,)
        lines : array of bool, (F,), optional
            Those that count; all without it.
        """
        problem, poles = self.arena.problem, self.descent.point.poles
        X = _complex(np.hstack([problem.columns(poles, slopes=False)[0], problem.terms]))
        y = _complex(problem.data)
        own = (2 * np.asarray(which)[:, None] + [0, 1]).ravel()
        for channel in np.ndindex(*self.left.shape[1:]):
            weight = 1 / np.sqrt(self.errors.variance[:, *channel])
            weight = weight if lines is None else weight * lines
            Z = X * weight[:, None]
            size = np.maximum(np.linalg.norm(Z, axis=0), 1e-300)
            Z /= size
            back = np.linalg.pinv((Z.conj().T @ Z).real, hermitian=True)[:, own]
            from_errors = Z @ back
            a = back.T @ (Z.conj().T @ (y[:, *channel] * weight)).real / size[own]
            B = (from_errors.conj().T @ self.errors.times((channel[0], channel[1]), from_errors)).real / 2
            B /= np.outer(size[own], size[own])
            k = np.arange(len(which))
            yield a.reshape(-1, 2), B.reshape(len(which), 2, len(which), 2)[k, :, k]

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
        for k in np.flatnonzero(told):
            beyond = np.abs(np.arange(lines.size) - at[k]) > _LOBE
            agreed, whole = 0.0, 0.0
            both = zip(self._residues(which[[k]]), self._residues(which[[k]], beyond), strict=True)
            for (a, _), (r, B) in both:
                towards = np.linalg.pinv(B[0], hermitian=True) @ a[0]
                agreed, whole = agreed + float(towards @ r[0]), whole + float(towards @ a[0])
            told[k] = agreed >= _AGREED * whole and agreed**2 > _SURE * ndtri(_CHANCE) ** 2 * whole
        return told

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
        may = np.flatnonzero(self.own(which) & (f >= low) & (f <= high) & (zeta < _DAMPED))
        gains = np.zeros(len(which))
        if may.size:
            gains[may] = np.sqrt(np.maximum(self.gains(which[may]), 0) / self.bar)
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
        grid = grid[(-grid.real < _DAMPED * np.abs(grid)) & (2 * self.arena.half_in_lines(grid) >= _NARROWEST)]
        grid = grid[~np.any(np.abs(grid[:, None] - known) < -known.real, axis=1)]
        weights = np.tile(2 / self.errors.variance, (2, 1, 1))
        residues, each = amplitudes_by_channel(problem.light, self.left, weights, problem.rows, grid)
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
