"""Roving hammer tests of symmetric structures: one sensor, places in mirrored pairs, several hits and files a place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import fftconvolve

import modalscope as ms
from modalscope.numerics.checks import Array, RealArray


class Roving(NamedTuple):
    """A test: its files, the place of each, and the frequencies (Hz) and shapes (places, modes) of the structure."""

    files: list[ms.Signals]
    places: list[int]
    frequencies: RealArray
    shapes: RealArray


def roving(seed: int, repeatable: float = 0.01) -> Roving:
    """Return a random test on a symmetric string or beam, at equal distances, in the order of a random walk through the files.

    One sensor, not on the plane of symmetry; 5 to 30 places, 1 to 5 files a place of 1 to 5 hits each, 4 to 7 decay times apart; noise 50
    to 80 dB below the largest vibration, damping .4 to 2 %. Hits miss their place by `repeatable` of the distance of two places (standard
    deviation).
    """
    rng = np.random.default_rng([2026, seed])
    count, modes, rate = int(rng.integers(5, 31)), int(rng.integers(3, 7)), 1024.0
    n = np.arange(1, modes + 1)
    f = 380 * (n / modes) ** float(rng.choice([1, 2])) * (1 + 0.02 * rng.standard_normal(modes))
    zeta = rng.uniform(0.004, 0.02, modes)
    x = np.arange(1, count + 1) / (count + 1)
    near = np.abs(x - 0.5) > 0.6 / (count + 1)
    shapes = np.sin(np.pi * np.outer(x, n))
    sensor = shapes[int(rng.choice(np.flatnonzero(near)))]
    files, hits = int(rng.integers(1, 6)), int(rng.integers(1, 6))
    level, seconds = 10 ** (-rng.uniform(50, 80) / 20), float(rng.uniform(4, 7) / np.min(2 * np.pi * f * zeta))
    apart = bool(rng.integers(2))
    records, places = [], np.repeat(np.arange(count), files)
    rng.shuffle(places)
    for place in places:
        at = x[place] + repeatable / (count + 1) * rng.standard_normal(hits)
        y, u = _hits(rng, f, zeta, sensor * np.sin(np.pi * np.outer(at, n)), rate, seconds, apart)
        y = y + level * np.abs(y).max() * rng.standard_normal(y.shape)
        u = u + 1e-4 * u.max() * rng.standard_normal(u.shape)
        records.append(ms.Signals(outputs=y[:, :, None], inputs=u[:, :, None], sampling_rate=rate))
    order = {int(place): k for k, place in enumerate(dict.fromkeys(places.tolist()))}
    return Roving(records, [order[int(place)] for place in places], f, shapes[list(order)])


def _hits(
    rng: np.random.Generator,
    f: RealArray,
    zeta: RealArray,
    residues: RealArray,
    rate: float,
    seconds: float,
    rest: bool,
) -> tuple[Array, Array]:
    """Return accelerations and forces (hits, N) of hits with residues (hits, modes); without `rest` a hit follows on another."""
    hits, samples = len(residues), int(seconds * rate) + 100
    t = np.arange(hits * samples) / rate
    w = 2 * np.pi * f
    damped = w * np.sqrt(1 - zeta**2)
    poles = -zeta * w + 1j * damped
    # acceleration: the second derivative of exp(p t) / damped
    h = np.imag(np.exp(np.outer(t, poles)) * poles**2 / damped)
    outputs, inputs = np.zeros((hits, t.size)), np.zeros((hits, t.size))
    for k, residue in enumerate(residues):
        pulse = np.hanning(int(rng.integers(2, 4)) + 2)[1:-1] * rng.uniform(10, 40)
        start = k * samples + int(rng.integers(30, 60))
        inputs[k, start : start + len(pulse)] = pulse
        response = h @ residue + np.r_[rate * residue.sum(), np.zeros(t.size - 1)]
        outputs[k, start:] = fftconvolve(response, pulse)[: t.size - start] / rate
    if rest:
        own = [slice(k * samples, (k + 1) * samples) for k in range(hits)]
        return tuple(np.array([x[k, part] for k, part in enumerate(own)]) for x in (outputs, inputs))
    return outputs.sum(axis=0)[None], inputs.sum(axis=0)[None]
