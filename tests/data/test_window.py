"""The damping that an exponential window adds is known to the response and taken off the modes, in either domain."""

from __future__ import annotations

import numpy as np

import modalscope as ms
from tests.support import FIVE

ADDED, DT = 0.8, 0.05


def windowed() -> ms.ImpulseResponse:
    model = FIVE["chain5"]().state_space(dt=DT, input="dirac")
    # h(t) exp(-a t) shifts every pole by -a exactly
    window = np.exp(-ADDED * DT * np.arange(400))
    values = model.markov_parameters(400) * window[:, None, None]
    return ms.ImpulseResponse(values=values, sampling_rate=1 / DT, kind="dirac", added_damping=ADDED)


def test_modes_of_windowed_samples_are_those_of_the_structure():
    truth = FIVE["chain5"]().state_space().continuous_poles
    found = ms.identify(windowed(), method="era", order=10).modes.poles
    # 1e-10, and ten times that for the shorter memory that the window leaves
    assert max(np.min(np.abs(found - s)) / abs(s) for s in truth if s.imag > 0) < 1e-9


def test_the_window_goes_along_from_samples_to_lines_and_back():
    lines = windowed().to_frequency_response()
    assert lines.added_damping == ADDED
    assert lines.to_impulse_response().added_damping == ADDED
