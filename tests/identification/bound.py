"""The Cramer-Rao bound of a modal model by its plain definition: every unknown at once, derivatives by differences."""

from __future__ import annotations

import numpy as np

from modalscope.model import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.model.poles import frequencies_and_damping

#: Relative step of the central differences.
STEP = 1e-6


def modal_rows(data: FrequencyResponse | ImpulseResponse, poles: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Return sum_j R_j g_j + conjugates on all rows, written out for the two kinds of response."""
    if isinstance(data, ImpulseResponse):
        t = (np.arange(data.samples) + data.first_sample) / data.sampling_rate
        return 2 * np.einsum("kj,joi->koi", np.exp(np.outer(t, poles)), residues).real
    x, p = 2j * np.pi * data.frequencies, poles
    if data.sampling_rate is not None:
        x, p = np.exp(x / data.sampling_rate), np.exp(poles / data.sampling_rate)
    H = np.einsum("kj,joi->koi", 1 / (x[:, None] - p), residues)
    H = H + np.einsum("kj,joi->koi", 1 / (x[:, None] - p.conj()), residues.conj())
    return np.concatenate([H.real, H.imag])


def bound(
    data: FrequencyResponse | ImpulseResponse, modes: ModalModel, deviation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the least standard deviations of frequencies (Hz) and damping ratios, and the covariance of all unknowns.

    `deviation` (l, m) is that of one real row. Unknown are, in this order, frequencies, damping ratios, the real and the imaginary parts
    of shapes (l, n) and of participation (n, m) (rank one); on lines the terms that a refinement carries beside the modes, too.
    """
    n, (l, m) = len(modes), data.values.shape[1:]
    f, zeta = frequencies_and_damping(modes.poles)

    def response(x: np.ndarray) -> np.ndarray:
        sizes = np.cumsum([n, n, n * l, n * l, n * m])
        f, zeta, cr, ci, br, bi = np.split(x, sizes)
        s = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2)) - data.added_damping
        residues = (cr + 1j * ci).reshape(l, n).T[:, :, None] * (br + 1j * bi).reshape(n, 1, m)
        return modal_rows(data, s, residues) / deviation

    c, b = modes.shapes, modes.participation
    x = np.concatenate([f, zeta, *(a.ravel() for a in (c.real, c.imag, b.real, b.imag))])
    sizes = [np.abs(c).max()] * (2 * n * l) + [np.abs(b).max()] * (2 * n * m)
    steps = STEP * np.concatenate([f, zeta, sizes])
    columns = [(response(x + e) - response(x - e)) / (2 * np.sum(e)) for e in np.diag(steps)]
    J = np.stack([column.reshape(-1, l * m) for column in columns], axis=2)
    terms = data.basis(np.zeros(0), data.outside_powers).terms
    if terms.shape[1]:
        Q = np.linalg.qr(terms / np.linalg.norm(terms, axis=0))[0]
        J = J - np.tensordot(Q, np.tensordot(Q.T, J, axes=1), axes=1)
    J = J.reshape(-1, x.size)
    scale = np.linalg.norm(J, axis=0)
    d, Vt = np.linalg.svd(J / scale, full_matrices=False)[1:]
    kept = d > 1e-6 * d[0]  # what changes shape and participation against each other leaves the response as it is
    covariance = (Vt[kept].T / d[kept] ** 2) @ Vt[kept] / np.outer(scale, scale)
    both = np.sqrt(np.diag(covariance))
    return both[:n], both[n : 2 * n], covariance


def shape_bound(modes: ModalModel, covariance: np.ndarray) -> np.ndarray:
    """Return the deviations of shapes of length one, what only scales or turns them taken out, from the covariance of all unknowns."""
    l, n = modes.shapes.shape
    found = []
    for j in range(n):
        real = 2 * n + j + n * np.arange(l)
        rows = np.concatenate([real, real + n * l])
        c = modes.shapes[:, j]
        P = np.eye(l) - np.outer(c, c.conj()) / np.vdot(c, c).real
        T = np.hstack([P, 1j * P]) / np.linalg.norm(c)
        found.append(np.sqrt(np.diag(T @ covariance[np.ix_(rows, rows)] @ T.conj().T).real))
    return np.stack(found, axis=1)
