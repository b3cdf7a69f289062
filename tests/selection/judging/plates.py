"""Made-up plates: 30 to 60 modes that overlap, a hammer at five points, and errors that are smooth over many lines.

A simply supported rectangle has modes sin(m pi x) sin(n pi y) at frequencies that go with (m / a)^2 + n^2, about evenly spaced. One
accelerometer; responses err by a part of themselves, lines together with their neighbours, and each point finds the resonances a little
elsewhere (`coloured`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.numerics.functions.poles import poles_from
from tests.selection.judging.coloured import unit_errors, white_errors
from tests.selection.judging.hard import Structure, lines_of

#: Hammer points, and the lowest natural frequency in Hz.
POINTS, LOWEST = 5, 20.0


@dataclass(frozen=True)
class Errors:
    """Errors of a test: `part` of the response, alike over `together` lines, resonances that scatter by `shift`, white noise in dB."""

    part: float
    together: int
    shift: float
    decibel: float
    lines: int


def plate(seed: int) -> Structure:
    """Return a plate, one accelerometer and five hammer points, damping .4 to 1.5 %."""
    rng = np.random.default_rng([seed, 77])
    n, ratio = int(rng.integers(30, 61)), rng.uniform(1.1, 1.9)
    m, k = (each.ravel() for each in np.meshgrid(np.arange(1, 40), np.arange(1, 40), indexing="ij"))
    level = (m / ratio) ** 2 + k**2
    first = np.argsort(level)[:n]
    m, k, level = m[first], k[first], level[first]
    zeta = np.exp(rng.uniform(np.log(0.004), np.log(0.015), n))
    outputs, points = rng.uniform(0.1, 0.9, (1, 2)), rng.uniform(0.1, 0.9, (POINTS, 2))
    s = poles_from(LOWEST * level / level[0], zeta)
    at_outputs, at_points = (
        np.sin(np.pi * m[:, None] * at[:, 0]) * np.sin(np.pi * k[:, None] * at[:, 1]) for at in (outputs, points)
    )
    R = np.einsum("no,ni->noi", at_outputs, at_points) / (2j * s.imag)[:, None, None]
    return Structure(s, R * (s**2)[:, None, None], "acceleration")


def plate_response(structure: Structure, errors: Errors, seed: int) -> FrequencyResponse:
    """Return the measured responses of a plate."""
    w = np.abs(structure.poles)
    f = np.linspace(0.8 * w.min(), 1.03 * w.max(), errors.lines) / (2 * np.pi)
    rng = np.random.default_rng([seed, 78])
    shifts = 1 + errors.shift * rng.standard_normal((POINTS, w.size))
    each = [
        replace(structure, poles=structure.poles * by, residues=structure.residues[:, :, [i]])
        for i, by in enumerate(shifts)
    ]
    H = np.concatenate([lines_of(one, f) for one in each], axis=2)
    H = H + errors.part * np.abs(H) * unit_errors(rng, H.shape, errors.together)
    H = H + white_errors(rng, H, 10 ** (-errors.decibel / 20))
    return FrequencyResponse(values=H, frequencies=f, quantity=structure.quantity)
