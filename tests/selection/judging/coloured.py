"""Hard random structures whose errors are no white noise: inputs find resonances at other places, lines err with their neighbours.

    H_oi(f) = sum_j R_j,oi of a pole s_j (1 + e_ij)  +  .05 |H_oi(f)| u_oi(f)  +  white noise of 40 dB

e_ij is normal with 3e-4 (a roving hammer that moves the resonances), u a mean of nine neighbouring complex normal numbers, of variance
one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import ComplexArray, RealArray
from tests.selection.judging.hard import Structure, lines_of

#: Relative scatter of resonances from input to input, part of the response that lines err by, lines that err together, white noise in dB.
SHIFT, ERROR, TOGETHER, DECIBEL = 3e-4, 0.05, 9, 40.0


def coloured_response(structure: Structure, seed: int, lines: int = 500) -> FrequencyResponse:
    """Return a response with all three errors."""
    f = _lines(structure, lines)
    rng = np.random.default_rng([seed, 3])
    m = structure.residues.shape[2]
    shifts = 1 + SHIFT * rng.standard_normal((m, structure.poles.size))
    each = [
        replace(structure, poles=structure.poles * by, residues=structure.residues[:, :, [i]])
        for i, by in enumerate(shifts)
    ]
    H = np.concatenate([lines_of(one, f) for one in each], axis=2)
    white = white_errors(rng, H, 10 ** (-DECIBEL / 20))
    together = unit_errors(rng, H.shape, TOGETHER)
    return FrequencyResponse(
        values=H + ERROR * np.abs(H) * together + white, frequencies=f, quantity=structure.quantity
    )


def white_errors(rng: np.random.Generator, H: ComplexArray, part: float) -> ComplexArray:
    """Return complex normal numbers of this part of the level of each channel."""
    return np.asarray(part * np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2) * _normal(rng, H.shape))


def unit_errors(rng: np.random.Generator, shape: tuple[int, ...], together: int) -> ComplexArray:
    """Return means over so many neighbouring complex normal numbers, of variance one."""
    longer = _normal(rng, (shape[0] + together - 1, *shape[1:])) / np.sqrt(2 * together)
    sums = np.cumsum(np.concatenate([np.zeros((1, *shape[1:])), longer]), axis=0)
    return np.asarray(sums[together:] - sums[:-together])


def coloured_gains(structure: Structure, lines: int = 500, *, exact: bool = False) -> RealArray:
    """Return by how many standard deviations of all errors each mode is needed beside the others, (n,).

    The covariance of a channel is C = s^2 + .05^2 |H| K |H| + 3e-4^2 sum_j d_j d_j^H, with K the correlation of nine-line means and d_j
    what a shift of mode j changes. The residues that least squares gives with the deviation of each line as its weight, beside those of the
    others and terms of modes outside the band, have a covariance that follows from C; a mode stands out by a' cov(a)^-1 a. With
    `exact` the weights are the inverse of C itself: what only one who knew the correlation of all errors could do.
    """
    f = _lines(structure, lines)
    x, s = 2j * np.pi * f, structure.poles
    H = lines_of(structure, f)
    K = np.maximum(1 - np.abs(np.subtract.outer(np.arange(lines), np.arange(lines))) / TOGETHER, 0)
    columns = pole_columns(x, s)
    total = np.zeros(s.size)
    for o in range(H.shape[1]):
        for i in range(H.shape[2]):
            h, r = H[:, o, i], structure.residues[:, o, i]
            d = SHIFT * (r * s) / (x[:, None] - s) ** 2
            white = np.full(lines, np.mean(np.abs(h) ** 2) * 10 ** (-DECIBEL / 10))
            C = np.diag(white) + ERROR**2 * np.outer(np.abs(h), np.abs(h)) * K + d @ d.conj().T
            covariance = _covariance(columns, C, exact=exact)
            for j in range(s.size):
                a, own = np.array([r[j].real, r[j].imag]), slice(2 * j, 2 * j + 2)
                total[j] += a @ np.linalg.solve(covariance[own, own], a)
    return np.asarray(np.sqrt(total / 2))


def _covariance(columns: ComplexArray, C: ComplexArray, *, exact: bool) -> RealArray:
    """Return that of real coefficients of complex columns, from the covariance C = E e e^H of circular errors."""
    if exact:
        whole = np.linalg.solve(np.linalg.cholesky(C), columns)
        return np.asarray(np.linalg.inv((whole.conj().T @ whole).real) / 2)
    size = np.sqrt(np.diag(C).real)
    X = columns / size[:, None]
    back = np.linalg.inv((X.conj().T @ X).real)
    return np.asarray(back @ (X.conj().T @ (C / np.outer(size, size)) @ X).real @ back / 2)


def pole_columns(x: ComplexArray, s: ComplexArray) -> ComplexArray:
    """Return real and imaginary parts' functions of each pole, mode by mode, and the terms 1 and x^2 of either phase."""
    one, other = 1 / (x[:, None] - s), 1 / (x[:, None] - s.conj())
    modes = np.stack([one + other, 1j * (one - other)], axis=2).reshape(x.size, -1)
    size = np.abs(x).max()
    return np.asarray(np.hstack([modes, np.stack([np.ones(x.size), (x / size) ** 2], axis=1).astype(complex)]))


def _lines(structure: Structure, lines: int) -> RealArray:
    return np.linspace(0.7 * np.abs(structure.poles).min(), 1.15 * np.abs(structure.poles).max(), lines) / (2 * np.pi)


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> ComplexArray:
    return np.asarray(rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
