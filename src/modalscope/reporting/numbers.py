"""Numbers and names as a reader wants them."""

from __future__ import annotations

import numbers
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from modalscope.model.checks import Array

__all__ = ["decimals", "frequency", "heading", "list_some", "percent", "value"]


def decimals(frequencies: Array) -> int:
    """Return how many decimals give the lowest frequency about six digits, at least two and at most five."""
    positive = np.asarray(frequencies)[np.asarray(frequencies) > 0]
    if not positive.size:
        return 3
    return int(np.clip(5 - np.floor(np.log10(positive.min())), 2, 5))


def frequency(hertz: float) -> str:
    """Return a frequency with five digits and its unit."""
    return f"{hertz:.5g} Hz"


def percent(ratio: float, digits: int = 3) -> str:
    """Return a ratio in per cent; a dash where it is not known."""
    return f"{100 * ratio:.{digits}g} %" if np.isfinite(ratio) else "–"


def heading(key: str) -> str:
    """Return the name of a field as a heading: `frequency_spread_hz` as `frequency spread [Hz]`."""
    words = key.removesuffix("_hz").replace("_", " ")
    if key.endswith("_hz"):
        return f"{words} [Hz]"
    return f"{words} [%]" if in_percent(key) else words


def in_percent(key: str) -> bool:
    """Whether a field is a ratio that readers know in per cent."""
    return "damping_ratio" in key or key.endswith(("_loss", "fit_error"))


def value(key: str, found: Any) -> str:
    """Return the value of a field in words or with four digits."""
    if found is None:
        return "–"
    if isinstance(found, bool | np.bool_):
        return "yes" if found else "no"
    if isinstance(found, numbers.Integral):
        return str(int(found))
    if isinstance(found, numbers.Real):
        number = float(found) * (100 if in_percent(key) else 1)
        return f"{number:.4g}" if np.isfinite(number) else "–"
    if isinstance(found, Mapping):
        return ", ".join(f"{k} {value(str(k), v)}" for k, v in found.items())
    if isinstance(found, np.ndarray) and found.size > 12:
        return f"array of shape {found.shape}"
    if isinstance(found, Iterable) and not isinstance(found, str):
        return ", ".join(value(key, item) for item in found)
    return str(found)


def list_some(names: Iterable[str], most: int = 12) -> str:
    """Return names, the first ones only where they are many."""
    every = list(names)
    rest = len(every) - most
    return ", ".join(every[:most]) + (f" and {rest} more" if rest > 0 else "")
