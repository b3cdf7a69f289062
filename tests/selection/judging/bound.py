"""The Cramer-Rao bound of a modal model by its plain definition: every unknown at once, derivatives by differences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag, qr

from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.numerics.functions.poles import frequencies_and_damping

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


def shape_bound(modes: ModalModel, covariance: np.ndarray, level: np.ndarray | float = 1.0) -> np.ndarray:
    """Return the deviations of shapes of length one, from the covariance of all unknowns.

    What only scales or turns them is taken out, outputs divided by their levels (l,).
    """
    l, n = modes.shapes.shape
    level = np.broadcast_to(level, l)
    found = []
    for j in range(n):
        real = 2 * n + j + n * np.arange(l)
        rows = np.concatenate([real, real + n * l])
        c = modes.shapes[:, j]
        P = np.eye(l) - np.outer(c, c.conj() / level**2) / np.sum(np.abs(c / level) ** 2)
        T = np.hstack([P, 1j * P]) / np.linalg.norm(c)
        found.append(np.sqrt(np.diag(T @ covariance[np.ix_(rows, rows)] @ T.conj().T).real))
    return np.stack(found, axis=1)


def compressed_bound(
    data: FrequencyResponse | ImpulseResponse,
    modes: ModalModel,
    deviation: np.ndarray,
    groups: Sequence[Sequence[int]] | None = None,
) -> np.ndarray:
    """Return the same bounds of f and zeta, (2, n), by derivatives in closed form on rows that are compressed, for hundreds of cases.

    Every derivative is a matrix times one of four real functions a mode; the largest participation of each is held, so that shape and
    participation cannot change against each other. Modes of one of the `groups` have the same pole, s = A with C A B instead of a sum
    of modes: all of A is free, as many columns of B are held as the group has modes, and the bound is that of the mean pole, trace A / k.
    """
    l, m = data.values.shape[1:]
    found = [[j] for j in range(len(modes))] if groups is None else groups
    g, mirrored = _functions(data, modes.poles[[group[0] for group in found]])
    # derivative by s, rows, modes, real and imaginary part
    pairs = np.stack([g + mirrored, 1j * (g - mirrored)], axis=-1)
    columns = pairs.transpose(1, 2, 0, 3).reshape(g.shape[1], 4 * len(found))
    real = columns.real if isinstance(data, ImpulseResponse) else np.concatenate([columns.real, columns.imag])
    terms = data.basis(np.zeros(0), data.outside_powers).terms
    if terms.shape[1]:
        Q = np.linalg.qr(terms / np.linalg.norm(terms, axis=0))[0]
        real = real - Q @ (Q.T @ real)
    R = np.linalg.qr(real)[1].reshape(-1, len(found), 2, 2)
    free: list[list[np.ndarray]] = [[], []]
    means = []
    for j, group in enumerate(found):
        C, B = modes.shapes[:, group].T, modes.participation[group]
        held = qr(B, mode="r", pivoting=True)[1][: len(group)]
        amounts = [(1, np.outer(c, b)) for c in C for b in B]
        amounts += [(0, np.outer(e, b)) for e in np.eye(l) for b in B]
        amounts += [(0, np.outer(c, e)) for c in C for i, e in enumerate(np.eye(m)) if i not in held]
        for by_pole, dR in amounts:
            for z in (dR, 1j * dR):
                column = np.einsum("kz,zoi->koi", R[:, j, by_pole], np.stack([z.real, z.imag])) / deviation
                free[0 if by_pole else 1].append(column.ravel())
        means.append(np.kron(np.eye(len(group)).reshape(1, -1) / len(group), np.eye(2)))
    J, rest = np.column_stack(free[0]), np.linalg.qr(np.column_stack(free[1]))[0]
    J = J - rest @ (rest.T @ J)
    scale = np.linalg.norm(J, axis=0)
    T = block_diag(*means) / scale
    covariance = T @ np.linalg.inv((J / scale).T @ (J / scale)) @ T.T
    return _of_poles(covariance, np.array([modes.poles[list(group)].mean() for group in found]))


def _functions(data: FrequencyResponse | ImpulseResponse, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return g_j and its derivative by the pole, (2, rows, n), and the same of the conjugate pole."""
    s = poles - data.added_damping
    if isinstance(data, ImpulseResponse):
        t = (np.arange(data.samples) + data.first_sample)[:, None] / data.sampling_rate
        g = np.exp(t * s)
        return np.stack([g, t * g]), np.stack([g, t * g]).conj()
    x = 2j * np.pi * data.frequencies[:, None]
    assert data.sampling_rate is None
    return tuple(np.stack([1 / (x - p), 1 / (x - p) ** 2]) for p in (s, s.conj()))  # type: ignore[return-value]


def _of_poles(covariance: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """Return deviations of f and zeta from the covariance of the real and imaginary parts of the poles, in turn."""
    w = np.abs(poles)
    by_f = np.stack([poles.real, poles.imag]) / w / (2 * np.pi)
    by_zeta = np.stack([-1 / w + poles.real**2 / w**3, poles.real * poles.imag / w**3])
    blocks = covariance.reshape(poles.size, 2, poles.size, 2)
    own = np.stack([blocks[j, :, j] for j in range(poles.size)])
    return np.stack([np.sqrt(np.einsum("pj,jpq,qj->j", D, own, D)) for D in (by_f, by_zeta)])
