"""Gradients that are convolutions: what noise makes of them by correlations is what it makes of them by transforms."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.blocks import convolved as convolved_module
from modalscope.blocks.convolved import ConvolvedInfluence, convolved
from modalscope.blocks.influence import SampleInfluence
from tests.support import relative


def gradient(rows: int, columns: int, seed: int) -> ConvolvedInfluence:
    rng = np.random.default_rng(seed)
    sizes = ((5, rows, 3), (5, columns, 2))
    return convolved(*(rng.standard_normal(size) + 1j * rng.standard_normal(size) for size in sizes))


@pytest.mark.parametrize("whole", [True, False], ids=["whole", "by lags"])
@pytest.mark.parametrize(("rows", "columns"), [(1, 40), (6, 40), (40, 6), (17, 17)])
def test_moments_are_those_of_the_samples(
    rows: int, columns: int, whole: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(convolved_module, "_as_one", lambda *_: whole)
    one, other = gradient(rows, columns, 0), gradient(rows + 3, columns + 8, 1)
    both = one.joined(gradient(rows, columns, 2))
    variance = np.random.default_rng(3).uniform(1, 2, (3, 2))
    for mine, its in ((one, one), (one, other), (other, one), (both, both), (both.take(np.arange(5)), other)):
        found = mine.joint(its, variance)
        g, h = (np.stack([part.gradient(j) for j in range(5)]) for part in (mine, its))
        seen = min(g.shape[1], h.shape[1])
        assert relative(found.size, np.einsum("ktoi,ktoi,oi->k", g[:, :seen], h[:, :seen].conj(), variance)) < 1e-12
        assert relative(found.square, np.einsum("ktoi,ktoi,oi->k", g[:, :seen], h[:, :seen], variance)) < 1e-12


def test_transposed_and_by_transforms() -> None:
    one, variance = gradient(6, 40, 0), np.random.default_rng(3).uniform(1, 2, (3, 2))
    found = one.joint(one, variance)
    turned = one.transposed()
    for same in (turned.joint(turned, variance.T), SampleInfluence(one.terms).joint(one, variance)):
        assert relative(same.size, found.size) < 1e-12
        assert relative(same.square, found.square) < 1e-12


def test_poles_some_at_a_time_have_the_moments_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    one, variance = gradient(6, 40, 0), np.random.default_rng(3).uniform(1, 2, (3, 2))
    whole = one.joint(one, variance)
    monkeypatch.setattr(convolved_module, "_AT_A_TIME", 400)
    assert all(np.allclose(*both, rtol=1e-13, atol=0) for both in zip(one.joint(one, variance), whole, strict=True))
    nothing = one.take(np.arange(0))
    assert nothing.joint(nothing, variance).size.shape == (0,)


def test_few_block_rows_of_many_outputs_go_by_lags_and_long_ones_as_a_whole() -> None:
    assert convolved_module._as_one(1500, 7500, np.ones((7, 6)))
    assert not convolved_module._as_one(300, 600, np.ones((30, 3)))
