"""Components of a mode shape in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.modal.indicators import mpc
from modalscope.model import ModalModel
from modalscope.model.checks import DataError
from modalscope.model.keywords import named
from modalscope.plot._style import BLUE, MUTED, PALE, aside, headline, new_axes
from modalscope.plot.shapes import check_mode

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["complexity"]


@named()
def complexity(modes: ModalModel, index: int, ax: Axes | None = None) -> Axes:
    """Draw the components of one shape as arrows in the complex plane; in line they are in phase or in opposition.

    Parameters
    ----------
    modes : ModalModel
    index : int
        Of the mode, from zero.
    ax : Axes, optional
        Polar axes; those of a new figure by default.

    Raises
    ------
    DataError
        A mode that is not there, or axes that are not polar.
    """
    check_mode(modes, index)
    ax = new_axes(ax, (6.0, 6.0), projection="polar")
    if ax.name != "polar":
        raise DataError(
            "the complexity of a shape was asked", f"the axes given are {ax.name}", 'Make them with projection="polar".'
        )
    phi = modes.shapes[:, index]
    largest = float(np.max(np.abs(phi))) or 1.0
    turn = 0.5 * np.angle(np.sum(phi**2))
    for value in phi * np.exp(-1j * turn) / largest:
        ax.plot(
            [0, np.angle(value)], [0, np.abs(value)], color=BLUE, linewidth=1.6, marker="o", markevery=[1], markersize=5
        )
    ax.set_ylim(0, 1.08)
    ax.set_yticks([0.5, 1.0], ["", ""])
    ax.tick_params(labelsize=9, labelcolor=MUTED)
    ax.grid(True, color=PALE, linewidth=0.5)
    ax.spines["polar"].set_color(PALE)
    headline(ax, f"mode {index + 1}: {modes.frequencies[index]:.5g} Hz")
    aside(ax, f"MPC {float(mpc(modes.shapes[:, [index]])[0]):.3f}")
    return ax
