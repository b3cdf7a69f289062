"""Where poles contend: the data, what a mode has to pass there, and what it is worth in noise that is correlated over lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.likelihood.likelihood import Whitened
from modalscope.likelihood.whitening import told_apart, told_under_window
from modalscope.numerics.checks import ComplexArray, RealArray

__all__ = ["SelectionProblem"]


@dataclass(frozen=True, eq=False, slots=True)
class SelectionProblem:
    """The data, and what a mode has to pass.

    `problem`: data divided by the noise of rows and channels. `variance`: of what is left of them by a richer model. `bar`: what noise
    may explain, in variances. `band`: hz. `brief`: whether poles are refined roughly. `coloured`: whether what is left of the data is
    more than noise: then nothing is looked for in it, collinear neighbours are not taken for two modes of which one may be noise, and the
    variance stays what it is. `recounted`: whether of coloured data what is left says how errors are correlated, so that modes which few
    orders show are counted again. `correlation` (F,): of the noise on neighbouring lines, which the rows' deviations already count in
    full. `whole` (K, q, p): the divided data with what the terms explain, where errors may be a part of them; without it where it is not
    given. `window`: a T of an exponential window that noise on lines lies under.
    """

    problem: Whitened
    variance: float
    bar: float
    band: tuple[float, float]
    brief: bool = False
    coloured: bool = False
    recounted: bool = True
    correlation: RealArray | None = None
    whole: RealArray | None = None
    window: float = 0.0

    def worth(self, poles: ComplexArray) -> RealArray:
        """Return by what the gain of poles is to be multiplied, (n,): see `told_apart` and `told_under_window`."""
        if self.correlation is not None:
            return told_apart(*self._on_lines(poles))
        if self.window > 0:
            # b / (2 pi) is the half bandwidth, so that b T is 2 pi of it in lines
            return told_under_window(self.window, 2 * np.pi * self.half_in_lines(poles))
        return np.ones(len(poles))

    def half_in_lines(self, poles: ComplexArray) -> RealArray:
        """Return the half bandwidths of poles in lines, (n,)."""
        lines = self.problem.light.grid
        assert lines is not None
        return np.asarray(-poles.real / (2 * np.pi) / np.interp(poles.imag / (2 * np.pi), lines, np.gradient(lines)))

    def _on_lines(self, poles: ComplexArray) -> tuple[RealArray, RealArray]:
        """Return the correlation of neighbouring lines at poles and their half bandwidths in lines, (n,) each."""
        lines = self.problem.light.grid
        assert lines is not None
        assert self.correlation is not None
        return np.interp(poles.imag / (2 * np.pi), lines, self.correlation), self.half_in_lines(poles)
