"""Responses of files that were driven at one place, or at several, of random structures."""

from __future__ import annotations

import numpy as np

from modalscope.numerics.checks import ComplexArray, RealArray

#: Lines of a response, and its band in Hz.
_LINES, _BAND = 3000, (20.0, 1000.0)


class Structure:
    """A random structure in one or two dimensions of 3 to 12 modes, with 1 to 3 sensors."""

    def __init__(self, rng: np.random.Generator) -> None:
        modes = int(rng.integers(3, 13))
        self.rng, self.plate = rng, bool(rng.integers(2))
        self.f = np.sort(rng.uniform(1.5 * _BAND[0], 0.95 * _BAND[1], modes))
        self.zeta = rng.uniform(0.003, 0.02, modes)
        self.waves = rng.permutation(modes)[:, None] + np.ones(2) if not self.plate else rng.integers(1, 5, (modes, 2))
        self.phase = rng.uniform(0, np.pi) * np.ones(2) if not self.plate else rng.uniform(0, np.pi, 2)
        self.sensors = self.shapes(rng.uniform(0.05, 0.95, (int(rng.integers(1, 4)), 2)))

    def shapes(self, x: RealArray) -> RealArray:
        """Return the mode shapes at places x (p, 2) of the unit square, (p, modes); of a beam the second coordinate is idle."""
        waves = np.sin(np.pi * x[:, None, :] * self.waves + self.phase)
        return np.asarray(np.prod(waves, axis=2) if self.plate else waves[:, :, 0])

    def distant(self, count: int, least: float = 0.05) -> RealArray:
        """Return random places (count, 2), of a beam and of a plate at least so far apart along the first axis."""
        x = 0.05 + least * np.arange(count)
        free = 0.95 - x[-1]
        x += np.sort(self.rng.uniform(0, free, count))
        return np.column_stack([self.rng.permutation(x), self.rng.uniform(0.05, 0.95, count)])

    def files(self, x: RealArray, gains: float, misses: float, modes: float) -> ComplexArray:
        """Return responses (files, lines, outputs) at places x (files, 2): gains, misses and sizes of modes scatter by these deviations.

        Frequencies shift by .05 to .2 % between files; noise lies 20 to 60 dB below the mean power, of one file of four or five in some
        tests five times as high.
        """
        rng, count = self.rng, len(x)
        shapes = self.shapes(x + misses * rng.standard_normal(x.shape))
        shapes *= 1 + modes * rng.standard_normal(shapes.shape)
        f = self.f * (1 + rng.uniform(0.0005, 0.002) * rng.standard_normal((count, 1)))
        line = np.linspace(*_BAND, _LINES)[None, :, None]
        each = line**2 / (f[:, None, :] ** 2 - line**2 + 2j * self.zeta * f[:, None, :] * line)
        H = np.einsum("klr,kr,or->klo", each, shapes, self.sensors)
        H *= np.exp(gains * rng.standard_normal((count, 1, 1)))
        level = 10 ** (-rng.uniform(20, 60) / 20) * np.sqrt(np.mean(np.abs(H) ** 2)) * np.ones((count, 1, 1))
        level[rng.integers(count)] *= 5 if rng.integers(2) else 1
        noise = rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)
        return np.asarray(H + level * noise / np.sqrt(2))


def one_place(seed: int) -> ComplexArray:
    """Return 3 to 7 hits on one place: gains scatter by 0 to 15 %, misses by 0 to .8 % of the length, modes by 0 to 5 %."""
    rng = np.random.default_rng([1, seed])
    structure, count = Structure(rng), int(rng.integers(3, 8))
    x = np.repeat(rng.uniform(0.05, 0.95, (1, 2)), count, axis=0)
    return structure.files(x, rng.uniform(0, 0.15), rng.uniform(0, 0.008), rng.uniform(0, 0.05))


def several_places(seed: int) -> ComplexArray:
    """Return one hit on each of 3 to 15 places."""
    rng = np.random.default_rng([2, seed])
    structure = Structure(rng)
    x = structure.distant(int(rng.integers(3, 16)))
    return structure.files(x, rng.uniform(0, 0.15), rng.uniform(0, 0.008), rng.uniform(0, 0.05))


def repeated_places(seed: int) -> tuple[ComplexArray, list[int]]:
    """Return hits on 2 to 4 places, 1 to 4 on each, and the place of every file."""
    rng = np.random.default_rng([3, seed])
    structure, count = Structure(rng), int(rng.integers(2, 5))
    x, hits = structure.distant(count), rng.integers(1, 5, count)
    hits[0] += 1 if hits.sum() == count else 0
    places = np.repeat(np.arange(count), hits)
    return structure.files(
        x[places], rng.uniform(0, 0.05), rng.uniform(0, 0.002), rng.uniform(0, 0.02)
    ), places.tolist()
