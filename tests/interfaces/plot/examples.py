"""A diagram made by hand from the exact modes of the five-storey chain, so that every count in it is known."""

from __future__ import annotations

from functools import cache

import numpy as np

from modalscope.data import FrequencyResponse, ModalModel, StabilizationDiagram
from modalscope.identification.options import LineOptions
from modalscope.systems import chain5

#: Poles that the diagram has beside those of the chain.
NEW, UNSTABLE, REAL = 3, 1, 2


@cache
def modes() -> ModalModel:
    return chain5().modes()


@cache
def response() -> FrequencyResponse:
    f = np.linspace(0.2, 1.3 * float(modes().frequencies.max()), 240)
    return modes().frequency_response(f)


@cache
def diagram() -> StabilizationDiagram:
    """Orders 2 to 14; mode k enters at order 2 (k + 1), is stable in frequency only at the next, then in all."""
    exact = modes()
    rows = [
        (order, exact.poles[k], k, order > 2 * (k + 1), order > 2 * (k + 2))
        for order in range(2, 15, 2)
        for k in range(len(exact))
        if order >= 2 * (k + 1)
    ]
    rows += [(14, exact.poles[i] * 1.1, i, False, False) for i in range(NEW)]
    rows += [(14, -np.conj(exact.poles[0]) * 1.2, 0, False, False)] * UNSTABLE
    rows += [(12, -3.0 + 0j, 0, False, False)] * REAL
    orders, poles, which, frequency, rest = (np.array(column) for column in zip(*rows, strict=True))
    part = exact.participation
    assert part is not None
    return StabilizationDiagram(
        response=response(),
        method="alternate",
        domain="s",
        orders=tuple(range(2, 15, 2)),
        order_of_pole=orders,
        poles=poles,
        shapes=exact.shapes[:, which],
        participation=part[which],
        stable_frequency=frequency,
        stable_damping=rest,
        stable_shape=rest,
        singular_values=np.logspace(0, -6, 20),
        fit_errors=np.logspace(0, -3, 7),
        tolerances={"frequency": 0.01, "damping": 0.05, "shape": 0.05},
        settings=LineOptions(block_rows=8, band=(0.3, 7.5)),
        notes=("orders 16 to 20 left out: the data matrix has rank 14",),
    )
