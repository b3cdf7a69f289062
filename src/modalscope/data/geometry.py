"""Hold the geometry of a test: nodes, lines, faces, and the degree of freedom that each label names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.shown import Shown
from modalscope.numerics.checks import (
    Array,
    IntArray,
    RealArray,
    check_each,
    check_kind,
    freeze,
    locked,
    real_array,
    stays_locked,
)
from modalscope.numerics.errors import DataError

#: Unit vectors of translations.
_DIRECTIONS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
#: A label of node and direction: a sign before or behind, R for a rotation, S for a scalar.
_LABEL = re.compile(r"^\s*(?P<node>[^:\s]+?)\s*:?\s*(?P<direction>[+-]?R?[XYZ][+-]?|S)\s*$")


class Dof(NamedTuple):
    """A node and a direction (`+X`, `-Z`, `+RY` for a rotation, `S` for a scalar)."""

    node: str
    direction: str

    @property
    def vector(self) -> tuple[float, float, float] | None:
        """Unit vector of a translation; None for rotations and scalars."""
        sign = -1.0 if self.direction.startswith("-") else 1.0
        axis = _DIRECTIONS.get(self.direction.lstrip("+-"))
        return None if axis is None else (sign * axis[0], sign * axis[1], sign * axis[2])

    def __str__(self) -> str:
        return f"{self.node}:{self.direction}"


#: What names a channel: a label, a number, or a pair (node, direction).
DofLike = str | int | Dof | Sequence[object]


class _CheckedLabels(tuple[str, ...]):
    """Labels in canonical form that are known to differ.

    Objects made of an object of a million channels carry its labels; this type says that `check_labels` need not read them again.
    """

    __slots__ = ()


def parse_dof(label: str) -> Dof | None:
    """Read `3:+Z`, `3Z` or `tip:-Y`; None when the label is a plain name.

    Examples
    --------
    >>> parse_dof("12:+Z"), parse_dof("12z"), parse_dof("force")
    (Dof(node='12', direction='+Z'), Dof(node='12', direction='+Z'), None)
    """
    match = _LABEL.match(label.upper() if ":" not in label else label)
    if match is None:
        return None
    node, direction = match["node"], match["direction"]
    if ":" not in label and not node.isdecimal():
        return None
    sign = "-" if "-" in direction else "+"
    bare = direction.strip("+-")
    return Dof(node, "S" if bare == "S" else sign + bare)


def label_of(dof: DofLike) -> str:
    """Return the canonical label of a string, a number or a pair (node, direction)."""
    if isinstance(dof, str):
        parsed = parse_dof(dof)
        return dof.strip() if parsed is None else str(parsed)
    if isinstance(dof, Sequence):
        return label_of(f"{dof[0]}:{dof[1]}") if len(dof) == 2 else ":".join(str(part) for part in dof)
    return str(dof)


def check_labels(name: str, dofs: Iterable[DofLike] | None, count: int, prefix: str) -> tuple[str, ...]:
    """Return `count` different labels: the given ones, or `prefix1`, `prefix2`, ... when there are none."""
    if dofs is None:
        return _CheckedLabels(f"{prefix}{i + 1}" for i in range(count))
    if isinstance(dofs, _CheckedLabels) and len(dofs) == count:
        return dofs
    each = [dofs] if isinstance(dofs, str) else check_each(name, dofs, "labels")
    labels = _CheckedLabels(label_of(dof) for dof in each)
    if len(labels) != count:
        raise DataError(f"{name} needs {count} labels, one per channel", f"{len(labels)} are given", "Give all.")
    repeated = sorted(label for label, times in Counter(labels).items() if times > 1)
    if repeated:
        raise DataError(
            f"{name} needs different labels", f"{', '.join(repeated)} are repeated", "Rename or drop channels."
        )
    return labels


def indices_of(name: str, channels: Iterable[DofLike] | DofLike, labels: Sequence[str]) -> list[int]:
    """Return the positions of channels that are given by label, or by index from zero.

    A whole number that is no index is taken as a label.
    """
    one = isinstance(channels, str | int | Integral | Dof)
    items: list[Any] = [channels] if one else check_each(name, channels, "labels")
    positions = {label: i for i, label in enumerate(labels)}
    indices = []
    for item in items:
        if isinstance(item, Integral) and 0 <= int(item) < len(labels):
            indices.append(int(item))
            continue
        label = label_of(item)
        if label not in positions:
            raise DataError(f"{name} {label!r}:", f"there are only {', '.join(labels)}", "Name one of these.")
        indices.append(positions[label])
    return indices


def references_of(references: Iterable[DofLike] | DofLike | None, outputs: Sequence[str]) -> list[int]:
    """Return the positions of references among the outputs, all of which they are by default; none, or one twice, is a `DataError`."""
    if references is None:
        return list(range(len(outputs)))
    chosen = indices_of("reference", references, outputs)
    if not chosen or len(set(chosen)) < len(chosen):
        have = f"{len(chosen)} are given, {len(set(chosen))} different"
        raise DataError("references needs different outputs, at least one", have, "Name every reference once.")
    return chosen


#: A node, and the direction in which it moves with a channel.
Motion = tuple[str, tuple[float, float, float]]


def _elements(name: str, elements: ArrayLike | None, sizes: tuple[int, ...], nodes: tuple[str, ...]) -> IntArray:
    """Return elements, rows of node names, as rows of indices into the nodes; `sizes`: numbers of nodes that an element may have."""
    array = np.asarray(() if elements is None else elements)
    if array.size == 0:
        return locked(np.zeros((0, sizes[0]), dtype=np.int64))
    if array.ndim != 2 or array.shape[1] not in sizes:
        needs = f"{name} need {' or '.join(map(str, sizes))} nodes per row"
        raise DataError(needs, f"the shape is {array.shape}", "Give one row each.")
    position = {node: i for i, node in enumerate(nodes)}
    if array.dtype.kind in "iu" and not {str(k) for k in array.ravel()} & set(nodes):  # no names: positions
        position |= {str(i): i for i in range(len(nodes))}
    unknown = sorted({str(node) for node in array.ravel()} - set(position))
    if unknown:
        raise DataError(
            f"{name} join nodes", f"there is no node {', '.join(unknown[:5])}", "Add it or drop the element."
        )
    return locked(np.array([[position[str(node)] for node in row] for row in array], dtype=np.int64))


def _motions(motions: Any) -> dict[str, tuple[Motion, ...]]:
    """Return the nodes that every channel moves and their directions, by its label."""
    check_kind("motions of a geometry", motions, Mapping)
    try:
        return {str(label): tuple((str(node), _vector(v)) for node, v in rows) for label, rows in motions.items()}
    except (TypeError, ValueError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            "motions need lists of (node, direction)",
            f"they are none ({error})",
            'Give for instance {"a": [("1", (0, 0, 1))]}.',
        ) from None


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Geometry(Shown):
    """Nodes of a structure, the lines and faces between them, and the motion that each channel measures.

    Parameters
    ----------
    nodes : sequence of str or int, (n,)
        Names of the nodes.
    coordinates : array, (n, 3)
        Their positions, in one unit of length.
    lines : array, (k, 2), optional
        Pairs of node names to join.
    faces : array, (k, 3) or (k, 4), optional
        Node names around each face.
    motions : mapping, optional
        Channel label -> sequence of (node, (dx, dy, dz)): the nodes that move with the channel and in which direction.
        A label made of node and direction, `3:+Z`, needs no entry.

    Examples
    --------
    >>> g = Geometry(nodes=[1, 2], coordinates=[[0, 0, 0], [1, 0, 0]], lines=[[1, 2]])
    >>> g.motion_of("2:-Z")
    (('2', (-0.0, -0.0, -1.0)),)
    """

    nodes: tuple[str, ...]
    coordinates: RealArray
    lines: IntArray = field(default=None)  # type: ignore[arg-type]
    faces: IntArray = field(default=None)  # type: ignore[arg-type]
    motions: Mapping[str, tuple[Motion, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        nodes = tuple(str(node) for node in check_each("nodes", self.nodes, "names"))
        if len(set(nodes)) != len(nodes):
            raise DataError("geometry needs different node names", "some are repeated", "Rename the repeated nodes.")
        xyz = real_array("geometry coordinates", self.coordinates, "(nodes, 3)", 2)
        if xyz.shape != (len(nodes), 3):
            raise DataError(
                f"coordinates needs shape ({len(nodes)}, 3)", f"it has {xyz.shape}", "Give x, y, z of every node."
            )
        freeze(
            self,
            nodes=nodes,
            coordinates=xyz,
            lines=_elements("geometry lines", self.lines, (2,), nodes),
            faces=_elements("geometry faces", self.faces, (3, 4), nodes),
            motions=_motions(self.motions),
        )

    def motion_of(self, label: str) -> tuple[Motion, ...]:
        """Return the (node, direction) pairs that a channel moves; empty when the geometry does not know it.

        Parameters
        ----------
        label : str
            Label of a channel.
        """
        if label in self.motions:
            return self.motions[label]
        dof = parse_dof(label)
        if dof is None or dof.vector is None or dof.node not in self.nodes:
            return ()
        return ((dof.node, dof.vector),)

    def displaced(self, labels: tuple[str, ...], shape: Array) -> Array:
        """Return the displacement of every node for one shape, (nodes, 3), zero where nothing was measured.

        Parameters
        ----------
        labels : tuple of str, (l,)
            Channels of the shape.
        shape : array, (l,)
            One value per channel.
        """
        if np.shape(shape) != (len(labels),):
            raise DataError(f"shape needs {len(labels)} values", f"it has {np.shape(shape)}", "Give one per channel.")
        displacement = np.zeros((len(self.nodes), 3), dtype=np.result_type(np.asarray(shape), float))
        position = {node: i for i, node in enumerate(self.nodes)}
        for label, value in zip(labels, shape, strict=True):
            for node, direction in self.motion_of(label):
                if node in position:
                    displacement[position[node]] += value * np.asarray(direction)
        return displacement


def _vector(direction: ArrayLike) -> tuple[float, float, float]:
    """Return a direction as three numbers; another count raises ValueError."""
    x, y, z = (float(v) for v in np.asarray(direction, dtype=float).ravel())
    return (x, y, z)
