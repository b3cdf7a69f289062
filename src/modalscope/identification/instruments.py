"""Identify records with unmeasured forces once more, past inputs and outputs as instruments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.record_residual import UNMEASURED
from modalscope.data.results import StabilizationDiagram
from modalscope.numerics.errors import DataError


def by_instruments(found: StabilizationDiagram, again: Callable[..., StabilizationDiagram]) -> StabilizationDiagram:
    """Return the diagram with past inputs and outputs as instruments where `found` shows unmeasured forces, else `found`.

    `again`: computes the diagram of a route, `route="subspace"`.
    """
    doubt = [note for note in found.notes if note.kind == UNMEASURED]
    if not doubt:
        return found
    try:
        other = again(route="subspace")
    except DataError:
        return found.changed(**withheld(found))
    text = "Past inputs and outputs are used as instruments: against unmeasured forces, not against noise on the inputs"
    rest = (note for note in other.notes if note.kind != UNMEASURED)
    return other.changed(notes=(*doubt, Note("route changed", {}, text), *rest), **withheld(other))


def withheld(diagram: StabilizationDiagram) -> dict[str, Any]:
    """Return the field of the diagram without standard deviations of damping, which unmeasured forces bias beyond them."""
    without = diagram.deviations_at(np.zeros(0, dtype=int))[1] is None
    return {} if without else {"damping_ratios_std": np.full(len(diagram.poles), np.nan)}
