"""Tuned sine dwell: isolated modes against exact ones."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import DataError, FrequencyResponse, mac
from modalscope.analysis.checking.dwell import tuned_dwell
from modalscope.systems import chain
from tests.support import FIVE, add_noise

QUANTITIES = ("displacement", "velocity", "acceleration")


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize(("name", "modes"), [("chain5", 5), ("ring5", 5), ("close4", 4)])
def test_modes_are_isolated(name: str, modes: int, quantity: str) -> None:
    """Lines .002 Hz apart. Non-proportional damping and a rest that is no parabola leave a percent of frequency's bandwidth."""
    s = FIVE[name]()
    found = tuned_dwell(s.frequency_response(np.arange(0.3, 7, 0.002), quantity=quantity)).modes
    truth = s.modes()
    assert len(found) == modes
    bandwidth = truth.frequencies * truth.damping_ratios
    assert np.all(np.abs(np.sort(found.frequencies) - np.sort(truth.frequencies)) < 0.1 * bandwidth)
    assert np.allclose(np.sort(found.damping_ratios), np.sort(truth.damping_ratios), rtol=0.1)


def test_the_shape_is_that_of_the_mode() -> None:
    s = FIVE["chain5"]()
    found = tuned_dwell(s.frequency_response(np.arange(0.3, 7, 0.002))).modes
    assert np.diag(mac(found.shapes, s.modes().shapes)).min() > 0.99
    assert np.all(found.indicators["mmif"] < 0.1)


def test_a_single_mode_is_exact() -> None:
    s = chain([2.0], [800.0], damping_ratios=0.02)
    for quantity in QUANTITIES:
        found = tuned_dwell(s.frequency_response(np.linspace(2.5, 3.9, 200), quantity=quantity)).modes
        assert np.allclose(found.poles, s.modes().poles, rtol=1e-9)


def test_the_force_pattern_is_blind_to_the_other_mode() -> None:
    """Two modes 2 % apart, forced at two masses: the pattern of each has no work in the other's shape."""
    s = chain([1.0, 1.0], [400.0, 4.0, 400.0], damping_ratios=0.002)
    found = tuned_dwell(s.frequency_response(np.linspace(3, 3.4, 2000)))
    assert len(found.modes) == 2
    work = np.abs(found.forces @ s.modes().shapes.real)
    assert np.all(np.sort(work, axis=1)[:, 0] < 0.02 * np.sort(work, axis=1)[:, 1])


def test_noise_of_one_percent_leaves_the_modes() -> None:
    s = FIVE["chain5"]()
    noisy = add_noise(s.frequency_response(np.arange(0.3, 7, 0.005)), 40, 3)
    found = tuned_dwell(noisy).modes
    for f, zeta in zip(s.modes().frequencies[:3], s.modes().damping_ratios[:3], strict=True):
        near = np.argmin(np.abs(found.frequencies - f))
        assert abs(found.frequencies[near] / f - 1) < 1e-3
        assert abs(found.damping_ratios[near] / zeta - 1) < 0.15


def test_what_it_needs() -> None:
    frf = FIVE["chain5"]().frequency_response(np.linspace(0.3, 7, 100))
    with pytest.raises(DataError, match="and with it the phase at resonance"):
        tuned_dwell(FrequencyResponse(values=frf.values, frequencies=frf.frequencies))
    with pytest.raises(DataError, match="at least 7 lines"):
        tuned_dwell(frf, band=(1, 1.3))
