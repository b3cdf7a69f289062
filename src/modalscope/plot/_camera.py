"""Project nodes to the paper: along a line, in a plane, or in perspective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.numerics.checks import Array, RealArray

#: A direction counts as absent when it holds less than this share of the size of the structure or of the motion.
_FLAT = 1e-6

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
    """Look at the structure from `elevation` degrees above, `azimuth` degrees round the vertical z axis."""
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return View("space", np.column_stack([right, np.cross(towards, right)]), towards)


def view_of(coordinates: RealArray, motion: RealArray) -> View:
    """Choose the clearest view: a line over its length, a plane that moves in itself flat, all else obliquely.

    `coordinates` (n, 3). `motion` (n, 3): displacement of the nodes.
    """
    size = extent(coordinates)
    centred = coordinates - coordinates.mean(axis=0)
    _, spread, directions = np.linalg.svd(centred, full_matrices=True)
    spread = np.pad(spread, (0, 3 - spread.size))
    if spread[1] <= _FLAT * size:
        along = directions[0] * (np.sign(directions[0][np.argmax(np.abs(directions[0]))]) or 1.0)
        return View("line", np.column_stack([along, along]), along, (_name(along), ""))
    normal = directions[2]
    through = float(np.max(np.abs(motion @ normal), initial=0.0))
    if spread[2] <= _FLAT * size and through <= _FLAT * float(np.max(np.abs(motion), initial=0.0)):
        return _flat(normal, directions)
    # a wing or a floor is seen from higher up, so that its outline opens
    lies = spread[2] <= _FLAT * size and abs(normal[2]) > 1 - _FLAT
    return oblique(elevation=40.0) if lies else oblique()


def _flat(normal: RealArray, directions: RealArray) -> View:
    """Keep two coordinate axes where the plane is parallel to them, else the plane's own directions."""
    along = int(np.argmax(np.abs(normal)))
    if abs(normal[along]) > 1 - _FLAT:
        kept = [axis for axis in range(3) if axis != along]
        return View("plane", np.eye(3)[:, kept], normal, (AXES[kept[0]], AXES[kept[1]]))
    return View("plane", np.ascontiguousarray(directions[:2].T), normal)


def _name(direction: RealArray) -> str:
    largest = int(np.argmax(np.abs(direction)))
    return AXES[largest] if abs(direction[largest]) > 1 - _FLAT else "length"
