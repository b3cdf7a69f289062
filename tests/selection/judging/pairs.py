"""Structures with two modes much closer than their bandwidths, and how far the data of one test can part them."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.data.indicators import mac
from modalscope.data.modes import ModalModel
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.information import inverse, normal
from modalscope.selection.likelihood.likelihood import whitened
from modalscope.selection.likelihood.whitening import levels_of
from tests.selection.judging.hard import Structure

#: Outputs, and shapes of a pair are less alike than this.
OUTPUTS, UNLIKE = 6, 0.7


def structure_with_pair(seed: int, low: float, high: float, *, inputs: int = 2, alike: bool = False) -> Structure:
    """Return six modes, the first two of them `low` to `high` half bandwidths apart, of shapes with a MAC below .7 or of one shape.

    Damping .5 to 2 %, alike within a tenth in the pair; displacement; driven at the first outputs.
    """
    rng = np.random.default_rng([seed, 7])
    f = 10 * np.exp(np.sort(rng.uniform(0, 1.6, 5)))
    while np.min(np.diff(f) / f[:-1]) < 0.08:
        f = 10 * np.exp(np.sort(rng.uniform(0, 1.6, 5)))
    zeta = np.exp(rng.uniform(np.log(0.005), np.log(0.02), 5))
    which, apart = int(rng.integers(5)), rng.uniform(low, high)
    f = np.append(f[which], np.insert(np.delete(f, which), 0, f[which] * (1 + apart * zeta[which])))
    zeta = np.append(zeta[which], np.insert(np.delete(zeta, which), 0, zeta[which] * rng.uniform(0.9, 1.1)))
    while True:
        shapes = rng.standard_normal((OUTPUTS, 6))
        if alike:
            shapes[:, 1] = shapes[:, 0] * rng.uniform(0.6, 1.6)
        if (alike or mac(shapes[:, :2])[0, 1] < UNLIKE) and _sees(shapes[:inputs]):
            break
    s = poles_from(f, zeta)
    return Structure(s, np.einsum("on,in->noi", shapes, shapes[:inputs]) / (2j * s.imag)[:, None, None], "displacement")


def _sees(driven: RealArray) -> bool:
    """Whether the inputs drive both modes of the pair: one that none of them moves is no mode of the test."""
    size = np.linalg.norm(driven[:, :2], axis=0)
    return bool(np.all(size > 0.3))


def apart_in_deviations(structure: Structure, response: Any, sigma: RealArray) -> float:
    """Return the distance of the first two poles in deviations of their difference, at the Cramer-Rao bound.

    d' C^-1 d for d the real and imaginary part of s_2 - s_1 and C its covariance.
    """
    levels = levels_of(sigma, sigma)
    rows = np.ones(len(response.basis(structure.poles[:0], ()).data))
    problem = whitened(response, structure.poles[:0], response.outside_powers, rows, levels.outputs, levels.inputs)
    parts = [np.linalg.svd(R / levels.outputs[:, None] / levels.inputs) for R in structure.residues]
    sides = np.array([U[:, 0] if problem.turned else Vh[0] for U, _, Vh in parts])
    point = problem.at(structure.poles, sides)
    covariance = inverse(normal(point, point.fitted())[0])
    p = sides.shape[1]
    one, two = np.arange(2), 2 * p + np.arange(2)
    of_difference = (
        covariance[np.ix_(one, one)]
        + covariance[np.ix_(two, two)]
        - covariance[np.ix_(one, two)]
        - covariance[np.ix_(two, one)]
    )
    d = structure.poles[1] - structure.poles[0]
    both = np.array([d.real, d.imag])
    return float(np.sqrt(both @ np.linalg.solve(of_difference, both)))


def both_found(structure: Structure, modes: ModalModel) -> bool:
    """Whether each of the pair has a mode of its own within half their distance, one-to-one."""
    pair: ComplexArray = structure.poles[:2]
    near = np.abs(pair[:, None] - modes.poles) < abs(pair[1] - pair[0]) / 2
    return bool(near.shape[1] and np.all(near.any(axis=1)))


def listed_in_pair(structure: Structure, modes: ModalModel) -> int:
    """Return how many modes are listed within a bandwidth of the pair."""
    middle = structure.poles[:2].mean()
    return int(np.sum(np.abs(modes.poles - middle) < -2 * middle.real))
