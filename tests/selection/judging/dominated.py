"""Ambient records in which one mode hides others: by its size, by its nearness, or by what the channels carry beside the modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter, ss2tf

from modalscope.data import ModalModel, Signals
from modalscope.data.indicators import mac

Array = NDArray[np.float64]

#: Samples of every record.
SAMPLES = 18_000

#: A mode is right within this part of its frequency.
NEAR = 0.012


class Hidden(NamedTuple):
    """A record, and what is true of it: frequencies (n,) in Hz, shapes (l, n), the least MAC of a shape that is right, and units (l,)."""

    record: Signals
    frequencies: Array
    shapes: Array
    least: float
    units: Array | float = 1.0

    def judged(self, modes: ModalModel) -> tuple[int, int]:
        """Return how many modes are right, and how many of those found are near none: false."""
        f = modes.frequencies
        near = np.abs(f[None, :] / self.frequencies[:, None] - 1) < NEAR
        shapes = modes.shapes / np.reshape(self.units, (-1, 1))
        alike = mac(self.shapes.astype(complex), shapes) if len(modes) else np.zeros(near.shape)
        right = int(np.any(near & (alike > self.least), axis=1).sum()) if len(modes) and len(self.frequencies) else 0
        return right, int((~near.any(axis=0)).sum()) if len(self.frequencies) else len(modes)


def dominated(seed: int, ratio: float = 300.0) -> Hidden:
    """Return two to four modes on two to six outputs, .5 to 2 %, the strongest 1 to `ratio` times each of the others in RMS."""
    rng = np.random.default_rng([1, seed])
    n = int(rng.integers(2, 5))
    l = int(rng.integers(max(n, 2), 7))
    f = rng.uniform(0.6, 1.2) * np.cumprod(np.r_[1, rng.uniform(1.2, 1.9, n - 1)])
    sizes = np.exp(-rng.uniform(0, np.log(ratio), n))
    sizes[rng.integers(n)] = 1.0
    return hidden_modes(
        rng, f, np.exp(rng.uniform(np.log(0.005), np.log(0.02), n)), _independent(rng, l, n), sizes, 20.0
    )


def control(seed: int) -> Hidden:
    """Return the same with modes of one size."""
    return dominated(seed, 1.0)


def tower(seed: int) -> Hidden:
    """Return a pair 1.5 to 4 % apart with orthogonal shapes, the second .05 to 1 times the first, and a third mode far above."""
    rng = np.random.default_rng([2, seed])
    first = rng.uniform(0.2, 0.26)
    f = first * np.array([1.0, 1 + rng.uniform(0.015, 0.04), rng.uniform(4.5, 6)])
    turn = rng.uniform(0, np.pi)
    pair = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)], [0.0, 0.0]])
    shapes = np.column_stack([pair + 0.2 * rng.standard_normal((3, 1)) * [[0], [0], [1]], rng.standard_normal(3)])
    sizes = np.array([1.0, np.exp(rng.uniform(np.log(0.05), 0)), 0.05])
    return hidden_modes(rng, f, rng.uniform(0.004, 0.008, 3), shapes, sizes, 5.0, least=0.85)


def spoilt(seed: int) -> Hidden:
    """Return modes of like size with drift (every third seed), offsets, or channels in other units."""
    rng = np.random.default_rng([3, seed])
    made = control(seed)
    y = np.asarray(made.record.outputs)
    l = y.shape[1]
    kind, units = seed % 3, np.ones(l)
    if kind == 0:  # a straight line
        y = y + rng.uniform(3, 300, l) * y.std(axis=0) * np.linspace(-1, 1, len(y))[:, None]
    elif kind == 1:
        y = y + rng.uniform(10, 1000, l) * y.std(axis=0)
    else:
        units = 10.0 ** rng.uniform(-3, 3, l)
        y = y * units
    return made._replace(record=Signals(outputs=y, sampling_rate=made.record.sampling_rate), units=units)


def noise(seed: int) -> Hidden:
    """Return one to six channels of white noise."""
    rng = np.random.default_rng([4, seed])
    l = int(rng.integers(1, 7))
    y = rng.standard_normal((SAMPLES, l)) @ rng.standard_normal((l, l))
    return Hidden(Signals(outputs=y, sampling_rate=20.0), np.zeros(0), np.zeros((l, 0)), 0.9)


#: The families by name.
FAMILIES: dict[str, Callable[[int], Hidden]] = {
    "one mode dominates, 1 to 300 times": dominated,
    "a close pair, the second .05 to 1 times": tower,
    "drift, offsets, other units": spoilt,
    "modes of like size": control,
    "white noise": noise,
}


def _independent(rng: np.random.Generator, l: int, n: int) -> Array:
    """Return shapes whose cosines are below .7: a mode that looks like another is found nowhere."""
    while True:
        shapes = rng.standard_normal((l, n))
        unit = shapes / np.linalg.norm(shapes, axis=0)
        if np.all(np.abs(unit.T @ unit - np.eye(n)) < 0.7):
            return unit


def hidden_modes(
    rng: np.random.Generator, f: Array, zeta: Array, shapes: Array, sizes: Array, rate: float, least: float = 0.9
) -> Hidden:
    """Return accelerations of modes under independent white forces, with sensor noise of a thousandth of each channel."""
    settle = int(4 * rate / (2 * np.pi * float(np.min(f * zeta))))
    q = np.zeros((SAMPLES, len(f)))
    for j, (w, z) in enumerate(zip(2 * np.pi * f, zeta, strict=True)):
        A = np.array([[0, 1], [-(w**2), -2 * z * w]])
        both = expm(np.block([[A, np.array([[0.0], [1.0]])], [np.zeros((1, 3))]]) / rate)
        b, a = ss2tf(both[:2, :2], both[:2, 2:], A[1:], np.ones((1, 1)))
        own = lfilter(b[0], a, rng.standard_normal(SAMPLES + settle))[settle:]
        q[:, j] = own / own.std()
    y = q @ (shapes * sizes).T
    y = y + 0.001 * y.std(axis=0) * rng.standard_normal(y.shape)
    return Hidden(Signals(outputs=y, sampling_rate=rate), f, shapes, least)
