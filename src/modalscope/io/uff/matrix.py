"""Functions as a matrix: one abscissa, one quantity, each pair of dofs once, complete."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from modalscope.io.limits import Room
from modalscope.io.uff.dofs import QUANTITY_OF, sort_key
from modalscope.io.uff.function import Function
from modalscope.model import DataError
from modalscope.model.checks import Array

__all__ = [
    "SAME",
    "Pair",
    "Sorted",
    "axis_words",
    "by_pair",
    "complete_block",
    "largest_group",
    "matrix",
    "same_axis",
    "units",
    "units_in",
]

#: Abscissas agree when they differ by less than this part of a step: text files print few digits.
SAME = 1e-3
#: Subsets of the shorter side are tried one by one up to this many channels.
_EXHAUSTIVE = 12
#: No measurement has more abscissas than this.
_MOST_AXES = 200

#: Units of SI by specific data type.
SI_UNITS = {8: "m", 9: "N", 11: "m/s", 12: "m/s2", 13: "N"}

Pair = tuple[str, str]


@dataclass(slots=True)
class Sorted:
    """The data object's fields, why functions were left (by place), what is missing, and the room that there is."""

    room: Room
    thing: Any = None
    left: dict[int, str] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def same_axis(a: Function, b: Function) -> bool:
    """Whether two functions have the same abscissa."""
    if a.x.size != b.x.size:
        return False
    step = (a.x[-1] - a.x[0]) / max(a.x.size - 1, 1)
    if abs(a.x[-1] - b.x[-1]) > SAME * abs(step):  # the ends tell most of them apart
        return False
    return bool(np.max(np.abs(a.x - b.x)) <= SAME * abs(step))


def axis_words(function: Function) -> str:
    """Return the abscissa in words."""
    return f"{function.x.size} points from {function.x[0]:g} to {function.x[-1]:g}"


def largest_group(
    functions: Sequence[Function], out: Sorted, quantity: str | None, by_quantity: bool
) -> list[Function]:
    """Return the functions on the commonest abscissa (and of one quantity); the first group wins a tie."""
    groups: list[list[Function]] = []
    for function in functions:
        kind = QUANTITY_OF.get(function.quantity)
        for group in groups:
            if same_axis(group[0], function) and (not by_quantity or QUANTITY_OF.get(group[0].quantity) == kind):
                group.append(function)
                break
        else:
            groups.append([function])
            out.room.parts("different abscissas", len(groups), _MOST_AXES)
    wanted = [
        group
        for group in groups
        if by_quantity and quantity is not None and QUANTITY_OF.get(group[0].quantity) == quantity
    ]
    best = max(wanted or groups, key=len)
    for group in groups:
        for function in group if group is not best else ():
            axis = not same_axis(function, best[0])
            kind = QUANTITY_OF.get(function.quantity, "an unknown quantity")
            out.left[function.place] = (
                f"another abscissa, {axis_words(function)}"
                if axis
                else f"{kind} where the others are {QUANTITY_OF.get(best[0].quantity, 'of unknown quantity')}"
            )
    return best


def by_pair(functions: Sequence[Function], out: Sorted, repeated: str | None) -> dict[Pair, Function]:
    """Return functions by output and input; what to do with a pair measured twice is for the caller to choose."""
    pairs: dict[Pair, Function] = {}
    for function in functions:
        key = (function.output, function.input)
        before = pairs.get(key)
        if before is not None and repeated is None:
            raise DataError(
                f"one {function.words} for each pair of dofs was asked",
                f"{key[0]} / {key[1]} was measured in {before.part} and again in {function.part}",
                'Give repeated="first" or repeated="last", or leave one out of the export.',
            )
        if before is None or repeated == "last":
            pairs[key] = function
        lost = before if repeated == "last" else function if before is not None else None
        if lost is not None:
            out.left[lost.place] = (
                f'{key[0]} / {key[1]} was measured more than once and repeated="{repeated}" was asked'
            )
    return pairs


