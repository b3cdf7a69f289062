"""Draw intervals and certificates of modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.checking.certificate import Certificate
from modalscope.data import ModalModel
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray, check_kind
from modalscope.numerics.errors import DataError, check_choice
from modalscope.plot._style import BLUE, MUTED, ORANGE, PALE, dress, key, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


# -------------------------------------------------------------------------------------------------------- certificates
# The certificate of a result: what was promised of every interval, and what simulations of the same case showed.

#: What can be drawn -> the field of the certificate.
_CERTIFIED_DRAWN = {"frequency": "frequency", "damping": "damping_ratio"}


@named()
def certificate(found: Certificate, ax: Axes | None = None, *, of: str = "frequency") -> Axes:
    """Draw where 95 % of the replicates of every mode lie, in predicted deviations from the truth, over the interval that was promised.

    Parameters
    ----------
    found : Certificate
    ax : Axes, optional
        A new figure by default.
    of : {"frequency", "damping"}
    """
    check_kind("found of certificate", found, Certificate)
    check_choice("of", of, _CERTIFIED_DRAWN)
    told = getattr(found, _CERTIFIED_DRAWN[of])
    holds = getattr(found, f"{_CERTIFIED_DRAWN[of]}_holds")
    ax = new_axes(ax)
    place = np.arange(len(found.modes))
    ax.axhspan(-_WIDTH, _WIDTH, color=PALE, alpha=0.35, linewidth=0, label="promised")
    ax.axhline(0, color=MUTED, linewidth=0.8)
    for kept, colour, words in ((holds, BLUE, "holds"), (~holds, ORANGE, "does not hold")):
        if not np.any(kept):
            continue
        half = np.nan_to_num(_WIDTH * told["ratio"][kept])
        ax.errorbar(
            place[kept], told["bias"][kept], yerr=half, fmt="o", markersize=4, color=colour, capsize=4, label=words
        )
    top = max(_WIDTH, float(np.nanmax(np.abs(told["bias"]) + _WIDTH * told["ratio"], initial=0.0)))
    for x, cover in zip(place, told["coverage"], strict=True):
        words = f"{100 * cover:.0f} %" if np.isfinite(cover) else "none given"
        ax.annotate(words, (x, 1.12 * top), ha="center", va="bottom", fontsize=8.5, color=MUTED)
    ax.set_ylim(-1.15 * top, 1.35 * top)
    ax.set_xlim(-0.6, len(found.modes) - 0.4)
    ax.set_xticks(place, [f"{f:.4g}" for f in found.modes.frequencies])
    dress(ax, title=of.capitalize(), xlabel="mode [Hz]", ylabel="predicted deviations from the truth")
    key(ax)
    return ax
