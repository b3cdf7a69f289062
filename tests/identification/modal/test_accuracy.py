"""Accuracy indicators in the frequency domain: rows over the lines against b / (x - s), derived like those of the time domain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modalscope import identify
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.transfer import transfer
from modalscope.identification.modal.accuracy import _within_order
from tests.support import FIVE, add_noise, match_poles, relative

CELLS = [(m, d) for d in ("s", "z") for m in ("era", "alternate", "least_squares")]


@pytest.mark.slow
@pytest.mark.parametrize(("method", "domain"), CELLS)
@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_they_are_one_without_noise(method: str, domain: str, quantity: str) -> None:
    for name in FIVE:
        frf = FIVE[name]().frequency_response(np.linspace(0.4, 8, 150), quantity=quantity)
        found = identify(frf, method=method, domain=domain, order=2 * FIVE[name]().degrees).modes
        for indicator in ("amplitude_coherence", "emac", "emaco"):
            assert found.indicators[indicator].min() > 1 - 1e-5, (name, indicator)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "domain"), CELLS)
def test_they_tell_modes_from_noise(method: str, domain: str) -> None:
    """At an order with seven extraneous pairs, 20 dB: modes above all of them in amplitude coherence."""
    s = FIVE["chain5"]()
    for seed in range(5):
        noisy = add_noise(s.frequency_response(np.linspace(0.3, 8, 160), quantity="acceleration"), 20, seed)
        found = identify(noisy, method=method, domain=domain, order=24).modes
        own = match_poles(found.poles, s.modes().poles).index[1:]  # the first mode is hidden in noise as accelerance
        rest = np.setdiff1d(np.arange(len(found)), match_poles(found.poles, s.modes().poles).index)
        coherence = found.indicators["amplitude_coherence"]
        assert coherence[own].min() > np.median(coherence[rest])
        assert coherence[own].mean() > 0.8
        assert found.indicators["emac"][own].mean() > 2 * found.indicators["emac"][rest].mean()


def test_the_consistent_mode_indicator_is_emac_times_phase_collinearity() -> None:
    noisy = add_noise(FIVE["chain5"]().frequency_response(np.linspace(0.3, 8, 160)), 20)
    values = identify(noisy, domain="s", order=14).modes.indicators
    assert np.array_equal(values["cmi"], values["emac"] * values["mpc"])
    assert values["mpc"].min() < 0.99  # else the product would be EMAC alone


def test_the_right_factor_is_brought_back_to_the_lines() -> None:
    """H = P d Q' with Q over lines, against the decomposition of the whole matrix."""
    frf = add_noise(FIVE["chain5"]().frequency_response(np.linspace(0.3, 8, 100)))
    matrix = transfer(frf, domain="s", block_rows=6)
    factors = factorize(matrix.tall(), 10)
    Q = matrix.with_columns(factors).right.whole.reshape(-1, 10)
    assert relative(Q.T @ Q, np.eye(10)) < 1e-10
    whole = np.vstack([matrix.columns_array(i) for i in range(2)]).T
    assert relative(factors.P.T @ whole, factors.d[:, None] * Q.T) < 1e-10


def test_on_many_lines_some_are_compared() -> None:
    frf = FIVE["chain5"]().frequency_response(np.linspace(0.3, 8, 3000))
    matrix = transfer(frf, domain="s", block_rows=10)
    assert 500 < matrix.compared_lines.size <= 1000
    found = identify(frf, method="era", domain="s", order=10, block_rows=10).modes
    assert found.indicators["amplitude_coherence"].min() > 1 - 1e-6


def test_a_pole_whose_shape_no_float_holds_leaves_the_others_as_they_are() -> None:
    poles = 2j * np.pi * np.array([10.0, 20.0, 1e6])
    modes: Any = SimpleNamespace(poles=poles, shapes=np.ones((1, 3)))
    found = {"mpc": np.ones(3), "msv": np.array([2.0, 4.0, np.inf])}
    _within_order(found, modes)
    np.testing.assert_array_equal(found["msv"], [0.5, 1.0, np.nan])
