"""The certificate of a result: what was promised of every interval, and what simulations of the same case showed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.judging.certificate import Certificate
from modalscope.model.checks import check_choice, check_kind
from modalscope.model.keywords import named
from modalscope.plot._style import BLUE, MUTED, ORANGE, PALE, dress, key, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["certificate"]

#: What can be drawn -> the field of the certificate.
_DRAWN = {"frequency": "frequency", "damping": "damping_ratio"}

#: Half-width of 95 % of a normal distribution, in standard deviations.
_WIDTH = 1.96


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
    check_choice("of", of, _DRAWN)
    told = getattr(found, _DRAWN[of])
    holds = getattr(found, f"{_DRAWN[of]}_holds")
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
