"""Deviations of modes that stay where they are: at the optimum those of the refinement, elsewhere of the same size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.selection.judging.refine import in_place
from tests.support import FIVE, add_noise

NAMES = ("frequencies_std", "damping_ratios_std", "frequencies_repeatability", "damping_ratios_repeatability")


def five_modes() -> ms.ModalModel:
    truth = FIVE["chain5"]().modes()
    return ms.ModalModel(poles=truth.poles, shapes=truth.shapes, participation=np.asarray(truth.shapes)[:4].T)


@pytest.fixture(scope="module")
def lines() -> ms.FrequencyResponse:
    return add_noise(five_modes().frequency_response(np.linspace(0.3, 8, 340)), 40, 0)


def test_at_the_optimum_they_are_those_of_the_refinement(lines):
    found = ms.refine(lines, five_modes(), groups=range(4))
    there = in_place(lines, found, np.zeros(0), groups=range(4))
    assert np.array_equal(there.poles, found.poles)
    for name in NAMES:
        # levels of the channels are settled in a refinement, and those of the data here
        assert np.allclose(getattr(there, name), getattr(found, name), rtol=0.3)


def test_off_the_optimum_by_a_fifth_of_a_deviation_they_hardly_change(lines):
    found = ms.refine(lines, five_modes(), groups=range(4))
    moved = replace(found, poles=found.poles + 0.4j * np.pi * found.frequencies_std)
    off = in_place(lines, moved, np.zeros(0), groups=range(4))
    there = in_place(lines, found, np.zeros(0), groups=range(4))
    for name in NAMES:
        ratio = getattr(off, name) / getattr(there, name)
        assert np.max(np.abs(np.log(ratio))) < np.log(1.6)
