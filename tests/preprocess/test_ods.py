"""Operating deflection shapes are what was measured at a line: of a single mode they are its shape."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5
from tests.support import refused

CHAIN = chain5()
LINES = np.linspace(0.1, 8, 800)


def test_near_a_lightly_damped_resonance_it_is_the_shape_of_the_mode() -> None:
    modes = CHAIN.modes()
    found = ms.ods(CHAIN.frequency_response(LINES), modes.frequencies)
    likeness = np.diag(ms.mac(found.shapes, modes.shapes))
    assert likeness[:2] == pytest.approx(1, abs=5e-3)  # neighbours take part by their own tails
    assert np.abs(found.frequencies - modes.frequencies).max() <= 0.5 * (LINES[1] - LINES[0]) + 1e-9
    assert (found.damping_ratios == 0).all()


def test_of_one_input_it_is_the_column_of_the_nearest_line() -> None:
    response = CHAIN.frequency_response(LINES)
    label = response.input_dofs[0]
    found = ms.ods(response, 3.0, input=label)
    k = int(np.argmin(np.abs(LINES - 3.0)))
    assert (found.shapes[:, 0] == response.values[k, :, 0]).all()
    assert (ms.ods(response, 3.0, input=0).shapes == found.shapes).all()


def test_of_ambient_records_it_is_the_first_singular_vector() -> None:
    record = CHAIN.simulate(inputs="ambient", samples=20_000, sampling_rate=20.0, seed=0)
    found = ms.ods(record, CHAIN.modes().frequencies[0])
    assert ms.mac(found.shapes, CHAIN.modes().shapes[:, :1])[0, 0] > 0.98


def test_what_is_not_there_is_said() -> None:
    response = CHAIN.frequency_response(LINES)
    refused("data go from", ms.ods, response, 80.0)
    refused("there are", ms.ods, response, 1.0, input="nobody")
    refused("no inputs", ms.ods, CHAIN.simulate(inputs="ambient", samples=600, sampling_rate=20.0), 1.0, input=0)
