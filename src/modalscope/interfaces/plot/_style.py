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

# Colours of data, which people of any colour vision tell apart: Okabe and Ito, Color Universal Design, 2008
BLUE = "#0072B2"
SKY = "#56B4E9"
GREEN = "#009E73"
ORANGE = "#E69F00"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"

# Greys, from text to grid lines
INK = "#1F2933"
MUTED = "#6B7785"
PALE = "#B4BEC9"
GRID = "#E4E8EC"

#: Maximum characters of a label, and how many characters of its end a longer one keeps: ends tell channels apart, as in `wing ... 12:+Z`.
_MAX_LABEL, _LABEL_END = 40, 10

#: Size of figures in inches, and dots an inch: together 1200 x 800 dots.
SIZE = (9.0, 6.0)
DPI = 400 / 3

#: Inches from the axes down to the legend: tick labels of 9.5 points and an axis label of 10.5 points lie between.
_LEGEND_DISTANCE = 0.58

#: Distance of the labels of modes above the axes, in widths of the axes: about 1.4 times the 8.5 points of their text at the width of
#: `SIZE`.
_MODE_LABEL_DISTANCE = 0.021

#: Style of a curve of single values, one per order.
DOTTED: dict[str, Any] = {"color": BLUE, "linewidth": 0.9, "marker": "o", "markersize": 3.4}


def new_axes(ax: Axes | None, size: tuple[float, float] = SIZE, **subplot: Any) -> Axes:
    """Return the given axes, or those of a new figure made by pyplot, so that notebooks show it."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    axes: Axes = pyplot.figure(figsize=size, dpi=DPI, layout="constrained").add_subplot(**subplot)
    return axes


def dress(ax: Axes, *, title: str = "", xlabel: str = "", ylabel: str = "", grid: bool = True) -> None:
    """Set title, labels, ticks, grid and frame of axes to the common style."""
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


def one_output(ax: Axes, why: str) -> Axes:
    """Write into empty axes that one output was measured, and what follows."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, f"One output was measured: {why}.", ha="center", va="center", color=MUTED, transform=ax.transAxes)
    return ax


def aside(ax: Axes, text: str) -> None:
    """Write a remark at the right above the axes."""
    ax.set_title(text, loc="right", fontsize=9.5, color=MUTED, pad=8)


def key(ax: Axes, **options: Any) -> None:
    """Add a legend in a row below the axis label; `options` are those of Matplotlib's `legend`."""
    from matplotlib.transforms import ScaledTranslation

    figure = ax.get_figure()
    below: dict[str, Any] = {"loc": "upper left", "ncols": 6, "borderaxespad": 0.0, "borderpad": 0.2}
    if figure is not None:
        # a distance in inches clears ticks and label at any height of the axes
        below["bbox_to_anchor"] = (0.0, 0.0)
        below["bbox_transform"] = ax.transAxes + ScaledTranslation(0, -_LEGEND_DISTANCE, figure.dpi_scale_trans)
    look: dict[str, Any] = {"frameon": False, "fontsize": 9.5, "labelcolor": INK, "columnspacing": 1.6}
    ax.legend(**(below | look | {"handletextpad": 0.5} | options))


def diverging() -> Colormap:
    """Return the colours of signed values: blue below zero, pale grey at zero, vermillion above."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("modalscope", [BLUE, "#7FAFD0", "#C9CED4", "#E8A06B", VERMILLION])


def sequential() -> Colormap:
    """Return the colours of values from zero (white) to one (dark blue)."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("modalscope", ["#FFFFFF", "#D3E5F1", "#7DB4D8", BLUE, "#003A5D"])


def plain(text: str) -> str:
    r"""Return a label for Matplotlib: one short line of printable characters, with dollar signs escaped.

    Examples
    --------
    >>> print(plain("$x$"), plain("tip" * 30))
    \$x\$ tiptiptiptiptiptiptiptiptip...ptiptiptip
    """
    line = printable(text).replace("\n", " ")
    start = _MAX_LABEL - len("...") - _LABEL_END
    short = line if len(line) <= _MAX_LABEL else f"{line[:start]}...{line[-_LABEL_END:]}"
    return short.replace("$", r"\$")


def unit_of(response: Response, output: int | None = None, input: int | None = None) -> str:
    """Return the unit ` [output/input]` of a channel, or of all channels if they share it; empty if unknown.

    `output`, `input`: positions of the channel; None for all.
    """
    output_units, input_units = response.units
    above = set(output_units) if output is None else {output_units[output]}
    below = set(input_units) if input is None else {input_units[input]}
    if len(above) != 1 or len(below) != 1:
        return ""
    top, bottom = (plain(unit).replace("^2", "²").replace("s2", "s²") for unit in (above.pop(), below.pop()))
    if not top:
        return ""
    return f" [({top})/{bottom}]" if bottom and "/" in top else f" [{top}/{bottom}]" if bottom else f" [{top}]"


def dodge(positions: Array, gap: float, low: float = 0.0, high: float = 1.0) -> RealArray:
    """Move increasing positions as little as possible (least squares) so that they lie at least `gap` apart within [low, high].

    If there are too many for the interval, they go beyond `high`.

    Positions minus `gap` times their number must not decrease: that is an isotonic regression.
    """
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
    places = dodge((f[shown] - limits[0]) / (limits[1] - limits[0]), gap=_MODE_LABEL_DISTANCE)
    for i, place in zip(shown, places, strict=True):
        x = limits[0] + place * (limits[1] - limits[0])
        ax.axvline(f[i], color=VERMILLION, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1.5)
        ax.plot([f[i], x], [1.0, 1.03], transform=across, color=VERMILLION, linewidth=0.8, clip_on=False)
        label = f"{i + 1}   {f[i]:.{digits}f}"
        ax.text(x, 1.04, label, transform=across, rotation=90, ha="center", va="bottom", fontsize=8.5, color=VERMILLION)


def channel(name: str, choice: str | int | None, labels: tuple[str, ...], default: int) -> int:
    """Return the position of a channel given by label or index, or the default; `name`: the argument, for the error."""
    if choice is None:
        return default
    if isinstance(choice, int) and 0 <= choice < len(labels):
        return choice
    if choice in labels:
        return labels.index(str(choice))
    choices = f"the channels are {', '.join(labels)}"
    raise DataError(f"{name} {choice!r} was asked", choices, "Use one of these, or its index from zero.")
