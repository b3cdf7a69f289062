"""Draw the map of methods, and their deviations from the consensus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.analysis.comparing import Comparison, MethodResult
from modalscope.analysis.comparing.kinship import Kinship
from modalscope.interfaces.plot._style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    PALE,
    VERMILLION,
    aside,
    dodge,
    dress,
    key,
    new_axes,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray, check_kind

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colour and marker of each domain.
_DOMAINS = {"time": (BLUE, "o"), "z": (VERMILLION, "s"), "s": (GREEN, "^")}

#: Share of the place of a mode that the methods take.
_WIDTH = 0.64


@named()
def method_map(kin: Comparison | Kinship, ax: Axes | None = None) -> Axes:
    """Draw the map of methods: methods at the same place have the same poles.

    Parameters
    ----------
    kin : Comparison or Kinship
    ax : Axes, optional
    """
    check_kind("a map of methods", kin, (Comparison, Kinship))
    kin = kin.kinship if isinstance(kin, Comparison) else kin
    ax = new_axes(ax, (8.0, 6.0))
    places = kin.places
    dress(
        ax,
        title="Map of methods",
        xlabel="distance [half-power half-bandwidths]",
        ylabel="distance [half-power half-bandwidths]",
    )
    if not len(places):
        return ax
    labelled: set[str] = set()
    for members in kin.classes:
        for rank, i in enumerate(members):
            style = _style_of(kin.methods[i].domain if kin.methods else "unknown", labelled)
            # equal methods are concentric rings
            style |= {"markersize": np.sqrt(46 * (1 + 1.3 * rank)), "markeredgewidth": 1.4, "zorder": 3}
            ax.plot(*places[i], markerfacecolor=style["color"] if rank == 0 else "none", **style)
    _square(ax, places)
    _name(ax, kin, places)
    key(ax)
    aside(ax, f"poles of order {kin.order}")
    return ax


def _style_of(domain: str, labelled: set[str]) -> dict[str, Any]:
    """Return colour and marker of a domain, with its label for the first method of it."""
    colour, marker = _DOMAINS.get(domain, (INK, "D"))
    label = None if domain in labelled else f"domain {domain}"
    labelled.add(domain)
    return {"color": colour, "marker": marker, "linestyle": "none", "label": label}


def _square(ax: Axes, places: RealArray) -> None:
    """Set equal scales, with room for names at the right."""
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float(high[0] - low[0]), 1.8 * float(high[1] - low[1]), 1e-3)
    middle = (low + high) / 2
    ax.set_xlim(middle[0] - 0.6 * size, middle[0] + 1.15 * size)
    ax.set_ylim(middle[1] - 0.45 * size, middle[1] + 0.45 * size)
    ax.set_aspect("equal", adjustable="box")


def _name(ax: Axes, kin: Kinship, places: RealArray) -> None:
    """Write names at the right of their points without overlap."""
    order = sorted(kin.classes, key=lambda members: float(places[members[0], 1]))
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    heights = dodge((places[[m[0] for m in order], 1] - y0) / (y1 - y0), gap=0.05, low=0.02, high=0.98)
    for members, height in zip(order, heights, strict=True):
        x, y = places[members[0]]
        text = " = ".join(kin.labels[i] for i in members)
        at = (float(places[:, 0].max()) + 0.06 * (x1 - x0), y0 + height * (y1 - y0))
        line = {"arrowstyle": "-", "color": PALE, "linewidth": 0.7, "shrinkA": 1, "shrinkB": 5}
        ax.annotate(text, xy=(x, y), xytext=at, fontsize=8.5, color=INK, va="center", arrowprops=line)


@named()
def deviations(comparison: Comparison, axes: tuple[Axes, Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw the deviation of every method from the consensus, mode by mode, over the stated scatter.

    Parameters
    ----------
    comparison : Comparison
    axes : (Axes, Axes), optional
        For frequency (in half-power half-bandwidths) and damping (in per cent of its value).
    """
    check_kind("a plot of deviations", comparison, Comparison)
    if axes is None:
        from matplotlib import pyplot

        axes = pyplot.figure(figsize=(9.0, 6.0), layout="constrained").subplots(2, 1, sharex=True)
    upper, lower = axes
    groups = comparison.groups
    for ax, kind, unit in ((upper, "frequency", "half-power half-bandwidths"), (lower, "damping", "% of its value")):
        labelled: set[str] = set()
        for k in range(len(groups)):
            width = scatter_of(comparison, kind, k)
            ax.fill_between([k - 0.42, k + 0.42], -width, width, color=PALE, alpha=0.35, linewidth=0)
        for r, x, y in deviations_of(comparison, kind):
            style = _style_of(r.method.domain, labelled)
            ax.plot(x, y, markerfacecolor=style["color"] if r.exact else "white", markersize=4.5, **style)
        ax.axhline(0, color=MUTED, linewidth=0.8)
        # modes that are in doubt do not set the scale
        ax.set_ylim(*reach_of(comparison, kind))
        dress(ax, title=kind.capitalize(), ylabel=unit)
    lower.set_xticks(range(len(groups)), [f"{g.frequency:.5g}" for g in groups], rotation=90 if len(groups) > 9 else 0)
    lower.set_xlabel("mode [Hz]", fontsize=10.5, color=INK)
    if groups:
        upper.legend(frameon=False, fontsize=9, ncols=3, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.2)
    return upper, lower


def scatter_of(c: Comparison, kind: str, k: int) -> float:
    """Return the stated scatter of a mode in the unit of its deviations."""
    return float(getattr(c.scatter, kind)[k]) / _size(c, kind, k)


def _size(c: Comparison, kind: str, k: int) -> float:
    """Return the unit of deviations of a mode: its half bandwidth, or a per cent of its damping."""
    return c.groups[k].half_bandwidth if kind == "frequency" else c.groups[k].damping / 100


def deviations_of(c: Comparison, kind: str) -> Iterator[tuple[MethodResult, RealArray, RealArray]]:
    """Yield every method that found a mode with the places and deviations of its modes."""
    kept = [r for r in c.results if r.modes is not None]
    name = "frequencies" if kind == "frequency" else "damping_ratios"
    for r, offset in zip(kept, np.linspace(-_WIDTH / 2, _WIDTH / 2, max(len(kept), 2)), strict=False):
        own = [k for k, g in enumerate(c.groups) if r.name in getattr(g, name)]
        if own:
            away = [getattr(c.groups[k], name)[r.name] - getattr(c.groups[k], kind) for k in own]
            yield r, np.array(own) + offset, np.array([d / _size(c, kind, k) for k, d in zip(own, away, strict=True)])


def reach_of(c: Comparison, kind: str) -> tuple[float, float]:
    """Return the ends of the scale: what the modes that are not doubtful need."""
    told = [k for k, trust in enumerate(c.trust) if trust.grade != "doubtful"]
    needed = [scatter_of(c, kind, k) for k in told]
    for _, x, y in deviations_of(c, kind):
        needed += np.abs(y[np.isin(np.round(x), told)]).tolist()
    limit = 1.15 * max((v for v in needed if np.isfinite(v)), default=0.0) or 1.0
    return -limit, limit
