"""Sound records of kinds that are easily taken for spoilt: sampled far beyond the modes, struck hard, in gusts, in coarse steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from benchmarks.records import faulty_records
from modalscope.data import Signals
from modalscope.numerics.checks import RealArray
from modalscope.systems import chain5, close4, heavy4, ring5


def responses(
    rng: np.random.Generator, forces: RealArray, rate: float, f: RealArray, zeta: RealArray, outputs: int
) -> RealArray:
    """Return accelerations (N, outputs) of a structure of random shapes with modes f (Hz), zeta under forces (N, m)."""
    y = np.zeros((len(forces), outputs))
    for fn, zn in zip(f, zeta, strict=True):
        w = 2 * np.pi * fn
        p = np.exp((-zn * w + 1j * w * np.sqrt(1 - zn**2)) / rate)
        push = forces @ rng.standard_normal(forces.shape[1])
        # impulse response of the acceleration: that of the mode, and the mass at once
        q = lfilter([1.0], [1.0, -2 * p.real, abs(p) ** 2], push) * (p.imag / w)
        a = np.gradient(np.gradient(q)) * rate**2 / rate
        y += np.outer(a, rng.standard_normal(outputs))
    return y


def _modes(rng: np.random.Generator, count: int, highest: float) -> tuple[RealArray, RealArray]:
    f = np.sort(rng.uniform(0.08, 1, count)) * highest
    return f, rng.uniform(0.005, 0.02, count)


def oversampled(seed: int) -> Signals:
    """A shaker in a band up to 200 Hz, six modes below 180 Hz, sampled at 12.8 or 25.6 kHz."""
    rng = np.random.default_rng([1, seed])
    rate = float(rng.choice([12_800.0, 25_600.0]))
    samples = int(20 * rate)
    u = sosfilt(butter(4, 200.0, fs=rate, output="sos"), rng.standard_normal((samples, 1)), axis=0)
    y = responses(rng, u, rate, *_modes(rng, 6, 180.0), outputs=int(rng.integers(2, 5)))
    y += 10 ** (-rng.uniform(30, 50) / 20) * y.std(axis=0).max() * rng.standard_normal(y.shape)
    u = u + 1e-3 * u.std() * rng.standard_normal(u.shape)
    return Signals(outputs=y, inputs=u, sampling_rate=rate, quantities="acceleration")


def struck(seed: int) -> Signals:
    """Hits of a hard or a soft hammer, in runs of one hit or one behind the other; modes up to half of the Nyquist frequency."""
    rng = np.random.default_rng([2, seed])
    rate, hits = float(rng.choice([1024.0, 5120.0, 51_200.0])), int(rng.integers(3, 7))
    f, zeta = _modes(rng, int(rng.integers(3, 9)), rate * rng.uniform(0.05, 0.35))
    samples = int(rate * 6 / (2 * np.pi * np.min(f * zeta))) + 200
    u = np.zeros((hits, samples, 1))
    for run in u:
        start = int(rng.integers(50, 150))
        width = int(rng.integers(1, 6))
        run[start : start + width, 0] = np.hanning(width + 2)[1:-1] * rng.uniform(1, 3)
    together = bool(rng.integers(2))
    forces = u.reshape(1, -1, 1) if together else u
    shapes = int(rng.integers(1 << 30))
    outputs = int(rng.integers(1, 4))
    y = np.stack([responses(np.random.default_rng(shapes), run, rate, f, zeta, outputs) for run in forces])
    y += 10 ** (-rng.uniform(50, 80) / 20) * np.abs(y).max() * rng.standard_normal(y.shape)
    forces = forces + 1e-4 * rng.standard_normal(forces.shape)
    return Signals(outputs=y, inputs=forces, sampling_rate=rate, quantities="acceleration")


def ambient(seed: int) -> Signals:
    """Gusts, twelve bits, hum of mains, gains a thousand apart, coloured forces, or nothing of these."""
    rng = np.random.default_rng([3, seed])
    structure, rate = (chain5, ring5, heavy4, close4)[seed % 4](), float(rng.choice([20.0, 50.0, 100.0]))
    quantity = ("acceleration", "velocity", "displacement")[seed % 3]
    record = structure.simulate(
        inputs="ambient", samples=int(1000 * rate), sampling_rate=rate, quantity=quantity, noise=0.03, seed=seed
    )
    y = np.array(record.outputs)
    t = np.arange(len(y)) / rate
    kind = seed % 6
    if kind == 0:
        slow = lfilter([1.0], [1.0, -np.exp(-1 / (60 * rate))], rng.standard_normal(len(y)))
        y *= np.exp(0.4 * slow / slow.std())[:, None]
    elif kind == 1:
        y = np.round(y / np.abs(y).max() * 2**11) / 2**11
    elif kind == 2:
        y += 0.5 * y.std() * np.sin(2 * np.pi * 0.41 * rate * t)[:, None]
    elif kind == 3:
        y *= 10 ** rng.uniform(-1.5, 1.5, y.shape[1])
    elif kind == 4:
        y = lfilter([1.0], [1.0, -0.7], y, axis=0)
    return replace(record, outputs=y)


def shaken(seed: int) -> Signals:
    """One or two shakers, in a temperature that shifts all frequencies by up to a thousandth between two runs."""
    structure = (chain5, ring5, heavy4, close4)[seed % 4]()
    return structure.simulate(
        samples=24_000, sampling_rate=(20.0, 40.0)[seed % 2], quantity="acceleration", noise=0.02, seed=seed
    )


KINDS: dict[str, Callable[[int], Signals]] = {
    "oversampled": oversampled,
    "struck": struck,
    "ambient": ambient,
    "shaken": shaken,
}


def sound(first: int, each: int) -> Iterator[tuple[str, Signals]]:
    """Yield sound records of all kinds, and those of `faulty_records.sound`."""
    for name, make in KINDS.items():
        for k in range(first, first + each):
            yield f"{name} {k}", make(k)
    yield from ((name, record) for name, record in faulty_records.sound(first) if isinstance(record, Signals))
