"""Define the style of all pictures: colours, grids, units on the axes.

All settings are made on the axes, so that no global setting of Matplotlib changes and pictures on given axes look the same. Matplotlib
is imported where a figure is made, which keeps `import modalscope` fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

# Okabe and Ito, Color Universal Design, 2008
BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
ORANGE = "#E69F00"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"

INK = "#1F2933"
MUTED = "#6B7785"
PALE = "#B4BEC9"
GRID = "#E4E8EC"

#: Maximum characters of a label.
_MAX_LABEL = 40

#: Inches; 1200 x 800 at the 133 dots an inch that new figures have.
SIZE = (9.0, 6.0)
DPI = 400 / 3


#: A curve of single values, one per order.
DOTTED: dict[str, Any] = {"color": BLUE, "linewidth": 0.9, "marker": "o", "markersize": 3.4}


def new_axes(ax: Axes | None, size: tuple[float, float] = SIZE, **subplot: Any) -> Axes:
    """Return the given axes, or those of a new figure that notebooks show."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    axes: Axes = pyplot.figure(figsize=size, dpi=DPI, layout="constrained").add_subplot(**subplot)
    return axes


def dress(ax: Axes, *, title: str = "", xlabel: str = "", ylabel: str = "", grid: bool = True) -> None:
    """Give axes their labels and the common look."""
    headline(ax, title)
    ax.set_xlabel(xlabel, fontsize=10.5, color=INK)
    ax.set_ylabel(ylabel, fontsize=10.5, color=INK)
    ax.tick_params(labelsize=9.5, color=PALE, labelcolor=INK, length=3.5, width=0.8)
    ax.tick_params(which="minor", length=0)
    ax.set_axisbelow(True)
    if grid:
        ax.grid(True, color=GRID, linewidth=0.7)
    for side, spine in ax.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(PALE)
        spine.set_linewidth(0.8)


def headline(ax: Axes, text: str) -> None:
    """Write the title at the left above the axes."""
    ax.set_title(text, loc="left", fontsize=11.5, color=INK, fontweight="bold", pad=8)


def frameless(ax: Axes) -> None:
    """Remove the frame of the axes."""
    for spine in ax.spines.values():
        spine.set_visible(False)


def aside(ax: Axes, text: str) -> None:
    """Write a remark at the right above the axes."""
    ax.set_title(text, loc="right", fontsize=9.5, color=MUTED, pad=8)


def key(ax: Axes, **options: Any) -> None:
    """Add a legend in a row below the axis label."""
    from matplotlib.transforms import ScaledTranslation

    figure = ax.get_figure()
    below: dict[str, Any] = {"loc": "upper left", "ncols": 6, "borderaxespad": 0.0, "borderpad": 0.2}
    if figure is not None:
        # in inches: the row clears ticks and label at any height of the axes
        below["bbox_to_anchor"] = (0.0, 0.0)
        below["bbox_transform"] = ax.transAxes + ScaledTranslation(0, -0.58, figure.dpi_scale_trans)
    look: dict[str, Any] = {"frameon": False, "fontsize": 9.5, "labelcolor": INK, "columnspacing": 1.6}
    ax.legend(**(below | look | {"handletextpad": 0.5} | options))


def diverging() -> Colormap:
    """Blue below zero, pale grey at zero, vermillion above."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("modalscope", [BLUE, "#7FAFD0", "#C9CED4", "#E8A06B", VERMILLION])


def sequential() -> Colormap:
    """White at zero, dark blue at one."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("modalscope", ["#FFFFFF", "#D3E5F1", "#7DB4D8", BLUE, "#003A5D"])


def plain(text: str) -> str:
    r"""Return a label for Matplotlib: one line of printable characters, with dollar signs escaped.

    Examples
    --------
    >>> print(plain("$x$"), plain("tip" * 30))
    \$x\$ tiptiptiptiptiptiptiptiptip...ptiptiptip
    """
    line = printable(text).replace("\n", " ")
    short = line if len(line) <= _MAX_LABEL else f"{line[: _MAX_LABEL - 13]}...{line[-10:]}"
    return short.replace("$", r"\$")


def unit_of(response: Response, output: int | None = None, input: int | None = None) -> str:
    """Return the unit ` [out/in]` of a channel, or of all channels if they share it; empty if unknown."""
    outs, ins = response.units
    out = {outs[output]} if output is not None else set(outs)
    inn = {ins[input]} if input is not None else set(ins)
    if len(out) != 1 or len(inn) != 1:
        return ""
    top, bottom = (plain(unit).replace("^2", "²").replace("s2", "s²") for unit in (out.pop(), inn.pop()))
    if not top:
        return ""
    return f" [({top})/{bottom}]" if bottom and "/" in top else f" [{top}/{bottom}]" if bottom else f" [{top}]"


def dodge(positions: Array, gap: float, low: float = 0.0, high: float = 1.0) -> RealArray:
    """Return the positions nearest to increasing ones (least squares) that lie at least `gap` apart within [low, high]."""
    from scipy.optimize import isotonic_regression

    steps: RealArray = gap * np.arange(len(positions), dtype=float)
    if not len(positions):
        return steps
    shifted: RealArray = isotonic_regression(np.asarray(positions, dtype=float) - steps).x
    return np.clip(shifted, low, max(high - steps[-1], low)) + steps


def decimals(frequencies: Array) -> int:
    """Return the decimals that give the highest frequency five digits."""
    highest = float(np.max(np.abs(frequencies), initial=0.0))
    return int(np.clip(4 - np.floor(np.log10(highest)), 0, 4)) if highest > 0 else 0


def mark_modes(ax: Axes, frequencies: Array, limits: tuple[float, float]) -> None:
    """Draw a thin line at every frequency within the limits, with its number and value above the axes."""
    f = np.asarray(frequencies, dtype=float)
    shown = np.flatnonzero((f >= limits[0]) & (f <= limits[1]))
    shown = shown[np.argsort(f[shown], kind="stable")]
    digits = decimals(f[shown])
    across = ax.get_xaxis_transform()
    places = dodge((f[shown] - limits[0]) / (limits[1] - limits[0]), gap=0.021)
    for i, place in zip(shown, places, strict=True):
        x = limits[0] + place * (limits[1] - limits[0])
        ax.axvline(f[i], color=VERMILLION, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1.5)
        ax.plot([f[i], x], [1.0, 1.03], transform=across, color=VERMILLION, linewidth=0.8, clip_on=False)
        label = f"{i + 1}   {f[i]:.{digits}f}"
        ax.text(x, 1.04, label, transform=across, rotation=90, ha="center", va="bottom", fontsize=8.5, color=VERMILLION)


def channel(name: str, wanted: str | int | None, labels: tuple[str, ...], default: int) -> int:
    """Return the position of a channel given by label or index, or the default."""
    if wanted is None:
        return default
    if isinstance(wanted, int) and 0 <= wanted < len(labels):
        return wanted
    if wanted in labels:
        return labels.index(str(wanted))
    choices = f"the channels are {', '.join(labels)}"
    raise DataError(f"{name} {wanted!r} was asked", choices, "Use one of these, or its index from zero.")
