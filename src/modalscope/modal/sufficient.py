"""Which orders of a stabilization diagram to read: from the first that explains the data, up to where only noise is left."""

from __future__ import annotations

import numpy as np

from modalscope.model.diagram import StabilizationDiagram

__all__ = ["still_falls", "sufficient_order", "usable_orders"]

#: An order explains the data when its fit error is within this factor of the best.
SLACK = 1.2

#: The fit still falls when the last quarter of the orders lowers the error by this part and more than this is unexplained: what
#: noise and models that bend to it lower is less, or of data that are explained.
_FALLS, _UNEXPLAINED = 0.1, 0.15

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


def still_falls(diagram: StabilizationDiagram) -> bool:
    """Return whether the fit error of the last orders falls as if modes were missing yet."""
    orders, errors = np.asarray(diagram.orders), np.asarray(diagram.fit_errors)
    late = orders > 0.75 * orders[-1]
    if late.all():
        return False
    last = errors[late].min()
    return bool(last > _UNEXPLAINED and last < (1 - _FALLS) * errors[~late].min())
