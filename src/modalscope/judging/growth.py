"""Orders that grow until the fit no longer falls, and what is said where they end first."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from modalscope.modal.sufficient import still_falls
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.notes import Note

__all__ = ["ORDERS_END", "grown"]

#: The kind of notes that say that the orders end too soon.
ORDERS_END = "orders end"

#: Orders that are tried by default are doubled so many times at most, and are every second one up to this.
_DOUBLED, _FINE = 2, 100


def grown(found: StabilizationDiagram, again: Callable[[Iterable[int]], StabilizationDiagram]) -> StabilizationDiagram:
    """Return the diagram of twice the orders while the fit error falls as if modes were missing, and say so where that ends first.

    Parameters
    ----------
    found : StabilizationDiagram
        At the orders that are tried by default.
    again : callable
        Makes the diagram of other orders.
    """
    if found.response.ambient or not found.response.separable:
        return found
    for _ in range(_DOUBLED):
        if not still_falls(found):
            return found
        top = 2 * found.orders[-1]
        room = found.response.room
        if room is not None and top > room:
            break
        step = 2 if top <= _FINE else 4
        found = again(range(step, top + 1, step))
        text = f"orders grew to {top}: the fit error still fell at {top // 2}"
        found = replace(found, notes=(*found.notes, Note("orders grew", {"largest": top}, text)))
    if still_falls(found):
        last = found.orders[-1]
        text = (
            f"the fit error still falls at order {last}, so that modes may be missing: give orders, or bands one by one"
        )
        found = replace(found, notes=(*found.notes, Note(ORDERS_END, {"largest": last}, text)))
    return found
