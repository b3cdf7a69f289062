"""Structures of many modes over a wide band, of which a band of its own is asked, its ends wherever they fall.

Where errors are coloured they are those of `coloured`: resonances that shift from input to input, and lines that err with their neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.data.modes import ModalModel
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import assign
from tests.selection.judging.coloured import unit_errors, white_errors
from tests.selection.judging.hard import NEAR, Structure, gains_of, lines_of, random_structure
from tests.selection.judging.narrow import Narrow, narrow_gains

#: What lies within so many half bandwidths of an end may be listed or not.
AT_END = 1.0

#: Resonances of a coloured case shift from input to input by this part; errors are this part of the response, over so many lines.
SHIFT, ERROR, TOGETHER = 3e-4, 0.03, 9


@dataclass(frozen=True, eq=False)
class SubBand:
    """All lines of a test, and the band that is asked.

    Parameters
    ----------
    structure : Structure
    response : FrequencyResponse
        All lines.
    band : (float, float)
        Hz.
    white : float
        Noise, as part of the level of every channel.
    coloured : bool
    """

    structure: Structure
    response: FrequencyResponse
    band: tuple[float, float]
    white: float
    coloured: bool

    @property
    def strong(self) -> Array:
        """Whether each mode lies in the band and stands ten deviations of the errors out of its lines beside the others, (n,)."""
        f, half = np.abs(self.structure.poles) / (2 * np.pi), -self.structure.poles.real / (2 * np.pi)
        low, high = self.band
        strong = (f > low + AT_END * half) & (f < high - AT_END * half)
        if self.coloured:
            which = np.flatnonzero(strong)
            errors = Narrow(self.structure, self.response, self.band, which, SHIFT, ERROR, self.white, TOGETHER)
            strong[which] = narrow_gains(errors) > 10
            return strong
        level = np.sqrt(np.mean(np.abs(lines_of(self.structure, self.response.frequencies)) ** 2, axis=0) / 2)
        return strong & (gains_of(self.structure, self.response.band(low, high), self.white * level) > 10)

    def scored(self, modes: ModalModel) -> tuple[Array, int]:
        """Return which of the strong modes are listed, and how many are listed that are no modes of the band.

        Parameters
        ----------
        modes : ModalModel
        """
        s, p = self.structure.poles, modes.poles
        half, found, spurious = -s.real, np.zeros(s.size, bool), len(modes)
        f, (low, high) = np.abs(s), 2 * np.pi * np.array(self.band)
        may = (f > low - AT_END * half) & (f < high + AT_END * half)
        distance = np.abs(s[:, None] - p) / np.maximum(half[:, None], -p.real)
        for i, j in zip(*assign(np.where(may[:, None], distance, 1e6)), strict=True) if p.size else ():
            if may[i] and distance[i, j] < NEAR:
                found[i], spurious = True, spurious - 1
        return found[self.strong], spurious


def many_modes(seed: int) -> Structure:
    """Return 12 to 20 modes over a band of 1 to 6 or more."""
    return random_structure([seed, 21], (12, 20), (6, 15))


def sub_band(seed: int, decibel: float, *, coloured: bool = False) -> SubBand:
    """Return a band of 2 to 6 neighbouring modes, either end anywhere between the last mode inside and the first one outside."""
    structure, rng = many_modes(seed), np.random.default_rng([seed, 22])
    f0, n = np.abs(structure.poles) / (2 * np.pi), structure.poles.size
    f = np.linspace(0.7 * f0.min(), 1.15 * f0.max(), int(rng.integers(2000, 5000)))
    count = int(rng.integers(2, 7))
    first = int(rng.integers(0, n - count + 1))
    edges = np.concatenate([f[:1], f0, f[-1:]])
    band = (
        float(rng.uniform(edges[first], edges[first + 1])),
        float(rng.uniform(edges[first + count], edges[first + count + 1])),
    )
    part = 10 ** (-decibel / 20)
    H = lines_of(structure, f)
    noise = white_errors(rng, H, part)
    if coloured:
        by = 1 + SHIFT * rng.standard_normal((H.shape[2], n))
        H = np.concatenate([lines_of(_moved(structure, each, i), f) for i, each in enumerate(by)], axis=2)
        H = H + ERROR * np.abs(H) * unit_errors(rng, H.shape, TOGETHER)
    response = FrequencyResponse(values=H + noise, frequencies=f, quantity=structure.quantity)
    return SubBand(structure, response, band, part, coloured)


def _moved(structure: Structure, by: RealArray, i: int) -> Structure:
    return replace(structure, poles=structure.poles * by, residues=structure.residues[:, :, [i]])
