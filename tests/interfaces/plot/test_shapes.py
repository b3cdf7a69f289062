from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection

from modalscope import plot
from modalscope.data import DataError, Geometry, ModalModel
from modalscope.interfaces.plot._camera import oblique, view_of
from modalscope.interfaces.plot.shapes import in_phase
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from tests.interfaces.plot import examples
from tests.support import refused


def model(shape: list[complex], dofs: list[str], geometry: Geometry | None = None) -> ModalModel:
    return ModalModel(
        poles=poles_from([2.0], [0.01]), shapes=np.array(shape)[:, None], output_dofs=dofs, geometry=geometry
    )


PLATE = Geometry(
    nodes=[1, 2, 3, 4],
    coordinates=[[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]],
    lines=[[1, 2], [2, 3], [3, 4], [4, 1]],
    faces=[[1, 2, 3, 4]],
)


def heights(ax: Axes) -> RealArray:
    """Return the heights of bars, from the left."""
    paths = [path.vertices for bars in ax.collections if isinstance(bars, PolyCollection) for path in bars.get_paths()]
    paths.sort(key=lambda corners: corners[0, 0])
    return np.array([corners[1, 1] for corners in paths])


@given(st.lists(st.floats(-1, 1), min_size=2, max_size=8), st.floats(0, 2 * np.pi))
def test_a_shape_of_one_phase_is_drawn_without_that_phase(values: list[float], phase: float) -> None:
    real = np.array(values)
    largest = float(np.max(np.abs(real)))
    if largest < 1e-3 or np.count_nonzero(np.abs(real) > largest * (1 - 1e-9)) > 1:
        return  # nothing to draw, or a tie decides which component is 1
    expected = real / real[np.argmax(np.abs(real))]
    # half the angle of a sum of squares: rounding of the sum, about eps
    assert in_phase(real * np.exp(1j * phase)) == pytest.approx(expected, abs=1e-12)


def test_the_phase_taken_leaves_the_least_imaginary_part() -> None:
    rng = np.random.default_rng(3)
    phi = rng.standard_normal(6) + 1j * rng.standard_normal(6)
    angles = np.linspace(0, np.pi, 2001)
    brute = max((phi * np.exp(-1j * a)).real @ (phi * np.exp(-1j * a)).real for a in angles)
    turned = (phi * np.exp(-0.5j * np.angle(np.sum(phi**2)))).real
    assert turned @ turned == pytest.approx(brute, rel=1e-5)  # the grid's step squared


def test_without_geometry_every_channel_is_a_bar() -> None:
    modes = replace(examples.modes(), geometry=None)
    ax = plot.shape(modes, 1)
    assert heights(ax) == pytest.approx(in_phase(modes.shapes[:, 1]))
    assert [label.get_text() for label in ax.get_xticklabels()] == list(modes.output_dofs)


def test_the_title_tells_mode_frequency_damping_and_complexity() -> None:
    ax = plot.shape(model([1, 1j], ["a", "b"]), 0)
    assert ax.get_title(loc="left") == "mode 1: 2.00000 Hz, 1.00 %"  # the decimals of the table
    assert ax.get_title(loc="right") == "MPC 0.000"  # a travelling wave


def test_nodes_on_a_line_are_displacement_over_position() -> None:
    line = Geometry(nodes=[1, 2, 3], coordinates=[[0, 0, 0], [2, 0, 0], [1, 0, 0]])
    ax = plot.shape(model([0.5, 1, -1 / 3], ["1:+Z", "2:+Z", "3:-Z"], line), 0)
    _, _, moved = ax.get_lines()  # at rest, stems, displaced
    assert np.asarray(moved.get_xdata()).tolist() == [0, 1, 2]
    assert np.asarray(moved.get_ydata()) == pytest.approx([0.5, 1 / 3, 1])
    assert ax.get_xlabel() == "position along x"
    assert ax.get_ylabel() == "motion in z (largest 1)"


def test_an_upright_structure_is_drawn_upright() -> None:
    tower = Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [0, 0, 30]])
    ax = plot.shape(model([0.5, 1], ["1:+X", "2:+X"], tower), 0)
    assert ax.get_ylabel() == "position along z"
    _, _, moved = ax.get_lines()  # at rest, stems, displaced
    assert np.asarray(moved.get_ydata()).tolist() == [0, 30]


def test_motion_in_two_directions_gives_two_curves() -> None:
    line = Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [1, 0, 0]])
    ax = plot.shape(model([1, 0.5, 0.2, 0.1], ["1:+Z", "2:+Z", "1:+Y", "2:+Y"], line), 0)
    assert {str(entry.get_label()) for entry in ax.get_lines()} >= {"y", "z"}


