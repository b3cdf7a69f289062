"""Structures with repeated and close modes, and a free decay that others published results for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from modalscope.model.entries import plainly
from modalscope.model.geometry import Geometry
from modalscope.model.impulse import ImpulseResponse
from modalscope.systems.chains import row_geometry
from modalscope.systems.structure import Structure

__all__ = ["close4", "ring5", "three_masses", "three_masses_record"]


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
