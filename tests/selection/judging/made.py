"""Poles and diagrams made by hand, for tests of the rules that judge them.

The structure is always one of two outputs and three inputs, so that no axis can stand for another.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.results import StabilizationDiagram
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.tracking import Poles

#: A step to either side of a threshold: far above rounding, far below what the rule means.
NUDGE = 1e-3


class Pole(NamedTuple):
    """One pole of one order."""

    order: int
    f: float = 10.0
    zeta: float = 0.01
    shape: Sequence[complex] = (1.0, 0.0)
    part: Sequence[complex] = (1.0, 0.0, 0.0)
    own: float = 1.0
    s: complex | None = None

    @property
    def pole(self) -> complex:
        return complex(poles_from(self.f, self.zeta)) if self.s is None else self.s


def poles_of(*made: Pole, orders: Sequence[int] | None = None) -> Poles:
    """Return hand-made poles as tracking takes them; the orders are those that have a pole unless they are given."""
    return Poles(
        tuple(sorted({p.order for p in made})) if orders is None else tuple(orders),
        np.array([p.order for p in made], dtype=int),
        np.array([p.pole for p in made], dtype=complex),
        np.array([p.shape for p in made], dtype=complex),
        np.array([p.part for p in made], dtype=complex),
        np.array([p.own for p in made], dtype=float),
    )


def at_angle(likeness: float) -> tuple[float, float]:
    """Return a shape of length one whose MAC with (1, 0) is this."""
    return float(np.sqrt(likeness)), float(np.sqrt(1 - likeness))


def response_of(
    poles: Sequence[complex], shapes: Sequence[Sequence[complex]], parts: Sequence[Sequence[complex]], **how: Any
) -> ImpulseResponse:
    """Return sum_j 2 Re phi_j exp(s_j k dt) l_j' at 400 samples of 50 Hz, by the plain definition."""
    k = np.arange(how.pop("samples", 400)) / 50.0
    values = sum(
        2 * np.real(np.exp(s * k)[:, None, None] * np.outer(shape, part))
        for s, shape, part in zip(poles, shapes, parts, strict=True)
    )
    return ImpulseResponse(values=values, sampling_rate=50.0, **{"kind": "dirac", **how})


def diagram_of(
    *made: Pole,
    response: ImpulseResponse | FrequencyResponse,
    orders: Sequence[int] | None = None,
    fit_errors: Sequence[float] | None = None,
    **more: Any,
) -> StabilizationDiagram:
    """Return a diagram of hand-made poles; every order fits alike (0.1) unless it is said."""
    flat = poles_of(*made, orders=orders)
    none = np.zeros(len(made), bool)
    return StabilizationDiagram(
        response=response,
        method="era",
        domain="time",
        orders=flat.orders,
        order_of_pole=flat.order,
        poles=flat.pole,
        shapes=flat.shape.T,
        participation=flat.participation,
        stable_frequency=none,
        stable_damping=none,
        stable_shape=none,
        singular_values=np.ones(4),
        fit_errors=np.full(len(flat.orders), 0.1) if fit_errors is None else np.asarray(fit_errors, float),
        **more,
    )
