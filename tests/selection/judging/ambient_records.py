"""Random structures under ambient forces, machines that turn beside them, and records of nothing but noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modalscope.data import Signals, StateSpace

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ambient:
    """A random structure: what is true of it, and its records at any rate.

    Parameters
    ----------
    frequencies : array, (n,)
        Hz.
    damping_ratios : array, (n,)
    shapes : array, (l, n)
        Of unit modal mass; white forces act on all outputs.
    duration : float
        Seconds.
    acceleration : bool
        Whether accelerations are measured, else velocities.
    """

    frequencies: Array
    damping_ratios: Array
    shapes: Array
    duration: float
    acceleration: bool

    @property
    def rate(self) -> float:
        """A sensible sampling rate: three samples a period of the highest mode."""
        return float(3 * self.frequencies[-1])

    @property
    def damping_law(self) -> Array:
        """Relative standard deviation of damping that no estimator betters, (2 pi zeta cycles)^-1/2, of a single mode without noise.

        Au, "Uncertainty law in ambient modal identification", Mechanical Systems and Signal Processing 48, 2014.
        """
        return np.asarray((2 * np.pi * self.damping_ratios * self.frequencies * self.duration) ** -0.5)

    def record(self, times: float, seed: int, noise: float = 0.1) -> Signals:
        """Return a record at so many times the sensible rate, with white noise on every channel as a part of its RMS (.1 is 20 dB)."""
        rng = np.random.default_rng(seed)
        rate = times * self.rate
        w, n = 2 * np.pi * self.frequencies, len(self.frequencies)
        decay = 2 * self.damping_ratios * w
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(w**2), -np.diag(decay)]])
        B = np.vstack([np.zeros((n, len(self.shapes))), self.shapes.T])
        if self.acceleration:
            C, D = self.shapes @ A[n:], self.shapes @ self.shapes.T
        else:
            C, D = self.shapes @ np.eye(2 * n)[n:], None
        model = StateSpace(A=A, B=B, C=C, D=D).to_discrete(1 / rate, "held")
        settling = int(rate * 4 / float(decay.min() / 2))
        forces = rng.standard_normal((round(self.duration * rate) + settling, len(self.shapes)))
        y = np.asarray(model.simulate(forces))[settling:]
        y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
        quantity = "acceleration" if self.acceleration else "velocity"
        return Signals(outputs=y, sampling_rate=rate, quantities=(quantity,) * y.shape[1])


def random_structure(seed: int) -> Ambient:
    """Return a random structure: 3-8 modes, 4-8 outputs, .5-2 % of damping, measured for 10-30 minutes.

    Neighbours are at least 4 % apart, and every mode is seen.
    """
    rng = np.random.default_rng(seed)
    n, l = int(rng.integers(3, 9)), int(rng.integers(4, 9))
    steps = rng.exponential(1.0, n - 1)
    steps = 0.04 + steps / steps.sum() * (np.log(rng.uniform(3, 10)) - 0.04 * (n - 1))
    f = rng.uniform(0.5, 3) * np.exp(np.r_[0, np.cumsum(steps)])
    zeta = np.exp(rng.uniform(*np.log([0.005, 0.02]), n))
    return Ambient(f, zeta, rng.standard_normal((l, n)), float(rng.uniform(600, 1800)), bool(rng.integers(2)))


@dataclass(frozen=True)
class Machine:
    """A record of a random structure with three harmonics of a shaft.

    Parameters
    ----------
    structure : Ambient
    record : Signals
    lines : array, (3,)
        Hz, mean.
    """

    structure: Ambient
    record: Signals
    lines: Array


def beside_a_machine(seed: int, wander: float) -> Machine:
    """Return a record with orders 1, 2 and 3 of a shaft whose speed wanders by so much (its standard deviation, relative).

    The second order is 2 % above a mode. Each harmonic has .5 to 1.5 times the root mean square of the random vibration of each channel's
    mean, another size and phase in every channel. Speed wanders within half a minute.
    """
    rng = np.random.default_rng(seed)
    structure = random_structure(seed)
    clean = structure.record(1.2, seed + 1)
    rate, y = clean.sampling_rate, np.asarray(clean.outputs)
    near = structure.frequencies[int(rng.integers(len(structure.frequencies)))]
    shaft = 1.02 * near / 2
    slow = rng.standard_normal(len(y))
    kernel = np.hanning(max(int(30 * rate), 3))
    slow = np.convolve(slow, kernel, mode="same")
    slow = (slow - slow.mean()) / slow.std()
    phase = 2 * np.pi * np.cumsum(shaft * (1 + wander * slow)) / rate
    lines = [k for k in (1, 2, 3) if k * shaft < 0.45 * rate]
    for k in lines:
        size = y.std() * rng.uniform(0.5, 1.5) * rng.uniform(0.4, 1, y.shape[1]) * np.sqrt(2)
        y = y + size * np.cos(k * phase[:, None] + rng.uniform(0, 2 * np.pi, y.shape[1]))
    record = Signals(outputs=y, sampling_rate=rate, quantities=clean.quantities)
    return Machine(structure, record, shaft * np.array(lines, dtype=float))
