"""Read geometry from tables of points and lines, universal files and finite element meshes.

| a table of points has | it is |
|---|---|
| `node, x, y, z` (by name, in any order), or four bare columns | nodes and their places |
| three bare columns | places of the nodes 1, 2, ... |
| `channel` and `direction` (`+Z`, `x`) beside these | the node that moves with a channel, and in which direction |

A table of lines has the names of two nodes a row, or of three or four around a face.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import DataError, Geometry, parse_dof
from modalscope.data.channels import Channels
from modalscope.io.columns.words import split_head
from modalscope.io.contents import Contents, Options
from modalscope.io.excel import rows_of
from modalscope.io.limits import room
from modalscope.io.text.cells import Dialect, is_number, number_of, split, uncommented
from modalscope.io.text.dialect import dialect_of, encoding_of, lines_of
from modalscope.numerics.checks import RealArray, check_path

# ---------------------------------------------------------------------------------------------------------- neighbours
# Lines between neighbouring points, where nobody drew any.

#: So many nearest points of each may be its neighbours.
_NEAREST = 12
#: Distances of a measured grid are equal within this part.
_EQUAL = 1e-3


def neighbour_lines(points: RealArray) -> list[tuple[int, int]]:
    """Return the pairs (p, q) between which no point lies: there is no r with max(|p - r|, |q - r|) < |p - q|.

    On a grid these are its meshes, without diagonals; along a beam one point follows the other. Every set of points hangs together by
    them, as far as the twelve nearest of each reach.

    `points` (n, 3).

    Notes
    -----
    The relative neighbourhood graph of G. T. Toussaint, Pattern Recognition 12 (1980).

    Examples
    --------
    >>> neighbour_lines(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    [(0, 1), (0, 2), (1, 3), (2, 3)]
    """
    from scipy.spatial import cKDTree

    count = len(points)
    if count < 2:
        return []
    found = cKDTree(points).query(points, k=min(_NEAREST + 1, count))
    distances, nearest = np.asarray(found[0]), np.asarray(found[1])
    pairs = set()
    for p in range(count):
        for distance, q in zip(distances[p], nearest[p], strict=True):
            if q == p or not distance:
                continue
            closer = nearest[p][(distances[p] < distance * (1 - _EQUAL)) & (nearest[p] != p)]
            between = np.linalg.norm(points[closer] - points[q], axis=1) < distance * (1 - _EQUAL)
            if not between.any():
                pairs.add((min(p, int(q)), max(p, int(q))))
    return sorted(pairs)


# -------------------------------------------------------------------------------------------------------------- points

#: Suffixes of tables.
TABLES = (".csv", ".txt", ".asc", ".tsv", ".dat", ".xlsx")

_NODES = {"node", "nodes", "point", "points", "name", "id", "label", "no", "nr", "number", "knoten", "punkt", "pt"}
_CHANNELS = {"channel", "sensor", "dof", "kanal", "ch"}
_DIRECTIONS = {"direction", "dir", "axis", "richtung", "orientation"}
#: Nobody measures so many points.
_MOST = 200_000
_LONGEST = 200


def geometry_of_tables(points: Path, lines: Path | None = None) -> Geometry:
    """Return the geometry that a table of points, and where given one of lines, describes.

    `points`, `lines`: see the tables at the head of this module.

    Raises `DataError`: columns that are not known, cells that are no numbers, nodes that are not there.
    """
    head, rows, dialect = _rows(points)
    places = _places(points, head, len(rows[0]))
    xyz = [[_number(points, row, places[axis], dialect) for axis in "xyz" if axis in places] for row in rows]
    coordinates = np.array([[*row, *[0.0] * (3 - len(row))] for row in xyz])
    names = [row[places["node"]] for row in rows] if "node" in places else [str(k) for k in range(1, len(rows) + 1)]
    motions = _motions(points, rows, places, names)
    nodes = dict(zip(names, coordinates, strict=True))  # a node that several channels move stands there once
    joined: dict[str, Any] = {} if lines is None else _joined(lines)
    return Geometry(nodes=tuple(nodes), coordinates=np.array(list(nodes.values())), motions=motions, **joined)  # type: ignore[arg-type]


def _rows(path: Path) -> tuple[list[str], list[list[str]], Dialect]:
    """Return the head of a table, empty where it has none, its rows, and how it is written."""
    if path.suffix.lower() == ".xlsx":
        lines = iter(rows_of(path))
    else:
        lines = lines_of(path, encoding_of(path), 0, room(path.name, path.stat().st_size))
    texts = [uncommented(line) for _, line in islice(lines, _MOST)]
    dialect = _dialect(path, [text for text, comment in texts if not comment])
    rows = [split(text, dialect) for text, _ in texts]
    width = max((len(row) for row, (_, comment) in zip(rows, texts, strict=True) if not comment), default=0)
    rows = [row for row in rows if len(row) == width]
    headed = bool(rows) and not any(map(is_number, rows[0]))
    body = rows[1:] if headed else rows
    if not body or width < 2 or any(len(cell) > _LONGEST for row in body for cell in row):
        raise DataError(
            f"reading points or lines from {path.name} was asked",
            f"it has {len(body)} rows of {width} cells",
            "Write one row a node (node, x, y, z) or a line (two nodes).",
        )
    return (rows[0] if headed else []), body, dialect


def _dialect(path: Path, texts: Sequence[str]) -> Dialect:
    """Return how a table is written; names of nodes are text, so that the cells of one row in three need be numbers alone."""
    parted = max(
        ("\t", ";", ",", ""), key=lambda sign: sum(len(split(text, Dialect(delimiter=sign))) > 1 for text in texts)
    )
    bare = [
        parted.join(cell for cell in split(text, Dialect(delimiter=parted)) if is_number(cell)) or "-"
        for text in texts
        if text
    ]
    sign = dialect_of(path.name, bare, parted or None, None).decimal if parted != "," else "."
    return Dialect(delimiter=parted, decimal=sign, quoted=any('"' in text for text in texts))


def _places(path: Path, head: Sequence[str], width: int) -> dict[str, int]:
    """Return which column is what."""
    if not head:
        bare = {3: "xyz", 4: ("node", "x", "y", "z"), 2: "xy"}.get(width)
        if bare is not None:
            return {name: k for k, name in enumerate(bare)}
    known: dict[str, int] = {}
    for k, cell in enumerate(head):
        name = split_head(cell)[0].strip().lower()
        for role, words in (("node", _NODES), ("channel", _CHANNELS), ("direction", _DIRECTIONS)):
            if name in words:
                known.setdefault(role, k)
        if name[:1] in "xyz" and name[1:].strip("_ ") in ("", "coord", "coordinate", "pos", "mm", "m", "cm"):
            known.setdefault(name[:1], k)
    if "x" not in known:
        raise DataError(
            f"reading points from {path.name} needs columns x, y, z (and node)",
            f"its columns are {', '.join(head[:8]) or width}",
            "Name them in the first row: node,x,y,z",
        )
    return known


def _number(path: Path, row: Sequence[str], place: int, dialect: Dialect) -> float:
    try:
        return number_of(row[place], dialect)
    except ValueError:
        raise DataError(
            f"reading points from {path.name} needs numbers as coordinates",
            f"a row is {[cell[:20] for cell in row[:6]]}",
            "Correct that row.",
        ) from None


def _motions(
    path: Path, rows: Sequence[Sequence[str]], places: dict[str, int], names: Sequence[str]
) -> dict[str, list[tuple[str, tuple[float, float, float]]]]:
    """Return the motion of each channel that the table names."""
    if "direction" not in places:
        return {}
    motions: dict[str, list[tuple[str, tuple[float, float, float]]]] = {}
    for row, node in zip(rows, names, strict=True):
        dof = parse_dof(f"1:{row[places['direction']].strip().upper()}")
        if dof is None or dof.vector is None:
            raise DataError(
                f"reading points from {path.name} was asked",
                f"{row[places['direction']][:20]!r} is no direction",
                "Write +X, -Y, z ...",
            )
        channel = row[places["channel"]] if "channel" in places else node
        motions.setdefault(channel, []).append((node, dof.vector))
    return motions


def _joined(path: Path) -> dict[str, Any]:
    """Return lines and faces by the names of their nodes."""
    _, rows, _ = _rows(path)
    named = [[cell for cell in row if cell] for row in rows]
    wrong = next((row for row in named if not 2 <= len(row) <= 4), None)
    if wrong is not None:
        raise DataError(
            f"reading lines from {path.name} needs two nodes a row, or three or four around a face",
            f"a row is {wrong[:6]}",
            "Leave other columns out.",
        )
    faces = [row for row in named if len(row) > 2]
    width = max(map(len, faces), default=3)
    return {
        "lines": [row for row in named if len(row) == 2] or None,
        "faces": [[*row, *[row[-1]] * (width - len(row))] for row in faces] or None,
    }


def joined_by_neighbours(geometry: Geometry) -> tuple[Geometry, tuple[str, ...]]:
    """Return a geometry with lines: its own, or else those between neighbours, with a note."""
    if geometry.lines.size or geometry.faces.size or len(geometry.nodes) < 2:
        return geometry, ()
    pairs = neighbour_lines(geometry.coordinates)
    lines = [[geometry.nodes[a], geometry.nodes[b]] for a, b in pairs]
    note = f"the geometry has no lines: {len(lines)} were drawn between neighbouring nodes (else: --lines lines.csv)"
    return replace(geometry, lines=lines), (note,)  # type: ignore[arg-type]


# ----------------------------------------------------------------------------------------------------- geometry option
# The option `geometry` of every format: a Geometry, or the file or files that hold one.


def with_geometry(options: Options, load: Callable[[Path], Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return options with the geometry itself where a file was named, and what to say of it.

    `options`: `geometry`: a Geometry, a path, or paths of points and lines. `load`: reads a file that is no table.

    Raises `DataError`: A file that is not there, or holds no geometry.
    """
    given = options.get("geometry")
    if given is None or isinstance(given, Geometry):
        return dict(options), ()
    paths = [given] if isinstance(given, str | Path) else list(given) if isinstance(given, list | tuple) else []
    if not 1 <= len(paths) <= 2:
        raise DataError(
            f"geometry={given!r} was asked",
            "it is no Geometry, path, or pair of paths of points and lines",
            'Give geometry="points.csv" or geometry=("points.csv", "lines.csv").',
        )
    points, *lines = (check_path(path) for path in paths)
    missing = next((path for path in (points, *lines) if not path.is_file()), None)
    if missing is not None:
        raise DataError(
            f"the geometry in {missing.name} was asked", "there is no such file", "Check the name and the folder."
        )
    if points.suffix.lower() in TABLES:
        found: Any = geometry_of_tables(points, lines[0] if lines else None)
    else:
        found = load(points)
        found = found if isinstance(found, Geometry) else getattr(found, "geometry", None)
    if found is None:
        raise DataError(
            f"a geometry from {points.name} was asked",
            "it holds none",
            "Give a table of points: node,x,y,z, or another file.",
        )
    geometry, notes = joined_by_neighbours(found)
    return {**options, "geometry": geometry}, notes


def told_of_channels(contents: Contents) -> Contents:
    """Return contents that say which channels have no place in the geometry.

    `contents`: of data with their geometry.
    """
    thing = contents.thing
    if not isinstance(thing, Channels) or thing.geometry is None:
        return contents
    lost = [label for label in thing.output_dofs if not thing.geometry.motion_of(label)]
    if not lost:
        return contents
    note = (
        f"{len(lost)} of {len(thing.output_dofs)} channels have no node and direction in the geometry: {', '.join(lost[:6])}; "
        "name channels as 3:+Z, or add columns channel and direction to the table of points"
    )
    return replace(contents, notes=(*contents.notes, note))
