"""The likelihood of modes: noise models, descent, refinement, standard deviations."""

from typing import TYPE_CHECKING

from modalscope.numerics.handed import later

if TYPE_CHECKING:
    from modalscope.selection.likelihood.error_model import TERMS as TERMS, Noise as Noise

__all__ = ["TERMS", "Noise"]

if not TYPE_CHECKING:
    __getattr__ = later(__name__, {"error_model": ("TERMS", "Noise")})
