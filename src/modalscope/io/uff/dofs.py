"""Labels of channels as nodes, directions and entity names; the codes of quantities."""

from __future__ import annotations

from modalscope.io.uff.layout import DAMAGED
from modalscope.model import DataError, parse_dof

__all__ = [
    "DIRECTIONS",
    "FORCES",
    "QUANTITY_CODES",
    "QUANTITY_OF",
    "code_of_direction",
    "dof_fields",
    "label_from",
    "sort_key",
]

DIRECTIONS = {
    0: "S",
    1: "+X",
    -1: "-X",
    2: "+Y",
    -2: "-Y",
    3: "+Z",
    -3: "-Z",
    4: "+RX",
    -4: "-RX",
    5: "+RY",
    -5: "-RY",
    6: "+RZ",
    -6: "-RZ",
}
_CODES = {name: code for code, name in DIRECTIONS.items()}

#: Specific data types: what an ordinate is.
QUANTITY_OF = {8: "displacement", 11: "velocity", 12: "acceleration"}
QUANTITY_CODES: dict[str | None, int] = {None: 0, **{name: code for code, name in QUANTITY_OF.items()}}
#: Reaction force and excitation force.
FORCES = (9, 13)

_ENTITY = 10


def label_from(where: str, entity: str, node: int, direction: int) -> str:
    """Return the label of a node and a direction; an entity name stands for a node that has no number."""
    if direction not in DIRECTIONS:
        raise DataError(
            f"{where} needs a direction from -6 to 6",
            f"it has {direction}",
            DAMAGED,
        )
    named = entity if entity.upper() != "NONE" else ""
    if node == 0 and named:
        return named if direction == 0 else f"{named}:{DIRECTIONS[direction]}"
    return f"{node}:{DIRECTIONS[direction]}"


def dof_fields(label: str) -> tuple[str, int, int]:
    """Return entity name, node and direction code of a label; `label_from` is the inverse."""
    dof = parse_dof(label)
    node, direction = (label, 0) if dof is None else (dof.node, _CODES.get(dof.direction, 0))
    if dof is not None and node.isdecimal() and int(node) < 10**10 and str(int(node)) == node:
        return "NONE", int(node), direction
    kept = node.isascii() and node.isprintable() and 0 < len(node) <= _ENTITY
    if not kept or label_from("", node, 0, direction) != label:
        raise DataError(
            f"the channel {label!r} was to be written to a universal file",
            f"that has a node number or a name of up to {_ENTITY} ASCII characters",
            "Give labels of node and direction, such as 3:+Z, as output_dofs and input_dofs.",
        )
    return node, 0, direction


def code_of_direction(direction: str) -> int:
    """Return the code of a direction such as +X."""
    return _CODES[direction]


def sort_key(label: str) -> tuple[int, int, str, int, int]:
    """Return a key that sorts labels by node number, then direction; names come last, in their own order."""
    dof = parse_dof(label)
    if dof is None:
        return (1, 0, label, 0, 0)
    code = _CODES.get(dof.direction, 0)
    if dof.node.isdecimal():
        return (0, int(dof.node), "", abs(code), code < 0)
    return (1, 0, dof.node, abs(code), code < 0)
