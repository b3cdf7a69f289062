"""Functions of oscillations and their squares on lines, against the functions that responses are fitted with."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.numerics.functions.pole_functions import line_functions
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.matched import line_filters

F = np.linspace(0.3, 4.5, 40)
POLES = poles_from(np.array([0.5, 2.0, 4.6]), np.array([0.01, 0.3, 0.05]))


@pytest.mark.parametrize("rate", [None, 20.0])
def test_filters_are_the_functions_of_oscillations_and_their_squares_add_up(rate: float | None) -> None:
    found, squares = line_filters(F, rate, POLES)
    expected = line_functions(F, rate, POLES).T.reshape(len(POLES), 2, 2, F.size)
    assert found == pytest.approx(expected, rel=1e-12)
    assert squares == pytest.approx(np.sum(expected**2, axis=(1, 2)) / 2, rel=1e-12)
