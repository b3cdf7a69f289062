"""Robust scatter, noise threshold of singular values, optimal pairing, and confidence intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri, stdtrit

from modalscope.numerics.checks import Array, RealArray, check_number
from modalscope.numerics.errors import DataError

if TYPE_CHECKING:
    from modalscope.data.modes import ModalModel

__all__ = ["NORMAL", "assign", "intervals", "noise_threshold", "scatter"]


# -------------------------------------------------------------------------------------------------------------- robust
# Statistics that a few outliers do not move: the scatter of values, and the threshold between modes and noise in a spectrum.

#: Standard deviation of Gaussian values over their median absolute deviation, 1 / Phi^-1(3/4).
NORMAL = 1.4826


def scatter(values: Array) -> float:
    """Return 1.4826 times the median absolute deviation: the standard deviation of Gaussian values, whatever a few others are.

    Of two or three values the deviation of the middle one says nothing, and the standard deviation itself is returned; of one, 0.

    Examples
    --------
    >>> scatter([1.0, 2.0]), scatter([1.0, 2.0, 3.0, 4.0, 1e9])
    (0.7071067811865476, 1.4826)
    """
    x = np.asarray(values, dtype=float)
    if x.size < 2:
        return 0.0
    if x.size < 4:
        return float(np.std(x, ddof=1))
    return float(NORMAL * np.median(np.abs(x - np.median(x))))


def noise_threshold(singular_values: Array, ratio: float = 1.0) -> float:
    """Return omega(beta) times the median singular value: what exceeds it stands out of white noise of unknown level.

    omega(beta) = .56 beta^3 - .95 beta^2 + 1.82 beta + 1.43.

    `singular_values`: of the whole matrix. `ratio`: beta, the shorter side of the matrix over the longer one.

    References
    ----------
    M. Gavish and D. L. Donoho, The optimal hard threshold for singular values is 4 / sqrt(3), IEEE Trans. Inf. Theory 60, 2014.

    Examples
    --------
    >>> round(noise_threshold([1.0, 1.0, 1.0]), 2)
    2.86
    """
    omega = 0.56 * ratio**3 - 0.95 * ratio**2 + 1.82 * ratio + 1.43
    return float(omega * np.median(singular_values))


# ------------------------------------------------------------------------------------------------------------- pairing
# Pairs between two sets, at least cost in all.


def assign(cost: RealArray) -> tuple[Array, Array]:
    """Return rows and columns of the pairs whose costs have the least sum; of the longer side some stay alone.

    `cost` (a, b): what it costs to pair i with j, finite.

    Returns
    -------
    rows, columns : array of int, (min(a, b),)
        Rows rise.

    Examples
    --------
    >>> rows, columns = assign(np.array([[1.0, 2.0], [2.0, 9.0]]))
    >>> columns.tolist()
    [1, 0]
    """
    from scipy.optimize import linear_sum_assignment  # a quarter of a second, for those who pair

    rows, columns = linear_sum_assignment(cost)
    return np.asarray(rows), np.asarray(columns)


# ----------------------------------------------------------------------------------------------------------- intervals


def intervals(modes: ModalModel, level: float) -> dict[str, RealArray]:
    """Return value -+ z sigma of frequencies and damping ratios, each (n, 2) (see `ModalModel.interval`)."""
    probability = check_number("level", level)
    if not 0 < probability < 1:
        raise DataError("a level between 0 and 1 was asked", f"it is {probability:g}", "Give 0.95 for 95 %.")
    z = _quantile(modes, (1 + probability) / 2)
    found: dict[str, RealArray] = {}
    for name, values, noise, between in (
        ("frequency", modes.frequencies, modes.frequencies_std, modes.frequencies_repeatability),
        ("damping_ratio", modes.damping_ratios, modes.damping_ratios_std, modes.damping_ratios_repeatability),
    ):
        known = [sigma for sigma in (noise, between) if sigma is not None]
        if known:
            half = z * np.maximum.reduce(known)
            found[name] = np.column_stack([values - half, values + half])
    if not found:
        raise DataError(
            f"intervals at {100 * probability:g} % were asked",
            "no standard deviation of these modes is known: neither from the noise nor between groups",
            "Give frequencies_std and damping_ratios_std, or their repeatability between groups.",
        )
    unknown = np.full((len(modes), 2), np.nan)
    return {name: found.get(name, unknown) for name in ("frequency", "damping_ratio")}


def _quantile(modes: ModalModel, probability: float) -> float:
    """Return the normal quantile; Student's where the deviations were estimated from few parts of a record, as their note says."""
    degrees = [note.numbers["degrees_of_freedom"] for note in modes.notes if "degrees_of_freedom" in note.numbers]
    return float(stdtrit(min(degrees), probability) if degrees else ndtri(probability))
