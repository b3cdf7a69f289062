"""What mode shapes are scaled to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.model.channels import derivatives_between
from modalscope.model.checks import ComplexArray, DataError
from modalscope.model.response_facts import CORRELATED, UNTOLD

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["NORMALIZATIONS", "shape_factor"]

#: What shapes can be scaled to (see `ModalModel.normalized`).
NORMALIZATIONS = ("unit", "max", "mass", "none")


def shape_factor(modes: ModalModel, scale: str) -> tuple[ComplexArray, str]:
    """Return the factor (n,) that shapes are divided by to be scaled as asked, and what they are scaled to, in words."""
    if scale == "mass":
        return _mass_factor(modes)
    largest = modes.shapes[np.argmax(np.abs(modes.shapes), axis=0), np.arange(len(modes))]
    if scale == "max":
        return np.where(largest == 0, 1, largest), "largest component 1"
    norm = np.linalg.norm(modes.shapes, axis=0)
    sign = np.where(largest == 0, 1, largest / np.where(largest == 0, 1, np.abs(largest)))
    return sign * np.where(norm == 0, 1, norm), "length 1, largest component real"


def _mass_factor(modes: ModalModel) -> tuple[ComplexArray, str]:
    """Return the factor of unit modal mass, phi_d^2 = 2 j w_d R_dd at each mode's largest driving point d."""
    part = modes.known_participation("unit modal mass")
    if any(step.startswith(CORRELATED) for step in modes.processing):
        raise DataError(
            "shapes of unit modal mass were asked",
            "no force was measured: participation is the correlation of each mode with references",
            "Measure again with known masses added, and give both to scale_by_mass.",
        )
    common = [dof for dof in modes.output_dofs if dof in modes.input_dofs]
    untold = {dof for note in modes.notes if note.kind == UNTOLD for dof in note.numbers}
    if common and untold.issuperset(common):
        raise DataError(
            "shapes of unit modal mass were asked",
            f"the driving points {', '.join(common)} are inputs whose shares in the response the record does not tell",
            "Drive each of them by a force of its own, or leave out what is no force of its own: exclude=[...].",
        )
    common = [dof for dof in common if dof not in untold]
    if not common:
        raise DataError(
            "shapes of unit modal mass were asked",
            "no output has the label of an input: no driving point",
            "Measure one, or give it the same label on both sides.",
        )
    power = derivatives_between(modes.quantity, "displacement")
    rows = [modes.output_dofs.index(dof) for dof in common]
    columns = [modes.input_dofs.index(dof) for dof in common]
    driving = np.abs(modes.shapes[rows] * part.T[columns])
    best, each = np.argmax(driving, axis=0), np.arange(len(modes))
    shape, weight = modes.shapes[rows][best, each], part.T[columns][best, each]
    residue = shape * weight * modes.poles**power
    if modes.held_input and modes.dt:  # an input held over dt gives R (exp(s dt) - 1) / s of a structure's residue R
        residue = residue * modes.poles / np.expm1(modes.poles * modes.dt)
    target = np.sqrt(2j * np.abs(modes.poles.imag) * residue)
    # of the two roots the one that leaves the mode nearest to its own phase
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(target == 0, 1, shape / np.where(target == 0, 1, target))
    return np.asarray(factor), f"unit modal mass, driving point {', '.join(common)}"
