"""From a model of one order to its modes: poles, shapes and participation, and which of them a canonical form has too many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.data.poles import one_of_each_pair
from modalscope.data.statespace import StateSpace
from modalscope.numerics.checks import Array, ComplexArray, RealArray

__all__ = ["Eigenmodes", "eigenmodes", "from_modes", "split_extraneous", "state_space"]


@dataclass(frozen=True, eq=False, slots=True)
class Eigenmodes:
    """The modal form of one model: one pole of each pair, rad/s, with what belongs to it.

    `poles` (k,): rad/s, as identified (an exponential window's damping still in them). `eigen`: the same in the plane of the data matrix,
    with the vectors of A. `fit`: shapes, participation and terms.
    """

    poles: ComplexArray
    eigen: Eigen
    fit: ModalFit

    @property
    def shapes(self) -> ComplexArray:
        """Shapes, (l, k)."""
        return self.fit.shapes

    @property
    def participation(self) -> ComplexArray:
        """Participation referred to the impulse itself, (k, m)."""
        return self.fit.participation

    @property
    def direct(self) -> RealArray:
        """Direct term, (l, m): zero beside residuals."""
        return self.fit.terms[0] if self.fit.powers == (0,) else np.zeros(self.fit.terms.shape[1:])

    @property
    def amplitude(self) -> RealArray:
        """Size of each residue times its reach, its share of the response: what tells extraneous poles.

        On lines the reach is the norm of 1 / (x - s) over them: an undamped pole between two lines has little. For samples it is the
        root of the time it acts for.
        """
        size = np.linalg.norm(self.shapes, axis=0) * np.linalg.norm(self.participation, axis=1)
        if self.fit.reach is not None:
            return np.asarray(size * self.fit.reach)
        return np.asarray(size / np.sqrt(np.maximum(np.abs(self.poles.real), 1e-12 * np.abs(self.poles) + 1e-300)))


def eigenmodes(matrix: DataMatrix, model: Triple) -> Eigenmodes:
    """Return the modal form of a model (Eqs. 15-16); participation from B, or by least squares over lines or samples."""
    eigen = model.eigen()
    poles = matrix.to_s(eigen.values)
    kept = one_of_each_pair(poles)
    eigen = eigen.take(kept)
    return Eigenmodes(poles[kept], eigen, matrix.fit(model, eigen))


def split_extraneous(modes: Eigenmodes, model: Triple) -> tuple[Array, Array]:
    """Return the modes that a rank explains, and the extraneous ones of a canonical form: what the truncated factor explains least."""
    count = modes.poles.size
    if model.A.shape[0] <= model.rank:
        return np.arange(count), np.arange(0)
    # a negative real pole of a sampled system is one state, although its logarithm is not real
    states = np.where(modes.eigen.values.imag == 0, 1, 2)
    share = model.explained(modes.eigen)
    by_size = np.argsort(-(modes.amplitude if share is None else share), kind="stable")
    kept = np.sort(by_size[np.cumsum(states[by_size]) <= model.rank])
    return kept, np.setdiff1d(np.arange(count), kept)


def state_space(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> StateSpace:
    """Return the model as it was realized; from lines in real modal coordinates, which do not depend on the polynomials."""
    if model.B is not None:
        C = matrix.of_all_outputs(model).C
        return StateSpace(A=model.A, B=model.B, C=C, D=modes.direct, dt=matrix.dt)
    z = modes.eigen.values
    # samples: Y(0) is the first sample there is
    participation = matrix.judged.of_inputs(modes.participation) * z[:, None] ** matrix.judged.steps_late
    poles = modes.poles if matrix.dt is None else z
    return matrix.with_noise(from_modes(poles, modes.shapes, participation, modes.direct, matrix.dt))


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
