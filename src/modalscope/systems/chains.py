"""Model spring chains: masses in a row, and the five-storey chain with known modes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.geometry import Geometry
from modalscope.numerics.arguments import COUNT, POSITIVE, named, plainly
from modalscope.numerics.checks import RealArray, check_each, real_array
from modalscope.numerics.errors import DataError
from modalscope.systems.modal import modal_damping
from modalscope.systems.structure import Structure


@plainly
def chain(
    masses: ArrayLike,
    stiffnesses: ArrayLike,
    dampings: ArrayLike | None = None,
    *,
    damping_ratios: ArrayLike | None = None,
    outputs: Sequence[int] | None = None,
    inputs: Sequence[int] | None = None,
    dt: float | None = None,
    name: str = "chain",
) -> Structure:
    """Return masses in a row; spring and damper 0 join the first to the ground, spring i joins masses i - 1 and i.

    Parameters
    ----------
    masses, stiffnesses, dampings : sequence of float, (n,)
        kg, N/m, N s/m; no damping by default. One more spring, (n + 1,), joins the last mass to the ground.
    damping_ratios : float or sequence of float, (n,), optional
        Instead of dampers: the ratio of every mode, by rising frequency.
    outputs, inputs : sequence of int, optional
        Masses that are measured and forced, counted from zero; all by default. They are called `1:+X`, `2:+X`, ...
    dt : float, optional
        Sampling interval that suits the chain, seconds.
    name : str
        What the chain is called.

    Raises
    ------
    DataError
        Springs or dampers that do not fit the masses, or dampers and damping ratios both.

    Examples
    --------
    >>> chain([1, 1], [400, 400]).modes().frequencies.round(4).tolist()
    [1.9673, 5.1504]
    """
    m = real_array("masses", masses, "(masses,)", 1)
    k = real_array("stiffnesses", stiffnesses, "(springs,)", 1)
    if dampings is not None and damping_ratios is not None:
        raise DataError("a chain takes dampers or damping ratios", "both are given", "Give one of them.")
    M, K = np.diag(m), joined("stiffnesses", k, m.size)
    D = np.zeros_like(K)
    if damping_ratios is not None:
        D = modal_damping(M, K, real_array("damping_ratios", damping_ratios, "() or (modes,)", (0, 1)))
    elif dampings is not None:
        D = joined("dampings", real_array("dampings", dampings, "(dampers,)", 1), m.size)
    measured, forced = (
        None if at is None else tuple(check_each(name, at, "indices of masses"))
        for name, at in (("outputs", outputs), ("inputs", inputs))
    )
    return Structure(
        mass=M,
        stiffness=K,
        damping=D,
        outputs=measured,  # type: ignore[arg-type]  # None is completed by the constructor
        inputs=forced,  # type: ignore[arg-type]
        dt=dt,
        geometry=row_geometry(m.size),
        name=name,
    )


def joined(name: str, links: RealArray, masses: int) -> RealArray:
    """Return the matrix of springs or dampers in a row from the ground."""
    if links.size not in (masses, masses + 1):
        raise DataError(
            f"{masses} masses in a row need {masses} {name}, or {masses + 1} if the last mass is tied to the ground, too",
            f"there are {links.size}",
            "Give the one to the ground first.",
        )
    between = links[1:masses]
    matrix = np.diag(links[:masses] + np.append(links[1:], np.zeros(2 * masses))[:masses])
    return np.asarray(matrix - np.diag(between, 1) - np.diag(between, -1))


def row_geometry(count: int, axis: int = 0, spacing: float = 1.0) -> Geometry:
    """Return `count` nodes called 1, 2, ... in a row along an axis, from a last-numbered node on the ground.

    The ground has the number after the last mass, because file formats do not know a node 0.
    """
    coordinates = np.zeros((count + 1, 3))
    coordinates[:, axis] = spacing * np.arange(count + 1)
    nodes = tuple(str(i) for i in (count + 1, *range(1, count + 1)))
    return Geometry(nodes=nodes, coordinates=coordinates, lines=np.column_stack([nodes[:-1], nodes[1:]]))


def chain5() -> Structure:
    """Five masses in a row, non-proportional light damping of .25 to 1.6 %."""
    return chain(
        np.ones(5),
        np.full(5, 400.0),
        [0.4, 0.2, 0.6, 0.1, 0.3],
        outputs=[0, 1, 3, 4],
        inputs=[1, 4],
        dt=0.05,
        name="chain5",
    )


def heavy4() -> Structure:
    """Four masses in a row, damping ratios 1, 35, 2 and 1.5 %: one mode is heavily damped."""
    ratios = [0.01, 0.35, 0.02, 0.015]
    return chain(np.ones(4), np.full(4, 400.0), damping_ratios=ratios, inputs=[0, 3], dt=0.05, name="heavy4")


def over4() -> Structure:
    """Four masses in a row on a strong damper: two real poles."""
    return chain(np.ones(4), np.full(4, 400.0), [70.0, 0.3, 0.3, 0.3], inputs=[0, 3], dt=0.05, name="over4")


@named(n=COUNT, mass=POSITIVE, stiffness=POSITIVE)
def spring_chain(n: int = 5, *, mass: float = 25.91, stiffness: float = 1e4, damping_ratio: float = 0.02) -> Structure:
    """Return n equal masses in a row with one damping ratio in every mode: a five-storey building known in closed form.

    w_j = 2 sqrt(k / m) sin((2 j - 1) pi / (2 (2 n + 1))). With 5 masses, 100 samples per second, white force on every mass and
    measured accelerations it is the example that the pyOMA packages publish results for.

    Parameters
    ----------
    n : int
        Number of masses.
    mass : float
        Of each, kg.
    stiffness : float
        Of every spring, N/m.
    damping_ratio : float
        Of every mode.
    """
    return chain(np.full(n, mass), np.full(n, stiffness), damping_ratios=damping_ratio, dt=0.01, name="spring_chain")
