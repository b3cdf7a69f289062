"""What brings the outputs of a response to one level: their noise, or their size."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.response import Response

__all__ = ["output_scale", "root_mean_squares"]


def output_scale(response: Response) -> RealArray:
    """Return what brings outputs to one level, (l,): their noise where it is known, as least squares ask, else their root mean squares."""
    return root_mean_squares(response) if response.known_level is None else response.known_level


def root_mean_squares(response: Response) -> RealArray:
    """Return the root mean square of every output over lines or samples and inputs, (l,)."""
    parts = _real_parts(response.values)
    return np.asarray(np.sqrt(np.einsum("klp,klp->l", parts, parts) / (response.count * response.values.shape[2])))


def _real_parts(values: Array) -> RealArray:
    """Return (K, l, m) numbers as real ones, (K, l, m) or (K, l, 2 m), without a copy where they lie in one piece."""
    return np.ascontiguousarray(values).view(np.float64).reshape(*values.shape[:2], -1)
