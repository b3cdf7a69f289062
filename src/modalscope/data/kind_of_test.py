"""Tell what kind of test a record is of: by its forces, or by what moves on without any."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.damped_tones import decays_of
from modalscope.numerics.statistics import NORMAL

#: An impact puts this part of its energy into this part of the record.
_IMPACT_ENERGY, _IMPACT_LENGTH = 0.95, 0.05

#: Standard deviations of a force's noise that no sample of noise reaches, and that those of a pulse exceed.
NOISE_DEVIATIONS, PULSE_DEVIATIONS = 5.0, 15.0


def kind_of_test(outputs: RealArray, inputs: RealArray | None) -> str:
    """Return "hammer", "shaker", "free decay" or "ambient" of runs (R, N, l) with inputs (R, N, m) or without.

    Runs share the kind of most of them, but are a free decay only where all are.
    """
    if inputs is not None:
        runs = [[force for force in run.T if np.any(force != force[0])] for run in inputs]
        return commonest(["hammer" if all(map(is_impact, run)) else "shaker" for run in runs if run], "shaker")
    return "free decay" if decays_of(outputs) is not None else "ambient"


def commonest(kinds: Sequence[str], otherwise: str) -> str:
    """Return the kind that more parts of a test have than any other; without one the kind given."""
    (first, most), *others = Counter(kinds).most_common() or [(otherwise, 0)]
    return otherwise if others and others[0][1] == most else first


def is_impact(force: Array) -> bool:
    """Whether a force (N,) has nearly all of its energy in a few samples: 95 % in 5 %, or what stands out of its noise has.

    In a long record the noise has more energy than a weak hit. Its deviation s is told by the median; what exceeds 5 s must then
    have 95 % of its energy in samples beyond 15 s that have a neighbour above the noise: a filter ahead of the converter makes a hit last
    two samples at least, where a fault may have one.
    """
    size = np.abs(force - np.median(force))
    energy = np.sort(np.square(size))[::-1]
    count = max(1, int(_IMPACT_LENGTH * energy.size))
    total = float(energy.sum())
    if not total or float(energy[:count].sum()) > _IMPACT_ENERGY * total:
        return total > 0
    s = NORMAL * float(np.median(size))
    out = np.pad(size > NOISE_DEVIATIONS * s, 1)
    pulse = (size > PULSE_DEVIATIONS * s) & (out[:-2] | out[2:])
    beyond = float(np.sum(np.square(size[out[1:-1]])))
    within = float(np.sum(np.square(size[pulse])))
    return bool(np.count_nonzero(pulse) <= count and within > _IMPACT_ENERGY * beyond)
