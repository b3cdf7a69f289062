"""A pole at half the sampling rate, by every way that fits on lines: one real state, not a pair that differs by rounding."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import dlsim

import modalscope as ms

RATE = 100.0


def sampled_system() -> tuple[np.ndarray, ...]:
    """Two modes and a pole at z = -.8, three outputs, two inputs."""
    rng = np.random.default_rng(3)
    A = np.zeros((5, 5))
    for k, s in enumerate((-0.5 + 2j * np.pi * 8, -0.7 + 2j * np.pi * 21)):
        z = np.exp(s / RATE)
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, z.imag], [-z.imag, z.real]]
    A[4, 4] = -0.8
    return A, rng.standard_normal((5, 2)), rng.standard_normal((3, 5)), np.zeros((3, 2))


@pytest.fixture
def response() -> ms.FrequencyResponse:
    A, B, C, _ = sampled_system()
    f = np.linspace(0, 49, 393)
    z = np.exp(2j * np.pi * f / RATE)
    values = np.stack([C @ np.linalg.solve(x * np.eye(5) - A, B) for x in z])
    return ms.FrequencyResponse(values=values, frequencies=f, sampling_rate=RATE)


@pytest.mark.parametrize("method", ["alternate", "era", "least_squares", "polyreference"])
def test_modes_of_lines_give_the_response_again(response: ms.FrequencyResponse, method: str) -> None:
    found = ms.identify(response, method=method, domain="z", order=5)
    assert found.modes.kinds == ("mode", "mode", "nyquist")
    assert found.fit_error < 1e-9
    again = found.modes.frequency_response(response.frequencies)
    assert np.abs(again.values - response.values).max() < 1e-9 * np.abs(response.values).max()


def test_modes_of_a_record_give_the_response(response: ms.FrequencyResponse) -> None:
    u = np.random.default_rng(1).standard_normal((400, 2))
    y = dlsim((*sampled_system(), 1 / RATE), u)[1]
    found = ms.identify(ms.Signals(outputs=y, inputs=u, sampling_rate=RATE), route="records", domain="z", order=5)
    assert found.modes.kinds == ("mode", "mode", "nyquist")
    assert found.fit_error < 1e-9
    again = found.modes.frequency_response(response.frequencies)
    assert np.abs(again.values - response.values).max() < 1e-9 * np.abs(response.values).max()
