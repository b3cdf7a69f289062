"""Factors beside modes, compared in pieces: the same as the definitions on whole arrays."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data.indicators import agreement, decay_step
from modalscope.identification.matrices import evolved
from modalscope.identification.matrices.evolved import Evolved, OnLines
from modalscope.identification.modal.accuracy import followed


@pytest.fixture(autouse=True)
def in_small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evolved, "_MAX_VALUES", 37)


def noisy(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def amplitude_coherence(identified: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return |<q, e>| / (|q| |e|) of each mode, the last axis (Juang and Pappa 1985)."""
    q, e = (x.reshape(-1, x.shape[-1]) for x in np.broadcast_arrays(identified, expected))
    return np.abs(np.sum(q.conj() * e, axis=0)) / (np.linalg.norm(q, axis=0) * np.linalg.norm(e, axis=0))


def emac_channels(identified: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return the agreement of each channel and mode (Pappa, Elliott and Schenk 1993)."""
    product = identified * expected.conj()
    return agreement(product.real, product.imag, np.abs(identified) ** 2, np.abs(expected) ** 2)


def weighted_mean(values: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    return np.average(values, axis=0, weights=np.abs(amplitude) ** 2)


def test_blocks_in_pieces_give_what_whole_arrays_do() -> None:
    rng = np.random.default_rng(0)
    blocks = rng.standard_normal((20, 3, 6))
    states, first, z = noisy(rng, 6, 4), noisy(rng, 3, 4), 0.9 * np.exp(1j * rng.uniform(0, 3, 4))
    side = Evolved(blocks, states, first, z ** np.arange(20)[:, None])
    identified = blocks @ states
    step = decay_step(side.evolution)
    at = identified[step, :, np.arange(4)].T
    emac = weighted_mean(emac_channels(at, first * side.evolution[step, np.arange(4)]), first)
    coherence = amplitude_coherence(identified, first * side.evolution[:, None])
    np.testing.assert_allclose(followed(side), (coherence, emac), rtol=1e-12)


def test_lines_in_pieces_give_what_both_signs_of_all_lines_do() -> None:
    rng = np.random.default_rng(1)
    factor, states = rng.standard_normal((2, 50, 6)), noisy(rng, 6, 4)
    functions, participation = noisy(rng, 2, 4, 25), noisy(rng, 2, 4)
    seen = np.array([True, True, False, True])

    real, imaginary = np.split(factor @ states, 2, axis=1)
    found = np.stack([real + 1j * imaginary, real - 1j * imaginary], axis=1).reshape(-1, 4)
    expected = (functions.transpose(0, 2, 1) * participation[:, None, None]).reshape(-1, 4)
    coherence = amplitude_coherence(found, expected)
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
    # half the amplitude counts a half; an eighth of pi a half; beyond a quarter of pi nothing
    known = np.array([[2.0], [1.0], [2 * np.exp(1j * np.pi / 8)], [2 * np.exp(1j * np.pi / 3)]])
    np.testing.assert_allclose(emac_channels(known, np.full((4, 1), 2.0))[:, 0], [1, 0.5, 0.5, 0], atol=1e-12)
