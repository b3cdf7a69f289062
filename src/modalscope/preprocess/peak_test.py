"""Test whether the lines of an ambient record have a peak at a pole, in any combination of its outputs."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike
from scipy import special

from modalscope.data.records import Signals
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.preprocess.harmonics import Spectrum

#: The name of the indicator.
PEAK = "peak"

#: Lines within a half bandwidth are a peak's own, so many at least on either side; its surroundings lie within these half bandwidths.
_OWN_LINES, _SURROUNDINGS = 4, (1.5, 5.0)

#: Surroundings need so many lines an output for an inverse that is known; a record of fewer is not tested.
_LINES_EACH = 4

#: Lines of a Hann window that are worth an independent one.
_CORRELATED = 1.5

#: A peak this high is one whatever the number of lines; a lower one has to exceed this chance, shared by all that might be tested.
_HIGH, _CHANCE = 2.0, 0.01

#: Lines of either set that are used at most, evenly spread.
_MOST = 2000


def peak_heights(record: Signals, frequencies: ArrayLike, damping_ratios: ArrayLike) -> RealArray:
    """Return how high the peak at every pole stands, (n,): 1 is the limit, and infinity stands where it cannot be tested.

    S_i is the mean of Y Y* over the lines within h = f zeta (four lines at least), S_o over those from 1.5 h to 5 h on both sides. The
    largest lambda of S_i w = lambda S_o w is the height in the combination w of the outputs that shows it best, and
    r = 2 n (lambda - 1 - log lambda), n = n_i n_o / (n_i + n_o) / 1.5, its likelihood ratio, about chi-squared with 2 l degrees of
    freedom where there is no peak. The result is the larger of lambda / 2 and r over the quantile 1 - .01 / trials, as many
    trials as windows fit in the record's lines. Other modes in the surroundings lower it in their own combinations alone, so that a single
    output is not tested, nor are surroundings with fewer than four lines an output. A pole with a half bandwidth of less than a line has
    1 at most: a sinusoid looks like that.

    `frequencies` (n,): hz. `damping_ratios` (n,).
    """
    f, zeta = np.atleast_1d(np.asarray(frequencies, float)), np.atleast_1d(np.asarray(damping_ratios, float))
    if len(record.output_dofs) < 2:
        return np.full(f.size, np.inf)
    spectrum = Spectrum.of(record)
    X = spectrum.lines / np.sqrt(np.maximum(np.mean(np.abs(spectrum.lines) ** 2, axis=(0, 1)), np.finfo(float).tiny))
    widths = np.abs(f * zeta) / spectrum.step
    places = zip(f / spectrum.step, np.maximum(widths, _OWN_LINES), strict=True)
    found = np.array([_height(X, place, half) for place, half in places])
    return np.where((widths < 1) & np.isfinite(found), np.minimum(found, 1.0), found)


def _height(X: ComplexArray, place: float, half: float) -> float:
    """Return the height of a peak at a place and with a half width in lines; lines (R, F, l)."""
    near, far = (width * half for width in _SURROUNDINGS)
    count, outputs = X.shape[1:]
    own = _between(place - half, place + half, count)
    around = np.concatenate([_between(place - far, place - near, count), _between(place + near, place + far, count)])
    own, around = (lines[:: -(-lines.size // _MOST)] if lines.size else lines for lines in (own, around))
    n_i, n_o = (len(X) * lines.size for lines in (own, around))
    if n_o < _LINES_EACH * outputs or not n_i:
        return float("inf")
    inside, outside = (_mean(X[:, lines].reshape(-1, outputs)) for lines in (own, around))
    try:
        height = float(sla.eigh(inside, outside, eigvals_only=True, subset_by_index=[outputs - 1, outputs - 1])[0])
    except np.linalg.LinAlgError:
        return float("inf")
    n = n_i * n_o / (n_i + n_o) / _CORRELATED
    rise = 2 * n * (height - 1 - np.log(height)) if height > 1 else 0.0
    trials = max(count / (2 * half), 1.0)
    return float(max(height / _HIGH, rise / special.chdtri(2 * outputs, _CHANCE / trials)))


def _between(low: float, high: float, count: int) -> IntArray:
    """Return the lines from one place to another, but the first two, in which the rest of a straight line is."""
    return np.arange(max(int(np.ceil(low)), 2), min(int(np.floor(high)), count - 1) + 1)


def _mean(Y: ComplexArray) -> ComplexArray:
    return np.asarray(Y.T @ Y.conj() / len(Y))
