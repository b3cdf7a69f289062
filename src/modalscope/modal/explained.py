"""How much of what was measured the modes explain, in words; little is said loudly."""

from __future__ import annotations

import numpy as np

__all__ = ["ENOUGH", "explained", "explains_enough", "share_explained"]

#: Share of the measured mean square below which modes leave out too much to be relied on.
ENOUGH = 0.7


def share_explained(fit_error: float) -> float:
    """Return 1 - (fit error)^2, the share of the measured mean square that rebuilt responses explain; at least 0."""
    return max(1 - float(fit_error) ** 2, 0.0) if np.isfinite(fit_error) else 0.0


def explains_enough(fit_error: float) -> bool:
    """Whether at least 70 % of the measured mean square is explained."""
    return share_explained(fit_error) >= ENOUGH


def explained(fit_error: float) -> str:
    """Return a sentence on how much the modes explain; below 70 % it says so first, and what to look at.

    Parameters
    ----------
    fit_error : float
        norm(measured - rebuilt) / norm(measured).

    Examples
    --------
    >>> print(explained(0.1))
    The modes explain 99 % of the measured mean square (fit error 10 %).
    >>> print(explained(0.72))
    WARNING: the modes explain only 48.16 % of the measured mean square (fit error 72 %). \
Something that was measured is not in them: raise the largest order, choose a narrower band, \
or look for channels and lines that no mode explains.
    """
    share = f"{100 * share_explained(fit_error):.4g} % of the measured mean square (fit error {100 * fit_error:.3g} %)."
    if explains_enough(fit_error):
        return f"The modes explain {share}"
    return (
        f"WARNING: the modes explain only {share} Something that was measured is not in them: raise the largest order, "
        "choose a narrower band, or look for channels and lines that no mode explains."
    )
