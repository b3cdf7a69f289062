"""How many states stand out of the noise: the singular values read by two rules, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.blocks.factor import Factors
from modalscope.blocks.matrix import DataMatrix
from modalscope.model.checks import RealArray

__all__ = ["OrderAdvice", "recommend_order"]


@dataclass(frozen=True, eq=False)
class OrderAdvice:
    """A recommended order.

    Parameters
    ----------
    order : int
        States to keep.
    by_gap, by_threshold : int
        What the largest gap between neighbours and the Gavish-Donoho threshold say.
    floor : float
        The threshold: singular values below it are taken for noise.
    confidence : {"certain", "fair", "poor"}
        Certain: both rules agree and the gap is wide. Fair: they agree, or differ by two states. Poor: they differ by more.
    reason : str
        The same in words.
    """

    order: int
    by_gap: int
    by_threshold: int
    floor: float
    confidence: str
    reason: str


def recommend_order(factors: Factors, matrix: DataMatrix | None = None) -> OrderAdvice:
    """Recommend an order from the singular values of a data matrix.

    The threshold is omega(beta) times the median singular value, beta the ratio of the sides and omega(beta) = .56 beta^3 - .95 beta^2 +
    1.82 beta + 1.43 (Gavish and Donoho, IEEE Trans. Inf. Theory 60, 2014, for white noise of unknown level). The gap is the largest
    ratio of neighbours above rounding.
    """
    d: RealArray = factors.spectrum
    rows, columns = factors.P.shape[0], factors.Q.shape[0]
    beta = min(rows, columns) / max(rows, columns)
    omega = 0.56 * beta**3 - 0.95 * beta**2 + 1.82 * beta + 1.43
    rounding = max(rows, columns) * np.finfo(float).eps * d[0]
    floor = max(omega * float(np.median(d)), rounding)
    by_threshold = max(int(np.count_nonzero(d > floor)), 1)
    safe = np.maximum(d, rounding)
    ratios = safe[:-1] / safe[1:]
    by_gap = int(np.argmax(ratios)) + 1 if ratios.size else 1
    width = float(ratios[by_gap - 1]) if ratios.size else np.inf
    reachable = min(factors.rank, d.size)
    order = min(by_gap if abs(by_gap - by_threshold) <= 2 else by_threshold, reachable)
    if by_gap == by_threshold and width > 5:
        confidence = "certain"
    else:
        confidence = "fair" if abs(by_gap - by_threshold) <= 2 else "poor"
    reason = (
        f"the largest gap (a factor {width:.3g}) lies after {by_gap} singular values, "
        f"{by_threshold} exceed the noise threshold {floor:.3g}"
    )
    return OrderAdvice(order, by_gap, by_threshold, floor, confidence, reason)
