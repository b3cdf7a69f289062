"""Structures whose resonances differ from row to row and from column to column of a test, with close pairs beside them.

    H_oi(f) = sum_j R_j,oi of a pole f_j (1 + a_jo + b_ji), zeta_j exp(a'_jo + b'_ji)  +  eps |H_oi(f)| u_oi(f)  +  white noise of 40 dB

a and b are normal with a deviation of 2e-4 to 2e-3, a' and b' with 0 to .2; u is one over nine lines, as in `coloured`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.data.modes import ModalModel
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.numerics.statistics import assign
from tests.selection.judging.coloured import unit_errors, white_errors
from tests.selection.judging.hard import Structure, lines_of

LINES, DECIBEL = 880, 40.0

#: A reported mode is a true one within this part of its frequency, or within its damping ratio.
NEAR = 0.004


@dataclass(frozen=True)
class Kind:
    """What a test has: shifts by row, by column, errors that are a part of the response, a pair of other shape .2 to 1 % apart."""

    rows: bool = False
    columns: bool = False
    smooth: bool = False
    pair: bool = False


KINDS = {
    "white": Kind(),
    "rows": Kind(rows=True),
    "columns": Kind(columns=True),
    "rows and columns": Kind(rows=True, columns=True),
    "rows, smooth errors": Kind(rows=True, smooth=True),
    "pair": Kind(pair=True),
    "columns, pair": Kind(columns=True, pair=True),
    "rows and columns, pair": Kind(rows=True, columns=True, pair=True),
}


def shifted_structure(seed: int, *, pair: bool = False) -> Structure:
    """Return 4 to 8 modes, 5 % apart at least, of 3 to 7 outputs and 2 to 4 inputs, damping .2 to 1.5 %; a pair comes last."""
    rng = np.random.default_rng([seed, 9])
    n, l, m = (int(rng.integers(low, high)) for low, high in ((4, 9), (3, 8), (2, 5)))
    while True:
        f = np.sort(10 * np.exp(rng.uniform(0, np.log(rng.uniform(3, 8)), n)))
        if np.min(np.diff(f) / f[:-1]) > 0.05:
            break
    zeta = np.exp(rng.uniform(np.log(0.002), np.log(0.015), n))
    shapes, parts = rng.standard_normal((l, n)) * np.exp(0.5 * rng.standard_normal(n)), rng.standard_normal((m, n))
    if pair:
        j = int(rng.integers(n))
        f, zeta = np.append(f, f[j] * (1 + rng.uniform(0.002, 0.01))), np.append(zeta, zeta[j] * rng.uniform(0.8, 1.25))
        level = np.linalg.norm(shapes[:, j]) / np.sqrt(l)
        shapes = np.hstack([shapes, level * rng.standard_normal((l, 1))])
        parts = np.hstack([parts, rng.standard_normal((m, 1))])
    s = poles_from(f, zeta)
    R = np.einsum("on,in->noi", shapes, parts) / (2j * s.imag)[:, None, None]
    return Structure(s, R * (s**2)[:, None, None], "acceleration")


def shifted_response(structure: Structure, kind: Kind, seed: int) -> FrequencyResponse:
    """Return the responses of such a test."""
    rng = np.random.default_rng([seed, 10])
    n, l, m = structure.residues.shape
    w = np.abs(structure.poles)
    f = np.linspace(0.8 * w.min(), 1.1 * w.max(), LINES) / (2 * np.pi)
    shift, spread = np.exp(rng.uniform(np.log(2e-4), np.log(2e-3))), rng.uniform(0, 0.2)
    by_row, by_column = kind.rows * rng.standard_normal((2, l, n)), kind.columns * rng.standard_normal((2, m, n))
    H = np.zeros((LINES, l, m), complex)
    for o in range(l):
        for i in range(m):
            both = by_row[:, o] + by_column[:, i]
            s = structure.poles * (1 + shift * both[0])
            own = Structure(
                s.real * np.exp(spread * both[1]) + 1j * s.imag,
                structure.residues[:, o : o + 1, i : i + 1],
                "acceleration",
            )
            H[:, o, i] = lines_of(own, f)[:, 0, 0]
    error = kind.smooth * np.exp(rng.uniform(np.log(0.003), np.log(0.05)))
    H = H + error * np.abs(H) * unit_errors(rng, H.shape, 9)
    H = H + white_errors(rng, H, 10 ** (-DECIBEL / 20))
    return FrequencyResponse(values=H, frequencies=f, quantity="acceleration")


def missed_and_false(structure: Structure, modes: ModalModel) -> tuple[int, int]:
    """Return how many modes are not listed, and how many listed ones are none; each is paired once."""
    f, zeta = frequencies_and_damping(structure.poles)
    room: RealArray = f * np.maximum(NEAR, zeta)
    apart = np.abs(f[:, None] - modes.frequencies) / room[:, None]
    found = sum(bool(apart[i, j] < 1) for i, j in zip(*assign(apart), strict=True)) if len(modes) else 0
    return len(f) - found, len(modes) - found
