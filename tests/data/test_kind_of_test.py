"""A weak hit in a long record is a hit; a fault of one sample among random forces is none."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import Records, Signals
from modalscope.data.kind_of_test import commonest, is_impact, kind_of_test
from modalscope.numerics.checks import Array
from modalscope.signals.preprocess.excitation import excitation_of, find_excitation
from tests.support import measured

RNG = np.random.default_rng(0)
NOISE = RNG.standard_normal(100_000)


def hit(peak: float, samples: int = 21) -> Array:
    """Return a half sine of this height, in standard deviations of the noise about it."""
    force = NOISE.copy()
    force[500 : 500 + samples] += peak * np.sin(np.pi * np.arange(1, samples + 1) / (samples + 1))
    return force


@pytest.mark.parametrize(("peak", "found"), [(300.0, True), (60.0, True), (18.0, False)])
def test_a_weak_hit_is_told_by_its_peak_over_its_noise(peak: float, found: bool) -> None:
    force = hit(peak)
    energy = np.sort(force**2)[::-1]
    assert energy[:5000].sum() < 0.95 * energy.sum()  # of the record it has too little
    assert is_impact(force) is found


@pytest.mark.parametrize(("samples", "found"), [(1, False), (2, True)])
def test_a_fault_of_one_sample_is_no_hit(samples: int, found: bool) -> None:
    force = NOISE.copy()
    force[500 : 500 + samples] = 100.0
    assert is_impact(force) is found


def test_bursts_and_forces_that_rise_and_fall_are_no_hits() -> None:
    t = np.arange(NOISE.size) / NOISE.size
    assert not is_impact(NOISE * np.exp(-(((t - 0.5) / 0.05) ** 2)) + 1e-3 * NOISE)
    assert not is_impact(np.where(t < 0.1, 100 * NOISE, NOISE))
    assert not is_impact(np.sin(100 * t))
    assert is_impact(np.zeros(100)) is False


def test_parts_share_the_kind_of_most_of_them() -> None:
    assert commonest(["a", "b", "a"], "c") == "a"
    assert commonest(["a", "b"], "c") == "c"
    assert commonest([], "c") == "c"
    forces = np.stack([hit(1000.0), hit(1000.0), NOISE])[:, :, None]
    y = np.zeros_like(forces)
    assert kind_of_test(y, forces) == "hammer"
    assert kind_of_test(y[1:], forces[1:]) == "shaker"
    assert kind_of_test(y[:1], 0 * forces[:1]) == "shaker"
    runs = [Signals(outputs=y[0], inputs=force, sampling_rate=1.0) for force in forces]
    assert (Records(runs=runs).kind_of_test, excitation_of(runs)) == ("hammer", "impact")
    assert (Records(runs=runs[1:]).kind_of_test, excitation_of(runs[1:])) == ("shaker", "random")
    assert find_excitation(Signals(outputs=y, inputs=forces, sampling_rate=1.0)) == "impact"


@pytest.mark.slow
def test_a_stored_weak_hit() -> None:
    from modalscope import read

    assert read(measured("standins", "weak_hit", "weak.csv")).kind_of_test == "hammer"
