"""Pose the joint selection of poles: whitened data, threshold of significance, and gains in correlated noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.data.response import line_step
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.selection.likelihood.likelihood import WhitenedResponse
from modalscope.selection.likelihood.settling import MIN_DISTANCE_LINES
from modalscope.selection.likelihood.whitening import gain_factor_in_correlated_noise, gain_factor_under_window

#: Damping ratio from which a pole may stand for modes outside the band rather than for a resonance in it.
MAX_DAMPING_OF_RESONANCES = 0.1

#: A pole farther outside the band than this part of its end, and than lines from where out-of-band poles stand for it, takes no part, nor
#: one more damped than this.
_MAX_OUTSIDE, _MAX_DAMPING = 0.1, 0.9

#: Minimum half-power bandwidth among coloured errors, in lines: what is narrower fits a single line.
_MIN_BANDWIDTH = 0.1


@dataclass(frozen=True, eq=False, slots=True)
class SelectionProblem:
    """Whitened data, and the threshold that a mode has to pass.

    `variance`: of the residual of the reference model. `bar`: what noise may explain, in variances. `band`: Hz. `brief`: refine poles
    roughly. `coloured`: the residual is more than noise: no poles are searched in it, collinear neighbours stay, the variance is fixed.
    `recounted`: the residual gives the covariance of coloured errors, by which rarely shown modes are judged. `correlation` (F,): of
    noise on neighbouring lines, which the deviations of rows already contain. `whole` (K, q, p): the divided data including the terms.
    `window`: a T of an exponential window on the noise.
    """

    problem: WhitenedResponse
    variance: float
    bar: float
    band: tuple[float, float]
    brief: bool = False
    coloured: bool = False
    recounted: bool = True
    correlation: RealArray | None = None
    whole: RealArray | None = None
    window: float = 0.0

    def gain_factors(self, poles: ComplexArray) -> RealArray:
        """Return the factor of each pole's gain, (n,), for noise that is correlated or lies under a window."""
        lines = self.problem.light.grid
        if self.correlation is not None and lines is not None:
            correlation = np.interp(poles.imag / (2 * np.pi), lines, self.correlation)
            return gain_factor_in_correlated_noise(correlation, self.half_bandwidths_in_lines(poles))
        if self.window > 0:
            # b / (2 pi) is the half bandwidth, so that b T is 2 pi of it in lines
            return gain_factor_under_window(self.window, 2 * np.pi * self.half_bandwidths_in_lines(poles))
        return np.ones(len(poles))

    def possible(self, poles: ComplexArray) -> Array:
        """Return which poles may stand in a selection, (n,): near the band, not overdamped; in coloured errors wider than a part of a line.

        Poles of much damping stay in coloured errors: they fit what is smooth there, and modes without them would not stand out.
        """
        low, high = self.band
        f, zeta = frequencies_and_damping(poles)
        lines = MIN_DISTANCE_LINES * line_step(self.problem.light)
        near = (f > low - max(_MAX_OUTSIDE * low, lines)) & (f < high + max(_MAX_OUTSIDE * high, lines))
        possible = near & (zeta < _MAX_DAMPING)
        if self.coloured:
            possible &= 2 * self.half_bandwidths_in_lines(poles) > _MIN_BANDWIDTH
        return np.asarray(possible)

    def half_bandwidths_in_lines(self, poles: ComplexArray) -> RealArray:
        """Return the half bandwidths of poles in lines, (n,)."""
        lines = self.problem.light.grid
        assert lines is not None
        return np.asarray(-poles.real / (2 * np.pi) / np.interp(poles.imag / (2 * np.pi), lines, np.gradient(lines)))
