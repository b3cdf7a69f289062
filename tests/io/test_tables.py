"""Geometry from folders of text tables, and the records that belong to it."""

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.data import DataError
from tests.support import measured


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pts_coord.txt").write_text("ptName x y z\n1 0 0 0\n2 5 0 10\n")
    (tmp_path / "sens_map.txt").write_text("ptName x y\n1 0 0\n2 ch1 ch2\n")
    (tmp_path / "sens_sign.txt").write_text("ptName x y\n1 0 0\n2 -1 1\n")
    (tmp_path / "sens_lines.txt").write_text("1 2\n")
    (tmp_path / "BG_nodes.txt").write_text("0 0 0\n1 0 0\n")
    (tmp_path / "BG_lines.txt").write_text("2\t1\n")
    return tmp_path


def test_channels_move_their_point_with_their_sign(folder):
    geometry = mio.geometry_from_tables(folder)
    assert geometry.nodes == ("1", "2", "B1", "B2")
    assert geometry.lines.tolist() == [[0, 1], [3, 2]]
    moved = geometry.displaced(("ch1", "ch2"), np.array([2.0, 3.0]))
    np.testing.assert_array_equal(moved[1], [-2, 3, 0])
    assert not moved[[0, 2, 3]].any()
    assert mio.geometry_from_tables(folder, background=False).nodes == ("1", "2")


def test_tables_that_do_not_fit_are_named(folder):
    (folder / "sens_lines.txt").write_text("1 3\n")
    with pytest.raises(DataError, match=r"sens_lines.txt needs pairs of numbers from 1 to 2(.|\n)*3"):
        mio.geometry_from_tables(folder)
    (folder / "sens_lines.txt").unlink()
    (folder / "sens_map.txt").write_text("ptName x y\n1 0 0\n7 ch1 ch2\n")
    with pytest.raises(DataError, match="unknown points: 7"):
        mio.geometry_from_tables(folder)
    (folder / "pts_coord.txt").write_text("ptName x y z\n1 0 0\n")
    with pytest.raises(DataError, match="rows of equal length"):
        mio.geometry_from_tables(folder)
    (folder / "pts_coord.txt").unlink()
    with pytest.raises(DataError, match="no such file"):
        mio.geometry_from_tables(folder)


@pytest.mark.parametrize(("name", "channels"), [("palisaden", 6), ("building_3sl", 24)])
def test_measured_folders_are_read(name, channels):
    folder = measured(name)
    geometry = mio.geometry_from_tables(folder)
    sensors = [line.split()[0] for line in (folder / "sens_coord.txt").read_text().splitlines()[1:]]
    directions = np.loadtxt(folder / "sens_dir.txt")
    assert len(sensors) == channels
    points = dict(zip(geometry.nodes, geometry.coordinates, strict=True))
    coordinates = np.loadtxt(folder / "sens_coord.txt", skiprows=1, usecols=(1, 2, 3))
    for sensor, place, direction in zip(sensors, coordinates, directions, strict=True):
        # the second route: each sensor's own place and direction, in tables that the reader does not use
        moved = [(points[node].tolist(), np.abs(vector).tolist()) for node, vector in geometry.motion_of(sensor)]
        own = [(place.tolist(), np.abs(direction).tolist())]
        # the map of the simulated building names ch4_1 at the point of ch4_3, too
        expected = {"ch4_3": [], "ch4_1": [([16.0, 8.5, 3.0], [0.0, 1.0, 0.0]), *own]}.get(sensor, own)
        assert moved == expected


def test_measured_records_are_read_under_their_own_names():
    records, hits = measured("palisaden", "palisaden_dec5.npz"), measured("impact_hits", "impacts.npz")
    names = ("ch1", "ch2", "ch3", "ch4", "ch5", "ch6")
    house = mio.read(
        records,
        rename={"y": "outputs", "fs": "sampling_rate"},
        quantity="acceleration",
        output_dofs=names,
        geometry=mio.geometry_from_tables(records.parent),
    )
    assert (house.outputs.shape, house.sampling_rate) == ((108000, 6), 20.0)
    assert house.geometry.displaced(names, np.ones(6)).any(axis=1).sum() == 3
    hammer = mio.read(
        hits,
        rename={"acc": "outputs", "force": "inputs", "fs": "sampling_rate"},
        axes={"outputs": "runs samples", "inputs": "runs samples"},
    )
    assert (hammer.outputs.shape, hammer.inputs.shape) == ((5, 51200, 1), (5, 51200, 1))
