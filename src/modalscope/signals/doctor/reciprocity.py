"""Exchange inputs and outputs of a response by reciprocity, H_ij = H_ji: a roving hammer is identified as roving sensors.

A mode of m inputs and l outputs has l components of the shape and m of the participation. With fewer outputs than inputs most of what was
measured would stand in the participation: one sensor gives no shape at all, and rows with few outputs separate close modes poorly.
Exchanged, the drive points are the points of the shape. Maxwell and Betti's theorem holds for linear structures without gyroscopic
forces, between forces and the motions that work with them: it is asked of responses to forces, each by itself, never of records whose
inputs act together.
"""

from __future__ import annotations

from modalscope.data.channels import input_groups
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.shown import counted
from modalscope.data.units import in_si
from modalscope.numerics.errors import DataError
from modalscope.signals.doctor.polarity import check_polarity

#: Findings at points that were both driven and measured which contradict reciprocity; a sign alone does not.
_CONTRADICTIONS = ("reciprocity", "swapped")


def by_reciprocity(response: Response, reciprocal: bool | None) -> tuple[Response, tuple[Note, ...]]:
    """Return a response with inputs and outputs exchanged where that was asked or helps, and a note.

    `reciprocal`: True exchanges, False keeps; None exchanges where the inputs outnumber the outputs and nothing contradicts.

    Raises `DataError`: an exchange was asked of what is not reciprocal: correlations, free decays, inputs that are no forces.
    """
    if reciprocal is False or response.exchanged:
        return response, ()
    outputs, inputs = len(response.output_dofs), len(response.input_dofs)
    if reciprocal is None and (inputs <= outputs or not response.reciprocal):
        return response, ()
    obstacle = _obstacle(response)
    if reciprocal is None:
        obstacle = obstacle or next(
            (f"{f.reason} at {', '.join(f.channels)}" for f in check_polarity(response) if f.kind in _CONTRADICTIONS),
            "",
        )
        if obstacle:
            text = (
                f"{counted(inputs, 'input')} and {counted(outputs, 'output')} not exchanged by reciprocity: {obstacle}"
            )
            return response, (Note("not exchanged", {"inputs": inputs, "outputs": outputs}, text),)
    elif obstacle:
        raise DataError("an exchange of inputs and outputs:", obstacle, "Leave out reciprocal=True.")
    text = f"Exchanged by reciprocity: shapes are over {inputs} drive points, not {outputs} sensors (else: --no-reciprocal)"
    return response.transposed(), (Note("exchanged", {"inputs": inputs, "outputs": outputs}, text),)


def _obstacle(response: Response) -> str:
    """Return why a response is not exchanged; empty where it may be."""
    if not response.reciprocal:
        return "columns are references or initial conditions, not forces"
    for side, units in zip(("outputs", "inputs"), response.units, strict=True):
        if len(set(units)) > 1:
            return f"the {side} differ in units: {', '.join(sorted(set(units)))}"
    driven_by = in_si(response.units[1][0])
    if driven_by is not None and driven_by.kind != "force":
        return f"inputs in {response.units[1][0]} are no forces"
    if response.groups not in (None, input_groups(response.input_dofs)):
        return "groups label the inputs"
    return ""
