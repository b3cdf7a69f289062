"""Random structures of the hard kind, and how complete a list of their modes is.

Residues follow from real mode shapes of a structure that is driven where it is measured: R = phi phi_d' / (2 j w_d), times s for velocity
and s^2 for acceleration. Sizes of shapes scatter, so that weak modes lie beside strong ones; the noise of a channel is a share of its own
level, so that it is no product of an output's and an input's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.modes import ModalModel
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.statistics import assign
from modalscope.selection.likelihood.likelihood import whitened
from modalscope.selection.likelihood.whitening import levels_of

#: Neighbours differ by this part of the frequency at least.
GAP = 0.02

#: A mode is found when a reported pole lies within this part of the larger decay rate: weak modes are known no better.
NEAR = 1.0

QUANTITIES = ("displacement", "velocity", "acceleration")


@dataclass(frozen=True, eq=False)
class Structure:
    """A structure of known modes: poles (n,) in rad/s, residues (n, l, m) of impulse responses."""

    poles: ComplexArray
    residues: ComplexArray
    quantity: str

    @property
    def top(self) -> float:
        """Highest natural frequency, Hz."""
        return float(np.abs(self.poles).max() / (2 * np.pi))


def random_structure(
    seed: int | Sequence[int], modes: tuple[int, int] = (5, 12), band: tuple[float, float] = (3, 8)
) -> Structure:
    """Return 5 to 12 modes of 3 to 8 outputs and 1 to 3 inputs, damping .3 to 3 %, frequencies over a band of 1 to 8 or less."""
    rng = np.random.default_rng(seed)
    n, l, m = int(rng.integers(modes[0], modes[1] + 1)), int(rng.integers(3, 9)), int(rng.integers(1, 4))
    while True:
        f = np.sort(np.exp(rng.uniform(0, np.log(rng.uniform(*band)), n)))
        if n == 1 or np.min(np.diff(f) / f[:-1]) >= GAP:
            break
    zeta = np.exp(rng.uniform(np.log(0.003), np.log(0.03), n))
    shapes = rng.standard_normal((l, n)) * np.exp(0.7 * rng.standard_normal(n))
    quantity = QUANTITIES[int(rng.integers(3))]
    s = poles_from(10 * f, zeta)
    R = np.einsum("on,in->noi", shapes, shapes[rng.choice(l, m, replace=False)]) / (2j * s.imag)[:, None, None]
    return Structure(s, R * (s ** QUANTITIES.index(quantity))[:, None, None], quantity)


def lines_of(structure: Structure, frequencies: RealArray) -> ComplexArray:
    """Return the noise-free frequency response, by the plain definition: (j w)^p times that of the displacements."""
    x, p = 2j * np.pi * frequencies[:, None], QUANTITIES.index(structure.quantity)
    s = structure.poles
    R = (structure.residues / (s**p)[:, None, None]).reshape(s.size, -1)
    H = x**p * ((1 / (x - s)) @ R + (1 / (x - s.conj())) @ R.conj())
    return np.asarray(H.reshape(-1, *structure.residues.shape[1:]))


def frequency_response(structure: Structure, decibel: float, seed: int, lines: int = 500) -> tuple[Any, RealArray]:
    """Return a noisy frequency response, and the deviation of a real row of every channel."""
    f = np.linspace(0.7 * np.abs(structure.poles).min(), 1.15 * np.abs(structure.poles).max(), lines) / (2 * np.pi)
    H = lines_of(structure, f)
    rng = np.random.default_rng([seed, 1])
    sigma = np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2) * 10 ** (-decibel / 20)
    H = H + sigma * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    return FrequencyResponse(values=H, frequencies=f, quantity=structure.quantity), sigma


def impulse_response(structure: Structure, decibel: float, seed: int, samples: int = 800) -> tuple[Any, RealArray]:
    """Return a noisy sampled impulse response, and the deviation of every channel."""
    rate = 2.6 * structure.top
    R = structure.residues.reshape(structure.poles.size, -1)
    Y = 2 * (np.exp(np.outer(np.arange(samples) / rate, structure.poles)) @ R).real
    Y = Y.reshape(samples, *structure.residues.shape[1:])
    rng = np.random.default_rng([seed, 2])
    sigma = np.sqrt(np.mean(Y**2, axis=0)) * 10 ** (-decibel / 20)
    Y = Y + sigma * rng.standard_normal(Y.shape)
    return ImpulseResponse(values=Y, sampling_rate=rate, kind="dirac", quantity=structure.quantity), sigma


def deviations_of(structure: Structure, response: Any, sigma: RealArray) -> RealArray:
    """Return by how many standard deviations of the noise each mode stands out of it, taken alone, (n,)."""
    functions = response.basis(structure.poles, ()).functions.reshape(-1, structure.poles.size, 2)
    R = structure.residues / sigma
    sizes = np.array(
        [
            np.sum((functions[:, j] @ np.stack([R[j].real.ravel(), R[j].imag.ravel()])) ** 2)
            for j in range(structure.poles.size)
        ]
    )
    return np.asarray(np.sqrt(sizes / 2))


def gains_of(structure: Structure, response: Any, sigma: RealArray) -> RealArray:
    """Return by how many standard deviations each mode is needed beside the others, (n,): what overlaps with them is not its own.

    The rise of the squared misfit at the truth when it goes and shapes and terms of the others are fitted again.
    """
    levels = levels_of(sigma, sigma)
    rows = np.ones(len(response.basis(structure.poles[:0], ()).data))
    none, powers = np.zeros(0, complex), response.outside_powers
    problem = whitened(response, none, powers, rows, levels.outputs, levels.inputs)
    parts = [np.linalg.svd(R / levels.outputs[:, None] / levels.inputs) for R in structure.residues]
    sides = np.array([U[:, 0] if problem.turned else Vh[0] for U, _, Vh in parts])
    return np.asarray(np.sqrt(problem.at(structure.poles, sides, slopes=False).fitted().gain / 2))


@dataclass(frozen=True)
class Score:
    """How complete a list is: true modes found (in their order), and how many reported ones are no mode."""

    found: Array
    spurious: int
    errors: RealArray

    def perfect(self, strong: Array) -> bool:
        """Whether every strong mode is there and nothing that is no mode."""
        return bool(np.all(self.found[strong])) and not self.spurious


def score(structure: Structure, modes: ModalModel) -> Score:
    """Pair true and reported poles, each once: within `NEAR` decay rates, relative to the larger of both."""
    s, p = structure.poles, modes.poles
    rate = np.maximum(-s.real[:, None], -p.real)
    distance = np.abs(s[:, None] - p) / rate
    found, errors = np.zeros(s.size, bool), np.full(s.size, np.nan)
    if p.size:
        for i, j in zip(*assign(distance), strict=True):
            if distance[i, j] < NEAR:
                found[i], errors[i] = True, abs(modes.damping_ratios[j] / (-s[i].real / abs(s[i])) - 1)
    return Score(found, int(p.size - found.sum()), errors)
