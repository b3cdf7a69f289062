"""Read geometry from tables of points and lines, and folders of such tables.

| a table of points has | it is |
|---|---|
| `node, x, y, z` (by name, in any order), or four bare columns | nodes and their coordinates |
| three bare columns | coordinates of the nodes 1, 2, ... |
| `channel` and `direction` (`+Z`, `x`) besides | the node that moves with a channel, and in which direction |

A table of lines has the names of two nodes a row, or of three or four around a face.

Channels whose names are no names of nodes may still belong to nodes by their number: P1 to P15 beside the nodes 1 to 15.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modalscope.data import DataError, Geometry, parse_dof
from modalscope.data.channels import Channels
from modalscope.data.geometry import Motion
from modalscope.io.columns.vocabulary import parted
from modalscope.io.columns.words import split_head
from modalscope.io.contents import Contents, Options, needs, unreadable
from modalscope.io.limits import room
from modalscope.io.options import MESHES
from modalscope.io.recorders import rows_of_workbook
from modalscope.io.text.cells import Dialect, is_number, number_of, split, uncommented
from modalscope.io.text.dialect import dialect_of, encoding_of, lines_of
from modalscope.numerics.checks import RealArray, check_path

#: Suffixes of tables.
TABLES = (".csv", ".txt", ".asc", ".tsv", ".dat", ".xlsx")

_WORDS = {
    "node": {
        *["node", "nodes", "point", "points", "name", "id", "label", "no", "nr", "number", "knoten", "punkt", "pt"]
    },
    "channel": {*["channel", "sensor", "dof", "kanal", "ch"]},
    "direction": {*["direction", "dir", "axis", "richtung", "orientation"]},
}
#: What may stand behind x, y or z in the name of a column, such as x_mm.
_AFTER_AXIS = {"", "coord", "coordinate", "pos", "position", "m", "mm", "cm", "in", "inch", "inches", "ft"}
#: Rows of a table of points, and characters of a cell, more than any test has; rows that show its columns.
_MAX_POINTS, _MAX_CHARACTERS, _FIRST = 200_000, 200, 200
#: Candidates for the neighbours of a point: the nearest so many.
_CANDIDATES = 12
#: Relative tolerance of equal distances on a measured grid.
_EQUAL_DISTANCE = 1e-3
#: Prefixes that name a point of the structure, not a channel of a recorder.
_POINTS = {"", "p", "n", "node", "point", "pt", "pkt", "punkt", "knoten", "location", "loc", "hit"}
_NUMBERED = re.compile(r"(?P<prefix>[^\W\d_]*)[ _.-]?0*(?P<number>\d{1,9})(?:[ _:]?(?P<direction>[+-]?[xyzXYZ]))?")

Motions = dict[str, list[tuple[str, tuple[float, ...]]]]


def with_geometry(options: Options, load: Callable[[Path], Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return options whose `geometry` is a Geometry, read from its file where a path was given, and notes.

    `options`: `geometry`: a Geometry, a path, or paths of points and lines. `load`: reads a file that is no table.

    Raises `DataError`: a file that is missing, or holds no geometry.
    """
    given = options.get("geometry")
    if given is None or isinstance(given, Geometry):
        return dict(options), ()
    paths = [given] if isinstance(given, str | Path) else list(given) if isinstance(given, list | tuple) else []
    if not 1 <= len(paths) <= 2:
        fault = "it is no Geometry, path, or pair of paths of points and lines"
        remedy = 'Give geometry="points.csv" or geometry=("points.csv", "lines.csv").'
        raise DataError(f"geometry={given!r}:", fault, remedy)
    points, *lines = (check_path(path) for path in paths)
    missing = next((path for path in (points, *lines) if not path.is_file()), None)
    if missing is not None:
        asked = f"the geometry in {missing.name}:"
        raise DataError(asked, "there is no such file", "Check the name and the folder.")
    if points.suffix.lower() in TABLES:
        geometry: Any = geometry_of_tables(points, lines[0] if lines else None)
    else:
        data = load(points)
        geometry = data if isinstance(data, Geometry) else getattr(data, "geometry", None)
    if geometry is None:
        asked = f"a geometry from {points.name}:"
        raise DataError(asked, "it holds none", "Give a table of points: node,x,y,z, or another file.")
    if geometry.lines.size or geometry.faces.size or len(geometry.nodes) < 2:
        return {**options, "geometry": geometry}, ()
    joined = [[geometry.nodes[a], geometry.nodes[b]] for a, b in neighbour_lines(geometry.coordinates)]
    note = f"the geometry has no lines: {len(joined)} were drawn between neighbouring nodes (else: --lines lines.csv)"
    return {**options, "geometry": replace(geometry, lines=joined)}, (note,)


