"""Read and write geometry in universal files: nodes, trace lines, elements, coordinate systems."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.data import DataError, Geometry, parse_dof
from modalscope.io.uff.layout import DAMAGED, Field, form, number, one_set, parse, whole
from modalscope.io.uff.scan import Block
from modalscope.numerics.checks import RealArray

_HEAD = tuple(Field(name, 10, "i") for name in ("node", "definition system", "displacement system", "color"))
_XYZ = tuple(Field(axis, 13, "e") for axis in "xyz")
_XYZ_LONG = tuple(Field(axis, 25, "e") for axis in "xyz")
_TRACE = tuple(Field(name, 10, "i") for name in ("trace line", "number of nodes", "color"))
_OF_ELEMENT = ("element", "descriptor", "physical table", "material table", "color", "number of nodes")
_ELEMENT = tuple(Field(name, 10, "i") for name in _OF_ELEMENT)
_SYSTEM = tuple(Field(name, 10, "i") for name in ("system", "type", "color"))
#: Descriptors of rods and beams, which have a record of their own; the type of Cartesian coordinate systems; nodes in a line of a set 82.
_RODS, _CARTESIAN, _NODES_OF_LINE = (11, 21, 22, 23, 24), 0, 8


@dataclass(frozen=True, kw_only=True, slots=True)
class _Node:
    xyz: tuple[float, float, float]
    definition: int
    displacement: int


@dataclass(slots=True)
class Parts:
    """What the geometry sets of a file contain, before it is put together."""

    nodes: dict[int, dict[int, _Node]] = field(default_factory=dict)
    lines: list[tuple[int, int]] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)
    systems: dict[int, tuple[int, RealArray]] = field(default_factory=dict)


def add_block(parts: Parts, block: Block, name: str) -> str:
    """Add one geometry set to the parts, and say what it contains."""
    where = f"{block.name} of {name}"
    try:
        return READERS[block.dataset](parts, block, where)
    except StopIteration:
        raise _short(where) from None


def _short(where: str) -> DataError:
    return DataError(f"{where} needs whole records", "its last one is cut off", DAMAGED)


def _read_nodes(parts: Parts, block: Block, where: str) -> str:
    nodes = parts.nodes.setdefault(block.dataset, {})
    rows = iter(block.records)
    count = 0
    for line in rows:
        head = parse(_HEAD, line, where)
        rest = line[40:] if block.dataset == 15 else next(rows)
        if not rest.strip():
            raise _short(where)
        xyz = parse(_XYZ if block.dataset == 15 else _XYZ_LONG, rest, where)
        place = (xyz["x"], xyz["y"], xyz["z"])
        node = _Node(xyz=place, definition=head["definition system"], displacement=head["displacement system"])
        if nodes.setdefault(head["node"], node) != node:
            fault = f"node {head['node']} occurs twice"
            raise DataError(f"{where} needs one place for each node", fault, "Renumber the nodes.")
        count += 1
    return f"{count} nodes"


def _numbers(line: bytes, where: str) -> list[int]:
    text = line.decode("latin-1").rstrip()
    return [whole(where, "a node", text[k : k + 10]) for k in range(0, len(text), 10)]


def _read_trace(parts: Parts, block: Block, where: str) -> str:
    rows = iter(block.records)
    head = parse(_TRACE, next(rows), where)
    next(rows)  # identification line
    path = [node for line in rows for node in _numbers(line, where)]
    # some programs leave repeated zeros out of the count
    unrepeated = [node for k, node in enumerate(path) if k == 0 or node != path[k - 1]]
    pairs = [(a, b) for a, b in pairwise(path) if a > 0 and b > 0 and a != b]
    parts.lines += pairs
    counted = head["number of nodes"]
    wrong = f"; its header counts {counted} nodes, and {len(path)} are there"
    return f"a trace line of {len(pairs)} lines{wrong * (counted not in (len(path), len(unrepeated)))}"


def _read_elements(parts: Parts, block: Block, where: str) -> str:
    rows = iter(block.records)
    count = 0
    for line in rows:
        head = parse(_ELEMENT, line, where)
        if head["descriptor"] in _RODS:
            next(rows)  # orientation and cross sections of a beam
        nodes: list[int] = []
        while len(nodes) < head["number of nodes"]:
            numbers = _numbers(next(rows), where)
            if not numbers:
                raise _short(where)
            nodes += numbers
        if len(nodes) != head["number of nodes"] or not nodes:
            asked = f"{where} needs {head['number of nodes']} nodes for element {head['element']}"
            raise DataError(asked, f"there are {len(nodes)}", DAMAGED)
        # triangles and quadrilaterals are faces, larger elements the edge around their nodes
        if len(nodes) == 2:
            parts.lines.append((nodes[0], nodes[1]))
        elif len(nodes) in (3, 4):
            parts.faces.append(tuple(nodes))
        elif len(nodes) > 4:
            parts.lines += list(zip(nodes, [*nodes[1:], nodes[0]], strict=True))
        count += 1
    return f"{count} elements"


def _read_systems(parts: Parts, block: Block, where: str) -> str:
    rows = iter(block.records[2:])
    count = 0
    for line in rows:
        head = parse(_SYSTEM, line, where)
        next(rows)  # its name
        rows_of_matrix = (next(rows).decode("latin-1") for _ in range(4))
        matrix = [
            [number(where, "the transformation matrix", r[k : k + 25]) for k in (0, 25, 50)] for r in rows_of_matrix
        ]
        parts.systems[head["system"]] = (head["type"], np.array(matrix))
        count += 1
    return f"{count} coordinate systems"


#: Dataset of a part of the geometry -> what reads it.
READERS: dict[int, Callable[[Parts, Block, str], str]] = {
    **dict.fromkeys((15, 2411), _read_nodes),
    82: _read_trace,
    2412: _read_elements,
    2420: _read_systems,
}


def geometry_of(parts: Parts, labels: Iterable[str] = ()) -> tuple[Geometry | None, list[str]]:
    """Return the geometry of the parts with the motions of the labels, and notes on what is not used.

    Nodes of dataset 2411 (double precision) go before those of 15. Coordinates of a Cartesian definition system are turned
    into global ones, x = R' x_local + t with the rows of R as local axes; a node's displacement system gives the
    directions of its labels.
    """
    notes: list[str] = []
    nodes = parts.nodes.get(2411) or parts.nodes.get(15)
    if not nodes:
        return None, notes
    if len(parts.nodes) > 1:
        notes.append("nodes are given by datasets 15 and 2411; those of 2411 were read")
    curved = [n for n, node in nodes.items() if parts.systems.get(node.definition, (_CARTESIAN, None))[0] != _CARTESIAN]
    if curved:
        return None, [f"geometry not read: nodes {curved[:5]} are given in a cylindrical or spherical system"]
    xyz = np.array([_global(parts, node) for node in nodes.values()])
    lines = [pair for pair in parts.lines if set(pair) <= set(nodes)]
    faces = [face for face in parts.faces if set(face) <= set(nodes)]
    gone = len(parts.lines) - len(lines) + len(parts.faces) - len(faces)
    if gone:
        notes.append(f"{gone} lines or faces were left out: their nodes are missing")
    unique = list(dict.fromkeys(tuple(sorted(pair)) for pair in lines))
    width = max((len(face) for face in faces), default=3)
    even = [[*face, *[face[-1]] * (width - len(face))] for face in faces]
    fields: dict[str, Any] = {"lines": unique or None, "faces": even or None, "motions": _motions(parts, nodes, labels)}
    return Geometry(nodes=tuple(str(n) for n in nodes), coordinates=xyz, **fields), notes


def _global(parts: Parts, node: _Node) -> RealArray:
    _, matrix = parts.systems.get(node.definition, (_CARTESIAN, None))
    local = np.array(node.xyz)
    return local if matrix is None else np.asarray(local @ matrix[:3] + matrix[3])


def _motions(parts: Parts, nodes: dict[int, _Node], labels: Iterable[str]) -> dict[str, Any]:
    motions: dict[str, Any] = {}
    for label in labels:
        dof = parse_dof(label)
        node = nodes.get(int(dof.node)) if dof is not None and dof.node.isdecimal() else None
        if dof is None or dof.vector is None or node is None or node.displacement not in parts.systems:
            continue
        kind, matrix = parts.systems[node.displacement]
        if kind == _CARTESIAN:
            motions[label] = ((dof.node, tuple(float(v) for v in np.array(dof.vector) @ matrix[:3])),)
    return motions


def _numbered(geometry: Geometry) -> list[int]:
    odd = [n for n in geometry.nodes if not (n.isdecimal() and str(int(n)) == n and 0 < int(n) < 10**10)]
    if odd:
        fault = f"its nodes {', '.join(odd[:5])} are not whole numbers"
        raise DataError("writing a geometry to a universal file:", fault, "Number the nodes, or write .npz or .h5.")
    return [int(node) for node in geometry.nodes]


def write_nodes(geometry: Geometry, dataset: int) -> bytes:
    """Return the nodes as dataset 2411 (16 digits) or 15 (6 digits)."""
    lines = []
    for node, xyz in zip(_numbered(geometry), geometry.coordinates, strict=True):
        head, place = form(_HEAD, {"node": node}), dict(zip("xyz", xyz.tolist(), strict=True))
        short = "".join(f"{v:13.5E}" for v in place.values())
        lines += [head + short] if dataset == 15 else [head, form(_XYZ_LONG, place)]
    return one_set(dataset, lines)


def write_lines(geometry: Geometry, dataset: int) -> bytes:
    """Return lines as trace lines (82) or rods (2412); faces are always elements."""
    names = _numbered(geometry)
    lines = [(names[a], names[b]) for a, b in geometry.lines]
    faces = [[names[i] for i in dict.fromkeys(row)] for row in geometry.faces.tolist()]
    traces = range(0, len(lines), 80) if dataset == 82 else ()
    data = b"".join(_trace(k, lines[start : start + 80]) for k, start in enumerate(traces, 1))
    elements = _elements([] if dataset == 82 else lines, faces)
    return data + (one_set(2412, elements) if elements else b"")


def _trace(place: int, pairs: Sequence[tuple[int, int]]) -> bytes:
    path = [node for pair in pairs for node in (*pair, 0)][:-1]
    lines = [form(_TRACE, {"trace line": place, "number of nodes": len(path)}), "NONE".ljust(80)]
    cells = [f"{node:10d}" for node in path]
    lines += ["".join(cells[k : k + _NODES_OF_LINE]) for k in range(0, len(cells), _NODES_OF_LINE)]
    return one_set(82, lines)


def _elements(lines: Sequence[tuple[int, int]], faces: Sequence[Sequence[int]]) -> list[str]:
    rows: list[str] = []
    for place, nodes in enumerate([*lines, *faces], 1):
        descriptor = {2: 11, 3: 41, 4: 44}[len(nodes)]
        head = {"element": place, "descriptor": descriptor, "physical table": 1, "material table": 1}
        rows.append(form(_ELEMENT, head | {"number of nodes": len(nodes)}))
        rows += [f"{0:10d}" * 3] if len(nodes) == 2 else []
        rows.append("".join(f"{node:10d}" for node in nodes))
    return rows
