"""Return the state-space model of an identification: as it was realized, or in modal coordinates."""

from __future__ import annotations

import numpy as np

from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.matrix import DataMatrix, Triple
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.numerics.checks import Array


def state_space(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> StateSpace:
    """Return the model as it was realized, with the gain of its innovations where the data matrix knows it."""
    made = deterministic(matrix, model, modes)
    return made if model.B is not None else full(matrix).with_noise(made)


def deterministic(matrix: DataMatrix, model: Triple, modes: Eigenmodes) -> StateSpace:
    """Return the model without noise; from lines in real modal coordinates, which do not depend on the polynomials."""
    if model.B is not None:
        whole = full(matrix).of_all_outputs(model)
        assert whole.B is not None
        return StateSpace(A=whole.A, B=whole.B, C=whole.C, D=modes.direct, dt=matrix.dt)
    z = modes.eigen.values
    # samples: Y(0) is the first sample there is
    participation = matrix.judged.of_inputs(modes.participation) * z[:, None] ** matrix.judged.steps_late
    poles = modes.poles if matrix.dt is None else z
    return from_modes(poles, modes.shapes, participation, modes.direct, matrix.dt)


def from_modes(poles: Array, shapes: Array, participation: Array, direct: Array, dt: float | None) -> StateSpace:
    """Return the real model of modes: a block [[a, w], [-w, a]] for each pair, one state for each real pole.

    With c = c_r + j c_i and l = l_r + j l_i a pair contributes C = 2 [c_r, c_i] and B = [l_r'; -l_i'], both scaled to one size.
    """
    n = np.where(poles.imag == 0, 1, 2)
    A, B = np.zeros((n.sum(), n.sum())), np.zeros((n.sum(), participation.shape[1]))
    C = np.zeros((shapes.shape[0], n.sum()))
    for j, k in enumerate(np.cumsum(n) - n):
        sizes = np.linalg.norm(shapes[:, j]), np.linalg.norm(participation[j])
        size = np.sqrt(sizes[0] * sizes[1]) or 1.0
        c, b = shapes[:, j] / (sizes[0] or 1.0) * size, participation[j] / (sizes[1] or 1.0) * size
        if n[j] == 1:
            A[k, k], B[k], C[:, k] = poles[j].real, b.real, c.real
            continue
        a, w = poles[j].real, poles[j].imag
        A[k : k + 2, k : k + 2] = [[a, w], [-w, a]]
        C[:, k], C[:, k + 1] = 2 * c.real, 2 * c.imag
        B[k], B[k + 1] = b.real, -b.imag
    return StateSpace(A=A, B=B, C=C, D=direct, dt=dt)