def geometry_among(paths: Sequence[Path]) -> tuple[list[Path], tuple[Path, ...]]:
    """Return the files of data, and those of their geometry: the only mesh or table of named points among others, and its table of lines.

    A table of points has columns of nodes and of x and y by name, a table of lines nothing but names of these nodes.
    """
    points = {path: nodes for path in paths if (nodes := _points_of(path)) is not None}
    if len(points) != 1 or len(paths) < 2:
        return list(paths), ()
    ((first, nodes),) = points.items()
    lines = [path for path in paths if path != first and _joins(path, nodes)]
    chosen = (first, *lines) if len(lines) == 1 else (first,)
    return [path for path in paths if path not in chosen], chosen


def points_table(geometry: Geometry) -> str | None:
    """Return the table of points of a geometry, as `geometry_of_tables` reads it; None where a channel moves along no axis.

    Channels that name their node by themselves stand in no column.
    """
    rows = {node: [f"{v:.9g}" for v in xyz] for node, xyz in zip(geometry.nodes, geometry.coordinates, strict=True)}
    moved = [(label, *motion) for label, motions in geometry.motions.items() for motion in motions]
    if not moved:
        return "\n".join(["node,x,y,z", *(",".join([node, *xyz]) for node, xyz in rows.items())])
    lines = []
    for label, node, vector in moved:
        axis = int(np.argmax(np.abs(vector)))
        if node not in rows or np.count_nonzero(vector) != 1 or abs(vector[axis]) != 1:
            return None
        lines.append(",".join([node, *rows[node], label, f"{'-' if vector[axis] < 0 else '+'}{'XYZ'[axis]}"]))
    if {node for _, node, _ in moved} < set(rows):
        return None  # a node without a channel has no direction
    return "\n".join(["node,x,y,z,channel,direction", *lines])


def _points_of(path: Path) -> set[str] | None:
    """Return the nodes that a table of points names, none of a mesh; None for other files."""
    if path.suffix.lower() in MESHES:
        return set()
    places = _named(_if_table(path, _FIRST)[0])  # a long record is not read to its end for that
    nodes = {row[places["node"]] for row in _if_table(path)[1]} if {"node", "x", "y"} <= set(places) else set()
    return nodes or None


def _joins(path: Path, nodes: set[str]) -> bool:
    """Whether a table has nothing but names of nodes."""
    rows = _if_table(path)[1]
    return bool(rows) and all(cell in nodes for row in rows for cell in row if cell)


def _if_table(path: Path, most: int = _MAX_POINTS) -> tuple[list[str], list[list[str]]]:
    """Return the head and the rows of a table of points or lines; nothing of any other file."""
    if path.suffix.lower() in TABLES:
        with suppress(DataError, OSError):
            return _rows(path, most)[:2]
    return [], []


def with_places(contents: Contents, exact: bool) -> Contents:
    """Return the contents with channels placed by the number of their node, and a note on those that have no place in their geometry.

    `exact`: channels belong only to nodes that they name.
    """
    data = contents.thing
    if not isinstance(data, Channels) or data.geometry is None:
        return contents
    inputs = getattr(data, "input_dofs", None) or ()
    sides = () if exact else (data.output_dofs, inputs)
    motions = {k: v for labels in sides for k, v in placed_by_number(data.geometry, labels).items()}
    placed = data.geometry if not motions else _moved_by(data.geometry, motions)
    if motions:
        data = replace(data, geometry=placed)
        (label, ((node, vector),)), *_ = motions.items()
        axis = "XYZ"[int(np.argmax(np.abs(vector)))]
        text = f"{len(motions)} channels belong to nodes by their number ({label}: node {node}, {'-' if min(vector) < 0 else '+'}{axis})"
        text += "; if that is wrong: --exact-nodes"
        contents = replace(contents, thing=data, notes=(*contents.notes, text))
    points = max(data.output_dofs, inputs, key=len)  # of a roving hammer the inputs
    lost = [label for label in points if not placed.motion_of(label)]
    if not lost:
        return contents
    note = f"{len(lost)} of {len(points)} channels have no node and direction in the geometry: {', '.join(lost[:6])}"
    note += "; name channels as 3:+Z, or add columns channel and direction to the table of points"
    return replace(contents, notes=(*contents.notes, note))


def _moved_by(geometry: Geometry, motions: Mapping[str, tuple[Motion, ...]]) -> Geometry:
    """Return a geometry with the motion of further channels."""
    names = np.array(geometry.nodes)
    every = {**geometry.motions, **motions}
    return replace(geometry, lines=names[geometry.lines], faces=names[geometry.faces], motions=every)


