"""From a model of one order to its modes: poles, shapes and participation, and which of them a canonical form has too many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.blocks.fraction import Fraction
from modalscope.blocks.projection import Projection
from modalscope.blocks.shifted import Shifted
from modalscope.blocks.transfer import Transfer
from modalscope.identification.pipeline import Pipeline
from modalscope.modal.basis import (
    ModalBasis,
    basis_of_lines,
    basis_of_samples,
    basis_of_window,
    fit_participation,
    fit_shapes,
    residual_powers,
)
from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import one_of_each_pair
from modalscope.model.statespace import StateSpace
from modalscope.realizations.triple import Triple, inverse_vectors

__all__ = ["Eigenmodes", "eigenmodes", "from_modes", "split_extraneous"]


@dataclass(frozen=True, eq=False)
class Eigenmodes:
    """The modal form of one model: one pole of each pair, rad/s, with what belongs to it.

    Parameters
    ----------
    poles : array of complex, (k,)
        rad/s, as identified (an exponential window's damping still in them).
    own : array of complex, (k,)
        The same in the plane of the realization.
    vectors : array of complex, (n, k)
        Eigenvectors of A.
    rows : array of complex, (k, n)
        The matching rows of their inverse.
    shapes : array of complex, (l, k)
    participation : array of complex, (k, m)
        Referred to the impulse itself.
    terms : array, (t, l, m)
        Direct term, or residuals of the modes below and above the band.
    powers : tuple of int, (t,)
        Powers of the relative frequency j f / f_max that the terms are factors of.
    reach : array, (k,), optional
        Norm of each mode's function over the lines.
    """

    poles: ComplexArray
    own: ComplexArray
    vectors: ComplexArray
    rows: ComplexArray
    shapes: ComplexArray
    participation: ComplexArray
    terms: RealArray
    powers: tuple[int, ...] = (0,)
    reach: RealArray | None = None

    @property
    def direct(self) -> RealArray:
        """Direct term, (l, m): zero beside residuals."""
        return self.terms[0] if self.powers == (0,) else np.zeros(self.terms.shape[1:])

    @property
    def amplitude(self) -> RealArray:
        """Size of each residue times its reach, its share of the response: what tells extraneous poles.

        On lines the reach is the norm of 1 / (x - s) over them: an undamped pole between two lines has little. For samples it is the
        root of the time it acts for.
        """
        size = np.linalg.norm(self.shapes, axis=0) * np.linalg.norm(self.participation, axis=1)
        if self.reach is not None:
            return np.asarray(size * self.reach)
        return np.asarray(size / np.sqrt(np.maximum(np.abs(self.poles.real), 1e-12 * np.abs(self.poles) + 1e-300)))


def eigenmodes(pipeline: Pipeline, model: Triple) -> Eigenmodes:
    """Return the modal form of a model (Eqs. 15-16); participation from B, or by least squares over lines or samples."""
    if isinstance(pipeline.matrix, Fraction):
        return _fraction_modes(pipeline, pipeline.matrix, model)
    own, vectors = np.linalg.eig(model.A)
    inverse = inverse_vectors(vectors)
    poles = pipeline.matrix.to_s(own)
    kept = one_of_each_pair(poles)
    poles, own, vectors, rows = poles[kept], own[kept], vectors[:, kept].astype(complex), inverse[kept]
    shapes = _shapes(pipeline, model, own, vectors)
    response = pipeline.response
    if isinstance(response, FrequencyResponse):
        weights = pipeline.matrix.weights if isinstance(pipeline.matrix, Transfer) else None
        basis = basis_of_lines(response, poles, weights=weights)
        participation, terms = fit_participation(basis, shapes)
        reach = np.linalg.norm(basis.functions.reshape(-1, poles.size, 2), axis=(0, 2))
        return Eigenmodes(poles, own, vectors, rows, shapes, participation, terms, reach=reach)
    if isinstance(pipeline.matrix, Projection):
        participation = fit_participation(basis_of_samples(response, poles), shapes)[0]
    elif isinstance(pipeline.matrix, Shifted):
        participation = _from_impulse(response, own, fit_participation(_window_basis(pipeline.matrix, own), shapes)[0])
    else:
        assert model.B is not None
        participation = _from_impulse(response, own, rows @ model.B)
    direct = np.zeros(response.values.shape[1:]) if response.feedthrough is None else response.feedthrough
    return Eigenmodes(poles, own, vectors, rows, shapes, participation, direct[None])


def _from_impulse(response: ImpulseResponse, own: ComplexArray, participation: ComplexArray) -> ComplexArray:
    """Return participation referred to the impulse, from that at the first sample there is."""
    first = response.first_sample
    return participation / own[:, None] ** first if first else participation


def _window_basis(matrix: Shifted, own: ComplexArray) -> ModalBasis:
    """Return what modes contribute to Y_0 on the lines of a window."""
    functions, mirrored = matrix.window_functions(own), matrix.window_functions(own.conj())
    return basis_of_window(functions, mirrored, own, matrix.transformed(matrix.samples), matrix.line_weights)


def _fraction_modes(pipeline: Pipeline, matrix: Fraction, model: Triple) -> Eigenmodes:
    """Return the stable roots of the denominator with participation from its null vectors and shapes by least squares.

    Unstable roots are what no mode explains (see `denominator`) and do not take part.
    """
    inverse, vectors = np.linalg.eig(model.A.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.where(inverse == 0, np.inf, 1 / inverse)
    stable = np.flatnonzero((np.abs(own) < 1) & (own != 0))
    poles = matrix.to_s(own[stable])
    kept = stable[one_of_each_pair(poles)]
    response = matrix.response
    participation = vectors[-matrix.inputs :, kept].T.astype(complex)
    powers = residual_powers(response.quantity, response.sampling_rate is None and response.frequencies[0] > 0)
    basis = basis_of_lines(response, matrix.to_s(own[kept]), powers, matrix.weights)
    shapes, terms = fit_shapes(basis, participation)
    # left eigenvectors [mu^(p-1) w', ..., w'] as rows, no right ones: nothing is read off them
    rows = vectors[:, kept].T.astype(complex)
    return Eigenmodes(
        matrix.to_s(own[kept]), own[kept], np.zeros_like(rows.T), rows, shapes, participation, terms, powers
    )


def _shapes(pipeline: Pipeline, model: Triple, own: ComplexArray, vectors: ComplexArray) -> ComplexArray:
    """Return C times the eigenvectors; on lines from all block rows instead of the first."""
    if not isinstance(pipeline.matrix, Transfer):
        return np.asarray(model.C @ vectors)
    if pipeline.realization.canonical:  # the states are the block rows themselves
        return pipeline.matrix.shapes(vectors, own)
    n, factors = model.rank, pipeline.factors
    return pipeline.matrix.shapes((factors.P[:, :n] * factors.d[:n] ** pipeline.realization.row_power) @ vectors, own)


def split_extraneous(modal: Eigenmodes, model: Triple) -> tuple[Array, Array]:
    """Return the modes that a rank explains, and the extraneous ones of a canonical form: what the truncated factor holds best."""
    count = modal.poles.size
    if model.A.shape[0] <= model.rank:
        return np.arange(count), np.arange(0)
    # a negative real pole of a sampled system is one state, although its logarithm is not real
    states = np.where(modal.own.imag == 0, 1, 2)
    held = model.held(modal.vectors, modal.rows)
    by_size = np.argsort(-(modal.amplitude if held is None else held), kind="stable")
    kept = by_size[np.cumsum(states[by_size]) <= model.rank]
    own = np.sort(kept)
    return own, np.setdiff1d(np.arange(count), own)


def from_modes(poles: Array, shapes: Array, participation: Array, direct: Array, dt: float | None) -> StateSpace:
    """Return the real model of modes: a block [[a, w], [-w, a]] for each pair, one state for each real pole.

    With c = c_r + j c_i and l = l_r + j l_i a pair contributes C = 2 [c_r, c_i] and B = [l_r'; -l_i'], both scaled to one size.
    """
    n = np.where(poles.imag == 0, 1, 2)
    A, B, C = (
        np.zeros((n.sum(), n.sum())),
        np.zeros((n.sum(), participation.shape[1])),
        np.zeros((shapes.shape[0], n.sum())),
    )
    for j, k in enumerate(np.cumsum(n) - n):
        size = np.sqrt(np.linalg.norm(shapes[:, j]) * np.linalg.norm(participation[j])) or 1.0
        c, b = (
            shapes[:, j] / (np.linalg.norm(shapes[:, j]) or 1.0) * size,
            participation[j] / (np.linalg.norm(participation[j]) or 1.0) * size,
        )
        if n[j] == 1:
            A[k, k], B[k], C[:, k] = poles[j].real, b.real, c.real
            continue
        a, w = poles[j].real, poles[j].imag
        A[k : k + 2, k : k + 2] = [[a, w], [-w, a]]
        C[:, k], C[:, k + 1] = 2 * c.real, 2 * c.imag
        B[k], B[k + 1] = b.real, -b.imag
    return StateSpace(A=A, B=B, C=C, D=direct, dt=dt)
