"""Draw the confidence intervals of modes, and their certificates: predicted against simulated deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.analysis.checking.certificate import Certificate
from modalscope.data import ModalModel
from modalscope.data.mode_fields import NORMAL_HALF_WIDTH
from modalscope.interfaces.plot._style import BLUE, MUTED, ORANGE, PALE, dress, key, new_axes
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind
from modalscope.numerics.errors import DataError, check_choice

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Quantity -> its attribute of the modes, the unit of its relative deviation, and the label.
_QUANTITIES = {
    "frequency": ("frequencies", 1e3, "frequency, deviation from its value [‰]"),
    "damping": ("damping_ratios", 1e2, "damping ratio, deviation from its value [%]"),
}

#: Quantity -> its attribute of the certificate.
_CERTIFIED = {"frequency": "frequency", "damping": "damping_ratio"}


@named()
def intervals(modes: ModalModel, ax: Axes | None = None, *, of: str = "frequency") -> Axes:
    """Draw the 95 % intervals of all modes relative to their values: from the noise, and between groups if these are known.

    Parameters
    ----------
    modes : ModalModel
        With standard deviations, of `refine` for instance. A hollow mark is the value before refinement.
    ax : Axes, optional
        A new figure by default.
    of : {"frequency", "damping"}

    Raises
    ------
    DataError
        No standard deviations are known.
    """
    check_kind("modes of intervals", modes, ModalModel)
    check_choice("of", of, _QUANTITIES)
    name, unit, label = _QUANTITIES[of]
    values = np.asarray(getattr(modes, name))
    if getattr(modes, f"{name}_std") is None and getattr(modes, f"{name}_repeatability") is None:
        raise DataError("intervals need standard deviations", "none are known", "Refine the modes.")
    ax = new_axes(ax)
    place, ends = np.arange(len(modes)), modes.interval(0.95)["frequency" if of == "frequency" else "damping_ratio"]
    away = unit * np.nan_to_num(np.abs(ends.T / values - 1))
    words = "noise only" if modes.frequencies_repeatability is None else "noise, and what groups disagree"
    ax.errorbar(place, np.zeros(len(modes)), yerr=away, fmt="none", ecolor=BLUE, capsize=4, label=words)
    if modes.unrefined is not None:
        moved = unit * (np.asarray(getattr(modes.unrefined, name)) / values - 1)
        ax.plot(place, moved, "o", markerfacecolor="white", markeredgecolor=MUTED, label="before refinement")
    ax.axhline(0, color=MUTED, linewidth=0.6)
    ax.set_xticks(place, [f"{f:.4g}" for f in modes.frequencies])
    dress(ax, xlabel="mode [Hz]", ylabel=label)
    key(ax)
    return ax


@named()
def certificate(found: Certificate, ax: Axes | None = None, *, of: str = "frequency") -> Axes:
    """Draw the 95 % range of the simulated values of every mode over the predicted interval, in predicted standard deviations.

    Parameters
    ----------
    found : Certificate
    ax : Axes, optional
        A new figure by default.
    of : {"frequency", "damping"}
    """
    check_kind("found of certificate", found, Certificate)
    check_choice("of", of, _CERTIFIED)
    measures, holds = getattr(found, _CERTIFIED[of]), getattr(found, f"{_CERTIFIED[of]}_holds")
    ax = new_axes(ax)
    place = np.arange(len(found.modes))
    ax.axhspan(-NORMAL_HALF_WIDTH, NORMAL_HALF_WIDTH, color=PALE, alpha=0.35, linewidth=0, label="predicted")
    ax.axhline(0, color=MUTED, linewidth=0.8)
    for kept, colour, words in ((holds, BLUE, "holds"), (~holds, ORANGE, "does not hold")):
        if not np.any(kept):
            continue
        half = np.nan_to_num(NORMAL_HALF_WIDTH * measures["ratio"][kept])
        style: dict[str, Any] = {"fmt": "o", "markersize": 4, "color": colour, "capsize": 4}
        ax.errorbar(place[kept], measures["bias"][kept], yerr=half, label=words, **style)
    top = max(
        NORMAL_HALF_WIDTH,
        float(np.nanmax(np.abs(measures["bias"]) + NORMAL_HALF_WIDTH * measures["ratio"], initial=0.0)),
    )
    for x, coverage in zip(place, measures["coverage"], strict=True):
        words = f"{100 * coverage:.0f} %" if np.isfinite(coverage) else "no interval"
        ax.annotate(words, (x, 1.12 * top), ha="center", va="bottom", fontsize=8.5, color=MUTED)
    ax.set_ylim(-1.15 * top, 1.35 * top)
    ax.set_xlim(-0.6, len(found.modes) - 0.4)
    ax.set_xticks(place, [f"{f:.4g}" for f in found.modes.frequencies])
    dress(
        ax, title=of.capitalize(), xlabel="mode [Hz]", ylabel="deviation from the truth [predicted standard deviations]"
    )
    key(ax)
    return ax
