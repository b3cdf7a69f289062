"""Modes taken by hand."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import DataError, select, stabilize
from modalscope.systems import chain5


def test_to_take_a_mode_that_is_listed_changes_nothing() -> None:
    diagram = stabilize(chain5().impulse_response(300, noise=0.01, seed=0), orders=range(2, 21, 2), method="era")
    listed = select(diagram)
    for f in listed.frequencies[1] * np.array([1.0, 1.001]):
        assert np.array_equal(select(diagram, take=[f]).poles, listed.poles)
    with pytest.raises(DataError, match="a mode at"):
        select(diagram, take=[0.5 * listed.frequencies[0]])
