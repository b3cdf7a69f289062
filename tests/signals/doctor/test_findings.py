"""Channels that never change; and those that are multiples of each other: in the order of one projection, and by comparing all pairs."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from modalscope.signals.doctor.findings import dead_channels, identical_channels


def _by_all_pairs(x: np.ndarray) -> set[str]:
    """Return the channels that are a multiple of an earlier one."""
    y = x - x.mean(axis=0)
    u = y / np.linalg.norm(y, axis=0)
    pairs = combinations(range(x.shape[1]), 2)
    return {f"c{j}" for i, j in pairs if np.linalg.norm(u[:, j] - (u[:, i] @ u[:, j]) * u[:, i]) < 1e-6}


@pytest.mark.parametrize("seed", range(20))
def test_multiples_are_those_that_all_pairs_show(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = rng.standard_normal((3, 40))
    x = rng.standard_normal((200, 3)) @ shapes  # three motions: many channels are much alike
    for j in rng.choice(40, 12, replace=False):
        x[:, j] = rng.choice([-2.0, 0.5, 1.0]) * x[:, rng.integers(40)]
    near = rng.choice(40, 6, replace=False)
    x[:, near] += 10.0 ** rng.uniform(-9, -3, 6) * rng.standard_normal((200, 6))
    found = identical_channels(x, [f"c{j}" for j in range(40)])
    assert {finding.channels[1] for finding in found} == _by_all_pairs(x)


def test_of_three_copies_two_are_named_beside_the_first() -> None:
    x = np.random.default_rng(0).standard_normal((50, 4))
    x[:, 3], x[:, 1] = 2 * x[:, 0], -x[:, 0]
    assert [f.channels for f in identical_channels(x, "abcd")] == [("a", "b"), ("a", "d")]
    assert "d is 2 times a" in identical_channels(x, "abcd")[1].reason


def test_dead_is_what_never_changes_but_for_rounding_and_not_what_others_exceed():
    rng = np.random.default_rng(0)
    moving = rng.standard_normal(1000)
    one = np.full(1000, 0.1)
    last_bit = one * (1 + np.finfo(float).eps * (rng.random(1000) < 0.5))
    columns = np.column_stack([moving, 1e-15 * moving, 0 * moving, one, last_bit, 1 + 1e-12 * moving])
    assert [finding.channels for finding in dead_channels(columns, list("abcdef"))] == [("c",), ("d",), ("e",)]
