"""Model a clamped beam by Euler-Bernoulli finite elements."""

from __future__ import annotations

import numpy as np

from modalscope.numerics.arguments import POSITIVE, named
from modalscope.numerics.checks import RealArray, check_count
from modalscope.numerics.resources import check_fits
from modalscope.systems.chains import row_geometry
from modalscope.systems.modal import modal_damping
from modalscope.systems.structure import Structure

#: What holds the beam's far end, and which of its two motions (deflection, slope) that leaves free.
FAR_ENDS = {"free": (True, True), "pinned": (False, True), "clamped": (False, False)}

#: Aluminium, a bar of 1 m by 40 mm by 10 mm that bends about its weak axis: Pa, kg/m3, m.
_MODULUS, _DENSITY, _LENGTH, _WIDTH, _HEIGHT = 70e9, 2700.0, 1.0, 0.04, 0.01


@named(far_end=tuple(FAR_ENDS), length=POSITIVE, bending_stiffness=POSITIVE, mass_per_length=POSITIVE)
def clamped_beam(
    elements: int = 20,
    *,
    far_end: str = "free",
    length: float = _LENGTH,
    bending_stiffness: float = _MODULUS * _WIDTH * _HEIGHT**3 / 12,
    mass_per_length: float = _DENSITY * _WIDTH * _HEIGHT,
    damping_ratio: float = 0.005,
) -> Structure:
    """Return a beam that is clamped at one end, by finite elements with cubic deflection and consistent mass.

    Parameters
    ----------
    elements : int
        Number of elements; with e elements the lowest e / 2 modes or so are right to a per mille.
    far_end : {"free", "pinned", "clamped"}
        What holds the other end.
    length : float
        m.
    bending_stiffness : float
        E I, N m2; an aluminium bar of 40 mm by 10 mm by default.
    mass_per_length : float
        kg/m.
    damping_ratio : float
        Of every mode.

    Returns
    -------
    Structure
        Degrees of freedom `1:+Z`, `1:+RY` ... for the deflection (m) and the slope dz/dx of every node that moves; the
        deflections are outputs and inputs. Sampled at 4096 Hz.

    Examples
    --------
    >>> clamped_beam().modes().frequencies[:3].round(2).tolist()
    [8.23, 51.55, 144.33]
    """
    free_end = FAR_ENDS[far_end]
    count = check_count("elements", elements, least=1 if far_end != "clamped" else 2)
    check_fits(f"a beam of {count} elements", 2 * 8.0 * (2 * count + 2) ** 2, "Give fewer elements.")
    h = length / count
    K_element, M_element = _element(h)
    K, M = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for e in range(count):
        here = slice(2 * e, 2 * e + 4)
        K[here, here] += bending_stiffness / h**3 * K_element
        M[here, here] += mass_per_length * h / 420 * M_element
    moving = np.r_[np.zeros(2, bool), np.ones(2 * count - 2, bool), np.array(free_end)]
    labels = [f"{node}:{direction}" for node in range(count + 1) for direction in ("+Z", "+RY")]
    dofs = tuple(label for label, moves in zip(labels, moving, strict=True) if moves)
    deflections = tuple(i for i, label in enumerate(dofs) if label.endswith("Z"))
    K, M = K[np.ix_(moving, moving)], M[np.ix_(moving, moving)]
    return Structure(
        mass=M,
        stiffness=K,
        damping=modal_damping(M, K, damping_ratio),
        outputs=deflections,
        inputs=deflections,
        dofs=dofs,
        dt=1 / 4096,
        geometry=row_geometry(count, spacing=h),
        name="clamped_beam",
    )


def _element(h: float) -> tuple[RealArray, RealArray]:
    """Return stiffness over E I / h^3 and mass over rho A h / 420 for deflection and slope at both ends (Hermite cubics)."""
    K = np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h**2, -6 * h, 2 * h**2],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2],
        ]
    )
    M = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    return K, M
