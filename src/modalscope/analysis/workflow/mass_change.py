"""Scale the modes of an ambient test to unit modal mass by a second test with known masses added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modalscope.analysis.workflow.pairing import pair_modes
from modalscope.data.geometry import indices_of
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Candidate, Note
from modalscope.data.shown import percent
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, RealArray, check_number
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.numerics.orthonormal import most_real

#: Reason and remedy for a mode that is not scaled.
_UNMOVED_REASON = (
    "its frequency did not move as a mass moves it: down, by what the masses do in its shape",
    "Put larger masses where it moves most, or measure longer",
)
_UNPAIRED_REASON = ("it has no partner among the modes of the changed structure", "Identify it in both tests")


@named(modes=ModalModel, changed=ModalModel, masses=Mapping)
def scale_by_mass(modes: ModalModel, changed: ModalModel, masses: Mapping[str, float]) -> ModalModel:
    """Scale the modes of an ambient test to unit modal mass by a second test with known masses added.

    K phi_r = w_r^2 M phi_r before and K psi = w^2 (M + dM) psi after the change give (w_r^2 - w^2) phi_r' M psi = w^2 phi_r' dM psi. With
    phi_r = a_r psi_r and the changed shape as a sum of those before, psi = sum_s q_s psi_s (least squares over the outputs),

        a_r^2 = q_r (w_r^2 - w^2) / (w^2 psi_r' dM psi),

    which is exact where the shape after the change is a sum of those before, and for a shape that did not change the usual
    (w_r^2 - w^2) / (w^2 psi_r' dM psi_r). Shapes are taken as real; w is the modulus of the pole.

    Parameters
    ----------
    modes : ModalModel
        Before the change.
    changed : ModalModel
        With the masses added, of the same outputs; modes are paired by frequency and shape.
    masses : mapping of output label to float
        Mass in kg that was added at each output (a negative one was taken away), effective in the direction of that output: a mass at a
        point that is measured in three directions stands there three times.

    Returns
    -------
    ModalModel
        Shapes of unit modal mass, participation of forces at all outputs: `frequency_response(f)` is that of forces. Modes
        that the masses did not move as masses do are in `left_out`.

    Raises
    ------
    DataError
        No mass, an output that is not there, or no mode that both tests have.

    References
    ----------
    Parloo, Verboven, Guillaume and Van Overmeire, "Sensitivity-based operational mode shape normalisation", Mechanical Systems and
    Signal Processing 16, 2002 (the first order); Bernal, "Modal scaling from known mass perturbations", Journal of Engineering
    Mechanics 130, 2004 (the projection).

    Examples
    --------
    >>> from modalscope.systems import chain
    >>> before, after = chain([1, 1], [400, 400]).modes(), chain([1.05, 1], [400, 400]).modes()
    >>> scaled = scale_by_mass(before.normalized("unit"), after.normalized("unit"), {"1:+X": 0.05})
    >>> np.allclose(np.abs(scaled.shapes), np.abs(before.shapes))
    True
    """
    pairs = pair_modes(modes, changed)
    added = _masses(masses, pairs.a.output_dofs)
    if not len(pairs.first):
        raise DataError(
            "modes before and after a change of mass:",
            f"none of the {len(modes)} modes before is one of the {len(changed)} after",
            "Give two tests of one structure; smaller masses move the modes less.",
        )
    before, after = _real(pairs.a.shapes), _real(pairs.b.shapes)
    w, moved = (2 * np.pi * f for f in (pairs.a.frequencies[pairs.first], pairs.b.frequencies[pairs.second]))
    q = np.linalg.lstsq(before, after[:, pairs.second], rcond=None)[0]
    own = q[pairs.first, np.arange(len(pairs.first))]
    work = np.sum(before[:, pairs.first] * added[:, None] * after[:, pairs.second], axis=0)
    squared = own * (w**2 - moved**2) / (moved**2 * np.where(work == 0, np.inf, work))
    good = squared > 0
    # the deviation of a is the deviation of half the relative change of w_r^2 - w^2
    spread = _spread(pairs.a, pairs.first, w) + _spread(pairs.b, pairs.second, moved)
    apart = np.sqrt(spread) / np.abs(w**2 - moved**2)
    kept = pairs.first[good]
    phi = _real(modes.shapes)[:, kept] * np.sqrt(squared[good])
    scaled = _of_unit_mass(modes.take(kept), phi)
    lost = [_lost(modes, int(r), *_UNMOVED_REASON) for r in pairs.first[~good]]
    lost += [_lost(modes, int(r), *_UNPAIRED_REASON) for r in pairs.alone[0]]
    return replace(
        scaled, left_out=(*modes.left_out, *lost), notes=(*modes.notes, *_notes(scaled, masses, apart[good]))
    )


def _masses(masses: Mapping[str, float], outputs: tuple[str, ...]) -> RealArray:
    """Return the mass at every output, (l,)."""
    added = np.zeros(len(outputs))
    for place, (dof, mass) in zip(indices_of("mass at", tuple(masses), outputs), masses.items(), strict=True):
        added[place] += check_number(f"the mass at {dof}", mass)
    if not np.any(added):
        raise DataError("a change of mass:", "none is given", 'Give kg at outputs: masses={"3:+Z": 12.5}.')
    return added


def _real(shapes: ComplexArray) -> RealArray:
    """Return shapes turned as near to the real axis as they come, of length one."""
    real = most_real(shapes).real
    return np.asarray(real / np.maximum(np.linalg.norm(real, axis=0), np.finfo(float).tiny))


def _spread(modes: ModalModel, which: np.ndarray[tuple[int], np.dtype[np.int64]], w: RealArray) -> RealArray:
    """Return the variance of w^2; NaN where it is not known."""
    if modes.frequencies_std is None:
        return np.full(w.size, np.nan)
    return (2 * w * 2 * np.pi * modes.frequencies_std[which]) ** 2


def _of_unit_mass(modes: ModalModel, phi: RealArray) -> ModalModel:
    """Return modes with shapes of unit modal mass: a displacement has the residues phi phi' / (2 j w_d)."""
    power = QUANTITIES[modes.quantity or "displacement"]
    damped = modes.poles.imag
    participation = (phi * modes.poles**power / (2j * np.where(damped == 0, np.inf, damped))).T
    return replace(
        modes,
        shapes=phi.astype(complex),
        shapes_std=None,
        participation=participation,
        feedthrough=phi @ phi.T if power == 2 else None,
        lower_residual=None,
        upper_residual=None,
        residual_terms=(),
        dt=None,
        held_input=False,
        input_dofs=modes.output_dofs,
        units=(modes.units[0], ("N",) * len(modes.output_dofs)),
        scaling="unit modal mass, by a change of mass",
        unrefined=None,
    )


def _lost(modes: ModalModel, r: int, reason: str, remedy: str) -> Candidate:
    f, zeta = float(modes.frequencies[r]), float(modes.damping_ratios[r])
    return Candidate(frequency=f, damping_ratio=zeta, reason=reason, remedy=remedy)


def _notes(modes: ModalModel, masses: Mapping[str, float], apart: RealArray) -> tuple[Note, ...]:
    where = ", ".join(f"{mass:g} kg at {dof}" for dof, mass in list(masses.items())[:6])
    text = f"scaled to unit modal mass by {where}; modes that were not identified are missing in this scaling"
    notes = [Note("scaled", {}, text)]
    known = np.isfinite(apart)
    if np.any(known):
        words = ", ".join(
            f"{percent(x, 2)} at {f:.5g} Hz" for f, x in zip(modes.frequencies[known], apart[known], strict=True)
        )
        notes.append(Note("modal mass", {}, f"standard deviations of modal masses, from those of frequencies: {words}"))
    return tuple(notes)
