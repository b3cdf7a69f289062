"""Data that benchmarks work on: impulse responses, frequency responses and records of known modes, with noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from modalscope.numerics.functions.poles import poles_from

__all__ = ["PLACE", "Data", "ambient", "lines", "modes", "samples"]

Data = dict[str, np.ndarray]

#: Where pictures and files of benchmarks lie.
PLACE = Path("build/bench")


def modes(outputs: int, inputs: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return poles (rad/s at one sample a second), shapes and participation."""
    rng = np.random.default_rng(0)
    s = poles_from(np.sort(rng.uniform(0.02, 0.45, count)), rng.uniform(0.005, 0.03, count))
    return s, rng.standard_normal((outputs, count)), rng.standard_normal((count, inputs))


def noisy(values: np.ndarray, level: float = 0.01) -> np.ndarray:
    """Return values with noise 40 dB below their root mean square."""
    rng, size = np.random.default_rng(1), level * np.sqrt(np.mean(np.abs(values) ** 2))
    return values + size * rng.standard_normal(values.shape) * (1j if np.iscomplexobj(values) else 1)


def samples(outputs: int, inputs: int, rows: int, columns: int, order: int) -> Data:
    """Return impulse responses of order / 2 modes, and the sizes of the Hankel matrix."""
    s, C, B = modes(outputs, inputs, order // 2)
    decay = np.exp(np.arange(rows + columns)[:, None] * s)
    values = np.stack([2 * np.real((C * row) @ B) for row in decay])
    sizes = {"rows": rows, "columns": columns, "order": order}
    return {"values": noisy(values), **{name: np.array(size) for name, size in sizes.items()}}


def lines(outputs: int, inputs: int, count: int, order: int) -> Data:
    """Return frequency responses of order / 4 modes."""
    s, C, B = modes(outputs, inputs, max(order // 4, 1))
    f = np.linspace(0.02, 0.48, count)
    x = 2j * np.pi * f[:, None]
    H = (C * (-1j / (x - s) + 1j / (x - s.conj()))[:, None]) @ B
    return {"values": noisy(H), "frequencies": f, "order": np.array(order)}


def ambient(outputs: int, count: int, rows: int = 30, largest: int = 100) -> Data:
    """Return a record of ten modes under white forces."""
    rng, (s, C, _) = np.random.default_rng(2), modes(outputs, 1, 10)
    z = np.exp(s)
    y = sum(
        np.outer(lfilter([0, 1], [1, -2 * a.real, abs(a) ** 2], rng.standard_normal(count)), c)
        for a, c in zip(z, C.T, strict=True)
    )
    sizes = {"rows": rows, "largest": largest, "order": 20, "lags": 200}
    return {"outputs": noisy(np.asarray(y), 0.1), **{name: np.array(size) for name, size in sizes.items()}}
