"""The Cramer-Rao bound of the poles of a structure under white or coloured unmeasured forces, from its innovations model.

    y = G u + H e,   G = C (z - A)^-1 B + D,   H = I + C (z - A)^-1 K + M / (z - a)

Poles are shared by G and H; shapes, participation, gains, D, M and a are unknown beside them. What a parameter changes in the errors of
prediction is -H^-1 (dG u + dH e), and the information is the sum of its products, weighted by the inverse covariance of e (Ljung, System
Identification, 2nd ed., 1999, Eqs. 9.29 and 9.30). Of a record of a few decay times it is summed over the record itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
from scipy.signal import lfilter

import modalscope as ms


class Unmeasured(NamedTuple):
    """White forces of this deviation on every state, through one pole; white noise of these deviations on the outputs, (l,)."""

    forces: float
    pole: float
    noise: np.ndarray


def _delayed(pole: complex, signals: np.ndarray) -> np.ndarray:
    """Return signals (..., N) through 1 / (z - pole)."""
    return np.asarray(lfilter([0, 1], [1, -pole], signals.astype(complex)))


def innovations_model(model: ms.StateSpace, by: Unmeasured) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return A, C and K of the structure with the states of its forces, and the covariance of the innovations."""
    n, R = model.order, np.diag(by.noise**2)
    if by.forces == 0:
        return model.A, model.C, np.zeros((n, len(R))), R
    A, C, Q = model.A, model.C, by.forces**2 * np.eye(n)
    if by.pole:
        A = np.block([[A, np.eye(n)], [np.zeros((n, n)), by.pole * np.eye(n)]])
        C, Q = np.hstack([C, np.zeros_like(C)]), sla.block_diag(np.zeros((n, n)), (1 - by.pole**2) * Q)
    P = sla.solve_discrete_are(A.T, C.T, Q, R)
    covariance = C @ P @ C.T + R
    return A, C, A @ P @ C.T @ np.linalg.inv(covariance), covariance


def whitened(A: np.ndarray, C: np.ndarray, K: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """Return H^-1 of signals (..., l, N)."""
    values, V = np.linalg.eig(A - K @ C)
    inputs = np.einsum("nl,...lt->...nt", np.linalg.solve(V, K.astype(complex)), signals)
    states = np.stack([_delayed(z, inputs[..., j, :]) for j, z in enumerate(values)], axis=-2)
    return np.asarray(signals - np.einsum("ln,...nt->...lt", C @ V, states).real)


def bound_of_poles(model: ms.StateSpace, by: Unmeasured, data: ms.Signals) -> np.ndarray:
    """Return the least root mean square of |s - s_0| of every mode with positive frequency, s = log z, in the order of `model.poles`."""
    A, C, K, covariance = innovations_model(model, by)
    u, y = data.inputs.T, data.outputs.T
    e = whitened(A, C, K, y - model.simulate(data.inputs).T)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    columns = np.einsum("ij,pjt->pit", root, whitened(A, C, K, _changes(model, by, K, u, e)))
    J = columns.reshape(len(columns), -1)
    size = np.linalg.norm(J, axis=1)
    spread = np.linalg.inv((J / size[:, None]) @ (J / size[:, None]).T) / np.outer(size, size)
    poles = model.poles[model.poles.imag > 0]
    of_poles = np.diag(spread)[: 2 * len(poles)].reshape(-1, 2)
    return np.asarray(np.sqrt(of_poles.sum(axis=1)) / np.abs(poles))


def _changes(model: ms.StateSpace, by: Unmeasured, K: np.ndarray, u: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return dG u + dH e of all unknowns, (p, l, N): first the real and imaginary parts of the poles."""
    n, l, I = model.order, len(e), np.eye(len(e))
    values, V = np.linalg.eig(model.A)
    gain, coloured = K[:n], by.forces > 0 and by.pole > 0
    if coloured:
        apart = np.linalg.solve(model.A - by.pole * np.eye(n), K[n:])
        gain, M = gain + apart, -model.C @ apart
    left = np.linalg.inv(V)
    both = np.concatenate([u, e])
    of_poles, others = [], []
    for j in np.flatnonzero(values.imag > 0):
        c, sides = (model.C @ V)[:, j], np.concatenate([left[j] @ model.B, left[j] @ gain])
        states = _delayed(values[j], both)
        of_poles += _parts(np.multiply.outer(c, _delayed(values[j], sides @ states)))
        free = [i for i in range(l) if i != np.abs(c).argmax()]  # the largest sets the scale
        free_sides = range(len(both)) if by.forces else range(len(u))
        for change in [np.multiply.outer(I[i], sides @ states) for i in free]:
            others += _parts(change)
        for i in free_sides:
            others += _parts(np.multiply.outer(c, states[i]))
    others += [np.multiply.outer(row, own) for row in I for own in u]
    if coloured:
        late = _delayed(by.pole, e).real
        others += [np.multiply.outer(row, own) for row in I for own in late]
        others.append(M @ _delayed(by.pole, late).real)
    return np.array([*of_poles, *others])


def _parts(change: np.ndarray) -> list[np.ndarray]:
    """Return what the real and the imaginary part of an unknown change, with the conjugate's."""
    return [2 * change.real, -2 * change.imag]
