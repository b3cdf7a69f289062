"""What is done, on which data, by whom, and how equal the results must be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from modalscope.numerics.functions.poles import poles_from

__all__ = ["WORKS", "Data", "Work", "ambient", "lines", "samples"]

Data = dict[str, np.ndarray]

#: Poles of the same equation on the same numbers; and of a randomized range, which knows the bulk of the noise to a part of it.
SAME, RANDOM = 1e-8, 1e-6


@dataclass(frozen=True)
class Work:
    """One piece of work.

    Parameters
    ----------
    name : str
    data : callable
        Makes the arrays.
    peers : tuple of (program, function, our function, largest difference)
    left_out : str
        Who cannot do it, and why.
    """

    name: str
    data: Callable[[], Data]
    peers: tuple[tuple[str, str, str, float], ...]
    left_out: str = ""


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


def fractions(outputs: int = 50, count: int = 4000, degree: int = 60) -> Data:
    """Return responses of ten modes on lines of .5 Hz, noise 60 dB below, and the poles (rad/s)."""
    rng, f = np.random.default_rng(0), 0.5 * np.arange(1, count + 1)
    s = 2 * np.pi * f[-1] * np.linspace(0.05, 0.95, 10) * (-0.005 + 1j)
    shapes, w = rng.standard_normal((10, outputs)), 2j * np.pi * f[:, None]
    H = (1j / (w - s)) @ shapes + (-1j / (w - s.conj())) @ shapes
    noise = rng.standard_normal((2, *H.shape))
    H = H + 1e-3 * np.sqrt(np.mean(np.abs(H) ** 2) / 2) * (noise[0] + 1j * noise[1])
    return {"values": H[:, :, None], "frequencies": f, "degree": np.array(degree), "truth": s}


def driven() -> Data:
    """Return a record of ten modes, four outputs and two inputs under white forces, and the poles (of one sample)."""
    rng, n = np.random.default_rng(0), 4000
    f = 0.03 + 0.42 * (np.arange(10) + rng.uniform(0.2, 0.8, 10)) / 10
    s = poles_from(f, np.exp(rng.uniform(np.log(0.002), np.log(0.05), 10)))
    u, shapes = rng.standard_normal((n, 2)), rng.standard_normal((10, 4))
    y = sum(
        np.outer(lfilter([0, 1], [1, -2 * a.real, abs(a) ** 2], u @ rng.standard_normal(2)), c)
        for a, c in zip(np.exp(s), shapes, strict=True)
    )
    sizes = {"samples": np.array(100), "order": np.array(20)}
    return {"outputs": noisy(np.asarray(y)), "inputs": u, "truth": np.exp(s), **sizes}


def _era(*names: str) -> tuple[tuple[str, str, str, float], ...]:
    """Return who does ERA by the whole decomposition: pyMOR's equation is that of our `alternate`."""
    ours = {"pymor": "alternate"}
    return tuple((name, "era", ours.get(name, "era"), SAME) for name in names)


_TOO_LARGE = "python-control and pyyeti: their square left factor alone takes more memory than there is"

WORKS = (
    Work(
        "ERA 4 x 2, Hankel 800 x 400, order 20",
        lambda: samples(4, 2, 200, 200, 20),
        _era("control", "pymor", "modred", "pyyeti", "scipy"),
    ),
    Work(
        "ERA 30 x 3, Hankel 6000 x 600, order 40",
        lambda: samples(30, 3, 200, 200, 40),
        _era("control", "pymor", "modred", "pyyeti", "scipy"),
    ),
    Work(
        "ERA 100 x 3, Hankel 30 000 x 900, order 60",
        lambda: samples(100, 3, 300, 300, 60),
        _era("pymor", "modred", "scipy"),
        _TOO_LARGE,
    ),
    Work(
        "ERA 20 x 20, Hankel 4000 x 4000, order 60",
        lambda: samples(20, 20, 200, 200, 60),
        (("pymor", "era_randomized", "alternate", RANDOM),),
        "the others: minutes",
    ),
    Work("OKID and ERA, 4 x 2, 4000 samples, order 20", driven, (("modred", "markov", "markov", 1e-2),)),
    Work(
        "OKID and ERA, observers of given order, ours 30, theirs 100",
        driven,
        (("modred", "markov", "markov_of_order", 1e-2),),
    ),
    Work("LSCF 50 x 4000 lines, poles of every degree to 60", fractions, (("sdypy_EMA", "lscf", "lscf", 1e-4),)),
    Work(
        "LSCF, ours the whole diagram with shapes, 50 x 4000", fractions, (("sdypy_EMA", "lscf", "lscf_diagram", 1e-4),)
    ),
    Work(
        "LSCF, ours the whole diagram with shapes, 7 x 10 000 to degree 100",
        lambda: fractions(7, 10_000, 100),
        (("sdypy_EMA", "lscf", "lscf_diagram", 1e-4),),
    ),
    Work(
        "LSCF, ours the whole diagram with shapes, 200 x 4000",
        lambda: fractions(200),
        (("sdypy_EMA", "lscf", "lscf_diagram", 1e-4),),
    ),
    Work(
        "LSCF, ours the whole diagram with shapes, 7 x 1000 to degree 40",
        lambda: fractions(7, 1000, 40),
        (("sdypy_EMA", "lscf", "lscf_diagram", 2e-4),),
    ),
    Work(
        "SSI-cov 15 x 60 000, orders 1 to 100",
        lambda: ambient(15, 60_000),
        (("pyoma_2", "ssi_cov", "ssi_cov", 1e-2), ("pyoma_2", "ssi_cov_r", "ssi_cov", 1e-2)),
    ),
    Work(
        "SSI-data 15 x 60 000, orders 1 to 100",
        lambda: ambient(15, 60_000),
        (("pyoma_2", "ssi_data", "ssi_data", 1e-2),),
    ),
)
