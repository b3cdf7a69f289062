"""Dwells at several levels: the backbone of a rig whose springs harden, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.hardening_rig import HardeningRig
from modalscope.data import Records, Signals
from modalscope.extras.dwell_levels import _backbone
from tests.support import refused

LEVELS = (0.001, 0.004, 0.008)


def dwells(rig: HardeningRig, noise: float = 0.01) -> Records:
    """Four frequencies about resonance at each of three levels."""
    f = np.concatenate([rig.backbone(a) * np.array([0.98, 0.99, 1.0, 1.01]) for a in LEVELS])
    return rig.dwell(np.repeat(20 * np.array(LEVELS), 4), f, noise=noise)


@pytest.mark.parametrize("cubic", [1e6, 0.0, pytest.param(-2e5, marks=pytest.mark.slow)])
def test_the_backbone_is_that_of_the_rig(cubic: float) -> None:
    """Noise of a hundredth of the motion; after twenty seconds motion is settled to exp(-6) = .2 %, more slowly near a fold."""
    rig = HardeningRig(cubic=cubic)
    found = ms.tuned_dwell(dwells(rig))
    levels = found.levels
    assert np.all(np.diff(levels.amplitude) >= 0)
    assert levels.amplitude[-1] > 4 * levels.amplitude[0]
    assert np.allclose(levels.frequency, rig.backbone(levels.amplitude), rtol=1e-3)
    assert np.allclose(levels.damping, rig.damping / (4 * np.pi * rig.mass * levels.frequency), rtol=1e-2)
    assert found.modes.frequencies[0] == pytest.approx(levels.frequency[0])
    assert np.allclose(found.modes.shapes[:, 0] / found.modes.shapes[0, 0], [1, 1], atol=1e-3)
    assert (np.abs(levels.frequency / levels.frequency[0] - 1).max() < 1e-3) == (cubic == 0)
    assert "linear within" in str(found.modes.notes[0])
    assert found.forces.shape == (1, 2)
    assert np.allclose(np.abs(found.forces), np.sqrt(0.5), atol=1e-6)
    assert found.indicator.min() < 0.01  # one of the dwells is at resonance


def test_accelerations_give_levels_in_metres() -> None:
    """A linear mode by its closed form, x = F / (k - m w^2 + j w c)."""
    t, runs = np.arange(2000) / 100, []
    for f in (4.9, 5.0, 5.05, 5.1):
        w = 2 * np.pi * f
        x = 2.0 / (1000 - w**2 + 0.6j * w)
        motion = np.real(-(w**2) * x * np.exp(1j * w * t))[:, None]
        given = {"output_dofs": ["1:+X"], "input_dofs": ["1:+X"], "quantities": ["acceleration"]}
        runs.append(Signals(outputs=motion, inputs=2 * np.cos(w * t)[:, None], sampling_rate=100.0, **given))  # type: ignore[arg-type]
    found = ms.tuned_dwell(runs)
    assert np.allclose(found.levels.frequency, np.sqrt(1000) / (2 * np.pi), rtol=1e-6)
    assert np.allclose(found.levels.damping, 0.6 / (2 * np.sqrt(1000)), rtol=1e-6)
    assert found.levels.amplitude[-1] == pytest.approx(
        max(abs(2 / (1000 - (2 * np.pi * f) ** 2 + 0.6j * 2 * np.pi * f)) for f in (4.9, 5.0, 5.05, 5.1)), rel=1e-6
    )


def test_dwells_that_tell_nothing_are_refused() -> None:
    rig = HardeningRig()
    steps = [4.9, 5.0, 5.1, 5.2]
    runs = rig.dwell([0.1] * 4, steps, duration=10.0).runs
    refused("4 dwells", ms.tuned_dwell, runs[:3])
    assert len(ms.tuned_dwell(runs).levels) == 4
    refused("all dwells are at one frequency", ms.tuned_dwell, rig.dwell([0.1] * 4, [5.0] * 4, duration=10.0))
    w, at_resonance = 2 * np.pi * np.array(steps), np.full(4, 1j)  # a structure that hardens is tuned at each level
    refused("from 4.9 to 5.2 Hz: mass and stiffness", _backbone, w, np.ones(4), at_resonance)
    refused("no forces were measured", ms.tuned_dwell, [run.select(inputs=[]) for run in runs])
    refused("periods", ms.tuned_dwell, rig.dwell([0.1] * 4, steps, duration=1.8))
    apart = [run.select(outputs=["1:+X"]) for run in runs]
    refused("the motion at 2:[+]X is not measured", ms.tuned_dwell, apart)
