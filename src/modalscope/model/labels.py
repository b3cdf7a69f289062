"""Degrees of freedom: labels made of a node and a direction, such as `3:+Z`, and how channels are chosen by them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import Any, NamedTuple

from modalscope.model.checks import DataError, check_each

__all__ = ["Dof", "DofLike", "check_labels", "indices_of", "label_of", "parse_dof"]

_DIRECTIONS = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
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


DofLike = str | int | Dof | Sequence[object]


class _Checked(tuple[str, ...]):
    """Labels that were read and found different: what is made of data of a million channels does not read them again."""

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
        return _Checked(f"{prefix}{i + 1}" for i in range(count))
    if isinstance(dofs, _Checked) and len(dofs) == count:
        return dofs
    labels = _Checked(label_of(dof) for dof in ([dofs] if isinstance(dofs, str) else check_each(name, dofs, "labels")))
    if len(labels) != count:
        raise DataError(
            f"{name} needs {count} labels, one a channel", f"{len(labels)} are given", "Give one label a channel."
        )
    twice = sorted(label for label, times in Counter(labels).items() if times > 1)
    if twice:
        raise DataError(
            f"{name} needs different labels",
            f"{', '.join(twice)} stand there more than once",
            "Rename the channels, or leave out the repeated ones.",
        )
    return labels


def indices_of(name: str, wanted: Iterable[DofLike] | DofLike, labels: Sequence[str]) -> list[int]:
    """Return the positions of channels given by label, or by index when they are whole numbers."""
    items: list[Any] = (
        [wanted] if isinstance(wanted, str | int | Integral | Dof) else check_each(name, wanted, "labels")
    )
    positions = {label: i for i, label in enumerate(labels)}
    found = []
    for item in items:
        if isinstance(item, Integral) and 0 <= int(item) < len(labels):
            found.append(int(item))
            continue
        label = label_of(item)
        if label not in positions:
            raise DataError(
                f"{name} {label!r} was asked", f"there are only {', '.join(labels)}", "Name one of these channels."
            )
        found.append(positions[label])
    return found
