"""Meshes are read by what is needed of them, as meshio reads them, and whatever is damaged in one is said."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.extras import meshes
from modalscope.io import apart
from tests.support import refused

POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.5]]
QUAD_AND_LINE = ([["2", "5"]], [["1", "2", "3", "4"]])

GMSH_2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
1 1 "edge"
$EndPhysicalNames
$Nodes
5
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 2 0 0.5
$EndNodes
$Elements
2
1 3 2 0 1 1 2 3 4
2 1 2 1 1 2 5
$EndElements
"""
GMSH_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
2 5 1 5
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
0 1 0 1
5
2 0 0.5
$EndNodes
$Elements
2 2 1 2
2 1 3 1
1 1 2 3 4
1 1 1 1
2 2 5
$EndElements
"""
VTK_3 = """# vtk DataFile Version 3.0
ASCII in the title
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 5 float
0 0 0 1 0 0 1 1 0
0 1 0 2 0 0.5
CELLS 2 8
4 0 1 2 3
2 1 4
CELL_TYPES 2
9
3
POINT_DATA 5
SCALARS a float 1
LOOKUP_TABLE default
1 2 3 4 5
"""
VTK_5 = """# vtk DataFile Version 5.1
title
ASCII
DATASET POLYDATA
POINTS 5 double
0 0 0 1 0 0 1 1 0 0 1 0 2 0 0.5
METADATA
INFORMATION 0

LINES 2 2
OFFSETS vtktypeint64
0 2
CONNECTIVITY vtktypeint64
1 4
POLYGONS 2 4
OFFSETS vtktypeint64
0 4
CONNECTIVITY vtktypeint64
0 1 2 3
"""
NASTRAN = """SOL 103
CEND
BEGIN BULK
$ a comment
GRID,1,,0.,0.,0.
GRID           2              1.      0.      0.
GRID*                  3                1.000000000E+00 1.000000000E+00
*       0.000000000E+00
GRID,4,,0.,1.
GRID           5              2.      0.    5.-1
CQUAD4         1       1       1       2       3       4
CBAR,2,1,2,5,0.,0.,1.
CELAS2,9,1.,1,1
ENDDATA
"""
ABAQUS = """*HEADING
 a plate
