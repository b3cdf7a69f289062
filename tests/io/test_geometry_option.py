"""Where the sensors are, from tables, universal files and meshes: nodes, lines, and which channel moves which node."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
import modalscope.io as mio
from modalscope.io.geometry import geometry_among, geometry_of_tables, points_table
from tests.support import refused

POINTS = "node,x [mm],y [mm],z [mm]\nA1,0,0,0\nA2,100,0,0\nA3,100,50,0\nA4,0,50,0\n"


def record(path: Path, *heads: str) -> Path:
    values = np.random.default_rng(0).standard_normal((50, len(heads)))
    lines = [",".join(["Time", *heads])]
    lines += [f"{k / 100:.2f}," + ",".join(f"{value:.4f}" for value in row) for k, row in enumerate(values)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    "text",
    [
        POINTS,
        POINTS.replace(",", ";"),
        POINTS.replace("0,0,0\n", "0,0,0.0\n"),
        "# A plate\n" + POINTS.replace(",", "\t"),
        "A1 0 0 0\nA2 100 0 0\nA3 100 50 0\nA4 0 50 0\n",
        "Point;Z;Y;X\nA1;0,0;0,0;0,0\nA2;0,0;0,0;100,0\nA3;0,0;50,0;100,0\nA4;0,0;50,0;0,0\n",
    ],
)
def test_tables_of_points_are_read_however_they_are_written(tmp_path: Path, text: str) -> None:
    (tmp_path / "points.csv").write_text(text)
    data = ms.read(record(tmp_path / "a.csv", "A1:+Z", "A2:+Z", "A3:-Z", "A4:+Z"), geometry=tmp_path / "points.csv")
    assert data.geometry.nodes == ("A1", "A2", "A3", "A4")
    np.testing.assert_array_equal(data.geometry.coordinates[2], [100, 50, 0])
    assert {tuple(line) for line in data.geometry.lines.tolist()} == {
        (0, 1),
        (1, 2),
        (2, 3),
        (0, 3),
    }  # the edges, no diagonal
    assert data.geometry.motion_of("A3:-Z") == (("A3", (-0.0, -0.0, -1.0)),)


def test_lines_of_a_table_are_taken_and_nothing_is_said_of_neighbours(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(POINTS)
    (tmp_path / "lines.csv").write_text("from,to\nA1,A3\nA2,A4\n")
    path = record(tmp_path / "a.csv", "A1:+Z", "A2:+Z")
    told = mio.survey(path, geometry=[str(tmp_path / "points.csv"), str(tmp_path / "lines.csv")])
    assert told.thing.geometry.lines.tolist() == [[0, 2], [1, 3]]
    assert not any("neighbouring" in note for note in told.notes)
    said = mio.survey(path, geometry=tmp_path / "points.csv").notes
    assert any("4 were drawn between neighbouring nodes" in note for note in said)


def test_channels_move_the_nodes_that_a_table_gives_them(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text(
        "channel,node,x,y,z,direction\nAccA,1,0,0,0,+Z\nAccB,1,0,0,0,X\nAccC,2,1,0,0,-y\n"
    )
    told = mio.survey(record(tmp_path / "a.csv", "AccA", "AccB", "AccC", "AccD"), geometry=tmp_path / "points.csv")
    geometry = told.thing.geometry
    assert geometry.nodes == ("1", "2")
    assert geometry.motion_of("AccB") == (("1", (1.0, 0.0, 0.0)),)
    assert geometry.motion_of("AccC") == (("2", (-0.0, -1.0, -0.0)),)
    assert any("1 of 4 channels have no node and direction in the geometry: AccD" in note for note in told.notes)


LINE = "node,x,y,z\n" + "".join(f"{k},{k},0,0\n" for k in (1, 2, 3))


@pytest.mark.parametrize(
    ("heads", "points", "direction"),
    [
        (("P1", "P2", "P3"), LINE, "+Z"),
        (("P1", "P3"), LINE, "+Z"),  # P is a point: not all need a channel
        (("Acc01", "Acc02", "Acc03"), LINE, "+Z"),  # as many as nodes
        (("Acc1", "Acc3"), LINE, None),  # a recorder's channels may be anywhere
        (("P1", "Q2", "Q3"), LINE, None),  # two prefixes
        (("P1", "P2", "P9"), LINE, None),  # no node 9
        (("P1Y", "P2Y", "P3-Y"), LINE, "+Y"),
        (("P1", "P2", "P3"), LINE.replace("3,3,0,0", "3,3,2,0"), "+Z"),  # a plane has one normal
        (("P1", "P2", "P3"), LINE.replace("3,3,0,0", "3,3,0,2"), "+Y"),
        (("P1", "P2", "P3"), LINE.replace("3,3,0,0", "3,3,1,2"), None),  # a volume has none
        (("P1Z", "P2Z", "P3Z"), LINE.replace("3,3,0,0", "3,3,1,2"), "+Z"),
        (("Acc1", "Acc2", "Acc3"), f"{LINE}shaker,9,0,0\n", "+Z"),  # a node without a number is no channel's
        (("P1", "P2", "P3"), f"{LINE}A3,9,0,0\n", None),  # two nodes with the number 3
        (
            ("P1", "P2", "P3"),
            "point,x_inch,y_inch,direction\n1,1,0,+Y\n2,2,0,+Y\n3,3,0,+Y\n",
            "+Y",
        ),  # the table says where to
    ],
)
def test_channels_belong_to_nodes_by_their_number_where_nothing_is_ambiguous(
    tmp_path: Path, heads: tuple[str, ...], points: str, direction: str | None
) -> None:
    (tmp_path / "points.csv").write_text(points)
    path = record(tmp_path / "a.csv", *heads)
    told = mio.survey(path, geometry=tmp_path / "points.csv")
    said = [note for note in told.notes if "by their number" in note]
    if direction is None:
        assert (said, told.thing.geometry.motion_of(heads[0])) == ([], ())
        return
    assert len(said) == 1
    assert f"({heads[0]}: node 1, {direction})" in said[0]
    axis = np.eye(3)["XYZ".index(direction[1])]
    node, vector = told.thing.geometry.motion_of(heads[-1])[0]
    assert (node, tuple(np.abs(vector))) == (str(3), tuple(axis))
    assert min(vector) == (-1 if "-" in heads[-1] else 0)
    assert told.thing.geometry.lines.tolist()[:2] == [[0, 1], [1, 2]]
    refused_ = mio.survey(path, geometry=tmp_path / "points.csv", exact_nodes=True)
    assert refused_.thing.geometry.motion_of(heads[0]) == ()
    assert any("no node and direction" in note for note in refused_.notes)


@pytest.mark.parametrize(
    "motions", [{}, {"a": [("1", (0, 0, 1.0))], "b": [("2", (0, -1.0, 0))], "c": [("2", (1.0, 0, 0))]}]
)
def test_the_table_of_a_geometry_is_read_as_it_was(
    tmp_path: Path, motions: dict[str, list[tuple[str, tuple[float, ...]]]]
) -> None:
    geometry = ms.Geometry(nodes=["1", "2"], coordinates=[[0.5, 0, 1], [1 / 3, -2, 0]], motions=motions)
    (tmp_path / "points.csv").write_text(f"{points_table(geometry)}\n")
    back = geometry_of_tables(tmp_path / "points.csv")
    assert (back.nodes, dict(back.motions)) == (geometry.nodes, dict(geometry.motions))
    np.testing.assert_allclose(back.coordinates, geometry.coordinates, rtol=1e-8)
    oblique = ms.Geometry(nodes=["1"], coordinates=[[0, 0, 0]], motions={"a": [("1", (0.6, 0.8, 0))]})
    assert points_table(oblique) is None


def test_a_geometry_is_found_among_files_of_data(tmp_path: Path) -> None:
    data = [record(tmp_path / f"{name}.csv", "P1", "P2") for name in ("one", "two")]
    points, lines, other = (tmp_path / f"{name}.csv" for name in ("points", "lines", "other"))
    points.write_text(LINE)
    lines.write_text("1,2\n2,3\n")
    other.write_text("1,2\n2,9\n")  # no node 9
    assert geometry_among([lines, data[0], points, data[1]]) == (data, (points, lines))
    assert geometry_among([data[0], points, other]) == ([data[0], other], (points,))
    assert geometry_among([points]) == ([points], ())
    assert geometry_among(data) == (data, ())
    phone = tmp_path / "phone.csv"  # axes of a record are no coordinates of nodes
    phone.write_text("time,x,y,z\n" + "".join(f"{k / 100},{k % 3},{k % 5},{k % 7}\n" for k in range(50)))
    assert geometry_among([phone, data[0]]) == ([phone, data[0]], ())
    again = tmp_path / "again.csv"
    again.write_text(LINE)
    assert geometry_among([data[0], points, again]) == ([data[0], points, again], ())  # which of the two is not known


def test_a_universal_file_gives_its_geometry(tmp_path: Path) -> None:
    held = ms.Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [1, 0, 0]], lines=[[1, 2]])
    ms.write(tmp_path / "g.uff", held)
    data = ms.read(record(tmp_path / "a.csv", "1:+Z", "2:+Z"), geometry=tmp_path / "g.uff")
    assert data.geometry.lines.tolist() == [[0, 1]]


@pytest.mark.slow
def test_a_workbook_gives_points(tmp_path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    for row in (["node", "x", "y", "z"], ["A1", 0, 0, 0], ["A2", 1.5, 0, 0]):
        book.active.append(row)
    book.save(tmp_path / "points.xlsx")
    data = ms.read(record(tmp_path / "a.csv", "A1:+Z", "A2:+Z"), geometry=tmp_path / "points.xlsx")
    assert data.geometry.coordinates.tolist() == [[0, 0, 0], [1.5, 0, 0]]


def test_a_sheet_of_a_chart_before_the_points_is_passed_over(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book, chart = openpyxl.Workbook(), pytest.importorskip("openpyxl.chart").BarChart()
    for row in (["node", "x", "y", "z"], ["A1", 0, 0, 0], ["A2", 1.5, 0, 0]):
        book.active.append(row)
    chart.add_data("Sheet!B2:B3")
    book.create_chartsheet("picture", 0).add_chart(chart)
    book.save(tmp_path / "points.xlsx")
    data = record(tmp_path / "a.csv", "A1:+Z", "A2:+Z")
    assert ms.read(data, geometry=tmp_path / "points.xlsx").geometry.nodes == ("A1", "A2")
    assert geometry_among([data, tmp_path / "points.xlsx"]) == ([data], (tmp_path / "points.xlsx",))


def test_a_fault_of_the_program_is_not_taken_for_a_file_without_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "points.csv").write_text(POINTS)
    data = record(tmp_path / "a.csv", "A1:+Z", "A2:+Z")
    (tmp_path / "b.xlsx").write_bytes(b"no workbook")
    assert geometry_among([data, tmp_path / "b.xlsx"]) == ([data, tmp_path / "b.xlsx"], ())
    monkeypatch.setattr("modalscope.io.geometry.split", lambda *_: {}["fault"])
    with pytest.raises(KeyError, match="fault"):
        geometry_among([data, tmp_path / "points.csv"])


def test_a_mesh_gives_nodes_lines_and_faces(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]]
    meshio.Mesh(points, [("quad", [[0, 1, 2, 3]]), ("line", [[1, 4]])]).write(tmp_path / "a.vtk")
    geometry = ms.read(tmp_path / "a.vtk")
    assert (geometry.lines.tolist(), geometry.faces.tolist()) == ([[1, 4]], [[0, 1, 2, 3]])
    assert ms.read(record(tmp_path / "a.csv", "1:+Z"), geometry=tmp_path / "a.vtk").geometry.nodes[4] == "5"
    (tmp_path / "b.vtk").write_text("nothing")
    refused("damaged or of another kind", ms.read, tmp_path / "b.vtk")


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ("node,a,b,c\nA1,0,0,0\nA2,1,0,0\n", "needs columns x, y, z"),
        ("node,x,y,z\nA1,0,0,0\nA2,1,here,0\n", "needs numbers as coordinates"),
        ("channel,x,y,z,direction\nA1,0,0,0,up\n", "'up' is no direction"),
        ("nothing\n", "it has 0 rows of 1 cells"),
    ],
)
def test_tables_that_are_no_points_are_named(tmp_path: Path, points: str, text: str) -> None:
    (tmp_path / "points.csv").write_text(points)
    refused(text, ms.read, record(tmp_path / "a.csv", "1:+Z"), geometry=tmp_path / "points.csv")


def test_a_geometry_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = record(tmp_path / "a.csv", "1:+Z")
    refused("there is no such file", ms.read, path, geometry=tmp_path / "b.csv")
    refused("no Geometry, path", ms.read, path, geometry=5)
    ms.write(path.with_suffix(".npz"), ms.read(path))
    refused("it holds none", ms.read, path, geometry=path.with_suffix(".npz"))
