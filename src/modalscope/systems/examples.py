"""Build structures with repeated and close modes, and a free decay with published results."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from modalscope.data.geometry import Geometry
from modalscope.data.responses import ImpulseResponse
from modalscope.numerics.arguments import plainly
from modalscope.numerics.errors import DataError
from modalscope.systems.chains import joined, row_geometry
from modalscope.systems.modal import modal_damping
from modalscope.systems.structure import Structure

# The IASC-ASCE structural health monitoring benchmark, phase I: the shear-building model with 12 degrees of freedom.
#
# A four-storey steel frame of two by two bays, 2.5 m by 2.5 m in plan and 3.6 m tall, at the University of British Columbia.
# Source: E. A. Johnson, H. F. Lam, L. S. Katafygiotis, J. L. Beck, "Phase I IASC-ASCE structural health monitoring benchmark
# problem using simulated data", Journal of Engineering Mechanics 130 (2004) 3-15.

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
        raise DataError(f"storeys {sorted(lost)} without braces:", "the storeys are 1 to 4", "Name some of these.")
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


def ring5() -> Structure:
    """Five masses in a ring: two exactly repeated pairs of poles, and a mode in which all move alike."""
    shift = np.roll(np.eye(5), 1, axis=0)
    K = 100 * np.eye(5) + 300 * (2 * np.eye(5) - shift - shift.T)
    angle = 2 * np.pi * np.arange(5) / 5
    nodes = tuple(str(i + 1) for i in range(5))
    geometry = Geometry(
        nodes=nodes,
        coordinates=np.column_stack([np.cos(angle), np.sin(angle), np.zeros(5)]),
        lines=np.column_stack([nodes, np.roll(nodes, -1)]),
    )
    return Structure(
        mass=np.eye(5),
        stiffness=K,
        damping=0.2 * np.eye(5) + 6e-4 * K,
        outputs=(0, 1, 2, 3),
        inputs=(0, 1),
        dofs=tuple(f"{node}:+Z" for node in nodes),
        dt=0.05,
        geometry=geometry,
        name="ring5",
    )


def close4() -> Structure:
    """Two weakly joined pairs of masses: two pairs of modes 2.8 % and 0.16 % apart with about 1 % damping."""
    k = 400.0
    pair = np.array([[2 * k, -k], [-k, k]])
    link = np.array([0.0, 1.0, 0.0, -1.0])
    K = sla.block_diag(pair, pair) + 6 * np.outer(link, link)
    D = 0.25 * np.eye(4) + 4e-4 * K
    return Structure(
        mass=np.eye(4), stiffness=K, damping=D, inputs=(1, 2), dt=0.05, geometry=row_geometry(4), name="close4"
    )


def three_masses() -> Structure:
    """Three masses of 1.33603, 7.39083 and 13.79671 Hz with 2, 7.5 and 5 %: the documented ERA example of pyyeti."""
    K = np.array([[4185.1498, 576.6947, 3646.8923], [576.6947, 2104.9252, -28.0450], [3646.8923, -28.0450, 3451.5583]])
    D = np.array(
        [
            [4.96765646, 0.97182432, 4.0162425],
            [0.97182432, 6.71403672, -0.86138453],
            [4.0162425, -0.86138453, 4.28850828],
        ]
    )
    return Structure(mass=np.eye(3), stiffness=K, damping=D, dt=0.01, geometry=row_geometry(3), name="three_masses")


@plainly
def three_masses_record(*, noisy: bool = True) -> ImpulseResponse:
    """Return 100 samples of the velocities of `three_masses` after all start at 1 m/s, with the published noise.

    The noise is normal with a standard deviation of 0.05 m/s, drawn by numpy's PCG64DXSM of seed 1 as (outputs, samples).

    Parameters
    ----------
    noisy : bool
        Whether the noise is there.
    """
    decay = three_masses().free_decay(100, velocity=np.ones(3), quantity="velocity")
    if not noisy:
        return decay
    noise = 0.05 * np.random.Generator(np.random.PCG64DXSM(seed=1)).normal(size=(3, 100))
    return replace(decay, values=decay.values + noise.T[:, :, None]).processed("published noise added, 0.05 m/s")
