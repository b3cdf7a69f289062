"""Paint a described picture on Matplotlib axes.

All settings are made on the axes, so that no global setting of Matplotlib changes and pictures on given axes look the same. Matplotlib
is imported where a figure is made, which keeps `import modalscope` fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.interfaces.plot.picture import INKS, Areas, Axis, Item, Line, Marks, Panel, Picture, Words, dodge
from modalscope.numerics.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Dots an inch: pictures of 9 x 6 inches have 1200 x 800 dots.
DPI = 400 / 3

#: Inches from the axes down to the legend: tick labels of 9.5 points and an axis label of 10.5 points lie between.
_LEGEND_DISTANCE = 0.58

#: Distance of the names of modes above the axes, in inches: about 1.4 times the 8.5 points of their text.
_NAME_DISTANCE = 0.165

#: Matplotlib's markers for the marks of a picture.
_MARKERS = {"dot": ".", "circle": "o", "square": "s", "diamond": "D", "triangle": "^"}
_MARKERS |= {"cross": "x", "bar": "_", "stick": "|"}

#: Characters of title and remark that an inch holds.
_HEAD_CHARACTERS = 9.5

#: Pieces of a line between two points, whose colour changes along it.
_PIECES = 16


def painted(picture: Picture, ax: Axes | Sequence[Axes] | None = None, *, dark: bool = False) -> Axes:
    """Paint a picture on axes, one for each of its first panels, and return the first; on those of a new figure by default."""
    given = (ax,) if ax is not None and not isinstance(ax, Sequence | np.ndarray) else ax
    axes: tuple[Axes, ...] = new_axes(picture, dark=dark) if given is None else tuple(given)
    shown = list(picture.panels[: len(axes)])
    shown[-1] = replace(shown[-1], x=replace(shown[-1].x, label=picture.panels[-1].x.label))
    pairs = list(zip(axes, shown, strict=False))
    for k, (each, panel) in enumerate(pairs):
        _Brush(each, panel, dark).paint(last=k == len(pairs) - 1)
    _Brush(pairs[-1][0], pairs[-1][1], dark).key(picture, [each for each, _ in pairs])
    return pairs[0][0]


def new_axes(picture: Picture, *, dark: bool = False, figure: Figure | None = None) -> tuple[Axes, ...]:
    """Return axes for every panel of a picture, in a new figure made by pyplot, so that notebooks show it."""
    if figure is None:
        from matplotlib import pyplot

        size = picture.size[0] / 100, picture.size[1] / 100
        figure = pyplot.figure(figsize=size, dpi=DPI, layout="constrained", facecolor=INKS["paper"][dark])
    shares = [panel.share for panel in picture.panels]
    return tuple(np.atleast_1d(figure.subplots(len(shares), 1, height_ratios=shares)).tolist())


def png(picture: Picture, dots: float = 140, size: tuple[float, float] | None = None) -> bytes:
    """Return a picture as PNG; `size`: in inches, that of the picture by default."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size or (picture.size[0] / 100, picture.size[1] / 100), layout="constrained")
    painted(picture, new_axes(picture, figure=figure))
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dots)
    return buffer.getvalue()


def escaped(text: str) -> str:
    """Return a text as Matplotlib writes it, with its dollar signs."""
    return text.replace("$", r"\$")


