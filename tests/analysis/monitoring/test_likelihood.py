"""Probabilities of assignments, against all of them one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from modalscope.analysis.monitoring.likelihood import chance
from modalscope.numerics.checks import RealArray


def enumerated(gain: RealArray) -> RealArray:
    found, total = np.zeros(gain.shape), 0.0
    for choice in product(range(-1, gain.shape[1]), repeat=len(gain)):
        taken = [(i, j) for i, j in enumerate(choice) if j >= 0]
        if len({j for _, j in taken}) == len(taken):
            weight = np.exp(sum(gain[pair] for pair in taken))
            total += weight
            for pair in taken:
                found[pair] += weight
    return found / total


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (2, 3), (3, 3)])
def test_probabilities_are_near_those_of_all_assignments(size: tuple[int, int]) -> None:
    """They are the same where two assignments alone have a say; others have little."""
    draw = np.random.default_rng(0)
    away = []
    for _ in range(40):
        gain = draw.normal(6, 4, size)
        found = np.array([[chance(gain, i, j) for j in range(size[1])] for i in range(size[0])])
        away.append(np.abs(found - enumerated(gain)).max())
    assert np.median(away) < 0.03
    assert max(away) < (0.001 if size == (1, 1) else 0.25)


def test_a_pair_that_cannot_be_is_none() -> None:
    gain = np.array([[9.0, -40.0, 1.0], [-np.inf, 8.0, -np.inf], [0.5, -100.0, 700.0]])
    assert chance(gain, 0, 0) > 0.999
    assert chance(gain, 2, 2) == 1
    assert chance(gain, 0, 1) < 1e-9
