"""Every technique on the same measured data: what they agree on, where they differ, and why."""

from modalscope.compare.causes import CAUSES, Cause, Disagreement
from modalscope.compare.comparison import compare
from modalscope.compare.result import Comparison
from modalscope.compare.run import MethodResult

__all__ = ["CAUSES", "Cause", "Comparison", "Disagreement", "MethodResult", "compare"]