** a comment
*NODE
1, 0., 0., 0.
2, 1., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 2., 0., .5
*ELEMENT, TYPE=S4R, ELSET=PLATE
1, 1, 2,
3, 4
*Element, type=B31
2, 2, 5
*NSET, NSET=ALL
1, 2
"""
FILES = {"2.msh": GMSH_2, "4.msh": GMSH_4, "3.vtk": VTK_3, "5.vtk": VTK_5, "a.bdf": NASTRAN, "a.inp": ABAQUS}


def written(folder: Path, name: str, text: str | None = None) -> Path:
    path = folder / name
    path.write_text(FILES[name] if text is None else text)
    return path


@pytest.mark.parametrize("name", FILES)
def test_nodes_lines_and_faces_are_read(tmp_path: Path, name: str) -> None:
    geometry = ms.read(written(tmp_path, name))
    assert geometry.nodes == ("1", "2", "3", "4", "5")
    np.testing.assert_array_equal(geometry.coordinates, POINTS)
    names = np.array(geometry.nodes)
    assert (names[geometry.lines].tolist(), names[geometry.faces].tolist()) == QUAD_AND_LINE


def test_nodes_keep_their_numbers(tmp_path: Path) -> None:
    text = NASTRAN.replace("GRID,1,", "GRID,101,").replace("       1       1       1  ", "       1       1     101  ")
    assert ms.read(written(tmp_path, "a.bdf", text)).nodes == ("101", "2", "3", "4", "5")


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("suffix", [".msh", ".vtk", ".bdf", ".inp", ".vtu", ".ply", ".stl", ".obj"])
def test_what_meshio_writes_is_read_as_meshio_reads_it(tmp_path: Path, suffix: str, binary: bool) -> None:
    meshio = pytest.importorskip("meshio")
    cells = [("triangle", [[0, 1, 2], [0, 2, 3]])]
    solids = [("tetra", [[0, 1, 2, 4]]), ("line", [[1, 4]]), ("quad", [[0, 1, 2, 3]])]
    cells += solids if suffix in (".msh", ".vtk", ".bdf", ".inp", ".vtu") else []
    form = {"binary": binary} if suffix in (".msh", ".vtk", ".vtu", ".ply", ".stl") else {}
    kind = {"file_format": "gmsh22"} if suffix == ".msh" else {}
    meshio.Mesh(np.array(POINTS, float), cells).write(tmp_path / f"a{suffix}", **kind, **form)
    ours, theirs = (
        meshes.read_mesh(tmp_path / f"a{suffix}", {}).thing,
        meshes._by_meshio(tmp_path / f"a{suffix}").geometry(),
    )
    assert ours.nodes == theirs.nodes
    np.testing.assert_allclose(ours.coordinates, theirs.coordinates)
    assert sorted(map(tuple, ours.lines.tolist())) == sorted(map(tuple, theirs.lines.tolist()))
    assert sorted(map(tuple, ours.faces.tolist())) == sorted(map(tuple, theirs.faces.tolist()))


ELEMENTS = {
    "CTETRA,1,1,1,2,3,5": 6,
    "CPYRAM,1,1,1,2,3,4,5": 8,
    "CHEXA,1,1,1,2,3,4,5,6,+\n+,7,8": 12,
    "CPENTA         1       1       1       2       3       4       5       6": 9,
    "PLOTEL,1,1,2": 1,
}


@pytest.mark.parametrize("card", ELEMENTS)
def test_solids_are_drawn_by_their_edges(tmp_path: Path, card: str) -> None:
    grid = "".join(f"GRID,{k},,{k}.,{k * k}.,{k % 3}.\n" for k in range(1, 9))
    assert len(ms.read(written(tmp_path, "a.bdf", grid + card + "\n")).lines) == ELEMENTS[card]


TYPES = {
    "B31": (2, "line"),
    "T3D2": (2, "line"),
    "B32": (3, "line"),
    "S3R": (3, "triangle"),
    "STRI65": (6, "triangle"),
    "CPS4R": (4, "quad"),
    "S8R5": (8, "quad"),
    "C3D4": (4, "tetra"),
    "C3D10M": (10, "tetra"),
    "C3D8R": (8, "hexahedron"),
    "SC8R": (8, "hexahedron"),
    "SC6R": (6, "wedge"),
    "C3D5": (5, "pyramid"),
    "MASS": (1, "MASS"),
}


@pytest.mark.parametrize("name", TYPES)
def test_types_of_abaqus_are_known(tmp_path: Path, name: str) -> None:
    count, kind = TYPES[name]
    nodes = "*NODE\n" + "".join(f"{k}, {k}, {k * k}, {k % 3}\n" for k in range(1, count + 1))
    path = written(tmp_path, "a.inp", f"{nodes}*ELEMENT, TYPE={name}\n1, {', '.join(map(str, range(1, count + 1)))}\n")
    survey = ms.io.survey(path)
    assert [(finding.part, finding.taken) for finding in survey.found] == [("nodes", True), (kind, kind != "MASS")]
    if name == "B32":
        assert survey.thing.lines.tolist() == [[0, 2]]


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("a.inp", "*INCLUDE, INPUT=secret.txt"),
        ("a.inp", " *Include,input=secret.txt"),
        ("a.inp", "*NODE, INPUT=secret.txt"),
        ("a.inp", "*ELEMENT, TYPE=B31, INPUT=secret.txt"),
        ("a.bdf", "INCLUDE 'secret.txt'"),
        ("a.bdf", "  include secret.txt"),
    ],
)
def test_a_mesh_that_names_another_file_is_refused_and_the_other_not_opened(
    tmp_path: Path, name: str, line: str
) -> None:
    (tmp_path / "secret.txt").write_text("7, 1, 2, 3\n")
    path = written(tmp_path, name, f"{FILES[name].rsplit('ENDDATA', 1)[0]}{line}\n")
    opened: list[str] = []
    sys.addaudithook(lambda event, given: opened.append(str(given[0])) if event == "open" else None)
    refused("names another file", ms.read, path)
    assert any("a." in each for each in opened)
    assert not any("secret" in each for each in opened)


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("2.msh", "$EndElements\n", "", "ends early"),
        ("2.msh", "\n5\n1 0 0 0", "\n6\n1 0 0 0", "has 5 nodes, and says 6"),
        ("2.msh", "2\n1 3 2", "3\n1 3 2", "has 2 elements, and says 3"),
        ("4.msh", "2 5 1 5", "2 6 1 6", "has 5 nodes"),
        ("4.msh", "0 1 0 1\n5", "0 1 0 99999999999\n5", "ends early|could not"),
        ("2.msh", "5 2 0 0.5", "4 2 0 0.5", "node 4 is there twice"),
        ("3.vtk", "CELLS 2 8", "CELLS 2 9", "CELL_TYPES"),
        ("3.vtk", "POINTS 5", "POINTS 5000000000", "says that it has 15000000000 numbers"),
        ("3.vtk", "4 0 1 2 3", "4 0 1 2 -3", "no nodes"),
        ("5.vtk", "\n0 4\n", "\n4 0\n", "offsets are none"),
        ("a.bdf", "GRID,4,,0.,1.", "GRID,4,7,0.,1.", "lies in coordinate system 7"),
        ("a.bdf", "GRID,4,,0.,1.", "GRID,4,,here,1.", "could not convert"),
        ("a.inp", "3, 4\n", "3, 4,\n", "an element has no end"),
        ("a.inp", "*NODE\n1", "*SYSTEM\n1,2,3\n*NODE\n1", "system of their own"),
        ("a.inp", "2, 2, 5", "2, 2, 6", "6"),
    ],
)
def test_what_is_not_whole_is_refused(tmp_path: Path, name: str, old: str, new: str, words: str) -> None:
    assert old in FILES[name]
    refused(words, ms.read, written(tmp_path, name, FILES[name].replace(old, new)))


def test_a_file_cut_anywhere_is_read_as_far_as_it_is_whole_or_refused(tmp_path: Path) -> None:
    for name in ("2.msh", "4.msh", "3.vtk", "5.vtk"):
        for k in range(0, len(FILES[name]) - 60, 7):
            if name == "3.vtk" and k >= FILES[name].index("POINT_DATA"):
                continue  # what comes after is not read
            try:
                geometry = ms.read(written(tmp_path, f"cut-{name}", FILES[name][:k] + " "))
            except ms.DataError:
                continue
            assert name.endswith("vtk"), (name, k)
            assert len(geometry.nodes) == 5


@pytest.fixture
def foreign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a folder in which a package called meshio can be put."""
    (tmp_path / "meshio").mkdir()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "meshio", raising=False)
    monkeypatch.setitem(apart.LIMITS, "meshio", ((1, 10**9), (3, 10**9), 1))
    (tmp_path / "a.stl").write_text("solid")
    yield tmp_path
    sys.modules.pop("meshio", None)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the system does not bound processes")
