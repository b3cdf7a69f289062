"""Project nodes to the paper: along a line, in a plane, or obliquely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.numerics.checks import Array, RealArray

#: Extent, relative to the structure or its motion, below which a direction is absent.
_FLAT_SHARE = 1e-6

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class View:
    """A parallel projection: coordinates (n, 3) @ `matrix` (3, 2) on paper, and the distance along `depth` (3,).

    `kind`: `line` (displacement drawn over position), `plane` (motion in the plane of the nodes) or `space`.
    """

    kind: str
    matrix: RealArray
    depth: RealArray
    names: tuple[str, str] = ("", "")


def extent(coordinates: Array) -> float:
    """Return the length of the diagonal of the box around the nodes."""
    return float(np.linalg.norm(np.ptp(coordinates, axis=0)))


def oblique(azimuth: float = -62.0, elevation: float = 24.0) -> View:
    """Return the view from `elevation` degrees above, `azimuth` degrees around the vertical z axis."""
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return View("space", np.column_stack([right, np.cross(towards, right)]), towards)


def view_of(coordinates: RealArray, motion: RealArray) -> View:
    """Choose the view: a line over its length, a plane with motion in the plane flat, all else obliquely.

    `coordinates` (n, 3). `motion` (n, 3): displacement of the nodes.
    """
    size = extent(coordinates)
    centred = coordinates - coordinates.mean(axis=0)
    _, spread, directions = np.linalg.svd(centred, full_matrices=True)
    spread = np.pad(spread, (0, 3 - spread.size))
    if spread[1] <= _FLAT_SHARE * size:
        along = directions[0] * (np.sign(directions[0][np.argmax(np.abs(directions[0]))]) or 1.0)
        largest = int(np.argmax(np.abs(along)))
        name = AXES[largest] if abs(along[largest]) > 1 - _FLAT_SHARE else "length"
        return View("line", np.column_stack([along, along]), along, (name, ""))
    normal = directions[2]
    through = float(np.max(np.abs(motion @ normal), initial=0.0))
    if spread[2] <= _FLAT_SHARE * size and through <= _FLAT_SHARE * float(np.max(np.abs(motion), initial=0.0)):
        return _flat(normal, directions)
    # a wing or a floor needs a higher elevation
    lies = spread[2] <= _FLAT_SHARE * size and abs(normal[2]) > 1 - _FLAT_SHARE
    return oblique(elevation=40.0) if lies else oblique()


def _flat(normal: RealArray, directions: RealArray) -> View:
    """Return the view on a plane: along two coordinate axes if it is parallel to them, else along its principal directions."""
    along = int(np.argmax(np.abs(normal)))
    if abs(normal[along]) > 1 - _FLAT_SHARE:
        kept = [axis for axis in range(3) if axis != along]
        return View("plane", np.eye(3)[:, kept], normal, (AXES[kept[0]], AXES[kept[1]]))
    return View("plane", np.ascontiguousarray(directions[:2].T), normal)
