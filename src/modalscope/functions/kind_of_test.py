"""Tell what kind of test a record is of: by its forces, or by what moves on without any."""

from __future__ import annotations

import numpy as np

from modalscope.functions.damped_tones import decay_of
from modalscope.numerics.checks import Array, RealArray

#: An impact puts this part of its energy into this part of the record.
_IMPACT_ENERGY, _IMPACT_LENGTH = 0.95, 0.05


def kind_of_test(outputs: RealArray, inputs: RealArray | None) -> str:
    """Return "hammer", "shaker", "free decay" or "ambient" of runs (R, N, l) with inputs (R, N, m) or without."""
    if inputs is not None:
        forces = [force for run in inputs for force in run.T if np.any(force)]
        return "hammer" if forces and all(map(is_impact, forces)) else "shaker"
    return "free decay" if all(decay_of(run) is not None for run in outputs) else "ambient"


def is_impact(force: Array) -> bool:
    """Whether a force (N,) has nearly all of its energy in a few samples: 95 % in 5 %."""
    energy = np.sort(np.square(force - np.median(force)))[::-1]
    count = max(1, int(_IMPACT_LENGTH * energy.size))
    total = float(energy.sum())
    return total > 0 and float(energy[:count].sum()) > _IMPACT_ENERGY * total
