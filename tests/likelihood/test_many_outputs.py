"""What is made of the peaks of thousands of outputs is of the size of the data, not of the outputs squared."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from modalscope.data import FrequencyResponse
from modalscope.likelihood.matched import strongest_peaks

LINES, OUTPUTS, INPUTS = 60, 5000, 2


def test_the_peaks_of_five_thousand_outputs_stay_below_100_mb() -> None:
    """The left vectors of one residue of full size alone take 400 MB."""
    rng = np.random.default_rng(0)
    f = np.linspace(10, 20, LINES)
    light = FrequencyResponse(values=np.full((LINES, 1, 1), 1j), frequencies=f)
    pole = 2 * np.pi * 15 * (-0.01 + 1j)
    shape, sides = rng.standard_normal((2, max(OUTPUTS, INPUTS)))
    H = (1 / (2j * np.pi * f - pole))[:, None, None] * np.outer(shape[:OUTPUTS], sides[:INPUTS])
    left = np.concatenate([H.real, H.imag])
    del H
    tracemalloc.start()
    (found,) = strongest_peaks(light, left, np.ones(2 * LINES), np.zeros(0, complex), 1.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100e6
    assert found.pole.imag == pytest.approx(pole.imag, rel=0.02)
    assert abs(found.shape.conj() @ shape) == pytest.approx(np.linalg.norm(shape), rel=1e-9)
    assert found.participation.shape == (INPUTS,)
