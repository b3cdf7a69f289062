"""The first terms D, CB, CAB, ... of a response where they are known, in the plane of its matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.plane import Plane
from modalscope.model.channels import derivatives_between, known_quantity
from modalscope.model.checks import DataError, RealArray, real_array
from modalscope.model.frequency import FrequencyResponse

__all__ = ["initial_terms", "rest_at_start"]


def rest_at_start(quantity: str | None, outputs: int, inputs: int) -> RealArray:
    """Return the initial terms D, CB, ... that vanish for a structure at rest: two for displacements, one for velocities."""
    own = known_quantity(quantity, "initial_values='rest' was asked")
    return np.zeros((derivatives_between(own, "acceleration"), outputs, inputs))


def initial_terms(given: ArrayLike | str, response: FrequencyResponse, plane: Plane) -> RealArray:
    """Return the known terms scaled to the plane: H = D + sum_i M_i / x^(i+1), x = s / scale or z."""
    _, outputs, inputs = response.values.shape
    if plane.scale is None:
        raise DataError(
            "initial_values were asked",
            "under the bilinear map the direct term and the initial values mix",
            "Use domain='s', or leave them out: they are eliminated.",
        )
    if isinstance(given, str):
        if given != "rest" or plane.dt is not None:
            raise DataError(
                f"initial_values={given!r} was asked",
                f"there are arrays, and 'rest' in the s-domain (this is the {plane.name})",
                "Give the terms (K, outputs, inputs), or leave them out.",
            )
        return rest_at_start(response.quantity, outputs, inputs)
    terms = real_array("initial_values", given, "(terms, outputs, inputs)", 3)
    if terms.shape[1:] != (outputs, inputs):
        raise DataError(
            f"initial_values needs shape (terms, {outputs}, {inputs})",
            f"it has {terms.shape}",
            "Give one matrix a term: D, CB, CAB, ...",
        )
    return np.asarray(terms / plane.scale ** np.arange(len(terms))[:, None, None])
