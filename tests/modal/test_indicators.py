"""Indicators of shapes and amplitudes: closed forms, ranges, and what they must not depend on."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.modal.indicators import (
    amplitude_coherence,
    cluster_mpc,
    clusters,
    decay_step,
    emac_channels,
    mac,
    modal_singular_values,
    mpc,
    mpd,
    weighted_mean,
)
from modalscope.model import DataError

RNG = np.random.default_rng(4)
SHAPES = RNG.standard_normal((6, 3)) + 1j * RNG.standard_normal((6, 3))

#: Complex factors, one a shape: none of what is tested may see them.
TURNS = np.array([2 - 1j, 0.1j, -3.0])


def test_the_modal_assurance_criterion_is_the_squared_cosine() -> None:
    a, b = np.array([1.0, 0.0]), np.array([np.cos(0.3), np.sin(0.3)])
    assert mac(a, b)[0, 0] == pytest.approx(np.cos(0.3) ** 2)
    np.testing.assert_allclose(mac(SHAPES, SHAPES * TURNS), mac(SHAPES))
    np.testing.assert_allclose(np.diag(mac(SHAPES)), 1)
    assert mac([0.0, 0.0], a)[0, 0] == 0
    with pytest.raises(DataError, match="6 and 2 channels"):
        mac(SHAPES, a)


def test_collinearity_is_one_for_one_phase_and_zero_for_a_travelling_wave() -> None:
    wave = np.exp(2j * np.pi * np.arange(8) / 8)
    still = np.array([1, -2, 3, 0.5]) * np.exp(0.7j)
    np.testing.assert_allclose(mpc(wave[:, None]), 0, atol=1e-15)
    np.testing.assert_allclose(mpc(still[:, None]), 1)
    np.testing.assert_allclose(mpc(SHAPES * TURNS), mpc(SHAPES))


def test_phase_deviation_is_the_weighted_angle_off_the_line() -> None:
    # two pairs of equal components 10 degrees to either side of a line through 25 degrees
    off = np.radians(10)
    shape = np.exp(1j * (np.radians(25) + np.array([off, -off, off + np.pi, -off])))
    np.testing.assert_allclose(mpd(shape[:, None]), 10)
    np.testing.assert_allclose(mpd(SHAPES * TURNS), mpd(SHAPES))


def test_repeated_modes_are_judged_together_whatever_their_basis() -> None:
    real = RNG.standard_normal((6, 2))
    mixed = real @ np.array([[1.0, 1j], [0.5j, 2.0]])
    assert mpc(mixed).min() < 0.9
    assert cluster_mpc(mixed) == pytest.approx(1)
    s = np.linalg.svd(np.column_stack([SHAPES[:, 0].real, SHAPES[:, 0].imag]), compute_uv=False)
    assert cluster_mpc(SHAPES[:, :1]) == pytest.approx(1 - (s[1] / s[0]) ** 2)


def test_clusters_are_chains_of_near_neighbours() -> None:
    poles = 1j * np.array([10.0, 10.015, 20.0, 10.03, 30.0])
    assert [group.tolist() for group in clusters(poles)] == [[0, 1, 3], [2], [4]]
    assert [group.tolist() for group in clusters(poles, width=1e-4)] == [[0], [1], [2], [3], [4]]


def test_amplitude_coherence_is_the_cosine_between_what_was_found_and_its_evolution() -> None:
    z = np.array([0.9 * np.exp(0.4j), 0.7])
    evolution = z ** np.arange(5)[:, None]
    first = SHAPES[:, :2]
    ideal = first * evolution[:, None, :]
    np.testing.assert_allclose(amplitude_coherence(ideal * np.array([3, 2j]), first, evolution), 1)
    # noise as large as the mode and orthogonal to it: the cosine of 45 degrees
    noise = RNG.standard_normal(ideal.shape) + 0j
    for j in range(2):
        a, e = ideal[..., j].ravel(), noise[..., j].ravel()
        e = e - a * (a.conj() @ e) / (a.conj() @ a)
        noise[..., j] = (e * np.linalg.norm(a) / np.linalg.norm(e)).reshape(noise.shape[:2])
    np.testing.assert_allclose(amplitude_coherence(ideal + noise, first, evolution), np.sqrt(0.5))


def test_amplitudes_agree_by_their_ratio_and_their_phase() -> None:
    expected = np.full((4, 1), 2.0 + 0j)
    identified = np.array([[2.0], [1.0], [2 * np.exp(1j * np.pi / 8)], [2 * np.exp(1j * np.pi / 3)]])
    # half the amplitude counts a half; an eighth of pi a half; beyond a quarter of pi nothing
    np.testing.assert_allclose(emac_channels(identified, expected)[:, 0], [1, 0.5, 0.5, 0], atol=1e-12)
    np.testing.assert_allclose(emac_channels(expected, identified), emac_channels(identified, expected))


def test_modes_are_compared_where_a_tenth_of_them_is_left() -> None:
    evolution = np.array([0.5, 0.999]) ** np.arange(10)[:, None]
    assert decay_step(evolution).tolist() == [3, 9]  # .5^3 = .125


def test_a_mean_weighs_channels_by_their_energy() -> None:
    values, amplitude = np.array([[1.0, 0.3], [0.0, 0.7]]), np.array([[2j, 0.0], [1.0, 0.0]])
    np.testing.assert_allclose(weighted_mean(values, amplitude), [4 / 5, 0])


def test_singular_values_of_modes_sum_their_decay() -> None:
    c, b, z = np.array([[3.0], [4.0]]), np.array([[2.0]]), np.array([0.8 + 0j])
    total = sum(0.8**k for k in range(9))
    np.testing.assert_allclose(modal_singular_values(c, b, z, 10), np.sqrt(5 * 2 * total))
    np.testing.assert_allclose(modal_singular_values(c, b, np.array([1.2 + 0j]), 10), np.sqrt(5 * 2 * 9))
