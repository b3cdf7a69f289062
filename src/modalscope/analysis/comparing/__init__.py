"""Compare every method on the same measured data: what they agree on, where they differ, and why."""

from modalscope.analysis.comparing.comparison import Comparison, compare
from modalscope.analysis.comparing.diagnosis import CAUSES, Cause, Disagreement
from modalscope.analysis.comparing.principles import Principle, Witness
from modalscope.analysis.comparing.run import MethodResult
from modalscope.numerics.arguments import plain_methods

__all__ = ["CAUSES", "Cause", "Comparison", "Disagreement", "MethodResult", "Principle", "Witness", "compare"]

plain_methods(Comparison)
