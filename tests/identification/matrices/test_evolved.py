"""Factors beside modes, compared in pieces: the same as the definitions on whole arrays."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data.indicators import amplitude_coherence, decay_step, emac_channels, weighted_mean
from modalscope.identification.matrices import evolved
from modalscope.identification.matrices.evolved import Evolved, OnLines
from modalscope.identification.modal.accuracy import followed


@pytest.fixture(autouse=True)
def in_small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evolved, "_MAX_VALUES", 37)


def noisy(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_blocks_in_pieces_give_what_whole_arrays_do() -> None:
    rng = np.random.default_rng(0)
    blocks = rng.standard_normal((20, 3, 6))
    states, first, z = noisy(rng, 6, 4), noisy(rng, 3, 4), 0.9 * np.exp(1j * rng.uniform(0, 3, 4))
    side = Evolved(blocks, states, first, z ** np.arange(20)[:, None])
    identified = blocks @ states
    step = decay_step(side.evolution)
    at = identified[step, :, np.arange(4)].T
    emac = weighted_mean(emac_channels(at, first * side.evolution[step, np.arange(4)]), first)
    coherence = amplitude_coherence(identified, first, side.evolution)
    np.testing.assert_allclose(followed(side), (coherence, emac), rtol=1e-12)


def test_lines_in_pieces_give_what_both_signs_of_all_lines_do() -> None:
    rng = np.random.default_rng(1)
    factor, states = rng.standard_normal((2, 50, 6)), noisy(rng, 6, 4)
    functions, participation = noisy(rng, 2, 4, 25), noisy(rng, 2, 4)
    seen = np.array([True, True, False, True])

    real, imaginary = np.split(factor @ states, 2, axis=1)
    found = np.stack([real + 1j * imaginary, real - 1j * imaginary], axis=1).reshape(-1, 4)
    expected = (functions.transpose(0, 2, 1) * participation[:, None, None]).reshape(-1, 4)
    coherence = amplitude_coherence(found[None], expected, np.ones((1, 4)))
    emac = weighted_mean(emac_channels(found, expected), expected)
    ours = followed(OnLines(factor.transpose(0, 2, 1), states, functions, participation, seen))
    np.testing.assert_allclose([v[seen] for v in ours], [coherence[seen], emac[seen]], rtol=1e-12)
    assert all(np.isnan(v[2]) for v in ours)


def test_the_agreement_of_amplitudes_is_the_published_product() -> None:
    rng = np.random.default_rng(2)
    a, e = noisy(rng, 30, 3), noisy(rng, 30, 3)
    smaller, larger = np.minimum(abs(a), abs(e)), np.maximum(abs(a), abs(e))
    phase = np.clip(1 - 4 * np.abs(np.angle(a / e)) / np.pi, 0, None)
    np.testing.assert_allclose(emac_channels(a, e), smaller / larger * phase, rtol=1e-12, atol=1e-14)
    assert not emac_channels(a * 0, e).any()
