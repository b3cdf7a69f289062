"""Probabilities of assignments, against all of them one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from modalscope.analysis.monitoring.likelihood import marginals
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


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (3, 3), (2, 4), (4, 2)])
def test_probabilities_are_those_of_all_assignments(size: tuple[int, int]) -> None:
    draw = np.random.default_rng(0)
    for _ in range(5):
        gain = draw.normal(2, 5, size)
        assert np.allclose(marginals(gain), enumerated(gain), atol=1e-9)


def test_pairs_that_cannot_be_are_left_out_and_change_nothing() -> None:
    gain = np.array([[9.0, -40.0, 1.0], [-np.inf, 8.0, -np.inf], [0.5, -100.0, 700.0]])
    assert np.allclose(marginals(gain), enumerated(np.minimum(gain, 600)), atol=1e-6)
