"""Mode indicator functions: curves over lines that show modes before anything is identified."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import DataError, FrequencyResponse
from modalscope.data.indicators import cmif, mmif, prominence
from tests.support import FIVE


def test_the_multivariate_indicator_is_a_share_of_the_least_force() -> None:
    frf = FIVE["ring5"]().frequency_response(np.arange(0.3, 7, 0.005))
    curves, forces = mmif(frf)
    assert curves.shape == (frf.lines, 2)
    assert curves.min() >= 0
    assert curves.max() <= 1
    assert np.allclose(np.linalg.norm(forces, axis=1), 1)
    # by its definition, for any force no less than the smallest curve
    f = np.array([0.6, -0.8])
    y = frf.values @ f
    share = np.sum(y.real**2, axis=1) / np.sum(np.abs(y) ** 2, axis=1)
    assert np.all(share >= curves[:, 0] - 1e-9)


def test_the_multivariate_indicator_drops_twice_where_two_modes_have_one_frequency() -> None:
    structure = FIVE["ring5"]()
    modes = structure.modes()
    frf = structure.frequency_response(modes.frequencies[[0, 1, 3]])
    curves, _ = mmif(frf)
    # the lowest mode is single, the others of a ring come in pairs; lightly damped, so that next to nothing is in phase
    assert np.all(curves[:, 0] < 0.01)
    assert (curves[0, 1] > 0.5, curves[1, 1] < 0.05, curves[2, 1] < 0.05) == (True, True, True)


def test_the_phase_at_resonance_needs_a_quantity() -> None:
    frf = FIVE["chain5"]().frequency_response(np.linspace(0.3, 7, 30))
    with pytest.raises(DataError, match="and with it the phase at resonance"):
        mmif(FrequencyResponse(values=frf.values, frequencies=frf.frequencies))


def test_the_complex_indicator_is_the_largest_response_to_a_unit_force_and_falls() -> None:
    H = FIVE["chain5"]().frequency_response(np.linspace(0.3, 7, 50)).values
    curves = cmif(H)
    assert curves.shape == (50, 2)
    assert np.all(np.diff(curves, axis=1) <= 0)
    # two inputs: H* H is two by two, and its eigenvalues are the squares
    squares = np.linalg.eigvalsh(H.conj().transpose(0, 2, 1) @ H)[:, ::-1]
    np.testing.assert_allclose(curves**2, squares, rtol=1e-9, atol=1e-12 * squares.max())


def test_prominence_asks_for_a_row_a_frequency() -> None:
    with pytest.raises(DataError, match="curves need one row per frequency, 100, but they have 101"):
        prominence(np.ones((101, 2)), np.arange(100.0), 4.0, 0.2)
