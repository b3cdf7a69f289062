"""What the lines of a frequency response must be, and what stands beside their values."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, ComplexArray, DataError, RealArray, real_array

__all__ = ["check_beside", "check_complex", "check_lines"]


def check_lines(lines: RealArray, shape: tuple[int, ...]) -> None:
    """Refuse no lines, another number of them than values, and lines that are negative or do not increase."""
    if 0 in shape or lines.size == 0:
        raise DataError(
            "a frequency response needs at least one line and channel",
            f"its shape is {shape}",
            "Measure at least one line.",
        )
    if lines.size != shape[0]:
        raise DataError(
            f"frequencies needs one entry for each of the {shape[0]} lines of values, shape {shape}",
            f"it has {lines.size}",
            "Lines come first in values: (lines, outputs, inputs); transpose it if they stand elsewhere.",
        )
    if lines[0] < 0:
        raise DataError(
            "frequencies needs lines at or above 0 Hz",
            f"the first is {lines[0]:g} Hz",
            "Leave the negative half of the spectrum out.",
        )
    falling = np.flatnonzero(np.diff(lines) <= 0)
    if falling.size:
        k = int(falling[0])
        raise DataError(
            "frequencies needs increasing lines",
            f"line {k + 1} ({lines[k + 1]:g} Hz) does not lie above line {k} ({lines[k]:g} Hz)",
            "Sort the lines together with their values and drop the repeated ones.",
        )


def check_complex(values: ComplexArray, lines: RealArray) -> None:
    """Refuse magnitudes; a single line may be real by chance, and an undamped model's real response changes sign."""
    if lines.size > 1 and not values.imag.any() and values.real.any() and values.real.min() >= 0:
        raise DataError(
            "values needs complex frequency responses",
            "they have no imaginary part and are never negative: magnitudes",
            "Give real and imaginary parts.",
        )


def check_beside(name: str, array: Array | None, shape: tuple[int, ...]) -> RealArray | None:
    """Return the coherence or the variance that stands beside values of a shape, checked; None when there is none."""
    if array is None:
        return None
    checked = real_array(name, array, "(lines, outputs) or (lines, outputs, inputs)", (2, 3))
    if checked.shape not in (shape, shape[:2]) or (name == "variance" and checked.ndim != 3):
        raise DataError(
            f"{name} needs the shape of values, {shape}",
            f"it has {checked.shape}",
            "Give one entry for each line and channel.",
        )
    low, high = float(checked.min()), float(checked.max())
    if low < -1e-9 or (name == "coherence" and high > 1 + 1e-6):
        raise DataError(
            f"{name} needs values of at least 0" + (" and at most 1" if name == "coherence" else ""),
            f"they lie between {low:g} and {high:g}",
            f"Correct the {name}, or leave it out.",
        )
    return checked
