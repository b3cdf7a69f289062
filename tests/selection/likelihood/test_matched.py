"""Filters that are matched to oscillations in samples, against plain sums over all of them."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.matched import amplitudes, explained_by_channel, grid_of


def test_samples_behind_the_last_that_tells_of_a_pole_are_left_out_and_nothing_is_lost() -> None:
    rng = np.random.default_rng(0)
    response = ImpulseResponse(values=rng.standard_normal((3000, 2, 1)), sampling_rate=100.0, kind="dirac")
    left, rows = rng.standard_normal((3000, 2, 1)), np.exp(-np.arange(3000) / 400)
    poles = poles_from([2.0, 7.0, 12.0, 30.0, 5.0], [0.001, 0.01, 0.06, 0.06, 0.2])
    found = np.concatenate([amplitudes(response, left, rows, poles[[k]]) for k in range(5)])
    t = (np.arange(3000) + response.first_sample) / 100
    for pole, A in zip(poles, found, strict=True):
        g = 2 * np.exp(pole.conj() * t) / rows  # g1 + j g2
        expected = np.einsum("k,kom->om", g, left) / np.sqrt(np.sum(np.abs(g) ** 2) / 2)
        assert pytest.approx(expected, rel=1e-10) == A


def test_what_peaks_explain_does_not_hang_on_how_their_dampings_are_rounded() -> None:
    """Poles of a grid share the lines near them; were they sorted by the last digit of their damping, they would share all lines."""
    rng = np.random.default_rng(0)
    f = np.linspace(0.5, 400, 800)
    response = FrequencyResponse(values=np.full((800, 1, 1), 1j), frequencies=f)
    left = rng.standard_normal((1600, 1, 1))
    left[[795, 1595]] = 1e3  # what another mode leaves, far from most poles
    given = np.ones((800, 1, 1)), np.ones(1600)
    grid = grid_of(response)
    rounded = grid * (1 + 1e-15 * rng.standard_normal(grid.size))
    found, again = (explained_by_channel(response, left, *given, poles) for poles in (grid, rounded))
    assert again == pytest.approx(found, rel=1e-8)
    far = (grid.imag / (2 * np.pi) < 100) & (-grid.real < 0.008 * np.abs(grid))
    assert np.max(found[far]) < 100 < 1e-3 * np.max(found)