@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("while True: pass", "does not end|did not end"),
        ("import time; time.sleep(60)", "did not end within 3 s"),
        ("x = b'x' * 10**12", "MemoryError"),
        ("import os; os._exit(3)", "status 3"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "status -11"),
        ("import zlib; raise zlib.error('bad')", "error: bad"),
        ("raise SystemError('odd')", "SystemError: odd"),
        ("import sys; print('noise'); sys.exit('not for you')", "SystemExit: not for you"),
    ],
)
def test_a_package_that_fails_in_any_way_is_an_error_of_the_file(
    foreign: Path, program: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (foreign / "meshio" / "__init__.py").write_text(f"def read(path):\n    {program}\n")
    refused(words, ms.read, foreign / "a.stl")
    assert capfd.readouterr() == ("", "")


def test_output_of_a_package_does_not_mix_with_what_it_read(foreign: Path, capfd: pytest.CaptureFixture[str]) -> None:
    mesh = "type('Mesh', (), {'points': [[0, 0, 0], [1, 0, 0]], 'cells': []})"
    (foreign / "meshio" / "__init__.py").write_text(f"def read(path):\n    print('{{')\n    return {mesh}\n")
    assert ms.read(foreign / "a.stl").nodes == ("1", "2")
    assert capfd.readouterr() == ("", "")


def test_inside_of_another_program_the_package_is_run_here(foreign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/opt/matlab/bin/glnxa64/MATLAB")
    mesh = "type('Mesh', (), {'points': [[0, 0, 0], [1, 0, 0]], 'cells': []})"
    (foreign / "meshio" / "__init__.py").write_text(f"def read(path):\n    return {mesh}\n")
    assert ms.read(foreign / "a.stl").nodes == ("1", "2")
    (foreign / "meshio" / "__init__.py").write_text("def read(path):\n    raise SystemError('odd')\n")
    sys.modules.pop("meshio")
    refused("SystemError: odd", ms.read, foreign / "a.stl")
