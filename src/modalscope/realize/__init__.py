"""Floor 2: factors and shifts -> models (A, B, C)."""

from modalscope.realize.balanced import balanced
from modalscope.realize.companion import least_squares_companion, null_space_companion
from modalscope.realize.reduction import reduced
from modalscope.realize.regression import regression
from modalscope.realize.shift import shift
from modalscope.realize.triple import Realization, Triple

__all__ = [
    "Realization",
    "Triple",
    "balanced",
    "least_squares_companion",
    "null_space_companion",
    "reduced",
    "regression",
    "shift",
]
