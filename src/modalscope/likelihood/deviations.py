"""Compute standard deviations of poles by first-order propagation of noise, order by order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modalscope.blocks.influence import Lines, Moments
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.triple import Eigen, Triple
from modalscope.data.response import Response
from modalscope.functions.pole_basis import ModalBasis
from modalscope.likelihood.covariance import PoleInfluence, deviations_of_poles, influence_on_all
from modalscope.likelihood.noise import Noise, White
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.orthonormal import energy_left
from modalscope.realizations.realization import Realization

# ------------------------------------------------------------------------------------------------------------ residual
# The variance of noise from the residual of a model.


def unexplained_energy(basis: ModalBasis) -> RealArray:
    """Return the residual energy with free residues and terms in every channel, (l, m)."""
    found = energy_left(basis.data.reshape(len(basis.data), -1), basis.columns)
    return np.asarray(found.reshape(basis.data.shape[1:]))


def residual_variance(energy: Array, free: float, is_complex: bool) -> RealArray:
    """Return the variance E|noise|^2 (l, m) of noise from residual energies (l, m); NaN without degrees of freedom.

    `free`: degrees of freedom of a channel, in real numbers. `is_complex`: values are lines, of two real numbers each.
    """
    return np.asarray((1 + is_complex) * energy / free if free > 0 else np.full(energy.shape, np.nan))


# ---------------------------------------------------------------------------------------------------------- deviations

#: Maximum number of lines that one represents: a power of two.
_MAX_LINES_PER_POINT = 8

#: One line represents several where their span is this fraction (one in so many) of the distance to the nearest pole ...
_POLE_DISTANCES = 3

#: ... and this many of them lie within every half wave of the polynomials of the rows.
_LINES_PER_HALF_WAVE = 8


#: Maximum product of poles, samples and channels computed at a time: larger temporary arrays are slower.
_BLOCK_NUMBERS = 100_000


class Deviations(NamedTuple):
    """Standard deviations of frequencies (Hz) and damping ratios, (k,) each; NaN where they are withheld."""

    frequency: RealArray
    damping_ratio: RealArray


class Asked(NamedTuple):
    """Poles of a model whose deviations are asked.

    Attributes
    ----------
    order : int
    model : Triple
        Of that order.
    poles : array of complex
        All of that order, rad/s, as they are in the data.
    eigen : Eigen
        The same in the plane of the data matrix.
    which : array of int
        Those that are asked; the others are NaN.
    noise : Noise
    """

    order: int
    model: Triple
    poles: ComplexArray
    eigen: Eigen
    which: IntArray
    noise: Noise


#: What is asked, and where it is put.
_Some = tuple[Asked, Deviations]


def deviations_of(matrix: DataMatrix, realization: Realization, *asked: Asked) -> list[Deviations]:
    """Return the standard deviations of some poles of models; without lines, of several orders at once."""
    found = [Deviations(*(np.full(one.poles.size, np.nan) for _ in range(2))) for one in asked]
    some = [(one, place) for one, place in zip(asked, found, strict=True) if one.which.size]
    for group in _groups(some, matrix.judged):
        if not _fill(matrix, realization, group) and len(group) > 1:
            for each in group:
                _fill(matrix, realization, [each])
    return found


def _groups(some: Sequence[_Some], response: Response) -> list[list[_Some]]:
    """Return orders that are taken together."""
    each, size = response.count * sum(response.values.shape[1:]), np.inf
    groups: list[list[_Some]] = []
    for one in some:
        more = one[0].which.size * each
        size = size + more if response.grid is None else np.inf
        if size > _BLOCK_NUMBERS:
            groups, size = [*groups, []], more
        groups[-1].append(one)
    return groups


def _fill(matrix: DataMatrix, realization: Realization, some: Sequence[_Some]) -> bool:
    """Put the deviations of models in their places; False for a way of reading poles off whose first order is not known."""
    asked = [one for one, _ in some]
    lines = lines_for_all(matrix.judged, asked[0].poles, matrix.block_rows) if matrix.thinned else None
    parts = [(one.order, one.model, one.eigen.take(one.which)) for one in asked]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        try:
            influence = influence_on_all(matrix, realization, parts, lines)
        except DataError:
            return False
        moments = _moments(influence, [one.noise for one in asked], [one.which.size for one in asked])
        poles: ComplexArray = np.concatenate([one.poles[one.which] for one in asked])
        poles = poles + matrix.judged.added_damping
        f, zeta = deviations_of_poles(poles, moments.covariance)
    start = 0
    for one, place in some:
        own = slice(start, start := start + one.which.size)
        place.frequency[one.which] = f[own]
        place.damping_ratio[one.which] = np.where(one.noise.damping_is_told(poles[own]), zeta[own], np.nan)
    return True


def _moments(influence: PoleInfluence, noises: Sequence[Noise], counts: Sequence[int]) -> Moments:
    """Return the moments of poles of several orders, each under its own estimate of noise."""
    first, ends = noises[0], np.cumsum([0, *counts])
    if all(noise is first for noise in noises):
        return first.moments(influence)
    white = [noise.variance for noise in noises if isinstance(noise, White) and noise.fading is None]
    if influence.gradient.noise_by_pole and len(white) == len(noises):
        return influence.joint(influence, np.repeat(np.stack(white)[:, None], counts, axis=0))
    each = (
        noise.moments(influence.take(np.arange(a, b))) for noise, (a, b) in zip(noises, pairwise(ends), strict=True)
    )
    return Moments(*(np.concatenate(part) for part in zip(*each, strict=True)))


def lines_for_all(response: Response, poles: Array, degree: int) -> Lines | None:
    """Return which lines may stand for their neighbours: far from all poles nothing changes from one to the next.

    Blocks of two, four and eight lines are represented by the one in their middle where a third of the distance to the nearest pole
    spans as many. None: all are needed, or there are no lines.

    `poles`: of the model, all of them, as they are in the data. `degree`: of the polynomials that the rows of the matrix are.
    """
    grid = response.grid
    if grid is None or grid.size < 2 or not response.separable or response.added_damping > 0:
        return (
            None  # lines of records differ with what drove them, and lines that a window correlates share their noise
        )
    step, count = np.gradient(grid), grid.size
    nearest = np.min(np.abs(2j * np.pi * grid[:, None] - poles), axis=1, initial=np.inf) / (2 * np.pi)
    spanned = nearest / (_POLE_DISTANCES * step)
    each, left = np.ones(count), np.ones(count, bool)
    most = min(_MAX_LINES_PER_POINT, count // (_LINES_PER_HALF_WAVE * max(degree, 1)))
    for size in (
        _MAX_LINES_PER_POINT >> k
        for k in range(_MAX_LINES_PER_POINT.bit_length() - 1)
        if _MAX_LINES_PER_POINT >> k <= most
    ):
        blocks = count // size
        free = (left & (spanned >= size))[: blocks * size].reshape(blocks, size).all(axis=1)
        starts = np.flatnonzero(free) * size
        covered = (starts[:, None] + np.arange(size)).ravel()
        left[covered], each[covered] = False, 0
        each[starts + size // 2] = size
    index = np.flatnonzero(each)
    return Lines(index, each[index])
