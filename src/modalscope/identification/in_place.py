"""What data say of modes that stay where they are: how far noise and repetitions of the test leave them open."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.identification.refined import refined
from modalscope.identification.settling import settle, task_of
from modalscope.model.checks import Array
from modalscope.model.groups import AUTO, check_groups
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response

__all__ = ["in_place"]


def in_place(response: Response, modes: ModalModel, fixed: Array, groups: Any = AUTO) -> ModalModel:
    """Return modes by frequency with both deviations, poles unmoved: information and scores of the likelihood are those at their place.

    Each group of inputs or runs pulls a value its own way; how far the pulls differ is the repeatability, whether or not they add to zero.

    Parameters
    ----------
    response : Response
    modes : ModalModel
        Decaying oscillations, with participation.
    fixed : array of complex, (k,)
        rad/s: poles that take part beside them.
    groups : "auto", None or sequence of labels
        As in `refine`.
    """
    added = response.added_damping
    task = task_of(response, np.asarray(fixed, dtype=np.complex128) - added, None, None)
    participation = modes.participation
    if participation is None or participation.shape[1] != response.drives:
        basis = response.basis(modes.poles - added, response.outside_powers)
        participation = basis.fit_participation(modes.shapes)[0]
    settled = settle(task, modes.poles - added, modes.shapes, participation, most=0)
    return refined(task, modes, settled, check_groups(groups, *response.parts, response.groups), [], [])
