"""Recommend a model order from the singular values of a data matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from modalscope.data.shown import figures
from modalscope.identification.matrices.factor import Factors
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.statistics import noise_threshold

#: Minimum ratio of the gap at the order to any later gap: in white noise of 10 to 60 dB those of the bulk reached 5.
_MIN_GAP_RATIO = 6.5

#: Share of the largest singular value below which a sudden end of the spectrum is rounding: the data have no noise.
_ROUNDING_OF_LARGEST = 1e-10


@dataclass(frozen=True, eq=False)
class OrderAdvice:
    """A recommended order.

    `order`: states to keep. `by_gap`, `by_threshold`: what the clearest gap between neighbours and the Gavish-Donoho threshold say.
    `floor`: the threshold: singular values below it are taken for noise. `confidence`: certain: there is no noise, or both rules agree
    and the gap is clear. Fair: they agree, or differ by one pair and the gap is clear. Poor: anything else. `reason`: the same in words.
    """

    order: int
    by_gap: int
    by_threshold: int
    floor: float
    confidence: str
    reason: str


def noise_floor(singular_values: Array, rows: int, columns: int) -> float:
    """Return omega(beta) times the median singular value, the Gavish-Donoho threshold for white noise of unknown level.

    omega(beta) = .56 beta^3 - .95 beta^2 + 1.82 beta + 1.43 with beta the ratio of the sides (IEEE Trans. Inf. Theory 60,
    2014). The noise of a Hankel matrix repeats along its antidiagonals, so that some of its largest singular values may
    pass: the count is a little high.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(0).standard_normal((200, 100))
    >>> d = np.linalg.svd(noise, compute_uv=False)
    >>> bool(1 < noise_floor(d, 200, 100) / d[0] < 1.3)
    True
    """
    return noise_threshold(singular_values, min(rows, columns) / max(rows, columns))


def gap_after(singular_values: Array, rounding: float = 0.0) -> tuple[int, float]:
    """Return after how many singular values the clearest gap lies, and how many times wider it is than any gap after it.

    The bulk of the noise is smooth and modes are not: the last gap that stands out is the edge between them, also where a stronger mode
    leaves a wider one before it. Only the upper half is looked at; the very last values of a spectrum spread again.

    Examples
    --------
    >>> order, width = gap_after([100, 90, 10, 9, 1.1, 1.05, 1, 0.98, 0.95, 0.93, 0.92, 0.91, 0.9, 0.89, 0.88, 0.87])
    >>> order, width > 10
    (4, True)
    """
    d = np.maximum(np.asarray(singular_values, dtype=float), rounding)
    upper = d[: max(d.size // 2, min(d.size, 3))]
    if upper.size < 3 or upper[-1] <= 0:
        return max(upper.size - 1, 1), 1.0
    gaps = np.log(upper[:-1] / upper[1:])
    after = np.maximum.accumulate(gaps[::-1])[::-1][1:]
    # where all that follows is flat (rounding), any gap is clear: a thousandth keeps the ratio finite
    width = gaps[:-1] / np.maximum(after, 1e-3)
    best = int(np.argmax(width))
    return best + 1, float(width[best])


def complete_spectrum(factors: Factors) -> RealArray:
    """All singular values, down to sqrt(eps) of the first where they come from the Gram matrix.

    Those that a range did not carry are drawn as d_last (1 - u)^p, u from 0 to 1, with p by the energy that they have together.
    """
    count, energy = factors.rest
    if count:
        last = factors.spectrum[-1]
        p = max(last**2 * count / max(energy, np.finfo(float).tiny) - 1, 0) / 2
        return np.concatenate([factors.spectrum, last * (1 - (np.arange(count) + 0.5) / count) ** p])
    if factors.gram is None:
        return factors.spectrum
    values = sla.eigvalsh(factors.gram, check_finite=False)[::-1]
    return np.concatenate([factors.spectrum, np.sqrt(np.clip(values[factors.spectrum.size :], 0, None))])


def recommend_order(factors: Factors) -> OrderAdvice:
    """Recommend an order from the singular values of a data matrix.

    Without noise the spectrum ends at rounding, and the rank is the order. In noise the gap decides when it is clear and
    leaves half to twice what the threshold counts; else the threshold does.

    `factors`: of H(0) or of the matrix with one block more, with some directions to spare.
    """
    d = complete_spectrum(factors)
    rows, columns = factors.left.shape[0], factors.Q.shape[0]
    rounding = float(max(rows, columns) * np.finfo(float).eps * d[0])
    floor = max(noise_floor(d, rows, columns), rounding)
    by_threshold = max(int(np.count_nonzero(d > floor)), 1)
    by_gap, width = gap_after(d, rounding)
    rank = factors.rank
    if rank < factors.spectrum.size and factors.spectrum[rank] < _ROUNDING_OF_LARGEST * d[0]:
        reason = f"the data have no noise: singular values end at rounding after {rank}"
        return OrderAdvice(rank, rank, rank, rounding, "certain", reason)
    clear = width >= _MIN_GAP_RATIO and by_threshold <= 2 * by_gap <= 4 * by_threshold
    order = min(by_gap if clear else by_threshold, rank)
    apart = abs(by_gap - by_threshold)
    if clear and apart == 0:
        confidence = "certain"
    else:
        confidence = "fair" if apart == 0 or (clear and apart <= 2) else "poor"
    reason = (
        f"the clearest gap ({figures(width)} times any after it) lies after {by_gap} singular values, "
        f"{by_threshold} exceed the noise threshold {figures(floor)}"
    )
    return OrderAdvice(order, by_gap, by_threshold, floor, confidence, reason)
