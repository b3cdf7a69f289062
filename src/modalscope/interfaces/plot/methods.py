"""Describe the map of methods, the distances between them, and their deviations from the consensus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from modalscope.analysis.comparing import Comparison, MethodResult
from modalscope.analysis.comparing.kinship import Kinship
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import (
    Areas,
    Axis,
    Item,
    Marks,
    Panel,
    Picture,
    Words,
    axis_of_names,
    boxes,
    dodge,
    level,
    plain,
    strokes,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Ink and mark of each domain.
_DOMAINS = {"time": ("blue", "circle"), "z": ("vermillion", "square"), "s": ("green", "triangle")}

#: Share of the place of a mode that the methods take.
_WIDTH = 0.64

#: Characters of the name of a method at most; of a name that several share.
_MAX_NAME, _MAX_NAMES = 34, 60


@named(kin=(Comparison, Kinship))
def method_map(kin: Comparison | Kinship, ax: Axes | None = None) -> Axes:
    """Draw the map of methods: methods at the same place have the same poles.

    Parameters
    ----------
    kin : Comparison or Kinship
    ax : Axes, optional
    """
    return painted(map_picture(kin), ax)


def map_picture(compared: Comparison | Kinship) -> Picture:
    """Return the map of methods: those at one place have the same poles, and are concentric rings."""
    kin = compared.kinship if isinstance(compared, Comparison) else compared
    places, label = kin.places, "distance [half-power half-bandwidths]"
    if not len(places):
        return Picture([Panel(Axis(label), Axis(label), title="Map of methods")], "Map of methods")
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float(high[0] - low[0]), 1.8 * float(high[1] - low[1]), 1e-3)
    middle = (low + high) / 2
    x = Axis(label, middle[0] - 0.6 * size, middle[0] + 1.15 * size)
    y = Axis(label, middle[1] - 0.45 * size, middle[1] + 0.45 * size)
    order = sorted(kin.classes, key=lambda members: float(places[members[0], 1]))
    points = places[[members[0] for members in order]]
    heights = y.low + (y.high - y.low) * dodge(y.shares(points[:, 1]), gap=0.05, low=0.02, high=0.98)
    ends = np.column_stack([np.full(len(order), float(high[0]) + 0.1 * size), heights])
    names = [plain(" = ".join(kin.labels[i] for i in members), _MAX_NAMES) for members in order]
    items: list[Item] = [strokes(np.stack([points, ends], axis=1)), Words(ends[:, 0], ends[:, 1], names, side="left")]
    for members in kin.classes:
        for rank, i in enumerate(members):
            domain = kin.methods[i].domain if kin.methods else "time"
            ink, mark = _DOMAINS.get(domain, ("ink", "diamond"))
            mark = "circle" if rank else mark
            at = places[[i]].T
            items.append(Marks(at[0], at[1], ink, mark, f"domain {domain}", 1 + 1.3 * rank, hollow=rank > 0))
    panel = Panel(x, y, items, "Map of methods", f"poles of order {kin.order}", equal=True)
    return Picture([panel], "Map of methods", (960, 560))


@named(comparison=Comparison)
def deviations(comparison: Comparison, axes: tuple[Axes, Axes] | None = None) -> tuple[Axes, Axes]:
    """Draw the deviation of every method from the consensus, mode by mode, over the stated scatter.

    Parameters
    ----------
    comparison : Comparison
    axes : (Axes, Axes), optional
        For frequency (in half-power half-bandwidths) and damping (in per cent of its value).
    """
    first = painted(deviations_picture(comparison), axes)
    return axes if axes is not None else tuple(first.figure.axes[:2])  # type: ignore[return-value]


def deviations_picture(c: Comparison) -> Picture:
    """Return the deviation of every method from the consensus; modes in doubt do not set the scale, open marks have no vote."""
    panels, names = [], [f"{g.frequency:.5g}" for g in c.groups]
    for kind, unit in (("frequency", "half-power half-bandwidths"), ("damping", "% of its value")):
        low, high = reach_of(c, kind)
        places = np.arange(len(c.groups))
        width = np.array([float(np.fmin(scatter_of(c, kind, k), high)) for k in range(len(c.groups))])
        across = axis_of_names("mode [Hz]" if kind == "damping" else "", names)
        items: list[Item] = [Areas(boxes(places - 0.42, places + 0.42, -width, width)), level(across)]
        for r, x, y in deviations_of(c, kind):
            ink, mark = _DOMAINS.get(r.method.domain, _DOMAINS["time"])
            items.append(Marks(x, y, ink, mark, f"domain {r.method.domain}", 0.7, not r.exact))
        panels.append(Panel(across, Axis(unit, low, high), items, kind.capitalize()))
    return Picture(panels, "Deviation of every method from the consensus")


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
