"""The noise of every channel, from a model that is richer than any that is reported."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from modalscope.identification.whitening import Colour, Levels, colour, from_variance, levels_of, row_deviations
from modalscope.model.checks import Array, RealArray
from modalscope.model.response import Response

__all__ = ["Floor", "by_line", "floor_of"]

#: Columns of the richer model are no more than this part of the rows: the rest tells the noise.
_COLUMNS = 0.5

#: Lines over which the level of a coloured residual is smoothed, and the correlation of neighbours; which is white below so many
#: deviations, and lengthens the noise by this factor at most.
_LEVELLED, _CORRELATED, _WHITE, _LONGEST = 41, 81, 2.0, 99.0

#: Noise is no less than rounding, relative to the data.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False, slots=True)
class Floor:
    """What a richer model leaves: the noise, where the data are of a linear structure.

    Parameters
    ----------
    rows : array, (K,)
        Deviations of the rows, relative to each other.
    levels : Levels
        Deviations of the channels.
    variance : float
        Of a row divided by all of these.
    colour : Colour
    left : array, (K, l, m)
        The residual, not divided.
    """

    rows: RealArray
    levels: Levels
    variance: float
    colour: Colour
    left: RealArray


def floor_of(response: Response, poles: Array) -> Floor:
    """Fit poles (n,) in rad/s with free residues in every channel, and the residual terms, and judge what is left.

    sigma_om^2 = RSS_om / (rows - columns) of channel (o, m), so s_i nearest to it in the logarithm.
    """
    powers = response.outside_powers
    basis = response.basis(_few(response, poles), powers)
    rows = len(basis.data)
    by_row, known = row_deviations(rows, None), None
    if response.known_variance is not None:
        by_row, known = from_variance(response.known_variance, rows)
    columns = basis.columns / by_row[:, None]
    size = np.linalg.norm(columns, axis=0)
    Q = np.asarray(sla.qr(columns[:, size > 0] / size[size > 0], mode="economic", check_finite=False)[0])
    flat = basis.data.reshape(rows, -1) / by_row[:, None]
    left = (flat - Q @ (Q.T @ flat)).reshape(basis.data.shape)
    least = _ROUNDING * np.sqrt(np.mean(flat**2))
    sigma = np.maximum(np.sqrt(np.sum(left**2, axis=0) / max(rows - Q.shape[1], 1)), least)
    levels = known or levels_of(sigma)
    variance = float(np.mean((sigma / np.outer(levels.outputs, levels.inputs)) ** 2))
    # a model that is too rich follows the noise of samples while its poles last, and not later: there the level tells nothing
    seen = colour(left, response.count, Q.shape[1], level=response.grid is not None)
    return Floor(by_row, levels, variance, seen, left * by_row[:, None, None])


def by_line(floor: Floor, count: int) -> Floor:
    """Return the noise with deviations line by line, for a residual that is coloured: misfit of the model as much as noise.

    With e the residual, channels brought to unit level: level(f) = mean |e|^2, rho(f) = Re mean(e_k+1 conj e_k) / level over neighbours,
    and a row's deviation sqrt(level tau), tau = (1 + rho) / (1 - rho): so many lines tell as much as one of white noise. The variance
    is that of the residual divided by its level alone, or the colour would cancel.

    Parameters
    ----------
    floor : Floor
    count : int
        Lines.
    """
    rows, l, m = floor.left.shape
    each = floor.left / floor.rows[:, None, None]
    each = each / np.maximum(np.sqrt(np.mean(each**2, axis=0)), 1e-300)
    e = each.reshape(rows // count, count, l * m)
    level = _smoothed(np.mean(e**2, axis=(0, 2)), _LEVELLED)
    size = _smoothed(np.mean(e**2, axis=(0, 2)), _CORRELATED)
    neighbours = np.append(np.mean(e[:, 1:] * e[:, :-1], axis=(0, 2)), 0)
    rho = _smoothed(neighbours, _CORRELATED) / size
    rho = np.where(rho > _WHITE / np.sqrt(len(e) * l * m * _CORRELATED), rho, 0)
    tau = (1 + rho) / np.maximum(1 - rho, 2 / (_LONGEST + 1))
    own = np.tile(np.sqrt(level * np.minimum(tau, _LONGEST)), len(e))
    levelled = float(np.mean(e**2 / level[:, None]))
    return replace(floor, rows=floor.rows * own, variance=floor.variance * levelled)


def _smoothed(values: RealArray, length: int) -> RealArray:
    """Return the mean over neighbours, of those that there are at the ends."""
    window = np.ones(min(length, len(values)))
    return np.asarray(np.convolve(values, window, mode="same") / np.convolve(np.ones(len(values)), window, mode="same"))


def _few(response: Response, poles: Array) -> Array:
    """Leave out poles that grow, and the most damped of too many."""
    decaying = poles[poles.real < 0]
    most = max(int(_COLUMNS * response.count * (2 if response.grid is not None else 1)) // 2, 1)
    return np.asarray(decaying[np.argsort(-decaying.real / np.abs(decaying), kind="stable")[:most]])
