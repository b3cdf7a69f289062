"""Hits that are cut off, over many random structures: what averages and what decays give of their modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.statistics import assign
from modalscope.signals.preprocess.after_hits import MAX_REMAINING, remaining
from modalscope.signals.preprocess.excitation import excitation_of
from tests.studies import Study

SEEDS = range(1000, 1100)

#: What is left at the end, parts of the largest vibration.
PARTS = ((0.0, MAX_REMAINING), (MAX_REMAINING, 0.15), (0.15, 1.0))


class Struck(NamedTuple):
    """A hammer test of a structure whose poles are known, and the part of its vibration that is left at three of four outputs."""

    record: ms.Signals
    poles: np.ndarray
    left: float


def struck(seed: int) -> Struck:
    """Return three to five hits, apart or in one record, whose decays are cut at .06 to .4 of what they need; noise on all sensors.

    Half sines drive 4 to 8 modes of .3 to 3 % that the rate of 3.07 times the highest frequency holds.
    """
    rng = np.random.default_rng([seed, 17])
    count, outputs, hits = int(rng.integers(4, 9)), int(rng.integers(3, 9)), int(rng.integers(3, 6))
    while True:
        frequencies = np.sort(np.exp(rng.uniform(np.log(10), np.log(10 * rng.uniform(3, 8)), count)))
        if np.min(np.diff(frequencies) / frequencies[:-1]) > 0.03:
            break
    damping = np.exp(rng.uniform(np.log(0.003), np.log(0.03), count))
    poles, rate = poles_from(frequencies, damping), 3.07 * frequencies.max()
    shapes = rng.standard_normal((outputs, count)) * np.exp(0.5 * rng.standard_normal(count))
    driven = rng.choice([-1, 1], count) * rng.uniform(0.3, 1.5, count) * np.abs(shapes).mean(axis=0)
    whole = min(max(2.4 / (damping * frequencies).min() / np.pi, 40 / frequencies.min()), 4096 / rate)
    length, apart = max(int(whole * rng.uniform(0.06, 0.4) * rate), 40), bool(rng.random() < 0.7)
    u = np.zeros((hits, length))
    u[:, 8:11] = np.sin(np.pi * np.arange(1, 4) / 4) * rng.uniform(0.5, 1.5, (hits, 1))
    u = u if apart else u.reshape(1, -1)
    decays = np.exp(poles / rate * np.arange(u.shape[1])[:, None]) * poles**2 * driven / (2j * poles.imag)
    h = 2 * np.real(decays @ shapes.T)
    y = np.stack([np.stack([np.convolve(force, each)[: len(force)] for each in h.T], axis=1) for force in u])
    y += rng.choice([0.0005, 0.002, 0.02]) * 3 * y.std(axis=(0, 1)) * rng.standard_normal(y.shape)
    u = u + rng.choice([1e-5, 1e-3, 1e-2]) * u.max() * rng.standard_normal(u.shape)
    record = ms.Signals(outputs=y, inputs=u[:, :, None], sampling_rate=rate, quantities=("acceleration",) * outputs)
    return Struck(record, poles, float(np.quantile(remaining(record, "impact")[0], 0.25)))


def judged(poles: np.ndarray, modes: Any) -> tuple[list[tuple[float, bool, bool]], int]:
    """Return the damping error of every mode that is found, and whether both intervals hold; and how many others there are."""
    distance = np.abs(poles[:, None] - modes.poles) / np.maximum(-poles.real, 0.003 * np.abs(poles))[:, None]
    pairs = [(i, j) for i, j in zip(*assign(np.minimum(distance, 100.0)), strict=True) if distance[i, j] < 1]
    true = {"frequency": np.abs(poles) / 2 / np.pi, "damping_ratio": -poles.real / np.abs(poles)}
    found = []
    for i, j in pairs:
        holds = [
            bool(low <= true[kind][i] <= high) for kind, (low, high) in ((k, modes.interval()[k][j]) for k in true)
        ]
        found.append((abs(modes.damping_ratios[j] / true["damping_ratio"][i] - 1), *holds))
    return found, len(modes) - len(pairs)


@pytest.fixture(scope="module")
def cases() -> list[Struck]:
    every = [struck(seed) for seed in SEEDS]
    return [case for case in every if excitation_of((case.record,)) == "impact"]  # not all of 40 samples look like hits


@pytest.mark.study("inputs")
@pytest.mark.parametrize("route", ["frf", "decays"])
@pytest.mark.parametrize("part", PARTS)
def test_modes_of_hits_that_are_cut_off(
    part: tuple[float, float], route: str, cases: list[Struck], study: Callable[[str, str], Study]
) -> None:
    some = [case for case in cases if part[0] < case.left <= part[1]]
    judgements = [judged(case.poles, ms.analyze(case.record, route=route).modes) for case in some]
    found = np.array([mode for modes, _ in judgements for mode in modes])
    true, asked = sum(len(case.poles) for case in some), route == "decays" and part[0] > 0
    data = f"hits, {100 * part[0]:.0f} to {100 * part[1]:.0f} % of the vibration left at their ends, route {route}"
    table = study(data, f"{len(some)} random structures of seeds {SEEDS[0]} to {SEEDS[-1]}")
    table.row(f"modes found of {true}", 100 * len(found) / true, least=95 if asked else None, unit=" %")
    table.row("false modes", sum(false for _, false in judgements), most=3 if asked else None)
    table.row("damping, median error", 100 * np.median(found[:, 0]), unit=" %")
    table.row("damping, mean error", 100 * np.mean(found[:, 0]), most=6 if asked else None, unit=" %")
    table.row(
        "95 % intervals of frequency that hold", 100 * np.mean(found[:, 1]), least=90 if asked else None, unit=" %"
    )
    table.row("95 % intervals of damping that hold", 100 * np.mean(found[:, 2]), least=90 if asked else None, unit=" %")
    assert not table.missed