def placed_by_number(geometry: Geometry, labels: Sequence[str]) -> dict[str, tuple[Motion, ...]]:
    """Return the motion of the channels without a node whose numbers are those of nodes; none where anything is ambiguous.

    All these channels have one prefix, such as P in P1 to P15, and a node each. Where the prefix is no word for a point they are as many
    as the nodes with numbers: a recorder's channel 3 is often not at node 3. Their direction is that of the label (`P3Z`), of the node in
    the table, or the normal of the plane of all nodes.
    """
    texts = dict(zip(labels, parted(labels)[0], strict=True))
    lost = {label: _numbered(texts[label]) for label in labels if not geometry.motion_of(label)}
    numbered = [(found.number, node) for node in geometry.nodes if (found := _numbered(node)) is not None]
    nodes = dict(numbered)
    channels = {label: found for label, found in lost.items() if found is not None and found.number in nodes}
    prefixes = {found.prefix for found in lost.values() if found is not None}
    points = {found.number for found in channels.values()}
    if len(nodes) < len(numbered) or len(prefixes) != 1 or len(points) < 2 or len(channels) < len(lost):
        return {}
    if prefixes.isdisjoint(_POINTS) and len(points) < len(nodes):
        return {}
    normal = _normal(geometry.coordinates)
    placed: dict[str, tuple[Motion, ...]] = {}
    for label, found in channels.items():
        node = nodes[found.number]
        own = geometry.motions.get(node, ())  # a table gives directions to nodes, too
        vector = _vector_of(found.direction) or (own[0][1] if len(own) == 1 else normal)
        if vector is None:
            return {}
        placed[label] = ((node, vector),)
    return placed


class _Numbered(NamedTuple):
    prefix: str
    number: int
    direction: str


def _numbered(label: str) -> _Numbered | None:
    """Return the parts of a label that is a prefix, a number and perhaps a direction, such as P03 or Point 3 +Z."""
    match = _NUMBERED.fullmatch(label.strip())
    if match is None:
        return None
    return _Numbered(match["prefix"].casefold(), int(match["number"]), match["direction"] or "")


def _vector_of(direction: str) -> tuple[float, float, float] | None:
    dof = parse_dof(f"1:{direction.upper()}")
    return None if dof is None else dof.vector


def _normal(points: RealArray) -> tuple[float, float, float] | None:
    """Return the axis across the plane of all points, z before y before x; None where they fill a volume."""
    flat = np.ptp(points, axis=0) == 0
    return next((tuple(np.eye(3)[k]) for k in (2, 1, 0) if flat[k]), None)


def neighbour_lines(points: RealArray) -> list[tuple[int, int]]:
    """Return the edges (p, q) of the relative neighbourhood graph: no r has max(|p - r|, |q - r|) < |p - q|.

    On a grid these are the sides of its cells, without diagonals; along a beam one point follows the other. The graph connects all
    points whose neighbours are among the 12 nearest.

    `points` (n, 3).

    Notes
    -----
    G. T. Toussaint, Pattern Recognition 12 (1980).

    Examples
    --------
    >>> neighbour_lines(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    [(0, 1), (0, 2), (1, 3), (2, 3)]
    """
    from scipy.spatial import cKDTree

    count = len(points)
    if count < 2:
        return []
    distances, nearest = map(np.asarray, cKDTree(points).query(points, k=min(_CANDIDATES + 1, count)))
    pairs = set()
    for p in range(count):
        for distance, q in zip(distances[p], nearest[p], strict=True):
            if q == p or not distance:
                continue
            closer = nearest[p][(distances[p] < distance * (1 - _EQUAL_DISTANCE)) & (nearest[p] != p)]
            between = np.linalg.norm(points[closer] - points[q], axis=1) < distance * (1 - _EQUAL_DISTANCE)
            if not between.any():
                pairs.add((min(p, int(q)), max(p, int(q))))
    return sorted(pairs)


def geometry_of_tables(points: Path, lines: Path | None = None) -> Geometry:
    """Return the geometry that a table of points, and where given one of lines, describes.

    `points`, `lines`: see the tables at the head of this module.

    Raises `DataError`: unknown columns, cells that are no numbers, missing nodes.
    """
    head, rows, dialect = _rows(points)
    places = _places(points, head, len(rows[0]))
    xyz = [[_number(points, row, places[axis], dialect) for axis in "xyz" if axis in places] for row in rows]
    coordinates = np.array([[*row, *[0.0] * (3 - len(row))] for row in xyz])
    names = [row[places["node"]] for row in rows] if "node" in places else [str(k) for k in range(1, len(rows) + 1)]
    motions = _motions(points, rows, places, names)
    nodes = dict(zip(names, coordinates, strict=True))  # a node that several channels move stands once
    joined: dict[str, Any] = {} if lines is None else _lines_and_faces(lines)
    return Geometry(nodes=tuple(nodes), coordinates=np.array(list(nodes.values())), motions=motions, **joined)  # type: ignore[arg-type]


