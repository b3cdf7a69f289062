"""Intervals that a frequency or a damping ratio lies in with a given probability."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri, stdtrit

from modalscope.model.checks import DataError, RealArray, check_number

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["intervals"]


def intervals(modes: ModalModel, level: float) -> dict[str, RealArray]:
    """Return value -+ z sigma of frequencies and damping ratios, each (n, 2) (see `ModalModel.interval`)."""
    probability = check_number("level", level)
    if not 0 < probability < 1:
        raise DataError("a level between 0 and 1 was asked", f"it is {probability:g}", "Give 0.95 for 95 %.")
    z = _quantile(modes, (1 + probability) / 2)
    found: dict[str, RealArray] = {}
    for name, values, noise, between in (
        ("frequency", modes.frequencies, modes.frequencies_std, modes.frequencies_repeatability),
        ("damping_ratio", modes.damping_ratios, modes.damping_ratios_std, modes.damping_ratios_repeatability),
    ):
        known = [sigma for sigma in (noise, between) if sigma is not None]
        if known:
            half = z * np.maximum.reduce(known)
            found[name] = np.column_stack([values - half, values + half])
    if not found:
        raise DataError(
            f"intervals at {100 * probability:g} % were asked",
            "no standard deviation of these modes is known: neither from the noise nor between groups",
            "Give frequencies_std and damping_ratios_std, or their repeatability between groups.",
        )
    unknown = np.full((len(modes), 2), np.nan)
    return {name: found.get(name, unknown) for name in ("frequency", "damping_ratio")}


def _quantile(modes: ModalModel, probability: float) -> float:
    """Return the normal quantile; Student's where the deviations were estimated from few parts of a record, as their note says."""
    degrees = [note.numbers["degrees_of_freedom"] for note in modes.notes if "degrees_of_freedom" in note.numbers]
    return float(stdtrit(min(degrees), probability) if degrees else ndtri(probability))
