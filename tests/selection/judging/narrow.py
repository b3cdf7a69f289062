"""Structures with errors that are no white noise, seen in a band that holds some of their modes only, with many lines and little noise.

    H_oi(f) = sum_j R_j,oi of a pole s_j (1 + e_ij)  +  eps |H_oi(f)| u_oi(f)  +  white noise

as in `coloured`, but all sizes are drawn: e_ij of 5e-5 to 5e-4, eps of .003 to .05, u that is one over 5 to 39 lines, noise of 40 to
70 dB. So many poles as a narrow band has room for follow such errors far into the noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import IntArray, RealArray
from tests.selection.judging.coloured import pole_columns, unit_errors, white_errors
from tests.selection.judging.hard import Structure, lines_of, random_structure

#: Lines that a band needs: fewer are no test of errors over lines.
FEWEST = 150


@dataclass(frozen=True, eq=False)
class Narrow:
    """A response, the band, the modes inside, and the sizes of the errors.

    Parameters
    ----------
    structure : Structure
    response : FrequencyResponse
    band : (float, float)
    inside : array of int
        Which of the modes lie in the band.
    shift, error, white : float
    together : int
        Lines that err together.
    """

    structure: Structure
    response: FrequencyResponse
    band: tuple[float, float]
    inside: IntArray
    shift: float
    error: float
    white: float
    together: int

    @property
    def within(self) -> Structure:
        """The modes of the band alone."""
        s = self.structure
        return Structure(s.poles[self.inside], s.residues[self.inside], s.quantity)

    @property
    def lines(self) -> RealArray:
        """Those of the band."""
        f = self.response.frequencies
        return np.asarray(f[(f >= self.band[0]) & (f <= self.band[1])])


def narrow_case(seed: int) -> Narrow:
    """Return a band of one to four neighbouring modes, cut .2 to .8 of the way to the next one."""
    structure, rng = random_structure(seed), np.random.default_rng([seed, 11])
    f0, n = np.abs(structure.poles) / (2 * np.pi), structure.poles.size
    shift, error = 10 ** rng.uniform(-4.3, -3.3), 10 ** rng.uniform(-2.5, -1.3)
    white, together = 10 ** (-rng.uniform(40, 70) / 20), int(rng.integers(5, 40))
    f = np.linspace(0.7 * f0.min(), 1.15 * f0.max(), int(rng.integers(2000, 5000)))
    shifts = 1 + shift * rng.standard_normal((structure.residues.shape[2], n))
    each = [
        replace(structure, poles=structure.poles * by, residues=structure.residues[:, :, [i]])
        for i, by in enumerate(shifts)
    ]
    H = np.concatenate([lines_of(one, f) for one in each], axis=2)
    values = H + white_errors(rng, H, white) + error * np.abs(H) * unit_errors(rng, H.shape, together)
    count = int(rng.integers(1, min(4, n) + 1))
    first = int(rng.integers(0, n - count + 1))
    edges = np.concatenate([f[:1], f0, f[-1:]])
    low, high = f0[first], f0[first + count - 1]
    band = (
        low - (low - edges[first]) * rng.uniform(0.2, 0.8),
        high + (edges[first + count + 1] - high) * rng.uniform(0.2, 0.8),
    )
    response = FrequencyResponse(values=values, frequencies=f, quantity=structure.quantity)
    return Narrow(structure, response, band, np.arange(first, first + count), shift, error, white, together)


def narrow_gains(case: Narrow) -> RealArray:
    """Return by how many deviations of all errors each mode of the band is needed beside the others, (k,); as `coloured_gains`.

    X' C X of the columns over their deviations by products: white part and own part are diagonal, nine-line means a sum over lags.
    """
    f, s = case.lines, case.structure.poles
    x, H = 2j * np.pi * f, lines_of(case.structure, f)
    columns, total = pole_columns(x, s), np.zeros(s.size)
    whole = lines_of(case.structure, case.response.frequencies)
    lags = np.arange(1 - case.together, case.together)
    kernel = 1 - np.abs(lags) / case.together
    for o, i in np.ndindex(H.shape[1:]):
        h, r = H[:, o, i], case.structure.residues[:, o, i]
        d = case.shift * (r * s) / (x[:, None] - s) ** 2
        level = np.mean(np.abs(whole[:, o, i]) ** 2) * case.white**2
        own = case.error * np.abs(h)
        size = np.sqrt(level + own**2 + np.sum(np.abs(d) ** 2, axis=1))
        X = columns / size[:, None]
        back = np.linalg.pinv((X.conj().T @ X).real, hermitian=True)
        smooth = np.stack([np.convolve(own / size * column, kernel, mode="same") for column in X.T], axis=1)
        D = (d / size[:, None]).conj().T @ X
        inner = X.conj().T @ (X * (level / size**2)[:, None]) + X.conj().T @ (smooth * (own / size)[:, None])
        covariance = back @ (inner + D.conj().T @ D).real @ back / 2
        for j in case.inside:
            a, of = np.array([r[j].real, r[j].imag]), slice(2 * j, 2 * j + 2)
            total[j] += a @ np.linalg.solve(covariance[of, of], a)
    return np.asarray(np.sqrt(total[case.inside] / 2))
