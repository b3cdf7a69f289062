"""Random structures whose slowest mode lives for a chosen part of the record, and how far each row's poles are off, over the bound."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import modalscope as ms
from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.identification.method import Method, Takes
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.numerics.statistics import assign
from tests.selection.judging.bound import compressed_bound
from tests.support import add_noise

Data = FrequencyResponse | ImpulseResponse

#: Noise of every channel, dB.
DECIBEL = 40.0

#: The life 1 / (zeta w) of the slowest mode over the length of the record.
LIVES = (0.05, 1.0)

KINDS = ("impulse responses", "free decays", "frequency responses")


class Case(NamedTuple):
    """Noise-free data, the modes in them, and the least deviations of f (Hz) and zeta of every mode, (2, n)."""

    clean: Data
    modes: ModalModel
    least: np.ndarray

    @property
    def order(self) -> int:
        """The true number of states."""
        return 2 * len(self.modes)

    @property
    def slowest(self) -> int:
        """Which mode lives longest."""
        return int(np.argmin(-self.modes.poles.real))


def random_case(kind: str, samples: int, seed: int) -> Case:
    """Return 2 to 6 modes of 2 to 6 outputs and 1 to 3 inputs (free decays: one) at a rate of 1 Hz.

    Decay rates lie within a factor of four; neighbours are two half bandwidths and two lines (1 / T) apart or more. Frequency responses
    have half as many lines as there are samples, up to half the rate, of a continuous structure (displacement).
    """
    rng = np.random.default_rng([seed, samples, KINDS.index(kind)])
    n, l = int(rng.integers(2, 7)), int(rng.integers(2, 7))
    m = 1 if kind == "free decays" else int(rng.integers(1, 4))
    while True:
        life = np.exp(rng.uniform(*np.log(LIVES))) * samples
        decay = np.concatenate([[1.0], np.exp(rng.uniform(0, np.log(4), n - 1))]) / life
        f = np.exp(rng.uniform(np.log(max(4 / samples, 3 / life)), np.log(0.4), n))
        near = np.abs(f[:, None] - f) + np.eye(n)
        width = np.maximum(decay[:, None], decay) / (2 * np.pi)
        if np.all(decay < 0.1 * 2 * np.pi * f) and np.all(near > 2 * (width + 1 / samples)):
            break
    modes = ModalModel(
        poles=poles_from(f, decay / (2 * np.pi * f)),
        shapes=_visible(rng, (l, n)),
        participation=_visible(rng, (n, m)),
        quantity="displacement",
    )
    if kind == "frequency responses":
        clean: Data = modes.frequency_response(np.arange(1, samples // 2 + 1) / samples)
        rows = 2.0
    else:
        clean, rows = modes.impulse_response(samples, 1.0), 1.0
    deviation = 10 ** (-DECIBEL / 20) * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0) / rows)
    return Case(clean, modes, compressed_bound(clean, modes, deviation))


def _visible(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    return rng.uniform(0.5, 2, shape) * np.exp(2j * np.pi * rng.uniform(size=shape))


def noisy(case: Case, seed: int) -> Data:
    """Return the data with white noise on every channel."""
    return add_noise(case.clean, DECIBEL, seed)


def errors(case: Case, poles: np.ndarray) -> np.ndarray:
    """Return errors of f and zeta over the bound, (2, n); infinite for a mode without a pole within its own decay rate or a line of it."""
    truth = case.modes.poles
    found = np.full((2, truth.size), np.inf)
    if poles.size == 0:
        return found
    distance = np.abs(poles - truth[:, None])
    mine, others = assign(distance)
    near = distance[mine, others] < np.maximum(-truth.real, 2 * np.pi / case.clean.values.shape[0])[mine]
    mine, others = mine[near], others[near]
    apart = np.array(frequencies_and_damping(poles[others])) - np.array(frequencies_and_damping(truth[mine]))
    found[:, mine] = apart / case.least[:, mine]
    return found


#: The domains that a kind of data has without a transform, and what the rows must take.
_DOMAINS = {kind: ("z", "s") if kind == "frequency responses" else ("time", "z") for kind in KINDS}
_TAKEN = (Takes.SAMPLES, Takes.LINES, Takes.RESPONSE, Takes.CONTINUOUS)


def rows_of(kind: str) -> list[Method]:
    """Return the rows of the table that take a kind of response."""
    return [row for row in ms.methods() if row.takes in _TAKEN and row.domain in _DOMAINS[kind]]


def order_of(row: Method, case: Case) -> int:
    """Return the true number of states; of rows without truncation what they need: a degree of 30, or twice the states in whole blocks."""
    if row.name == "lscf":
        return 30
    inputs = case.clean.values.shape[2]
    return -(-2 * case.order // inputs) * inputs if row.name == "prce" else case.order


def identified(row: Method, case: Case, seed: int, **sizes: int) -> np.ndarray:
    """Return the errors of one row at the true order with default blocks, or those given, over the bound, (2, n)."""
    found = ms.identify(
        noisy(case, seed), method=row.name, domain=row.domain, order=order_of(row, case), deviations=False, **sizes
    )
    return errors(case, found.poles)


def selected(case: Case, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the slowest mode, (2,), as it is selected from a diagram and as it is refined."""
    data = noisy(case, seed)
    modes = ms.select(ms.stabilize(data, deviations=False))
    return errors(case, modes.poles)[:, case.slowest], errors(case, ms.refine(data, modes).poles)[:, case.slowest]
