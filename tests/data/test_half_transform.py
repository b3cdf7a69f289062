"""The transform in the place of its result is that of the library, for any length."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import record_transform as module
from modalscope.data.record_transform import half_transform


@pytest.mark.parametrize("samples", [8, 12, 16, 64, 96, 1000, 1001, 1002, 4096])
def test_the_transform_of_halves_is_that_of_the_whole(samples, monkeypatch):
    monkeypatch.setattr(module, "_MIN_SPLIT_SAMPLES", 8)
    monkeypatch.setattr(module, "_LINES_AT_A_TIME", 7)
    x = np.random.default_rng(samples).standard_normal((samples, 2))[:, 1]
    place = np.empty(samples // 2 + 1, complex)
    half_transform(x, place)
    assert np.allclose(place, np.fft.rfft(x), atol=1e-13 * samples)
