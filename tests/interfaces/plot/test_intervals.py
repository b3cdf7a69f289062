"""Pictures of intervals: what holds and what does not is told apart for frequencies and damping."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import same_color

from modalscope import plot
from modalscope.analysis.checking.certificate import Certificate
from modalscope.interfaces.plot._style import BLUE, ORANGE
from modalscope.systems import chain5


@pytest.mark.parametrize("of", ["frequency", "damping"])
def test_modes_whose_interval_does_not_hold_have_a_colour_of_their_own(of: str) -> None:
    n, count = 5, np.full(5, 40)
    good = {"bias": np.zeros(n), "ratio": np.ones(n), "coverage": np.full(n, 0.95)}
    bad = {**good, "bias": np.array([0.0, 0.0, 3.0, 0.0, 0.0])}
    sides = {"frequency": bad if of == "frequency" else good, "damping_ratio": good if of == "frequency" else bad}
    found = Certificate(
        modes=chain5().modes(), holds=np.ones(n, bool), found=count, replicates=count, order=10, **sides
    )
    drawn = {group.get_label(): group.lines[0] for group in plot.certificate(found, of=of).containers}
    assert drawn["holds"].get_xdata().tolist() == [0, 1, 3, 4]
    assert drawn["does not hold"].get_xdata().tolist() == [2]
    assert same_color(drawn["holds"].get_color(), BLUE)
    assert same_color(drawn["does not hold"].get_color(), ORANGE)
