"""Deviations of modes that were found at several orders."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note
from modalscope.uncertainty.noise import KIND

__all__ = ["SPLIT", "typical_deviation", "withheld"]

#: Members whose deviation is above so many times that of the smallest quarter are split, or of an order that fits badly.
SPLIT = 2.0


def typical_deviation(values: RealArray) -> float:
    """Return the median of the deviations that are not large beside the smallest; NaN where none is known.

    Where a mode splits in two at an order, the deviation of each part is, rightly, many times that of the whole.

    Examples
    --------
    >>> typical_deviation(np.array([1.0, 1.1, 1.2, 40.0]))
    1.1
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return float("nan")
    return float(np.median(known[known <= SPLIT * np.quantile(known, 0.25)]))


def withheld(modes: ModalModel) -> tuple[Note, ...]:
    """Return a note that names the modes without a deviation of frequency or damping; none where all have theirs."""
    notes = []
    for what, values in (("frequency", modes.frequencies_std), ("damping ratio", modes.damping_ratios_std)):
        if values is None or not np.any(np.isnan(values)) or not len(modes):
            continue
        names = ", ".join(f"{f:.5g}" for f in modes.frequencies[np.isnan(values)])
        count = float(np.count_nonzero(np.isnan(values)))
        notes.append(Note(KIND, {"withheld": count}, f"no deviation of the {what} is given at {names} Hz"))
    return tuple(notes)
