"""Read finite element meshes as geometry through meshio (an extra): nodes, beams, shells, edges of solids."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, Geometry
from modalscope.io.contents import Contents, Finding, Options
from modalscope.io.limits import room
from modalscope.numerics.extras import optional_package

#: Suffixes of meshes.
MESHES = (".msh", ".vtk", ".vtu", ".inp", ".bdf", ".nas", ".fem", ".med", ".stl", ".obj", ".ply")

_DAMAGED = (
    ValueError, KeyError, TypeError, IndexError, AttributeError, OSError, EOFError, RuntimeError, MemoryError, AssertionError, SyntaxError,
    SystemExit, OverflowError,
)  # fmt: skip
_EDGES = {
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "hexahedron": ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
}
#: Bytes that a node or a cell becomes as names.
_EACH = 400


def read(path: Path, options: Options) -> Contents:
    """Read a mesh; nodes are numbered from 1 in the order of the file, elements of higher order are taken by their corners.

    Raises `DataError`: meshio is missing, or the file is none that it reads.
    """
    package = optional_package(f"reading a mesh ({path.suffix})", "meshio", "mesh")
    space = room(path.name, path.stat().st_size)
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            mesh = package.read(path)
        points = np.asarray(mesh.points, float)
        space.take("its nodes", _EACH * (len(points) + sum(len(block.data) for block in mesh.cells)))
        geometry, left = _geometry(mesh, np.pad(points, ((0, 0), (0, 3 - points.shape[1]))))
    except (*_DAMAGED, package.ReadError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"reading {path.name} as a mesh was asked",
            f"meshio does not read it ({type(error).__name__}: {str(error)[:100]})",
            "Export it as .msh, .vtk, .bdf or .inp, or as a table of points.",
        ) from None
    notes = (f"elements that are not drawn were left: {', '.join(sorted(left))}",) if left else ()
    parts = [
        Finding(part=str(block.type), what=f"{len(block.data)} elements", taken=str(block.type) not in left)
        for block in mesh.cells
    ]
    return Contents(thing=geometry, findings=(Finding(part="nodes", what=f"{len(points)}"), *parts), notes=notes)


def _geometry(mesh: Any, points: Any) -> tuple[Geometry, set[str]]:
    lines: list[tuple[int, int]] = []
    faces: list[list[int]] = []
    left: set[str] = set()
    for block in mesh.cells:
        kind = str(block.type).rstrip("0123456789")
        rows = np.asarray(block.data, int)
        if kind == "line":
            lines += [(int(a), int(b)) for a, b in rows[:, :2]]
        elif kind in ("triangle", "quad"):
            corners = rows[:, : 3 if kind == "triangle" else 4]
            faces += [[*map(int, row), *([int(row[-1])] if kind == "triangle" else [])] for row in corners]
        elif kind in _EDGES:
            lines += [(int(row[a]), int(row[b])) for row in rows for a, b in _EDGES[kind]]
        elif kind != "vertex":
            left.add(str(block.type))
    unique = list(dict.fromkeys((min(pair), max(pair)) for pair in lines))
    names = [str(k) for k in range(1, len(points) + 1)]
    return Geometry(
        nodes=tuple(names),
        coordinates=points,
        lines=[[names[a], names[b]] for a, b in unique] or None,  # type: ignore[arg-type]
        faces=[[names[k] for k in face] for face in faces] or None,  # type: ignore[arg-type]
    ), left
