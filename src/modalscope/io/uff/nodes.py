"""Read and write geometry in universal files: nodes, trace lines, elements, coordinate systems."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.data import DataError, Geometry, parse_dof
from modalscope.io.uff.layout import DAMAGED, Field, form, number, one_set, parse, whole
from modalscope.io.uff.scan import Block
from modalscope.numerics.checks import RealArray

_HEAD = (
    Field("node", 10, "i"),
    Field("definition system", 10, "i"),
    Field("displacement system", 10, "i"),
    Field("color", 10, "i"),
)
_XYZ = (Field("x", 13, "e"), Field("y", 13, "e"), Field("z", 13, "e"))
_XYZ_LONG = (Field("x", 25, "e"), Field("y", 25, "e"), Field("z", 25, "e"))
_TRACE = (Field("trace line", 10, "i"), Field("number of nodes", 10, "i"), Field("color", 10, "i"))
_ELEMENT = (
    Field("element", 10, "i"), Field("descriptor", 10, "i"), Field("physical table", 10, "i"), Field("material table", 10, "i"),
    Field("color", 10, "i"), Field("number of nodes", 10, "i"),
)  # fmt: skip
_SYSTEM = (Field("system", 10, "i"), Field("type", 10, "i"), Field("color", 10, "i"))

_RODS = (11, 21, 22, 23, 24)
_CARTESIAN = 0
_A_LINE = 8


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


# ------------------------------------------------------------------------------------------------------------- reading


def add_block(parts: Parts, block: Block, name: str) -> str:
    """Add one geometry set to the parts, and say what it contains."""
    where = f"{block.name} of {name}"
    try:
        if block.dataset in (15, 2411):
            return _read_nodes(parts, block, where)
        if block.dataset == 82:
            return _read_trace(parts, block, where)
        if block.dataset == 2412:
            return _read_elements(parts, block, where)
        return _read_systems(parts, block, where)
    except StopIteration:
        raise _short(where) from None


def _short(where: str) -> DataError:
    return DataError(f"{where} needs whole records", "its last one is cut off", DAMAGED)


def _read_nodes(parts: Parts, block: Block, where: str) -> str:
    found = parts.nodes.setdefault(block.dataset, {})
    rows = iter(block.records)
    count = 0
    for line in rows:
        head = parse(_HEAD, line, where)
        rest = line[40:] if block.dataset == 15 else next(rows)
        if len(rest.strip().split()) < 1:
            raise _short(where)
        place = parse(_XYZ if block.dataset == 15 else _XYZ_LONG, rest, where)
        node = _Node(
            xyz=(place["x"], place["y"], place["z"]),
            definition=head["definition system"],
            displacement=head["displacement system"],
        )
        if found.setdefault(head["node"], node) != node:
            fault = f"node {head['node']} stands there twice"
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
    if len(path) != head["number of nodes"]:
        found = f"it holds {len(path)}"
        # some programs leave repeated zeros out of the count
        if len([n for k, n in enumerate(path) if k == 0 or n != path[k - 1]]) != head["number of nodes"]:
            raise DataError(f"{where} needs the {head['number of nodes']} nodes of its header", found, DAMAGED)
    pairs = [(a, b) for a, b in pairwise(path) if a > 0 and b > 0 and a != b]
    parts.lines += pairs
    return f"a trace line of {len(pairs)} lines"


def _read_elements(parts: Parts, block: Block, where: str) -> str:
    rows = iter(block.records)
    count = 0
    for line in rows:
        head = parse(_ELEMENT, line, where)
        if head["descriptor"] in _RODS:
            next(rows)  # orientation and cross sections of a beam
        nodes: list[int] = []
        while len(nodes) < head["number of nodes"]:
            more = _numbers(next(rows), where)
            if not more:
                raise _short(where)
            nodes += more
        if len(nodes) != head["number of nodes"] or not nodes:
            asked = f"{where} needs {head['number of nodes']} nodes for element {head['element']}"
            raise DataError(asked, f"there are {len(nodes)}", DAMAGED)
        _add_element(parts, nodes)
        count += 1
    return f"{count} elements"


def _add_element(parts: Parts, nodes: list[int]) -> None:
    """Keep rods as lines and triangles and quadrilaterals as faces; larger elements by the edge around their nodes."""
    if len(nodes) == 2:
        parts.lines.append((nodes[0], nodes[1]))
    elif len(nodes) in (3, 4):
        parts.faces.append(tuple(nodes))
    elif len(nodes) > 4:
        parts.lines += list(zip(nodes, [*nodes[1:], nodes[0]], strict=True))


def _read_systems(parts: Parts, block: Block, where: str) -> str:
    rows = iter(block.records[2:])
    count = 0
    for line in rows:
        head = parse(_SYSTEM, line, where)
        next(rows)  # its name
        matrix = [[number(where, "the transformation matrix", text) for text in _columns(next(rows))] for _ in range(4)]
        parts.systems[head["system"]] = (head["type"], np.array(matrix))
        count += 1
    return f"{count} coordinate systems"


def _columns(line: bytes) -> list[str]:
    text = line.decode("latin-1")
    return [text[k : k + 25] for k in (0, 25, 50)]


# ---------------------------------------------------------------------------------------------------- putting together


def geometry_of(parts: Parts, labels: Iterable[str] = ()) -> tuple[Geometry | None, list[str]]:
    """Return the geometry of the parts with the motions of the labels, and notes on what was left out.

    Nodes of dataset 2411 (double precision) go before those of 15. Coordinates of a Cartesian definition system are turned
    into global ones, x = R' x_local + t with the rows of R as local axes; a node's displacement system gives the
    directions of its labels.
    """
    notes: list[str] = []
    if not parts.nodes:
        return None, notes
    dataset = 2411 if parts.nodes.get(2411) else min(parts.nodes)
    nodes = parts.nodes[dataset]
    if not nodes:
        return None, notes
    if len(parts.nodes) > 1:
        notes.append("nodes stand there as datasets 15 and 2411; those of 2411 were taken")
    curved = [n for n, node in nodes.items() if parts.systems.get(node.definition, (_CARTESIAN, None))[0] != _CARTESIAN]
    if curved:
        return None, [f"the geometry was left: nodes {curved[:5]} are given in a cylindrical or spherical system"]
    xyz = np.array([_global(parts, node) for node in nodes.values()])
    lines = [pair for pair in parts.lines if set(pair) <= set(nodes)]
    faces = [face for face in parts.faces if set(face) <= set(nodes)]
    gone = len(parts.lines) - len(lines) + len(parts.faces) - len(faces)
    if gone:
        notes.append(f"{gone} lines or faces were left out: they join nodes that are not there")
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


# ------------------------------------------------------------------------------------------------------------- writing


def _numbered(geometry: Geometry) -> list[int]:
    odd = [
        node for node in geometry.nodes if not (node.isdecimal() and str(int(node)) == node and 0 < int(node) < 10**10)
    ]
    if odd:
        fault = f"its nodes {', '.join(odd[:5])} are not whole numbers"
        remedy = "Number the nodes, or write .npz or .h5."
        raise DataError("a geometry was to be written to a universal file", fault, remedy)
    return [int(node) for node in geometry.nodes]


def write_nodes(geometry: Geometry, dataset: int) -> bytes:
    """Return the nodes as dataset 2411 (16 digits) or 15 (6 digits)."""
    lines = []
    for node, xyz in zip(_numbered(geometry), geometry.coordinates, strict=True):
        head = form(_HEAD, {"node": node})
        place = dict(zip("xyz", (float(v) for v in xyz), strict=True))
        lines += (
            [head + "".join(f"{v:13.5E}" for v in place.values())] if dataset == 15 else [head, form(_XYZ_LONG, place)]
        )
    return one_set(dataset, lines)


def write_lines(geometry: Geometry, dataset: int) -> bytes:
    """Return lines as trace lines (82) or rods (2412); faces are always elements."""
    names = _numbered(geometry)
    lines = [(names[a], names[b]) for a, b in geometry.lines]
    faces = [[names[i] for i in dict.fromkeys(row)] for row in geometry.faces.tolist()]
    data = (
        b"".join(_trace(k, lines[start : start + 80]) for k, start in enumerate(range(0, len(lines), 80), 1))
        if dataset == 82
        else b""
    )
    elements = _elements([] if dataset == 82 else lines, faces)
    return data + (one_set(2412, elements) if elements else b"")


def _trace(place: int, pairs: Sequence[tuple[int, int]]) -> bytes:
    path = [node for pair in pairs for node in (*pair, 0)][:-1]
    lines = [form(_TRACE, {"trace line": place, "number of nodes": len(path)}), "NONE".ljust(80)]
    lines += ["".join(f"{node:10d}" for node in path[k : k + _A_LINE]) for k in range(0, len(path), _A_LINE)]
    return one_set(82, lines)


def _elements(lines: Sequence[tuple[int, int]], faces: Sequence[Sequence[int]]) -> list[str]:
    rows: list[str] = []
    for place, nodes in enumerate([*lines, *faces], 1):
        descriptor = {2: 11, 3: 41, 4: 44}[len(nodes)]
        rows.append(
            form(
                _ELEMENT,
                {
                    "element": place,
                    "descriptor": descriptor,
                    "physical table": 1,
                    "material table": 1,
                    "number of nodes": len(nodes),
                },
            )
        )
        rows += ["".join(f"{0:10d}" for _ in range(3))] if len(nodes) == 2 else []
        rows.append("".join(f"{node:10d}" for node in nodes))
    return rows
