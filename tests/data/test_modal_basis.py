"""Functions of poles and their derivatives: the slope of each is that of differences, on lines, on the circle and from any first sample."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.response import Response

POLES = np.array([-0.3 + 9.0j, -0.8 + 21.0j])
STEP = 1e-6


def lines(rate: float | None) -> Response:
    return FrequencyResponse(
        values=np.ones((40, 1, 1)) * (1 + 1j), frequencies=np.linspace(0.3, 4.5, 40), sampling_rate=rate
    )


def samples(first: int) -> Response:
    return ImpulseResponse(values=np.ones((50, 1, 1)), sampling_rate=20.0, kind="dirac", first_sample=first)


@pytest.mark.parametrize("response", [lines(None), lines(20.0), samples(0), samples(7)], ids=lambda r: r.origin)
@pytest.mark.parametrize("k", [0, 1])
def test_derivatives_are_the_slopes_of_the_functions(response: Response, k: int) -> None:
    moved = np.where(np.arange(2) == k, STEP, 0)
    rise = response.basis(POLES + moved, ()).functions - response.basis(POLES - moved, ()).functions
    slope = rise[:, 2 * k : 2 * k + 2] / (2 * STEP)
    found = response.derivatives(POLES)[:, 2 * k : 2 * k + 2]
    # central differences err by step^2 times the third derivative, and by rounding over the step
    assert np.abs(found - slope).max() < 1e-7 * np.abs(slope).max()