def _rows(path: Path, most: int = _MAX_POINTS) -> tuple[list[str], list[list[str]], Dialect]:
    """Return the head of a table, empty where it has none, its rows, and how it is written."""
    lines: Iterator[tuple[int, str]]
    if path.suffix.lower() == ".xlsx":
        lines = iter(rows_of_workbook(path))
    else:
        lines = lines_of(path, encoding_of(path), 0, room(path.name, path.stat().st_size))
    texts = [uncommented(line) for _, line in islice(lines, most)]
    dialect = _dialect(path, [text for text, comment in texts if not comment])
    rows = [split(text, dialect) for text, _ in texts]
    width = max((len(row) for row, (_, comment) in zip(rows, texts, strict=True) if not comment), default=0)
    rows = [row for row in rows if len(row) == width]
    headed = bool(rows) and not any(map(is_number, rows[0]))
    body = rows[1:] if headed else rows
    if not body or width < 2 or any(len(cell) > _MAX_CHARACTERS for row in body for cell in row):
        fault = f"it has {len(body)} rows of {width} cells"
        remedy = "Write one node in each row (node, x, y, z), or one line in each row (two nodes)."
        raise unreadable(f"points or lines from {path.name}", fault, remedy)
    return (rows[0] if headed else []), body, dialect


def _dialect(path: Path, texts: Sequence[str]) -> Dialect:
    """Return how a table is written; node names are text, so only the cells that are numbers are examined."""
    delimiter = max(
        ("\t", ";", ",", ""), key=lambda sign: sum(len(split(text, Dialect(delimiter=sign))) > 1 for text in texts)
    )
    cells = (split(text, Dialect(delimiter=delimiter)) for text in texts if text)
    numbers = [delimiter.join(filter(is_number, row)) or "-" for row in cells]
    decimal = dialect_of(path.name, numbers, delimiter or None, None).decimal if delimiter != "," else "."
    return Dialect(delimiter=delimiter, decimal=decimal, quoted=any('"' in text for text in texts))


def _places(path: Path, head: Sequence[str], width: int) -> dict[str, int]:
    """Return the place of each column by its role."""
    bare = {3: "xyz", 4: ("node", "x", "y", "z"), 2: "xy"}.get(width)
    if not head and bare is not None:
        return {name: k for k, name in enumerate(bare)}
    places = _named(head)
    if "x" not in places:
        need, fault = "columns x, y, z (and node)", f"its columns are {', '.join(head[:8]) or width}"
        raise needs(f"points from {path.name}", need, fault, "Name them in the first row: node,x,y,z")
    return places


def _named(head: Sequence[str]) -> dict[str, int]:
    """Return the place of each column whose name says its role."""
    places: dict[str, int] = {}
    for k, cell in enumerate(head):
        name = split_head(cell)[0].strip().lower()
        for role, words in _WORDS.items():
            if name in words:
                places.setdefault(role, k)
        if name[:1] in "xyz" and name[1:].strip("_ ") in _AFTER_AXIS:
            places.setdefault(name[:1], k)
    return places


def _number(path: Path, row: Sequence[str], place: int, dialect: Dialect) -> float:
    try:
        return number_of(row[place], dialect)
    except ValueError:
        fault = f"a row is {[cell[:20] for cell in row[:6]]}"
        raise needs(f"points from {path.name}", "numbers as coordinates", fault, "Correct that row.") from None


def _motions(path: Path, rows: Sequence[Sequence[str]], places: dict[str, int], names: Sequence[str]) -> Motions:
    """Return the motion of each channel that the table names."""
    motions: Motions = {}
    for row, node in zip(rows, names, strict=True) if "direction" in places else ():
        direction = row[places["direction"]]
        vector = _vector_of(direction.strip())
        if vector is None:
            raise unreadable(f"points from {path.name}", f"{direction[:20]!r} is no direction", "Write +X, -Y, z ...")
        channel = row[places["channel"]] if "channel" in places else node
        motions.setdefault(channel, []).append((node, vector))
    return motions


def _lines_and_faces(path: Path) -> dict[str, Any]:
    """Return lines and faces by the names of their nodes."""
    rows = [[cell for cell in row if cell] for row in _rows(path)[1]]
    wrong = next((row for row in rows if not 2 <= len(row) <= 4), None)
    if wrong is not None:
        need, fault = "two nodes in each row for a line, three or four for a face", f"a row is {wrong[:6]}"
        raise needs(f"lines from {path.name}", need, fault, "Leave other columns out.")
    faces = [row for row in rows if len(row) > 2]
    width = max(map(len, faces), default=3)
    whole = [[*row, *[row[-1]] * (width - len(row))] for row in faces]
    return {"lines": [row for row in rows if len(row) == 2] or None, "faces": whole or None}
