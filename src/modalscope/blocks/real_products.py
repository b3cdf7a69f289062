"""Products of real matrices with complex ones by parts: half the work, and no complex copy of the large one."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray

__all__ = ["real_times", "times_real"]


def real_times(left: RealArray, right: Array) -> Array:
    """Return left @ right of a real left side, (..., a, n) and (n, k)."""
    if not np.iscomplexobj(right):
        return np.asarray(left @ right)
    product = left @ np.ascontiguousarray(right).view(np.float64)
    return np.asarray(np.ascontiguousarray(product).view(np.complex128))


def times_real(left: Array, right: RealArray) -> Array:
    """Return left @ right of a real right side, (k, n) and (n, b)."""
    if not np.iscomplexobj(left):
        return np.asarray(left @ right)
    found = np.empty((len(left), right.shape[1]), dtype=complex)
    found.real, found.imag = np.ascontiguousarray(left.real) @ right, np.ascontiguousarray(left.imag) @ right
    return found
