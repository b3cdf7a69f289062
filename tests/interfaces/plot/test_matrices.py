from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes

from modalscope import plot
from modalscope.data import DataError, indicators
from modalscope.numerics.checks import RealArray
from tests.interfaces.plot import examples


def shades(ax: Axes) -> RealArray:
    """Return how dark the cells are, row by row."""
    (cells,) = ax.collections
    return np.asarray(cells.get_facecolor())[:, 3]


def test_every_cell_of_the_mac_shows_its_number() -> None:
    modes = examples.modes()
    ax = plot.mac(modes)
    values = indicators.mac(modes.shapes)
    assert shades(ax) == pytest.approx(values.ravel())
    words = [text.get_text() for text in ax.texts]
    assert len(words) == 25
    assert words.count("1.00") == 5
    assert all(word == "·" or float(word) >= 0.01 for word in words)
    assert [float(t.get_text()) for t in ax.get_yticklabels()] == pytest.approx(modes.frequencies, rel=1e-3)


def test_models_are_compared_channel_by_channel_whatever_their_order() -> None:
    modes = examples.modes()
    turned = modes.select(outputs=modes.output_dofs[::-1])
    ax = plot.mac(modes, turned)
    assert np.diag(shades(ax).reshape(5, 5)) == pytest.approx(np.ones(5))


def test_a_missing_channel_is_an_error() -> None:
    modes = examples.modes()
    with pytest.raises(DataError, match="output"):
        plot.mac(modes, modes.select(outputs=[0, 1, 2]))


def test_plain_arrays_are_numbered() -> None:
    ax = plot.mac(np.eye(3), np.eye(3)[:, :2])
    assert [t.get_text() for t in ax.get_xticklabels()] == ["1", "2"]
    assert ax.get_xlabel() == "mode"


def test_many_modes_are_drawn_without_numbers() -> None:
    assert not plot.mac(np.eye(30)).texts


def test_singular_values_are_drawn_relative_to_the_largest() -> None:
    ax = plot.singular_values(examples.diagram(), order=10)
    values = np.asarray(ax.get_lines()[0].get_ydata())
    assert values == pytest.approx(examples.diagram().singular_values)
    assert values[0] == 1
    legend = ax.get_legend()
    assert legend is not None
    assert {text.get_text() for text in legend.get_texts()} == {"singular values", "order 10"}


def test_singular_values_of_zero_leave_a_gap_on_the_logarithmic_axis() -> None:
    (line,) = plot.singular_values([4.0, 2.0, 0.0]).get_lines()
    assert np.asarray(line.get_ydata()).tolist() == [1.0, 0.5]


def test_one_output_has_neither_shape_nor_mac() -> None:
    modes = examples.modes().select(outputs=[0])
    for ax, words in ((plot.mac(modes), "cannot be compared"), (plot.shape(modes), "one number says nothing")):
        assert not ax.images
        assert not ax.patches
        assert words in ax.texts[0].get_text()
