"""Read finite element meshes: Gmsh, VTK, Nastran and Abaqus by what is needed here, nodes and the corners of elements; others by meshio.

Files of Gmsh, Nastran and Abaqus number their nodes, and these numbers are the names of the nodes; those of others are numbered from 1 in
the order of the file. A mesh that names further files (`*INCLUDE`, `INPUT=`, `INCLUDE`) is refused: it may be a stranger's.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from modalscope.data import Geometry
from modalscope.io.contents import Contents, Finding, Options, damage_as_error, unreadable
from modalscope.io.foreign import read_apart
from modalscope.io.limits import room
from modalscope.numerics.checks import Array

_Row = TypeVar("_Row")


#: Bytes that a node or a cell of a mesh becomes as names.
_BYTES_OF_NODE = 400
#: Corners of an element, and its edges where it is drawn by them.
_CORNERS = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
_EDGES = {
    "line": ((0, 1),),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "hexahedron": ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
}
_REMEDY = "Export it as .msh (2.2 or 4.1, text), .vtk, .bdf or .inp in one file, or as a table of points."


@dataclass(slots=True)
class Mesh:
    """Nodes by name, and the names of the corners of elements by kind; kinds that are not drawn have no corners."""

    nodes: dict[str, Sequence[float]] = field(default_factory=dict)
    elements: dict[str, list[tuple[str, ...]]] = field(default_factory=dict)

    def node(self, name: str, xyz: Sequence[str] | Sequence[float]) -> None:
        """Add a node; text becomes numbers."""
        if name in self.nodes:
            raise ValueError(f"node {name} is there twice")
        self.nodes[name] = [float(x) for x in xyz]

    def element(self, kind: str, names: Sequence[str], corners: Sequence[int] | None = None) -> None:
        """Add an element by all of its nodes, corners first unless their places are given."""
        places = corners or range(_CORNERS.get(kind, 0))
        self.elements.setdefault(kind, []).append(tuple(names[place] for place in places))

    def geometry(self) -> Geometry:
        """Return the geometry: lines along the edges, faces, and all nodes."""
        lines, faces = [], []
        for kind, cells in self.elements.items():
            if kind in ("triangle", "quad"):
                faces += [(*corners, corners[-1])[:4] for corners in cells]
            lines += [tuple(sorted((c[a], c[b]))) for c in cells for a, b in _EDGES.get(kind, ())]
        return Geometry(
            nodes=tuple(self.nodes),
            coordinates=np.array([[*xyz, 0.0, 0.0][:3] for xyz in self.nodes.values()]),
            lines=list(map(list, dict.fromkeys(lines))) or None,  # type: ignore[arg-type]
            faces=list(map(list, faces)) or None,  # type: ignore[arg-type]
        )


def read_mesh(path: Path, options: Options) -> Contents:
    """Read a mesh; elements of higher order are read by their corners.

    Raises `DataError`: a damaged file, one that names further files, or a form that is read by meshio where that is missing.
    """
    space = room(path.name, path.stat().st_size)
    reader = _READERS.get(path.suffix.lower())
    with damage_as_error(path.name, _REMEDY):
        mesh = None if reader is None else reader(path)
        if mesh is None:
            mesh = _by_meshio(path)
        if not mesh.nodes:
            raise ValueError("it has no nodes")
        space.take("its nodes", _BYTES_OF_NODE * (len(mesh.nodes) + sum(map(len, mesh.elements.values()))))
        geometry = mesh.geometry()
    omitted = [kind for kind in mesh.elements if kind not in _CORNERS]
    findings = [
        Finding(part=kind, what=f"{len(cells)} elements", taken=kind not in omitted)
        for kind, cells in mesh.elements.items()
    ]
    notes = (f"elements that are not drawn: {', '.join(sorted(omitted))}",) if omitted else ()
    return Contents(thing=geometry, found=(Finding(part="nodes", what=f"{len(mesh.nodes)}"), *findings), notes=notes)


def _by_meshio(path: Path) -> Mesh:
    """Return what meshio reads, in a process of its own."""
    answer, arrays = read_apart("meshio", path)
    mesh = Mesh()
    for number, xyz in enumerate(arrays[0].tolist(), 1):
        mesh.node(str(number), xyz)
    names = list(mesh.nodes)
    for kind, cells in zip(answer["kinds"], arrays[1:], strict=True):
        plain = kind.rstrip("0123456789")
        for row in cells.tolist():
            mesh.element(plain if plain in _CORNERS else kind, [names[place] for place in row])
    return mesh


def _rows(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines()


def _outside(path: Path, row: str) -> Exception:
    return unreadable(path.name, f"it names another file: {row.strip()[:80]}", "Export it as one file.")


# ----------------------------------------------------------------------------------------------------------------------- Gmsh

#: Kinds of elements by the number of Gmsh, corners first.
_GMSH = {
    **dict.fromkeys((1, 8, 26, 27, 28), "line"),
    **dict.fromkeys((2, 9, 20, 21, 22, 23, 24, 25), "triangle"),
    **dict.fromkeys((3, 10, 16, 36, 37, 38), "quad"),
    **dict.fromkeys((4, 11, 29, 30, 31), "tetra"),
    **dict.fromkeys((5, 12, 17, 92, 93), "hexahedron"),
    **dict.fromkeys((6, 13, 18), "wedge"),
    **dict.fromkeys((7, 14, 19), "pyramid"),
    15: "vertex",
}


def _gmsh(path: Path) -> Mesh | None:
    """Read layouts 2 and 4.1 as text; None for binary files and other layouts."""
    with path.open("rb") as file:
        head = file.read(80).split()
    if head[:1] != [b"$MeshFormat"] or head[2:3] != [b"0"] or not head[1].startswith((b"2", b"4.1")):
        return None
    sections: dict[str, list[list[str]]] = {}
    rows = iter(_rows(path))
    for row in rows:
        name, section = row.strip(), list[list[str]]()
        if not name.startswith("$"):
            continue
        while (inner := _next(rows).strip()) != f"$End{name[1:]}":
            section += [inner.split()] if inner else []
        if name in sections and name in ("$Nodes", "$Elements"):
            raise ValueError(f"{name} is there twice")
        sections[name] = section
    mesh, nodes, elements = Mesh(), sections["$Nodes"], sections["$Elements"]
    blocks = _gmsh_blocks if head[1].startswith(b"4") else _gmsh_list
    blocks(mesh, nodes, elements)
    if len(mesh.nodes) != int(nodes[0][blocks is _gmsh_blocks]):
        raise ValueError(f"it has {len(mesh.nodes)} nodes, and says {' '.join(nodes[0])}")
    return mesh


def _next(rows: Iterator[_Row]) -> _Row:
    """Return the next row of a file that is whole."""
    for row in rows:
        return row
    raise ValueError("it ends early")


def _gmsh_list(mesh: Mesh, nodes: list[list[str]], elements: list[list[str]]) -> None:
    for name, *xyz in nodes[1:]:
        mesh.node(name, xyz)
    for _, kind, tags, *rest in elements[1:]:
        mesh.element(_GMSH.get(int(kind), f"Gmsh {kind}"), rest[int(tags) :])
    if len(elements) - 1 != int(elements[0][0]):
        raise ValueError(f"it has {len(elements) - 1} elements, and says {elements[0][0]}")


def _gmsh_blocks(mesh: Mesh, nodes: list[list[str]], elements: list[list[str]]) -> None:
    rows, count = iter(nodes[1:]), 0
    for *_, size in rows:
        names = [_next(rows)[0] for _ in range(int(size))]
        for name in names:
            mesh.node(name, _next(rows)[:3])
    rows = iter(elements[1:])
    for _, _, kind, size in rows:
        for _ in range(int(size)):
            mesh.element(_GMSH.get(int(kind), f"Gmsh {kind}"), _next(rows)[1:])
            count += 1
    if count != int(elements[0][1]):
        raise ValueError(f"it has {count} elements, and says {elements[0][1]}")


# ------------------------------------------------------------------------------------------------------------------------ VTK

_VTK = {
    **dict.fromkeys((1, 2), "vertex"),
    **dict.fromkeys((3, 21, 35, 68), "line"),
    4: "polyline",
    **dict.fromkeys((5, 22, 34, 69), "triangle"),
    **dict.fromkeys((9, 23, 28, 70), "quad"),
    **dict.fromkeys((10, 24, 71), "tetra"),
    **dict.fromkeys((12, 25, 29, 72), "hexahedron"),
    **dict.fromkeys((13, 26, 32, 73), "wedge"),
    **dict.fromkeys((14, 27, 74), "pyramid"),
}
_VTK_NUMBERS = {
    "float": "f4",
    "double": "f8",
    "int": "i4",
    "unsigned_int": "u4",
    "long": "i8",
    "vtktypeint64": "i8",
    "vtkidtype": "i8",
}
_POLYDATA = {"VERTICES": "vertex", "LINES": "polyline", "POLYGONS": "polygon", "TRIANGLE_STRIPS": "strip"}


class _Vtk:
    """A cursor in a legacy file: lines, and numbers as text or big-endian."""

    def __init__(self, data: bytes, binary: bool, at: int) -> None:
        self.data, self.binary, self.at = data, binary, at

    def words(self) -> list[str]:
        """Return the words of the next line that has any; none at the end."""
        while self.at < len(self.data):
            end = self.data.find(b"\n", self.at)
            end = len(self.data) if end < 0 else end
            row, self.at = self.data[self.at : end], end + 1
            if row.strip():
                return row.decode("latin-1").split()
        return []

    def numbers(self, count: int, kind: str) -> Array:
        """Return so many numbers."""
        dtype = np.dtype(_VTK_NUMBERS[kind.lower()])
        if not 0 <= count <= len(self.data):
            raise ValueError(f"it says that it has {count} numbers")
        if self.binary:
            found = np.frombuffer(self.data, dtype.newbyteorder(">"), count, self.at)
            self.at += found.nbytes
            return found.astype(dtype.newbyteorder("="))
        texts = self.data[self.at :].split(None, count)
        if len(texts) > count:
            self.at = len(self.data) - len(texts.pop())
        else:
            self.at = len(self.data)
        if len(texts) < count:
            raise ValueError(f"it has {len(texts)} of {count} numbers")
        return np.array(
            [(float if dtype.kind == "f" else int)(text) for text in texts], "f8" if dtype.kind == "f" else dtype
        )

    def section(self, name: str, words: list[str]) -> Any:
        """Return what a section holds: coordinates, kinds of cells, or the nodes of cells."""
        if name == "POINTS":
            return self.numbers(3 * int(words[1]), words[2]).reshape(-1, 3).tolist()
        if name == "CELL_TYPES":
            return self.numbers(int(words[1]), "int").tolist()
        if name != "METADATA":
            return self.cells(int(words[1]), int(words[2]))
        end = self.data.find(b"\n\n", self.at)
        self.at = len(self.data) if end < 0 else end
        return None

    def cells(self, first: int, second: int) -> list[list[int]]:
        """Return the nodes of each cell: from layout 5 with offsets, before it with the number of nodes in front of them."""
        before, words = self.at, [word.upper() for word in self.words()]
        if words[:1] == ["OFFSETS"]:
            offsets = self.numbers(first, words[1])
            flat = self.numbers(second, self.words()[1]).tolist()
            ends = offsets.tolist()
            if not ends or ends[0] != 0 or ends[-1] != second or np.any(np.diff(offsets) < 0):
                raise ValueError("its offsets are none")
            return [flat[a:b] for a, b in pairwise(ends)]
        self.at, cells, k = before, [], 0
        flat = self.numbers(second, "int").tolist()
        while k < second:
            if flat[k] < 0:
                raise ValueError("a cell has no nodes")
            cells.append(flat[k + 1 : k + 1 + flat[k]])
            k += 1 + flat[k]
        if k != second or len(cells) != first:
            raise ValueError(f"it has {len(cells)} cells, and says {first}")
        return cells


def _vtk(path: Path) -> Mesh | None:
    """Read a legacy file of an unstructured grid or of polygons; None for others."""
    data = path.read_bytes()
    title, second, form, *_ = data[:600].split(b"\n", 4)
    if not title.startswith(b"# vtk DataFile") or form.strip() not in (b"ASCII", b"BINARY"):
        return None
    file = _Vtk(data, form.strip() == b"BINARY", len(title) + len(second) + len(form) + 3)
    if file.words()[1:] not in (["UNSTRUCTURED_GRID"], ["POLYDATA"]):
        return None
    sections: dict[str, Any] = {}
    while (words := file.words()) and words[0].upper() not in ("POINT_DATA", "CELL_DATA"):
        name = words[0].upper()
        if name in sections:
            raise ValueError(f"{name[:20]} is there twice")
        if name not in ("POINTS", "CELLS", "CELL_TYPES", "METADATA", *_POLYDATA):
            return None
        sections[name] = file.section(name, words)
    kinds = [_VTK.get(kind, f"VTK {kind}") for kind in sections.get("CELL_TYPES", ())]
    cells = list(sections.get("CELLS", ()))
    for name in set(_POLYDATA) & set(sections):
        kinds, cells = kinds + [_POLYDATA[name]] * len(sections[name]), cells + sections[name]
    mesh = Mesh()
    for number, xyz in enumerate(sections["POINTS"], 1):
        mesh.node(str(number), xyz)
    names = list(mesh.nodes)
    for kind, cell in zip(kinds, cells, strict=True):
        if min(cell, default=-1) < 0:
            raise ValueError("a cell has no nodes")
        _vtk_cell(mesh, kind, [names[k] for k in cell])
    return mesh


def _vtk_cell(mesh: Mesh, kind: str, names: list[str]) -> None:
    """Add a cell; a line of several nodes is several lines, a polygon of three or four nodes a face."""
    if kind == "polyline":
        for pair in pairwise(names):
            mesh.element("line", pair)
    else:
        mesh.element({3: "triangle", 4: "quad"}.get(len(names), kind) if kind == "polygon" else kind, names)


# -------------------------------------------------------------------------------------------------------------------- Nastran

#: Card -> kind, and the fields of its corners, counted from the name of the card.
_NASTRAN = {
    **dict.fromkeys(("CBAR", "CBEAM", "CROD", "CTUBE", "CBUSH", "CBEND"), ("line", 3)),
    **dict.fromkeys(("CONROD", "PLOTEL"), ("line", 2)),
    **dict.fromkeys(("CTRIA3", "CTRIA6", "CTRIAR"), ("triangle", 3)),
    **dict.fromkeys(("CQUAD4", "CQUAD8", "CQUADR", "CQUAD", "CSHEAR"), ("quad", 3)),
    "CTETRA": ("tetra", 3),
    "CPYRAM": ("pyramid", 3),
    "CPENTA": ("wedge", 3),
    "CHEXA": ("hexahedron", 3),
}
_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def _nastran(path: Path) -> Mesh:
    """Read the grid points and elements of a bulk data file: free fields, fields of 8 and of 16 columns."""
    rows = _rows(path)
    begin = next((k for k, row in enumerate(rows) if re.match(r"\s*BEGIN\s+BULK", row, re.IGNORECASE)), -1)
    mesh = Mesh()
    for row in rows:
        if re.match(r"\s*INCLUDE\b", row, re.IGNORECASE):
            raise _outside(path, row)
    for card in _cards(rows[begin + 1 :]):
        name = card[0].rstrip("*").upper()
        if name == "GRID":
            if card[2] not in ("", "0"):
                fault = f"node {card[1]} lies in coordinate system {card[2]}"
                raise unreadable(path.name, fault, "Export it with all nodes in the basic system.")
            mesh.node(card[1], [_EXPONENT.sub(r"e\1", x.upper().replace("D", "E")) or "0" for x in card[3:6]])
        elif name in _NASTRAN:
            kind, first = _NASTRAN[name]
            corners = card[first : first + _CORNERS[kind]]
            if all(corners) and len(corners) == _CORNERS[kind]:  # a spring to the ground has one
                mesh.element(kind, corners)
    return mesh


def _cards(rows: Sequence[str]) -> Iterator[list[str]]:
    """Give the fields of each card, with those of the lines that continue it; at least nine."""
    card: list[str] = []
    for row in rows:
        text = row.split("$")[0].rstrip()
        if not text or text.upper().startswith("ENDDATA"):
            continue
        if "," in text:
            fields = [cell.strip() for cell in text.split(",")]
            fields = fields[:9] if len(fields) > 9 else fields
        else:
            text = text.expandtabs(8)
            width = 16 if "*" in text[:8] else 8
            fields = [text[:8].strip(), *(text[k : k + width].strip() for k in range(8, min(len(text), 72), width))]
        continues = not fields[0] or fields[0][0] in "+*"
        if continues and card:
            card += [""] * (_field_count(card) - len(card)) + fields[1:]
        else:
            if card:
                yield card + [""] * (9 - len(card))
            card = fields
    if card:
        yield card + [""] * (9 - len(card))


def _field_count(card: Sequence[str]) -> int:
    """Return how many fields a card has when its last line is full: lines of 16 columns have four, others eight."""
    step = 4 if card[0].endswith("*") else 8
    return 1 + step * max(-(-(len(card) - 1) // step), 1)


# --------------------------------------------------------------------------------------------------------------------- Abaqus

#: Type of element -> kind; the middle node of a beam of three stands between its ends.
_ABAQUS = (
    (r"(B|T|CONN|RB|PIPE)[23]D?[1-3][A-Z]*|(SPRING|DASHPOT)[2A]", "line"),
    (r"(S|CPS|CPE|CAX|M3D|R3D|DS|DC2D|DCAX)(3|6)[A-Z]*|STRI(3|65)", "triangle"),
    (r"(S|CPS|CPE|CAX|M3D|R3D|DS|DC2D|DCAX)(4|8|9)[A-Z0-9]*", "quad"),
    (r"(C3D|DC3D)(4|10)[A-Z]*", "tetra"),
    (r"(C3D|DC3D)5[A-Z]*", "pyramid"),
    (r"(C3D|DC3D|SC)(6|15)[A-Z]*", "wedge"),
    (r"(C3D|DC3D|SC)(8|20|27)[A-Z]*", "hexahedron"),
)


def _abaqus(path: Path) -> Mesh:
    """Read the nodes and elements of an input file of one part."""
    mesh, keyword, kind, row = Mesh(), "", "", ""
    for line in _rows(path):
        if line.startswith("**") or not line.strip():
            continue
        if line.lstrip().startswith("*"):
            if row:
                raise ValueError("an element has no end")
            keyword, _, rest = line.strip().upper().partition(",")
            given = {key.strip(): value.strip() for key, _, value in (each.partition("=") for each in rest.split(","))}
            if keyword == "*INCLUDE" or "INPUT" in given:
                raise _outside(path, line)
            if keyword == "*SYSTEM":
                raise unreadable(
                    path.name, "its nodes lie in a system of their own", "Export them in the global system."
                )
            if keyword == "*ELEMENT":
                kind = _abaqus_kind(given["TYPE"])
        elif keyword == "*NODE":
            name, *xyz = (cell.strip() for cell in line.split(","))
            mesh.node(name, [x or "0" for x in xyz[:3]])
        elif keyword == "*ELEMENT":
            row += line.strip()
            if not row.endswith(","):
                names = [cell.strip() for cell in row.split(",")][1:]
                mesh.element(kind, names, (0, len(names) - 1) if kind == "line" and len(names) > 1 else None)
                row = ""
    return mesh


def _abaqus_kind(name: str) -> str:
    return next((kind for pattern, kind in _ABAQUS if re.fullmatch(pattern, name)), name[:20])


_READERS: dict[str, Callable[[Path], Mesh | None]] = {
    ".msh": _gmsh,
    ".vtk": _vtk,
    ".inp": _abaqus,
    **dict.fromkeys((".bdf", ".nas", ".fem"), _nastran),
}
