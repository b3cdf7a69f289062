"""Describe places of sensors and forces on the geometry."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.analysis.planning.next_measurement import NextMeasurement
from modalscope.analysis.planning.placement import Placement
from modalscope.data import Geometry
from modalscope.interfaces.plot._camera import View, extent, oblique, view_of
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import Axis, Item, Marks, Panel, Picture, Words, plain, remark, strokes
from modalscope.interfaces.plot.shapes import measured_nodes, triad, with_lines
from modalscope.numerics.arguments import named

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Length of an arrow relative to the diagonal of the structure.
_ARROW = 0.1


@named(geometry=Geometry)
def places(found: Placement | NextMeasurement, geometry: Geometry, ax: Axes | None = None) -> Axes:
    """Draw where sensors and forces go: arrows on the structure at rest, numbered as they were chosen or are listed.

    Parameters
    ----------
    found : Placement or NextMeasurement
    geometry : Geometry
        Its nodes or motions have the places' labels.
    ax : Axes, optional
        Two-dimensional axes; a new figure by default.

    Raises
    ------
    DataError
        A geometry with none of the places.
    """
    return painted(places_picture(found, geometry), ax)


def places_picture(found: Placement | NextMeasurement, geometry: Geometry) -> Picture:
    """Return the places of sensors and forces on the geometry; a sentence where nothing is to be placed."""
    if isinstance(found, Placement):
        chosen = {"sensor": list(enumerate(found.sensors, 1)), "force": list(enumerate(found.forces, 1))}
    else:
        each = [("force" if s.kind == "repeat" else s.kind, k, s.place) for k, s in enumerate(found.steps, 1)]
        chosen = {kind: [(k, place) for own, k, place in each if own == kind] for kind in ("sensor", "force")}
    labels = tuple(place for some in chosen.values() for _, place in some)
    if not labels:
        return remark("No place lowers what is lacking.")
    joined = with_lines(geometry)
    measured_nodes(joined, labels)
    far, view = extent(joined.coordinates), view_of(joined.coordinates, joined.displaced(labels, np.ones(len(labels))))
    view = oblique() if view.kind == "line" else view
    rest = joined.coordinates @ view.matrix
    items: list[Item] = [strokes(rest[joined.lines]), Marks(rest[:, 0], rest[:, 1], "pale", size=0.4)]
    # a sensor points out of the structure, a force stands on the other side and acts along its direction
    length = {"sensor": _ARROW * far, "force": -_ARROW * far}
    arrows = [item for kind, some in chosen.items() for item in _arrows(joined, view, some, kind, length[kind])]
    reach = np.concatenate([rest, *(np.column_stack([w.x, w.y]) for w in arrows if isinstance(w, Words))])
    low, high = reach.min(axis=0) - 0.1 * far, reach.max(axis=0) + 0.1 * far
    across, upward = (Axis("", *ends, named=()) for ends in zip(low, high, strict=True))
    drawn = [*items, *arrows, *triad(view, low, far)]
    panel = Panel(across, upward, drawn, "Places of sensors and forces", equal=True, bare=True)
    return Picture([panel], f"Places on the geometry: {', '.join(labels)}")


def _arrows(geometry: Geometry, view: View, some: list[tuple[int, str]], kind: str, length: float) -> list[Item]:
    """Return arrows at numbered places, each with its number and label."""
    at = dict(zip(geometry.nodes, geometry.coordinates, strict=True))
    ends = [(at[n], at[n] + length * np.asarray(v)) for _, place in some for n, v in geometry.motion_of(place)]
    texts = [f"{k}. {plain(place, 14)}" for k, place in some for _ in geometry.motion_of(place)]
    both = np.array(ends).reshape(-1, 2, 3) @ view.matrix
    tip, beyond = both[:, 1], 1.4 * both[:, 1] - 0.4 * both[:, 0]
    ink, mark = ("blue", "circle") if kind == "sensor" else ("vermillion", "triangle")
    across, upward = (tip - both[:, 0]).T
    # a text beside its arrow begins or ends where that ends
    sides = np.where(np.abs(across) <= np.abs(upward), "middle", np.where(across > 0, "left", "right"))
    words = [Words(beyond[[k], 0], beyond[[k], 1], [text], ink, str(sides[k])) for k, text in enumerate(texts)]
    return [strokes(both, ink, 1.6), Marks(tip[:, 0], tip[:, 1], ink, mark, f"{kind}s" if texts else ""), *words]
