"""Draw what a measurement file is of: a small structure, and its record, its frequency responses or a spectrum of one signal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

#: Contents, and how often each is drawn. Public repositories hold records of hammer tests and of loggers most of all.
CONTENTS = {
    "hammer": 5, "shaker": 2, "ambient": 5, "decay": 3, "parts": 4, "polar degrees": 2, "polar radians": 1, "decibels": 2, "complex": 1,
    "spectrum": 1,
}  # fmt: skip
RECORDS = ("hammer", "shaker", "ambient", "decay")
RATES = (50.0, 100.0, 128.0, 200.0, 256.0, 500.0, 1000.0, 1024.0, 2000.0, 2048.0, 5000.0, 10000.0, 12800.0, 51200.0)


@dataclass
class Truth:
    """What was measured.

    `axis` (N,): s or Hz. `outputs` (N, l), of responses complex (the input is one). `inputs` (N, m), None without forces. `rate`: Hz,
    None of lines. `coherence` (N, l), where it was written. `names`, `units`: of the outputs, then of the inputs, as they were written;
    empty where they were not. `motion`: of time, of nodes with clocks of their own.
    """

    content: str
    axis: np.ndarray
    outputs: np.ndarray
    inputs: np.ndarray | None = None
    rate: float | None = None
    coherence: np.ndarray | None = None
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    motion: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def of_lines(self) -> bool:
        """Whether it is over frequency."""
        return self.content not in RECORDS


def draw_truth(rng: np.random.Generator, content: str) -> Truth:
    """Return a structure's record or response of a content."""
    outputs, rate = int(rng.integers(1, 6)), float(rng.choice(RATES))
    if content in RECORDS:
        return draw_record(rng, content, outputs, rate)
    lines, step = int(rng.integers(180, 400)), float(rng.choice([0.25, 0.5, 1.0, 1.25, 2.0, 3.125]))
    first = step * float(rng.choice([0, 0, 1, 8, 40]))
    frequencies = first + step * np.arange(lines)
    shown = int(rng.integers(1, 4))
    response = _response(rng, frequencies, frequencies[-1], shown) * 10 ** rng.uniform(-2, 1)
    scale = np.sqrt(np.mean(np.abs(response) ** 2))
    response += 0.003 * scale * (rng.standard_normal(response.shape) + 1j * rng.standard_normal(response.shape))
    return Truth(content, frequencies, response)


def structure(rng: np.random.Generator, places: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frequencies relative to the highest, damping ratios and shapes (places, modes) of three modes."""
    shapes = rng.uniform(0.3, 1, (places, 3)) * rng.choice([-1, 1], (places, 3))
    return np.sort(rng.uniform(0.08, 0.8, 3)), rng.uniform(0.01, 0.03, 3), shapes


def accelerances(frequencies: np.ndarray, highest: float, of: tuple[np.ndarray, ...], place: int) -> np.ndarray:
    """Return the accelerances (N, l) of a structure at all places to a force at one."""
    modes, zeta, shapes = of
    f = frequencies[:, None]
    ratios = (f / (highest * modes)) ** 2 / (1 - (f / (highest * modes)) ** 2 + 2j * zeta * f / (highest * modes))
    return np.asarray(-ratios @ (shapes * shapes[place]).T)


def _response(rng: np.random.Generator, frequencies: np.ndarray, highest: float, outputs: int) -> np.ndarray:
    """Return accelerances (N, l) of three modes below the highest frequency."""
    modes = highest * np.sort(rng.uniform(0.08, 0.8, 3))
    residues = rng.uniform(0.3, 1, (3, outputs)) * rng.choice([-1, 1], (3, outputs))
    zeta = rng.uniform(0.01, 0.03, 3)
    f = frequencies[:, None]
    ratios = ((f / modes) ** 2 / (1 - (f / modes) ** 2 + 2j * zeta * f / modes)) @ residues
    return np.asarray(-ratios)


def draw_record(
    rng: np.random.Generator,
    content: str,
    outputs: int,
    rate: float,
    responses: Callable[[np.ndarray, float], np.ndarray] | None = None,
) -> Truth:
    """Return a record; `responses`: of the structure, a function of lines and the highest frequency, where it is known."""
    rows = int(rng.integers(260, 520))
    padded = 4 * rows
    if content == "hammer":
        force = np.zeros((padded, 1))
        pulse, width = int(rng.integers(12, 40)), int(rng.integers(4, 8))
        force[rows + pulse : rows + pulse + width, 0] = np.sin(np.pi * np.arange(width) / width)
    else:
        force = rng.standard_normal((padded, 1))
        if content == "decay":
            force[rows:] = 0.0
    lines = np.fft.rfftfreq(padded, 1 / rate)
    response = responses(lines, rate / 2.5) if responses is not None else _response(rng, lines, rate / 2.5, outputs)
    motion = np.fft.irfft(np.fft.rfft(force, axis=0) * response, padded, axis=0)[rows : 2 * rows]
    if responses is None:
        motion *= 10 ** rng.uniform(-0.5, 1) / np.abs(motion).max()
    motion += 0.003 * np.sqrt(np.mean(motion**2)) * rng.standard_normal(motion.shape)
    inputs = None
    if content in ("hammer", "shaker"):
        inputs = force[rows : 2 * rows] * (10 ** rng.uniform(0, 2) if responses is None else 1.0)
        inputs = inputs + 1e-3 * np.abs(inputs).max() * rng.standard_normal(inputs.shape)
    return Truth(content, np.arange(rows) / rate, motion, inputs, rate)
