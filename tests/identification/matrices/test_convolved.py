"""Gradients that are convolutions: what noise makes of them by correlations is what it makes of them by transforms."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.identification.matrices import influence as convolved_module
from modalscope.identification.matrices.influence import ConvolvedInfluence, SampleInfluence, convolved
from tests.support import relative


def gradient(rows: int, columns: int, seed: int) -> ConvolvedInfluence:
    rng = np.random.default_rng(seed)
    sizes = ((5, rows, 3), (5, columns, 2))
    return convolved(*(rng.standard_normal(size) + 1j * rng.standard_normal(size) for size in sizes))


@pytest.mark.parametrize(("rows", "columns"), [(1, 40), (6, 40), (40, 6), (17, 17)])
def test_moments_are_those_of_the_samples(rows: int, columns: int) -> None:
    one, other = gradient(rows, columns, 0), gradient(rows + 3, columns + 8, 1)
    both = one.joined(gradient(rows, columns, 2))
    variance = np.random.default_rng(3).uniform(1, 2, (3, 2))
    for mine, its in ((one, one), (one, other), (other, one), (both, both), (both.take(np.arange(5)), other)):
        found = mine.joint(its, variance)
        g, h = (np.stack([part.gradient(j) for j in range(5)]) for part in (mine, its))
        seen = min(g.shape[1], h.shape[1])
        assert relative(found.size, np.einsum("ktoi,ktoi,oi->k", g[:, :seen], h[:, :seen].conj(), variance)) < 1e-12
        assert relative(found.square, np.einsum("ktoi,ktoi,oi->k", g[:, :seen], h[:, :seen], variance)) < 1e-12


def test_many_rows_of_few_blocks_meet_at_few_lags_and_few_over_all_samples() -> None:
    rng = np.random.default_rng(0)
    for outputs, at_lags in ((3, False), (60, True)):
        sizes = ((5, 20, outputs), (5, 30, 1))
        one = convolved(*(rng.standard_normal(size) + 1j * rng.standard_normal(size) for size in sizes))
        assert (convolved_module._lengths(one.parts)[0] is not None) == at_lags
        variance = rng.uniform(1, 2, (outputs, 1))
        found, g = one.joint(one, variance), np.stack([one.gradient(j) for j in range(5)])
        assert relative(found.size, np.einsum("ktoi,oi->k", np.abs(g) ** 2, variance)) < 1e-12
        assert relative(found.square, np.einsum("ktoi,oi->k", g**2, variance)) < 1e-12


def test_every_pole_may_have_its_own_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    one, variance = gradient(6, 40, 0), np.random.default_rng(3).uniform(1, 2, (5, 1, 3, 2))
    monkeypatch.setattr(convolved_module, "_BLOCK_NUMBERS", 200)  # two poles at a time
    found = one.joint(one, variance)
    for j in range(5):
        alone = one.take(np.array([j]))
        expected = alone.joint(alone, variance[j, 0])
        assert relative(found.size[j], expected.size[0]) < 1e-12
        assert relative(found.square[j], expected.square[0]) < 1e-12


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
    monkeypatch.setattr(convolved_module, "_BLOCK_NUMBERS", 400)
    assert all(np.allclose(*both, rtol=1e-13, atol=0) for both in zip(one.joint(one, variance), whole, strict=True))
    nothing = one.take(np.arange(0))
    assert nothing.joint(nothing, variance).size.shape == (0,)
