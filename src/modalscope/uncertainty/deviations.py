"""Standard deviations of the poles of one model, by the noise in the data."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.blocks.influence import Lines
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.triple import Triple
from modalscope.modal.eigenmodes import Eigenmodes
from modalscope.model.checks import Array, DataError, IntArray, RealArray
from modalscope.model.response import Response
from modalscope.realizations.realization import Realization
from modalscope.uncertainty.covariance import deviations_of_poles
from modalscope.uncertainty.influence import influence_on
from modalscope.uncertainty.noise import Noise

__all__ = ["Deviations", "deviations_of", "lines_for_all"]

#: Lines that one stands for at most: a power of two.
_MOST = 8

#: A line may stand for so many that their span is this share of the distance to the nearest pole ...
_NEAR = 3

#: ... and that so many of them lie within every half wave of the polynomials of the rows.
_WAVE = 8


class Deviations(NamedTuple):
    """Standard deviations of frequencies (Hz) and damping ratios, (k,) each; NaN where they are withheld."""

    frequency: RealArray
    damping_ratio: RealArray


def deviations_of(
    matrix: DataMatrix,
    realization: Realization,
    order: int,
    model: Triple,
    modal: Eigenmodes,
    index: IntArray,
    noise: Noise,
) -> Deviations:
    """Return the standard deviations of some poles of a model.

    Parameters
    ----------
    matrix : DataMatrix
    realization : Realization
    order : int
    model : Triple
        Of that order.
    modal : Eigenmodes
        Its poles.
    index : array of int
        Those that are asked; the others are NaN.
    noise : Noise
    """
    found = Deviations(*(np.full(modal.poles.size, np.nan) for _ in range(2)))
    if not index.size:
        return found
    lines = lines_for_all(matrix.judged, modal.poles, matrix.block_rows) if matrix.thinned else None
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        try:
            influence = influence_on(matrix, realization, order, model, modal.eigen.take(index), lines)
        except DataError:  # a way of reading poles off whose first order is not known
            return found
        covariance = noise.moments(influence).covariance
        poles = modal.poles[index] + matrix.judged.added_damping
        f, zeta = deviations_of_poles(poles, covariance)
    found.frequency[index] = f
    found.damping_ratio[index] = np.where(noise.damping_is_told(poles), zeta, np.nan)
    return found


def lines_for_all(response: Response, poles: Array, degree: int) -> Lines | None:
    """Return which lines may stand for their neighbours: far from all poles nothing changes from one to the next.

    Blocks of two, four and eight lines are represented by the one in their middle where a third of the distance to the nearest pole
    spans as many. None: all are needed, or there are no lines.

    Parameters
    ----------
    response : Response
    poles : array of complex
        Of the model, all of them, as they are in the data.
    degree : int
        Of the polynomials that the rows of the matrix are.
    """
    grid = response.grid
    if grid is None or grid.size < 2 or not response.separable or response.added_damping > 0:
        return (
            None  # lines of records differ with what drove them, and lines that a window correlates share their noise
        )
    step, count = np.gradient(grid), grid.size
    nearest = np.min(np.abs(2j * np.pi * grid[:, None] - poles), axis=1, initial=np.inf) / (2 * np.pi)
    spanned = nearest / (_NEAR * step)
    each, left = np.ones(count), np.ones(count, bool)
    most = min(_MOST, count // (_WAVE * max(degree, 1)))
    for size in (_MOST >> k for k in range(_MOST.bit_length() - 1) if _MOST >> k <= most):
        blocks = count // size
        free = (left & (spanned >= size))[: blocks * size].reshape(blocks, size).all(axis=1)
        starts = np.flatnonzero(free) * size
        covered = (starts[:, None] + np.arange(size)).ravel()
        left[covered], each[covered] = False, 0
        each[starts + size // 2] = size
    index = np.flatnonzero(each)
    return Lines(index, each[index])
