"""What the lines of a frequency response must be, and what stands beside their values."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import (
    Array,
    ComplexArray,
    DataError,
    IntArray,
    RealArray,
    check_band,
    check_positive,
    real_array,
)

__all__ = ["check_beside", "check_lines", "check_rate", "lines_inside"]


def check_lines(lines: RealArray, values: ComplexArray) -> None:
    """Refuse no lines, another number of them than values, lines that are negative or do not increase, and magnitudes."""
    shape = values.shape
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
    _check_complex(values, lines)


def _check_complex(values: ComplexArray, lines: RealArray) -> None:
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


def check_rate(sampling_rate: float | None, lines: RealArray) -> float | None:
    """Return the sampling rate, or raise where lines lie above half of it; None for a continuous structure."""
    rate = None if sampling_rate is None else check_positive("sampling_rate", sampling_rate)
    if rate is not None and lines[-1] > rate / 2 * (1 + 1e-9):
        raise DataError(
            f"lines up to half the sampling rate, {rate / 2:g} Hz, were asked",
            f"there are lines up to {lines[-1]:g} Hz",
            "Correct the sampling rate, or leave it out for the response of a continuous structure.",
        )
    return rate


def lines_inside(lines: RealArray, band: tuple[float, float]) -> IntArray:
    """Return which lines lie in a band, Hz, or raise where none does."""
    low, high = check_band(band)
    inside = np.flatnonzero((lines >= low) & (lines <= high))
    if not inside.size:
        raise DataError(
            f"the band {low:g} to {high:g} Hz was asked",
            f"the {lines.size} lines lie from {lines.min():g} to {lines.max():g} Hz, none of them inside",
            "Choose a band that holds measured lines.",
        )
    return inside
