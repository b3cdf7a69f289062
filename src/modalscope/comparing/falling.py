"""Whether the orders that were tried are too low.

The fit error still falls at the largest order of most methods: by 15 % with every two states over the last quarter of the
orders; or by a fifth over that quarter while more than a tenth is left. Or more than 3 % is left, and more singular values
than the largest order has states exceed 2.86 times their median (Gavish and Donoho's threshold for square matrices). And more
orders change the modes that are reported (`modalscope.comparing.further`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modalscope.comparing.causes import Cause
from modalscope.comparing.run import MethodResult
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.robust import noise_threshold

__all__ = ["order_cause"]

_FALLS, _MUCH, _SOME, _STEEP, _SHARE = 0.8, 0.1, 0.03, 0.85, 0.75
_ROUNDING = 1e-9


def order_cause(results: Sequence[MethodResult]) -> Cause | None:
    """Whether the fit error still falls at the largest order, by most of the methods that worked on the data themselves."""
    diagrams = [r.diagram for r in results if r.diagram is not None and r.exact]
    said = [why for d in diagrams if (why := _still_falls(d))]
    if not diagrams or 2 * len(said) <= len(diagrams):
        return None
    return Cause("order too low", max(dict.fromkeys(said), key=said.count))


def _still_falls(diagram: StabilizationDiagram) -> str:
    """Return by which rule the fit error still falls, with its numbers; nothing when it has settled."""
    orders, errors = np.asarray(diagram.orders), np.asarray(diagram.fit_errors)
    below = orders <= _SHARE * orders[-1]
    below = below if below.any() else orders < orders[-1]
    if diagram.exact_rank is not None or errors.min() < _ROUNDING or not below.any():
        return ""
    left, fall = float(errors.min()), float(errors.min() / errors[below].min())
    pairs = max((orders[-1] - orders[below][-1]) / 2, 1.0)
    lead = f"at order {orders[-1]} {100 * left:.2g} % is left to explain"
    if fall ** (1 / pairs) < _STEEP:
        return f"{lead}, and every two states still take {100 * (1 - fall ** (1 / pairs)):.0f} % of it away"
    if left > _MUCH and fall < _FALLS:
        return f"{lead}; the last quarter of the orders still took it to {100 * fall:.0f} % of what it was"
    if left > _SOME and (count := _stand_out(diagram)) > orders[-1]:
        return f"{lead}, and {count} singular values stand out of the noise"
    return ""


def _stand_out(diagram: StabilizationDiagram) -> int:
    """Return how many singular values stand out of the noise."""
    d = diagram.singular_values
    return int(np.count_nonzero(d > noise_threshold(d))) if d.size else 0
