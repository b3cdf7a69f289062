"""Residues of all modes fitted together: shapes and participation in turn, each by least squares with the other held."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.model.checks import Array, ComplexArray
from modalscope.model.response import Response

__all__ = ["joint_residues"]

#: The fit goes on while a round lowers the squared misfit by this part of it ...
_GAIN = 1e-3

#: ... and this many rounds at most: each costs as much as one fit of participation on the compressed data.
_ROUNDS = 30


#: Poles (n,), shapes (l, n) and participation (n, m).
_Modes = tuple[Array, Array, Array]


def joint_residues(
    response: Response, poles: Array, shapes: Array, held: _Modes | None = None
) -> tuple[ComplexArray, dict[str, Any]]:
    """Fit residues of rank one, R_j = c_j l_j, of all modes together to all data; poles are kept.

    min over c, l, terms of sum |Y - sum_j (c_j l_j g_j + conjugate) - terms|^2, from the given shapes on: participation with the
    shapes held, then shapes with the participation held, and so on. No round can raise the misfit, so that the result explains at
    least what the given shapes explain. The data are compressed once to as many rows as there are functions.

    Parameters
    ----------
    response : Response
    poles : array of complex, (n,)
        rad/s, as the modes have them.
    shapes : array of complex, (l, n)
        Where to start.
    held : (array (k,), array (l, k), array (k, m)), optional
        Poles, shapes and participation of modes whose residues are known: they are taken off the data.

    Returns
    -------
    shapes : array of complex, (l, n)
    fields : dict
        `participation` and the direct term or residuals, as a `ModalModel` has them.
    """
    powers = response.outside_powers
    basis = response.basis(poles - response.added_damping, powers)
    if held is not None:
        left = response.left_of(held[0] - response.added_damping, *held[1:], powers)
        basis = replace(basis, data=left, whole=None)
    basis = basis.compressed()
    participation, terms = basis.fit_participation(shapes)
    best = float(np.linalg.norm(basis.data - basis.rebuilt(shapes, participation, terms))) ** 2
    for _ in range(_ROUNDS if len(poles) else 0):
        turned, _ = basis.fit_shapes(participation)
        again, more = basis.fit_participation(turned)
        now = float(np.linalg.norm(basis.data - basis.rebuilt(turned, again, more))) ** 2
        if not now < best:
            break
        shapes, participation, terms, gained, best = turned, again, more, best - now, now
        if gained < _GAIN * best:
            break
    return shapes, {"participation": response.of_inputs(participation), **response.named_terms(terms, powers)}
