"""Pictures of intervals: what holds and what does not is told apart for frequencies and damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import same_color

import modalscope as ms
from modalscope import plot
from modalscope.analysis.checking.certificate import Certificate
from modalscope.interfaces.plot.intervals import intervals_picture
from modalscope.interfaces.plot.picture import INKS, Item, Line, Marks, Words
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.systems import chain5


def widths(items: Sequence[Item]) -> RealArray:
    """Return how wide the bars of intervals are."""
    (bars,) = [item for item in items if isinstance(item, Line)]
    return np.diff(np.reshape(bars.x, (-1, 3))[:, :2])[:, 0]


@pytest.mark.parametrize("of", ["frequency", "damping"])
def test_modes_whose_interval_does_not_hold_have_a_colour_of_their_own(of: str) -> None:
    n, count = 5, np.full(5, 40)
    good = {"bias": np.zeros(n), "ratio": np.ones(n), "coverage": np.full(n, 0.95)}
    bad = {**good, "bias": np.array([0.0, 0.0, 3.0, 0.0, 0.0])}
    sides = {"frequency": bad if of == "frequency" else good, "damping_ratio": good if of == "frequency" else bad}
    found = Certificate(
        modes=chain5().modes(), holds=np.ones(n, bool), found=count, replicates=count, order=10, **sides
    )
    drawn = {line.get_label(): line for line in plot.certificate(found, of=of).get_lines()}
    assert drawn["holds"].get_xdata()[::3].tolist() == [0, 1, 3, 4]
    assert drawn["does not hold"].get_xdata()[::3].tolist() == [2]
    assert same_color(drawn["holds"].get_color(), INKS["blue"][0])
    assert same_color(drawn["does not hold"].get_color(), INKS["orange"][0])


def test_each_interval_has_its_own_scale_with_its_ends() -> None:
    data = chain5().frequency_response(np.linspace(0.3, 7.5, 300), noise=0.01, seed=1)
    modes = ms.analyze(data, orders=range(8, 15, 2)).modes
    assert modes.frequencies_std is not None
    wide = replace(
        modes, frequencies_std=modes.frequencies_std * np.array([1000.0, *[1.0] * (len(modes) - 1)]), unrefined=None
    )
    items = intervals_picture(wide, "frequency").panels[0].items
    assert widths(items) == pytest.approx(2)  # a wide one leaves the others as they are
    texts = [[float(text) for text in item.texts] for item in items if isinstance(item, Words) and len(item.texts)]
    assert np.transpose(texts) == pytest.approx(wide.interval(0.95)["frequency"], rel=1e-3)


@pytest.mark.parametrize(("away", "width"), [(2.0, 1.0), (50.0, 0.8)])
def test_a_value_before_refinement_that_is_far_away_stands_at_the_edge(away: float, width: float) -> None:
    modes = replace(chain5().modes(), frequencies_std=np.full(5, 1e-3))
    half = np.ptp(modes.interval(0.95)["frequency"], axis=1) / 2
    f = modes.frequencies + away * half
    moved = replace(modes, poles=poles_from(f, modes.damping_ratios), frequencies_std=None)
    items = intervals_picture(replace(modes, unrefined=moved), "frequency").panels[0].items
    before = [item for item in items if isinstance(item, Marks)][-1]
    assert widths(items) == pytest.approx(width, rel=1e-3)
    assert np.asarray(before.x) == pytest.approx(1.0, rel=1e-3)
