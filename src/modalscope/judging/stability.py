"""What is stable from one order to the next: poles whose frequency, damping and shape are those of one before."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from modalscope.identification.cut import Cut
from modalscope.modal.indicators import mac
from modalscope.model.checks import Array, DataError, check_kind, check_positive
from modalscope.model.poles import frequencies_and_damping

__all__ = ["TOLERANCES", "limits_of", "stable_against"]

#: A pole is stable when one of the order before differs by less: relative frequency, relative damping, 1 - MAC.
TOLERANCES = {"frequency": 0.01, "damping": 0.05, "shape": 0.05}


def limits_of(tolerances: Mapping[str, float] | None) -> dict[str, float]:
    """Return the tolerances that were given, the usual ones for all others."""
    given = {} if tolerances is None else tolerances
    check_kind("tolerances", given, Mapping)
    limits = {**TOLERANCES, **{k: check_positive(k, v) for k, v in given.items()}}
    if set(limits) != set(TOLERANCES):
        raise DataError(
            f"tolerances for {', '.join(sorted(map(str, limits)))} were asked",
            f"there are {', '.join(TOLERANCES)}",
            "Correct the names.",
        )
    return limits


def stable_against(before: Cut, after: Cut, limits: Mapping[str, float] = TOLERANCES) -> Array:
    """Return for each pole of `after` whether frequency, damping and shape are those of one pole of `before`, (3, k).

    Parameters
    ----------
    before, after : Cut
    limits : mapping
        Tolerances of stability, all three.
    """
    new, old = after.reported, before.reported
    if not old.size or not new.size:
        return np.zeros((3, new.size), bool)
    f, zeta = frequencies_and_damping(after.modal.poles[new])
    g, eta = frequencies_and_damping(before.modal.poles[old])
    with np.errstate(divide="ignore", invalid="ignore"):
        frequency = np.abs(f[:, None] - g) <= limits["frequency"] * np.minimum(f[:, None], g)
        damping = np.abs(zeta[:, None] - eta) <= limits["damping"] * np.maximum(np.abs(zeta[:, None]), np.abs(eta))
    shape = 1 - mac(after.modal.shapes[:, new], before.modal.shapes[:, old]) <= limits["shape"]
    # damping and shape are compared with the poles of the same frequency only, and the best of them is taken
    score = frequency * (1 + damping + shape + (damping & shape))
    best, rows = np.argmax(score, axis=1), np.arange(new.size)
    return np.stack([frequency[rows, best], (frequency & damping)[rows, best], (frequency & shape)[rows, best]])