def test_a_plane_that_moves_in_itself_is_drawn_flat_and_to_scale() -> None:
    motion = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0]])
    view = view_of(PLATE.coordinates, motion)
    assert view.kind == "plane"
    assert view.names == ("x", "y")
    assert PLATE.coordinates @ view.matrix == pytest.approx(PLATE.coordinates[:, :2])


def test_a_plane_that_moves_out_of_itself_is_seen_obliquely() -> None:
    ax = plot.shape(model([1, -1, 0.5, -0.5], ["1:+Z", "2:+Z", "3:+Z", "4:+Z"], PLATE), 0)
    kinds = [type(collection) for collection in ax.collections]
    assert kinds.count(PolyCollection) == 1
    assert kinds.count(LineCollection) == 1  # lines displaced
    assert kinds.count(PathCollection) == 1  # nodes displaced
    # lines at rest and stems, two points and a gap each; nodes at rest; the directions
    assert [len(np.asarray(line.get_xdata())) for line in ax.get_lines()] == [3 * 4, 3 * 4, 4, 3 * 3]
    assert ax.get_aspect() == 1
    nodes = [c for c in ax.collections if isinstance(c, PathCollection)][-1]
    assert np.asarray(nodes.get_array()) == pytest.approx([1, -1, 0.5, -0.5])  # colour tells the sign


def test_the_largest_displacement_is_the_asked_share_of_the_structure() -> None:
    ax = plot.shape(model([1, 0, 0, 0], ["1:+Z", "2:+Z", "3:+Z", "4:+Z"], PLATE), 0, scale=0.25, azimuth=0, elevation=0)
    rest = np.column_stack(ax.get_lines()[2].get_data())
    (moved,) = (np.asarray(c.get_offsets()) for c in ax.collections if isinstance(c, PathCollection))
    # seen from the side z stands upright and unshortened; the diagonal of the plate is sqrt(5)
    assert (moved - rest)[0] == pytest.approx([0, 0.25 * np.sqrt(5)])


@given(st.floats(-180, 180), st.floats(0, 89))
def test_the_oblique_view_is_a_projection_with_z_upwards(azimuth: float, elevation: float) -> None:
    view = oblique(azimuth, elevation)
    assert view.matrix.T @ view.matrix == pytest.approx(np.eye(2), abs=1e-12)
    assert view.matrix.T @ view.depth == pytest.approx([0, 0], abs=1e-12)
    assert view.matrix[2, 0] == pytest.approx(0, abs=1e-12)
    assert view.matrix[2, 1] > 0


def test_a_geometry_that_knows_no_channel_is_an_error() -> None:
    with pytest.raises(DataError, match="has none of the channels a, b"):
        plot.shape(model([1, 1], ["a", "b"], PLATE), 0)


def test_a_mode_that_is_not_there_is_an_error() -> None:
    with pytest.raises(DataError, match="there are 5 modes"):
        plot.shape(examples.modes(), 5)
    with pytest.raises(DataError, match="there are 5 modes"):
        plot.complexity(examples.modes(), 7)


def test_complexity_shows_every_component_in_the_complex_plane_turned_and_scaled() -> None:
    *_, ends = plot.complexity(examples.modes(), 0).get_lines()
    shape = examples.modes().shapes[:, 0]
    drawn = np.asarray(ends.get_xdata()) + 1j * np.asarray(ends.get_ydata())
    assert np.abs(drawn).max() == pytest.approx(1)
    assert drawn / drawn[0] == pytest.approx(shape / shape[0])


def test_bars_stand_in_the_order_of_the_structure() -> None:
    modes = examples.modes()
    labels = ("10:+Z", "9:-Z", "2:+X", "11:+X")
    ax = plot.shape(replace(modes, output_dofs=labels, geometry=None), 0)
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["2:+X", "11:+X", "9:-Z", "10:+Z"]
    assert heights(ax) == pytest.approx(in_phase(modes.shapes[:, 0])[[2, 3, 1, 0]])


def test_standard_deviations_of_a_shape_are_bars_at_its_channels() -> None:
    shapes = np.array([[1.0, 2.0], [-2.0, 1.0], [0.5, 4.0]])
    modes = ModalModel(poles=[-1 + 10j, -1 + 20j], shapes=shapes, shapes_std=0.1 * np.abs(shapes))
    ax = plot.shape(modes, 1, std=True)
    ends = np.asarray(ax.get_lines()[1].get_ydata()).reshape(-1, 3)[:, :2]
    drawn = heights(ax)
    # largest component 1, and a tenth of each to either side
    assert np.allclose(np.sort(ends, axis=1), np.sort(drawn[:, None] + 0.1 * np.abs(drawn[:, None]) * [-1, 1], axis=1))
    assert np.abs(drawn).max() == pytest.approx(1)
    refused("these modes have none", plot.shape, replace(modes, shapes_std=None), std=True)