def complete_block(pairs: dict[Pair, Function], out: Sorted) -> tuple[list[str], list[str]]:
    """Return the outputs and inputs of the largest complete matrix (all of them when none is missing)."""
    outputs = sorted({o for o, _ in pairs}, key=sort_key)
    inputs = sorted({i for _, i in pairs}, key=sort_key)
    out.room.square(f"{len(outputs)} outputs and {len(inputs)} inputs", len(outputs) * len(inputs), len(pairs))
    there = np.array([[(o, i) in pairs for i in inputs] for o in outputs])
    if there.all():
        return outputs, inputs
    rows, columns = _largest_block(there)
    kept_out, kept_in = [outputs[k] for k in rows], [inputs[k] for k in columns]
    gone = [f"{outputs[a]} / {inputs[b]}" for a, b in np.argwhere(~there)]
    named = ", ".join(gone[:6]) + (" ..." if len(gone) > 6 else "")
    out.missing.append(f"{len(gone)} of {there.size} pairs of the {len(outputs)} x {len(inputs)} matrix: {named}")
    out.notes.append(f"the largest complete block, {len(kept_out)} outputs x {len(kept_in)} inputs, was taken")
    for (o, i), function in pairs.items():
        if o not in kept_out or i not in kept_in:
            out.left[function.place] = f"{o} / {i} lies outside the largest complete block of outputs and inputs"
    return kept_out, kept_in


def _largest_block(there: Array) -> tuple[list[int], list[int]]:
    """Return rows and columns of the largest block of True.

    Exact when one side has at most twelve; else by dropping the emptiest row or column until nothing is missing.
    """
    if min(there.shape) > _EXHAUSTIVE:
        return _without_gaps(~there)
    wide = there if there.shape[1] <= there.shape[0] else there.T
    best: tuple[int, list[int], list[int]] = (0, [], [])
    for size in range(1, wide.shape[1] + 1):
        for choice in combinations(range(wide.shape[1]), size):
            full = np.flatnonzero(wide[:, choice].all(axis=1))
            if full.size * size >= best[0] and full.size:
                best = (full.size * size, full.tolist(), list(choice))
    return (best[1], best[2]) if wide is there else (best[2], best[1])


def _without_gaps(gaps: Array) -> tuple[list[int], list[int]]:
    """Drop the row or the column with the largest part of gaps until none is left."""
    kept = [np.ones(gaps.shape[0], bool), np.ones(gaps.shape[1], bool)]
    counts = [gaps.sum(axis=1), gaps.sum(axis=0)]
    while counts[0][kept[0]].any():
        part = [np.where(kept[k], counts[k] / kept[1 - k].sum(), -1.0) for k in (0, 1)]
        side = 0 if part[0].max() >= part[1].max() else 1
        worst = int(np.argmax(part[side]))
        kept[side][worst] = False
        counts[1 - side] -= gaps.take(worst, axis=side)
    return np.flatnonzero(kept[0]).tolist(), np.flatnonzero(kept[1]).tolist()


def units(functions: Sequence[Function], si: bool) -> list[str]:
    """Return the units of the ordinates; in a file of SI units those that are not written follow from the data type."""
    return [function.unit or (SI_UNITS.get(function.quantity, "") if si else "") for function in functions]


def units_in(functions: Sequence[Function], si: bool) -> list[str]:
    """Return the units of the denominators, as `units`."""
    return [function.unit_in or (SI_UNITS.get(function.denominator, "") if si else "") for function in functions]


def matrix(pairs: dict[Pair, Function], outputs: Sequence[str], inputs: Sequence[str], si: bool) -> dict[str, Any]:
    """Return values (points, outputs, inputs), labels and units of a complete matrix."""
    values = np.stack([np.stack([pairs[o, i].values for i in inputs], axis=-1) for o in outputs], axis=1)
    pair = (units([pairs[o, inputs[0]] for o in outputs], si), units_in([pairs[outputs[0], i] for i in inputs], si))
    return {"values": values, "output_dofs": tuple(outputs), "input_dofs": tuple(inputs), "units": pair}
