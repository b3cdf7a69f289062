"""Which orders of a stabilization diagram to read: from the first that explains the data, up to where only noise is left."""

from __future__ import annotations

import numpy as np

from modalscope.model.diagram import StabilizationDiagram

__all__ = ["sufficient_order", "usable_orders"]

#: An order explains the data when its fit error is within this factor of the best.
SLACK = 1.2

#: Orders above the sufficient one that are still of use: as many again, and this many at least.
_MORE = 20


def sufficient_order(diagram: StabilizationDiagram) -> int:
    """Return the first order whose fit error is within a fifth of the best."""
    errors = np.asarray(diagram.fit_errors)
    return int(diagram.orders[int(np.argmax(errors <= SLACK * errors.min()))])


def usable_orders(diagram: StabilizationDiagram) -> tuple[tuple[int, ...], float]:
    """Return the orders up to twice (at least 20 above) the sufficient one, and the best fit error among them.

    Beyond there is only noise left to explain.
    """
    enough = sufficient_order(diagram)
    used = np.asarray(diagram.orders) <= max(2 * enough, enough + _MORE)
    orders = tuple(int(n) for n in np.asarray(diagram.orders)[used])
    return orders, float(np.asarray(diagram.fit_errors)[used].min())
