"""Exactly repeated poles, whose mean is held against the bound of a pair that is free to be any block; starts with a false mode."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.functions.poles import frequencies_and_damping
from tests.selection.judging.bound import compressed_bound
from tests.selection.judging.test_refine import clean_data, start
from tests.studies import Study
from tests.support import add_noise

#: ring5: a single mode and two pairs.
PAIRS = [[0], [1, 2], [3, 4]]


def means_over_the_bound(kind: str, snr_db: float, seeds: range) -> np.ndarray:
    """Return errors of f and zeta of the mean poles over their bounds, (seeds, 2, 3)."""
    clean = clean_data("ring5", kind)
    exact = ms.identify(clean, order=10).modes
    deviation = 10 ** (-snr_db / 20) * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0) / (1 + (kind == "lines")))
    least = compressed_bound(clean, exact, deviation, PAIRS)
    errors = []
    for seed in seeds:
        data = add_noise(clean, snr_db, seed)
        noisy = snr_db < 40
        found = ms.refine(data, start(data, 10, 4 * noisy), complete=noisy)
        assert len(found) == 5
        assert found.converged
        apart = _of_means(found.poles[np.argsort(found.frequencies)]) - _of_means(exact.poles)
        errors.append(apart / least)
    return np.array(errors)


def _of_means(poles: np.ndarray) -> np.ndarray:
    return np.array(frequencies_and_damping(np.array([poles[pair].mean() for pair in PAIRS])))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["samples", "lines"])
def test_means_of_pairs_are_no_further_off_than_the_bound(kind: str) -> None:
    errors = means_over_the_bound(kind, 40, range(100, 112))
    # twelve seeds of six figures, nearly independent: 1.3 is five deviations of their root mean square
    assert np.sqrt(np.mean(errors**2)) < 1.3


@pytest.mark.parametrize("seed", range(3))
def test_a_false_mode_of_the_list_does_not_keep_a_true_one_out(seed: int) -> None:
    # the start holds 2.2 Hz, where there is nothing but noise, in place of the fifth mode
    clean = clean_data("chain5", "samples")
    true = start(clean, 10)
    false = np.where(np.arange(5) < 4, true.poles, 2 * np.pi * 2.2 * (1j - 0.02))
    found = ms.refine(add_noise(clean, 20, seed), replace(true, poles=false), complete=True)
    assert len(found) == 5
    assert found.frequencies[-1] == pytest.approx(true.frequencies[-1], rel=0.01)
    assert found.left_out[0].frequency == pytest.approx(2.2, abs=0.01)


@pytest.mark.study("refinement")
@pytest.mark.parametrize("snr_db", [40, 20])
@pytest.mark.parametrize("kind", ["samples", "lines"])
def test_means_of_pairs_reach_the_bound_over_two_hundred_seeds(
    kind: str, snr_db: float, study: Callable[[str, str], Study]
) -> None:
    """200 seeds tell a ratio to 5 %."""
    errors = means_over_the_bound(kind, snr_db, range(200))
    f, zeta = np.sqrt(np.mean(errors**2, axis=0))
    table = study(f"ring5, means of its pairs, {kind}, {snr_db} dB", "200 seeds, 0 to 199")
    table.row("error over the bound, f", f, most=1.2, form=".2f")
    table.row("error over the bound, zeta", zeta, most=1.2, form=".2f")
    table.row("largest single error over the bound", np.abs(errors).max(), most=6, form=".1f")
    assert not table.missed
