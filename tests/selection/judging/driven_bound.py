"""The Cramer-Rao bound of modes in records by its plain definition: derivatives by differences, output by output."""

from __future__ import annotations

import numpy as np

from modalscope.data.record_spectra import RecordSpectra
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from

#: Relative step of the central differences.
STEP = 1e-6


def record_bound(
    records: RecordSpectra, poles: np.ndarray, shapes: np.ndarray, sides: np.ndarray, deviation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least standard deviations of frequencies (Hz) and damping ratios.

    Y_o = sum_j c_oj (b_j' d) / (x - p_j) + conjugate + D_o U, d = [U; ends of every run], noise of `deviation` (l,) on each real row.
    Unknown are frequencies, damping ratios, all b (n, m + R), and in every output c and D.
    """
    n, d = sides.shape
    m = records.drive.shape[1]
    f, zeta = frequencies_and_damping(poles)
    z_plane = records.sampling_rate is not None
    s = 2j * np.pi * records.frequencies
    x = np.exp(s / records.sampling_rate) if z_plane else s
    ends = [np.where(records.run == r, x if z_plane else 1, 0) for r in range(len(records.durations))]
    drives = np.column_stack([records.drive, *ends])

    def rows(own: np.ndarray) -> np.ndarray:
        return np.concatenate([own.real, own.imag])

    def output(theta: np.ndarray, c: np.ndarray) -> np.ndarray:
        f, zeta, br, bi = np.split(theta, [n, 2 * n, 2 * n + n * d])
        s = poles_from(f, zeta)
        p = np.exp(s / records.sampling_rate) if z_plane else s
        b = (br + 1j * bi).reshape(n, d)
        total = drives @ b.T / (x[:, None] - p) @ c
        return rows(total + drives @ b.conj().T / (x[:, None] - p.conj()) @ c.conj())

    theta = np.concatenate([f, zeta, sides.real.ravel(), sides.imag.ravel()])
    steps = STEP * np.concatenate([f, zeta, np.full(2 * n * d, np.abs(sides).max())])
    information = np.zeros((theta.size, theta.size))
    for c, sigma in zip(shapes, deviation, strict=True):
        by_shape = [output(theta, k * e) for e in np.eye(n) for k in (1, 1j)]
        free = np.column_stack([*by_shape, *rows(records.drive).T])
        J = np.column_stack([(output(theta + e, c) - output(theta - e, c)) / (2 * e.sum()) for e in np.diag(steps)])
        Q = np.linalg.qr(free / np.linalg.norm(free, axis=0))[0]
        J = (J - Q @ (Q.T @ J)) / sigma
        information += J.T @ J
    assert free.shape[1] == 2 * n + m
    scale = np.sqrt(np.diag(information))
    # what changes b and c against each other leaves the records as they are: two directions a mode
    covariance = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-9, hermitian=True) / np.outer(
        scale, scale
    )
    both = np.sqrt(np.diag(covariance))
    return both[:n], both[n : 2 * n]
