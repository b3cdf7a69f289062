"""Spectra of records: where there is energy, and in how many shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.model.keywords import named
from modalscope.model.kinds import check_kind
from modalscope.plot._style import dress, key, mark_modes, new_axes
from modalscope.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["spectra"]

#: So many singular values are drawn: more lie in the noise.
_DRAWN = 4


@named()
def spectra(found: Decomposition, ax: Axes | None = None, *, peaks: int | None = 12) -> Axes:
    """Draw the singular values of the outputs' spectra over frequency, and mark the peaks of the first (FDD).

    Parameters
    ----------
    found : Decomposition
        From `preprocess.decomposition`.
    ax : Axes, optional
        Where to draw; a new figure by default.
    peaks : int, optional
        How many peaks are marked, those that stand out most.
    """
    check_kind("a plot of spectra", found, Decomposition)
    ax = new_axes(ax)
    f, levels = found.frequencies, 10 * np.log10(np.maximum(found.singular_values, np.finfo(float).tiny))
    for k in range(min(levels.shape[1], _DRAWN)):
        ax.plot(
            f,
            levels[:, k],
            lw=1.2 if k == 0 else 0.8,
            color=f"C{k}",
            label=f"singular value {k + 1}",
            zorder=3 - k / 10,
        )
    inside = levels[f > 0, : min(levels.shape[1], _DRAWN)]
    ax.set_ylim(float(inside.min()) - 3, float(inside.max()) + 8)
    ax.set_xlim(0, float(f[-1]))
    dress(ax, xlabel="frequency [Hz]", ylabel="power spectral density [dB re unit²/Hz]")
    mark_modes(ax, found.peaks(peaks)[0], (0, float(f[-1])))
    key(ax)
    return ax
