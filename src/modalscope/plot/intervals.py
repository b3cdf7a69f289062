"""Deviations of every mode, from the noise and between groups, and where its values stood before refinement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.model import ModalModel
from modalscope.model.checks import DataError, RealArray, check_choice, check_kind
from modalscope.model.keywords import named
from modalscope.plot._style import BLUE, MUTED, ORANGE, dress, key, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["intervals"]

#: What can be drawn -> its own values, deviations from the noise and between groups, and how much of a value is one unit.
_DRAWN = {
    "frequency": ("frequencies", 1e3, "frequency, deviation from its value [‰]"),
    "damping": ("damping_ratios", 1e2, "damping ratio, deviation from its value [%]"),
}

#: Half-width of 95 % of a normal distribution, in standard deviations.
_WIDTH = 1.96


@named()
def intervals(modes: ModalModel, ax: Axes | None = None, *, of: str = "frequency") -> Axes:
    """Draw 95 % intervals of all modes, relative to their values: from the noise, and between groups where these are known.

    Parameters
    ----------
    modes : ModalModel
        With deviations; `refine` gives them. A hollow mark shows where a mode stood before refinement.
    ax : Axes, optional
        A new figure by default.
    of : {"frequency", "damping"}

    Raises
    ------
    DataError
        No deviations are known.
    """
    check_kind("modes of intervals", modes, ModalModel)
    check_choice("of", of, _DRAWN)
    name, unit, label = _DRAWN[of]
    values = np.asarray(getattr(modes, name))
    known: list[tuple[str, RealArray, str]] = [
        (words, unit * _WIDTH * sigma / values, colour)
        for words, sigma, colour in (
            ("noise", getattr(modes, f"{name}_std"), BLUE),
            ("between groups", getattr(modes, f"{name}_repeatability"), ORANGE),
        )
        if sigma is not None
    ]
    if not known:
        raise DataError("intervals were to be drawn", "no deviations of these modes are known", "Refine the modes.")
    ax = new_axes(ax)
    place = np.arange(len(modes))
    for k, (words, half, colour) in enumerate(known):
        where = place + 0.22 * (k - 0.5 * (len(known) - 1))
        ax.errorbar(
            where, np.zeros(len(modes)), yerr=np.nan_to_num(half), fmt="none", ecolor=colour, capsize=4, label=words
        )
    if modes.unrefined is not None:
        moved = unit * (np.asarray(getattr(modes.unrefined, name)) / values - 1)
        ax.plot(place, moved, "o", markerfacecolor="white", markeredgecolor=MUTED, label="before refinement")
    ax.axhline(0, color=MUTED, linewidth=0.6)
    ax.set_xticks(place, [f"{f:.4g}" for f in modes.frequencies])
    dress(ax, xlabel="mode [Hz]", ylabel=label)
    key(ax)
    return ax