@dataclass(frozen=True, slots=True)
class _Brush:
    """The axes of a panel, painted on white or on dark ground."""

    ax: Axes
    panel: Panel
    dark: bool

    def paint(self, *, last: bool) -> None:
        """Draw the panel; the last one below others has the words of the horizontal axis."""
        if self.panel.behind is not None:
            self._behind(*self.panel.behind)
        for item in self.panel.items:
            self.draw(item)
        self._dress()
        self._scale(self.panel.x, "x")
        self._scale(self.panel.y, "y")
        self._marked()
        if not last:
            self.ax.tick_params(labelbottom=self.panel.labelled)

    def ink(self, name: str) -> str:
        """Return the colour of an ink."""
        return INKS[name][self.dark]

    def draw(self, item: Item, zorder: float = 2.0) -> None:
        """Draw one of the things of which pictures are made."""
        if isinstance(item, Words):
            self._words(item)
            return
        look: dict[str, Any] = {"label": escaped(item.words) or None, "zorder": zorder}
        if isinstance(item, Areas):
            self._areas(item, look)
        elif item.tones is not None:
            self._toned(item)
        else:
            self.ax.plot(item.x, item.y, color=self.ink(item.ink), **look, **_look_of(item))

    def _areas(self, item: Areas, look: dict[str, Any]) -> None:
        from matplotlib.collections import PolyCollection

        if not len(item.corners):
            return
        strength = np.broadcast_to(np.asarray(item.strength, dtype=float), len(item.corners))
        look |= {"facecolors": self.ink(item.ink), "alpha": strength}
        if item.tones is not None:
            edge = {"edgecolors": self.ink("paper"), "zorder": 3}
            look = {"array": item.tones, "alpha": float(strength[0]), **edge, **self._signed()}
        areas = PolyCollection(list(item.corners), **look)
        self.ax.add_collection(areas, autolim=True)

    def _toned(self, item: Line | Marks) -> None:
        """Draw a line or marks whose colours change with their tones."""
        from matplotlib.collections import LineCollection

        x, y, tones = (np.asarray(side, dtype=float) for side in (item.x, item.y, item.tones))
        if isinstance(item, Marks):
            style: dict[str, Any] = {"edgecolors": self.ink("paper"), "linewidths": 0.7, "zorder": 5}
            self.ax.scatter(x, y, s=34 * item.size, c=tones, **style, **self._signed(dots=True))
            return
        share = np.linspace(0, 1, _PIECES + 1)[:, None]
        across, upward, colours = (side[:-1] * (1 - share) + side[1:] * share for side in (x, y, tones))
        ends = np.stack([np.stack([side[:-1], side[1:]], axis=-1) for side in (across, upward)], axis=-1)
        values = (colours[:-1] + colours[1:]) / 2
        kept = np.isfinite(ends).all(axis=(2, 3))
        style = {"linewidths": 1.1 * item.width, "capstyle": "round", "zorder": 4}
        lines: Any = LineCollection(list(ends[kept]), array=values[kept], **style, **self._signed())
        self.ax.add_collection(lines, autolim=True)

    def _signed(self, *, dots: bool = False) -> dict[str, Any]:
        """Return how tones from -1 to 1 are coloured."""
        from matplotlib.colors import LinearSegmentedColormap

        inks = [self.ink(name) for name in ("blue", "middle", "vermillion")]
        ends: dict[str, Any] = {"vmin": -1, "vmax": 1} if dots else {"clim": (-1, 1)}
        return {"cmap": LinearSegmentedColormap.from_list("modalscope", inks), **ends}

    def _words(self, item: Words) -> None:
        sides = {"left": "left", "middle": "center", "right": "right"}
        style: dict[str, Any] = {"color": self.ink(item.ink), "fontsize": 9, "va": "center", "zorder": 6}
        style |= {"rotation": 90, "ha": "right", "va": "top"} if item.turned else {"ha": sides[item.side]}
        for x, y, text in zip(item.x, item.y, item.texts, strict=True):
            self.ax.text(x, y, escaped(text), **style)

    def _behind(self, axis: Axis, lines: Sequence[Line]) -> None:
        """Draw lines on a vertical axis of their own, at the right, behind all else."""
        twin = self.ax.twinx()
        self.ax.set_zorder(twin.get_zorder() + 1)
        self.ax.patch.set_visible(False)
        brush = _Brush(twin, self.panel, self.dark)
        for k, line in enumerate(lines):
            brush.draw(line, zorder=len(lines) - k)
        brush._scale(axis, "y")
        twin.set_ylabel(escaped(axis.label), fontsize=9.5, color=self.ink("muted"))
        twin.tick_params(labelsize=8.5, labelcolor=self.ink("muted"), color=self.ink("pale"), length=2)
        twin.tick_params(which="minor", length=0)
        twin.spines[:].set_visible(False)

    def _dress(self) -> None:
        """Set title, labels, grid and frame."""
        ax, panel, ink = self.ax, self.panel, self.ink
        ax.set_facecolor(ink("paper"))
        ax.set_title(escaped(panel.title), loc="left", fontsize=11.5, color=ink("ink"), fontweight="bold", pad=8)
        if len(panel.title) + len(panel.aside) < _HEAD_CHARACTERS * self._inches():
            ax.set_title(escaped(panel.aside), loc="right", fontsize=9.5, color=ink("muted"), pad=8)
        if panel.equal:
            ax.set_aspect("equal", adjustable="box")
        ax.set_xlabel(escaped(panel.x.label), fontsize=10.5, color=ink("ink"))
        ax.set_ylabel(escaped(panel.y.label), fontsize=10.5, color=ink("ink"))
        ax.tick_params(labelsize=9.5, color=ink("pale"), labelcolor=ink("ink"), length=3.5, width=0.8)
        ax.tick_params(which="minor", length=0)
        ax.set_axisbelow(True)
        if panel.bare:
            ax.set_axis_off()
        elif panel.grid:
            ax.grid(visible=True, color=ink("grid"), linewidth=0.7)
        for side, spine in ax.spines.items():
            spine.set_visible(side in ("left", "bottom"))
            spine.set_color(ink("pale"))

    def _scale(self, axis: Axis, side: str) -> None:
        """Set ends and ticks of one side: Matplotlib's own round numbers, which follow a zoom, where they are not named."""
        from matplotlib.ticker import LogLocator, NullFormatter

        across = side == "x"
        own = self.ax.xaxis if across else self.ax.yaxis
        if axis.log:
            (self.ax.set_xscale if across else self.ax.set_yscale)("log")
            if axis.high / axis.low < 1000:  # plain numbers 1, 2, 5, 10: the axis may cover less than a decade
                own.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                own.set_major_formatter(lambda number, _: f"{number:g}")
                own.set_minor_formatter(NullFormatter())
        (self.ax.set_xlim if across else self.ax.set_ylim)(axis.low, axis.high)
        if axis.named is not None or axis.dates:
            ticks = axis.ticks()
            own.set_ticks([at for at, _ in ticks], [escaped(words) for _, words in ticks])
            if across and axis.upright:
                self.ax.tick_params(axis="x", rotation=90)

    def _inches(self) -> float:
        """Return how wide the axes are."""
        figure: Any = self.ax.get_figure()
        return 1.0 if figure is None else float(self.ax.get_position().width * figure.get_figwidth())

    def _marked(self) -> None:
        """Draw a line at every marked place, with its name above the axes, apart from its neighbours."""
        ax, axis, colour = self.ax, self.panel.x, self.ink("vermillion")
        at: Array = np.array([place for place, _ in self.panel.marked])
        shares, across = dodge(axis.shares(at), gap=_NAME_DISTANCE / self._inches()), ax.get_xaxis_transform()
        style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 8.5, "color": colour, "rotation": 90}
        for (place, name), share in zip(self.panel.marked, shares, strict=True):
            x = axis.low + share * (axis.high - axis.low)
            ax.axvline(place, color=colour, linewidth=0.9, linestyle=(0, (5, 3)), zorder=1.5)
            ax.plot([place, x], [1.0, 1.03], transform=across, color=colour, linewidth=0.8, clip_on=False)
            ax.text(x, 1.04, escaped(name), transform=across, **style)

    def key(self, picture: Picture, axes: Sequence[Axes]) -> None:
        """Add a key in rows below the axis label."""
        from matplotlib.transforms import ScaledTranslation

        pairs = [pair for each in axes for pair in zip(*each.get_legend_handles_labels(), strict=True)]
        found = {label: handle for handle, label in pairs}
        named = [words for words in (escaped(item.words) for item in picture.key()) if words in found]
        figure = self.ax.get_figure()
        if not named or figure is None:
            return
        # a distance in inches clears ticks and label at any height of the axes
        place = self.ax.transAxes + ScaledTranslation(0, -_LEGEND_DISTANCE, figure.dpi_scale_trans)
        look: dict[str, Any] = {"frameon": False, "fontsize": 9.5, "labelcolor": self.ink("ink"), "columnspacing": 1.6}
        look |= {"loc": "upper left", "ncols": picture.columns, "borderaxespad": 0.0, "bbox_to_anchor": (0.0, 0.0)}
        self.ax.legend([found[words] for words in named], named, bbox_transform=place, handletextpad=0.5, **look)


def _look_of(item: Line | Marks) -> dict[str, Any]:
    """Return how Matplotlib draws a line, or marks."""
    mark = _MARKERS.get(item.mark, "")
    if isinstance(item, Line):
        dashes: dict[str, Any] = {"linestyle": (0, (4, 1.6))} if item.dashed else {}
        return {"linewidth": 1.1 * item.width, "marker": mark, "markersize": 5.0, **dashes}
    look: dict[str, Any] = {"linestyle": "none", "marker": mark, "markersize": 6 * np.sqrt(item.size)}
    if item.letter:
        return look | {"marker": rf"$\mathbf{{{item.letter}}}$", "markeredgewidth": 0}
    return look | ({"markerfacecolor": "none"} if item.hollow else {})
