"""Tell whether two rows of the table give the same modes at every order of one data matrix: what one of them costs is then saved."""

from __future__ import annotations

import numpy as np

from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.matrix import Triple
from modalscope.identification.sweep import Sweep
from modalscope.numerics.checks import RealArray

#: Models of one data matrix are the same within this fraction of their largest entry: rounding.
_SAME_MODEL = 1e-12


def same_poles(one: Sweep, other: Sweep) -> bool:
    """Whether sweeps over the same factors have the same poles at every order."""
    return one.orders == other.orders and _same_states(one.largest, other.largest)


def same_modes(one: Sweep, other: Sweep) -> bool:
    """Whether sweeps over the same factors have the same modes, notes and settings at every order."""
    if not same_poles(one, other):
        return False
    ours, theirs = one.pipeline, other.pipeline
    alike = ours.notes == theirs.notes and ours.settings == theirs.settings
    return alike and (full(ours.matrix).fits_states or _same_ends(one.largest, other.largest))


def _same_states(one: Triple, other: Triple) -> bool:
    """Whether a model is another from the same factors in other units of its states, and so at every smaller order.

    States of which the row factor is P d^a are those of P d^(1/2) but for d^(a - 1/2): leading blocks stay leading blocks.
    """
    if one.factors is None or one.factors is not other.factors or (one.rank, one.turned) != (other.rank, other.turned):
        return False
    if any(model.span is not None or len(model.A) != model.rank for model in (one, other)):
        return False
    return _same(_balanced(one, one.A, 1, 1), _balanced(other, other.A, 1, 1))


def _same_ends(one: Triple, other: Triple) -> bool:
    """Whether B and C of models with the same poles are the same, too, in the same units of states."""
    if one.B is None or other.B is None:
        return False
    ends = ((one.B, other.B, 1, 0), (one.C, other.C, 0, 1))
    return all(_same(_balanced(one, a, *sides), _balanced(other, b, *sides)) for a, b, *sides in ends)


def _balanced(model: Triple, values: RealArray, left: int, right: int) -> RealArray:
    """Return an array of states on either side (0 or 1) for those of P d^(1/2)."""
    assert model.factors is not None
    unit = model.factors.d[: model.rank] ** (model.power - 0.5)
    scaled = values * unit[:, None] if left else values
    return np.asarray(scaled / unit if right else scaled)


def _same(one: RealArray, other: RealArray) -> bool:
    return bool(np.all(np.abs(one - other) <= _SAME_MODEL * np.max(np.abs(one), initial=0.0)))
