"""Roving tests: one point is struck after the other, and every file has frequencies of its own; half of them with a close pair."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.data.modes import ModalModel
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.statistics import assign

#: Lines, Hz.
LINES = np.arange(20, 560, 0.25)

#: A reported mode is a true one within this part of its frequency, within its damping ratio, and in a pair within .4 of its distance; what
#: lies within so many half bandwidths of one that is listed is listed twice.
NEAR, NEAR_IN_PAIR, TWICE = 0.004, 0.4, 2.5


class Roving(NamedTuple):
    """A test, its frequencies (Hz) and damping ratios, (n,), and the first mode of a close pair, if there is one."""

    response: FrequencyResponse
    frequencies: RealArray
    damping_ratios: RealArray
    pair: int | None


def roving(seed: int, sensors: int | None = None) -> Roving:
    """Return 8 to 14 modes at 10 to 20 points and 1 to 3 accelerometers, damping .4 to 1.2 %, noise of 30 to 60 dB.

    Frequencies shift from point to point with a standard deviation of up to .2 %, every mode in its own way. Even seeds have a pair 1.2 to
    2.5 half bandwidths apart.
    """
    rng = np.random.default_rng([seed, 7700])
    points, outputs = int(rng.integers(10, 21)), int(rng.integers(1, 4))
    outputs = outputs if sensors is None else sensors
    n, shift, decibel = int(rng.integers(8, 14)), rng.uniform(0, 0.002), rng.uniform(30, 60)
    while True:
        f = np.sort(rng.uniform(50, 500, n))
        if np.min(np.diff(f) / f[:-1]) > 0.03:
            break
    zeta, pair = np.exp(rng.uniform(np.log(0.004), np.log(0.012), n)), None
    if seed % 2 == 0:
        pair = int(rng.integers(1, n - 1))
        f = np.insert(f, pair + 1, f[pair] * (1 + zeta[pair] * rng.uniform(1.2, 2.5)))
        zeta = np.insert(zeta, pair + 1, zeta[pair] * rng.uniform(0.8, 1.25))
    x, waves = np.sort(rng.uniform(0, 1, points + outputs)), np.pi * (0.7 * np.arange(1, len(f) + 1) + 0.5)
    shapes = np.array([np.sin(wave * x + rng.uniform(0, 6)) for wave in waves]).T
    shapes = shapes + 0.3 * rng.standard_normal(shapes.shape)
    places = rng.permutation(points + outputs)
    struck, seen = shapes[places[:points]], shapes[places[points:]]
    H = np.zeros((LINES.size, outputs, points), complex)
    for k in range(points):
        own = shift * rng.standard_normal() * (1 + 0.5 * rng.standard_normal(len(f)))
        H[:, :, k] = _accelerances(poles_from(f * (1 + own), zeta), seen * struck[k])
    sigma = np.sqrt(np.mean(np.abs(H) ** 2) / 2) * 10 ** (-decibel / 20)
    H += sigma * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    return Roving(FrequencyResponse(values=H, frequencies=LINES, quantity="acceleration"), f, zeta, pair)


def _accelerances(s: ComplexArray, products: RealArray) -> ComplexArray:
    """Return the responses (F, l) of poles (n,) whose shapes at output and input have such products, (l, n)."""
    w = 2j * np.pi * LINES[:, None]
    R = products / (2j * s.imag)
    return np.asarray(w**2 * ((1 / (w - s)) @ R.T + (1 / (w - s.conj())) @ R.conj().T))


class Counted(NamedTuple):
    """Modes found and in all, false ones, those listed twice, and whether a pair was found; None without one."""

    found: int
    modes: int
    false: int
    twice: int
    pair: bool | None

    @property
    def perfect(self) -> bool:
        return self.found == self.modes and not self.false and not self.twice


def counted(test: Roving, modes: ModalModel) -> Counted:
    """Return how a list holds against the truth; each mode is paired once."""
    _, f, zeta, pair = test
    room = f * np.maximum(NEAR, zeta)
    if pair is not None:
        room[[pair, pair + 1]] = np.minimum(room[[pair, pair + 1]], NEAR_IN_PAIR * (f[pair + 1] - f[pair]))
    apart = np.abs(f[:, None] - modes.frequencies) / room[:, None]
    rows, columns = assign(np.minimum(apart, 10)) if len(modes) else (np.zeros(0, int), np.zeros(0, int))
    good = apart[rows, columns] <= 1
    found, others = rows[good], np.setdiff1d(np.arange(len(modes)), columns[good])
    near = np.abs(f[found, None] - modes.frequencies[others]) < TWICE * (zeta * f)[found, None]
    twice = int(near.any(axis=0).sum()) if found.size else 0
    both = None if pair is None else {pair, pair + 1} <= set(found.tolist())
    return Counted(len(found), len(f), len(others) - twice, twice, both)
