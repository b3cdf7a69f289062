"""Lists of ambient records with nothing set: two known structures, a measured building, and noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5, iasc_asce
from tests.studies import Study
from tests.support import measured

ROWS = ("alternate", "era", "ssi-data")
LABELS = (
    "shear building of 12 modes, 12 x 120 s at 250 Hz, 20 dB",
    "chain5, 4 x 2000 s at 20 Hz, 40 dB",
    "timber building, measured, 6 x 5400 s at 20 Hz",
    "white noise, 1 to 5 x 20 000",
)
SEEDS = 40


def counts(truth: ms.ModalModel, found: ms.ModalModel) -> tuple[int, int]:
    """Return how many true modes are found, each by one of its own within 1 % or two half bandwidths, and how many others there are."""
    free = list(found.frequencies)
    for f, zeta in zip(truth.frequencies, truth.damping_ratios, strict=True):
        near = [g for g in free if abs(g - f) < max(0.01, 2 * zeta) * f]
        if near:
            free.remove(min(near, key=lambda g: abs(g - f)))
    return len(found) - len(free), len(free)


def simulated(label: str, seed: int) -> tuple[ms.ModalModel, ms.Signals]:
    """Return the true modes and a record of the first or the second label."""
    if label == LABELS[0]:
        structure = iasc_asce()
        return structure.modes(), structure.simulate(
            inputs="ambient", duration=120, sampling_rate=250, noise=0.1, seed=seed
        )
    return chain5().modes(), chain5().simulate(inputs="ambient", duration=2000, sampling_rate=20, noise=0.01, seed=seed)


def of_noise(seed: int) -> ms.Signals:
    """Return a record of nothing but noise."""
    y = np.random.default_rng(500 + seed).standard_normal((20_000, 1 + seed % 5))
    return ms.Signals(outputs=y, sampling_rate=100.0)


# ---------------------------------------------------------------------------------------------------------- short form


@pytest.mark.slow
@pytest.mark.parametrize("label", LABELS[:2])
def test_all_modes_of_a_known_structure_and_no_others(label: str) -> None:
    truth, record = simulated(label, 1000)
    assert counts(truth, ms.analyze(record).modes) == (len(truth), 0)


def test_noise_has_no_modes() -> None:
    assert not len(ms.analyze(of_noise(1000)).modes)


# ---------------------------------------------------------------------------------------------------------------- study


@pytest.mark.study("ambient")
@pytest.mark.parametrize("label", LABELS[:2])
def test_study_of_known_structures(label: str, study: Callable[[str, str], Study]) -> None:
    """Of 40 records 95 % are 38."""
    cases = [simulated(label, seed) for seed in range(SEEDS)]
    found = np.array([counts(truth, ms.analyze(record).modes) for truth, record in cases])
    total = len(cases[0][0])
    table = study(label, f"{SEEDS} records, seeds 0 to {SEEDS - 1}")
    whole = int(np.sum(found[:, 0] == total))
    table.row(f"records with all {total} modes", whole, least=round(0.95 * SEEDS))
    table.row("other modes", int(found[:, 1].sum()))
    assert not table.missed


@pytest.mark.study("ambient")
def test_study_of_a_measured_building(study: Callable[[str, str], Study]) -> None:
    """Published by stochastic subspace identification of the same record."""
    published = np.array([1.88202, 2.42170, 2.68704])
    record = ms.read(measured("palisaden", "palisaden_dec5.npz"), rename={"y": "outputs", "fs": "sampling_rate"})
    found = [ms.analyze(record, method=row).modes.frequencies for row in ROWS]
    three = [int(np.sum(np.min(np.abs(f[:, None] / published - 1), axis=0) < 0.003)) for f in found]
    table = study(LABELS[2], "1 record, palisaden_dec5")
    for row, f, count in zip(ROWS, found, three, strict=True):
        table.row(f"published modes found within 0.3 %, of 3, {row}", count, least=3)
        table.row(f"other modes, {row}", len(f) - count)
    assert not table.missed


@pytest.mark.study("ambient")
def test_at_most_one_record_of_noise_in_forty_has_a_mode(study: Callable[[str, str], Study]) -> None:
    false = [len(ms.analyze(of_noise(seed)).modes) for seed in range(SEEDS)]
    table = study(LABELS[3], f"{SEEDS} records, seeds 500 to {499 + SEEDS}")
    table.row("modes in all records together", sum(false), most=1)
    assert not table.missed
