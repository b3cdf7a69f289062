"""The IASC-ASCE structural health monitoring benchmark, phase I: the shear-building model with 12 degrees of freedom.

A four-storey steel frame of two by two bays, 2.5 m by 2.5 m in plan and 3.6 m tall, at the University of British Columbia.
Source: E. A. Johnson, H. F. Lam, L. S. Katafygiotis, J. L. Beck, "Phase I IASC-ASCE structural health monitoring benchmark
problem using simulated data", Journal of Engineering Mechanics 130 (2004) 3-15.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import DataError
from modalscope.model.entries import plainly
from modalscope.model.geometry import Geometry
from modalscope.systems.chains import joined
from modalscope.systems.modal import modal_damping
from modalscope.systems.structure import Structure

__all__ = ["iasc_asce"]

#: Stiffness of a storey along x (the columns' strong direction) and y, N/m, and about the vertical axis, N m.
_STIFFNESS = (106.60e6, 67.90e6, 232.02e6)

#: A brace: Young's modulus, Pa; area, m2; and the frame's storey height and half width, m.
_E, _BRACE, _HEIGHT, _HALF = 2e11, 0.141e-3, 0.9, 1.25

#: Mass of every floor, kg, and its moment of inertia about the vertical axis, kg m2, with the members' shares.
_MASS = (3452.4, 2652.4, 2652.4, 1809.9)
_INERTIA = (3819.4, 2986.1, 2986.1, 2056.9)


@plainly
def iasc_asce(*, without_braces: Iterable[int] = (), damping_ratio: float = 0.01) -> Structure:
    """Return the 12-DOF shear building of the IASC-ASCE benchmark: 9.41, 11.79, 16.38, 25.54 ... 83.62 Hz.

    Floors are rigid and move along x (the columns' strong direction), along y and about the vertical axis. A storey has
    nine columns and eight braces, two in every face, each of E A cos^2 / L along its face.

    Parameters
    ----------
    without_braces : sequence of int
        Storeys, 1 to 4, that lost all their braces: (1,) is the benchmark's damage pattern 1 and (1, 3) its pattern 2.
    damping_ratio : float
        Of every mode; 1 % in the benchmark.

    Returns
    -------
    Structure
        Degrees of freedom `1:+X`, `1:+Y`, `1:+RZ`, `2:+X` ... `4:+RZ`, sampled at 1000 Hz.

    Examples
    --------
    >>> iasc_asce().modes().frequencies.round(2).tolist()
    [9.41, 11.79, 16.38, 25.54, 32.01, 38.66, 44.64, 48.01, 48.44, 60.15, 67.48, 83.62]
    """
    lost = set(without_braces)
    if not lost <= {1, 2, 3, 4}:
        raise DataError(
            f"storeys {sorted(lost)} without braces were asked", "the storeys are 1 to 4", "Name some of these."
        )
    missing = np.array([storey in lost for storey in (1, 2, 3, 4)], dtype=float)
    length = np.hypot(_HALF, _HEIGHT)
    brace = _E * _BRACE / length * (_HALF / length) ** 2
    # along x as along y two faces of two braces carry, about the vertical axis all eight, half the width away
    shares = (4 * brace, 4 * brace, 8 * brace * _HALF**2)
    storeys = (total - share * missing for total, share in zip(_STIFFNESS, shares, strict=True))
    by_direction = sla.block_diag(*(joined("stiffnesses", k, 4) for k in storeys))
    floor_first = np.arange(12).reshape(3, 4).T.ravel()
    K = by_direction[np.ix_(floor_first, floor_first)]
    M = np.diag(np.column_stack([_MASS, _MASS, _INERTIA]).ravel())
    return Structure(
        mass=M,
        stiffness=K,
        damping=modal_damping(M, K, damping_ratio),
        dofs=tuple(f"{floor}:{direction}" for floor in (1, 2, 3, 4) for direction in ("+X", "+Y", "+RZ")),
        dt=0.001,
        geometry=_frame(),
        name="iasc_asce",
    )


def _corner(floor: int, k: int) -> str:
    """Number of a corner: 1 to 4 on the ground, 101 to 104 on the first floor, and so on."""
    return str(100 * floor + k + 1)


def _frame() -> Geometry:
    """Return the frame's corners, which move with their floor's centre and turn about it."""
    corners = [(-_HALF, -_HALF), (_HALF, -_HALF), (_HALF, _HALF), (-_HALF, _HALF)]
    nodes = [(_corner(floor, k), x, y, floor * _HEIGHT) for floor in range(5) for k, (x, y) in enumerate(corners)]
    lines = [(_corner(floor, k), _corner(floor, (k + 1) % 4)) for floor in range(1, 5) for k in range(4)]
    lines += [(_corner(floor, k), _corner(floor + 1, k)) for floor in range(4) for k in range(4)]
    motions = {}
    for floor in range(1, 5):
        here = [(_corner(floor, k), x, y) for k, (x, y) in enumerate(corners)]
        motions[f"{floor}:+X"] = tuple((node, (1.0, 0.0, 0.0)) for node, _, _ in here)
        motions[f"{floor}:+Y"] = tuple((node, (0.0, 1.0, 0.0)) for node, _, _ in here)
        motions[f"{floor}:+RZ"] = tuple((node, (-y, x, 0.0)) for node, x, y in here)
    names = tuple(node for node, *_ in nodes)
    return Geometry(
        nodes=names, coordinates=np.array([xyz for _, *xyz in nodes]), lines=np.array(lines), motions=motions
    )
