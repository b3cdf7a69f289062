"""Compute standard deviations of poles by first-order propagation of noise, order by order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.identification.deviating import Asked, Deviating, Deviations
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.influence import Lines, Moments
from modalscope.identification.matrices.matrix import DataMatrix, Realization, Triple
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.identification.pipeline import Pipeline
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.orthonormal import energy_left
from modalscope.selection.likelihood.covariance import PoleInfluence, deviations_of_poles, influence_on_all
from modalscope.selection.likelihood.noise import Noise, Unknown, White, noise_of

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
    lines = lines_for_all(matrix.judged, asked[0].poles, matrix.block_rows) if full(matrix).thinned else None
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
    most = min(_MAX_LINES_PER_POINT, grid.size // (_LINES_PER_HALF_WAVE * max(degree, 1)))
    starts, sizes = blocks_of_lines(grid, poles, most)
    return Lines(starts + sizes // 2, sizes.astype(float))


def blocks_of_lines(grid: RealArray, poles: Array, most: int) -> tuple[IntArray, IntArray]:
    """Return where blocks of lines begin (n,), and how many lines each has: a third of the distance to the nearest pole spans as many.

    `grid` (K,): Hz. `poles`: rad/s. `most`: lines of a block at most; they have 1, 2, 4, ... lines.
    """
    nearest = np.min(np.abs(2j * np.pi * grid[:, None] - poles), axis=1, initial=np.inf) / (2 * np.pi)
    spanned = nearest / (_POLE_DISTANCES * np.gradient(grid))
    sizes, left = np.ones(grid.size, dtype=int), np.ones(grid.size, bool)
    for size in (1 << k for k in range(most.bit_length() - 1, 0, -1)):
        blocks = grid.size // size
        free = (left & (spanned >= size))[: blocks * size].reshape(blocks, size).all(axis=1)
        starts = np.flatnonzero(free) * size
        covered = (starts[:, None] + np.arange(size)).ravel()
        left[covered], sizes[covered] = False, 0
        sizes[starts] = size
    starts = np.flatnonzero(sizes)
    return starts, sizes[starts]


# --------------------------------------------------------------------------------------------------------- of one sweep


#: Relative distance below which poles are the same: standard deviations are given to three digits.
_SAME_POLE = 1e-8


class _Computed(NamedTuple):
    """Standard deviations of the poles of an order, and which of them are known."""

    poles: ComplexArray
    known: Array
    deviations: Deviations


def _same(one: ComplexArray, other: ComplexArray) -> bool:
    """Return whether poles are the same, in the same order."""
    return one.shape == other.shape and bool(np.all(np.abs(one - other) <= _SAME_POLE * np.abs(other)))


class OfPipeline(Deviating):
    """Standard deviations of the poles of a pipeline, each computed once, by the noise of its data."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline, self._matrix = pipeline, pipeline.matrix.fitted
        self._response = self._matrix.judged
        self._complex = bool(np.iscomplexobj(self._response.values))
        self._weighted = getattr(self._matrix, "weights", None) is not None
        self.noise = noise_of(self._response, pipeline.problem.records, pipeline.problem.whitening)
        self._computed: dict[int, _Computed] = {}
        self.asked: dict[int, Asked] = {}
        self._alike: dict[int, Asked] = {}

    def ask(self, order: int, model: Triple, modal: Eigenmodes, which: IntArray) -> Asked:
        """Return what the deviations of some poles of an order are computed of; its fit tells its noise."""
        alike = self._alike.get(order)
        noise = self._noise_beside(modal) if alike is None or not _same(alike.poles, modal.poles) else alike.noise
        self.asked[order] = Asked(order, model, modal.poles, modal.eigen, which, noise)
        return self.asked[order]

    def deviations(self, *asked: Asked) -> list[Deviations]:
        """Return the deviations of some poles of orders, NaN at others that are not known."""
        kept, missing = [], []
        for one in asked:
            computed = self._computed.get(one.order)
            if computed is None or not _same(computed.poles, one.poles):
                count = one.poles.size
                unknown = Deviations(np.full(count, np.nan), np.full(count, np.nan))
                computed = _Computed(one.poles, np.zeros(count, bool), unknown)
                self._computed[one.order] = computed
            kept.append(computed)
            missing.append(one._replace(which=one.which[~computed.known[one.which]]))
        found = deviations_of(self._matrix, self._pipeline.realization, *(m for m in missing if m.which.size))
        for computed, one in ((c, m) for c, m in zip(kept, missing, strict=True) if m.which.size):
            std = found.pop(0)
            computed.known[one.which] = True
            for to, values in zip(computed.deviations, std, strict=True):
                to[one.which] = values[one.which]
        return [computed.deviations for computed in kept]

    def take_from(self, other: Any) -> None:
        """Share the deviations of another pipeline with the same poles, and its noise."""
        self._computed, self._alike = other._computed, other.asked

    def note_on(self, asked: Iterable[Asked]) -> Note:
        """Return how the deviations were estimated, or why there are none; computes no more orders than that takes."""
        if isinstance(self.noise, Unknown):
            return self.noise.note
        if any(np.any(np.isfinite(self.deviations(one)[0].frequency)) for one in asked):
            return self.noise.note
        return Unknown("this method has no propagation of errors to its poles, or the data have no residual").note

    def _noise_beside(self, modal: Eigenmodes) -> Noise:
        """Return the noise of the residual of free residues at the poles of a model."""
        if not self.noise.of_residual:
            return self.noise
        fit = modal.fit if self._pipeline.problem.whitening is None else modal.fit.fitted or modal.fit
        rows = self._response.count * (1 + self._complex)  # not those of a compressed basis
        if fit.unexplained is not None and np.all(np.isfinite(fit.unexplained)):
            unknown = len(fit.terms) + 2 * modal.poles.size
            return self.noise.beside(residual_variance(fit.unexplained, rows - unknown, self._complex))
        basis = (None if self._weighted else fit.basis) or self._response.basis(modal.poles, fit.powers)
        unknown = basis.terms.shape[1] + basis.functions.shape[1]
        return self.noise.beside(residual_variance(unexplained_energy(basis), rows - unknown, self._complex))
